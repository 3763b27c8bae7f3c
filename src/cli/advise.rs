//! `flank advise`.

use std::{path::PathBuf, time::Instant};

use serde::Serialize;
use serde_json::json;

use super::{Completion, pictures::Pictures, print, progress::counted, read_scene, report_line, request, wrapped};
use crate::{
    Error, Task,
    accuracy::median,
    plot::Report,
    study::{
        Context, StudyError,
        advise::{Advice, AdvisePlan, Rung},
        steady::Rule,
    },
};

/// Arguments of `flank advise`.
#[derive(Debug, clap::Args)]
pub struct AdviseArguments {
    /// Scene file; the reference planetary set under light load if left out
    scene: Option<PathBuf>,
    /// Folder of report.html, the figures and their data
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Largest accepted change: forcing periods of time apart, share of the peak force
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = tolerance)]
    tolerance: f64,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    pictures: Pictures,
}

fn tolerance(word: &str) -> Result<f64, String> {
    let wanted = || "a number above 0 and below 1, such as 0.01".to_owned();
    word.parse().ok().filter(|share| *share > 0.0 && *share < 1.0).ok_or_else(wanted)
}

const TABLE: &str = "advise.csv";
const ADVICE: &str = "advise.json";
const TIMING: &str = "timing.json";

/// Content of `timing.json`, the only file that differs between two runs.
#[derive(Serialize)]
struct Timing {
    /// Repetitions; within each, all models in turn.
    repetitions: usize,
    models: Vec<ModelTime>,
}

#[derive(Serialize)]
struct ModelTime {
    model: String,
    /// Forcing cycles of a repetition.
    cycles: u64,
    /// Median time of a forcing cycle, s.
    cycle_s: f64,
}

const REPETITIONS: usize = 5;
/// Approximate dense steps of a repetition.
const STEPS: f64 = 4_000.0;

/// Runs `flank advise`.
pub fn execute(arguments: &AdviseArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let plan = AdvisePlan::new(&read_scene(arguments.scene.as_deref())?)?;
    // Refused before any run, created with the first output.
    let files = Report::files(["rungs", "freedoms"], &[TABLE, ADVICE, TIMING]);
    let (out, scene) = (arguments.out.as_deref(), arguments.scene.as_deref());
    let request = request(out, "advise", scene, arguments.force, files)?;
    let found = counted(plan.runs(), 0, "models", arguments.quiet, |task| {
        let advice = plan.advice(&Context { rule: Rule::default(), task }, arguments.tolerance)?;
        let timing = timing(&advice, task)?;
        Ok((advice, timing))
    });
    let (advice, timing) = match found {
        Err(StudyError::Interrupted) => {
            return print("interrupted: nothing was written\n").map(|()| Completion::Interrupted);
        }
        found => found?,
    };

    if let Some(request) = &request {
        let mut folder = request.open()?;
        for figure in advice.figures() {
            figure.write(&mut folder, &form)?;
        }
        folder.bytes(TABLE, advice.csv())?;
        folder.complete(ADVICE, &json!({ "flank": env!("CARGO_PKG_VERSION"), "advice": advice }))?;
        folder.complete(TIMING, &timing)?;
        advice.report(env!("CARGO_PKG_VERSION")).write(&mut folder, &form)?;
    }
    if !arguments.quiet {
        let report = if out.is_some() { "\n".to_owned() + &report_line(out) } else { String::new() };
        print(&(text(&advice, &timing) + &report))?;
    }
    Ok(Completion::Completely)
}

/// Returns the models of the table, in its order, and the least one if that is not among them.
fn timed(advice: &Advice) -> Vec<&Rung> {
    let table = std::iter::once(&advice.full).chain(&advice.rungs).chain(&advice.together);
    let mut models: Vec<&Rung> = table.collect();
    models.extend(advice.least().filter(|least| models.iter().all(|model| model.words != least.words)));
    models
}

/// Times a forcing cycle of every model, the models in turn.
fn timing(advice: &Advice, task: Task<'_>) -> Result<Timing, StudyError> {
    let models = timed(advice);
    let cycles = |rung: &Rung| (STEPS / rung.motion.work.steps.max(1.0)).clamp(4.0, 1_000.0) as u64;
    let mut seconds = vec![Vec::new(); models.len()];
    for _ in 0..REPETITIONS {
        for (rung, seconds) in models.iter().zip(&mut seconds) {
            if task.is_cancelled() {
                return Err(StudyError::Interrupted);
            }
            let start = Instant::now();
            rung.advance(cycles(rung))?;
            seconds.push(start.elapsed().as_secs_f64() / cycles(rung) as f64);
        }
    }
    let timed = |(rung, seconds): (&&Rung, Vec<f64>)| ModelTime {
        model: rung.words.clone(),
        cycles: cycles(rung),
        cycle_s: median(seconds),
    };
    let models = models.iter().zip(seconds).map(timed).collect();
    Ok(Timing { repetitions: REPETITIONS, models })
}

fn text(advice: &Advice, timing: &Timing) -> String {
    let mut text = format!("{}: how little is enough\n\n", advice.scene);
    let mut models = advice.models_table();
    // The time replaces the events, which are in the files: a line should fit a terminal.
    let place = models.head.len() - 2;
    models.head[place] = "µs/T".to_owned();
    for (row, timed) in models.rows.iter_mut().zip(&timing.models) {
        row[place] = format!("{:.1}", 1e6 * timed.cycle_s);
    }
    text += &format!("{models}\n");
    let freedoms = advice.freedoms_table();
    if freedoms.rows.len() > 1 {
        text += &format!("{freedoms}\n");
    }
    for line in advice.verdicts() {
        text += &(wrapped(&line, "") + "\n");
    }
    if let Some(faster) = faster(advice, timing) {
        text += &faster;
    }
    text + "\n" + &wrapped(&advice.rule_in_words(), "") + "\n"
}

/// Returns a line on the time that the least model saves; `None` if there is none or it was not timed.
fn faster(advice: &Advice, timing: &Timing) -> Option<String> {
    let least = advice.least()?;
    let own = timing.models.iter().find(|timed| timed.model == least.words)?;
    let full = timing.models.first()?;
    let [from, to] = [full.cycle_s, own.cycle_s].map(|seconds| 1e6 * seconds);
    Some(format!("It takes {to:.1} µs a cycle, the scene {from:.1} µs: {:.1} times as fast.\n", from / to))
}
