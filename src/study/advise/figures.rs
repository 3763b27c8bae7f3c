//! The charts of an advice.

use std::f64::consts::TAU;

use super::{Advice, Rung, ladder::Ladder};
use crate::plot::{Axis, Figure, Guide, Note, Panel, Series, Style};

/// Changes below this are drawn at this: on a logarithmic axis nothing has no place.
const LEAST: f64 = 1e-6;

/// Size of a change, as it is drawn.
fn size(change: f64) -> f64 {
    change.abs().max(LEAST)
}

fn changes_axis(label: &str, unit: &str) -> Axis {
    Axis { logarithmic: true, ..Axis::new(label, unit) }
}

fn tolerance(advice: &Advice) -> Guide {
    Guide::Horizontal { y: advice.tolerance, name: "tolerance".to_owned() }
}

/// A point of a chart: what it is, its series, where.
struct Point {
    words: String,
    series: (String, usize),
    x: f64,
    y: f64,
}

/// Points with their names, series by series.
fn panel(title: &str, x: Axis, y: Axis, points: &[Point], guide: Guide) -> Panel {
    let mut series: Vec<Series> = Vec::new();
    for point in points {
        let (name, colour) = &point.series;
        if series.iter().all(|known| known.name != *name) {
            series.push(Series::line(name.clone(), *colour, Vec::new(), Vec::new()).styled(Style::Points));
        }
        if let Some(own) = series.iter_mut().find(|known| known.name == *name) {
            own.x.push(point.x);
            own.y.push(point.y);
        }
    }
    let notes = points.iter().map(|point| Note { at: [point.x, point.y], text: point.words.clone() }).collect();
    Panel { title: title.to_owned(), x, y, series, notes, guides: vec![guide], ..Panel::default() }
}

/// What each rung costs: changes of time apart and peak force against the steps it takes.
#[must_use]
pub fn rungs(advice: &Advice) -> Option<Figure> {
    let points = |of: &dyn Fn(&Rung) -> Option<f64>| -> Vec<Point> {
        let own = |(i, rung): (usize, &Rung)| {
            let (series, colour) = match rung.ladder {
                Some(ladder) if i < advice.rungs.len() => {
                    (ladder.word(), Ladder::ALL.iter().position(|l| *l == ladder).unwrap_or(0))
                }
                _ => ("together", 7),
            };
            let y = size(of(rung)?);
            let words = if series == "together" { series.to_owned() } else { rung.words.clone() };
            Some(Point { words, series: (series.to_owned(), colour), x: rung.motion.work.steps, y })
        };
        advice.rungs.iter().chain(&advice.together).enumerate().filter_map(own).collect()
    };
    let steps = || Axis::new("steps a forcing cycle", "");
    let full = || Guide::Vertical { x: advice.full.motion.work.steps, name: "the scene".to_owned() };
    let mut panels = vec![panel(
        "Time apart",
        steps(),
        changes_axis("change, forcing periods", ""),
        &points(&|rung| Some(rung.apart_change())),
        tolerance(advice),
    )];
    let peaks = points(&Rung::peak_change);
    if !peaks.is_empty() {
        panels.push(panel("Peak force", steps(), changes_axis("change, relative", ""), &peaks, tolerance(advice)));
    }
    panels.iter_mut().for_each(|panel| panel.guides.push(full()));
    (!advice.rungs.is_empty()).then(|| Figure {
        id: "rungs".to_owned(),
        title: "What each simplification costs".to_owned(),
        caption: format!(
            "Largest change of any family of contacts against the scene, over the dense steps the model takes. Below the dashed \
             tolerance a model is enough. Changes below {LEAST:e} are drawn there."
        ),
        columns: 2,
        panels,
    })
}

/// Which freedoms matter: what holding each group changes against its share in the motion, and the natural modes.
#[must_use]
pub fn freedoms(advice: &Advice) -> Option<Figure> {
    let mut panels = Vec::new();
    let points = |of: &dyn Fn(&Rung) -> Option<f64>| -> Vec<Point> {
        let own = |part: &super::Part| {
            let y = size(of(part.dropped.as_ref()?)?);
            let series = ("held".to_owned(), 0);
            Some(Point { words: part.group.words.clone(), series, x: part.share?.max(LEAST), y })
        };
        advice.parts.iter().filter_map(own).collect()
    };
    let share = || Axis { logarithmic: true, ..Axis::new("share of the motion's kinetic energy", "") };
    for (title, label, points) in [
        ("Time apart", "change, forcing periods", points(&|rung| Some(rung.apart_change()))),
        ("Peak force", "change, relative", points(&Rung::peak_change)),
    ] {
        if !points.is_empty() {
            let mut panel = panel(title, share(), changes_axis(label, ""), &points, tolerance(advice));
            // One kind of point needs no legend.
            panel.series.iter_mut().for_each(|series| series.name.clear());
            panels.push(panel);
        }
    }
    if !advice.modes.is_empty() {
        let (factor, x) = if advice.dimensionless {
            (1.0, Axis::new("natural frequency, rad per unit of time", ""))
        } else {
            (TAU.recip(), Axis::new("natural frequency", "Hz"))
        };
        let stems = |(name, colour, values): (String, usize, Vec<f64>)| {
            let x = advice.modes.iter().map(|mode| factor * mode.omega).collect();
            Series::line(name, colour, x, values).styled(Style::Stems)
        };
        let mut series: Vec<Series> = Vec::new();
        let of_motion: Vec<f64> = advice.modes.iter().filter_map(|mode| mode.motion).collect();
        for (i, family) in advice.families.iter().enumerate() {
            let values = advice.modes.iter().map(|mode| mode.meshes[i]).collect();
            series.push(stems((format!("deflection of {family}"), i, values)));
        }
        let title = "Modes in the deflection of a contact".to_owned();
        let y = || Axis::new("weight", "").between(0.0, 1.0);
        panels.push(Panel { title, x: x.clone(), y: y(), series, ..Panel::default() });
        if of_motion.len() == advice.modes.len() {
            let title = "Modes in the motion".to_owned();
            let y = Axis { label: "share of its kinetic energy".to_owned(), ..y() };
            panels.push(Panel { title, x, y, series: vec![stems((String::new(), 4, of_motion))], ..Panel::default() });
        }
    }
    (!panels.is_empty()).then(|| Figure {
        id: "freedoms".to_owned(),
        title: "Which freedoms matter".to_owned(),
        caption: format!(
            "Above: each group of freedoms held by itself, over its share in the motion of the scene; changes and shares below \
             {LEAST:e} are drawn there. Below: weights of the natural modes, every contact closed; they sum to one."
        ),
        columns: 2,
        panels,
    })
}
