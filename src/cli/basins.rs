//! `flank basins`.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    Completion,
    map::RuleArguments,
    pictures::Pictures,
    work::{self, LongWork, Merge, Points, stem},
};
use crate::{
    Error, Task,
    map::{Attractor, BasinResult, Basins, Measured, basins_figure},
    output::{Fault, Table, read_text},
    plot::Print,
    scene::Scene,
    sweep::{Begin, CommandFiles, Ending, Records, Share, SweepError},
};

/// Maximum number of attractors in the printed table.
const MOST: usize = 20;

/// Arguments of `flank basins`.
#[derive(Debug, clap::Args, Deserialize, Serialize)]
pub struct BasinsArguments {
    /// Scene file; the reference scene if left out
    #[serde(skip)]
    scene: Option<PathBuf>,
    /// A coordinate or velocity of the start: /initial/q/I=FROM:TO:COUNT or /initial/v/I=FROM:TO:COUNT, I a number or the name of a
    /// freedom; twice, the last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    #[command(flatten)]
    rule: RuleArguments,
    /// A file of the survey: read if it is there, else written. Parts need the survey only once
    #[arg(long, value_name = "FILE")]
    survey: Option<PathBuf>,
    #[command(flatten)]
    #[serde(skip)]
    work: LongWork,
    /// Folder of basins.csv, attractors.json, basins.json and the figure
    #[arg(long, value_name = "DIR", default_value = "basins")]
    #[serde(skip)]
    out: PathBuf,
    #[command(flatten)]
    #[serde(skip)]
    pictures: Pictures,
}

/// Returns the attractors that were found as text for the terminal.
fn text(found: &BasinResult) -> String {
    let BasinResult { attractors, figures, .. } = found;
    let rows = attractors.iter().take(MOST).enumerate().map(|(i, attractor)| {
        let share = &figures.fractions[i];
        vec![
            i.to_string(),
            attractor.kind.word().to_owned(),
            attractor.period_cycles.map_or_else(String::new, |period| period.to_string()),
            attractor.word.clone().unwrap_or_default(),
            format!("{:.5} ± {:.5}", share.fraction, share.standard_error),
        ]
    });
    let mut out = Table::new(["attractor", "kind", "period", "word", "share of starts"]).with(rows).to_string();
    if attractors.len() > MOST {
        let _ = writeln!(out, "{} more attractors: attractors.json", attractors.len() - MOST);
    }
    let number = |measured: &Option<Measured>| {
        measured.map_or_else(|| "too few points".to_owned(), |m| format!("{:.4} ± {:.4}", m.value, m.standard_error))
    };
    for share in &figures.fractions[attractors.len()..] {
        let _ = writeln!(out, "{}: {:.4} %", share.attractor, 100.0 * share.fraction);
    }
    let _ = writeln!(out, "uncertainty exponent: {}", number(&figures.uncertainty_exponent));
    let _ = writeln!(out, "dimension of the boundary: {}", number(&figures.boundary_dimension));
    let _ = writeln!(out, "basin entropy: {}", number(&figures.basin_entropy));
    let _ = writeln!(out, "boundary entropy: {}", number(&figures.boundary_entropy));
    out
}

/// Basins, the form of their figure, and the file of their survey.
struct Plane {
    basins: Basins,
    name: String,
    form: Print,
    survey: Option<PathBuf>,
}

impl Points for Plane {
    const COMMAND: &'static str = "basins";
    const THINGS: &'static str = "starts";
    type Rows = Records;

    fn kept() -> CommandFiles {
        Basins::FILES
    }

    fn rows(&self) -> [usize; 2] {
        [self.basins.starts(); 2]
    }

    fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Records>, SweepError> {
        self.basins.open(folder, begin, share)
    }

    fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Records, SweepError> {
        self.basins.merged(folders, out)
    }

    fn records(rows: &mut Records) -> &mut Records {
        rows
    }

