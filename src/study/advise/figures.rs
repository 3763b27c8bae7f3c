//! Charts of an advice.

use std::f64::consts::TAU;

use super::{Advice, Rung};
use crate::plot::{Axis, Figure, Guide, Note, Panel, Series, Style};

/// Least number drawn on a logarithmic axis; smaller ones are drawn at this value.
const LEAST: f64 = 1e-6;

/// Row of a chart: its name, and an optional value of each series.
struct ChartRow {
    words: String,
    values: Vec<Option<f64>>,
}

/// Returns rows of points, one above the other in the order given, each under its name.
fn rows(title: &str, x: Axis, names: &[&str], rows: &[ChartRow], guide: Guide) -> Panel {
    let sizes = |k: usize| rows.iter().enumerate().filter_map(move |(i, row)| Some(((i + 1) as f64, row.values[k]?)));
    let drawn = |value: f64| if x.logarithmic { value.abs().max(LEAST) } else { value };
    let series = names.iter().enumerate().map(|(k, name)| {
        let (y, values): (Vec<f64>, Vec<f64>) = sizes(k).unzip();
        Series::line(*name, k, values.into_iter().map(drawn).collect(), y).styled(Style::Points)
    });
    let series: Vec<Series> = series.filter(|series| !series.x.is_empty()).collect();
    let values = || series.iter().flat_map(|series| series.x.iter().copied());
    let own = match guide {
        Guide::Vertical { x, .. } => x,
        _ => 0.0,
    };
    let highest = values().fold(own, f64::max);
    let [low, high] = if x.logarithmic { [LEAST / 2.0, 3.0 * highest] } else { [0.0, 1.1 * highest] };
    // Inside the left edge.
    let edge = if x.logarithmic { 1.05 * low } else { 0.005 * high };
    let notes = rows.iter().enumerate().map(|(i, row)| Note { at: [edge, (i + 1) as f64], text: row.words.clone() });
    Panel {
        title: title.to_owned(),
        x: x.between(low, high),
        // Room for the name above the highest row.
        y: Axis { places: true, ..Axis::new("from least to largest change", "") }.between(0.5, rows.len() as f64 + 0.8),
        notes: notes.collect(),
        series,
        guides: vec![guide],
        names_above: true,
        ..Panel::default()
    }
}

fn logarithmic(label: &str) -> Axis {
    Axis { logarithmic: true, ..Axis::new(label, "") }
}

/// Returns the largest absolute value of a change, which orders the rows.
fn change(rung: &Rung) -> f64 {
    rung.apart_change().abs().max(rung.peak_change().unwrap_or(0.0).abs())
}

fn sorted<T>(items: impl Iterator<Item = T>, of: impl Fn(&T) -> f64) -> Vec<T> {
    let mut items: Vec<T> = items.collect();
    items.sort_by(|a, b| of(a).total_cmp(&of(b)));
    items
}

fn tolerance(advice: &Advice) -> Guide {
    Guide::Vertical { x: advice.tolerance, name: "tolerance".to_owned() }
}

impl Advice {
    /// Returns the charts of the cost of each simplification and of the freedoms; a chart without data is left out.
    #[must_use]
    pub fn figures(&self) -> Vec<Figure> {
        [rungs(self), freedoms(self)].into_iter().flatten().collect()
    }
}

