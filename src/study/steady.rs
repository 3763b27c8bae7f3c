//! Steady motion of a scene, with its measures.

use serde::{Deserialize, Serialize};

use super::StudyError;
use crate::{
    analysis::{
        BearingReport, Bearings, ContactReport, Contacts, Grid, Sample, Spectrum, Trajectory, TransmissionError,
        Window, cycles_later, of_train,
    },
    engine::{Engine, Observer, Outcome, State},
    hybrid::{Clock, ContactMode, ContactView, Instant},
    orbit::{Approach, ApproachEnd, Motion, Section, SectionMap, WatchTime, decide, decide_on_torus},
    scene::Scene,
    simulation::Simulation,
    system::Structure,
    task::Task,
};

/// Rule for the end of the transient, with the numbers of cycles measured after it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rule {
    /// Criterion for a periodic motion.
    #[serde(flatten)]
    pub approach: Approach,
    /// True if a motion that approaches no orbit is run on until its kind is decided: some thousand cycles.
    pub decides: bool,
    /// Least number of cycles measured of a periodic motion; whole periods.
    pub measured_cycles: u64,
    /// Cycles measured of an irregular motion.
    pub irregular_cycles: u64,
    /// Maximum number of cycles that decide on the kind of a motion without an orbit, at least 2000; without limit if none.
    #[serde(skip)]
    pub watched_cycles: Option<u64>,
}

impl Rule {
    fn watching(&self) -> WatchTime {
        let usual = WatchTime::default();
        // Averages over fewer cycles than the usual first ones do not decide.
        let most = self.watched_cycles.unwrap_or(u64::MAX);
        WatchTime { doublings: usual.doublings.min((most / usual.cycles).max(1).ilog2()), ..usual }
    }
}

impl Default for Rule {
    fn default() -> Self {
        Self {
            approach: Approach::default(),
            decides: true,
            measured_cycles: 4,
            irregular_cycles: 200,
            watched_cycles: None,
        }
    }
}

/// State of one run, from which another one can start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seed {
    /// State `(q, q̇, latched speeds)` at the start of a cycle, SI units.
    pub x: Vec<f64>,
    /// States of the contacts.
    pub contacts: Vec<ContactMode>,
}

impl Seed {
    /// Returns the seed of another run of `structure` from `state`.
    pub(super) fn of(structure: &Structure, state: &State) -> Self {
        let contacts = (0..structure.contact_count()).map(|j| structure.contact_mode(j, &state.jump.mode)).collect();
        Self { x: state.x.clone(), contacts }
    }
}

/// Steady motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Steady {
    /// Forcing period, s.
    pub period_s: f64,
    /// Kind of the motion, and the cycles until it was known.
    pub motion: Motion,
    /// True if it started from the seed; a seed that does not fit is dropped, and the scene's own start is used.
    pub seeded: bool,
    /// Cycles measured.
    pub measured_cycles: u64,
    /// Events in them.
    pub events: u64,
    /// Grazes in them.
    pub grazes: u64,
    /// Measures of each contact.
    pub contacts: Vec<ContactSteady>,
    /// Forces of the bearings.
    pub bearings: Vec<BearingReport>,
    /// Final state, at the start of a cycle.
    #[serde(skip)]
    pub end: Seed,
}

/// Steady motion of one contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ContactSteady {
    /// Measures over the measured cycles.
    #[serde(flatten)]
    pub report: ContactReport,
    /// Mean of the dynamic transmission error, m.
    pub transmission_mean: f64,
    /// RMS value of its difference from the mean, m.
    pub transmission_rms: f64,
    /// Difference of its largest and smallest values, m.
    pub transmission_peak_to_peak: f64,
    /// Half the difference of largest and smallest force, N.
    pub force_amplitude: f64,
    /// Amplitudes of the force at 1, 2, … times the forcing frequency, N.
    pub force_harmonics: Vec<f64>,
    /// Deflections at the starts of the measured cycles, m: the section.
    pub section: Vec<f64>,
}

impl Steady {
    /// Returns the first contact whose name starts with `stem`.
    #[must_use]
    pub fn contact(&self, stem: &str) -> Option<&ContactSteady> {
        self.contacts.iter().find(|contact| contact.report.name.starts_with(stem))
    }

