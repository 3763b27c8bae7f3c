//! `flank study`.

use std::path::{Path, PathBuf};

use flank::{
    output::{Folder, Request},
    plot::{self, Theme},
    scene::Scene,
    study::{
        Kind, Listing, StudyError,
        figures::Context,
        page::Contents,
        plan::{Entry, Plan},
        published::{Comparison, contradictions},
        steady::Rule,
    },
    sweep::{Axis, GridError},
};
use serde::Serialize;
use serde_json::json;

use super::{
    CliError, Done, print,
    progress::{catch_interrupt, counting, interrupt},
    session::threads,
};

/// Arguments of `flank study`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference planetary set, beside its published numbers, if left out
    scene: Option<PathBuf>,
    /// Folder of report.html, the figures and their data
    #[arg(long, value_name = "DIR", default_value = "study")]
    out: PathBuf,
    /// Make only these figures
    #[arg(long, value_name = "FIG", num_args = 1.., value_parser = kind)]
    only: Vec<Kind>,
    /// Loads, N m: FROM:TO:COUNT or V1,V2,…
    #[arg(long, value_name = "AXIS")]
    loads: Option<String>,
    /// Speeds, rev/min: FROM:TO:COUNT or V1,V2,…
    #[arg(long, value_name = "AXIS")]
    speeds: Option<String>,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

fn kind(word: &str) -> Result<Kind, String> {
    Kind::ALL.into_iter().find(|kind| kind.id() == word).ok_or_else(|| {
        let names: Vec<&str> = Kind::ALL.iter().map(|kind| kind.id()).collect();
        format!("known figures: {}", names.join(", "))
    })
}

const TABLE: &str = "table.csv";
const SUMMARY: &str = "study.json";
pub(super) const REPORT: &str = "report.html";

/// The table behind a figure.
fn table(kind: Kind) -> String {
    format!("figures/{}-table.csv", kind.id())
}

/// `study.json`: where everything came from, and the table.
#[derive(Serialize)]
struct Summary<'a> {
    flank: &'static str,
    rule: Rule,
    figures: Vec<serde_json::Value>,
    missing: Vec<serde_json::Value>,
    comparisons: Vec<&'a Comparison>,
    contradictions: &'a [Comparison],
}

/// Makes a study.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let plan = plan(arguments)?;
    let asked: Vec<Kind> = Kind::ALL
        .into_iter()
        .filter(|kind| arguments.only.is_empty() || arguments.only.contains(kind))
        .filter(|kind| plan.published || !kind.is_of_reference() || arguments.only.contains(kind))
        .collect();

    let figures = asked.iter().flat_map(|kind| forms(kind.id()).into_iter().chain([table(*kind)]));
    let files = figures.chain([TABLE, SUMMARY, REPORT].map(String::from)).collect();
    let (input, force) = (arguments.scene.as_deref(), arguments.force);
    let mut folder = Request { folder: &arguments.out, command: "study", input, force, files }.open()?;

    catch_interrupt();
    let bar = counting("runs", arguments.quiet);
    bar.set_length(asked.iter().map(|kind| plan.runs(*kind) as u64).sum());
    let done = || bar.inc(1);
    let context = Context { rule: Rule::default(), interrupted: interrupt(), done: &done };
    let pool = threads(arguments.threads)?;

    let mut failed = false;
    let mut contents = Contents { title: title(&plan), ..Contents::default() };
    for kind in asked {
        match pool.install(|| plan.make(kind, &context)) {
            Ok(entry) => {
                if let Some(figure) = &entry.figure {
                    write(&mut folder, figure)?;
                }
                if let Some(listing) = &entry.listing {
                    folder.bytes(&table(kind), listing_csv(listing).as_bytes())?;
                }
                contents.entries.push((kind, entry));
            }
            Err(StudyError::Interrupted) => {
                bar.finish_and_clear();
                let (kept, out) = (contents.entries.len(), arguments.out.display());
                let text =
                    format!("interrupted: {kept} figures are kept in {out}/figures; there is no report of them\n");
                return print(&text).map(|()| Done::Partly);
            }
            // A train without what a figure shows is no failure, unless that figure was asked for by name.
            Err(StudyError::Missing { missing, .. }) if arguments.only.is_empty() => {
                contents.missing.push((kind, missing))
            }
            Err(error @ (StudyError::Scene(_) | StudyError::Missing { .. })) => {
                bar.finish_and_clear();
                return Err(error.into());
            }
            // One figure that fails does not take the others with it.
            Err(error) => {
                failed = true;
                contents.missing.push((kind, error.to_string()));
            }
        }
    }
    bar.finish_and_clear();
    if plan.published && arguments.only.is_empty() {
        contents.contradictions = contradictions().map_err(StudyError::from)?;
    }
    contents.provenance = provenance(&contents, &context.rule);

    folder.bytes(TABLE, csv(&contents).as_bytes())?;
    folder.complete(SUMMARY, &summary(&contents, context.rule))?;
    folder.bytes(REPORT, contents.report().html().as_bytes())?;
    if !arguments.quiet {
        print(&text(&contents, &arguments.out))?;
    }
    Ok(if failed { Done::Partly } else { Done::Completely })
}

