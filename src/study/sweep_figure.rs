//! The picture of a sweep over one number.

use super::steady::{ContactSteady, Steady};
use crate::{
    orbit::Kind,
    plot::{Axis, Figure, Guide, Panel, Series, Style},
    sweep::Direction,
};

/// Families of contacts drawn.
const MOST: usize = 4;
/// The kinds, each in its colour.
const KINDS: [Kind; 5] = [Kind::Periodic, Kind::QuasiPeriodic, Kind::Chaotic, Kind::Transient, Kind::Undecided];

/// A row of a sweep: the value of the number, how it was reached, the motion.
pub(super) type Row = (f64, Direction, Steady);

/// The name of a contact without its number: equal contacts of a train are one family.
fn family(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit() || c == ' ')
}

/// Time separated, largest force and deflection against the number at `pointer`, a row of panels for each family of contacts, by its first
/// one; full points on the way up or alone, open ones on the way down, colours by kind.
pub(super) fn figure(name: &str, pointer: &str, rows: &[Row], dimensionless: bool) -> Option<Figure> {
    let unit = |unit: &'static str| if dimensionless { "" } else { unit };
    let mut first: Vec<usize> = Vec::new();
    let contacts = &rows.first()?.2.contacts;
    for (j, contact) in contacts.iter().enumerate() {
        let is_new = |k: &usize| family(&contacts[*k].report.name) != family(&contact.report.name);
        if first.iter().all(is_new) && first.len() < MOST {
            first.push(j);
        }
    }
    let panel =
        |j: usize, label: &str, unit: &str, values: &[fn(&ContactSteady) -> Option<f64>], guides: Vec<Guide>| {
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
            let title = format!("{}: {label}", contacts[j].report.name);
            Panel { title, x: Axis::new(pointer, ""), y: Axis::new(label, unit), series, guides, ..Panel::default() }
        };
    let panels = first.iter().flat_map(|j| {
        [
            panel(*j, "time separated / period", "", &[|c| Some(c.report.apart_fraction)], Vec::new()),
            panel(*j, "largest force", unit("N"), &[|c| c.report.force_max], Vec::new()),
            panel(
                *j,
                "deflection, least and largest",
                unit("m"),
                &[|c| c.report.deflection_min, |c| c.report.deflection_max],
                Vec::new(),
            ),
        ]
    });
    let count = |kind: &Kind| rows.iter().filter(|(.., steady)| steady.motion.kind == *kind).count();
    let counts = KINDS.iter().filter(|kind| count(kind) > 0).map(|kind| format!("{} {}", count(kind), kind.word()));
    Some(Figure {
        id: "sweep".to_owned(),
        title: format!("Steady motions of {name} against {pointer}"),
        caption: format!(
            "Motions by kind: {}. Full points: on the way up, or each from the scene's own start; open points: on the way down.",
            counts.collect::<Vec<_>>().join(", ")
        ),
        columns: 3,
        panels: panels.collect(),
    })
}
