//! The files of a [`WorkPrecision`]: data, charts, report.

use serde_json::{Value, json};

use super::{
    ContenderRun, ContenderSummary, Score, SolverKind, Truth, WorkPrecision,
    work_precision::{TARGETS, fold},
};
use crate::{
    integrate::Choice,
    output::{Folder, OutputError, Table},
    plot::{Axis, Figure, Guide, Item, Panel, Print, Report, Section, Series, Style},
};

const TABLE: &str = "compare.csv";
const ERRORS: &str = "compare.json";
const TIMING: &str = "timing.json";

impl WorkPrecision<'_> {
    /// Names of the files that [`write`](Self::write) writes.
    #[must_use]
    pub fn files() -> Vec<String> {
        Report::files(["work-precision", "work-precision-time"], &[TABLE, ERRORS, TIMING])
    }

    /// Writes table, errors, times, charts and report.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    pub fn write(&self, folder: &mut Folder, summaries: &[ContenderSummary], print: &Print) -> Result<(), OutputError> {
        let name = self.problem.simulation.title();
        let figures = charts(name, &self.truth, &self.rows);
        figures.iter().try_for_each(|figure| figure.write(folder, print))?;
        folder.bytes(TABLE, self.csv())?;
        folder.complete(ERRORS, &self.json(summaries))?;
        let time =
            |row: &ContenderRun<'_>| json!({ "method": row.contender.name, "setting": row.setting, "time": row.time });
        let times: Vec<Value> = self.rows.iter().map(time).collect();
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
        self.report(summaries, figures).write(folder, print)
    }

    /// Errors and counters: the same input gives the same file. Times are in `timing.json`.
    fn json(&self, summaries: &[ContenderSummary]) -> Value {
        let simulation = self.problem.simulation;
        let Truth { window, error, independent, passages, sizes, .. } = &self.truth;
        let rows = self.rows.iter().map(|row| {
            let mut work = json!(row.work);
            work["evaluations"] = json!(row.evaluations());
            json!({
                "method": row.contender.name, "setting": row.setting, "right_sequence": row.score.is_right(),
                "error": row.score, "work": work, "stopped": row.stopped,
            })
        });
        let orders = summaries.iter().filter_map(|s| {
            Some(json!({ "method": s.name, "order": s.order.as_ref()?, "stable_from_steps_per_cycle": s.stable }))
        });
        json!({
            "flank": env!("CARGO_PKG_VERSION"),
            "scene": simulation.name,
            "scene_sha256": simulation.hash(),
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
        let head = "method,setting,event_time_error_periods,missed,spurious,apart_error,state_error,peak_force_error,\
                        energy_error,steps,evaluations,newton_iterations,factorisations,unconverged_steps";
        let mut table = Table::new(head.split(','));
        let maybe = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        for row in &self.rows {
            let (s, w) = (&row.score, &row.work);
            let found = [row.contender.name.to_string(), row.setting.to_string(), maybe(s.event_time)];
            let errors = [s.apart, s.state, s.peak_force, s.energy].map(maybe);
            let counts =
                [Some(w.steps), row.evaluations(), Some(w.iterations), Some(w.factorisations), Some(w.unconverged)];
            let counts = counts.map(|count| count.map_or(String::new(), |count| count.to_string()));
            let events = [s.missed, s.spurious].map(|count| count.to_string());
            table.rows.push([&found[..], &events, &errors, &counts].concat());
        }
        table.csv()
    }

    fn report(&self, summaries: &[ContenderSummary], figures: [Figure; 2]) -> Report {
        let simulation = self.problem.simulation;
        let runs = self.run_table().titled("Runs", self.failures().join("; "));
        let note = "Costs are times over those of Flank for the same error; in brackets: not reached, extrapolated with the order seen.";
        let orders = self.order_table(summaries).titled("Orders and costs", note);
        Report {
            title: format!("Accuracy against work: {}", simulation.title()),
            summary: self.reference().into_iter().chain(self.verdicts(summaries)).collect(),
            sections: vec![
                Section::new("Charts", "", figures.map(Item::Figure).to_vec()),
                Section::new(
                    "Orders",
                    "The order seen is the slope of the error of event times on the finest steps. The last \
                     column says why it falls short of the order on a smooth motion.",
                    vec![orders.into()],
                ),
                Section::new("All runs", "", vec![runs.into()]),
            ],
            provenance: vec![
                format!("flank {}", env!("CARGO_PKG_VERSION")),
                format!("scene {}; SHA-256 {}", simulation.name, simulation.hash().unwrap_or_default()),
            ],
            files: Some("figures".to_owned()),
        }
    }
}

/// A measure of error: its name, its unit, its value.
type ErrorMeasure = (&'static str, &'static str, fn(&Score) -> Option<f64>);

const MEASURES: [ErrorMeasure; 4] = [
    ("largest error of event times", "T", |s| s.event_time),
    ("error of the time apart, share of the window", "", |s| s.apart),
    ("error of the state at the starts of cycles, share of its size", "", |s| s.state),
    ("relative error of the largest force", "", |s| s.peak_force),
];

/// Errors against steps a cycle, and against time. Open marks: the sequence of events is wrong.
fn charts(name: &str, truth: &Truth, rows: &[ContenderRun<'_>]) -> [Figure; 2] {
    let chart =
        |id: &str, against: &str, caption: String, x: Axis, cost: &dyn Fn(&ContenderRun<'_>) -> f64, count: usize| {
            let points: Vec<_> = rows.iter().map(|row| (row, cost(row))).collect();
            let panels = MEASURES[..count].iter().map(|m| panel(m, &points, &x, truth));
            Figure {
                id: id.to_owned(),
                title: format!("Accuracy against {against}: {name}"),
                caption,
                columns: 2,
                panels: panels.filter(|p| !p.series.is_empty()).collect(),
            }
        };
    let (cycles, caption) = (truth.window.cycles as f64, caption(truth));
    let timed = format!("{caption} Medians of alternating repetitions on one core.");
    let (steps, time) = (logarithmic("steps a cycle", ""), logarithmic("time a cycle", "µs"));
    [
        chart("work-precision", "steps", caption, steps, &|row| row.work.steps as f64 / cycles, MEASURES.len()),
        chart("work-precision-time", "time", timed, time, &|row| 1e6 * row.time.seconds_per_cycle, 2),
    ]
}

fn logarithmic(label: &str, unit: &str) -> Axis {
    Axis { logarithmic: true, ..Axis::new(label, unit) }
}

fn caption(truth: &Truth) -> String {
    let window = truth.window;
    format!(
        "Over the first {} cycles{}; T is one cycle. The reference states an error of {:.0e} T. Open marks: the \
         sequence of events is wrong.",
        window.cycles,
        if window.cut { format!(", where errors grow {}-fold at most", fold(window.growth)) } else { String::new() },
        truth.error
    )
}

/// The colour of ink: the engine's.
const ENGINE: usize = 6;

/// Errors of nothing cannot be drawn on a logarithmic axis; they stand at the truth's own.
fn panel(measure: &ErrorMeasure, points: &[(&ContenderRun<'_>, f64)], x: &Axis, truth: &Truth) -> Panel {
    let (name, error_unit, of) = measure;
    let floor = truth.error.max(f64::EPSILON);
    let mut names: Vec<&str> = Vec::new();
    for (row, _) in points {
        if !names.contains(&row.contender.name.as_str()) {
            names.push(&row.contender.name);
        }
    }
    // Wrong runs come last: the legend follows the order of the series.
    let (mut series, mut wrong) = (Vec::new(), Vec::new());
    let mut next = (0..).filter(|c| *c != ENGINE);
    for name in &names {
        let is_engine = |row: &ContenderRun<'_>| {
            row.contender.name == *name && row.contender.kind == SolverKind::Engine(Choice::Auto)
        };
        let is_engine = points.iter().any(|(row, _)| is_engine(row));
        let colour = if is_engine { ENGINE } else { next.next().unwrap_or(0) };
        let all: Vec<(f64, f64, bool)> = points
            .iter()
            .filter(|(row, _)| row.contender.name == *name)
            .filter_map(|(row, cost)| Some((*cost, of(&row.score)?, row.score.is_right())))
            .filter(|(_, error, _)| error.is_finite())
            .collect();
        let curve = |right: bool| -> (Vec<f64>, Vec<f64>) {
            all.iter().filter(|p| p.2 == right).map(|p| (p.0, p.1.max(floor))).unzip()
        };
        let ((x, y), (wrong_x, wrong_y)) = (curve(true), curve(false));
        if !x.is_empty() {
            series.push(Series::line(*name, colour, x, y).styled(Style::Joined));
        }
        if !wrong_x.is_empty() {
            wrong.push(Series::line("sequence of events wrong", colour, wrong_x, wrong_y).styled(Style::Marks));
        }
    }
    series.extend(wrong);
    let reference = || Guide::Horizontal { y: floor, name: "error of the reference".to_owned() };
    let guides = (*name == MEASURES[0].0).then(reference).into_iter().collect();
    Panel { x: x.clone(), y: logarithmic(name, error_unit), series, guides, ..Panel::default() }
}