fn plan(arguments: &Arguments) -> Result<Plan, CliError> {
    let mut faults = Vec::new();
    // An axis has a pointer in a sweep; here it has the name of its argument.
    let mut values = |name: &str, text: &Option<String>| {
        let axis = Axis::parse(&format!("/{name}={}", text.as_ref()?)).map_err(|found| faults.extend(found)).ok()?;
        Some((0..axis.count()).map(|i| axis.value(i)).collect::<Vec<f64>>())
    };
    let (loads, speeds) = (values("loads", &arguments.loads), values("speeds", &arguments.speeds));
    if !faults.is_empty() {
        return Err(GridError(faults).into());
    }
    let plan = match &arguments.scene {
        Some(path) => Plan::of(&Scene::from_file(path)?),
        None => Plan::reference()?,
    };
    let plan = plan.varied(loads, speeds);
    // Before anything is written.
    match plan.refused().into_iter().next() {
        Some(error) => Err(error.into()),
        None => Ok(plan),
    }
}

fn title(plan: &Plan) -> String {
    if plan.published {
        "Vibro-impact of the reference planetary set".to_owned()
    } else {
        format!("Study of {}", plan.light.name())
    }
}

/// The files of a figure.
pub(super) fn forms(id: &str) -> [String; 4] {
    ["csv", "json", "svg", "png"].map(|kind| format!("figures/{id}.{kind}"))
}

/// One figure in all its forms.
pub(super) fn write(folder: &mut Folder, figure: &plot::Figure) -> Result<(), CliError> {
    let [csv, json, svg, png] = forms(&figure.id);
    folder.bytes(&csv, figure.csv().as_bytes())?;
    folder.bytes(&json, figure.json().as_bytes())?;
    folder.bytes(&svg, plot::svg(figure, Theme::Light).as_bytes())?;
    Ok(folder.bytes(&png, &plot::png(figure, 1.5))?)
}

fn provenance(contents: &Contents, rule: &Rule) -> Vec<String> {
    let mut lines = vec![format!("flank {}", env!("CARGO_PKG_VERSION"))];
    for (kind, Entry { scene: [words, hash], .. }) in &contents.entries {
        lines.push(format!("{}: scene {words}; SHA-256 of the scene {hash}", kind.id()));
    }
    let settling = rule.settling;
    lines.push(format!(
        "Transients end when the motion is within {:e} (relative) of an orbit of at most {} periods, judged from the section at \
         the start of each forcing period; after {} periods a motion counts as irregular.",
        settling.tolerance, settling.longest_period, settling.most_cycles
    ));
    lines
}

fn summary(contents: &Contents, rule: Rule) -> Summary<'_> {
    let figure = |(kind, entry): &(Kind, Entry)| {
        json!({
            "id": kind.id(), "scene": entry.scene[0], "scene_sha256": entry.scene[1], "table": entry.listing,
        })
    };
    Summary {
        flank: env!("CARGO_PKG_VERSION"),
        rule,
        figures: contents.entries.iter().map(figure).collect(),
        missing: contents.missing.iter().map(|(kind, why)| json!({ "id": kind.id(), "why": why })).collect(),
        comparisons: contents.comparisons(),
        contradictions: &contents.contradictions,
    }
}

fn rows(contents: &Contents) -> impl Iterator<Item = &Comparison> {
    contents.comparisons().into_iter().chain(&contents.contradictions)
}

/// A row as RFC 4180 asks, every field quoted.
fn line<'f>(fields: impl IntoIterator<Item = &'f str>) -> String {
    let quoted = |field: &str| format!("\"{}\"", field.replace('"', "\"\""));
    fields.into_iter().map(quoted).collect::<Vec<_>>().join(",") + "\r\n"
}

fn csv(contents: &Contents) -> String {
    let mut text = line(["figure", "quantity", "published", "flank", "verdict", "note"]);
    for row in rows(contents) {
        text += &line([row.place, &row.quantity, &row.published, &row.found, row.verdict.word(), &row.note]);
    }
    text
}

fn listing_csv(listing: &Listing) -> String {
    let rows = std::iter::once(&listing.head).chain(&listing.rows);
    rows.map(|row| line(row.iter().map(String::as_str))).collect()
}

fn text(contents: &Contents, out: &Path) -> String {
    let mut text = format!("{}\n\n", contents.title);
    for row in contents.comparisons() {
        let (word, place, quantity) = (row.verdict.word(), row.place, &row.quantity);
        text += &format!("{word:<13}  {place:>6}  {quantity}: published {}, Flank {}\n", row.published, row.found);
    }
    text += "\n";
    for (kind, why) in &contents.missing {
        text += &format!("not made: {} ({why})\n", kind.id());
    }
    text + &format!("report: {}\n", out.join("report.html").display())
}
