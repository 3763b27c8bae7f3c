//! Lyapunov exponents: rates at which neighbouring motions part, from the tangent and its factors.
//!
//! The columns of the tangent are made orthonormal repeatedly, `W X = Q R`, with the scales W of the components. The exponents are the
//! means of `ln R_ii` over time (Benettin et al. 1980, with jumps Müller 1995). Their sum is the mean rate of volumes, which the divergence
//! of the field along arcs and `ln |det|` of the jumps give independently.

use serde::{Deserialize, Serialize};

use super::{
    Drift, Section, SectionMap,
    averages::{Averages, BLOCKS},
    frame::{Frame, FrameState, rate_scale},
    words::{Sequence, Statistics, WordObserver},
};
use crate::{
    engine::{Engine, State},
    simulation::{Simulation, SimulationError},
    task::{Progress, Task},
};

/// Least number of cycles dropped.
const DROPPED: u64 = 1000;
/// Maximum number of cycles averaged, unless their number is given.
const MOST: u64 = 1_000_000;
/// Largest accepted band of the largest exponent, as a share of the largest in size.
const BAND: f64 = 1e-3;
/// Largest difference between the sum and its rule, as a share of the largest exponent: relative rounding of logarithms is some 1e-13.
const RULE: f64 = 1e-9;
/// Reason that interrupted work gives for its end.
pub const INTERRUPTED: &str = "interrupted";
/// Cycles whose words are read.
const SPELLED: u64 = 100_000;
/// Cycles after which a run restarts from its present state, as a resumed run does.
const KEPT: u64 = 8192;
/// Roundings of a step or an event, in units of ε of the state.
const ROUNDED: f64 = 2.0;

/// Settings of the computation of Lyapunov exponents.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lyapunov {
    /// Cycles averaged; if absent, until the band of the largest exponent is small.
    pub cycles: Option<u64>,
    /// True to compute the exponents of resets alone too, which shows the effect of saltation.
    pub without_saltation: bool,
    /// Cycles from the start over which finite-time exponents are computed too.
    pub finite: Option<u64>,
}

/// Exponents with their standard errors. `null` is −∞.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Exponents {
    /// Exponents, 1/s, largest first, one for each displacement and velocity that does not drift. Then `null` for each rank that rest takes
    /// and for each latched speed.
    pub exponents: Vec<Option<f64>>,
    /// One standard error of each exponent.
    pub band: Vec<Option<f64>>,
    /// Sum of the finite exponents; `null` before the first cycle.
    pub sum: Option<f64>,
    /// Predicted value of the sum; `null` if contacts rest or latch speeds.
    pub sum_rule: Option<f64>,
    /// Cycles averaged.
    pub cycles: u64,
    /// Cycles dropped before them.
    pub dropped: u64,
    /// Unit of the exponents: `1/s`, or `1/time` if the scene has no units.
    pub unit: &'static str,
    /// Directions of drift left out, each with exponent 0.
    pub drift: usize,
    /// True if impacts that depend on each other fell on one instant. The derivative is then that of neighbours that keep them together;
    /// others may part faster.
    pub piecewise: bool,
    /// Statistics of the words of the averaged cycles, of at most the first hundred thousand.
    pub words: Statistics,
    /// Reason for stopping before the band was small enough, or before the end.
    pub reason: Option<String>,
    /// True if all requested cycles are averaged.
    #[serde(skip)]
    pub is_whole: bool,
    /// True if the sum contradicts its rule: the exponents must not be used.
    #[serde(skip)]
    pub is_contradictory: bool,
    /// Exponents from the derivative of each reset alone, without the change of event times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_saltation: Option<WithoutSaltation>,
    /// Finite-time exponents of the first cycles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub finite: Option<Finite>,
    /// Course of the averages: cycles averaged, mean and band of each exponent.
    #[serde(skip)]
    pub course: Vec<(u64, Vec<f64>, Vec<f64>)>,
}

/// Exponents without saltation.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct WithoutSaltation {
    /// Description of what is left out.
    pub way: &'static str,
    /// Exponents, as [`Exponents::exponents`].
    pub exponents: Vec<Option<f64>>,
}

/// Exponents of a number of cycles from the start, with the unit matrix as initial columns.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Finite {
    /// Number of cycles.
    pub cycles: u64,
    /// Exponents in the order of the columns.
    pub exponents: Vec<Option<f64>>,
    /// Error of each exponent from rounding: its change if the start moves by the rounding of the whole run. `null` if no run from there is
    /// possible.
    pub errors: Vec<Option<f64>>,
}

