//! What `flank compare` says: text, files, report.

use std::path::Path;

use flank::{
    accuracy::{
        Contender, Kind, Order, Problem, Row, Setting, Timed, Truth, by_steps, by_time, fold, orders, reached,
        stability::highest_frequency,
    },
    integrate::Choice,
    output::Folder,
    plot::{Cell, Figure, Item, Report, Section, Table as ReportTable},
};
use serde::Serialize;
use serde_json::{Value, json};

use super::{
    CliError,
    session::Session,
    study::{REPORT, forms, write},
    table::{Table, number},
};

const TABLE: &str = "compare.csv";
const ERRORS: &str = "compare.json";
const TIMING: &str = "timing.json";

/// Errors at which costs are compared, periods.
const TARGETS: [f64; 3] = [1e-3, 1e-6, 1e-9];

/// What one contender's runs come to.
pub struct Summary {
    pub name: String,
    pub order: Option<Order>,
    /// Steps a cycle below which it is unstable with every mesh closed, if it is anywhere.
    pub stable: Option<f64>,
    /// For each target: cost over Flank's, and whether it was reached.
    pub ratios: [Option<(f64, bool)>; 3],
}

/// Times of one run and of Flank's beside it, s a cycle, and the median of their ratios.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Time {
    pub seconds_per_cycle: f64,
    pub flank_seconds_per_cycle: f64,
    pub ratio: f64,
    pub repetitions: usize,
}

pub struct Comparison<'a> {
    pub session: &'a Session,
    pub problem: &'a Problem<'a>,
    pub truth: &'a Truth,
    pub rows: &'a [Row<'a>],
    pub times: &'a [Time],
    pub stopped: &'a [Option<String>],
}

