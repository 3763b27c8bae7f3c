//! Loads in steps and ramps: points in time, once or with a period.

use std::f64::consts::TAU;

use super::{build, curve::TORQUES, node::Node};
use crate::{
    gear::{Piece, Stiffness},
    hybrid::Wide,
    system::{LoadSchedule, Spec},
    train::{
        Mesh,
        gearbox::{Gearbox, Layout},
    },
};

/// Difference of two equal times, relative to the period: angles are rounded.
const SAME: f64 = 1e-12;

/// A point: time, and value.
type TimePoint = (Wide, f64);

/// Reads a load, a number or a schedule; returns its value at rest, and the schedule. `units` are the names of units of its values with
/// their factors, the usual one first; `turn` is the time of a turn of the loaded body, s.
pub(super) fn or_schedule(node: &Node, units: &[(&str, f64)], turn: Option<f64>) -> (f64, Option<Stiffness>) {
    if node.is_number() {
        return (node.number(), None);
    }
    let schedule = read(node, units, turn);
    (schedule.as_ref().map_or(0.0, rest), schedule)
}

/// Reads a load, a number or a schedule, at rest. The time of a turn does not matter.
pub(super) fn at_rest(node: &Node, units: &[(&str, f64)]) -> f64 {
    if node.is_number() { node.number() } else { schedule(node, units, Some(1.0)).as_ref().map_or(0.0, rest) }
}

/// Returns the first value of a single schedule, the mean of a repeated one.
fn rest(schedule: &Stiffness) -> f64 {
    if let Stiffness::Listed { values, .. } = schedule { values[0] } else { schedule.mean() }
}

/// Multiplies a load by `factor`: `[without, unit]` are the loads of the train without it, and those of a factor of 1 alone.
pub(super) fn follow(spec: &mut Spec, factor: Stiffness, [without, unit]: [Vec<f64>; 2]) {
    spec.load = without;
    spec.load_schedules.push(LoadSchedule { vector: unit, factor });
}

/// Adds the schedules of the torques of shafts, the `nodes`.
pub(super) fn of_shafts(
    node: &Node,
    spec: &mut Spec,
    nodes: &[Node],
    (gearbox, layout, meshes): (&Gearbox, &Layout, &[Mesh]),
) -> Option<()> {
    let turn = |i: usize| (layout.speed(i) != 0.0).then(|| TAU / layout.speed(i).abs());
    let read = |(i, shaft): (usize, &Node)| {
        let torque = shaft.at("torque_nm");
        let is_schedule = torque.at("points").is_list();
        is_schedule.then(|| Some((i, or_schedule(&torque, &TORQUES, turn(i)).1?)))
    };
    let schedules = nodes.iter().enumerate().filter_map(read).collect::<Option<Vec<_>>>()?;
    if schedules.is_empty() {
        return Some(());
    }
    let repeats = |factor: &Stiffness| matches!(factor, Stiffness::Periodic { .. });
    let torques: Vec<(usize, bool)> = schedules.iter().map(|(i, factor)| (*i, repeats(factor))).collect();
    let loads = |gearbox: &Gearbox| Some(build::assembled(node, gearbox.assemble(layout, meshes))?.load);
    let without = loads(&gearbox.without(layout, &torques))?;
    for ((_, factor), torque) in schedules.into_iter().zip(torques) {
        follow(spec, factor, [without.clone(), loads(&gearbox.with_unit(torque))?]);
    }
    Some(())
}

/// Reads a schedule, and adds a remark on it.
pub(super) fn read(node: &Node, units: &[(&str, f64)], turn: Option<f64>) -> Option<Stiffness> {
    let schedule = schedule(node, units, turn)?;
    let (count, when) = match &schedule {
        Stiffness::Periodic { period, pieces, .. } => (pieces.len(), format!("in each period of {period:.6e}")),
        Stiffness::Listed { times, .. } => (times.len(), "once".to_owned()),
        _ => (0, String::new()),
    };
    node.remark(format!("a load of at most {:.4e}, {count} corners and steps {when}", schedule.maximum()));
    Some(schedule)
}

fn schedule(node: &Node, units: &[(&str, f64)], turn: Option<f64>) -> Option<Stiffness> {
    let list = node.at("points");
    if !list.is_list() {
        node.at("table").refuse("a scene from a file or a text", "write the points themselves");
        return None;
    }
    let period = period(node, turn)?;
    let second = match (node.at("place").text(), period) {
        ("ms", _) => 1e-3,
        ("period", Some(period)) => period,
        ("deg", Some(period)) => period / 360.0,
        ("rad", Some(period)) => period / TAU,
        ("period" | "deg" | "rad", None) => {
            node.at("place").refuse("\"s\" or \"ms\", as the load does not repeat", "name its period");
            return None;
        }
        // Over a turn the places are shares of it.
        ("", Some(period)) if node.at("over").is_text() => period,
        _ => 1.0,
    };
    let unit = units.iter().find(|(name, _)| *name == node.at("unit").text()).or(units.first());
    let factor = node.at("scale").number() * unit.map_or(1.0, |(_, factor)| *factor);
    let point = |item: &Node| {
        let row = item.items();
        // Two entries, by the shape.
        (row[0].wide() * second, row[1].wide().value() * factor)
    };
    let points: Vec<TimePoint> = list.items().iter().map(point).collect();
    let is_sudden = node.at("through").text() == "steps";
    rises(&list, &points, is_sudden)?;
    let origin = node.at_unit("origin", "s").number();
    match period {
        Some(period) => repeating(&list, &points, is_sudden, period, origin),
        None => Some(once(&points, is_sudden, origin)),
    }
}

