//! `flank compare`.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant as Stopwatch},
};

use flank::{
    accuracy::{
        AccuracyError, Contender, Kind, Order, Problem, Row, Setting, Timed, Truth, by_steps, by_time, orders, reached,
    },
    plot::{Cell, Figure, Item, Report, Section, Table as ReportTable},
    scene::Duration as Length,
};
use serde::Serialize;
use serde_json::{Value, json};

use super::{
    CliError, Done,
    folder::Folder,
    print,
    progress::{catch_interrupt, counting, interrupted},
    session::Session,
    study::write,
    table::{Table, number},
};

/// Arguments of `flank compare`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Methods, such as rk4, newmark, hht=0.1, verlet, rk4+tanh=1e6, bdf, flank; all that apply if left out
    #[arg(long, value_name = "METHOD", num_args = 1..)]
    methods: Vec<String>,
    /// Write compare.json, compare.csv, timing.json, charts and report.html into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Cycles to compare over, at most; the scene's own, but not more than 50, if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    cycles: Option<u64>,
    /// The window ends before errors grow so many times
    #[arg(long, value_name = "X", default_value_t = 1e3, value_parser = growth)]
    growth: f64,
    /// Most steps of one run
    #[arg(long, value_name = "N", default_value_t = 5_000_000)]
    most_steps: u64,
    /// Timed repetitions of each run
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    repetitions: u16,
    /// Write into a folder that is not empty
    #[arg(long, requires = "out")]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

fn growth(word: &str) -> Result<f64, String> {
    word.parse().ok().filter(|x| (1.0..=1e6).contains(x)).ok_or_else(|| "a number from 1 to 1e6".to_owned())
}

/// What is compared if nobody says.
const USUAL: [&str; 11] = [
    "flank",
    "rk4",
    "rk4+cubic",
    "newmark",
    "hht",
    "generalized-alpha",
    "verlet",
    "euler",
    "tsit45",
    "bdf",
    "flank-explicit",
];
/// Cycles if nobody says.
const CYCLES: u64 = 50;
/// Errors at which costs are compared, periods.
const TARGETS: [f64; 3] = [1e-3, 1e-6, 1e-9];
/// Flank is run so long in each repetition that a clock can tell.
const MEASURABLE: Duration = Duration::from_millis(3);
/// One setting is not timed longer than this, repetitions and all.
const PATIENCE: Duration = Duration::from_secs(6);

/// What one contender's runs come to.
struct Summary {
    name: String,
    order: Option<Order>,
    /// For each target: cost over Flank's, and whether it was reached.
    ratios: [Option<(f64, bool)>; 3],
}

/// Compares methods on a scene.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let session = Session::open(arguments.scene.as_deref())?;
    let problem = problem(&session, arguments.cycles);
    let contenders = contenders(arguments, &problem)?;
    let folder = arguments.out.as_deref().map(|path| Folder::open(path, arguments.force)).transpose()?;
    catch_interrupt();

    let truth = Truth::find(&problem, arguments.growth)?;
    let cycles = truth.window.cycles;
    let plan: Vec<(&Contender, Setting)> = contenders
        .iter()
        .flat_map(|c| c.settings(cycles, arguments.most_steps).into_iter().map(move |s| (c, s)))
        .collect();
    let bar = counting("runs", arguments.quiet);
    bar.set_length(plan.len() as u64);
    let (mut rows, mut times, mut stopped) = (Vec::new(), Vec::new(), Vec::new());
    for (contender, setting) in plan {
        if interrupted() {
            bar.finish_and_clear();
            return print("interrupted: nothing was written\n").map(|()| Done::Partly);
        }
        let run = contender.perform(&problem, cycles, setting)?;
        let score = flank::accuracy::score(&truth, &run, problem.period);
        stopped.push(run.stopped);
        rows.push(Row { contender, setting, score, work: run.work });
        times.push(time(contender, setting, &problem, cycles, arguments.repetitions)?);
        bar.inc(1);
    }
    bar.finish_and_clear();

    let comparison = Comparison {
        session: &session,
        problem: &problem,
        truth: &truth,
        rows: &rows,
        times: &times,
        stopped: &stopped,
    };
    let summaries = comparison.summaries(&contenders);
    if let Some(folder) = &folder {
        comparison.write(folder, arguments.out.as_deref().unwrap_or(Path::new(".")), &summaries)?;
    }
    if !arguments.quiet {
        print(&comparison.text(&summaries, arguments.out.as_deref()))?;
    }
    Ok(Done::Completely)
}

