//! Work–precision charts.

use super::{Contender, Kind, RunTime, Score, Setting, Truth};
use crate::baseline::Counters;
use crate::integrate::Choice;
use crate::plot::{Axis, Figure, Guide, Panel, Series, Style};

/// One run of one contender.
#[derive(Clone, Debug, PartialEq)]
pub struct Row<'a> {
    /// Which contender.
    pub contender: &'a Contender,
    /// How finely.
    pub setting: Setting,
    /// How far from the truth.
    pub score: Score,
    /// Work over the window; of the engine its steps alone.
    pub work: Counters,
    /// Its time and Flank's.
    pub time: RunTime,
    /// Why it stopped before its end, if it did.
    pub stopped: Option<String>,
}

impl Row<'_> {
    /// Evaluations of the contact forces; none of the engine, which expands series.
    pub(super) fn evaluations(&self) -> Option<u64> {
        (!matches!(self.contender.kind, Kind::Engine(_))).then_some(self.work.evaluations)
    }
}

/// A measure of error: its name, its unit, its value.
type Measure = (&'static str, &'static str, fn(&Score) -> Option<f64>);

const MEASURES: [Measure; 4] = [
    ("largest error of event times", "T", |s| s.event_time),
    ("error of the time apart, share of the window", "", |s| s.apart),
    ("error of the state at the starts of cycles, share of its size", "", |s| s.state),
    ("relative error of the largest force", "", |s| s.peak_force),
];

/// Errors against steps a cycle, and against time. Open marks: the sequence of events is wrong.
pub(super) fn charts(name: &str, truth: &Truth, rows: &[Row<'_>]) -> [Figure; 2] {
    let chart = |id: &str, against: &str, caption: String, x: Axis, cost: &dyn Fn(&Row<'_>) -> f64, count: usize| {
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

/// A growth, as written.
pub(super) fn fold(growth: f64) -> String {
    if growth < 10.0 { format!("{growth:.1}") } else { format!("{growth:.0}") }
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
fn panel(measure: &Measure, points: &[(&Row<'_>, f64)], x: &Axis, truth: &Truth) -> Panel {
    let (name, error_unit, of) = measure;
    let floor = truth.error.max(f64::EPSILON);
    let mut names: Vec<&str> = Vec::new();
    for (row, _) in points {
        if !names.contains(&row.contender.name.as_str()) {
            names.push(&row.contender.name);
        }
    }
    let mut series = Vec::new();
    let mut next = (0..).filter(|c| *c != ENGINE);
    for name in &names {
        let is_engine = |row: &Row<'_>| row.contender.name == *name && row.contender.kind == Kind::Engine(Choice::Auto);
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
            series.push(Series::line("sequence of events wrong", colour, wrong_x, wrong_y).styled(Style::Marks));
        }
    }
    let reference = || Guide::Horizontal { y: floor, name: "error of the reference".to_owned() };
    let guides = (*name == MEASURES[0].0).then(reference).into_iter().collect();
    Panel { x: x.clone(), y: logarithmic(name, error_unit), series, guides, ..Panel::default() }
}
