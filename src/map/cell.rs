//! Motion of one cell.

use std::ops::ControlFlow;

use crate::{
    engine::{JumpRecord, Observer, State},
    hybrid::{ContactView, Instant, LaneRecords, Mode},
    integrate::DenseStep,
    orbit::{Approach, Motion, Section, SectionMap, WatchTime, decide},
    simulation::{Simulation, SimulationError},
    system::{Structure, guard_of},
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

/// Times of contacts in their states, and the flanks that they strike.
#[derive(Debug)]
struct Flanks<'s> {
    structure: &'s Structure,
    /// Time of each contact in each state, s, in the order of [`ContactMode`](crate::hybrid::ContactMode).
    times: Vec<[f64; 5]>,
    /// True for each contact if an impact occurs on the drive flank, on the back flank.
    struck: Vec<[bool; 2]>,
}

impl<'s> Flanks<'s> {
    fn new(structure: &'s Structure) -> Self {
        let contacts = structure.contact_count();
        Self { structure, times: vec![[0.0; 5]; contacts], struck: vec![[false; 2]; contacts] }
    }

    fn add(&mut self, mode: &Mode, time: f64) {
        for (j, times) in self.times.iter_mut().enumerate() {
            times[self.structure.contact_mode(j, mode) as usize] += time;
        }
    }

    /// Returns the share of time in which each contact is separated.
    fn apart(&self) -> Vec<f64> {
        self.times.iter().map(|times| times[0] / times.iter().sum::<f64>()).collect()
    }

    fn impacts(&self) -> Impacts {
        let of = |([separated, drive, back, drive_detached, back_detached], struck): (&[f64; 5], &[bool; 2])| {
            let met = [*separated, drive + drive_detached, back + back_detached].map(|time| time > 0.0);
            // An impact takes no time.
            Impacts::of([met[0], met[1] || struck[0], met[2] || struck[1]])
        };
        self.times.iter().zip(&self.struck).map(of).max().unwrap_or(Impacts::None)
    }
}

impl Observer for Flanks<'_> {
    fn wants_steps(&self, _: &Mode, _: Instant) -> bool {
        false
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        Some(LaneRecords { times: Some(&mut self.times), ..LaneRecords::default() })
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
        for (j, watch) in jumped.to.struck.iter().map(guard_of) {
            self.struck[j][usize::from(watch.side() < 0.0)] = true;
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

    /// Runs `simulation` from `start` until the kind of its motion is known, or the allowed cycles do not decide it. `None` if the run is
    /// interrupted.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn decide(
        &self,
        simulation: &Simulation,
        start: State,
        task: Task<'_>,
    ) -> Result<Option<Cell>, SimulationError> {
        let map = SectionMap::new(simulation)?;
        map.repeats()?;
        let (rule, period) = (self.counted(simulation), simulation.period()?);
        let mut engine = simulation.engine(start)?;
        let Some(approached) = rule.approach().run(&map, &mut engine, &mut (), task)? else { return Ok(None) };
        let mut flanks = Flanks::new(&simulation.structure);
        let decided = decide(&map, &mut engine, &approached, rule.watching(), &mut flanks, task)?;
        let Some((motion, decided)) = decided else { return Ok(None) };
        let orbit = approached.orbit.or(decided);
        if let Some(orbit) = &orbit {
            flanks = Flanks::new(flanks.structure);
            map.watch(&orbit.section, orbit.period, &mut flanks)?;
        }
        let exponent = match &orbit {
            Some(orbit) => Some(libm::log(orbit.largest_multiplier()) / (orbit.period as f64 * period)),
            None => motion.exponent.map(|[exponent, _]| exponent),
        };
        let section = orbit.map_or_else(|| map.section(engine.state()), |orbit| orbit.section);
        let mut averages = Vec::new();
        if motion.period.is_none() && rule.averages {
            let mut seen = vec![Vec::new(); section.x.len()];
            for _ in 0..rule.further_cycles {
                if !map.cycle(&mut engine, &mut ())? {
                    return Ok(None);
                }
                seen.iter_mut().zip(&engine.state().x).for_each(|(seen, x)| seen.push(*x));
            }
            averages = seen.iter().map(|values| average(values)).collect();
        }
        // A multiplier of zero has no exponent.
        let exponent = exponent.filter(|exponent| exponent.is_finite());
        Ok(Some(Cell { impacts: flanks.impacts(), apart: flanks.apart(), exponent, section, averages, motion }))
    }
}
