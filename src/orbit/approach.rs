//! Orbit that a run approaches: it is solved for, and the run only selects which one.

use std::collections::VecDeque;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{
    Drift, Orbit, SectionMap,
    mover::{Mover, Point},
    newton::Options,
    rest::returns,
    unknowns::{Unknowns, distance},
    words::sorted,
};
use crate::{
    engine::{Engine, Observer},
    simulation::SimulationError,
    task::Task,
};

/// Settings of the search for the orbit that a run approaches.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Approach {
    /// Largest distance between the ends of an orbit, in scales, > 0.
    pub tolerance: f64,
    /// Longest period searched for, cycles, ≥ 1.
    pub longest_period: u32,
    /// Maximum number of cycles run.
    pub most_cycles: u64,
}

impl Default for Approach {
    fn default() -> Self {
        Self { tolerance: 1e-9, longest_period: 8, most_cycles: 400 }
    }
}

/// Result of a run towards an orbit.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct ApproachEnd {
    /// Stable orbit that the run approaches, if one was found.
    pub orbit: Option<Orbit>,
    /// Cycles run.
    pub cycles: u64,
    /// Residual of the orbit, in scales; without an orbit the distance of the last two sections.
    pub distance: f64,
    /// Without an orbit: factor by which the distances of returns change in each of the last quarters of the run, the larger one.
    pub closing: f64,
    /// Reason for which the last solution was rejected.
    pub reason: Option<String>,
}

/// Distance of two sections, in scales, below which Newton's method is tried.
pub(super) const NEAR: f64 = 0.03;
/// Distance, in scales, within which a run is beside an unstable orbit.
pub(super) const BESIDE: f64 = 1e-3;
/// Newton steps in which the residual must fall by half.
const PATIENCE: usize = 3;
/// Periods over which a run must approach an orbit.
const FOLLOWED: u64 = 2;
/// Share of the contraction by the derivative that a run must show.
const CONTRACTS: f64 = 0.5;
/// First cycle at which an orbit is searched for, and the growth of the intervals between later ones.
const FIRST: u64 = 3;
const GROWTH: f64 = 1.5;
/// Doublings of a sum over powers of the derivative: decays as slow as 2⁻⁴⁰ a period are summed.
const DOUBLINGS: u32 = 46;

/// Measure of the distance from an orbit that attracts its neighbours: `‖y‖² = Σ_i |Jⁱ y|²`, which falls by `|y|²` in a period.
struct Attraction {
    orbit: Vec<f64>,
    unknowns: Unknowns,
    sum: DMatrix<f64>,
}

impl Attraction {
    fn new(map: &SectionMap<'_>, orbit: &Orbit, drift: &Drift) -> Self {
        let unknowns = Unknowns::new(map, &orbit.image, drift);
        let mut power = unknowns.reduced(&orbit.image.jacobian);
        let mut sum = DMatrix::identity(power.nrows(), power.ncols());
        for _ in 0..DOUBLINGS {
            sum += power.transpose() * &sum * &power;
            power = &power * &power;
            if power.amax() <= f64::MIN_POSITIVE.sqrt() {
                break;
            }
        }
        Self { orbit: orbit.section.x.clone(), unknowns, sum }
    }

    /// Returns the measure of a state's distance from the orbit, and its decrease in a period.
    fn of(&self, x: &[f64]) -> [f64; 2] {
        let off = self.unknowns.between(&self.orbit, x);
        [off.dot(&(&self.sum * &off)), off.norm_squared()]
    }
}

/// Returns the median distance of returns, after at most `longest` cycles, in each of the last three quarters of some sections, in scales;
/// `None` if they are too few.
pub(super) fn return_distances(
    map: &SectionMap<'_>,
    sections: &[impl AsRef<[f64]>],
    longest: usize,
    drift: &Drift,
) -> Option<[f64; 3]> {
    let quarter = sections.len() / 4;
    if quarter <= longest {
        return None;
    }
    let scales = map.scales_of(sections);
    let returned = |m: usize| {
        let apart = |k: usize| distance(map, &sections[m - k], &sections[m], &scales, drift);
        (1..=longest).map(apart).fold(f64::INFINITY, f64::min)
    };
    let median = |from: usize| {
        // A hundred of them represent all.
        let step = quarter.div_ceil(100);
        let mut all: Vec<f64> = (from..from + quarter).step_by(step).map(returned).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2].max(f64::EPSILON)
    };
    Some([1, 2, 3].map(|k| median(k * quarter)))
}

/// Returns the factor by which the distances of returns change from quarter to quarter, the larger one; 1 if there are too few.
pub(super) fn closing(returns: Option<[f64; 3]>) -> f64 {
    returns.map_or(1.0, |[a, b, c]| (b / a).max(c / b))
}

