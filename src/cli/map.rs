//! `flank map`.

use std::path::{Path, PathBuf};

use flank::{
    map::{KindMap, Rule, Tally, figure},
    sweep::{Begin, Ending},
};

use super::{CliError, Done, pictures::Pictures, print, progress::counted, read_scene, threads};

/// Arguments of `flank map`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// A number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or POINTER=V1,V2,…; twice, the
    /// last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Measures of each contact, by their names in sweep.csv without unit, separated by commas [default: apart_fraction]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    columns: Vec<String>,
    #[command(flatten)]
    rule: RuleArguments,
    #[command(flatten)]
    work: Work,
    /// Folder of map.csv, map.json and the figure
    #[arg(long, value_name = "DIR", default_value = "map")]
    out: PathBuf,
    #[command(flatten)]
    pictures: Pictures,
}

/// How long motions are run.
#[derive(Debug, clap::Args)]
pub struct RuleArguments {
    /// Cycles that belong to the transient
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    transient: u64,
    /// Cycles after it by which the kind of a motion without an orbit is decided
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u64).range(100..=1_000_000))]
    further: u64,
}

impl RuleArguments {
    pub fn rule(&self) -> Rule {
        Rule { transient_cycles: self.transient, further_cycles: self.further, ..Rule::default() }
    }
}

/// Long work, kept as it is done.
#[derive(Debug, clap::Args)]
pub struct Work {
    /// Go on with what was broken off
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print nothing
    #[arg(long, short)]
    pub quiet: bool,
}

impl Work {
    /// How it begins.
    pub fn begin(&self) -> Begin {
        match (self.resume, self.force) {
            (true, _) => Begin::Resume,
            (_, true) => Begin::Replace,
            _ => Begin::New,
        }
    }

    /// Prints, unless that is not wanted.
    pub fn say(&self, text: &str) -> Result<(), CliError> {
        if self.quiet { Ok(()) } else { print(text) }
    }

    /// Says what of it is kept in `out`.
    pub fn interrupted(&self, kept: &str, out: &Path) -> Result<Done, CliError> {
        let out = out.display();
        self.say(&format!("interrupted: {kept} are kept in {out}; the same command with --resume goes on\n"))?;
        Ok(Done::Partly)
    }
}

/// The name of a scene without folder and ending.
pub fn stem(name: &str) -> String {
    Path::new(name).file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// How many cells there are of each kind, one line each.
pub fn counts(tally: &Tally) -> String {
    let share = |count: u64| 100.0 * count as f64 / tally.cells().max(1) as f64;
    tally.kinds().into_iter().map(|(kind, count)| format!("{kind}: {count} ({:.2} %)\n", share(count))).collect()
}

/// Maps the kinds of motion.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let Arguments { work, out, .. } = arguments;
    let form = arguments.pictures.print()?;
    let scene = read_scene(arguments.scene.as_deref())?;
    let map = KindMap::new(scene, &arguments.vary, arguments.rule.rule(), &arguments.columns)?;
    let begin = work.begin();
    if begin != Begin::New {
        KindMap::FILES.request(begin, out, arguments.scene.as_deref()).check()?;
    }
    let cells = map.plane().cells();
    let Some(mut lines) = map.open(out, begin)? else {
        work.say(&format!("{} holds the whole map\n", out.display()))?;
        return Ok(Done::Completely);
    };
    let pool = threads(work.threads)?;
    let ending = counted(cells, lines.count(), "cells", work.quiet, |task| pool.install(|| map.run(&mut lines, task)))?;
    if ending == Ending::Interrupted {
        return work.interrupted(&format!("{} of {cells} cells", lines.count()), out);
    }
    let name = stem(map.plane().scene().name());
    let tally = map.finish(lines, |tally, folder| {
        let dimensionless = map.plane().own().dimensionless;
        figure(&name, map.plane().grid(), tally, &map.shown(), dimensionless).draw_into(folder, &form)
    })?;
    work.say(&format!("{}{} cells: {}\n", counts(&tally), tally.cells(), out.join("map.csv").display()))?;
    Ok(if tally.failed() < tally.cells() as u64 { Done::Completely } else { Done::Partly })
}
