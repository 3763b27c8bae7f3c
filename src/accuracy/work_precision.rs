//! Work–precision of contenders on one problem: errors, orders and costs.

use serde::Serialize;

use super::{
    AccuracyError, Contender, Order, Problem, Score, Setting, SolverKind, Truth, reached, stability::highest_frequency,
};
use crate::{
    baseline::Counters,
    integrate::Choice,
    output::{Table, five_digits},
    task::Task,
};

/// Errors at which costs are compared, periods.
pub(super) const TARGETS: [f64; 3] = [1e-3, 1e-6, 1e-9];
/// Word of the contender that is Flank itself.
const FLANK: &str = "flank";
/// Least time of the runs in each repetition, s, so that a clock resolves it.
const MEASURABLE: f64 = 3e-3;
/// Longest time for one setting, repetitions and all, s.
const PATIENCE: f64 = 6.0;

/// Summary of the runs of one contender.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ContenderSummary {
    /// Name of the contender.
    pub name: String,
    /// Observed and expected order; none for a contender without a fixed step.
    pub order: Option<Order>,
    /// Steps per cycle below which it is unstable with every mesh closed; none without a stability limit.
    pub stable: Option<f64>,
    /// For each of the errors 1e-3, 1e-6 and 1e-9 T: cost relative to that of Flank for this error, or at full precision where Flank is
    /// no contender; and true if the error was reached.
    pub ratios: [Option<(f64, bool)>; 3],
}

/// Median times of one run and of a run of Flank in turn with it, s per cycle, and the median of their ratios.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RunTime {
    /// Time of the run, s per cycle.
    pub seconds_per_cycle: f64,
    /// Time of the run of Flank, s per cycle.
    pub flank_seconds_per_cycle: f64,
    /// Median of the ratios.
    pub ratio: f64,
    /// Repetitions.
    pub repetitions: usize,
}

/// One run of one contender.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ContenderRun<'a> {
    /// Contender that was run.
    pub contender: &'a Contender,
    /// Resolution of the run.
    pub setting: Setting,
    /// Errors against the reference.
    pub score: Score,
    /// Work over the window; for the engine, the number of steps alone.
    pub work: Counters,
    /// Time of the run and that of Flank.
    pub time: RunTime,
    /// Reason for a stop before the end, if it stopped early.
    pub stopped: Option<String>,
}

impl ContenderRun<'_> {
    /// Returns the evaluations of the contact forces; none for the engine, which expands series.
    pub(super) fn evaluations(&self) -> Option<u64> {
        (!matches!(self.contender.kind, SolverKind::Engine(_))).then_some(self.work.evaluations)
    }
}

/// Contenders on one problem: the runs to make, and their errors, work and time.
///
/// ```
/// use flank::{Simulation, Task, accuracy::{Contender, Problem, WorkPrecision}};
/// use std::time::Instant;
///
/// let simulation = Simulation::from_file("examples/scenes/W1a-ss.json")?;
/// let problem = Problem::new(&simulation, Some(2))?;
/// let contenders = [Contender::parse("flank")?, Contender::parse("rk4")?];
/// let mut found = WorkPrecision::new(&problem, &contenders, 1e3, 500)?;
/// let start = Instant::now();
/// assert!(found.run(1, &|| start.elapsed().as_secs_f64(), Task::default())?);
/// let [flank, .., rk4] = &found.rows[..] else { unreachable!("each makes some runs") };
/// assert!(flank.score.event_time < rk4.score.event_time);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct WorkPrecision<'a> {
    pub(super) problem: &'a Problem<'a>,
    contenders: &'a [Contender],
    plan: Vec<(&'a Contender, Setting)>,
    /// The engine's own solution.
    pub truth: Truth,
    /// The runs made.
    pub rows: Vec<ContenderRun<'a>>,
}