/// Returns the period after which the load repeats, s.
fn period(node: &Node, turn: Option<f64>) -> Option<Option<f64>> {
    let (over, period) = (node.at("over"), node.at_unit("period", "s").written());
    if !over.is_text() {
        return Some(period.map(|period| period.number()));
    }
    if let Some(period) = period {
        period.refuse("no period beside \"over\"", "remove one of them");
        return None;
    }
    match turn.filter(|turn| turn.is_finite() && *turn > 0.0) {
        Some(turn) => Some(Some(turn)),
        None => {
            over.refuse("a body that turns", "write the period in seconds");
            None
        }
    }
}

/// Refuses falling times, and more than two points at one time.
fn rises(list: &Node, points: &[TimePoint], is_sudden: bool) -> Option<()> {
    let items = list.items();
    for (pair, item) in points.windows(2).zip(&items[1..]) {
        let is_step = !is_sudden && pair[0].0 == pair[1].0;
        if pair[1].0.value() < pair[0].0.value() || pair[1].0 == pair[0].0 && !is_step {
            item.refuse("times that rise", "sort the points by time; a step is two points at one time");
            return None;
        }
    }
    for (triple, item) in points.windows(3).zip(&items[2..]) {
        if triple[0].0 == triple[2].0 {
            item.refuse("at most two points at one time", "write the values before and after the step");
            return None;
        }
    }
    Some(())
}

/// Returns a schedule that is constant before the first point and after the last one.
fn once(points: &[TimePoint], is_sudden: bool, origin: f64) -> Stiffness {
    let (mut times, mut values, mut slopes) = (Vec::new(), vec![points[0].1], vec![0.0]);
    let count = points.len();
    for (i, (time, value)) in points.iter().enumerate() {
        let next = points.get(i + 1);
        // The first of two points at one time ends a line.
        if next.is_some_and(|next| next.0 == *time) {
            continue;
        }
        let slope = match next {
            Some((end, after)) if !is_sudden => (after - value) / (*end - *time).value(),
            _ => 0.0,
        };
        let is_same = slope == 0.0 && slopes.last() == Some(&0.0) && values.last() == Some(value);
        if !is_same || count == 1 {
            let at = *time + origin.into();
            times.push([at.hi, at.lo]);
            values.push(*value);
            slopes.push(slope);
        }
    }
    Stiffness::Listed { times, values, slopes }
}

/// Returns the pieces over a period, at whose end lines close.
fn repeating(list: &Node, points: &[TimePoint], is_sudden: bool, period: f64, origin: f64) -> Option<Stiffness> {
    let items = list.items();
    let place = |time: Wide| (time * period.recip()).value();
    let first = place(points[0].0);
    let last = place(points[points.len() - 1].0);
    if last - first > 1.0 + SAME {
        items[items.len() - 1]
            .refuse("times within one period", "name the unit of the times (\"place\"), or a longer period");
        return None;
    }
    if !is_sudden {
        let closes = (last - first - 1.0).abs() <= SAME;
        let gap = points[points.len() - 1].1 - points[0].1;
        if !closes || gap != 0.0 {
            let found = if closes {
                format!("a load that does not close: its end lies {gap:e} above its beginning")
            } else {
                format!("a load from {first} to {last} of its period")
            };
            items[items.len() - 1].fault(
                found,
                "lines over the whole period, with the same value at both ends",
                "write the last point a period after the first one; a step is two points at one time",
            );
            return None;
        }
    }
    let mut pieces = Vec::new();
    for (i, (time, value)) in points.iter().enumerate() {
        let next = points.get(i + 1);
        let slope = match next {
            _ if is_sudden => 0.0,
            // The first of two points at one time ends a line, the last of all points the period.
            Some(next) if next.0 != *time => (next.1 - value) / (next.0 - *time).value(),
            _ => continue,
        };
        pieces.push(Piece { start: place(*time) - first, value: *value, slope });
    }
    if is_sudden && last - first > 1.0 - SAME {
        if points[points.len() - 1].1 != points[0].1 {
            items[items.len() - 1].refuse("the value of the first point, a period later", "leave the last point out");
            return None;
        }
        pieces.pop();
    }
    pieces.dedup_by(|next, last| next.slope == 0.0 && last.slope == 0.0 && next.value == last.value);
    // The origin of the period is its first point; a run that starts at 0 is inside the first period.
    Some(Stiffness::Periodic { period, origin: origin + points[0].0.value(), pieces })
}
