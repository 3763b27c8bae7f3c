//! `flank fit`.

use std::{
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
};

use serde_json::json;

use super::{Completion, pictures::Pictures, print, progress::counted, study::read_study, tell, threads};
use crate::{
    Error, Task,
    output::{Request, Table, five_digits as number, read_text},
    study::{
        StudyError,
        fit::{Fit, FitResult, Trial},
        plan::Plan,
    },
};

/// Arguments of `flank fit`.
#[derive(Debug, clap::Args)]
pub struct FitArguments {
    /// Study file with scenes, plots, claims, and the numbers to find ("fit"); the reference set with one set of numbers, if left out
    study: Option<PathBuf>,
    /// Folder of fit.json, the study with the best numbers, the trials and the figure
    #[arg(long, value_name = "DIR", default_value = "fit")]
    out: PathBuf,
    /// Sets of numbers to try
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    trials: u32,
    /// Seed of the search
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Spread of the first sets around the scenes' own numbers, as a share of the ranges; small values search nearby
    #[arg(long, value_name = "SHARE", default_value_t = 0.25, value_parser = spread)]
    spread: f64,
    /// Random copies with which each set is judged too
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=100))]
    copies: u16,
    /// Largest share by which the numbers of copies differ
    #[arg(long, value_name = "SHARE", default_value_t = 0.02, value_parser = share)]
    jitter: f64,
    /// Resume with the trials in the folder
    #[arg(long, conflicts_with = "force")]
    resume: bool,
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

fn share(word: &str) -> Result<f64, String> {
    word.parse().ok().filter(|share| (0.0..=0.5).contains(share)).ok_or_else(|| "a share from 0 to 0.5".to_owned())
}

/// Reads a spread; zero would try the same numbers for ever.
fn spread(word: &str) -> Result<f64, String> {
    share(word).ok().filter(|share| *share >= 1e-3).ok_or_else(|| "a share from 0.001 to 0.5".to_owned())
}

const TRIALS: &str = "trials.jsonl";
const ANSWER: &str = "fit.json";

/// Finds numbers of a study.
pub fn execute(arguments: &FitArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let plan = match arguments.study.as_deref() {
        Some(path) => {
            let text = read_text(path).map_err(|error| StudyError::File(format!("{}: {error}", path.display())))?;
            read_study(path, &text)?
        }
        None => Plan::one_set()?,
    };
    let fit = Fit::new(&plan, (usize::from(arguments.copies), arguments.jitter), arguments.seed, arguments.spread)?;
    let head = json!({ "flank": env!("CARGO_PKG_VERSION"), "question": fit.identity() }).to_string();
    let known = if arguments.resume { known(&arguments.out.join(TRIALS), &head)? } else { Vec::new() };

    let scenes = plan.scenes().map(|(name, _)| scene_file(name));
    let figures = ["svg", "pdf", "png", "csv", "json"].map(|ending| format!("figures/fit.{ending}"));
    let files = [TRIALS, ANSWER].map(String::from).into_iter().chain(scenes).chain(figures).collect();
    let (input, force) = (arguments.study.as_deref(), arguments.force || arguments.resume);
    let mut folder = Request { folder: &arguments.out, command: "fit", input, force, files }.open()?;
    let mut rows = folder.create(TRIALS)?;
    line(&mut rows, &head)?;
    // Known trials are written before any new one.
    let pool = threads(arguments.threads)?;
    let count = arguments.trials as usize;
    let mut kept = known.len();
    for trial in &known {
        line(&mut rows, &row(trial))?;
    }
    let mut take = |trial: &Trial| {
        // The search repeats known trials, in the same order.
        if kept > 0 {
            kept -= 1;
            return Ok(());
        }
        line(&mut rows, &row(trial))
    };
    let search = |task: Task<'_>| pool.install(|| fit.search(count, known, task, &mut take));
    let trials = match counted(count, 0, "trials", arguments.quiet, search) {
        Err(StudyError::Interrupted) => {
            tell("interrupted: the trials are kept; go on with --resume");
            return Ok(Completion::Interrupted);
        }
        trials => trials?,
    };
    let Some(found) = FitResult::new(&fit, &trials) else { return Ok(Completion::Partly) };
    folder.complete(ANSWER, &found)?;
    if let Some(best) = fit.study(&found.values()) {
        for (name, scene) in best.scenes() {
            folder.complete(&scene_file(name), scene.given())?;
        }
    }
    found.figure(&fit, &trials).write(&mut folder, &form)?;
    if !arguments.quiet {
        print(&words(&found))?;
    }
    Ok(Completion::Completely)
}

fn scene_file(name: &str) -> String {
    format!("{name}.json")
}

fn row(trial: &Trial) -> String {
    serde_json::to_string(trial).unwrap_or_default()
}

fn line(file: &mut File, text: &str) -> Result<(), StudyError> {
    writeln!(file, "{text}").map_err(|error| StudyError::File(format!("{TRIALS}: {error}")))
}

/// Returns the trials of an earlier run of the same question. An incomplete line is ignored.
fn known(path: &Path, head: &str) -> Result<Vec<Trial>, StudyError> {
    let text = fs::read_to_string(path).map_err(|error| StudyError::File(format!("{}: {error}", path.display())))?;
    let mut lines = text.lines();
    if lines.next() != Some(head) {
        let why =
            "its trials belong to another study, seed or version; use --force, or the arguments they were made with";
        return Err(StudyError::File(format!("{}: {why}", path.display())));
    }
    Ok(lines.map_while(|line| serde_json::from_str(line).ok()).collect())
}

fn words(found: &FitResult) -> String {
    let score = |[agree, partly, deviate, unjudged]: [usize; 4]| {
        let rest = if unjudged > 0 { format!(", {unjudged} not judged") } else { String::new() };
        format!("{agree} agree, {partly} in part, {deviate} deviate{rest}")
    };
    let numbers = found.numbers.iter().map(|n| {
        let [low, high] = n.as_good;
        let note = if n.is_plausible { "" } else { "not plausible" };
        vec![n.name.clone(), number(n.found), number(low), number(high), note.to_owned()]
    });
    let claims = found.claims.iter().map(|claim| {
        let verdict = match claim.verdict {
            'a' => "agrees",
            'p' => "in part",
            'd' => "deviates",
            _ => "not judged",
        };
        let held = if claim.held_out { "held out" } else { "" };
        vec![claim.place.clone(), claim.quantity.clone(), verdict.to_owned(), claim.met.to_string(), held.to_owned()]
    });
    let mut text = format!(
        "{} trials, loss {}\n  fitted:   {}\n  held out: {}\n\nNumbers\n{}\nClaims\n{}",
        found.trials,
        number(found.loss),
        score(found.fitted),
        score(found.held_out),
        Table::new(["", "found", "as good from", "to", ""]).with(numbers),
        Table::new(["place", "claim", "best set", "trials in which it is met", ""]).with(claims)
    );
    if !found.never_together.is_empty() {
        let rows = found.never_together.iter().map(|pair| {
            let [a, b] = pair.met;
            vec![pair.claims[0].clone(), pair.claims[1].clone(), format!("{a}, {b}")]
        });
        text += &format!("\nNever met together\n{}", Table::new(["", "", "trials in which each is met"]).with(rows));
    }
    text
}
