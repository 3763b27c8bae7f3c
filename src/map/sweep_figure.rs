//! Picture of a sweep over one number or two.

use super::picture::{CellLayout, look, measures};
use crate::{
    orbit::{Motion, MotionKind},
    plot::{Axis, Figure, Panel, Series, Style},
    study::{ContactMeasures, SweepRow},
    sweep::{Plan, SweepDirection},
};

/// Maximum number of families of contacts drawn over one number, and over two.
const MOST: [usize; 2] = [4, 2];
/// Kinds and their colours: those of a map, as far as curves have them.
const KINDS: [(MotionKind, usize); 5] = [
    (MotionKind::Periodic, 0),
    (MotionKind::QuasiPeriodic, 3),
    (MotionKind::Chaotic, 4),
    (MotionKind::Transient, 1),
    (MotionKind::Undecided, 6),
];
/// Factor over the steps beside it, and share of the range, above which a step between neighbours is a jump.
const JUMP: (f64, f64) = (4.0, 0.01);

/// Measure of a contact, with one or two values.
type ContactMeasure = fn(&ContactMeasures) -> [Option<f64>; 2];

/// Draws the `rows` of a sweep of `name`; none without rows.
#[must_use]
pub fn sweep_figure(name: &str, plan: &Plan, rows: &[SweepRow], dimensionless: bool) -> Option<Figure> {
    let longest = rows.iter().max_by_key(|row| row.contacts.len())?;
    let families: Vec<&str> = longest.contacts.iter().map(|(name, _)| name.as_str()).collect();
    let count = |kind: &MotionKind| rows.iter().filter(|row| row.motion.kind == *kind).count();
    let counts = KINDS.iter().map(|(kind, _)| (count(kind), kind)).filter(|(count, _)| *count > 0);
    let counts = counts.map(|(count, kind)| format!("{count} {}", kind.word()));
    let counts = counts.collect::<Vec<_>>().join(", ");
    let labels: Vec<String> =
        plan.grid().axes().iter().map(|axis| Axis::of_number(&axis.pointer, dimensionless).label).collect();
    let is_plane = labels.len() > 1;
    let panels = if is_plane {
        plane(plan, rows, &families, dimensionless)
    } else {
        families.iter().take(MOST[0]).flat_map(|family| line(plan, rows, family, dimensionless)).collect()
    };
    let how = if is_plane {
        ""
    } else {
        " Full points and full lines: on the way up, or each from the scene's own start; open points and dashed lines: on the way down. \
         Lines join neighbours of the same period with the same events, and end at jumps."
    };
    Some(Figure {
        id: "sweep".to_owned(),
        title: format!("Steady motions of {name} against {}", labels.join(" and ")),
        caption: format!("Motions by kind: {counts}.{how}"),
        columns: if is_plane { 1 } else { 3 },
        panels,
    })
}

/// Returns rows in runs, each along one branch: neighbours of the same period with the same events, without a jump between them.
fn runs<'r>(way: &[(f64, &'r SweepRow)], family: &str) -> Vec<Vec<(f64, &'r SweepRow)>> {
    let is_alike =
        |one: &Motion, other: &Motion| one.period.is_some() && one.period == other.period && one.word == other.word;
    let values = |row: &SweepRow| {
        let shown = row.contacts.iter().find(|(name, _)| name == family).map(|(_, shown)| shown);
        let of = |value: fn(&ContactMeasures) -> Option<f64>| shown.and_then(value).unwrap_or(0.0);
        [of(|s| Some(s.apart)), of(|s| s.force), of(|s| s.deflection[0]), of(|s| s.deflection[1])]
    };
    let all: Vec<[f64; 4]> = way.iter().map(|(_, row)| values(row)).collect();
    let joined = |k: usize| is_alike(&way[k].1.motion, &way[k + 1].1.motion);
    let step = |k: usize, i: usize| (all[k + 1][i] - all[k][i]).abs();
    let is_jump = |k: usize| {
        let beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
        let beside: Vec<usize> = beside.filter(|k| k + 1 < way.len() && joined(*k)).collect();
        (0..4).any(|i| {
            let ends = all.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v[i]), b.max(v[i])]);
            let usual = beside.iter().map(|k| step(*k, i)).fold(0.0, f64::max);
            !beside.is_empty() && step(k, i) > JUMP.0 * usual && step(k, i) > JUMP.1 * (ends[1] - ends[0])
        })
    };
    let mut runs: Vec<Vec<(f64, &SweepRow)>> = Vec::new();
    for (k, point) in way.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if joined(k - 1) && !is_jump(k - 1) => run.push(*point),
            _ => runs.push(vec![*point]),
        }
    }
    runs
}