    fn run(&self, rows: &mut Records, _: &LongWork, task: Task<'_>) -> Result<Ending, Error> {
        let Some(survey) = self.survey(task)? else { return Ok(Ending::Interrupted) };
        Ok(self.basins.run(rows, &survey, task)?)
    }

    fn finish(&self, rows: Records, work: &LongWork, out: &Path) -> Result<Completion, Error> {
        let survey = self.survey(Task::default())?.unwrap_or_default();
        let found = self.basins.finish(rows, &survey, |found, folder| {
            basins_figure(&self.name, self.basins.grid(), found, self.basins.simulation().dimensionless)
                .draw_into(folder, &self.form)
        })?;
        work.say(&format!("{}{} starts: {}\n", text(&found), found.figures.starts, out.join("basins.csv").display()))?;
        let failed = found.figures.fractions.last().map_or(0.0, |failed| failed.fraction);
        // Exact: a share of whole starts.
        let starts = found.figures.starts as f64;
        Ok(Completion::with_failed((failed * starts).round() as u64, starts as u64))
    }
}

/// Survey in a file: the data on which it depends, and its attractors.
#[derive(Deserialize, Serialize)]
struct Survey {
    of: Value,
    attractors: Vec<Attractor>,
}

impl Plane {
    fn new(arguments: &BasinsArguments, scene: Scene, pictures: &Pictures) -> Result<Self, Error> {
        let name = stem(scene.name());
        let basins = Basins::new(scene, &arguments.vary, arguments.rule.rule())?;
        Ok(Self { basins, name, form: pictures.print()?, survey: arguments.survey.clone() })
    }

    /// Returns the survey, from its file if that exists; else computes and writes it. `None` if it is interrupted.
    fn survey(&self, task: Task<'_>) -> Result<Option<Vec<Attractor>>, Error> {
        let of = Value::Object(self.basins.header());
        if let Some(file) = self.survey.as_deref().filter(|file| file.exists()) {
            let place = file.display().to_string();
            let text = read_text(file).map_err(|error| Error::Unread(place.clone(), error))?;
            let fault = |found: String| {
                let fault = Fault::new(&place, found, "the survey of these basins");
                Error::Arguments(vec![fault.remedy("remove the file, or name another one")])
            };
            let survey: Survey = serde_json::from_str(&text).map_err(|error| fault(error.to_string()))?;
            return if survey.of == of {
                Ok(Some(survey.attractors))
            } else {
                Err(fault("one of other basins".to_owned()))
            };
        }
        let Some(attractors) = self.basins.survey(task)? else { return Ok(None) };
        if let Some(file) = &self.survey {
            let survey = Survey { of, attractors: attractors.clone() };
            let text = serde_json::to_string(&survey).unwrap_or_default();
            // Parts that begin together write the same.
            let part = file.with_extension(format!("{}.part", std::process::id()));
            let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, file));
            written.map_err(|error| Error::file(file.display(), error))?;
        }
        Ok(Some(attractors))
    }
}

/// Finds the end of each start.
pub fn execute(arguments: &BasinsArguments) -> Result<Completion, Error> {
    let scene = arguments.work.scene(arguments.scene.as_deref())?;
    let plane = Plane::new(arguments, scene.clone(), &arguments.pictures)?;
    let asked = serde_json::to_value(arguments).unwrap_or_default();
    work::execute(&plane, (&scene, &asked), &arguments.work, (arguments.scene.as_deref(), &arguments.out))
}

/// Merges parts of basins.
pub fn merge(asked: Value, scene: Scene, pictures: &Pictures, parts: &Merge<'_>) -> Result<Completion, Error> {
    let plane = Plane::new(&work::read(asked)?, scene, pictures)?;
    // A merge reads the survey, or computes it again; it writes only into its own folder.
    let survey = plane.survey.clone().filter(|file| file.exists());
    work::merge(&Plane { survey, ..plane }, parts)
}
