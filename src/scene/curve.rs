//! Curves of measured points in a scene.

use super::node::Node;
use crate::gear::{Curve, CurveShape, Harmonic, HarmonicSeries, MeshHarmonic};

/// Largest difference of values that closes a period, relative to the largest one.
const CLOSED: f64 = 1e-9;
/// Largest difference of places that closes a period, in mean distances of the points: angles are rounded.
const WHOLE: f64 = 1e-3;

/// Curve and the number of mesh periods that it covers.
pub(super) struct OverMesh {
    pub curve: Curve,
    pub periods: u32,
}

/// Returns whether a curve is written here.
pub(super) fn is_curve(node: &Node) -> bool {
    node.at("points").is_list() || node.at("table").is_text()
}

/// Reads a curve, in SI units; `units` are the names of units of its values with their factors, the usual one first.
pub(super) fn read(node: &Node, units: &[(&str, f64)]) -> Option<Curve> {
    // The first unit is that of values without a unit; the shape allows no others.
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
    rows.iter_mut().for_each(|row| row[1] *= scale);
    let (places, values): (Vec<f64>, Vec<f64>) = rows.into_iter().map(|[x, y]| (x, y)).unzip();
    Some(Curve::new(places, values))
}

/// Returns the points of one period, whose end repeats its beginning or is left out.
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
    let whole = WHOLE / items.len() as f64;
    if span > 1.0 + whole {
        let allowed = "places within one period";
        items[items.len() - 1].refuse(
            allowed,
            "name the unit of the places (\"place\": \"deg\"), or how many periods they cover (\"over\")",
        );
        return None;
    }
    if span >= 1.0 - whole {
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
    if first[0] >= 1.0 {
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

/// Reads a curve over mesh periods; `teeth` are those of the driving and the driven gear.
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

/// Returns the series of a curve, and adds its residual to the remarks.
pub(super) fn series(node: &Node, curve: &Curve, through: CurveShape) -> HarmonicSeries {
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

/// Returns the curve of a stiffness, which must not be negative.
pub(super) fn stiffness(node: &Node, curve: Curve) -> Option<Curve> {
    if curve.mean() <= 0.0 || curve.values().iter().any(|value| *value < 0.0) {
        node.at("points").refuse("stiffnesses >= 0, some of them above 0", "correct the values, or their scale");
        return None;
    }
    Some(curve)
}

/// Returns mean and harmonics, relative to it, of a stiffness through points.
pub(super) fn relative_series(node: &Node, curve: &Curve) -> (f64, Vec<MeshHarmonic>) {
    let HarmonicSeries { mean, mut harmonics, .. } = series(node, curve, CurveShape::Lines);
    harmonics.iter_mut().for_each(|h| h.amplitude /= mean);
    if harmonics.iter().map(|h| h.amplitude).sum::<f64>() >= 1.0 {
        node.warn("the amplitudes of its series sum to 1 or more: the stiffness may become negative");
    }
    (mean, harmonics)
}

/// Reads harmonics in a mesh's own clock, as sines.
pub(super) fn mesh_error(node: &Node, teeth: Option<[u32; 2]>) -> Option<(f64, Vec<MeshHarmonic>)> {
    let OverMesh { curve, periods } = over_mesh(node, &LENGTHS, teeth)?;
    let series = series(node, &curve, CurveShape::Spline);
    let sine = |h: &MeshHarmonic| MeshHarmonic {
        order: h.order / f64::from(periods),
        phase: h.phase + std::f64::consts::FRAC_PI_2,
        ..*h
    };
    Some((series.mean, series.harmonics.iter().map(sine).collect()))
}

/// Reads harmonics in time, of a curve with a separate period and origin.
pub(super) fn in_time(node: &Node, units: &[(&str, f64)]) -> Option<(f64, Vec<Harmonic>)> {
    let curve = read(node, units)?;
    let series = series(node, &curve, CurveShape::Spline);
    Some((series.mean, timed(node, &series.harmonics)))
}

/// Returns the harmonics of a curve in time, by its period and origin.
pub(super) fn timed(node: &Node, harmonics: &[MeshHarmonic]) -> Vec<Harmonic> {
    let (period, origin) = (node.at_unit("period", "s").number(), node.at_unit("origin", "s").number());
    harmonics.iter().map(|h| h.cosine(period.recip(), -origin / period)).collect()
}

/// Units of lengths and stiffnesses.
pub(super) const LENGTHS: [(&str, f64); 3] = [("m", 1.0), ("mm", 1e-3), ("um", 1e-6)];
pub(super) const STIFFNESSES: [(&str, f64); 3] = [("N/m", 1.0), ("N/mm", 1e3), ("N/um", 1e6)];
pub(super) const FORCES: [(&str, f64); 2] = [("N", 1.0), ("kN", 1e3)];
pub(super) const TORQUES: [(&str, f64); 3] = [("N m", 1.0), ("N mm", 1e-3), ("kN m", 1e3)];
pub(super) const SPEEDS: [(&str, f64); 2] = [("rev/min", std::f64::consts::TAU / 60.0), ("rad/s", 1.0)];
