//! `flank study`.

use std::{
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;

use super::{Completion, axis, pictures::Pictures, print, progress::counted, read_scene, report_line, threads};
use crate::{
    Error,
    output::{Request, Table, label, read_text},
    plot::Report,
    simulation::SimulationError,
    study::{
        Context, FigureKind, StudyError,
        claims::Comparison,
        page::Contents,
        plan::{Entry, Plan},
        steady::Rule,
    },
    sweep::{Axis, GridError},
};

/// Arguments of `flank study`.
#[derive(Debug, clap::Args)]
pub struct StudyArguments {
    /// Scene, or study file with scenes, plots and claims; the reference planetary set, beside its published numbers, if left out
    scene: Option<PathBuf>,
    /// The reference set with one set of numbers for all figures, preset reference, in place of three
    #[arg(long, conflicts_with = "scene")]
    one_set: bool,
    /// Folder of report.html, the figures and their data
    #[arg(long, value_name = "DIR", default_value = "study")]
    out: PathBuf,
    /// Make only these figures
    #[arg(long, value_name = "FIG", num_args = 1.., value_parser = kind)]
    only: Vec<FigureKind>,
    /// Loads, N m: FROM:TO:COUNT or V1,V2,…; POINTER= before them names another number
    #[arg(long, value_name = "AXIS")]
    loads: Option<String>,
    /// Speeds, rev/min, likewise
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
    #[command(flatten)]
    pictures: Pictures,
}

fn kind(word: &str) -> Result<FigureKind, String> {
    FigureKind::ALL.into_iter().find(|kind| kind.id() == word).ok_or_else(|| {
        let names: Vec<&str> = FigureKind::ALL.iter().map(|kind| kind.id()).collect();
        format!("known figures: {}", names.join(", "))
    })
}

const TABLE: &str = "table.csv";
const SUMMARY: &str = "study.json";

/// Returns the file name of the table of a figure.
fn table(kind: FigureKind) -> String {
    format!("figures/{}-table.csv", kind.id())
}

/// Content of `study.json`: the origin of all results, and the table.
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
pub fn execute(arguments: &StudyArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let plan = plan(arguments)?;
    let asked: Vec<FigureKind> = FigureKind::ALL
        .into_iter()
        .filter(
            |kind| {
                if arguments.only.is_empty() { plan.kinds().contains(kind) } else { arguments.only.contains(kind) }
            },
        )
        .collect();

    let mut files = Report::files(asked.iter().map(|kind| kind.id()), &[TABLE, SUMMARY]);
    files.extend(asked.iter().map(|kind| table(*kind)));
    let (input, force) = (arguments.scene.as_deref(), arguments.force);
    let folder = Mutex::new(Request { folder: &arguments.out, command: "study", input, force, files }.open()?);

    let pool = threads(arguments.threads)?;
    let (rule, runs) = (Rule::default(), asked.iter().map(|kind| plan.runs(*kind)).sum());
    let made = counted(runs, 0, "runs", arguments.quiet, |task| {
        let make = |kind: &FigureKind| {
            let made = plan.make(*kind, &Context { rule, task });
            // Written as soon as it is made: later plots may be interrupted.
            if let Ok(entry) = &made {
                let mut folder = folder.lock().unwrap_or_else(PoisonError::into_inner);
                entry.figure.iter().try_for_each(|figure| figure.write(&mut folder, &form))?;
                entry.listing.iter().try_for_each(|listing| folder.bytes(&table(*kind), listing.csv()))?;
            }
            Ok((*kind, made))
        };
        pool.install(|| asked.par_iter().with_max_len(1).map(make).collect::<Result<Vec<_>, Error>>())
    })?;
    let mut folder = folder.into_inner().unwrap_or_else(PoisonError::into_inner);
    let (mut failed, mut interrupted) = (false, false);
    let mut contents = Contents { title: plan.title.clone(), ..Contents::default() };
    for (kind, made) in made {
        match made {
            Ok(entry) => contents.entries.push((kind, entry)),
            // A train without data for a figure is no failure, unless that figure was requested by name.
            Err(StudyError::Simulation(SimulationError::Missing { missing, .. })) if arguments.only.is_empty() => {
                contents.missing.push((kind, missing))
            }
            Err(StudyError::Simulation(error @ (SimulationError::Scene(_) | SimulationError::Missing { .. }))) => {
                return Err(error.into());
            }
            Err(error @ StudyError::File(_)) => return Err(error.into()),
            Err(StudyError::Interrupted) => interrupted = true,
            // A figure that fails does not prevent the others.
            Err(error) => {
                failed = true;
                contents.missing.push((kind, error.to_string()));
            }
        }
    }
    if interrupted {
        let (kept, out) = (contents.entries.len(), arguments.out.display());
        let text = format!("interrupted: {kept} figures are kept in {out}/figures; there is no report of them\n");
        return print(&text).map(|()| Completion::Interrupted);
    }
    if !plan.claims.is_empty() && arguments.only.is_empty() {
        contents.contradictions = plan.contradictions()?;
    }
    contents.provenance = provenance(&contents, &rule);

    folder.bytes(TABLE, csv(&contents))?;
    folder.complete(SUMMARY, &summary(&contents, rule))?;
    contents.report(&plan).write(&mut folder, &form)?;
    if !arguments.quiet {
        print(&text(&contents, &arguments.out))?;
    }
    Ok(if failed { Completion::Partly } else { Completion::Completely })
}

fn plan(arguments: &StudyArguments) -> Result<Plan, Error> {
    let mut faults = Vec::new();
    let mut varied = |name: &str, text: &Option<String>| {
        let text = text.as_ref()?;
        let has_pointer = text.contains('=');
        let read = if has_pointer {
            Axis::parse(text).map_err(|found| faults.extend(found)).ok()
        } else {
            axis(name, text, &mut faults)
        }?;
        Some((has_pointer.then(|| read.pointer.clone()), read.all()))
    };
    let (loads, speeds) = (varied("loads", &arguments.loads), varied("speeds", &arguments.speeds));
    if !faults.is_empty() {
        return Err(GridError(faults).into());
    }
    let mut plan = match arguments.scene.as_deref() {
        Some(path) => match study_file(path) {
            Some(text) => read_study(path, &text)?,
            None => Plan::of(&read_scene(Some(path))?)?,
        },
        None if arguments.one_set => Plan::one_set()?,
        None => Plan::reference()?,
    };
    let split = |varied: Option<(Option<String>, Vec<f64>)>, own: &mut Option<String>| {
        let (pointer, values) = varied?;
        *own = pointer.or_else(|| own.take());
        Some(values)
    };
    let (loads, speeds) = (split(loads, &mut plan.load), split(speeds, &mut plan.speed));
    let plan = plan.varied(loads, speeds);
    // Before anything is written.
    match plan.refused().into_iter().next() {
        Some(error) => Err(error.into()),
        None => Ok(plan),
    }
}

/// Reads the study in the file at `path`, whose text is `text`.
pub(super) fn read_study(path: &Path, text: &str) -> Result<Plan, StudyError> {
    Plan::read(text, &|name| {
        let file = path.with_file_name(name);
        read_text(&file).map_err(|error| format!("{}: {error}", file.display()))
    })
}

/// Returns the text of a study file; none if the file is a scene.
fn study_file(path: &Path) -> Option<String> {
    let text = read_text(path).ok().filter(|text| text.contains("\"flank_study\""))?;
    let is_study = |file: &serde_json::Value| file.get("flank_study").is_some();
    // A text that is not JSON is read again, for its error.
    serde_json::from_str(&text).map_or(true, |file| is_study(&file)).then_some(text)
}

fn provenance(contents: &Contents, rule: &Rule) -> Vec<String> {
    let mut lines = vec![format!("flank {}", env!("CARGO_PKG_VERSION"))];
    for (kind, Entry { scene: [words, hash], .. }) in &contents.entries {
        lines.push(format!("{}: scene {words}; SHA-256 of the scene {hash}", kind.id()));
    }
    let settling = rule.approach;
    lines.push(format!(
        "Transients end when the motion is within {:e} (relative) of an orbit of at most {} periods, judged from the section at \
         the start of each forcing period; after {} periods a motion counts as irregular.",
        settling.tolerance, settling.longest_period, settling.most_cycles
    ));
    lines
}

fn summary(contents: &Contents, rule: Rule) -> Summary<'_> {
    let figure = |(kind, entry): &(FigureKind, Entry)| {
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

fn csv(contents: &Contents) -> String {
    let row = |row: &Comparison| {
        let [place, quantity, published, found] =
            [&row.place, &row.quantity, &row.published, &row.found].map(String::clone);
        vec![place, quantity, published, found, label(row.verdict), row.note.clone(), row.fitted.to_string()]
    };
    let head = ["figure", "quantity", "published", "flank", "verdict", "note", "fitted"];
    Table::new(head).with(rows(contents).map(row)).csv()
}

fn text(contents: &Contents, out: &Path) -> String {
    let mut text = format!("{}\n\n", contents.title);
    for row in contents.comparisons() {
        let (word, place, quantity) = (label(row.verdict), &row.place, &row.quantity);
        let fitted = if row.fitted { " (fitted to)" } else { "" };
        text +=
            &format!("{word:<13}  {place:>6}  {quantity}: published {}, Flank {}{fitted}\n", row.published, row.found);
    }
    text += &contents.score().map_or_else(|| "\n".to_owned(), |score| format!("\n{score}\n\n"));
    for (kind, why) in &contents.missing {
        text += &format!("not made: {} ({why})\n", kind.id());
    }
    text + &report_line(Some(out))
}