fn problem(session: &Session, cycles: Option<u64>) -> Problem<'_> {
    let run = &session.case.built.run;
    let clock = session.case.clock();
    let [from, _, end] = session.instants;
    let span = clock.between(from, end);
    let period = run.period.or_else(|| clock.period().map(|t| t.value())).unwrap_or(span);
    let own = match run.duration {
        Length::Cycles(n) => n,
        // OK to convert: whole cycles within the run.
        Length::Until(_) => ((span / period * (1.0 + 1e-12)).floor() as u64).max(1),
    };
    Problem {
        structure: &session.case.structure,
        start: session.start.clone(),
        period,
        cycles: cycles.unwrap_or(own.min(CYCLES)),
        choice: run.method,
        tolerance: run.tolerance,
    }
}

fn contenders(arguments: &Arguments, problem: &Problem<'_>) -> Result<Vec<Contender>, CliError> {
    let mut faults = Vec::new();
    let mut found: Vec<Contender> = Vec::new();
    let words: Vec<&str> = if arguments.methods.is_empty() {
        USUAL.to_vec()
    } else {
        // Flank is what the others are measured against.
        std::iter::once("flank").chain(arguments.methods.iter().map(String::as_str)).collect()
    };
    for word in words {
        match Contender::parse(word) {
            Ok(contender) if found.iter().any(|c| c.name == contender.name) => {}
            Ok(contender) if contender.applies_to(problem.structure) => found.push(contender),
            Ok(_) if arguments.methods.is_empty() => {}
            Ok(_) => faults.push(AccuracyError::Word {
                word: word.to_owned(),
                problem: "it cannot solve this scene: it needs a force at every contact, and a build with the feature \
                          diffsol"
                    .to_owned(),
            }),
            Err(error) => faults.push(error),
        }
    }
    if faults.is_empty() { Ok(found) } else { Err(CliError::Methods(faults)) }
}

/// Times of one run and of Flank's beside it, s a cycle, and the median of their ratios.
#[derive(Clone, Copy, Debug, Serialize)]
struct Time {
    seconds_per_cycle: f64,
    flank_seconds_per_cycle: f64,
    ratio: f64,
    repetitions: usize,
}

fn time(
    contender: &Contender,
    setting: Setting,
    problem: &Problem<'_>,
    cycles: u64,
    repetitions: u16,
) -> Result<Time, CliError> {
    let flank = Contender::parse("flank")?;
    let once = |contender: &Contender, setting: Setting| -> Result<f64, CliError> {
        let watch = Stopwatch::now();
        let mut runs = 0u32;
        while runs == 0 || watch.elapsed() < MEASURABLE {
            contender.solve(problem, cycles, setting)?;
            runs += 1;
        }
        Ok(watch.elapsed().as_secs_f64() / f64::from(runs) / cycles as f64)
    };
    let (mut theirs, mut ours, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let watch = Stopwatch::now();
    while ratios.is_empty() || (ratios.len() < usize::from(repetitions) && watch.elapsed() < PATIENCE) {
        let (a, b) = (once(&flank, Setting::RoundOff)?, once(contender, setting)?);
        ours.push(a);
        theirs.push(b);
        ratios.push(b / a);
    }
    let repetitions = ratios.len();
    let [seconds_per_cycle, flank_seconds_per_cycle, ratio] = [theirs, ours, ratios].map(median);
    Ok(Time { seconds_per_cycle, flank_seconds_per_cycle, ratio, repetitions })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] }
}

struct Comparison<'a> {
    session: &'a Session,
    problem: &'a Problem<'a>,
    truth: &'a Truth,
    rows: &'a [Row<'a>],
    times: &'a [Time],
    stopped: &'a [Option<String>],
}

