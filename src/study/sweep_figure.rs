//! The picture of a sweep over one number.

use super::{
    figures::families,
    steady::{ContactSteady, Steady},
};
use crate::{
    orbit::Kind,
    plot::{Axis, Figure, Panel, Series, Style},
    sweep::Direction,
};

/// Families of contacts drawn.
const MOST: usize = 4;
/// The kinds, each in its colour.
const KINDS: [Kind; 5] = [Kind::Periodic, Kind::QuasiPeriodic, Kind::Chaotic, Kind::Transient, Kind::Undecided];

/// A row of a sweep: the value of the number, how it was reached, the motion.
pub(super) type Row = (f64, Direction, Steady);

/// Time separated, largest force and deflection against the number at `pointer`, a row of panels for each family of contacts, by its first
/// one; full points on the way up or alone, open ones on the way down, colours by kind.
pub(super) fn figure(name: &str, pointer: &str, rows: &[Row], dimensionless: bool) -> Option<Figure> {
    let unit = |unit: &'static str| if dimensionless { "" } else { unit };
    let longest = rows.iter().map(|(.., steady)| steady).max_by_key(|steady| steady.contacts.len())?;
    let mut families = families(longest);
    families.truncate(MOST);
    let panel = |j: usize, label: &str, unit: &str, values: &[fn(&ContactSteady) -> Option<f64>]| {
        let mut series = Vec::new();
        for (colour, kind) in KINDS.iter().enumerate() {
            for (down, style) in [(false, Style::Points), (true, Style::Marks)] {
                let of_kind = rows.iter().filter(|(_, direction, steady)| {
                    steady.motion.kind == *kind && (*direction == Direction::Down) == down
                });
                let points = of_kind.flat_map(|(x, _, steady)| {
                    values.iter().filter_map(move |value| Some((*x, steady.contacts.get(j).and_then(value)?)))
                });
                let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
                if !x.is_empty() {
                    let name = format!("{}{}", kind.word(), if down { ", down" } else { "" });
                    series.push(Series::line(name, colour, x, y).styled(style));
                }
            }
        }
        let title = format!("{}: {label}", longest.contacts[j].report.name);
        Panel {
            title,
            x: Axis::of_number(pointer, dimensionless),
            y: Axis::new(label, unit),
            series,
            ..Panel::default()
        }
    };
    let panels = families.iter().flat_map(|(j, _)| {
        [
            panel(*j, "time apart / period", "", &[|c| Some(c.report.apart_fraction)]),
            panel(*j, "largest force", unit("N"), &[|c| c.report.force_max]),
            panel(
                *j,
                "deflection, least and largest",
                unit("m"),
                &[|c| c.report.deflection_min, |c| c.report.deflection_max],
            ),
        ]
    });
    let count = |kind: &Kind| rows.iter().filter(|(.., steady)| steady.motion.kind == *kind).count();
    let counts = KINDS.iter().filter(|kind| count(kind) > 0).map(|kind| format!("{} {}", count(kind), kind.word()));
    Some(Figure {
        id: "sweep".to_owned(),
        title: format!("Steady motions of {name} against {}", Axis::of_number(pointer, dimensionless).label),
        caption: format!(
            "Motions by kind: {}. Full points: on the way up, or each from the scene's own start; open points: on the way down.",
            counts.collect::<Vec<_>>().join(", ")
        ),
        columns: 3,
        panels: panels.collect(),
    })
}
