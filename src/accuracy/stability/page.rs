//! Tables, text and files of a map.

#[cfg(feature = "plot")]
use serde_json::json;

use super::{Map, Outcome};
use crate::output::{Table, five_digits, label};
#[cfg(feature = "plot")]
use crate::{
    output::{Folder, OutputError, number},
    plot::{self, Item, Print, Report, Section},
    simulation::Simulation,
    train::Quantity,
};

#[cfg(feature = "plot")]
const TABLE: &str = "stability.csv";
#[cfg(feature = "plot")]
const MAP: &str = "stability.json";

impl Map {
    /// Returns a table of the steps that each method needs, where the factor is 1 and over all factors. `unit` is the unit of time.
    #[must_use]
    pub fn summary_table(&self, unit: &str) -> Table {
        let step = if unit.is_empty() { "its step".to_owned() } else { format!("its step, {unit}") };
        let mut head = vec!["method", "sequence from", "motion from", &step, "limit", "all factors"];
        head.extend(self.references.iter().map(|reference| reference.name.as_str()));
        let one = self.rows.iter().find(|row| row.factor == 1.0);
        let rows = self.methods.iter().enumerate().map(|(i, method)| {
            let fewest = |holds: fn(Outcome) -> bool| one.and_then(|row| self.fewest(i, row, holds));
            let limit = one.and_then(|row| row.limit_steps_per_cycle.get(i).copied().flatten());
            let right = fewest(|outcome| outcome == Outcome::Right);
            let mut cells = vec![
                method.clone(),
                steps(fewest(Outcome::has_right_sequence)),
                steps(right),
                five_digits(right.map(|n| self.period_s / n as f64)),
                match (limit, self.limits[i]) {
                    (Some(limit), _) => format!("{limit:.1}"),
                    (None, Some(_)) => "unknown".to_owned(),
                    (None, None) => "any step".to_owned(),
                },
                self.over_all(i),
            ];
            for (k, _) in self.references.iter().enumerate() {
                let cell = one.and_then(|row| row.references.get(i)?.get(k));
                cells.push(cell.map_or_else(|| "-".to_owned(), |cell| label(cell.outcome)));
            }
            cells
        });
        Table::new(head).with(rows)
    }

    /// Fewest steps with the right sequence over all factors that could be judged.
    fn over_all(&self, method: usize) -> String {
        let judged = self.rows.iter().filter(|row| row.error.is_none());
        let all: Vec<Option<u64>> = judged.map(|row| self.fewest(method, row, Outcome::has_right_sequence)).collect();
        let found = || all.iter().flatten();
        let none = all.iter().filter(|n| n.is_none()).count();
        let range = match (found().min(), found().max()) {
            (Some(least), Some(most)) if least == most => least.to_string(),
            (Some(least), Some(most)) => format!("{least} to {most}"),
            _ => return "none".to_owned(),
        };
        if none == 0 { range } else { format!("{range}, none at {none} of {}", all.len()) }
    }

    /// One line for each factor.
    #[must_use]
    pub fn factor_table(&self) -> Table {
        let mut head = vec!["factor", "cycles", "events", "motion", "Flank's steps"];
        head.extend(self.methods.iter().map(String::as_str));
        let rows = self.rows.iter().map(|row| {
            let factor = five_digits(row.factor);
            let (Some(own), Some(window)) = (&row.own, &row.window) else {
                return vec![factor, row.error.clone().unwrap_or_default()];
            };
            let mut cells = vec![
                factor,
                window.cycles.to_string(),
                row.events.to_string(),
                own.to_string(),
                format!("{:.1}", own.steps_per_cycle),
            ];
            for i in 0..self.methods.len() {
                let limit = row.limit_steps_per_cycle[i].map_or_else(|| "-".to_owned(), |n| format!("{n:.1}"));
                let sequence = steps(self.fewest(i, row, Outcome::has_right_sequence));
                let motion = steps(self.fewest(i, row, |outcome| outcome == Outcome::Right));
                cells.push(format!("{limit} / {sequence} / {motion}"));
            }
            cells
        });
        Table::new(head).with(rows)
    }

    /// Returns an explanation of the tables.
    #[must_use]
    pub fn rules(&self, unit: &str) -> String {
        let length = format!("{} {unit}", five_digits(self.period_s));
        format!(
            "A cycle is {}{}. Steps are steps a cycle; \"from\": the fewest on the map from which on every finer step is right too. By \
             factor, of each method: its limit / right sequence from / right motion from.",
            length.trim_end(),
            if unit.is_empty() { " long, without unit" } else { "" }
        )
    }

