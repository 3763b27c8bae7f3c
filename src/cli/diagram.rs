//! `flank diagram`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    Completion,
    pictures::Pictures,
    work::{self, LongWork, Merge, Points, stem},
};
use crate::{
    Error, Task,
    map::{BranchLine, Diagram, DiagramRows, Sampling, diagram_figure},
    output::Fault,
    plot::Print,
    scene::Scene,
    sweep::{Begin, CommandFiles, Ending, Records, Seeding, Share, SweepError},
};

/// Arguments of `flank diagram`.
#[derive(Debug, clap::Args, Deserialize, Serialize)]
pub struct DiagramArguments {
    /// Scene file; the reference scene if left out
    #[serde(skip)]
    scene: Option<PathBuf>,
    /// The number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or POINTER=V1,V2,…
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Each value starts where the one before it ended: upwards, downwards, or both
    #[arg(long, default_value = "up", value_parser = ["up", "down", "both"])]
    seed: String,
    /// Number of starts of the first value: that of the scene, and others spread around it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    starts: u64,
    /// Cycles dropped at each value
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    transient: u64,
    /// Cycles recorded at each value
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    points: u64,
    /// Folder of flank continue over the same number: its branches are drawn over the points
    #[arg(long, value_name = "DIR")]
    branches: Option<PathBuf>,
    #[command(flatten)]
    #[serde(skip)]
    work: LongWork,
    /// Folder of diagram.csv, impacts.csv, exponents.csv, diagram.json and the figure
    #[arg(long, value_name = "DIR", default_value = "diagram")]
    #[serde(skip)]
    out: PathBuf,
    #[command(flatten)]
    #[serde(skip)]
    pictures: Pictures,
}

/// Diagram, the branches over it, and the form of its figure.
struct DiagramWithForm {
    diagram: Diagram,
    name: String,
    branches: Vec<BranchLine>,
    form: Print,
}

impl Points for DiagramWithForm {
    const COMMAND: &'static str = "diagram";
    const THINGS: &'static str = "values";
    type Rows = DiagramRows;

    fn kept() -> CommandFiles {
        Diagram::FILES
    }

    fn rows(&self) -> [usize; 2] {
        [self.diagram.rows(), self.diagram.plan().chains()]
    }

    fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<DiagramRows>, SweepError> {
        self.diagram.open(folder, begin, share)
    }

    fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<DiagramRows, SweepError> {
        self.diagram.merged(folders, out)
    }

    fn records(rows: &mut DiagramRows) -> &mut Records {
        rows.records_mut()
    }

    fn run(&self, rows: &mut DiagramRows, _: &LongWork, task: Task<'_>) -> Result<Ending, Error> {
        Ok(self.diagram.run(rows, task)?)
    }

    fn finish(&self, rows: DiagramRows, work: &LongWork, out: &Path) -> Result<Completion, Error> {
        let (diagram, count) = (&self.diagram, self.diagram.rows());
        let own = diagram.own();
        let first = own.structure.spec().freedoms.first().map_or_else(String::new, |freedom| own.in_words(freedom));
        let points = diagram.finish(rows, |points, folder| {
            let shown = (diagram.pointer(), first);
            diagram_figure(&self.name, (&shown.0, &shown.1, own.dimensionless), points, &self.branches)
                .draw_into(folder, &self.form)
        })?;
        let failed = match points.failed {
            0 => String::new(),
            failed => format!(", {failed} values failed (exponents.csv, column error)"),
        };
        work.say(&format!("{} section points{failed}: {}\n", points.sections, out.join("diagram.csv").display()))?;
        Ok(Completion::with_failed(points.failed as u64, count as u64))
    }
}

impl DiagramWithForm {
    fn new(arguments: &DiagramArguments, scene: Scene, pictures: &Pictures) -> Result<Self, Error> {
        let name = stem(scene.name());
        let seeding = match arguments.seed.as_str() {
            "down" => Seeding::Down,
            "both" => Seeding::Both,
            _ => Seeding::Up,
        };
        let sampling = Sampling {
            starts: arguments.starts as usize,
            transient_cycles: arguments.transient,
            recorded_cycles: arguments.points,
        };
        let diagram = Diagram::new(scene, &arguments.vary, seeding, sampling)?;
        let branches = arguments.branches.as_deref().map(|folder| {
            let fault =
                |found: String| Fault::new("--branches", found, "a folder of flank continue with the same scene");
            diagram.branches(folder).map_err(|found| Error::Arguments(vec![fault(found)]))
        });
        let branches = branches.transpose()?.unwrap_or_default();
        Ok(Self { diagram, name, branches, form: pictures.print()? })
    }
}

/// Draws a diagram.
pub fn execute(arguments: &DiagramArguments) -> Result<Completion, Error> {
    let scene = arguments.work.scene(arguments.scene.as_deref())?;
    let drawn = DiagramWithForm::new(arguments, scene.clone(), &arguments.pictures)?;
    let asked = serde_json::to_value(arguments).unwrap_or_default();
    work::execute(&drawn, (&scene, &asked), &arguments.work, (arguments.scene.as_deref(), &arguments.out))
}

/// Merges parts of a diagram.
pub fn merge(asked: Value, scene: Scene, pictures: &Pictures, parts: &Merge<'_>) -> Result<Completion, Error> {
    work::merge(&DiagramWithForm::new(&work::read(asked)?, scene, pictures)?, parts)
}