    /// Returns the same contact; an error if `scene` does not have it.
    pub(super) fn expect(&self, stem: &str, scene: &Scene) -> Result<&ContactSteady, StudyError> {
        let missing = || StudyError::missing(scene.name(), format!("it has no contact {stem}"));
        self.contact(stem).ok_or_else(missing)
    }
}

/// Samples of the force per cycle.
const PER_CYCLE: u32 = 256;
/// Least number of cycles run if a cycle has several periods of the scene's clock: until an orbit is found, and for a first average.
const COMMON_CYCLES: u64 = 8;
const WATCHED_COMMON_CYCLES: u64 = 200;
/// Periods of the clock in the longest common cycle of all forcing that is followed. Longer ones are treated as a torus: an orbit needs
/// several cycles to be found, and its word and sections fill the row.
const LONGEST: u64 = 1000;
/// Number of harmonics.
const HARMONICS: usize = 8;

/// Runs `scene` until its transient is over, and measures the steady motion.
///
/// With a seed, the motion starts from there (at the start of the scene's first cycle). A branch of solutions can so be followed through
/// changes of the scene.
///
/// # Errors
/// [`StudyError`]; [`StudyError::Interrupted`] once `task` is cancelled.
pub fn steady(scene: impl Into<Scene>, seed: Option<&Seed>, rule: &Rule, task: Task<'_>) -> Result<Steady, StudyError> {
    let scene = Simulation::from_scene(scene)?;
    if let Some(why) = long_cycle(&scene) {
        return on_torus(&scene, seed, rule, &why, task);
    }
    let common = scene.clone().in_common_cycles()?;
    let (start, seeded) = start(&common, seed)?;
    let verifier = |state: &State| common.settings.verify.then(|| common.verifier(state));
    let mut check = verifier(&start);
    let steady = transient(&common, start, rule, &mut check, task).and_then(|(mut engine, motion)| {
        if motion.period.is_some() {
            // The motion continues from the orbit, a state that the run has not passed.
            check.as_mut().map_or(Ok(()), |check| check.finish(engine.state().at))?;
            check = verifier(engine.state());
        }
        if common.periods_per_cycle() == 1 {
            let steady = measure(&common, &mut engine, motion, (seeded, rule), &mut check, task)?;
            check.as_mut().map_or(Ok(()), |check| check.finish(engine.state().at))?;
            return Ok(steady);
        }
        // Measures refer to periods of the scene's clock. The forcing is that of its first cycle.
        let section = SectionMap::new(&common)?.section(engine.state());
        let start = SectionMap::new(&scene)?.state(&section)?;
        let mut check = scene.settings.verify.then(|| scene.verifier(&start));
        let measured = measure(&scene, &mut scene.engine(start)?, motion, (seeded, rule), &mut check, task);
        check.and_then(|check| check.difference()).map_or(measured, |difference| Err(difference.into()))
    });
    // A difference breaks the run off, and is the reason for any other error.
    check.and_then(|check| check.difference()).map_or(steady, |difference| Err(difference.into()))
}

/// Returns the reason against following the cycle of all forcing, if it is long.
fn long_cycle(simulation: &Simulation) -> Option<String> {
    let periods = simulation.structure.common_cycle().ok().filter(|periods| *periods > LONGEST)?;
    Some(format!("all forcing repeats after {periods} cycles only, more than {LONGEST}: its cycle is not waited for"))
}

/// Returns the steady motion under forcing whose cycle is too long to be followed.
fn on_torus(
    simulation: &Simulation,
    seed: Option<&Seed>,
    rule: &Rule,
    why: &str,
    task: Task<'_>,
) -> Result<Steady, StudyError> {
    let (start, seeded) = start(simulation, seed)?;
    let mut check = simulation.settings.verify.then(|| simulation.verifier(&start));
    let steady = along_torus(simulation, start, (rule, why), &mut check, task)
        .and_then(|(mut engine, motion)| measure(simulation, &mut engine, motion, (seeded, rule), &mut check, task));
    check.and_then(|check| check.difference()).map_or(steady, |difference| Err(difference.into()))
}