impl Comparison<'_> {
    /// Order and costs of each contender.
    pub fn summaries(&self, contenders: &[Contender]) -> Vec<Summary> {
        let of = |contender: &Contender| {
            let own = || self.rows.iter().zip(self.times).filter(|(row, _)| row.contender.name == contender.name);
            let right = own().filter(|(row, _)| row.score.is_right());
            let steps = right.clone().filter_map(|(row, _)| match row.setting {
                Setting::StepsPerCycle(n) => Some((n, row.score.event_time?)),
                _ => None,
            });
            let order = orders(contender, self.problem.structure, &steps.collect::<Vec<_>>(), self.truth.error);
            let costs: Vec<(Option<f64>, f64)> = own()
                .map(|(row, time)| {
                    let error = row.score.event_time.filter(|_| row.score.is_right());
                    (error.map(|e| e.max(self.truth.error)), time.ratio)
                })
                .collect();
            // Better than it can be for long it is by chance.
            let slope = order.as_ref().and_then(|o| o.observed.map(|p| p.min(o.expected)));
            let ratios = TARGETS.map(|target| reached(&costs, target, slope));
            Summary { name: contender.name.clone(), order, stable: self.stable_steps(contender), ratios }
        };
        contenders.iter().map(of).collect()
    }

    /// Steps a cycle at the stability limit of a method, with every mesh closed; none for a method without one.
    fn stable_steps(&self, contender: &Contender) -> Option<f64> {
        let Kind::Fixed(method) = contender.kind else { return None };
        let omega = highest_frequency(self.problem.structure.spec(), &self.truth.peak)?;
        Some(omega * self.problem.period / method.stability_limit()?)
    }

    /// A setting, marked where it is beyond the limit.
    fn setting(&self, row: &Row<'_>) -> String {
        let unstable = match (row.setting, self.stable_steps(row.contender)) {
            (Setting::StepsPerCycle(n), Some(stable)) => (n as f64) < stable,
            _ => false,
        };
        format!("{}{}", row.setting, if unstable { ", unstable" } else { "" })
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
                "The window ends after {} of {} cycles: there a small error has grown {}-fold, and would grow beyond the limit.",
                window.cycles,
                self.problem.cycles,
                fold(window.growth)
            )
        } else {
            format!(
                "The window is the whole run, {} cycles: errors grow {}-fold at most.",
                window.cycles,
                fold(window.growth)
            )
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
                    "At {target:e} T no fixed-step method tried arrives; by the order it shows {} would take {} times Flank's time.",
                    best.name,
                    times(cost)
                ),
                None => format!("At {target:e} T no fixed-step method tried arrives, and none shows an order that tells its cost there."),
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
                self.setting(row),
                match s.event_time {
                    // The reference beside itself: its error is what it states.
                    Some(e) if row.contender.kind == Kind::Engine(Choice::Auto) => {
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
                    s.stable.map_or("-".to_owned(), |n| format!("{:.0}", n.ceil())),
                ];
                row.extend(s.ratios.iter().map(ratio));
                row.push(order.map_or(String::new(), |o| o.reason.clone()));
                row
            })
            .collect()
    }

    pub fn text(&self, summaries: &[Summary], out: Option<&Path>) -> String {
        let mut text = format!("{}\n\n", self.session.scene.name());
        for line in self.reference() {
            text += &format!("{line}\n");
        }
        if out.is_none() {
            let (head, rows) = self.table();
            text += &format!("\n{}", Table::new(head).with(rows));
        }
        text += "\n";
        // Without the last column, which follows in words.
        let (columns, mut rows) = (ORDERS.len() - 1, self.order_rows(summaries));
        rows.iter_mut().for_each(|row| row.truncate(columns));
        text += &format!("{}\n", Table::new(&ORDERS[..columns]).with(rows));
        for s in summaries {
            let order = s.order.as_ref().filter(|o| !o.reason.is_empty());
            text += &order.map_or(String::new(), |o| format!("{} falls short of its order: {}\n", s.name, o.reason));
        }
        for line in self.verdicts(summaries) {
            text += &format!("{line}\n");
        }
        let failures = self.failures();
        if !failures.is_empty() {
            text += "\nFailed:\n";
            failures.iter().for_each(|line| text += &format!("  {line}\n"));
        }
        out.map_or(text.clone(), |out| text + &format!("\nreport: {}\n", out.join("report.html").display()))
    }

    fn failures(&self) -> Vec<String> {
        let unconverged = self.rows.iter().filter(|row| row.work.unconverged > 0).map(|row| {
            let (name, setting, n) = (&row.contender.name, row.setting, row.work.unconverged);
            format!("{name}, {setting}: Newton's iteration did not converge in {n} steps")
        });
        let rows = self.rows.iter().zip(self.stopped);
        rows.filter_map(|(row, why)| Some(format!("{}, {}: {}", row.contender.name, row.setting, why.as_ref()?)))
            .chain(unconverged)
            .collect()
    }

    /// The files that `write` writes.
    pub fn files() -> Vec<String> {
        let figures = ["work-precision", "work-precision-time"].into_iter().flat_map(forms);
        figures.chain([TABLE, ERRORS, TIMING, REPORT].map(String::from)).collect()
    }

    pub fn write(&self, folder: &mut Folder, summaries: &[Summary]) -> Result<(), CliError> {
        let name = &self.session.title();
        let timed: Vec<Timed<'_>> = self
            .rows
            .iter()
            .zip(self.times)
            .map(|(row, time)| Timed { row, seconds: time.seconds_per_cycle })
            .collect();
        let figures = [by_steps(name, self.truth, self.rows), by_time(name, self.truth, &timed)];
        for figure in &figures {
            write(folder, figure)?;
        }
        folder.bytes(TABLE, self.csv().as_bytes())?;
        folder.complete(ERRORS, &self.json(summaries))?;
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
        folder.complete(TIMING, &json!({ "rows": times, "costs": ratios }))?;
        Ok(folder.bytes(REPORT, self.report(summaries, figures).html().as_bytes())?)
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
        let orders = summaries.iter().filter_map(|s| {
            Some(json!({ "method": s.name, "order": s.order.as_ref()?, "stable_from_steps_per_cycle": s.stable }))
        });
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
                maybe(s.apart),
                maybe(s.state),
                maybe(s.peak_force),
                maybe(s.energy),
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
            note: "Costs are times over Flank's; in brackets: not reached, told from the order seen.".to_owned(),
        };
        let section =
            |title: &str, text: &str, items| Section { title: title.to_owned(), text: text.to_owned(), items };
        Report {
            title: format!("Accuracy against work: {}", self.session.title()),
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
const ORDERS: [&str; 8] = [
    "method",
    "order seen",
    "smooth",
    "stable from, steps",
    "× Flank at 1e-3",
    "at 1e-6",
    "at 1e-9",
    "why the order falls short",
];

/// A time or a ratio of times: three digits are more than it is known to.
fn times(x: f64) -> String {
    if !(0.01..1e5).contains(&x) {
        return format!("{x:.2e}");
    }
    let decimals = (2 - x.log10().floor() as i32).clamp(0, 4) as usize;
    format!("{x:.decimals$}")
}
