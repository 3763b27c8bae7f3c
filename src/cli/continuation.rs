//! `flank continue`.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{
    Completion,
    checkpoint::{Checkpoint, CommandStart},
    pictures::Pictures,
    print,
    progress::{cancellable, catch_interrupt, running, show},
    read_scene, threads,
};
use crate::{
    Error, Progress,
    branch::{BranchProgress, Continuation, Curve, Family, SpecialKind, curves},
    output::{Fault, Request, Table, five_digits as number},
    plot::Figure,
    scene::Scene,
    simulation::{Parameter, SimulationError},
    study::branches::{Branches, curve_table},
    sweep::GridError,
};

const TABLE: &str = "branches.csv";
const SPECIAL: &str = "special.csv";
const CURVES: &str = "curves.csv";
/// Maximum number of characters of a word in the printed table: eight events.
const LONGEST: usize = 31;
/// Name of the checkpoint file, from which `--resume` goes on.
const STATE: &str = "continue.json";

/// Arguments of `flank continue`.
#[derive(Debug, clap::Args)]
pub struct ContinueArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// The number to vary, by JSON pointer: POINTER=FROM:TO; P1,P2,…=FROM:TO moves further frequencies and periods with the first
    #[arg(long, value_name = "AXIS")]
    vary: String,
    /// Folder of branches.csv, special.csv and the figures
    #[arg(long, value_name = "DIR", default_value = "continue")]
    out: PathBuf,
    #[command(flatten)]
    pictures: Pictures,
    /// Period of the first orbit, cycles; the smallest that is found if left out
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    period: Option<u64>,
    /// Levels of branches beyond the first that are followed from doublings and broken symmetries
    #[arg(long, value_name = "N", default_value_t = 3)]
    doublings: u32,
    /// Kind of special points to follow in a second number
    #[arg(long, value_name = "KIND", requires = "second", value_enum)]
    follow: Option<SpecialKind>,
    /// Second number, by JSON pointer: POINTER=FROM:TO, as with --vary
    #[arg(long, value_name = "AXIS", requires = "follow")]
    second: Option<String>,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Resume an interrupted command
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// Reads `P1,P2,…=FROM:TO`.
fn axis(text: &str) -> Result<(Vec<&str>, [f64; 2]), Vec<Fault>> {
    const FORM: &str = "POINTER=FROM:TO, such as /train/speed_rpm=400:6000";
    let fault = |found: String| vec![Fault::new(text, found, FORM)];
    let (pointers, range) = text.rsplit_once('=').ok_or_else(|| fault("no equals sign".to_owned()))?;
    let (from, to) = range.split_once(':').ok_or_else(|| fault(format!("{range:?} as range")))?;
    let end = |word: &str| {
        word.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| fault(format!("{word:?} as an end")))
    };
    let ends = [end(from)?, end(to)?];
    if ends[0] == ends[1] {
        return Err(fault("a range without length".to_owned()));
    }
    Ok((pointers.split(',').collect(), ends))
}

/// Returns the parameter of an axis, and its range extended to the scene's own value.
fn number_of(scene: &Scene, text: &str) -> Result<(Parameter, [f64; 2]), Error> {
    let (pointers, ends) = axis(text).map_err(GridError)?;
    let parameter = Parameter::around(scene, &pointers, ends).map_err(|fault| GridError(vec![fault]))?;
    Ok((parameter, ends))
}

/// Work done so far, as the checkpoint holds it.
#[derive(Serialize, Deserialize)]
struct CheckpointWork {
    followed: BranchProgress,
    curves: Vec<Curve>,
}

