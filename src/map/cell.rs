//! Motion of one cell.

use std::ops::ControlFlow;

use super::runner::Runner;
use crate::{
    engine::{JumpRecord, Observer, State},
    hybrid::{ContactView, Instant, Mode},
    integrate::DenseStep,
    kernel::LaneRecords,
    orbit::{
        Approach, Motion, Orbit, Section, SectionMap, WatchTime, decide,
        kind::{STANDS, kind_of},
        mover::{EngineMover, Mover},
    },
    simulation::{Simulation, SimulationError},
    system::{ContactMode, Structure, guard_of},
    task::Task,
};

/// Cycles that the motion of a cell is run until its kind is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct CellRule {
    /// Cycles of the transient. A motion that reaches a stable orbit earlier is not run further: it stays there.
    pub transient_cycles: u64,
    /// Cycles after it that decide on the kind of a motion without an orbit; half of them if it is clear by then.
    pub further_cycles: u64,
    /// True to compute averages of a motion without an orbit.
    #[serde(skip)]
    pub averages: bool,
}

impl Default for CellRule {
    fn default() -> Self {
        Self { transient_cycles: 200, further_cycles: 500, averages: false }
    }
}

/// Least number of cycles of a transient, and of further ones, if a cycle has several periods of the scene's clock.
pub(super) const LEAST_CYCLES: u64 = 8;
const LEAST_FURTHER_CYCLES: u64 = 64;
/// Longest period searched for, cycles.
const LONGEST: u32 = 16;

/// Flanks that are struck.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Impacts {
    /// No contact opens.
    None,
    /// Contacts open, and close again on one side only.
    SingleSided,
    /// Some contact touches both of its flanks.
    DoubleSided,
}

impl Impacts {
    /// All values, from the fewest flanks.
    pub const ALL: [Self; 3] = [Self::None, Self::SingleSided, Self::DoubleSided];

    /// Returns the value for the modes of a contact: separated, on the drive flank, on the back flank.
    fn of(met: [bool; 3]) -> Self {
        match met {
            [_, true, true] => Self::DoubleSided,
            [true, true, _] | [true, _, true] => Self::SingleSided,
            _ => Self::None,
        }
    }

    /// Returns its word in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::SingleSided => "single-sided",
            Self::DoubleSided => "double-sided",
        }
    }
}

/// Results for the motion of a cell.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Cell {
    /// Kind of the motion.
    pub motion: Motion,
    /// Largest exponent, 1/s; on an orbit from its largest multiplier.
    pub exponent: Option<f64>,
    /// Flanks that are struck, over one period, or over the cycles watched.
    pub impacts: Impacts,
    /// Share of this time in which each contact is separated.
    pub apart: Vec<f64>,
    /// Section after the transient, at the start of a cycle; on the orbit of a periodic motion.
    pub section: Section,
    /// Mean and standard deviation of each component at the starts of cycles, for a motion without an orbit.
    pub averages: Vec<[f64; 2]>,
}

/// Returns mean and standard deviation.
fn average(values: &[f64]) -> [f64; 2] {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    [mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()]
}

/// Times in which contacts are separated, and the flanks that they touch.
#[derive(Debug)]
struct Flanks<'s> {
    structure: &'s Structure,
    /// Time of separation of each contact, s.
    apart: Vec<f64>,
    /// Total time, s.
    time: f64,
    /// True for each contact if it occurs separated, on the drive flank, on the back flank.
    met: Vec<[bool; 3]>,
}

impl<'s> Flanks<'s> {
    fn new(structure: &'s Structure) -> Self {
        let contacts = structure.contact_count();
        Self { structure, apart: vec![0.0; contacts], time: 0.0, met: vec![[false; 3]; contacts] }
    }

    fn add(&mut self, mode: &Mode, time: f64) {
        self.time += time;
        for (j, (apart, met)) in self.apart.iter_mut().zip(&mut self.met).enumerate() {
            match self.structure.contact_mode(j, mode) {
                ContactMode::Separated => {
                    *apart += time;
                    met[0] = true;
                }
                ContactMode::Drive | ContactMode::DriveDetached => met[1] = true,
                ContactMode::Back | ContactMode::BackDetached => met[2] = true,
            }
        }
    }

    fn impacts(&self) -> Impacts {
        self.met.iter().map(|met| Impacts::of(*met)).max().unwrap_or(Impacts::None)
    }
}

impl Observer for Flanks<'_> {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.add(mode, time);
        ControlFlow::Continue(())
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.add(mode, step.time(until));
        ControlFlow::Continue(())
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        // An impact takes no time.
        for (j, watch) in jumped.to.struck.iter().map(guard_of) {
            self.met[j][if watch.side() > 0.0 { 1 } else { 2 }] = true;
        }
    }
}

impl CellRule {
    /// Returns the rule in cycles of `simulation`: limits are stated in periods of the scene's clock.
    pub(super) fn counted(&self, simulation: &Simulation) -> Self {
        Self {
            transient_cycles: simulation.cycles_in(self.transient_cycles, LEAST_CYCLES),
            further_cycles: simulation.cycles_in(self.further_cycles, LEAST_FURTHER_CYCLES),
            ..*self
        }
    }

