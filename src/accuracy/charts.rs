//! Work–precision charts.

use super::{Contender, Kind, Score, Setting, Truth, Work};
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
    /// Work over the window.
    pub work: Work,
}

/// A row with its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed<'a> {
    /// The run.
    pub row: &'a Row<'a>,
    /// Time a cycle, s.
    pub seconds: f64,
}

/// A measure of error: its name, its unit, its value.
type Measure = (&'static str, &'static str, fn(&Score) -> Option<f64>);

const MEASURES: [Measure; 4] = [
    ("largest error of event times", "T", |s| s.event_time),
    ("error of the time apart, share of the window", "", |s| s.apart),
    ("error of the state at the starts of cycles, share of its size", "", |s| s.state),
    ("relative error of the largest force", "", |s| s.peak_force),
];

/// Errors against steps a cycle. Open marks: the sequence of events is wrong.
#[must_use]
pub fn by_steps(name: &str, truth: &Truth, rows: &[Row<'_>]) -> Figure {
    let cycles = truth.window.cycles as f64;
    let points: Vec<_> = rows.iter().map(|row| (row, row.work.steps as f64 / cycles)).collect();
    let panels = MEASURES.iter().map(|m| panel(m, &points, ("steps a cycle", ""), truth));
    Figure {
        id: "work-precision".to_owned(),
        title: format!("Accuracy against steps: {name}"),
        caption: caption(truth),
        columns: 2,
        panels: panels.filter(|p| !p.series.is_empty()).collect(),
    }
}

/// Errors against time.
#[must_use]
pub fn by_time(name: &str, truth: &Truth, rows: &[Timed<'_>]) -> Figure {
    let points: Vec<_> = rows.iter().map(|t| (t.row, 1e6 * t.seconds)).collect();
    let panels = MEASURES[..2].iter().map(|m| panel(m, &points, ("time a cycle", "µs"), truth));
    Figure {
        id: "work-precision-time".to_owned(),
        title: format!("Accuracy against time: {name}"),
        caption: format!("{} Medians of alternating repetitions on one core.", caption(truth)),
        columns: 2,
        panels: panels.filter(|p| !p.series.is_empty()).collect(),
    }
}

/// A growth, as written.
#[must_use]
pub fn fold(growth: f64) -> String {
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
fn panel(measure: &Measure, points: &[(&Row<'_>, f64)], (label, unit): (&str, &str), truth: &Truth) -> Panel {
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
    let log = |label: &str, unit: &str| Axis { logarithmic: true, ..Axis::new(label, unit) };
    let guides = if measure.0 == MEASURES[0].0 {
        vec![Guide::Horizontal { y: floor, name: "error of the reference".to_owned() }]
    } else {
        Vec::new()
    };
    Panel { x: log(label, unit), y: log(name, error_unit), series, guides, ..Panel::default() }
}
