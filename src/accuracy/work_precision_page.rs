//! The files of a [`WorkPrecision`].

use serde_json::{Value, json};

use super::{ContenderSummary, Row, Truth, WorkPrecision, charts::charts, work_precision::TARGETS};
use crate::{
    output::{Folder, OutputError},
    plot::{Figure, Item, Report, Section},
};

const TABLE: &str = "compare.csv";
const ERRORS: &str = "compare.json";
const TIMING: &str = "timing.json";

impl WorkPrecision<'_> {
    /// Names of the files that [`write`](Self::write) writes.
    #[must_use]
    pub fn files() -> Vec<String> {
        Report::files(["work-precision", "work-precision-time"], &[TABLE, ERRORS, TIMING])
    }

    /// Writes table, errors, times, charts and report.
    ///
    /// # Errors
    /// [`OutputError`] if a file cannot be written.
    pub fn write(&self, folder: &mut Folder, summaries: &[ContenderSummary]) -> Result<(), OutputError> {
        let name = self.problem.simulation.title();
        let figures = charts(name, &self.truth, &self.rows);
        figures.iter().try_for_each(|figure| figure.write(folder))?;
        folder.bytes(TABLE, self.csv())?;
        folder.complete(ERRORS, &self.json(summaries))?;
        let time = |row: &Row<'_>| json!({ "method": row.contender.name, "setting": row.setting, "time": row.time });
        let times: Vec<Value> = self.rows.iter().map(time).collect();
        let ratios: Vec<Value> = summaries
            .iter()
            .map(|s| {
                let at = TARGETS.iter().zip(&s.ratios).map(
                    |(t, r)| json!({ "error_periods": t, "times_flank": r.map(|r| r.0), "reached": r.map(|r| r.1) }),
                );
                json!({ "method": s.name, "at": at.collect::<Vec<_>>() })
            })
            .collect();
        folder.complete(TIMING, &json!({ "rows": times, "costs": ratios }))?;
        self.report(summaries, figures).write(folder)
    }

    /// Errors and counters: the same input gives the same file. Times are in `timing.json`.
    fn json(&self, summaries: &[ContenderSummary]) -> Value {
        let simulation = self.problem.simulation;
        let Truth { window, error, independent, passages, sizes, .. } = &self.truth;
        let rows = self.rows.iter().map(|row| {
            let mut work = json!(row.work);
            work["evaluations"] = json!(row.evaluations());
            json!({
                "method": row.contender.name, "setting": row.setting, "right_sequence": row.score.is_right(),
                "error": row.score, "work": work, "stopped": row.stopped,
            })
        });
        let orders = summaries.iter().filter_map(|s| {
            Some(json!({ "method": s.name, "order": s.order.as_ref()?, "stable_from_steps_per_cycle": s.stable }))
        });
        json!({
            "flank": env!("CARGO_PKG_VERSION"),
            "scene": simulation.name,
            "scene_sha256": simulation.hash(),
            "period_s": self.problem.period,
            "reference": {
                "events": passages.len(), "error_periods": error, "independent_difference_periods": independent,
                "window_cycles": window.cycles, "window_growth": window.growth, "window_cut": window.cut, "sizes": sizes,
            },
            "rows": rows.collect::<Vec<_>>(),
            "orders": orders.collect::<Vec<_>>(),
        })
    }

    fn csv(&self) -> String {
        let mut text =
            "method,setting,event_time_error_periods,missed,spurious,apart_error,state_error,peak_force_error,\
                        energy_error,steps,evaluations,newton_iterations,factorisations,unconverged_steps\r\n"
                .to_owned();
        let maybe = |x: Option<f64>| x.map_or(String::new(), |x| x.to_string());
        for row in &self.rows {
            let (s, w) = (&row.score, &row.work);
            let (time, errors) = (maybe(s.event_time), [s.apart, s.state, s.peak_force, s.energy].map(maybe).join(","));
            let evaluations = row.evaluations().map_or(String::new(), |e| e.to_string());
            text += &format!("{},{},{time},{},{},{errors}", row.contender.name, row.setting, s.missed, s.spurious);
            text += &format!(",{},{evaluations},{},{},{}\r\n", w.steps, w.iterations, w.factorisations, w.unconverged);
        }
        text
    }

    fn report(&self, summaries: &[ContenderSummary], figures: [Figure; 2]) -> Report {
        let simulation = self.problem.simulation;
        let runs = self.run_table().titled("Runs", self.failures().join("; "));
        let note = "Costs are times over Flank's; in brackets: not reached, told from the order seen.";
        let orders = self.order_table(summaries).titled("Orders and costs", note);
        Report {
            title: format!("Accuracy against work: {}", simulation.title()),
            summary: self.reference().into_iter().chain(self.verdicts(summaries)).collect(),
            sections: vec![
                Section::new("Charts", "", figures.map(Item::Figure).to_vec()),
                Section::new(
                    "Orders",
                    "The order seen is the slope of the error of event times on the finest steps. What it falls short of is said \
                     beside it.",
                    vec![orders.into()],
                ),
                Section::new("All runs", "", vec![runs.into()]),
            ],
            provenance: vec![
                format!("flank {}", env!("CARGO_PKG_VERSION")),
                format!("scene {}; SHA-256 {}", simulation.name, simulation.hash().unwrap_or_default()),
            ],
            files: Some("figures".to_owned()),
        }
    }
}
