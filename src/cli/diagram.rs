//! `flank diagram`.

use std::path::PathBuf;

use flank::{
    map::{Diagram, Sampling, diagram_figure},
    output::Fault,
    sweep::{Begin, Ending, Seeding},
};

use super::{
    CliError, Done,
    map::{Work, stem},
    pictures::Pictures,
    progress::counted,
    read_scene, threads,
};

/// Arguments of `flank diagram`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// The number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or POINTER=V1,V2,…
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Each value starts where the one before it ended: upwards, downwards, or both
    #[arg(long, default_value = "up", value_parser = ["up", "down", "both"])]
    seed: String,
    /// Starts of the first value: that of the scene, and others spread around it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    starts: u64,
    /// Cycles dropped at each value
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(0..=1_000_000_000))]
    transient: u64,
    /// Cycles recorded at each value
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    points: u64,
    /// A folder of flank continue over the same number: its branches are drawn over the points
    #[arg(long, value_name = "DIR")]
    branches: Option<PathBuf>,
    #[command(flatten)]
    work: Work,
    /// Folder of diagram.csv, impacts.csv, exponents.csv, diagram.json and the figure
    #[arg(long, value_name = "DIR", default_value = "diagram")]
    out: PathBuf,
    #[command(flatten)]
    pictures: Pictures,
}

/// Draws a diagram.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let Arguments { work, out, .. } = arguments;
    let form = arguments.pictures.print()?;
    let scene = read_scene(arguments.scene.as_deref())?;
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
        let fault = |found: String| Fault::new("--branches", found, "a folder of flank continue with the same scene");
        diagram.branches(folder).map_err(|found| CliError::Arguments(vec![fault(found)]))
    });
    let branches = branches.transpose()?.unwrap_or_default();
    let begin = work.begin();
    if begin != Begin::New {
        Diagram::FILES.request(begin, out, arguments.scene.as_deref()).check()?;
    }
    let count = diagram.rows();
    let Some(mut rows) = diagram.open(out, begin)? else {
        work.say(&format!("{} holds the whole diagram\n", out.display()))?;
        return Ok(Done::Completely);
    };
    let pool = threads(work.threads)?;
    let ending =
        counted(count, rows.kept(), "values", work.quiet, |task| pool.install(|| diagram.run(&mut rows, task)))?;
    if ending == Ending::Interrupted {
        return work.interrupted(&format!("{} of {count} values", rows.kept()), out);
    }
    let own = diagram.own();
    let first = own.structure.spec().freedoms.first().map_or_else(String::new, |freedom| own.in_words(freedom));
    let points = diagram.finish(rows, |points, folder| {
        diagram_figure(&name, (&diagram.pointer(), &first, own.dimensionless), points, &branches)
            .draw_into(folder, &form)
    })?;
    let failed = match points.failed {
        0 => String::new(),
        failed => format!(", {failed} values failed (exponents.csv, column error)"),
    };
    work.say(&format!("{} section points{failed}: {}\n", points.sections, out.join("diagram.csv").display()))?;
    Ok(if points.failed < count { Done::Completely } else { Done::Partly })
}
