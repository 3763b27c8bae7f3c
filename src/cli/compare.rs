//! `flank compare`.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use super::{Completion, open, pictures::Pictures, print, progress::counted, report_line, request};
use crate::{
    Error,
    accuracy::{AccuracyError, Contender, ContenderSummary, Problem, SolverKind, WorkPrecision},
};

/// Arguments of `flank compare`.
#[derive(Debug, clap::Args)]
pub struct CompareArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Methods, such as rk4, newmark, hht=0.1, verlet, rk4+tanh=1e6, bdf, flank-explicit; the usual ones if left out
    #[arg(long, value_name = "M1,M2,…", value_delimiter = ',', num_args = 1..)]
    methods: Vec<String>,
    /// Write compare.json, compare.csv, timing.json, charts and report.html into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Maximum number of cycles to compare over; the scene's own, but not more than 50, if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    cycles: Option<u64>,
    /// Largest growth of errors in the window
    #[arg(long, value_name = "X", default_value_t = 1e3, value_parser = growth)]
    growth: f64,
    /// Maximum number of steps of one run
    #[arg(long, value_name = "N", default_value_t = 2_000_000)]
    most_steps: u64,
    /// Timed repetitions of each run
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    repetitions: u16,
    /// Write into a folder that is not empty
    #[arg(long, requires = "out")]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    pictures: Pictures,
}

fn growth(word: &str) -> Result<f64, String> {
    word.parse().ok().filter(|x| (1.0..=1e6).contains(x)).ok_or_else(|| "a number from 1 to 1e6".to_owned())
}

/// Methods that are compared by default.
const USUAL: [&str; 8] = ["flank", "rk4", "rk4+cubic", "newmark", "verlet", "euler", "tsit45", "bdf"];

/// Compares methods on a scene.
pub fn execute(arguments: &CompareArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let simulation = open(arguments.scene.as_deref())?;
    let problem = Problem::new(&simulation, arguments.cycles)?;
    let contenders = contenders(arguments, &problem)?;
    let (out, scene) = (arguments.out.as_deref(), arguments.scene.as_deref());
    let request = request(out, "compare", scene, arguments.force, WorkPrecision::files())?;

    let mut found = WorkPrecision::new(&problem, &contenders, arguments.growth, arguments.most_steps)?;
    let start = Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    let (runs, repetitions) = (found.runs(), arguments.repetitions);
    if !counted(runs, 0, "runs", arguments.quiet, |task| found.run(repetitions, &clock, task))? {
        return print("interrupted: nothing was written\n").map(|()| Completion::Interrupted);
    }
    let summaries = found.summaries();
    if let Some(request) = &request {
        found.write(&mut request.open()?, &summaries, &form)?;
    }
    if !arguments.quiet {
        print(&text(&simulation.name, &found, &summaries, out))?;
    }
    Ok(Completion::Completely)
}

fn contenders(arguments: &CompareArguments, problem: &Problem<'_>) -> Result<Vec<Contender>, Error> {
    let mut faults = Vec::new();
    let mut found: Vec<Contender> = Vec::new();
    let words: Vec<&str> = if arguments.methods.is_empty() {
        USUAL.to_vec()
    } else {
        // Flank is the reference for the others.
        std::iter::once("flank").chain(arguments.methods.iter().map(String::as_str)).collect()
    };
    for word in words {
        match Contender::parse(word) {
            Ok(contender) if found.iter().any(|c| c.name == contender.name) => {}
            Ok(contender) if contender.applies_to(&problem.simulation.structure) => found.push(contender),
            Ok(_) if arguments.methods.is_empty() => {}
            Ok(contender) => faults.push(AccuracyError::Word {
                word: word.to_owned(),
                problem: match contender.kind {
                    SolverKind::Adaptive(_) if cfg!(feature = "diffsol") => {
                        "it needs a force at every contact, and a rigid one has none".to_owned()
                    }
                    _ => "not part of this build: it needs the cargo feature diffsol".to_owned(),
                },
            }),
            Err(error) => faults.push(error),
        }
    }
    if faults.is_empty() { Ok(found) } else { Err(Error::Methods(faults)) }
}

fn text(name: &str, found: &WorkPrecision<'_>, summaries: &[ContenderSummary], out: Option<&Path>) -> String {
    let mut text = format!("{name}\n\n{}\n", found.reference().join("\n"));
    if out.is_none() {
        text += &format!("\n{}", found.run_table());
    }
    text += "\n";
    // Without the last column, whose content follows in words.
    let mut orders = found.order_table(summaries);
    orders.rows.iter_mut().chain([&mut orders.head]).for_each(|row| drop(row.pop()));
    text += &format!("{orders}\n");
    for s in summaries {
        let order = s.order.as_ref().filter(|o| !o.reason.is_empty());
        text += &order.map_or(String::new(), |o| format!("{} falls short of its order: {}\n", s.name, o.reason));
    }
    text += &(found.verdicts(summaries).join("\n") + "\n");
    let failures = found.failures();
    if !failures.is_empty() {
        text += "\nFailed:\n";
        failures.iter().for_each(|line| text += &format!("  {line}\n"));
    }
    if out.is_some() { text + "\n" + &report_line(out) } else { text }
}