impl Comparison<'_> {
    /// Order and costs of each contender.
    fn summaries(&self, contenders: &[Contender]) -> Vec<Summary> {
        let of = |contender: &Contender| {
            let own = || self.rows.iter().zip(self.times).filter(|(row, _)| row.contender.name == contender.name);
            let right = own().filter(|(row, _)| row.score.is_right());
            let steps = right.clone().filter_map(|(row, _)| match row.setting {
                Setting::StepsPerCycle(n) => Some((n, row.score.event_time?)),
                _ => None,
            });
            let order = orders(contender, self.problem.structure, &steps.collect::<Vec<_>>(), self.truth.error);
            // A run with a wrong sequence is as wrong as can be.
            let costs: Vec<(f64, f64)> = own()
                .map(|(row, time)| {
                    let error = row.score.event_time.filter(|_| row.score.is_right()).unwrap_or(1.0);
                    (error.max(self.truth.error), time.ratio)
                })
                .collect();
            Summary { name: contender.name.clone(), order, ratios: TARGETS.map(|target| reached(&costs, target)) }
        };
        contenders.iter().map(of).collect()
    }

    /// The fixed-step method that is cheapest at target `i`: reached ones before extrapolated ones.
    fn best<'s>(&self, summaries: &'s [Summary], i: usize) -> Option<(&'s Summary, f64, bool)> {
        let fixed = |name: &str| {
            self.rows.iter().any(|row| row.contender.name == name && matches!(row.contender.kind, Kind::Fixed(_)))
        };
        summaries
            .iter()
            .filter(|s| fixed(&s.name))
            .filter_map(|s| s.ratios[i].map(|(cost, is_reached)| (s, cost, is_reached)))
            .min_by(|a, b| (!a.2, a.1).partial_cmp(&(!b.2, b.1)).unwrap_or(std::cmp::Ordering::Equal))
    }

    fn reference(&self) -> Vec<String> {
        let Truth { window, error, independent, passages, .. } = self.truth;
        let cut = if window.cut {
            format!(
                "The window ends after {} of {} cycles: there a small error has grown {:.0}-fold, and would grow beyond the limit.",
                window.cycles, self.problem.cycles, window.growth
            )
        } else {
            format!(
                "The window is the whole run, {} cycles: errors grow {:.0}-fold at most.",
                window.cycles, window.growth
            )
        };
        let independent = independent.map_or_else(
            || "No independent integrator confirms it.".to_owned(),
            |e| format!("An explicit Runge-Kutta integrator at 1e-12, with events, agrees to {e:.1e} T."),
        );
        vec![
            format!(
                "Reference: Flank, {} events. It states an error of event times of {error:.1e} T (T = {} s): the largest of what \
                 each event states and of the difference to a run whose steps are cut elsewhere. {independent}",
                passages.len(),
                number(self.problem.period)
            ),
            cut,
        ]
    }

    fn verdicts(&self, summaries: &[Summary]) -> Vec<String> {
        let mut lines = Vec::new();
        for (i, target) in TARGETS.iter().enumerate() {
            lines.push(match self.best(summaries, i) {
                Some((best, cost, true)) => {
                    format!("At an error of {target:e} T the best fixed-step method ({}) takes {} times Flank's time.", best.name, times(cost))
                }
                Some((best, cost, false)) => format!(
                    "At {target:e} T no fixed-step method tried arrives; on its last slope {} would take {} times Flank's time.",
                    best.name,
                    times(cost)
                ),
                None => format!("At {target:e} T no fixed-step method tried arrives, and none is on its way there."),
            });
        }
        lines
    }

    fn table(&self) -> (Vec<&'static str>, Vec<Vec<String>>) {
        let head = vec![
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
        let rows = self.rows.iter().zip(self.times).map(|(row, time)| {
            let s = &row.score;
            vec![
                row.contender.name.clone(),
                row.setting.to_string(),
                s.event_time.map_or("-".to_owned(), small),
                s.missed.to_string(),
                s.spurious.to_string(),
                small(s.apart),
                small(s.state),
                s.peak_force.map_or("-".to_owned(), small),
                small(s.energy),
                format!("{:.0}", row.work.steps as f64 / cycles),
                row.work.evaluations.map_or("-".to_owned(), |e| format!("{:.0}", e as f64 / cycles)),
                times(1e6 * time.seconds_per_cycle),
                times(time.ratio),
            ]
        });
        (head, rows.collect())
    }

    fn order_rows(&self, summaries: &[Summary]) -> Vec<Vec<String>> {
        let ratio = |r: &Option<(f64, bool)>| match r {
            None => "-".to_owned(),
            Some((cost, true)) => times(*cost),
            Some((cost, false)) => format!("({})", times(*cost)),
        };
        summaries
            .iter()
            .map(|s| {
                let order = s.order.as_ref();
                let mut row = vec![
                    s.name.clone(),
                    order.and_then(|o| o.observed).map_or("-".to_owned(), |o| format!("{o:.2}")),
                    order.map_or("-".to_owned(), |o| o.smooth.to_string()),
                ];
                row.extend(s.ratios.iter().map(ratio));
                row.push(order.map_or(String::new(), |o| o.reason.clone()));
                row
            })
            .collect()
    }

    fn text(&self, summaries: &[Summary], out: Option<&Path>) -> String {
        let mut text = format!("{}\n\n", self.session.scene.name());
        for line in self.reference() {
            text += &format!("{line}\n");
        }
        let (head, rows) = self.table();
        let mut table = Table::new(&head);
        rows.into_iter().for_each(|row| table.row(row));
        text += &format!("\n{table}\n");
        let mut table = Table::new(&ORDERS);
        self.order_rows(summaries).into_iter().for_each(|row| table.row(row));
        text += &format!("{table}\n");
        for line in self.verdicts(summaries) {
            text += &format!("{line}\n");
        }
        let failures = self.failures();
        if !failures.is_empty() {
            text += "\nStopped:\n";
            failures.iter().for_each(|line| text += &format!("  {line}\n"));
        }
        out.map_or(text.clone(), |out| text + &format!("\nreport: {}\n", out.join("report.html").display()))
    }

    fn failures(&self) -> Vec<String> {
        let rows = self.rows.iter().zip(self.stopped);
        rows.filter_map(|(row, why)| Some(format!("{}, {}: {}", row.contender.name, row.setting, why.as_ref()?)))
            .collect()
    }

    fn write(&self, folder: &Folder, out: &Path, summaries: &[Summary]) -> Result<(), CliError> {
        let name = self.session.scene.name();
        let timed: Vec<Timed<'_>> = self
            .rows
            .iter()
            .zip(self.times)
            .map(|(row, time)| Timed { row, seconds: time.seconds_per_cycle })
            .collect();
        let figures = [by_steps(name, self.truth, self.rows), by_time(name, self.truth, &timed)];
        let place = Folder::open(&out.join("figures"), true)?;
        for figure in &figures {
            write(&place, figure)?;
        }
        folder.bytes("compare.csv", self.csv().as_bytes())?;
        folder.complete("compare.json", &self.json(summaries))?;
        let times: Vec<Value> = self
            .rows
            .iter()
            .zip(self.times)
            .map(|(row, time)| json!({ "method": row.contender.name, "setting": row.setting, "time": time }))
            .collect();
        let ratios: Vec<Value> = summaries
            .iter()
            .map(|s| {
                let at = TARGETS.iter().zip(&s.ratios).map(
                    |(t, r)| json!({ "error_periods": t, "times_flank": r.map(|r| r.0), "reached": r.map(|r| r.1) }),
                );
                json!({ "method": s.name, "at": at.collect::<Vec<_>>() })
            })
            .collect();
        folder.complete("timing.json", &json!({ "rows": times, "costs": ratios }))?;
        folder.bytes("report.html", self.report(summaries, figures).html().as_bytes())
    }

    /// Errors and counters: the same input gives the same file. Times are in `timing.json`.
    fn json(&self, summaries: &[Summary]) -> Value {
        let Truth { window, error, independent, passages, sizes, .. } = self.truth;
        let rows = self.rows.iter().zip(self.stopped).map(|(row, stopped)| {
            json!({
                "method": row.contender.name, "setting": row.setting, "right_sequence": row.score.is_right(),
                "error": row.score, "work": row.work, "stopped": stopped,
            })
        });
        let orders = summaries.iter().filter_map(|s| Some(json!({ "method": s.name, "order": s.order.as_ref()? })));
        json!({
            "flank": env!("CARGO_PKG_VERSION"),
            "scene": self.session.scene.name(),
            "scene_sha256": self.session.scene.hash(),
            "period_s": self.problem.period,
            "reference": {
                "events": passages.len(), "error_periods": error, "independent_difference_periods": independent,
                "window_cycles": window.cycles, "window_growth": window.growth, "window_cut": window.cut, "sizes": sizes,
            },
            "rows": rows.collect::<Vec<_>>(),
            "orders": orders.collect::<Vec<_>>(),
        })
    }

    fn csv(&self) -> String {
        let mut text =
            "method,setting,event_time_error_periods,missed,spurious,apart_error,state_error,peak_force_error,\
                        energy_error,steps,evaluations,newton_iterations,factorisations,unconverged_steps\r\n"
                .to_owned();
        let maybe = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        for row in self.rows {
            let (s, w) = (&row.score, &row.work);
            text += &format!(
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{}\r\n",
                row.contender.name,
                row.setting,
                maybe(s.event_time),
                s.missed,
                s.spurious,
                s.apart,
                s.state,
                maybe(s.peak_force),
                s.energy,
                w.steps,
                w.evaluations.map_or(String::new(), |e| e.to_string()),
                w.iterations,
                w.factorisations,
                w.unconverged
            );
        }
        text
    }

    fn report(&self, summaries: &[Summary], figures: [Figure; 2]) -> Report {
        let cells = |row: &Vec<String>| row.iter().map(|c| Cell::from(c.as_str())).collect::<Vec<_>>();
        let (head, rows) = self.table();
        let owned = |head: &[&str]| head.iter().map(|h| (*h).to_owned()).collect::<Vec<_>>();
        let runs = ReportTable {
            title: "Runs".to_owned(),
            head: owned(&head),
            rows: rows.iter().map(cells).collect(),
            note: self.failures().join("; "),
        };
        let orders = ReportTable {
            title: "Orders and costs".to_owned(),
            head: owned(&ORDERS),
            rows: self.order_rows(summaries).iter().map(cells).collect(),
            note: "Costs are times over Flank's; in brackets: not reached, followed on along the last slope."
                .to_owned(),
        };
        let section =
            |title: &str, text: &str, items| Section { title: title.to_owned(), text: text.to_owned(), items };
        Report {
            title: format!("Accuracy against work: {}", self.session.scene.name()),
            summary: self.reference().into_iter().chain(self.verdicts(summaries)).collect(),
            sections: vec![
                section("Charts", "", figures.map(Item::Figure).to_vec()),
                section(
                    "Orders",
                    "The order seen is the slope of the error of event times on the finest steps. What it falls short of is said \
                     beside it.",
                    vec![Item::Table(orders)],
                ),
                section("All runs", "", vec![Item::Table(runs)]),
            ],
            provenance: vec![
                format!("flank {}", env!("CARGO_PKG_VERSION")),
                format!("scene {}; SHA-256 {}", self.session.scene.name(), self.session.scene.hash()),
            ],
            files: Some("figures".to_owned()),
        }
    }
}

/// Head of the table of orders.
const ORDERS: [&str; 7] =
    ["method", "order seen", "smooth", "× Flank at 1e-3", "at 1e-6", "at 1e-9", "why the order falls short"];

/// A time or a ratio of times: three digits are more than it is known to.
fn times(x: f64) -> String {
    if !(0.01..1e5).contains(&x) {
        return format!("{x:.2e}");
    }
    let decimals = (2 - x.log10().floor() as i32).clamp(0, 4) as usize;
    format!("{x:.decimals$}")
}
