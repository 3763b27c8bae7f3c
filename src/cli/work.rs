//! Long work over many points: stored as it is done, divided into parts, and merged.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{
    Completion, print,
    progress::{counted, lasting, limit},
    read_scene, tell, threads,
};
use crate::{
    Error, Instructions,
    output::{Fault, Folder, OutputError, read_text},
    scene::Scene,
    sweep::{Begin, CommandFiles, Ending, Records, Share, SweepError},
};

/// File in which a part describes itself, for `flank merge`.
const PART: &str = "part.json";

/// Long work, stored as it is done.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct LongWork {
    /// Resume an interrupted command
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Do part I of N only, counted from 0; flank merge joins the folders of all parts
    #[arg(long, value_name = "I/N", help_heading = "Parts")]
    part: Option<Share>,
    /// Print the number of points and the approximate time that they take
    #[arg(long, help_heading = "Parts")]
    count: bool,
    /// Print the command lines of N parts, and do nothing
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=Share::MOST as u64), help_heading = "Parts")]
    plan: Option<u64>,
    /// Vector instructions of all parts, which this machine must have: those that --plan prints
    #[arg(long, value_name = "NAME", value_parser = instructions, help_heading = "Parts")]
    instructions: Option<Instructions>,
    /// End after this many seconds, at a finished point; exit code 75
    #[arg(long, value_name = "SECONDS", value_parser = seconds, help_heading = "Parts")]
    time_limit: Option<f64>,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print nothing
    #[arg(long, short)]
    pub quiet: bool,
}

fn seconds(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|seconds: &f64| *seconds > 0.0 && *seconds < 1e9);
    value.ok_or_else(|| "a number of seconds above 0, below 1e9".to_owned())
}

fn instructions(name: &str) -> Result<Instructions, String> {
    let best = Instructions::best().name();
    Instructions::named(name).ok_or_else(|| format!("this machine does not have them; its best are {best:?}"))
}

impl LongWork {
    /// Reads its scene, with the requested instructions.
    pub fn scene(&self, path: Option<&Path>) -> Result<Scene, Error> {
        self.instructions.into_iter().for_each(Instructions::choose);
        read_scene(path)
    }

    /// Returns work without arguments, which prints unless it is to be `quiet`.
    pub fn silent(quiet: bool) -> Self {
        Self { quiet, ..Self::default() }
    }

    /// Returns the way in which it begins.
    pub fn begin(&self) -> Begin {
        match (self.resume, self.force) {
            (true, _) => Begin::Resume,
            (_, true) => Begin::Replace,
            _ => Begin::New,
        }
    }

    /// Returns its share of the work.
    fn share(&self) -> Share {
        self.part.unwrap_or(Share::ALL)
    }

    /// Prints, unless the work is quiet.
    pub fn say(&self, text: &str) -> Result<(), Error> {
        if self.quiet { Ok(()) } else { print(text) }
    }
}

/// Command of many points.
pub trait Points: Sized + Sync {
    /// Name of the command.
    const COMMAND: &'static str;
    /// Name of its points, in words.
    const THINGS: &'static str;
    /// Its rows while they are stored.
    type Rows: Send;

