use super::{FactorRow, Map, Outcome};
use crate::plot::{Axis, Figure, Guide, Panel, Series, Style, Tile};

/// Legend of the limit, and of the engine's own row.
const LIMIT: &str = "analytic limit, every mesh closed";
const OWN: &str = "Flank, its own steps: right";
const OWN_WRONG: &str = "Flank, its own steps: not confirmed";
/// Colour of lines and points on tiles: that of ink.
const INK: usize = 6;

impl Map {
    /// The map as a figure, one panel a method; `name` is that of the scene.
    ///
    /// The ends of a tile lie halfway to its neighbours, in ratios. The engine's own steps are at the left, as a rule: it needs
    /// a few where the others need hundreds.
    #[must_use]
    pub fn figure(&self, name: &str) -> Figure {
        let over = self.over.word();
        let rule = &self.rule;
        let windows: Vec<u64> = self.rows.iter().filter_map(|row| row.window.map(|w| w.cycles)).collect();
        let (least, most) = (windows.iter().min().unwrap_or(&0), windows.iter().max().unwrap_or(&0));
        let cycles = if least == most { format!("{most}") } else { format!("{least} to {most}") };
        let unsettled = self.rows.iter().filter(|row| row.own.as_ref().is_some_and(|own| own.period.is_none()));
        let unsettled = match unsettled.count() {
            0 => String::new(),
            count => format!(
                " Flank's own motion does not settle for {count} of {} factors: there only statistics are compared in the long run.",
                self.rows.len()
            ),
        };
        let missing = self.rows.iter().filter(|row| row.error.is_some()).count();
        let missing = if missing == 0 { String::new() } else { format!(" {missing} factors could not be judged.") };
        let [first, last] =
            [self.steps_per_cycle.first(), self.steps_per_cycle.last()].map(|n| n.map_or(1.0, |n| *n as f64));
        let outside = if self.own_steps().any(|n| !(first..=last).contains(&n)) {
            " Some of Flank's own steps lie beyond the steps that were tried; the plane has no colour there."
        } else {
            ""
        };
        Figure {
            id: format!("stability-{over}"),
            title: format!("Where fixed steps give the right motion: {name}"),
            caption: format!(
                "Outcome of each method against Flank's motion of the same train, with the {over} of every contact multiplied. \
                 Sequences of events are compared over the first {cycles} cycles, where errors grow {:.0}-fold at most, the motion \
                 in the long run over {} cycles.{unsettled}{missing}{outside}",
                rule.growth, rule.cycles
            ),
            columns: 2.min(self.methods.len()),
            panels: (0..self.methods.len()).map(|method| panel(self, method)).collect(),
        }
    }

    /// The engine's own steps a cycle, where it has a motion.
    fn own_steps(&self) -> impl Iterator<Item = f64> {
        self.rows.iter().filter_map(|row| row.own.as_ref()).map(|own| own.steps_per_cycle)
    }
}

/// Ends of cells on a logarithmic axis: geometric means between neighbours, as far again at the ends.
fn edges(values: &[f64]) -> Vec<f64> {
    let ratio = |i: usize| (values[i + 1] / values[i]).sqrt();
    let Some(last) = values.len().checked_sub(1) else { return Vec::new() };
    if last == 0 {
        return vec![values[0] / 2f64.sqrt(), values[0] * 2f64.sqrt()];
    }
    let inner = (0..last).map(|i| values[i] * ratio(i));
    std::iter::once(values[0] / ratio(0)).chain(inner).chain([values[last] * ratio(last - 1)]).collect()
}

fn panel(map: &Map, method: usize) -> Panel {
    let steps: Vec<f64> = map.steps_per_cycle.iter().map(|n| *n as f64).collect();
    let factors: Vec<f64> = map.rows.iter().map(|row| row.factor).collect();
    let (across, up) = (edges(&steps), edges(&factors));
    let mut tiles = Vec::new();
    for (j, row) in map.rows.iter().enumerate() {
        for (i, cell) in row.cells.get(method).into_iter().flatten().enumerate() {
            tiles.push(Tile {
                x: [across[i], across[i + 1]],
                y: [up[j], up[j + 1]],
                name: cell.outcome.words().to_owned(),
                // OK to convert: seven outcomes, in their order.
                colour: cell.outcome as usize,
            });
        }
    }
    let own = |right: bool| -> (Vec<f64>, Vec<f64>) {
        let rows = map.rows.iter().filter(|row| (row.own_outcome() == Outcome::Right) == right);
        rows.filter_map(|row| row.own.as_ref().map(|own| (own.steps_per_cycle, row.factor))).unzip()
    };
    let limit = |row: &FactorRow| row.limit_steps_per_cycle.get(method).copied().flatten().map(|n| (n, row.factor));
    let (x, y): (Vec<f64>, Vec<f64>) = map.rows.iter().filter_map(limit).unzip();
    let mut series = vec![Series::line(LIMIT, INK, x, y).styled(Style::Dashed)];
    for (name, right, style) in [(OWN, true, Style::Points), (OWN_WRONG, false, Style::Marks)] {
        let (x, y) = own(right);
        series.push(Series::line(name, INK, x, y).styled(style));
    }
    series.retain(|series| !series.x.is_empty());
    let least = map.own_steps().map(|n| n / 1.5).fold(across.first().copied().unwrap_or(1.0), f64::min);
    let most = map.own_steps().map(|n| n * 1.5).fold(across.last().copied().unwrap_or(1.0), f64::max);
    let guides = map.references.iter().filter(|r| (r.steps_per_cycle as f64) < most);
    let log = |label: &str, ends: Option<[f64; 2]>| Axis { logarithmic: true, range: ends, ..Axis::new(label, "") };
    Panel {
        title: map.methods[method].clone(),
        x: log("steps a cycle", Some([least, most])),
        y: log(
            &format!("factor on the {}", map.over.word()),
            up.first().copied().zip(up.last().copied()).map(Into::into),
        ),
        tiles,
        series,
        names_above: true,
        guides: guides.map(|r| Guide::Vertical { x: r.steps_per_cycle as f64, name: r.name.clone() }).collect(),
        ..Panel::default()
    }
}
