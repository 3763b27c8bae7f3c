//! Simulation: a scene, or a train built in Rust, ready to run.
//!
//! A [`Simulation`] holds a train, its start and the settings of its run. [`Simulation::run`] returns a [`RunRecord`] with measures and
//! events. [`Simulation::write`] writes the files of `flank run`. A [`Job`] sets the options of one run.
//!
//! The borrowing types behind it ([`Structure`], [`Engine`], observers) stay public, for direct control of a run.

mod error;
mod job;
mod parameter;
mod report;
mod rows;
mod samples;
mod summary;
mod tables;
mod variation;

use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde_json::{Value, json};

pub use error::SimulationError;
pub use job::{Job, RunRecord};
pub use parameter::Parameter;
pub use report::{ContactAtStart, MeshOfTeeth, Mode, Order, Report, Share, Speed};
pub use rows::{EVENT_COLUMNS, EventColumn, EventValues, event_head, event_lines};
pub(crate) use samples::CancelObserver;
pub use samples::SampleTable;
pub use summary::{EndKind, IntegratorUsed, Provenance, RunEnd, Summary, TrainUsed};

use crate::{
    engine::{Engine, Observer, Options, State},
    gear::contact::Law,
    hybrid::{Clock, ContactView, HybridSystem, Instant, Watch, Wide},
    integrate::{Integrator, build, reason},
    scene::{BuiltScene, Duration, Fault, Memory, Run, Scene, SceneError, ToothMesh, Warning, hash},
    system::{ContactMode, Spec, Structure, bonded_modes},
    train::Drawing,
    verify::Verifier,
};

/// Phase, rad, that a step covers of the fastest oscillation: measured at a linear wall, over 2e3 and 2e4 rad.
const RADIANS_PER_STEP: f64 = 2.4;

/// Condition number of a scaled mass matrix above which a warning tells of the rounding of its entries: it costs 1e-10 of a period.
const ILL_CONDITIONED: f64 = 1e6;

/// Train with its start and the settings of its run.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Simulation {
    /// Name in messages and in the summary.
    pub name: String,
    /// The train.
    pub structure: Structure,
    /// Duration and accuracy of the run.
    pub settings: Run,
    /// Coordinates at the start, m, `[n]`.
    pub q0: Vec<f64>,
    /// Velocities at the start, m/s, `[n]`.
    pub v0: Vec<f64>,
    /// Further data of the start: latched speeds and modes of contacts.
    pub memory: Memory,
    /// True if the start is the static equilibrium, so that a changed train starts in its own.
    pub is_static: bool,
    /// True if the train is in dimensionless form.
    pub dimensionless: bool,
    /// Speed of a rotating frame in which the train is written, rad/s.
    pub carrier_speed: Option<f64>,
    /// Meshes with given teeth, in the order of the contacts.
    pub meshes: Vec<ToothMesh>,
    /// Mean speeds of the shafts and the loose gears of a gearbox, rad/s, by name.
    pub speeds: Vec<(String, f64)>,
    /// Train in the form of a picture, if its gears are known.
    pub drawing: Option<Drawing>,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
    /// Remarks on the fit of series to measured curves.
    pub remarks: Vec<Warning>,
    /// Faults of a start that does not fit the train.
    start_faults: Vec<Fault>,
    /// Periods of the scene's clock in a cycle, and the index of the period with which cycle 0 begins; none unless cycles are common ones.
    common: Option<[u64; 2]>,
    /// Scene with every default; null for a train built in Rust.
    scene: Value,
    /// File of the scene, which no output replaces.
    file: Option<PathBuf>,
}

impl Simulation {
    /// Reads a scene from JSON text.
    ///
    /// # Errors
    /// [`SimulationError::Scene`] with every fault, each with the JSON pointer of its place.
    pub fn from_json(text: &str) -> Result<Self, SimulationError> {
        Self::from_scene(Scene::from_json(text, "scene")?)
    }