/// Returns an engine on a motion whose forcing repeats too late, and the kind of that motion.
fn along_torus<'c>(
    simulation: &'c Simulation,
    start: State,
    (rule, why): (&Rule, &str),
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<(Engine<'c>, Motion), StudyError> {
    let map = SectionMap::new(simulation)?;
    let mut engine = simulation.engine(start)?;
    go_on(&mut engine, simulation.clock(), rule.approach.most_cycles, observer, task)?;
    let mut motion = if rule.decides {
        let decided = decide_on_torus(&map, &mut engine, why, rule.watching(), observer, task)?;
        decided.ok_or_else(|| broken(&engine, task))?
    } else {
        Motion { reason: Some(why.to_owned()), ..Motion::of(&ApproachEnd::default()) }
    };
    motion.cycles += rule.approach.most_cycles;
    Ok((engine, motion))
}

/// Returns the measures of an orbit over its period.
pub(super) fn of_orbit(
    simulation: &Simulation,
    section: &Section,
    motion: Motion,
    task: Task<'_>,
) -> Result<Steady, StudyError> {
    let map = SectionMap::new(simulation)?;
    let mut engine = simulation.engine(map.state(section)?)?;
    let rule = Rule { measured_cycles: 1, ..Rule::default() };
    measure(simulation, &mut engine, motion, (true, &rule), &mut (), task)
}

/// Returns the window for spectra of a motion that are taken over whole cycles (and periods).
pub(super) fn window(motion: &Motion) -> Window {
    if motion.period.is_some() { Window::Rectangular } else { Window::Hann }
}

/// Returns an engine whose transient is over, the motion that it has reached by `rule`, and whether it started from the seed.
pub(super) fn settled<'c>(
    simulation: &'c Simulation,
    seed: Option<&Seed>,
    rule: &Rule,
    task: Task<'_>,
) -> Result<(Engine<'c>, Motion, bool), StudyError> {
    let (start, seeded) = start(simulation, seed)?;
    let (engine, motion) = match long_cycle(simulation) {
        Some(why) => along_torus(simulation, start, (rule, &why), &mut (), task)?,
        None => transient(simulation, start, rule, &mut (), task)?,
    };
    Ok((engine, motion, seeded))
}

/// Returns the start of a run, and whether it is the seed.
fn start(simulation: &Simulation, seed: Option<&Seed>) -> Result<(State, bool), StudyError> {
    simulation.period()?;
    let start = seed.and_then(|seed| resumed(simulation, seed));
    let seeded = start.is_some();
    Ok((start.map_or_else(|| simulation.start(), Ok)?, seeded))
}

fn transient<'c>(
    simulation: &'c Simulation,
    start: State,
    rule: &Rule,
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<(Engine<'c>, Motion), StudyError> {
    let map = SectionMap::new(simulation)?;
    let mut engine = simulation.engine(start)?;
    // Limits count periods of the scene's clock.
    let most_cycles = simulation.cycles_in(rule.approach.most_cycles, COMMON_CYCLES);
    let watched = rule.watching();
    let watching = WatchTime { cycles: simulation.cycles_in(watched.cycles, WATCHED_COMMON_CYCLES), ..watched };
    let approached = Approach { most_cycles, ..rule.approach }.run(&map, &mut engine, observer, task)?;
    let approached = approached.ok_or_else(|| broken(&engine, task))?;
    let (mut motion, decided) = if rule.decides {
        let decided = decide(&map, &mut engine, &approached, watching, observer, task)?;
        decided.ok_or_else(|| broken(&engine, task))?
    } else {
        (Motion::of(&approached), None)
    };
    motion.cycles *= simulation.periods_per_cycle();
    if let Some(orbit) = approached.orbit.or(decided) {
        engine = simulation.engine(map.state(&orbit.section)?)?;
    }
    Ok((engine, motion))
}

pub(super) fn resumed(simulation: &Simulation, seed: &Seed) -> Option<State> {
    let at = simulation.cycle_start(simulation.instants()[0]);
    let start = simulation.structure.resume(at, &seed.x, &seed.contacts).ok()?;
    Some(State { at, x: start.x, jump: start.jump })
}

/// Returns the error of a run that ended early: observers break it off on interruption alone, else the event budget is spent.
fn broken(engine: &Engine<'_>, task: Task<'_>) -> StudyError {
    if task.is_cancelled() { StudyError::Interrupted } else { StudyError::Budget { cycle: engine.state().at.cycle } }
}

