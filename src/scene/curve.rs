//! Curves of measured points, as a scene has them.

use super::node::Node;
use crate::gear::{Curve, Harmonic, MeshHarmonic, Series, Through};

/// A place or a value that closes a period, relative to the largest value.
const CLOSED: f64 = 1e-9;

/// A curve and the number of mesh periods that it covers.
pub(super) struct OverMesh {
    pub curve: Curve,
    pub periods: u32,
}

/// Tells that a curve is written here.
pub(super) fn is_curve(node: &Node) -> bool {
    node.at("points").is_list() || node.at("table").is_text()
}

/// The curve that is written here, in SI units; `units` are the names of those of its values with their factors, the usual one first.
pub(super) fn read(node: &Node, units: &[(&str, f64)]) -> Option<Curve> {
    // The first one is that of values without a unit; the shape allows no others.
    let factor = units.iter().find(|(name, _)| *name == node.at("unit").text()).unwrap_or(&units[0]).1;
    let turn = match node.at("place").text() {
        "deg" => 360.0,
        "rad" => std::f64::consts::TAU,
        _ => 1.0,
    };
    let list = node.at("points");
    if !list.is_list() {
        node.at("table").refuse("a scene from a file or a text", "write the points themselves");
        return None;
    }
    let rows: Vec<[f64; 2]> =
        list.items().iter().map(|item| item.numbers()).map(|row| [row[0] / turn, row[1]]).collect();
    let mut rows = closed(&list, rows)?;
    let scale = node.at("scale").number() * factor;
    // Within rounding of a whole period, as from angles in radians.
    rows.iter_mut().for_each(|row| row[1] *= scale);
    let (places, values): (Vec<f64>, Vec<f64>) = rows.into_iter().map(|[x, y]| (x, y)).unzip();
    Some(Curve::new(places, values))
}

/// The points of one period, the end of which repeats its beginning or is left out.
fn closed(list: &Node, mut rows: Vec<[f64; 2]>) -> Option<Vec<[f64; 2]>> {
    let items = list.items();
    let [first, last] = [*rows.first()?, *rows.last()?];
    for (pair, item) in rows.windows(2).zip(&items[1..]) {
        if pair[0][0] >= pair[1][0] {
            item.refuse("places that rise", "sort the points by place, and write each place once");
            return None;
        }
    }
    if first[0] < 0.0 {
        items[0].refuse("places from 0 on", "begin the period at 0, or name the unit of the places: \"place\"");
        return None;
    }
    let span = last[0] - first[0];
    if span > 1.0 + CLOSED {
        let allowed = "places within one period";
        items[items.len() - 1].refuse(
            allowed,
            "name the unit of the places (\"place\": \"deg\"), or how many periods they cover (\"over\")",
        );
        return None;
    }
    if span >= 1.0 - CLOSED {
        let largest = rows.iter().map(|row| row[1].abs()).fold(0.0, f64::max);
        let gap = last[1] - first[1];
        if gap.abs() > CLOSED * largest {
            items[items.len() - 1].fault(
                format!("a curve that does not close: its end lies {gap:e} above its beginning"),
                "the same value at both ends of the period",
                "correct the drift, or leave the last point out: the curve then goes on to the first one",
            );
            return None;
        }
        rows.pop();
    }
    if last[0] >= 1.0 + CLOSED && first[0] >= 1.0 {
        items[0].refuse("places within one period", "begin the period at 0");
        return None;
    }
    // A first place above 0 may bring the last one beyond 1.
    let wraps = rows.iter().position(|row| row[0] >= 1.0).unwrap_or(rows.len());
    rows[wraps..].iter_mut().for_each(|row| row[0] -= 1.0);
    let count = rows.len().max(1);
    rows.rotate_left(wraps % count);
    if rows.len() < 2 {
        list.refuse("two points at least", "write more points");
        return None;
    }
    Some(rows)
}

/// The curve that is written here over mesh periods; `teeth` are those of the driving and the driven gear.
pub(super) fn over_mesh(node: &Node, units: &[(&str, f64)], teeth: Option<[u32; 2]>) -> Option<OverMesh> {
    let over = node.at("over");
    let periods = match (over.text(), teeth) {
        ("driving", Some([teeth, _])) | ("driven", Some([_, teeth])) => teeth,
        ("driving" | "driven", None) => {
            over.refuse(
                "a number of mesh periods, as the teeth are not given",
                "write the number of teeth of the gear",
            );
            return None;
        }
        _ => over.whole() as u32,
    };
    Some(OverMesh { curve: read(node, units)?, periods })
}

/// The series of a curve, whose residual the user is told.
pub(super) fn series(node: &Node, curve: &Curve, through: Through) -> Series {
    let most = node.at("harmonics").written().map(|most| most.whole() as usize);
    let series = curve.series(most, through);
    let [largest, rms] = series.residual;
    let harmonics = series.harmonics.len();
    node.remark(format!(
        "{} points as {harmonics} harmonics: at most {largest:.2e} beside them, {rms:.2e} RMS",
        curve.count()
    ));
    series
}

/// Harmonics in a mesh's own clock, as sines.
pub(super) fn mesh_error(node: &Node, teeth: Option<[u32; 2]>) -> Option<(f64, Vec<MeshHarmonic>)> {
    let OverMesh { curve, periods } = over_mesh(node, &LENGTHS, teeth)?;
    let series = series(node, &curve, Through::Spline);
    let sine = |h: &MeshHarmonic| MeshHarmonic {
        order: h.order / f64::from(periods),
        phase: h.phase + std::f64::consts::FRAC_PI_2,
        ..*h
    };
    Some((series.mean, series.harmonics.iter().map(sine).collect()))
}

/// Harmonics in time, of a curve with a period and an origin of its own.
pub(super) fn in_time(node: &Node, units: &[(&str, f64)], through: Through) -> Option<(f64, Vec<Harmonic>)> {
    let curve = read(node, units)?;
    let series = series(node, &curve, through);
    let (period, origin) = (node.at_unit("period", "s").number(), node.at_unit("origin", "s").number());
    let harmonic = |h: &MeshHarmonic| h.cosine(period.recip(), -origin / period);
    Some((series.mean, series.harmonics.iter().map(harmonic).collect()))
}

/// Units of lengths and stiffnesses.
pub(super) const LENGTHS: [(&str, f64); 3] = [("m", 1.0), ("mm", 1e-3), ("um", 1e-6)];
pub(super) const STIFFNESSES: [(&str, f64); 3] = [("N/m", 1.0), ("N/mm", 1e3), ("N/um", 1e6)];
pub(super) const FORCES: [(&str, f64); 2] = [("N", 1.0), ("kN", 1e3)];
pub(super) const TORQUES: [(&str, f64); 3] = [("N m", 1.0), ("N mm", 1e-3), ("kN m", 1e3)];
pub(super) const SPEEDS: [(&str, f64); 2] = [("rev/min", std::f64::consts::TAU / 60.0), ("rad/s", 1.0)];
