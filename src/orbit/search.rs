//! Search for periodic orbits: starts and periods of Newton's method.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{
    Drift, INTERRUPTED, NewtonFailure, Orbit, SectionMap,
    newton::{Options, SAME},
    report::components,
    section::{Section, SpareEngine},
    unknowns::{ACCELERATES, distance},
};
use crate::{
    simulation::{Simulation, SimulationError},
    task::{Progress, Task},
};

/// Longest period searched for unless one is given, cycles.
pub const LONGEST: u64 = 16;
/// Distance, in scales, from a start within which an orbit belongs to it.
const NEAR: f64 = 2.0;
/// Distance, in scales, after a period above which Newton's method is not tried: an orbit near the start closes better.
const RETURNED: f64 = 0.5;
/// Steps in which Newton's method must halve the residual of a near start: it converges quadratically there.
const PATIENCE: usize = 3;
/// Sections kept of the end of a run, in which close returns are searched for.
const KEPT: usize = 2000;
/// Starts that are solved in parallel, between two checks of the task.
const BLOCK: usize = 64;
/// Bound on the error of an orbit, as a multiple of its condition times its residual.
const UNSURE: f64 = 10.0;
/// Least number of cycles run: a run may be shorter than a few common cycles of its forcing.
const LEAST_CYCLES: i64 = 8;
/// Close returns that are tried.
const RETURNS: usize = 24;

/// Settings of a search.
#[derive(Clone, Copy, Debug, Default)]
pub struct Search {
    /// Period, cycles; if absent, the smallest one that is found.
    pub period: Option<u64>,
    /// Number of further starts, spread over the states of the motion and around them.
    pub starts: usize,
}

/// State of a search, from which it resumes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SearchState {
    /// Starts that have been tried.
    pub starts: usize,
    /// Orbits in the order in which they were found.
    pub orbits: Vec<Orbit>,
    /// Least residual, in scales, of the failed solutions, and the reason of the failure.
    best: Option<f64>,
    reason: Option<String>,
}

/// Result of a search.
#[derive(Debug)]
#[non_exhaustive]
pub struct SearchResult {
    /// Orbits in the order in which they were found.
    pub orbits: Vec<Orbit>,
    /// The drift of the train.
    pub drift: Drift,
    /// Reason for which none was found, or for which the search ended early.
    pub reason: Option<String>,
    /// Least residual, in scales, of the failed solutions.
    pub best: f64,
}

impl Search {
    /// Searches for orbits: from the start of the scene; if there is none, from the end of its run; and from further starts.
    ///
    /// # Errors
    /// [`SimulationError`] for a train without a forcing period or a start that cannot be used.
    pub fn run(&self, simulation: &Simulation, task: Task<'_>) -> Result<SearchResult, SimulationError> {
        self.go_on(simulation, None, &mut |_| (), task)
    }

    /// Does the same, resumed from `earlier` work of the same search of the same train, if any. `keep` receives the orbits found after each
    /// block of further starts.
    ///
    /// # Errors
    /// Errors of [`run`](Self::run).
    pub fn go_on(
        &self,
        simulation: &Simulation,
        earlier: Option<SearchState>,
        keep: &mut (dyn FnMut(&SearchState) + Send),
        task: Task<'_>,
    ) -> Result<SearchResult, SimulationError> {
        let map = SectionMap::new(simulation)?;
        let mut found = SearchResult { orbits: Vec::new(), drift: map.drift(), reason: None, best: f64::INFINITY };
        map.repeats()?;
        let start = map.start()?;
        if found.drift.accelerates(simulation) {
            found.reason = Some(ACCELERATES.to_owned());
            return Ok(found);
        }
        let (mut first, is_new) = (0, earlier.is_none());
        match earlier {
            Some(SearchState { starts, orbits, best, reason }) => {
                (first, found.orbits, found.reason) = (starts, orbits, reason);
                found.best = best.unwrap_or(f64::INFINITY);
            }
            None => self.near(&map, &start, &mut found, task),
        }
        let (mut passed, mut ended) = (Vec::new(), None);
        if found.orbits.is_empty() || self.starts > 0 {
            (passed, ended) = self.pass(&map, &start, task)?;
        }
        // An orbit is the same wherever it has drifted to: near the start it has the most digits.
        passed.iter_mut().for_each(|section| found.drift.take_back(simulation, section, &start));
        if is_new && found.orbits.is_empty() && !passed.is_empty() {
            self.returns(&map, &passed, &mut found, task);
        }
        if is_new && self.starts > 0 && !task.is_cancelled() {
            keep(&found.kept(0));
        }
        self.spread(&map, &passed, first, &mut found, keep, task);
        found.pair_up(&map);
        if task.is_cancelled() {
            ended = Some(INTERRUPTED.to_owned());
        }
        found.reason = if !found.orbits.is_empty() || ended.is_some() {
            ended
        } else {
            let no_return = || "no state of the motion comes back near enough to itself".to_owned();
            Some(found.reason.take().unwrap_or_else(no_return))
        };
        Ok(found)
    }