/// State of the averages, from which a run resumes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Averaging {
    /// Cycles run, including those dropped.
    cycle: u64,
    section: Section,
    frame: FrameState,
    averages: Averages,
    /// Columns and averages of resets alone.
    bare: Option<(FrameState, Averages)>,
    /// Volume rate `∫ div f dt + Σ ln |det|`; `None` if unknown.
    volume: Option<f64>,
    piecewise: bool,
    sequence: Sequence,
    course: Vec<(u64, Vec<f64>, Vec<f64>)>,
    next_look: u64,
    next_point: u64,
    finite: Option<Finite>,
}

/// Motion, its tangents, and the sums of their factors.
struct FramedRun<'s> {
    engine: Engine<'s>,
    frame: Frame<'s>,
    bare: Option<Frame<'s>>,
}

impl<'s> FramedRun<'s> {
    /// Starts at `section` after `cycle` cycles, with the kept columns, if any.
    fn new(
        map: &SectionMap<'s>,
        drift: &'s Drift,
        (section, cycle): (&Section, u64),
        held: Option<(&FrameState, Option<&FrameState>)>,
        without_saltation: bool,
    ) -> Result<Self, SimulationError> {
        let simulation = map.simulation();
        let start = map.later(cycle).state(section)?;
        let framed = |held: Option<&FrameState>| {
            let mut frame = Frame::new(simulation, drift, rate_scale(simulation));
            frame.start(&start);
            held.iter().for_each(|held| frame.hold(held));
            frame
        };
        let frame = framed(held.map(|(held, _)| held));
        let bare = without_saltation.then(|| {
            let mut bare = framed(held.and_then(|(_, held)| held));
            bare.tangent.without_saltation();
            bare
        });
        Ok(Self { engine: simulation.engine(start)?, frame, bare })
    }

    fn held(&self) -> (FrameState, Option<FrameState>) {
        (self.frame.held(), self.bare.as_ref().map(Frame::held))
    }
}

impl Lyapunov {
    /// Returns the exponents of the motion that the scene runs to.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails, or for a train without a forcing period.
    pub fn run(&self, simulation: &Simulation, task: Task<'_>) -> Result<Exponents, SimulationError> {
        self.go_on(simulation, None, &mut |_| (), task)
    }

    /// Returns the exponents as [`run`](Self::run), resumed from `earlier` averages of the same train, if any; every so many cycles `keep` receives the present
    /// averages. The result is the same to the last bit, however often it was interrupted.
    ///
    /// # Errors
    /// Errors of [`run`](Self::run).
    pub fn go_on(
        &self,
        simulation: &Simulation,
        earlier: Option<Averaging>,
        keep: &mut (dyn FnMut(&Averaging) + Send),
        task: Task<'_>,
    ) -> Result<Exponents, SimulationError> {
        let map = SectionMap::new(simulation)?;
        let (drift, period) = (map.drift(), simulation.period()?);
        // Earlier averages contain them.
        let finite = match self.finite.filter(|_| earlier.is_none()) {
            Some(cycles) => finite_time(&map, &drift, cycles, period, task)?,
            None => None,
        };
        self.average(&map, &drift, earlier, finite, keep, task)
    }