    /// Returns the files that it stores.
    fn kept() -> CommandFiles;
    /// Returns the number of its rows, and of the chains by which they are divided.
    fn rows(&self) -> [usize; 2];
    /// Opens the rows of a share in a folder.
    fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Self::Rows>, SweepError>;
    /// Returns the merged rows of parts.
    fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Self::Rows, SweepError>;
    /// Returns its records.
    fn records(rows: &mut Self::Rows) -> &mut Records;
    /// Computes the missing rows.
    fn run(&self, rows: &mut Self::Rows, work: &LongWork, task: crate::Task<'_>) -> Result<Ending, Error>;
    /// Writes the final files, and returns the end of the command.
    fn finish(&self, rows: Self::Rows, work: &LongWork, out: &Path) -> Result<Completion, Error>;
}

/// Does the work of a command, or a share of it, by the arguments `asked`.
pub fn execute<P: Points>(
    points: &P,
    (scene, asked): (&Scene, &Value),
    work: &LongWork,
    (input, out): (Option<&Path>, &Path),
) -> Result<Completion, Error> {
    let [rows, chains] = points.rows();
    if work.count {
        let time = duration(points, work)?;
        print(&format!("{rows} {} in {chains} chains{time}\n", P::THINGS))?;
        return Ok(Completion::Completely);
    }
    if let Some(of) = work.plan {
        return plan(chains, of as usize, out);
    }
    let (begin, share) = (work.begin(), work.share());
    if chains < share.of {
        tell(&format!(
            "warning: {chains} chains of neighbours, fewer than {} parts: some parts have nothing to do",
            share.of
        ));
    }
    if begin != Begin::New {
        P::kept().request(begin, out, input).check()?;
    }
    let Some(mut kept) = points.open(out, begin, share)? else {
        work.say(&format!("{} holds all of it\n", out.display()))?;
        return Ok(Completion::Completely);
    };
    let records = P::records(&mut kept);
    if !records.outputs().is_locked() {
        tell(&format!(
            "warning: the file system of {} has no locks: see that no other command writes there",
            out.display()
        ));
    }
    if !records.lost().is_empty() {
        let lost = records.lost().join(", ");
        tell(&format!("warning: missing or changed in {}: {lost}; all is computed again", out.display()));
    }
    if records.damaged() > 0 {
        tell(&format!(
            "warning: {} damaged records in {}: their {} are computed again",
            records.damaged(),
            out.display(),
            P::THINGS
        ));
    }
    let (own, before) = (records.own(), records.count());
    if share.of > 1 {
        describe::<P>(records.outputs(), (scene, asked), share)?;
    }
    let pool = threads(work.threads)?;
    work.time_limit.into_iter().for_each(limit);
    let ending =
        counted(own, before, P::THINGS, work.quiet, |task| pool.install(|| points.run(&mut kept, work, task)))?;
    let count = P::records(&mut kept).count();
    if ending == Ending::Interrupted {
        let out = out.display();
        work.say(&format!(
            "interrupted: {count} of {own} {} are kept in {out}; the same command with --resume goes on\n",
            P::THINGS
        ))?;
        return Ok(Completion::Interrupted);
    }
    if share.of > 1 {
        work.say(&format!("part {share}: all of its {own} {} are kept in {}\n", P::THINGS, out.display()))?;
        return Ok(Completion::Completely);
    }
    points.finish(kept, work, out)
}

/// Chains that are tried for an estimate, and the time for that, s.
const TRIED: usize = 64;
const TRIAL: f64 = 2.0;

/// Returns the time that all rows take, in words, from those that are done in a moment.
fn duration<P: Points>(points: &P, work: &LongWork) -> Result<String, Error> {
    let [rows, chains] = points.rows();
    let folder = std::env::temp_dir().join(format!("flank-count-{}", std::process::id()));
    let share = Share { part: 0, of: (chains / TRIED).clamp(1, Share::MOST) };
    let pool = threads(work.threads)?;
    let Ok(Some(mut kept)) = points.open(&folder, Begin::New, share) else { return Ok(String::new()) };
    limit(TRIAL);
    let began = Instant::now();
    let quiet = LongWork { quiet: true, ..work.clone() };
    let tried = counted(0, 0, P::THINGS, true, |task| pool.install(|| points.run(&mut kept, &quiet, task)));
    let (seconds, count) = (began.elapsed().as_secs_f64(), P::records(&mut kept).count());
    drop(kept);
    let _ = fs::remove_dir_all(&folder);
    tried?;
    let threads = pool.current_num_threads();
    Ok(match count {
        0 => format!("; none was done within {TRIAL} s"),
        _ => format!(", about {} here (threads: {threads})", lasting(seconds * rows as f64 / count as f64)),
    })
}

/// Prints the command line of every part.
fn plan(chains: usize, of: usize, out: &Path) -> Result<Completion, Error> {
    let words = super::WORDS.get().map_or(&[][..], Vec::as_slice);
    let mut text = String::new();
    let mut kept = Vec::new();
    let mut skip = false;
    for word in words {
        let is_own = ["--plan", "--out"].contains(&word.as_str());
        let is_other = ["--resume", "--force"].contains(&word.as_str());
        if !is_own && !is_other && !skip && !word.starts_with("--plan=") && !word.starts_with("--out=") {
            kept.push(quoted(word));
        }
        skip = is_own;
    }
    // Parts agree to the last bit if they use the same instructions.
    if !words.iter().any(|word| word.starts_with("--instructions")) {
        kept.push(format!("--instructions {}", Instructions::best().name()));
    }
    if chains < of {
        tell(&format!("warning: {chains} chains of neighbours make no more than {chains} parts"));
    }
    let of = of.min(chains.max(1));
    for part in 0..of {
        let folder = quoted(&out.join(format!("part-{part}")).display().to_string());
        text += &format!("{} --part {part}/{of} --resume --out {folder}\n", kept.join(" "));
    }
    print(&text)?;
    Ok(Completion::Completely)
}

/// Returns a word quoted for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Description of a part.
#[derive(Debug, PartialEq, Deserialize, Serialize)]
pub struct PartDescription {
    pub command: String,
    pub part: String,
    /// Name of the scene, and the scene as it was given.
    pub name: String,
    pub scene: Value,
    pub asked: Value,
    /// Name of the vector instructions that it used.
    pub instructions: String,
}

fn describe<P: Points>(folder: &mut Folder, (scene, asked): (&Scene, &Value), share: Share) -> Result<(), OutputError> {
    let (name, scene) = (scene.name(), scene.given());
    let part = json!({
        "command": P::COMMAND, "part": share.to_string(), "name": name, "scene": scene, "asked": asked,
        "instructions": Instructions::best().name(),
    });
    folder.complete(PART, &part)
}

/// Reads the descriptions of the parts in some folders, which must agree except for their numbers.
pub fn parts(folders: &[PathBuf]) -> Result<PartDescription, Error> {
    let mut faults = Vec::new();
    let mut first: Option<PartDescription> = None;
    for folder in folders {
        let place = folder.join(PART);
        let read = read_text(&place).map_err(|error| error.to_string());
        match (
            read.and_then(|text| serde_json::from_str::<PartDescription>(&text).map_err(|error| error.to_string())),
            &first,
        ) {
            (Err(why), _) => faults.push(Fault::new(&place.display().to_string(), why, "the folder of a part")),
            (Ok(part), None) => first = Some(part),
            (Ok(part), Some(known)) => {
                let same = part.command == known.command && part.scene == known.scene && part.asked == known.asked;
                let of = |part: &PartDescription| part.part.parse::<Share>().map(|share| share.of);
                if !same || of(&part) != of(known) {
                    let found =
                        "another scene, command, arguments or number of parts than in the first folder".to_owned();
                    faults.push(Fault::new(&place.display().to_string(), found, "parts of the same work"));
                }
            }
        }
    }
    match first {
        Some(part) if faults.is_empty() => Ok(part),
        _ => Err(Error::Arguments(faults)),
    }
}

/// Reads the arguments of the command of a part.
pub fn read<T: for<'de> Deserialize<'de>>(asked: Value) -> Result<T, Error> {
    serde_json::from_value(asked).map_err(|error| {
        let fault = Fault::new(PART, error.to_string(), "the arguments of a part");
        Error::Arguments(vec![fault.remedy("merge with the version that computed the parts")])
    })
}

/// Folders of parts, and the output of their merge.
pub struct Merge<'a> {
    pub folders: &'a [PathBuf],
    pub of: usize,
    pub out: &'a Path,
    pub force: bool,
    pub only_check: bool,
    pub work: &'a LongWork,
}

/// Merges parts: writes the files of an undivided run.
pub fn merge<P: Points>(points: &P, merge: &Merge<'_>) -> Result<Completion, Error> {
    let Merge { folders, out, work, .. } = merge;
    let begin = if merge.force { Begin::Replace } else { Begin::New };
    let mut rows = points.merged((folders, merge.of), (out, begin))?;
    if merge.only_check {
        let count = P::records(&mut rows).count();
        work.say(&format!("{} parts are complete: {count} {}\n", folders.len(), P::THINGS))?;
        return Ok(Completion::Completely);
    }
    P::records(&mut rows).begin(begin)?;
    points.finish(rows, work, out)
}

/// Returns the name of a scene without folder and ending.
pub fn stem(name: &str) -> String {
    Path::new(name).file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}
