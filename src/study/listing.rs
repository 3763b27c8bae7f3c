//! What was found, as tables.

use super::{
    changes::{Effect, SPEEDS},
    figures::ModeRow,
    values::Checked,
};
use crate::output::Table;

pub(super) fn modes(rows: &[ModeRow]) -> Table {
    let cells = |row: &ModeRow| {
        let shares = row.shares.iter().filter(|(_, share)| *share >= 0.05);
        let shares =
            shares.map(|(part, share)| format!("{part} {:.0} %", 100.0 * share)).collect::<Vec<_>>().join(", ");
        vec![row.name(), format!("{:.2}", row.hertz), row.multiplicity.to_string(), shares]
    };
    let note = "R rotational, T translational, P planet modes; shares of the kinetic energy from 5 % on.";
    let head = ["Mode", "Hz", "Times", "Kinetic energy"];
    Table::new(head).with(rows.iter().map(cells)).titled("Natural frequencies", note)
}

/// Numbers beside those of another implementation.
pub(super) fn values(values: &[Checked]) -> Table {
    let cells = |value: &Checked| {
        let number = |v: f64| format!("{v:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
        let verdict = if value.holds() { "within" } else { "off" };
        let numbers = [value.expected, value.tolerance].map(number);
        let found = number((value.found * 1e5).round() / 1e5);
        [vec![value.quantity.clone()], numbers.to_vec(), vec![found, verdict.to_owned()]].concat()
    };
    let off = values.iter().filter(|value| !value.holds()).count();
    let note = format!(
        "{} numbers, {off} off. Rows that are off belong to motions whose sun meshes never open in the end: which impact \
         of a cold start was their last one hangs on the step of the other implementation, and with it their damping.",
        values.len()
    );
    let table = Table::new(["Quantity", "Expected", "Tolerance", "Flank", ""]).with(values.iter().map(cells));
    table.titled("Numbers beside an independent implementation", note)
}

pub(super) fn changes(effects: &[Effect]) -> Table {
    let cells = |effect: &Effect| {
        let apart = effect.apart.iter().map(|apart| format!("{apart:.3}"));
        let rest = [format!("{:.2}", effect.threshold), format!("{:.1}", effect.largest)];
        std::iter::once(effect.words.clone()).chain(apart).chain(rest).collect()
    };
    let speeds = SPEEDS.map(|rpm| format!("Apart at {rpm} rev/min, T"));
    let head = std::iter::once("Change".to_owned()).chain(speeds);
    let note = "Ring meshes without load, one change at a time, every motion from a cold start; threshold and force at 500 \
                rev/min. At 2000 rev/min small changes also change the last impact of the sun meshes, and with it the \
                damping: read that column with care.";
    let head = head.chain(["Threshold, N m", "Largest force, N"].map(String::from));
    Table::new(head).with(effects.iter().map(cells)).titled("What controls what", note)
}