impl Approach {
    /// Runs `engine` from start of cycle to start of cycle until it approaches a stable orbit, or until the allowed cycles are spent. Tries
    /// Newton's method from the present section at times. A stable orbit counts if the run follows it: two periods with its word, in which
    /// the distance, by the measure of the orbit's derivative, falls at least half as fast as predicted. `None` if the run is interrupted:
    /// by `task`, by the observer or by the limit on events.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails.
    pub fn run<'s>(
        &self,
        map: &SectionMap<'s>,
        engine: &mut Engine<'s>,
        observer: &mut dyn Observer,
        task: Task<'_>,
    ) -> Result<Option<ApproachEnd>, SimulationError> {
        let (drift, clock) = (map.drift(), map.simulation().clock());
        let start = engine.state().at;
        if clock.between(clock.at(start.cycle, 0.0), start) > 0.0 {
            // A start within a cycle first completes it.
            if !map.cycle(engine, observer)? {
                return Ok(None);
            }
        }
        self.along(&mut Mover::new(*map, &drift, engine, observer), task)
    }

    /// Does the same from the start of a cycle.
    pub(super) fn along(
        &self,
        mover: &mut Mover<'_, '_>,
        task: Task<'_>,
    ) -> Result<Option<ApproachEnd>, SimulationError> {
        let mut sections = VecDeque::from([mover.point()]);
        let kept = (self.longest_period.max(1) as usize + 1).max(self.most_cycles.min(4096) as usize / 2 + 1);
        let (mut cycles, mut next, mut reason) = (0, FIRST.min(self.most_cycles), None);
        let mut unstable: Vec<Vec<f64>> = Vec::new();
        while cycles < self.most_cycles {
            if !mover.cycle()? || task.is_cancelled() {
                return Ok(None);
            }
            cycles += 1;
            if sections.len() == kept {
                sections.pop_front();
            }
            sections.push_back(mover.point());
            if cycles < next {
                continue;
            }
            next = (cycles + 1).max((cycles as f64 * GROWTH) as u64).min(self.most_cycles);
            let searched = (cycles, &mut unstable, &mut reason, task);
            if let Some(orbit) = self.candidate(mover, sections.make_contiguous(), searched)? {
                let before = sections.len();
                let followed = self.follow(mover, &orbit, (&mut sections, task))?;
                let Some(approaches) = followed else { return Ok(None) };
                cycles += (sections.len() - before) as u64;
                if approaches {
                    let distance = orbit.residual;
                    return Ok(Some(ApproachEnd { orbit: Some(orbit), cycles, distance, closing: 1.0, reason: None }));
                }
                reason = Some(
                    "the motion does not come nearer to the orbit that was found as its multipliers say".to_owned(),
                );
                sections.drain(..sections.len().saturating_sub(kept));
            }
        }
        let (sections, map, drift) = (&*sections.make_contiguous(), mover.map, mover.drift);
        let distance = match sections {
            [.., before, last] => distance(&map, last, before, &map.scales_of(sections), drift),
            _ => f64::INFINITY,
        };
        let closing = closing(return_distances(&map, sections, self.longest_period as usize, drift));
        Ok(Some(ApproachEnd { orbit: None, cycles, distance, closing, reason }))
    }

    /// Returns a stable orbit near the last of `sections`, from Newton's method, or the rest there.
    fn candidate(
        &self,
        mover: &mut Mover<'_, '_>,
        sections: &[Point],
        (cycles, unstable, reason, task): (u64, &mut Vec<Vec<f64>>, &mut Option<String>, Task<'_>),
    ) -> Result<Option<Orbit>, SimulationError> {
        let (map, drift) = (mover.map, mover.drift);
        if let [.., before, last] = sections
            && returns(map.simulation(), before, last, cycles)
            && let Some(orbit) = map.rest(mover.section(), cycles)?
        {
            return Ok(Some(orbit));
        }
        let scales = map.scales_of(sections);
        let last = sections.len() - 1;
        // A run beside an unstable orbit has to leave it first.
        if unstable.iter().any(|known| distance(&map, known, &sections[last], &scales, drift) <= BESIDE) {
            return Ok(None);
        }
        // The distance is weighted by the period: a long period has to close better.
        let near = (1..=last.min(self.longest_period as usize))
            .map(|k| (distance(&map, &sections[last - k], &sections[last], &scales, drift), k))
            .filter(|(apart, _)| *apart <= NEAR)
            .min_by(|a, b| (a.0 * a.1 as f64).total_cmp(&(b.0 * b.1 as f64)));
        let Some((_, period)) = near else { return Ok(None) };
        // The last return is tried in any case.
        let is_stable = cycles < self.most_cycles;
        let options = Options { patience: Some(PATIENCE), is_stable, task, ..Options::default() };
        let start = vec![mover.section()];
        match map.newton(&mut mover.spare, (start, period as u64), drift, options) {
            Ok(orbit) if !orbit.is_stable => {
                *reason = Some("the orbit near the end of the run is not stable".into());
                unstable.push(orbit.section.x);
            }
            Ok(orbit) if orbit.is_marginal => {
                let why = match orbit.image.corner {
                    Some(_) => {
                        "has impacts at one instant that depend on each other: its derivative does not tell whether it is stable"
                    }
                    None => "has a multiplier on the unit circle",
                };
                *reason = Some(format!("the orbit near the end of the run {why}"));
                unstable.push(orbit.section.x);
            }
            Ok(orbit) if orbit.residual > self.tolerance => {
                *reason = Some(format!("the orbit near the end of the run closes to {:e} only", orbit.residual));
            }
            Ok(orbit) => return Ok(Some(orbit)),
            Err(missed) => *reason = Some(missed.reason),
        }
        Ok(None)
    }

    /// Runs some further periods, adds their sections, and returns whether the run approaches `orbit` as required.
    fn follow(
        &self,
        mover: &mut Mover<'_, '_>,
        orbit: &Orbit,
        (sections, task): (&mut VecDeque<Point>, Task<'_>),
    ) -> Result<Option<bool>, SimulationError> {
        let (map, drift) = (mover.map, mover.drift);
        let attraction = Attraction::new(&map, orbit, drift);
        let word = sorted(&orbit.image.word);
        let mut before = attraction.of(&mover.point());
        for _ in 0..FOLLOWED {
            let Some(spelt) = mover.spell(orbit.period, sections)?.filter(|_| !task.is_cancelled()) else {
                return Ok(None);
            };
            let now = attraction.of(&mover.point());
            let is_there = now[1].sqrt() <= self.tolerance;
            let comes = now[0] <= before[0] - CONTRACTS * before[1];
            if sorted(&spelt) != word || !(is_there || comes) {
                return Ok(Some(false));
            }
            before = now;
        }
        Ok(Some(true))
    }
}