    /// Searches near one section: with the period after which it returns, or else the first for which Newton's method converges near it.
    fn near(&self, map: &SectionMap<'_>, start: &Section, found: &mut SearchResult, task: Task<'_>) {
        if let Some(period) = self.period {
            let guess = FirstGuess::Start(start, period);
            self.attempt(map, guess, f64::INFINITY, found, task);
            return;
        }
        let mut sections = vec![start.clone()];
        for _ in 0..LONGEST {
            match map.follow(&sections[sections.len() - 1], 1) {
                Ok(next) => sections.push(next),
                Err(error) => {
                    found.reason = Some(error.to_string());
                    break;
                }
            }
        }
        let scales = map.scales_of(&sections);
        let close = (1..sections.len()).find(|k| distance(map, start, &sections[*k], &scales, &found.drift) <= SAME);
        if close.is_some_and(|k| self.attempt(map, FirstGuess::Cycles(&sections[..k]), f64::INFINITY, found, task)) {
            return;
        }
        for (period, section) in sections.iter().enumerate().skip(1) {
            let is_far = distance(map, start, section, &scales, &found.drift) > RETURNED;
            if task.is_cancelled()
                || !is_far && self.attempt(map, FirstGuess::Cycles(&sections[..period]), NEAR, found, task)
            {
                return;
            }
        }
    }

    /// Applies Newton's method to the start of a guess, then to all of it. Returns whether an orbit was found that is `near` the start.
    fn attempt(
        &self,
        map: &SectionMap<'_>,
        guess: FirstGuess<'_>,
        near: f64,
        found: &mut SearchResult,
        task: Task<'_>,
    ) -> bool {
        let patience = near.is_finite().then_some(PATIENCE);
        let (start, period) = guess.start();
        let options = Options { patience, task, ..Options::default() };
        let mut spare = None;
        let solved = map.newton(&mut spare, (vec![start.clone()], period), &found.drift, options).or_else(|missed| {
            let parts = map.divided();
            let sections = if period > 1 || parts.steps() > 1 { guess.sections(&parts) } else { None };
            let shot = sections.map(|sections| parts.newton(&mut spare, (sections, 1), &found.drift, options));
            shot.and_then(Result::ok).ok_or(missed)
        });
        let is_near = |orbit: &Orbit| {
            let scales = map.scales_of(std::slice::from_ref(&orbit.section));
            distance(map, start, &orbit.section, &scales, &found.drift) <= near
        };
        let is_found = solved.as_ref().is_ok_and(is_near);
        if is_found || solved.is_err() {
            found.take(map, solved);
        }
        is_found
    }

    /// Runs the scene; returns the last of its sections, and the reason for an early end.
    fn pass(
        &self,
        map: &SectionMap<'_>,
        start: &Section,
        task: Task<'_>,
    ) -> Result<(Vec<Section>, Option<String>), SimulationError> {
        let simulation = map.simulation();
        let [from, _, end] = simulation.instants();
        let cycles = (end.cycle - from.cycle).max(LEAST_CYCLES);
        let mut engine = simulation.engine(map.state(start)?)?;
        let first = engine.state().at.cycle;
        let (mut sections, mut ended) = (std::collections::VecDeque::new(), None);
        for cycle in 1..=cycles {
            if let Err(error) = map.advance(&mut engine, simulation.clock().at(first + cycle, 0.0), &mut ()) {
                ended = Some(format!("the run of the scene ends in cycle {cycle}: {error}"));
                break;
            }
            if sections.len() == KEPT {
                sections.pop_front();
            }
            sections.push_back(map.section(engine.state()));
            if cycle % 256 == 0 {
                task.report(Progress::Share(cycle as f64 / cycles as f64));
            }
            if task.is_cancelled() {
                break;
            }
        }
        Ok((sections.into(), ended))
    }