    /// Names of the files that [`write`](Self::write) writes for a quantity.
    #[cfg(feature = "plot")]
    #[must_use]
    pub fn files(over: Quantity) -> Vec<String> {
        Report::files([format!("stability-{}", over.word()).as_str()], &[TABLE, MAP])
    }

    /// Writes table, figure, report and the map itself. `simulation` is the one that the map was made for.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    #[cfg(feature = "plot")]
    pub fn write(&self, folder: &mut Folder, simulation: &Simulation, print: &Print) -> Result<(), OutputError> {
        let title = Some(simulation.title()).filter(|title| !title.is_empty());
        let figure = self.figure(title.unwrap_or(&simulation.name));
        folder.bytes(TABLE, self.csv())?;
        figure.write(folder, print)?;
        self.report(simulation, figure).write(folder, print)?;
        let scene = json!({ "name": simulation.name, "sha256": simulation.hash() });
        folder.complete(MAP, &json!({ "flank": env!("CARGO_PKG_VERSION"), "scene": scene, "map": self }))
    }

    #[cfg(feature = "plot")]
    fn report(&self, simulation: &Simulation, figure: plot::Figure) -> Report {
        let unit = simulation.unit("s");
        let table = |title: &str, table: Table| Item::from(table.titled(title, ""));
        let rule = &self.rule;
        Report {
            title: figure.title.clone(),
            summary: vec![self.rules(unit)],
            sections: vec![
                Section::new(
                    "Map",
                    "",
                    vec![Item::Figure(figure), table("With the factor 1", self.summary_table(unit))],
                ),
                Section::new("Every factor", "", vec![table("Steps a cycle that are needed", self.factor_table())]),
            ],
            provenance: vec![
                format!("flank {}", env!("CARGO_PKG_VERSION")),
                format!("scene {}; SHA-256 of the scene {}", simulation.name, simulation.hash().unwrap_or_default()),
                format!(
                    "Sequences over at most {} cycles with growth of errors below {:e}; motions over at most {} cycles, settled within \
                     {:e}, one orbit within {}, statistics within {}.",
                    rule.window, rule.growth, rule.cycles, rule.settled, rule.apart, rule.statistics
                ),
            ],
            files: Some("figures".to_owned()),
        }
    }

    /// Returns the table of cells, one row each; rows of the engine have the method `flank`.
    #[cfg(feature = "plot")]
    fn csv(&self) -> String {
        let head = "factor,method,steps_per_cycle,step,outcome,missed,spurious,period_cycles,distance,cycles";
        let mut table = Table::new(head.split(','));
        for row in &self.rows {
            let factor = number(row.factor);
            if let Some(own) = &row.own {
                let word = own.period.map(|period| period.to_string()).unwrap_or_default();
                let (steps, step) = (number(own.steps_per_cycle), number(self.period_s / own.steps_per_cycle));
                let outcome = label(row.own_outcome());
                let (missed, spurious, distance) = ("0".to_owned(), "0".to_owned(), String::new());
                let cycles = own.cycles.to_string();
                let method = "flank".to_owned();
                table.rows.push(vec![
                    factor.clone(),
                    method,
                    steps,
                    step,
                    outcome,
                    missed,
                    spurious,
                    word,
                    distance,
                    cycles,
                ]);
            }
            for (method, cells) in self.methods.iter().zip(&row.cells) {
                for cell in cells {
                    let step = number(self.period_s / cell.steps_per_cycle as f64);
                    let period = cell.period.map(|period| period.to_string()).unwrap_or_default();
                    let distance = cell.distance.map(number).unwrap_or_default();
                    let super::Cell { steps_per_cycle, outcome, missed, spurious, cycles, .. } = cell;
                    let [steps, missed, spurious, cycles] =
                        [*steps_per_cycle, *missed as u64, *spurious as u64, *cycles].map(|n| n.to_string());
                    let (factor, method, outcome) = (factor.clone(), method.to_string(), label(outcome));
                    table
                        .rows
                        .push(vec![factor, method, steps, step, outcome, missed, spurious, period, distance, cycles]);
                }
            }
        }
        table.csv()
    }
}

/// A number of steps, or `none`.
fn steps(n: Option<u64>) -> String {
    n.map_or_else(|| "none".to_owned(), |n| n.to_string())
}