/// Follows branches of orbits.
pub fn execute(arguments: &ContinueArguments) -> Result<Completion, Error> {
    let scene = read_scene(arguments.scene.as_deref())?;
    let (parameter, ends) = number_of(&scene, &arguments.vary)?;
    let mut family = Family::new(&scene, parameter, ends)?;
    let form = arguments.pictures.print()?;
    let mut files = [STATE, TABLE, SPECIAL].map(String::from).to_vec();
    files.extend(Figure::files("branches"));
    if let Some(second) = &arguments.second {
        let (second, ends) = number_of(&scene, second)?;
        family = family.with(second, ends)?;
        files.push(CURVES.to_owned());
        files.extend(Figure::files("curves"));
    }
    let asked = json!({
        "flank": env!("CARGO_PKG_VERSION"), "scene_sha256": scene.hash(), "vary": arguments.vary, "period": arguments.period,
        "doublings": arguments.doublings, "follow": arguments.follow, "second": arguments.second,
    });
    let force = arguments.force || arguments.resume;
    let request =
        Request { folder: &arguments.out, command: "continue", input: arguments.scene.as_deref(), force, files };
    let name = Path::new(scene.name()).file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let begun = Checkpoint::begin::<CheckpointWork>(&request, STATE, &asked, (arguments.resume, arguments.quiet))?;
    let (mut checkpoint, earlier) = match begun {
        CommandStart::Open(checkpoint, earlier) => (checkpoint, earlier),
        CommandStart::Finished(done) => return Ok(done),
    };
    let mut branches = Branches::new(family.clone())?;
    let bar = running(arguments.quiet);
    let tried = AtomicUsize::new(0);
    let progress = |progress| match progress {
        Progress::Unit => bar.set_message(format!("{} orbits", tried.fetch_add(1, Ordering::Relaxed) + 1)),
        Progress::Share(_) => show(&bar, progress, None),
    };
    let working = catch_interrupt();
    let task = cancellable(&progress);
    let method = Continuation { period: arguments.period, doublings: arguments.doublings };
    let (earlier, known) = earlier.map_or((None, Vec::new()), |work| (Some(work.followed), work.curves));
    let pool = threads(arguments.threads)?;
    let mut keep = |followed: &BranchProgress, curves: &[Curve], finished: Option<bool>| -> Result<(), Error> {
        branches.take(&followed.branches, task);
        let folder = &mut checkpoint.folder;
        folder.bytes(TABLE, branches.table())?;
        folder.bytes(SPECIAL, branches.special_table())?;
        // Figures are drawn at the end: a resumed command needs only tables.
        let is_last = finished != Some(false);
        if is_last {
            branches.figure(&name).draw_into(folder, &form)?;
        }
        if arguments.follow.is_some() {
            folder.bytes(CURVES, curve_table(curves))?;
            if is_last {
                branches.plane(curves, &name).draw_into(folder, &form)?;
            }
        }
        match finished {
            Some(false) => checkpoint.keep(&CheckpointWork { followed: followed.clone(), curves: curves.to_vec() })?,
            Some(true) => checkpoint.finish(Completion::Completely)?,
            None => {}
        }
        Ok(())
    };
    let mut failed = None;
    let mut each = |followed: &BranchProgress| -> Result<(), SimulationError> {
        failed = failed.take().or(keep(followed, &known, Some(false)).err());
        Ok(())
    };
    let followed = pool.install(|| method.run(&family, earlier, &mut each, task));
    let mut found = Vec::new();
    if let (Some(kind), Ok(followed)) = (arguments.follow, &followed) {
        let mut each = |curves: &[Curve]| -> Result<(), SimulationError> {
            failed = failed.take().or(keep(followed, curves, Some(false)).err());
            Ok(())
        };
        let branches = &followed.branches;
        found = pool.install(|| curves(&family, kind, branches, known.clone(), &mut each, task))?;
    }
    drop(working);
    bar.finish_and_clear();
    if let Some(error) = failed {
        return Err(error);
    }
    let followed = followed?;
    let is_whole = !task.is_cancelled();
    // An interrupted branch is in the tables, and is followed again later.
    keep(&followed, &found, is_whole.then_some(true))?;
    if !arguments.quiet {
        let left_out = if is_whole { followed.left_out } else { 0 };
        print(&text(&branches, left_out).unwrap_or_default())?;
        print(&curves_text(&found).unwrap_or_default())?;
    }
    if is_whole {
        return Ok(Completion::Completely);
    }
    if !arguments.quiet {
        print("interrupted: the branches so far are kept; the same command with --resume goes on\n")?;
    }
    Ok(Completion::Interrupted)
}

/// Returns one line for each curve, one for each point of codimension two.
fn curves_text(curves: &[Curve]) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    for (i, curve) in curves.iter().enumerate() {
        let Curve { kind, points, ends } = curve;
        writeln!(out, "curve {i}, {}: {} points, from {} to {}", kind.word(), points.len(), ends[0], ends[1])?;
        for point in points {
            if let Some(special) = point.codimension_two {
                writeln!(out, "curve {i}: {} at {:?}, {:?}", special.word(), point.value, point.second)?;
            }
        }
    }
    Ok(out)
}

/// Returns a word short enough for a line; the tables have all of it.
fn shortened(word: &str) -> String {
    if word.len() <= LONGEST { word.to_owned() } else { format!("{} …", &word[..LONGEST]) }
}

fn text(branches: &Branches, left_out: usize) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    for (i, branch) in branches.branches.iter().enumerate() {
        writeln!(
            out,
            "branch {i}, level {}: {} points, from {} to {}",
            branch.level,
            branch.points.len(),
            branch.ends[0],
            branch.ends[1]
        )?;
    }
    if left_out > 0 {
        writeln!(
            out,
            "{left_out} further branches are not followed: the limit is reached; take a shorter range or fewer --doublings"
        )?;
    }
    for (i, branch) in branches.branches.iter().enumerate() {
        for passed in &branch.unlocated {
            writeln!(out, "branch {i}: not located: {passed}")?;
        }
    }
    let rows = branches.specials().map(|special| {
        vec![
            special.branch.to_string(),
            special.kind.word().to_owned(),
            format!("{:?}", special.value),
            special.period.to_string(),
            shortened(&special.word),
            number(special.residual),
            number(special.uncertainty),
        ]
    });
    let head = ["branch", "kind", "parameter", "period", "word", "residual", "uncertainty"].map(String::from);
    write!(out, "{}", Table::new(head).with(rows))?;
    Ok(out)
}