/// Draws a row of panels of one family over the number.
fn line(plan: &Plan, rows: &[SweepRow], family: &str, dimensionless: bool) -> [Panel; 3] {
    let unit = |unit: &'static str| if dimensionless { "" } else { unit };
    let axis = &plan.grid().axes()[0];
    let panel = |label: &str, unit: &str, measure: ContactMeasure| {
        let mut series: Vec<Series> = Vec::new();
        for down in [false, true] {
            let mut way: Vec<(f64, &SweepRow)> = rows
                .iter()
                .map(|row| (plan.cell(row.row), row))
                .filter(|(cell, _)| (cell.direction == SweepDirection::Down) == down)
                .map(|(cell, row)| (cell.values[0], row))
                .collect();
            way.sort_by(|a, b| a.0.total_cmp(&b.0));
            let value = |row: &SweepRow, part: usize| {
                row.contacts.iter().find(|(name, _)| name == family).and_then(|(_, shown)| measure(shown)[part])
            };
            let style = if down { Style::Dashed } else { Style::Line };
            for part in 0..2 {
                for run in runs(&way, family).iter().filter(|run| run.len() > 1) {
                    let points = run.iter().filter_map(|(x, row)| Some((*x, value(row, part)?)));
                    let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
                    series.push(Series { name: String::new(), x, y, style, colour: 0 });
                }
            }
            for (kind, colour) in KINDS {
                let of_kind = way.iter().filter(|(_, row)| row.motion.kind == kind);
                let points = of_kind
                    .flat_map(|(x, row)| [0, 1].into_iter().filter_map(move |part| Some((*x, value(row, part)?))));
                let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
                let name = format!("{}{}", kind.word(), if down { ", on the way down" } else { "" });
                let style = if down { Style::Marks } else { Style::Points };
                series.push(Series { name, x, y, style, colour });
            }
        }
        series.retain(|series| !series.x.is_empty());
        let x = Axis { logarithmic: axis.is_geometric(), ..Axis::of_number(&axis.pointer, dimensionless) };
        Panel { title: format!("{family}: {label}"), x, y: Axis::new(label, unit), series, ..Panel::default() }
    };
    [
        panel("time apart / period", "", |shown| [Some(shown.apart), None]),
        panel("largest force", unit("N"), |shown| [shown.force, None]),
        panel("deflection, least and largest", unit("m"), |shown| shown.deflection),
    ]
}

/// Draws panels over both numbers, for each direction: the kinds of motion, and measures of the first families.
fn plane(plan: &Plan, rows: &[SweepRow], families: &[&str], dimensionless: bool) -> Vec<Panel> {
    let axes = plan.grid().axes();
    let place = CellLayout::new(plan.grid(), [axes[0].count(), axes[1].count()], dimensionless);
    let unit = |unit: &str| if dimensionless { String::new() } else { format!(" [{unit}]") };
    let points = axes[0].count() * axes[1].count();
    let ways = plan.rows() / points;
    let mut panels = Vec::new();
    for way in 0..ways {
        let mut of_point: Vec<Option<&SweepRow>> = vec![None; points];
        rows.iter().filter(|row| row.row % ways == way).for_each(|row| of_point[row.row / ways] = Some(row));
        let said = match plan.cell(way).direction {
            SweepDirection::Fresh => "",
            SweepDirection::Up => ", on the way up",
            SweepDirection::Down => ", on the way down",
        };
        let mut looks = Vec::new();
        let class = |row: &Option<&SweepRow>| match row {
            Some(row) => look(&(row.motion.kind.word().to_owned(), row.motion.period)),
            None => look(&("failed".to_owned(), None)),
        };
        of_point.iter().for_each(|row| {
            let seen = class(row);
            if !looks.contains(&seen) {
                looks.push(seen);
            }
        });
        looks.sort_by_key(|look| look.0);
        // Exact: looks are few.
        let number = |i: usize| looks.iter().position(|look| *look == class(&of_point[i])).unwrap_or(0) as u8;
        let classes = looks.iter().map(|(_, name, colour)| (name.clone(), *colour)).collect();
        panels.push(place.panel(&format!("kind of motion{said}"), place.raster(number, classes)));
        for family in families.iter().take(MOST[1]) {
            let values = |measure: fn(&ContactMeasures) -> Option<f64>| -> Vec<Option<f64>> {
                let of = |row: &Option<&SweepRow>| {
                    row.and_then(|row| measure(&row.contacts.iter().find(|(name, _)| name == family)?.1))
                };
                of_point.iter().map(of).collect()
            };
            let apart = measures(&place, &values(|shown| Some(shown.apart)));
            panels.push(place.panel(&format!("{family}: time apart / period{said}"), apart));
            let force = measures(&place, &values(|shown| shown.force));
            panels.push(place.panel(&format!("{family}: largest force{}{said}", unit("N")), force));
        }
    }
    panels
}