    /// Reads a scene file. [`write`](Self::write) never replaces this file.
    ///
    /// # Errors
    /// [`SimulationError::Scene`] with every fault; a file that cannot be read is one.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, SimulationError> {
        Ok(Self::from_scene(Scene::from_file(&path)?)?.read_from(path.as_ref()))
    }

    /// Returns the simulation of a scene. A borrowed scene is copied.
    ///
    /// # Errors
    /// [`SimulationError::Assemble`].
    pub fn from_scene(scene: impl Into<Scene>) -> Result<Self, SimulationError> {
        let (name, scene, built) = scene.into().into_parts();
        let is_static = scene["initial"] == "static";
        Ok(Self { is_static, scene, ..Self::from_built(&name, built)? })
    }

    /// Returns the simulation of a built scene, possibly changed.
    ///
    /// # Errors
    /// [`SimulationError::Assemble`].
    pub fn from_built(name: &str, built: BuiltScene) -> Result<Self, SimulationError> {
        Ok(Self {
            name: name.to_owned(),
            structure: Structure::new(built.spec)?.by(built.run.instructions),
            settings: built.run,
            q0: built.q0,
            v0: built.v0,
            memory: built.memory,
            is_static: false,
            dimensionless: built.dimensionless,
            carrier_speed: built.carrier_speed,
            meshes: built.meshes,
            speeds: built.speeds,
            drawing: built.drawing,
            warnings: built.warnings,
            remarks: built.remarks,
            start_faults: built.start_faults,
            common: None,
            scene: Value::Null,
            file: None,
        })
    }

    /// Returns the simulation of a train built in Rust. It starts at rest with all coordinates zero; [`starting_at`](Self::starting_at)
    /// changes that. A run without a period has that of the train.
    ///
    /// # Errors
    /// [`SimulationError::Assemble`]; [`SimulationError::Missing`] for a run without an end after its start and transient.
    pub fn from_spec(name: &str, spec: Spec, run: Run) -> Result<Self, SimulationError> {
        let period = run.period.or(spec.omega.map(|omega| std::f64::consts::TAU / omega));
        let (n, run) = (spec.freedoms.len(), Run { period, ..run });
        let (q0, v0) = (vec![0.0; n], vec![0.0; n]);
        // A run with cycles but without a period ends at no finite time.
        let measured = run.end() - (run.start_cycle + run.transient_cycles) as f64 * period.unwrap_or(0.0);
        if !(measured > 0.0 && measured.is_finite()) {
            let missing =
                "its run has no end after its start and transient; give it a time or a period, and more cycles";
            return Err(SimulationError::missing(name, missing));
        }
        let (meshes, speeds, warnings, start_faults) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self::from_built(
            name,
            BuiltScene {
                spec,
                q0,
                v0,
                memory: Memory::default(),
                run,
                dimensionless: false,
                carrier_speed: None,
                meshes,
                speeds,
                drawing: None,
                warnings,
                remarks: Vec::new(),
                start_faults,
            },
        )
    }

    /// Returns the same simulation, read from `file`, which its outputs never replace.
    #[must_use]
    pub fn read_from(self, file: &Path) -> Self {
        Self { file: Some(file.to_owned()), ..self }
    }

    /// Starts at these coordinates, m, and velocities, m/s, `[n]` each; its scene is changed accordingly.
    #[must_use]
    pub fn starting_at(mut self, q0: Vec<f64>, v0: Vec<f64>) -> Self {
        if !self.scene.is_null() {
            self.scene["initial"] = json!({ "q": q0, "v": v0 });
        }
        Self { q0, v0, memory: Memory::default(), is_static: false, start_faults: Vec::new(), ..self }
    }

    /// Runs to the end and stores a row of every event, about a kilobyte each.
    ///
    /// # Errors
    /// [`SimulationError`] if the run cannot start, fails, or contradicts itself.
    pub fn run(&self) -> Result<RunRecord, SimulationError> {
        self.job().run()
    }

    /// Returns a run with an observer of the user.
    pub fn observe<'a>(&'a self, observer: &'a mut dyn Observer) -> Job<'a> {
        Job { observer: Some(observer), ..self.job() }
    }

    /// Runs to the end and writes the files of `flank run --out` into `folder`.
    ///
    /// # Errors
    /// Errors of [`run`](Self::run); [`SimulationError::Output`] for a folder that is not empty.
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<RunRecord, SimulationError> {
        self.job().write(folder)
    }

    /// Returns a run, for options of its own.
    pub fn job(&self) -> Job<'_> {
        Job::new(self)
    }

    /// Returns the forcing clock.
    #[must_use]
    pub fn clock(&self) -> &Clock {
        self.structure.clock()
    }

    /// Returns the instants of the start of the run, of the start of its measures, and of its end.
    #[must_use]
    pub fn instants(&self) -> [Instant; 3] {
        self.settings.instants(self.clock())
    }

    /// Returns the forcing period T, s.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] without one.
    pub fn period(&self) -> Result<f64, SimulationError> {
        self.clock().period().map(Wide::value).ok_or_else(|| {
            self.missing(
                "its forcing has no period, so that there are no cycles to compare; give it a forcing with one",
            )
        })
    }

    /// Returns the scene's clock periods (such as mesh periods) per cycle: 1 except after [`in_common_cycles`](Self::in_common_cycles).
    #[must_use]
    pub fn periods_per_cycle(&self) -> u64 {
        self.common.map_or(1, |[periods, _]| periods)
    }

    /// Returns the same simulation with a clock whose cycle is the shortest after which all forcing repeats, from its start: `q` mesh
    /// periods for a run-out of order `1/q`. Orbits, maps and branches count these cycles. A run counts its cycles, and those of its
    /// events, in periods of the scene's clock. A train without a common cycle is unchanged: orbits, maps and branches refuse it.
    ///
    /// # Errors
    /// [`SimulationError::Assemble`].
    pub fn in_common_cycles(self) -> Result<Self, SimulationError> {
        let Ok(periods) = self.structure.common_cycle() else { return Ok(self) };
        if self.structure.has_whole_orders() && periods == 1 {
            return Ok(self);
        }
        let (omega, [start, transient, end]) = (self.clock().omega(), self.instants());
        let mut settings = self.settings.clone();
        let mut first = 0;
        if start.phase.value() == 0.0 && start.cycle >= 0 {
            // OK to convert: cycles are not negative.
            (settings.start_cycle, first) = (start.cycle as u64 / periods, start.cycle as u64 % periods);
            let cycles = |to: Instant| ((to.cycle - start.cycle).max(0) as u64).div_ceil(periods);
            settings.transient_cycles = cycles(transient);
            settings.duration = Duration::Cycles(cycles(end).max(settings.transient_cycles + 1));
            settings.period = self.clock().period().map(|period| (period * periods as f64).value());
        }
        let spec = self.structure.spec().clone().over_cycles(omega, periods, first);
        let structure = Structure::new(spec)?.by(self.settings.instructions);
        Ok(Self { structure, settings, common: Some([periods, first]), ..self })
    }

    /// Returns `spec`, built like this simulation's train, in its clock.
    pub(crate) fn clocked(&self, spec: Spec) -> Result<Structure, SimulationError> {
        let structure = Structure::new(spec)?.by(self.settings.instructions);
        let Some([periods, first]) = self.common else { return Ok(structure) };
        let omega = structure.clock().omega();
        Ok(Structure::new(structure.spec().clone().over_cycles(omega, periods, first))?.by(self.settings.instructions))
    }

    /// Returns the cycles of this simulation in `periods` periods of the scene's clock, but not fewer than `least`.
    pub(crate) fn cycles_in(&self, periods: u64, least: u64) -> u64 {
        let own = self.periods_per_cycle();
        if own == 1 { periods } else { periods.div_ceil(own).max(least) }
    }

    /// Returns words for a freedom: its body and its direction.
    #[must_use]
    pub fn in_words(&self, freedom: &str) -> String {
        let (stem, body) = freedom.split_once('_').unwrap_or((freedom, ""));
        let body = match (self.kind(), body) {
            ("planetary", "s") => "the sun".to_owned(),
            ("planetary", "r") => "the ring".to_owned(),
            ("planetary", "c") => "the carrier".to_owned(),
            ("planetary", "") => "the planets".to_owned(),
            ("planetary", number) => format!("planet {number}"),
            ("gear-pair", number) => format!("gear {number}"),
            ("gearbox", name) => name.to_owned(),
            _ => return format!("displacement {freedom}"),
        };
        match stem {
            "x" | "y" => format!("displacement {stem} of {body}"),
            "xi" => format!("radial displacement of {body}"),
            "eta" => format!("tangential displacement of {body}"),
            "u" => format!("rotation of {body}, on the base circle"),
            "w" => format!("axial displacement of {body}"),
            _ => format!("displacement {freedom}"),
        }
    }

    /// Returns the error of a measure that the simulation lacks data for.
    #[must_use]
    pub fn missing(&self, missing: impl Into<String>) -> SimulationError {
        SimulationError::missing(&self.name, missing)
    }

    /// Returns the state at the start.
    ///
    /// # Errors
    /// [`SimulationError::Start`]; [`SimulationError::Scene`] if the start of a scene does not fit its train.
    pub fn start(&self) -> Result<State, SimulationError> {
        if !self.start_faults.is_empty() {
            return Err(SceneError { name: self.name.clone(), faults: self.start_faults.clone() }.into());
        }
        let start = self.start_at(&self.q0, &self.v0)?;
        if self.memory == Memory::default() {
            return Ok(start);
        }
        let (structure, mut x) = (&self.structure, start.x);
        for (j, speed) in &self.memory.latched {
            // A simpler model of a train may lack such a contact, or have another law there.
            let known = *j < structure.contact_count();
            let latch =
                known.then(|| structure.latch_on(*j, structure.contact_mode(*j, &start.jump.mode).side())).flatten();
            latch.iter().for_each(|latch| x[*latch] = *speed);
        }
        let state = |j: usize| match structure.contact_mode(j, &start.jump.mode) {
            ContactMode::Drive if self.memory.detached.contains(&j) => ContactMode::DriveDetached,
            ContactMode::Back if self.memory.detached.contains(&j) => ContactMode::BackDetached,
            other => other,
        };
        let states: Vec<ContactMode> = (0..structure.contacts().len()).map(state).collect();
        let resumed = structure.resume(start.at, &x, &states)?;
        Ok(State { at: start.at, x: resumed.x, jump: resumed.jump })
    }

    /// Returns the warning that the run takes more steps than its budget, by the fastest oscillation with every contact open, or closed.
    #[must_use]
    pub fn budget_warning(&self) -> Option<String> {
        let ([from, _, end], structure, run) = (self.instants(), &self.structure, &self.settings);
        let start = self.start().ok()?.jump.mode;
        let rate_with = |state| {
            let mut mode = start.clone();
            (0..structure.contact_count()).for_each(|j| structure.set_contact(&mut mode, j, state));
            structure.rates(&mode).map_or(0.0, |rates| rates.oscillating)
        };
        let fastest = rate_with(ContactMode::Separated).max(rate_with(ContactMode::Drive));
        let steps = |time: f64| fastest * time / RADIANS_PER_STEP;
        let total = steps(self.clock().between(from, end));
        let per_cycle = run.period.map_or(String::new(), |period| format!(", {:.1e} per cycle", steps(period)));
        (total > run.step_budget as f64).then(|| {
            format!(
                "the run needs some {total:.1e} steps{per_cycle}, as its fastest oscillation has {fastest:.3e} rad/s; run.step_budget \
                 allows {}: check stiffness, inertia and speed, run shorter, or raise the budget",
                run.step_budget
            )
        })
    }

    /// Returns the warning of a nearly singular mass matrix: uncertainties of events exclude its rounding.
    fn mass_warning(&self) -> Option<String> {
        let mass = &self.structure.spec().mass;
        let scale = mass.diagonal().map(|m| m.sqrt().recip());
        let scaled = DMatrix::from_diagonal(&scale) * mass * DMatrix::from_diagonal(&scale);
        let inverse = scaled.clone().cholesky()?.inverse();
        let norm = |matrix: &DMatrix<f64>| matrix.column_iter().map(|c| c.lp_norm(1)).fold(0.0, f64::max);
        let condition = norm(&scaled) * norm(&inverse);
        (condition > ILL_CONDITIONED).then(|| {
            format!(
                "the mass matrix is nearly singular, its condition number {condition:.1e} with masses scaled to one: the rounding of its \
                 entries may shift events by up to some {:.0e} of a period, which their uncertainties do not count; choose coordinates with \
                 weaker coupling",
                condition * f64::EPSILON
            )
        })
    }

    /// Returns the warnings about the train and its start, in words.
    #[must_use]
    pub fn warnings_in_words(&self) -> Vec<String> {
        let of_train =
            self.warnings.iter().map(ToString::to_string).chain(self.budget_warning()).chain(self.mass_warning());
        let Ok(start) = self.start() else { return of_train.collect() };
        let structure = &self.structure;
        let hysteretic = structure.contacts().iter().enumerate().filter_map(|(j, c)| match c.spec.law {
            Law::Power(law) if c.latch().is_some() => Some((j, c, law.speed_floor)),
            _ => None,
        });
        let at_rest = hysteretic.filter(|(j, _, floor)| {
            let on = |watch: &Watch| start.jump.pinned.contains(structure.guard_of_contact(*j, watch.side(), *watch));
            let rate = |side: f64| ContactView::deflection(structure, *j, side, start.at, &start.x).1;
            [Watch::DriveFlank, Watch::BackFlank]
                .iter()
                .filter(|watch| on(watch))
                .any(|watch| watch.side() * rate(watch.side()) <= *floor)
        });
        let mut by_floor: Vec<(f64, Vec<&str>)> = Vec::new();
        for (_, c, floor) in at_rest {
            match by_floor.iter_mut().find(|(known, _)| *known == floor) {
                Some((_, names)) => names.push(&c.spec.name),
                None => by_floor.push((floor, vec![&c.spec.name])),
            }
        }
        let of_start = by_floor.into_iter().map(|(floor, names)| {
            format!(
                "{}: exactly on its flank at the start, without an approach speed. Where it closes, it latches its speed floor of {floor:e} \
                 m/s, by which its hysteresis damps very strongly. Start it inside the flank, or give it a speed",
                names.join(", ")
            )
        });
        of_train.chain(of_start).collect()
    }

    /// Returns the state at the start of another motion: coordinates `q`, m, and velocities `v`, m/s, `[n]` each.
    ///
    /// # Errors
    /// [`SimulationError::Start`].
    pub fn start_at(&self, q: &[f64], v: &[f64]) -> Result<State, SimulationError> {
        let at = self.instants()[0];
        let start = self.structure.start(at, q, v)?;
        Ok(State { at, x: start.x, jump: start.jump })
    }

    /// Returns an engine at `state` at full precision, with the integrator and the other limits of the run, for orbits, exponents and maps.
    ///
    /// # Errors
    /// [`SimulationError::Integrator`].
    pub fn engine(&self, state: State) -> Result<Engine<'_>, SimulationError> {
        let options = Options { event_tolerance: 0.0, ..self.options() };
        Ok(Engine::new(&self.structure, self.integrator()?, options, state))
    }

    /// Returns the engine of a run, with another limit on events, and the reason for its integrator.
    ///
    /// # Errors
    /// [`SimulationError::Integrator`].
    pub fn limited(&self, state: State, max_events: u64) -> Result<(Engine<'_>, String), SimulationError> {
        let options = Options { max_events, ..self.options() };
        let why = reason(self.settings.method, self.settings.tolerance, &self.structure);
        Ok((Engine::new(&self.structure, self.integrator()?, options, state), why))
    }

    /// Returns the limits of a run.
    #[must_use]
    pub fn options(&self) -> Options {
        let run = &self.settings;
        Options {
            max_events: run.event_budget,
            max_steps: run.step_budget,
            event_tolerance: run.event_tolerance,
            period: run.period,
            chatter_speed: run.chatter_speed.unwrap_or(0.0),
            ..Options::default()
        }
    }

    /// Returns the integrator of the run.
    ///
    /// # Errors
    /// [`SimulationError::Integrator`].
    pub fn integrator(&self) -> Result<Box<dyn Integrator>, SimulationError> {
        Ok(build(self.settings.method, self.settings.tolerance, &self.structure)?)
    }

    /// Returns the checker of a run from `state`.
    #[must_use]
    pub fn verifier(&self, state: &State) -> Verifier<'_, Structure> {
        Verifier::new(&self.structure, state, self.time_unit(), self.settings.method)
    }

    /// Returns the time, s, to which the accuracy of a check refers: the forcing period, else that of the highest natural frequency with
    /// all linear contacts closed. Rigid contacts and power laws have no frequency; a train with nothing else has no such time.
    fn time_unit(&self) -> Option<f64> {
        let natural = || {
            let mut spec = self.structure.spec().clone();
            spec.contacts.retain(|c| c.law.is_linear());
            let highest = bonded_modes(&spec).ok()?.omega.last().copied().filter(|omega| *omega > 0.0)?;
            Some(std::f64::consts::TAU / highest)
        };
        self.clock().period().map(Wide::value).or_else(natural)
    }

    /// Returns the index of the degree of freedom called `name`.
    ///
    /// # Errors
    /// [`SimulationError::Missing`].
    pub fn freedom(&self, name: &str) -> Result<usize, SimulationError> {
        let freedoms = &self.structure.spec().freedoms;
        freedoms
            .iter()
            .position(|freedom| freedom == name)
            .ok_or_else(|| self.missing(format!("it has no freedom {name}; it has {}", freedoms.join(", "))))
    }

    /// Returns `at`, moved to the start of its cycle, for the state of another simulation.
    pub(crate) fn cycle_start(&self, at: Instant) -> Instant {
        self.clock().at(at.cycle, 0.0)
    }

    /// Returns the scene with every default; null for a train built in Rust.
    #[must_use]
    pub fn resolved(&self) -> &Value {
        &self.scene
    }

    /// Returns the SHA-256 of the scene, as [`Scene::hash`]; none for a train built in Rust.
    #[must_use]
    pub fn hash(&self) -> Option<String> {
        (!self.scene.is_null()).then(|| hash(&self.scene))
    }

    /// Returns the title of the scene, or else the name.
    #[must_use]
    pub fn title(&self) -> &str {
        self.scene["name"].as_str().filter(|name| !name.is_empty()).unwrap_or(&self.name)
    }

    /// Returns the kind of train of the scene; `spec` for a train built in Rust.
    #[must_use]
    pub fn kind(&self) -> &str {
        self.scene["train"]["kind"].as_str().unwrap_or("spec")
    }

    /// Returns a unit, or an empty text for a dimensionless train.
    #[must_use]
    pub fn unit(&self, name: &'static str) -> &'static str {
        if self.dimensionless { "" } else { name }
    }

    /// Returns the states of all contacts, such as `drive, separated`.
    #[must_use]
    pub fn mode_name(&self, mode: &crate::hybrid::Mode) -> String {
        let names = (0..self.structure.contact_count()).map(|j| self.structure.contact_mode(j, mode).name());
        names.collect::<Vec<_>>().join(", ")
    }
}