    fn average(
        &self,
        map: &SectionMap<'_>,
        drift: &Drift,
        earlier: Option<Averaging>,
        finite: Option<Finite>,
        keep: &mut (dyn FnMut(&Averaging) + Send),
        task: Task<'_>,
    ) -> Result<Exponents, SimulationError> {
        let simulation = map.simulation();
        let period = simulation.period()?;
        let run = &simulation.settings;
        let [from, _, end] = simulation.instants();
        let least = self.cycles.unwrap_or_else(|| (end.cycle - from.cycle).max(1) as u64);
        let most = self.cycles.unwrap_or(MOST.max(least));
        let dropped = DROPPED.max(run.transient_cycles);
        let begin = |at: (&Section, u64), held: Option<(&FrameState, Option<&FrameState>)>| {
            FramedRun::new(map, drift, at, held, self.without_saltation)
        };
        let (mut now, mut running) = match earlier {
            Some(earlier) => {
                let held = (&earlier.frame, earlier.bare.as_ref().map(|(held, _)| held));
                let running = begin((&earlier.section, earlier.cycle), Some(held))?;
                (earlier, running)
            }
            None => {
                let section = map.start()?;
                let running = begin((&section, 0), None)?;
                let (frame, bare) = running.held();
                let now = Averaging {
                    cycle: 0,
                    section,
                    frame,
                    averages: Averages::default(),
                    bare: bare.map(|held| (held, Averages::default())),
                    volume: Some(0.0),
                    piecewise: false,
                    sequence: Sequence::default(),
                    course: Vec::new(),
                    next_look: least,
                    next_point: 2 * BLOCKS as u64,
                    finite,
                };
                (now, running)
            }
        };
        let mut words = WordObserver::new(&simulation.structure, &now.section.x);
        let (mut reason, mut is_whole) = (None, true);
        while now.cycle < dropped + most {
            if now.cycle.is_multiple_of(KEPT) && now.cycle > 0 {
                let (frame, bare) = running.held();
                (now.section, now.frame) = (map.section(running.engine.state()), frame);
                now.bare.iter_mut().zip(bare).for_each(|((held, _), bare)| *held = bare);
                keep(&now);
                let held = (&now.frame, now.bare.as_ref().map(|(held, _)| held));
                running = begin((&now.section, now.cycle), Some(held))?;
            }
            now.cycle += 1;
            let FramedRun { engine, frame, bare } = &mut running;
            let spells = now.cycle <= dropped + SPELLED;
            let observer = &mut ((&mut *frame, &mut *bare), spells.then_some(&mut words));
            let run = map.advance(engine, map.at(now.cycle), observer);
            let (logs, bare_logs) = (frame.take(), bare.as_mut().map(Frame::take));
            let all_logs = logs.iter().chain(bare_logs.iter().flatten());
            if let Err(error) = run.and_then(|()| known(simulation, engine.state(), frame, all_logs)) {
                // An incomplete cycle is ignored.
                if now.averages.cycles == 0 && now.finite.is_none() {
                    return Err(error);
                }
                (now.cycle, reason, is_whole) = (now.cycle - 1, Some(error.to_string()), false);
                break;
            }
            // Twice: columns that have turned to the trace of a speed latched once have to turn back.
            if [dropped / 2, dropped].contains(&now.cycle) {
                frame.begin();
                bare.iter_mut().for_each(Frame::begin);
            }
            let word = words.take();
            if now.cycle > dropped {
                if spells {
                    now.sequence.add(&word);
                }
                now.averages.add(&logs);
                now.bare.iter_mut().zip(bare_logs).for_each(|((_, averages), logs)| averages.add(&logs));
                now.volume = now.volume.map(|volume| volume + frame.tangent.volume).filter(|volume| volume.is_finite());
            }
            frame.tangent.volume = 0.0;
            now.piecewise |= frame.tangent.corner.is_some();
            if task.is_cancelled() {
                (reason, is_whole) = (Some(INTERRUPTED.to_owned()), false);
                break;
            }
            let averaged = now.averages.cycles;
            if now.cycle % 64 == 0 {
                task.report(Progress::Share(now.cycle as f64 / (dropped + most) as f64));
            }
            if now.cycle <= dropped || averaged < now.next_look.min(now.next_point) {
                continue;
            }
            let (mean, band) = now.averages.figures(period);
            let largest =
                mean.iter().zip(&frame.lost).filter(|(_, lost)| !**lost).fold(0.0, |m: f64, (e, _)| m.max(e.abs()));
            // The band of the largest finite one; none is finite if rest takes all ranks.
            let first = (0..mean.len()).filter(|l| !frame.lost[*l]).max_by(|a, b| mean[*a].total_cmp(&mean[*b]));
            let is_good = first.is_none_or(|l| band[l] <= BAND * largest);
            if mean.iter().chain(&band).all(|number| number.is_finite()) {
                now.course.push((averaged, mean, band));
            }
            now.next_point = averaged + averaged / 8 + 1;
            if averaged < now.next_look {
                continue;
            }
            if self.cycles.is_none() && is_good {
                break;
            }
            now.next_look = (averaged + averaged / 8 + 1).min(most);
            if averaged == most && !is_good && self.cycles.is_none() {
                reason = Some(format!("stopped after {most} cycles, before the band was below {BAND} of the largest"));
            }
        }
        let (mean, band) = now.averages.figures(period);
        let lost = &running.frame.lost;
        let latches = running.engine.state().x.len() - 2 * simulation.structure.freedoms();
        let null = |values: &[f64]| -> Vec<Option<f64>> {
            let mut order: Vec<usize> = (0..values.len()).filter(|l| !lost[*l]).collect();
            order.sort_by(|a, b| mean[*b].total_cmp(&mean[*a]));
            let known = order.iter().map(|l| Some(values[*l]).filter(|v| v.is_finite()));
            known.chain(std::iter::repeat_n(None, values.len() - order.len() + latches)).collect()
        };
        let bare = now.bare.as_ref().zip(running.bare.as_ref()).map(|((_, averages), bare)| {
            let (means, _) = averages.figures(period);
            let known = means.iter().zip(&bare.lost).filter(|(mean, lost)| !**lost && mean.is_finite());
            let mut values: Vec<f64> = known.map(|(mean, _)| *mean).collect();
            values.sort_by(|a, b| b.total_cmp(a));
            let lost = bare.lost.iter().filter(|lost| **lost).count() + latches;
            WithoutSaltation {
                way: "the derivative of each reset alone, without the change of event times",
                exponents: values.into_iter().map(Some).chain(std::iter::repeat_n(None, lost)).collect(),
            }
        });
        let exponents = null(&mean);
        let cycles = now.averages.cycles;
        // The empty sum would be -0.
        let sum = (cycles > 0).then(|| exponents.iter().flatten().sum::<f64>() + 0.0);
        let known = now.volume.filter(|_| latches == 0 && cycles > 0);
        let sum_rule = known.map(|volume| volume / (cycles as f64 * period));
        let largest = exponents.iter().flatten().fold(0.0, |m: f64, e| m.max(e.abs()));
        let mut is_contradictory = false;
        if let (Some(sum), Some(rule)) = (sum, sum_rule)
            && (sum - rule).abs() > RULE * largest
        {
            (is_whole, is_contradictory) = (false, true);
            reason = Some(format!("the exponents have the sum {sum}, which must be {rule}: do not use them"));
        }
        Ok(Exponents {
            sum,
            band: null(&band),
            exponents,
            sum_rule,
            cycles,
            dropped,
            unit: if simulation.dimensionless { "1/time" } else { "1/s" },
            drift: drift.is_free.iter().map(|free| 1 + usize::from(*free)).sum(),
            piecewise: now.piecewise,
            words: now.sequence.statistics(),
            reason,
            is_whole,
            is_contradictory,
            without_saltation: bare,
            finite: now.finite,
            course: now.course,
        })
    }
}