    fn approach(&self) -> Approach {
        Approach { most_cycles: self.transient_cycles, longest_period: LONGEST, ..Approach::default() }
    }

    fn watching(&self) -> WatchTime {
        WatchTime { cycles: self.further_cycles / 2, doublings: 1, is_settled: true }
    }

    /// Returns the result of [`decide_generally`](Self::decide_generally), by a lane if the train has one.
    ///
    /// # Errors
    /// Errors of that function.
    pub fn decide(
        &self,
        simulation: &Simulation,
        start: State,
        task: Task<'_>,
    ) -> Result<Option<Cell>, SimulationError> {
        SectionMap::new(simulation)?.repeats()?;
        let rule = self.counted(simulation);
        match rule.decide_in_lane(simulation, &start, task)? {
            Some(cell) => Ok(Some(cell)),
            None => rule.decide_generally(simulation, start, task),
        }
    }

    /// Returns the result of [`decide`](Self::decide) by a lane; `None` if the train or its motion has none.
    fn decide_in_lane(
        &self,
        simulation: &Simulation,
        start: &State,
        task: Task<'_>,
    ) -> Result<Option<Cell>, SimulationError> {
        let Some(mut lane) = Runner::new(simulation)? else { return Ok(None) };
        lane.begin(start);
        let Some(approached) = self.approach().along(&mut lane, task)? else { return Ok(None) };
        // A run that stands on an orbit is moved off it first, which an engine does.
        if approached.orbit.is_none() && approached.distance <= STANDS {
            return Ok(None);
        }
        let motion = Motion::of(&approached);
        let decided = match approached.orbit {
            Some(orbit) => Some((motion, Some(orbit))),
            None => kind_of(&mut lane, motion, self.watching(), task)?,
        };
        let Some((motion, orbit)) = decided else { return Ok(None) };
        let times = match &orbit {
            Some(orbit) => lane.times(&orbit.section, orbit.period)?,
            None => Some(lane.records.times),
        };
        let Some([separated, drive, back, drive_detached, back_detached]) = times else { return Ok(None) };
        let total = separated + drive + back + drive_detached + back_detached;
        let met = [separated > 0.0, drive + drive_detached > 0.0, back + back_detached > 0.0];
        let flanks = Flanks { structure: &simulation.structure, apart: vec![separated], time: total, met: vec![met] };
        // Averages need no derivative.
        lane.records = LaneRecords::default();
        self.cell(&mut lane, motion, orbit, &flanks)
    }

    /// Returns the cell of a motion that `mover` is on, or of its orbit. `None` if the run is interrupted.
    fn cell<'s>(
        &self,
        mover: &mut impl Mover<'s>,
        motion: Motion,
        orbit: Option<Orbit>,
        flanks: &Flanks<'_>,
    ) -> Result<Option<Cell>, SimulationError> {
        let period = mover.map().0.simulation().period()?;
        let exponent = match &orbit {
            Some(orbit) => Some(libm::log(orbit.largest_multiplier()) / (orbit.period as f64 * period)),
            None => motion.exponent.map(|[exponent, _]| exponent),
        };
        let section = orbit.map_or_else(|| mover.section(), |orbit| orbit.section);
        let mut averages = Vec::new();
        if motion.period.is_none() && self.averages {
            let mut seen = vec![Vec::new(); section.x.len()];
            for _ in 0..self.further_cycles {
                if !mover.cycle()? {
                    return Ok(None);
                }
                seen.iter_mut().zip(mover.point().as_ref()).for_each(|(seen, x)| seen.push(*x));
            }
            averages = seen.iter().map(|values| average(values)).collect();
        }
        // A multiplier of zero has no exponent.
        let exponent = exponent.filter(|exponent| exponent.is_finite());
        let apart = flanks.apart.iter().map(|apart| apart / flanks.time).collect();
        Ok(Some(Cell { impacts: flanks.impacts(), apart, exponent, section, averages, motion }))
    }

    /// Runs `simulation` from `start` until the kind of its motion is known, or the allowed cycles do not decide it. `None` if the run is
    /// interrupted.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn decide_generally(
        &self,
        simulation: &Simulation,
        start: State,
        task: Task<'_>,
    ) -> Result<Option<Cell>, SimulationError> {
        let map = SectionMap::new(simulation)?;
        let mut engine = simulation.engine(start)?;
        let Some(approached) = self.approach().run(&map, &mut engine, &mut (), task)? else { return Ok(None) };
        let mut flanks = Flanks::new(&simulation.structure);
        let decided = decide(&map, &mut engine, &approached, self.watching(), &mut flanks, task)?;
        let Some((motion, decided)) = decided else { return Ok(None) };
        let orbit = approached.orbit.or(decided);
        if let Some(orbit) = &orbit {
            flanks = Flanks::new(flanks.structure);
            map.watch(&orbit.section, orbit.period, &mut flanks)?;
        }
        let drift = map.drift();
        self.cell(&mut EngineMover::new(map, &drift, &mut engine, &mut ()), motion, orbit, &flanks)
    }
}