impl<'a> WorkPrecision<'a> {
    /// Finds the truth in a window where errors grow less than `growth`-fold, and the settings of each contender with at
    /// most `most_steps` steps.
    ///
    /// # Errors
    /// [`AccuracyError`]; [`AccuracyError::Word`] for a contender that no setting fits.
    pub fn new(
        problem: &'a Problem<'a>,
        contenders: &'a [Contender],
        growth: f64,
        most_steps: u64,
    ) -> Result<Self, AccuracyError> {
        let truth = Truth::find(problem, growth)?;
        let cycles = truth.window.cycles;
        let settings = |c: &'a Contender| c.settings(cycles, most_steps).into_iter().map(move |s| (c, s));
        let plan: Vec<_> = contenders.iter().flat_map(settings).collect();
        if let Some(idle) = contenders.iter().find(|c| !plan.iter().any(|(p, _)| p.name == c.name)) {
            let least = 47 * cycles;
            let problem =
                format!("no run of {cycles} cycles fits into --most-steps {most_steps}: allow {least} or more");
            return Err(AccuracyError::Word { word: idle.name.clone(), problem });
        }
        Ok(Self { problem, contenders, plan, truth, rows: Vec::new() })
    }

    /// Runs to make.
    #[must_use]
    pub fn runs(&self) -> usize {
        self.plan.len()
    }

    /// Makes the runs and times each `repetitions` times with `clock`, which gives seconds. False once `task` is cancelled.
    ///
    /// # Errors
    /// [`AccuracyError`] if the engine fails.
    pub fn run(&mut self, repetitions: u16, clock: &dyn Fn() -> f64, task: Task<'_>) -> Result<bool, AccuracyError> {
        for (contender, setting) in std::mem::take(&mut self.plan) {
            if task.is_cancelled() {
                return Ok(false);
            }
            let run = contender.perform(self.problem, self.truth.window.cycles, setting)?;
            let score = Score::of(&self.truth, &run, self.problem.period);
            let time = self.time(contender, setting, repetitions, clock)?;
            self.rows.push(ContenderRun { contender, setting, score, work: run.work, time, stopped: run.stopped });
            task.advance();
        }
        Ok(true)
    }

    fn time(
        &self,
        contender: &Contender,
        setting: Setting,
        repetitions: u16,
        clock: &dyn Fn() -> f64,
    ) -> Result<RunTime, AccuracyError> {
        let (flank, cycles) = (Contender::parse(FLANK)?, self.truth.window.cycles);
        let once = |contender: &Contender, setting: Setting| -> Result<f64, AccuracyError> {
            let (start, mut runs) = (clock(), 0u32);
            while runs == 0 || clock() - start < MEASURABLE {
                contender.solve(self.problem, cycles, setting)?;
                runs += 1;
            }
            Ok((clock() - start) / f64::from(runs) / cycles as f64)
        };
        let (mut theirs, mut ours, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
        let start = clock();
        while ratios.is_empty() || (ratios.len() < usize::from(repetitions) && clock() - start < PATIENCE) {
            let (a, b) = (once(&flank, Setting::RoundOff)?, once(contender, setting)?);
            ours.push(a);
            theirs.push(b);
            ratios.push(b / a);
        }
        let repetitions = ratios.len();
        let [seconds_per_cycle, flank_seconds_per_cycle, ratio] = [theirs, ours, ratios].map(median);
        Ok(RunTime { seconds_per_cycle, flank_seconds_per_cycle, ratio, repetitions })
    }

    /// Order and costs of each contender.
    #[must_use]
    pub fn summaries(&self) -> Vec<ContenderSummary> {
        let of = |contender: &Contender| {
            let own = || self.rows.iter().filter(|row| row.contender.name == contender.name);
            let right = own().filter(|row| row.score.is_right());
            let steps = right.clone().filter_map(|row| match row.setting {
                Setting::StepsPerCycle(n) => Some((n, row.score.event_time?)),
                _ => None,
            });
            let order = Order::of(contender, self.problem.structure(), &steps.collect::<Vec<_>>(), self.truth.error);
            let costs = own().map(|row| {
                let error = row.score.event_time.filter(|_| row.score.is_right());
                (error.map(|e| e.max(self.truth.error)), row.time.ratio)
            });
            let costs: Vec<(Option<f64>, f64)> = costs.collect();
            // A run that beats the expected order does so by luck: the slope is capped.
            let slope = order.as_ref().and_then(|o| o.observed.map(|p| p.min(o.expected)));
            let ratios = TARGETS.map(|target| reached(&costs, target, slope));
            ContenderSummary { name: contender.name.clone(), order, stable: self.stable_steps(contender), ratios }
        };
        let mut all: Vec<ContenderSummary> = self.contenders.iter().map(of).collect();
        // Relative to the cost of Flank for the same error.
        let own = all.iter().find(|s| s.name == FLANK).map_or([None; 3], |s| s.ratios);
        for ratios in all.iter_mut().map(|s| &mut s.ratios) {
            ratios.iter_mut().zip(own).for_each(|(r, own)| *r = r.map(|(c, at)| (c / own.map_or(1.0, |o| o.0), at)));
        }
        all
    }

    /// Steps a cycle at the stability limit of a method, with every mesh closed; none for a method without one.
    fn stable_steps(&self, contender: &Contender) -> Option<f64> {
        let limit = contender.stability_limit()?;
        let omega = highest_frequency(self.problem.structure().spec(), &self.truth.peak)?;
        Some(omega * self.problem.period / limit)
    }

    /// Returns the setting of a run in words, marked if it is beyond the stability limit.
    fn setting(&self, row: &ContenderRun<'_>) -> String {
        let unstable = match (row.setting, self.stable_steps(row.contender)) {
            (Setting::StepsPerCycle(n), Some(stable)) => (n as f64) < stable,
            _ => false,
        };
        format!("{}{}", row.setting, if unstable { ", unstable" } else { "" })
    }

    /// The fixed-step method that is cheapest at target `i`: reached ones before extrapolated ones.
    fn best<'s>(&self, summaries: &'s [ContenderSummary], i: usize) -> Option<(&'s ContenderSummary, f64, bool)> {
        let fixed =
            |name: &str| self.contenders.iter().any(|c| c.name == name && matches!(c.kind, SolverKind::Fixed(_)));
        summaries
            .iter()
            .filter(|s| fixed(&s.name))
            .filter_map(|s| s.ratios[i].map(|(cost, is_reached)| (s, cost, is_reached)))
            .min_by(|a, b| (!a.2, a.1).partial_cmp(&(!b.2, b.1)).unwrap_or(std::cmp::Ordering::Equal))
    }