    /// Searches from the end of a run, and from its closest returns.
    fn returns(&self, map: &SectionMap<'_>, passed: &[Section], found: &mut SearchResult, task: Task<'_>) {
        let scales = map.scales_of(passed);
        let Some(last) = passed.len().checked_sub(1) else { return };
        let periods = match self.period {
            Some(period) => period..=period,
            None => 1..=LONGEST,
        };
        let apart = |m: usize, k: u64| distance(map, &passed[m], &passed[m + k as usize], &scales, &found.drift);
        let fits = |m: usize, k: u64| m + k as usize <= last;
        // First from the end, with the shortest period that closes best.
        let mut ends: Vec<(f64, usize, u64)> = periods
            .clone()
            .filter(|k| last as u64 >= *k)
            .map(|k| (apart(last - k as usize, k), last - k as usize, k))
            .collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(k) = ends.iter().filter(|(d, ..)| *d <= SAME).map(|(.., k)| *k).min() {
            ends.insert(0, (0.0, last - k as usize, k));
        }
        let mut all: Vec<(f64, usize, u64)> = periods
            .flat_map(|k| (0..passed.len()).filter(move |m| fits(*m, k)).map(move |m| (m, k)))
            .map(|(m, k)| (apart(m, k), m, k))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, m, k) in ends.into_iter().take(4).chain(all.into_iter().take(RETURNS)) {
            if task.is_cancelled()
                || self.attempt(map, FirstGuess::Cycles(&passed[m..m + k as usize]), f64::INFINITY, found, task)
            {
                return;
            }
        }
    }

    /// Searches from further starts: states of the motion, and states around them.
    fn spread<'s>(
        &self,
        map: &SectionMap<'s>,
        passed: &[Section],
        first: usize,
        found: &mut SearchResult,
        keep: &mut dyn FnMut(&SearchState),
        task: Task<'_>,
    ) {
        let Some(last) = passed.last() else { return };
        let simulation = map.simulation();
        let n = simulation.structure.freedoms();
        let scales = map.scales_of(passed);
        // Multiples of the roots of primes, which are independent, fill the cube evenly (Weyl 1916); the same on every machine.
        let roots: Vec<f64> = primes().take(2 * n).map(|prime| (prime as f64).sqrt()).collect();
        let start = |i: usize| {
            let spread = |k: usize| ((i + 1) as f64 * roots[k]).fract() * 2.0 - 1.0;
            if i.is_multiple_of(2) {
                return passed[i * 7919 % passed.len()].clone();
            }
            let x = (0..last.x.len()).map(|k| if k < 2 * n { 2.0 * scales[k] * spread(k) } else { last.x[k] });
            Section { x: x.collect(), contacts: last.contacts.clone() }
        };
        let periods = self.period.map_or(1..=4, |period| period..=period);
        for first in (first..self.starts).step_by(BLOCK) {
            let block = first..self.starts.min(first + BLOCK);
            let tried = block.end;
            let (drift, orbits) = (&found.drift, &found.orbits);
            // Orbits known when a block begins are avoided.
            let known = |k: u64| {
                let closing = orbits.iter().filter(move |orbit| k.is_multiple_of(orbit.period));
                closing
                    .flat_map(|orbit| orbit.image.between.iter().map(|section| section.x.clone()))
                    .collect::<Vec<_>>()
            };
            let solve = |spare: &mut SpareEngine<'s>, i: usize, k: u64| {
                let options = Options { known: &known(k), task, ..Options::default() };
                map.newton(spare, (vec![start(i)], k), drift, options).or_else(|missed| {
                    // Starts from states along the motion.
                    let first = i * 7919 % passed.len();
                    let parts = map.divided();
                    let is_long = k > 1 || parts.steps() > 1;
                    let trail = passed.get(first..first + k as usize).filter(|_| i.is_multiple_of(2) && is_long);
                    let trail = trail.and_then(|trail| FirstGuess::Cycles(trail).sections(&parts));
                    trail.ok_or(missed).and_then(|trail| {
                        let options = Options { patience: Some(PATIENCE), task, ..Options::default() };
                        parts.newton(spare, (trail, 1), drift, options)
                    })
                })
            };
            let from = |i: usize| {
                let mut spare = None;
                periods.clone().map(|k| solve(&mut spare, i, k)).collect::<Vec<_>>()
            };
            let solved: Vec<Vec<_>> = block.into_par_iter().map(from).collect();
            if task.is_cancelled() {
                // The block counts as a whole or not at all.
                return;
            }
            solved.into_iter().flatten().for_each(|solved| found.take(map, solved));
            keep(&found.kept(tried));
            task.report(Progress::Share(tried as f64 / self.starts as f64));
            if task.is_cancelled() {
                return;
            }
        }
    }
}