/// Returns the chart of cost and saving of each rung: changes of time apart and peak force, and its work relative to that of the scene.
pub(super) fn rungs(advice: &Advice) -> Option<Figure> {
    let together = advice.together.iter().map(|rung| (rung, "all that is enough, together"));
    let all = sorted(advice.rungs.iter().map(|rung| (rung, rung.words.as_str())).chain(together), |(r, _)| change(r));
    let row = |of: &dyn Fn(&Rung) -> Vec<Option<f64>>| -> Vec<ChartRow> {
        all.iter().map(|(rung, words)| ChartRow { words: (*words).to_owned(), values: of(rung) }).collect()
    };
    let changes = rows(
        "What it changes",
        logarithmic("change"),
        &["time without force, forcing periods", "peak force, relative"],
        &row(&|rung| vec![Some(rung.apart_change()), rung.peak_change()]),
        tolerance(advice),
    );
    let work = advice.full.work();
    let scene = Guide::Vertical { x: 1.0, name: "the scene".to_owned() };
    let own = row(&|rung| vec![None, None, Some(rung.work() / work)]);
    let takes = rows("What it takes", Axis::new("work, relative to the scene", ""), &["", "", ""], &own, scene);
    (!all.is_empty()).then(|| Figure {
        id: "rungs".to_owned(),
        title: "What each simplification costs".to_owned(),
        caption: format!(
            "Changes: the largest of any family of contacts, against the scene; left of the tolerance a model is enough. Changes \
             below {LEAST:e} are drawn there. Work: freedoms times the dense steps of a forcing cycle."
        ),
        columns: 2,
        panels: vec![changes, takes],
    })
}

/// Returns the chart of the freedoms: share in the motion, and the change from holding each group; the natural modes.
pub(super) fn freedoms(advice: &Advice) -> Option<Figure> {
    let dropped = advice.parts.iter().filter_map(|part| Some((part, part.dropped.as_ref()?)));
    let all = sorted(dropped, |(_, rung)| change(rung));
    let row = |(part, rung): &(&super::Participation, &Rung)| ChartRow {
        words: part.group.words.clone(),
        values: vec![Some(rung.apart_change()), rung.peak_change(), part.share],
    };
    let names = ["time without force, forcing periods", "peak force, relative", "share of the motion's kinetic energy"];
    let mut panels = Vec::new();
    if !all.is_empty() {
        let own: Vec<ChartRow> = all.iter().map(row).collect();
        panels.push(rows("Held, one group at a time", logarithmic("change, share"), &names, &own, tolerance(advice)));
    }
    panels.extend(modes(advice));
    (!panels.is_empty()).then(|| Figure {
        id: "freedoms".to_owned(),
        title: "Which freedoms matter".to_owned(),
        caption: format!(
            "Changes: each group of freedoms held by itself; left of the tolerance it can be dropped. Changes and shares below \
             {LEAST:e} are drawn there. Weights of the natural modes, every contact closed, sum to one."
        ),
        columns: 2,
        panels,
    })
}

fn modes(advice: &Advice) -> Vec<Panel> {
    if advice.modes.is_empty() {
        return Vec::new();
    }
    let (factor, x) = if advice.dimensionless {
        (1.0, Axis::new("natural frequency, rad per unit of time", ""))
    } else {
        (TAU.recip(), Axis::new("natural frequency", "Hz"))
    };
    let highest = advice.modes.iter().map(|mode| factor * mode.omega).fold(0.0, f64::max);
    let x = if highest > 0.0 { x.between(0.0, 1.05 * highest) } else { x };
    let stems = |name: String, colour: usize, values: Vec<f64>| {
        let x = advice.modes.iter().map(|mode| factor * mode.omega).collect();
        Series::line(name, colour, x, values).styled(Style::Stems)
    };
    let panel = |title: String, label: &str, series: Series| Panel {
        title,
        x: x.clone(),
        y: Axis::new(label, "").between(0.0, 1.0),
        series: vec![series],
        ..Panel::default()
    };
    let mut panels = Vec::new();
    let motion: Vec<f64> = advice.modes.iter().filter_map(|mode| mode.motion).collect();
    if motion.len() == advice.modes.len() {
        let series = stems(String::new(), 4, motion);
        panels.push(panel("Natural modes in the motion".to_owned(), "share of its kinetic energy", series));
    }
    for (i, family) in advice.families.iter().enumerate().take(4) {
        let weights = advice.modes.iter().map(|mode| mode.meshes[i]).collect();
        let series = stems(String::new(), 3, weights);
        panels.push(panel(format!("Natural modes in the deflection of {family}"), "weight", series));
    }
    panels
}