    /// Describes the reference and the window in which it holds.
    #[must_use]
    pub fn reference(&self) -> Vec<String> {
        let Truth { window, error, independent, passages, .. } = &self.truth;
        let (cycles, growth) = (window.cycles, fold(window.growth));
        let cut = if window.cut {
            format!(
                "The window ends after {cycles} of {} cycles: there a small error has grown {growth}-fold, and would grow \
                 beyond the limit.",
                self.problem.cycles
            )
        } else {
            format!("The window is the whole run, {cycles} cycles: errors grow {growth}-fold at most.")
        };
        let independent = independent.map_or_else(
            || "No independent integrator confirms it.".to_owned(),
            |e| format!("An explicit Runge-Kutta integrator at 1e-12, with events, agrees to {e:.1e} T."),
        );
        vec![
            format!(
                "Reference: Flank, {} events. It states an error of event times of {error:.1e} T (T = {} s): what its events state \
                 or the difference to a run whose steps are cut elsewhere, and rounding times growth. {independent}",
                passages.len(),
                five_digits(self.problem.period)
            ),
            cut,
        ]
    }

    /// Describes the cost of the best fixed-step method at each error.
    #[must_use]
    pub fn verdicts(&self, summaries: &[ContenderSummary]) -> Vec<String> {
        let best = (0..TARGETS.len()).map(|i| self.best(summaries, i).map(|(s, cost, at)| (&s.name, times(cost), at)));
        let say = |(best, target): (Option<(&String, String, bool)>, f64)| match best {
            Some((name, cost, true)) => {
                format!(
                    "At an error of {target:e} T the best fixed-step method ({name}) takes {cost} times Flank's time."
                )
            }
            Some((name, cost, false)) => format!(
                "At {target:e} T no fixed-step method tried arrives; by the order it shows {name} would take {cost} times \
                 Flank's time."
            ),
            None => format!(
                "At {target:e} T no fixed-step method tried arrives, and none shows an order that tells its cost there."
            ),
        };
        best.zip(TARGETS).map(say).collect()
    }