/// Start of a search: a section and a period, or a section for each cycle of the period.
enum FirstGuess<'a> {
    Start(&'a Section, u64),
    Cycles(&'a [Section]),
}

impl FirstGuess<'_> {
    /// Returns the first section, and the period, cycles.
    fn start(&self) -> (&Section, u64) {
        match self {
            Self::Start(start, period) => (start, *period),
            Self::Cycles(sections) => (&sections[0], sections.len() as u64),
        }
    }

    /// Returns a section for each step of the period; `None` if the run from the start fails.
    fn sections(&self, map: &SectionMap<'_>) -> Option<Vec<Section>> {
        let follow = |start: &Section, steps: usize| {
            let mut all = vec![start.clone()];
            for step in 1..steps {
                all.push(map.at_step(step - 1).follow(&all[step - 1], 1).ok()?);
            }
            Some(all)
        };
        match self {
            Self::Start(start, period) => follow(start, *period as usize * map.steps()),
            Self::Cycles(sections) => {
                let all = sections.iter().map(|section| follow(section, map.steps())).collect::<Option<Vec<_>>>();
                all.map(|all| all.concat())
            }
        }
    }
}

/// Returns the primes 2, 3, 5, 7, …
fn primes() -> impl Iterator<Item = u64> {
    (2..).filter(|n| (2..).take_while(|d| d * d <= *n).all(|d| n % d != 0))
}

impl SearchResult {
    /// Returns the state of the search after `starts` further starts.
    fn kept(&self, starts: usize) -> SearchState {
        let best = Some(self.best).filter(|best| best.is_finite());
        SearchState { starts, orbits: self.orbits.clone(), best, reason: self.reason.clone() }
    }

    /// Stores a result of Newton's method.
    fn take(&mut self, map: &SectionMap<'_>, solved: Result<Orbit, NewtonFailure>) {
        match solved {
            Ok(orbit) => self.add(map, orbit),
            Err(NewtonFailure { residual, reason })
                if residual <= self.best || residual.is_nan() && self.best == f64::INFINITY =>
            {
                (self.best, self.reason) = (if residual.is_nan() { f64::INFINITY } else { residual }, Some(reason));
            }
            Err(_) => {}
        }
    }

    /// Adds an orbit if none of its points is on a known orbit, each known to its condition times its residual. A family of rests counts as
    /// one orbit, represented by any of them.
    fn add(&mut self, map: &SectionMap<'_>, mut orbit: Orbit) {
        if orbit.is_rest() {
            orbit.round_ones();
            orbit.is_marginal = true;
            let is_family = |known: &Orbit| known.is_rest() && known.section.contacts == orbit.section.contacts;
            if self.orbits.iter().any(is_family) {
                return;
            }
        }
        let unsure = |orbit: &Orbit| (UNSURE * orbit.condition * orbit.residual).min(1e3 * SAME);
        let is_same = |known: &Orbit| {
            let within = SAME + unsure(known).max(unsure(&orbit));
            known.period == orbit.period && known.passes(map, &orbit.section.x, &self.drift, within)
        };
        let is_known = self.orbits.iter().any(is_same);
        if !is_known {
            self.orbits.push(orbit);
        }
    }

    /// Returns the content of the file `orbit.json`.
    #[must_use]
    pub fn report(&self, simulation: &Simulation) -> Value {
        let names = &simulation.structure.spec().freedoms;
        json!({
            "flank": env!("CARGO_PKG_VERSION"),
            "scene": { "name": simulation.name, "sha256": simulation.hash() },
            "components": components(simulation),
            (if simulation.dimensionless { "cycle" } else { "cycle_s" }): simulation.clock().period().map(|period| period.value()),
            "drift": self.drift.directions.iter().zip(&self.drift.is_free).map(|(direction, is_free)| json!({
                "direction": names.iter().zip(direction).map(|(name, d)| (name.clone(), json!(d))).collect::<Map<_, _>>(),
                "multipliers": 1 + usize::from(*is_free),
            })).collect::<Vec<_>>(),
            "orbits": self.orbits.iter().map(|orbit| orbit.report(simulation)).collect::<Vec<_>>(),
            "reason": self.reason,
            "best_residual": if self.best.is_finite() && self.orbits.is_empty() { json!(self.best) } else { Value::Null },
        })
    }
}