/// Runs further whole cycles.
pub(super) fn go_on(
    engine: &mut Engine<'_>,
    clock: &Clock,
    cycles: u64,
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<(), StudyError> {
    until(engine, cycles_later(clock, engine.state().at, cycles), observer, task)
}

/// Runs further until `end`.
pub(super) fn until(
    engine: &mut Engine<'_>,
    end: Instant,
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<(), StudyError> {
    match engine.run(end, observer)? {
        Outcome::ReachedEnd => Ok(()),
        _ => Err(broken(engine, task)),
    }
}

/// Measures a motion from a section at which its transient is over.
pub(crate) fn measured(
    simulation: &Simulation,
    section: &Section,
    motion: Motion,
    task: Task<'_>,
) -> Result<Steady, StudyError> {
    let mut engine = simulation.engine(SectionMap::new(simulation)?.state(section)?)?;
    measure(simulation, &mut engine, motion, (false, &Rule::default()), &mut (), task)
}

fn measure(
    simulation: &Simulation,
    engine: &mut Engine<'_>,
    motion: Motion,
    (seeded, rule): (bool, &Rule),
    check: &mut dyn Observer,
    task: Task<'_>,
) -> Result<Steady, StudyError> {
    let structure = &simulation.structure;
    let count = structure.contact_count();
    // The motion counts cycles after which all forcing repeats.
    let whole = structure.common_cycle().ok().filter(|periods| *periods <= LONGEST).unwrap_or(1);
    let cycles = match motion.period {
        Some(period) => rule.measured_cycles.max(1).next_multiple_of(period * whole),
        None => rule.irregular_cycles.max(1).next_multiple_of(whole),
    };
    let from = engine.state().at;
    let before = engine.counters();
    let mut contacts = Contacts::new(structure, Some(from)).keep(0);
    let mut transmission = TransmissionError::new(structure, 0..count, 0, Some(from));
    let mut bearings = Bearings::new(structure, Some(from));
    let mut forces = vec![Vec::with_capacity(cycles as usize * PER_CYCLE as usize); count];
    let mut sections = vec![Vec::with_capacity(cycles as usize); count];
    let mut samples = Trajectory::new(structure, Grid::Phases { per_cycle: PER_CYCLE }, from, |s: &Sample<'_>| {
        for j in 0..count {
            forces[j].push(structure.force(j, s.mode, s.at, s.x));
            if s.index.is_multiple_of(u64::from(PER_CYCLE)) {
                sections[j].push(structure.deflection(j, s.at, s.x).0);
            }
        }
        task.flow()
    });
    go_on(
        engine,
        simulation.clock(),
        cycles,
        &mut ((&mut contacts, (&mut samples, (&mut transmission, &mut bearings))), check),
        task,
    )?;
    let after = engine.counters();
    let window = window(&motion);
    let transmission = transmission.reports();
    let reports = of_train((0..count).map(|j| contacts.report(j)).collect(), structure);
    let contacts =
        reports.into_iter().zip(forces.iter().zip(sections)).enumerate().map(|(j, (report, (force, section)))| {
            let spectrum = Spectrum::new(force, f64::from(PER_CYCLE), window);
            let [low, high] = [report.force_min, report.force_max].map(Option::unwrap_or_default);
            // Measured time began with the first step.
            let [mean, rms, range] = transmission.get(j).map_or([0.0; 3], |t| [t.mean, t.rms, t.peak_to_peak]);
            ContactSteady {
                transmission_mean: mean,
                transmission_rms: rms,
                transmission_peak_to_peak: range,
                force_amplitude: 0.5 * (high - low),
                force_harmonics: (1..=HARMONICS).map(|h| spectrum.at(h as f64)).collect(),
                section,
                report,
            }
        });
    let steady = Steady {
        period_s: simulation.period()?,
        motion,
        seeded,
        measured_cycles: cycles,
        events: after.events - before.events,
        grazes: after.grazes - before.grazes,
        contacts: contacts.collect(),
        bearings: bearings.reports(),
        end: Seed::of(structure, engine.state()),
    };
    match steady.contacts.iter().find(|c| !(c.force_amplitude + c.report.force_mean).is_finite()) {
        Some(contact) => Err(StudyError::Overflow(format!("the force of {}", contact.report.name))),
        None => Ok(steady),
    }
}