/// Checks that the state, the columns and their logarithms are finite numbers after a cycle.
fn known<'l>(
    simulation: &Simulation,
    state: &State,
    frame: &Frame<'_>,
    mut logs: impl Iterator<Item = &'l f64>,
) -> Result<(), SimulationError> {
    let what = if !state.x.iter().all(|x| x.is_finite()) {
        "its motion leaves the range of numbers"
    } else if frame.is_unresolved() {
        "the derivative along a step of its motion cannot be resolved"
    } else if !logs.all(|log| log.is_finite()) {
        "the derivative of its motion leaves the range of numbers"
    } else {
        return Ok(());
    };
    Err(simulation.missing(what))
}

/// Returns the exponents of the first `cycles` cycles, and their errors from rounding.
/// `None` if it is cancelled.
fn finite_time(
    map: &SectionMap<'_>,
    drift: &Drift,
    cycles: u64,
    period: f64,
    task: Task<'_>,
) -> Result<Option<Finite>, SimulationError> {
    let simulation = map.simulation();
    let start = map.start()?;
    // The exponents, and the number of steps and events.
    type ExponentsWithTime = (Vec<Option<f64>>, f64);
    let from = |section: &Section| -> Result<Option<ExponentsWithTime>, SimulationError> {
        let start = map.state(section)?;
        let mut frame = Frame::new(simulation, drift, 1.0);
        frame.start(&start);
        let mut engine = simulation.engine(start)?;
        for cycle in 1..=cycles {
            map.advance(&mut engine, map.at(cycle), &mut frame)?;
            if task.is_cancelled() {
                return Ok(None);
            }
        }
        let logs = frame.take();
        known(simulation, engine.state(), &frame, logs.iter())?;
        let exponent = |(log, lost): (&f64, &bool)| (!lost).then_some(log / (cycles as f64 * period));
        let counters = engine.counters();
        let exponents: Vec<Option<f64>> = logs.iter().zip(&frame.lost).map(exponent).collect();
        Ok(Some((exponents, (counters.steps + counters.events) as f64)))
    };
    let Some((exponents, pieces)) = from(&start)? else { return Ok(None) };
    // A rounding on the way counts at most as much as one at the start: the rest of the way amplifies it less.
    let (scales, n) = (map.scales_of(std::slice::from_ref(&start)), simulation.structure.freedoms());
    let moved = |sign: f64| {
        let mut moved = start.clone();
        let size = sign * ROUNDED * f64::EPSILON * pieces.sqrt();
        let by = |i: usize| size * scales[i] * [1.0, -1.0][i % 2];
        moved.x.iter_mut().enumerate().take(2 * n).for_each(|(i, x)| *x += by(i));
        from(&moved).ok().flatten().map(|(exponents, _)| exponents)
    };
    let moved = rayon::join(|| moved(1.0), || moved(-1.0));
    let error = |l: usize| {
        let change = |moved: &Option<Vec<Option<f64>>>| Some((moved.as_ref()?.get(l)?.as_ref()? - exponents[l]?).abs());
        Some(change(&moved.0)?.max(change(&moved.1)?))
    };
    let errors = (0..exponents.len()).map(error).collect();
    Ok((!task.is_cancelled()).then_some(Finite { cycles, exponents, errors }))
}
