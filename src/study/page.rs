//! Report of a study.

use super::{
    FigureKind,
    claims::{Comparison, Verdict},
    plan::{Entry, Plan},
};
use crate::{
    output::label,
    plot::{Item, Report, Section, Table, TableCell},
};

/// Contents of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// Title of the page.
    pub title: String,
    /// Entries in the order made.
    pub entries: Vec<(FigureKind, Entry)>,
    /// Requested plots that cannot be made, with the reasons.
    pub missing: Vec<(FigureKind, String)>,
    /// Contradictions within the source.
    pub contradictions: Vec<Comparison>,
    /// Origin of the page, line by line.
    pub provenance: Vec<String>,
}

impl Contents {
    /// Returns all comparisons, in order.
    #[must_use]
    pub fn comparisons(&self) -> Vec<&Comparison> {
        self.entries.iter().flat_map(|(_, entry)| &entry.comparisons).collect()
    }

    /// Returns the page, in the sections of its plan.
    #[must_use]
    pub fn report(&self, plan: &Plan) -> Report {
        let mut sections = Vec::new();
        for section in &plan.sections {
            let mut items = Vec::new();
            let has = |kind: FigureKind| section.plots.iter().any(|plot| plot.kind == kind);
            for (_, entry) in self.entries.iter().filter(|(kind, _)| has(*kind)) {
                if let Some(figure) = &entry.figure {
                    let mut figure = figure.clone();
                    figure.caption = format!("{} Scene: {}.", figure.caption, entry.scene[0]);
                    items.push(Item::Figure(figure));
                }
                items.extend(entry.listing.clone().map(Item::from));
            }
            if !items.is_empty() {
                sections.push(Section::new(&section.title, &section.text, items));
            }
        }
        if self.entries.iter().any(|(_, entry)| !entry.comparisons.is_empty()) {
            let text = "A number agrees within 5 %, in part within 15 %. A statement agrees if the computed motion bears it \
                        out. Rows that were part of the fit that gave the presets say \"fitted to\": they are no test. Nothing \
                        was tuned to this page.";
            let items = vec![Item::Table(table("All comparisons", "", &self.comparisons()))];
            sections.push(Section::new("Published, Flank, verdict", text, items));
        }
        if !self.contradictions.is_empty() {
            let items = vec![Item::Table(table("", "", &self.contradictions.iter().collect::<Vec<_>>()))];
            let text = "From the source's own tooth numbers, masses, loads and formulas.";
            sections.push(Section::new("Where the source contradicts itself", text, items));
        }
        Report {
            title: self.title.clone(),
            summary: self.summary(),
            sections,
            provenance: self.provenance.clone(),
            files: Some("figures".to_owned()),
        }
    }

    /// Returns the count of published numbers and statements by verdict, as a sentence; none without a comparison.
    #[must_use]
    pub fn score(&self) -> Option<String> {
        let rows = self.comparisons();
        let count = |verdict: Verdict| rows.iter().filter(|row| row.verdict == verdict).count();
        let fitted = rows.iter().filter(|row| row.fitted && row.verdict == Verdict::Agrees).count();
        (!rows.is_empty()).then(|| {
            format!(
                "{} published numbers and statements: {} agree ({fitted} of them were fitted to), {} in part, {} deviate, {} \
                 contradict the source's own data.",
                rows.len(),
                count(Verdict::Agrees),
                count(Verdict::Partly),
                count(Verdict::Deviates),
                count(Verdict::Contradiction)
            )
        })
    }

    fn summary(&self) -> Vec<String> {
        let mut lines: Vec<String> = self.score().into_iter().collect();
        lines.extend(self.missing.iter().map(|(kind, why)| format!("Not made: {} ({why}).", kind.id())));
        lines.push(
            "Drag over a figure to zoom, double-click to return, point at a curve for its numbers; a word in the legend \
             hides its curve."
                .to_owned(),
        );
        lines
    }
}

fn table(title: &str, note: &str, rows: &[&Comparison]) -> Table {
    let cells = |row: &&Comparison| {
        let fitted = || format!("fitted to; {}", row.note).trim_end_matches("; ").to_owned();
        let mut cells = [&row.place, &row.quantity, &row.published, &row.found].map(TableCell::from).to_vec();
        cells.push(TableCell::judged(label(row.verdict), row.verdict));
        cells.push(if row.fitted { fitted() } else { row.note.clone() }.into());
        cells
    };
    Table {
        title: title.to_owned(),
        head: ["Figure", "Quantity", "Published", "Flank", "Verdict", "Note"].map(String::from).to_vec(),
        rows: rows.iter().map(cells).collect(),
        note: note.to_owned(),
    }
}