    /// Returns a table with one line for each run.
    #[must_use]
    pub fn run_table(&self) -> Table {
        let head = [
            "method",
            "setting",
            "event time / T",
            "missed",
            "spurious",
            "apart",
            "state",
            "peak force",
            "energy",
            "steps",
            "evaluations",
            "µs/cycle",
            "× Flank",
        ];
        let small = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") };
        let cycles = self.truth.window.cycles as f64;
        let rows = self.rows.iter().map(|row| {
            let s = &row.score;
            vec![
                row.contender.name.clone(),
                self.setting(row),
                match s.event_time {
                    // The reference against itself: its error is its own estimate.
                    Some(e)
                        if row.contender.kind == SolverKind::Engine(Choice::Auto)
                            && row.setting == Setting::RoundOff =>
                    {
                        format!("≤ {}", small(e.max(self.truth.error)))
                    }
                    e => e.map_or("-".to_owned(), small),
                },
                s.missed.to_string(),
                s.spurious.to_string(),
                s.apart.map_or("-".to_owned(), small),
                s.state.map_or("-".to_owned(), small),
                s.peak_force.map_or("-".to_owned(), small),
                s.energy.map_or("-".to_owned(), small),
                format!("{:.0}", row.work.steps as f64 / cycles),
                row.evaluations().map_or("-".to_owned(), |e| format!("{:.0}", e as f64 / cycles)),
                times(1e6 * row.time.seconds_per_cycle),
                times(row.time.ratio),
            ]
        });
        Table::new(head).with(rows)
    }

    /// Returns a table with one line for each contender; the last column states the reason for a lower order.
    #[must_use]
    pub fn order_table(&self, summaries: &[ContenderSummary]) -> Table {
        let ratio = |r: &Option<(f64, bool)>| match r {
            None => "-".to_owned(),
            Some((cost, true)) => times(*cost),
            Some((cost, false)) => format!("({})", times(*cost)),
        };
        let rows = summaries.iter().map(|s| {
            let order = s.order.as_ref();
            let mut row = vec![
                s.name.clone(),
                order.and_then(|o| o.observed).map_or("-".to_owned(), |o| format!("{o:.2}")),
                order.map_or("-".to_owned(), |o| o.smooth.to_string()),
                s.stable.map_or("-".to_owned(), |n| format!("{:.0}", n.ceil())),
            ];
            row.extend(s.ratios.iter().map(ratio));
            row.push(order.map_or(String::new(), |o| o.reason.clone()));
            row
        });
        let costs = ["× Flank at 1e-3", "at 1e-6", "at 1e-9"];
        let head = ["method", "order seen", "smooth", "stable from, steps"].into_iter().chain(costs);
        Table::new(head.chain(["why the order falls short"])).with(rows)
    }

    /// Runs that stopped before their end, and steps that did not converge.
    #[must_use]
    pub fn failures(&self) -> Vec<String> {
        let unconverged = self.rows.iter().filter(|row| row.work.unconverged > 0).map(|row| {
            let (name, setting, n) = (&row.contender.name, row.setting, row.work.unconverged);
            format!("{name}, {setting}: Newton's iteration did not converge in {n} steps")
        });
        let stopped = |row: &ContenderRun<'_>| {
            Some(format!("{}, {}: {}", row.contender.name, row.setting, row.stopped.as_ref()?))
        };
        self.rows.iter().filter_map(stopped).chain(unconverged).collect()
    }
}

/// Returns a growth as text.
pub(super) fn fold(growth: f64) -> String {
    if growth < 10.0 { format!("{growth:.1}") } else { format!("{growth:.0}") }
}

/// Returns a time or a ratio of times with three digits, which is more than its accuracy.
fn times(x: f64) -> String {
    if !(0.01..1e5).contains(&x) {
        return format!("{x:.2e}");
    }
    let decimals = (2 - libm::log10(x).floor() as i32).clamp(0, 4) as usize;
    format!("{x:.decimals$}")
}

/// Returns the median of at least one value.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] }
}
