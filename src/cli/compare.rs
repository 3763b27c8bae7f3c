//! `flank compare`.

use std::{
    path::PathBuf,
    time::{Duration, Instant as Stopwatch},
};

use flank::{
    accuracy::{AccuracyError, Contender, Kind, Problem, Row, Setting, Truth, score},
    output::Request,
    scene::Duration as Length,
};

use super::{
    CliError, Done,
    comparison::{Comparison, Time},
    print,
    progress::{catch_interrupt, counting, interrupted},
    session::Session,
};

/// Arguments of `flank compare`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Methods, such as rk4, newmark, hht=0.1, verlet, rk4+tanh=1e6, bdf, flank-explicit; the usual ones if left out
    #[arg(long, value_name = "M1,M2,…", value_delimiter = ',', num_args = 1..)]
    methods: Vec<String>,
    /// Write compare.json, compare.csv, timing.json, charts and report.html into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Cycles to compare over, at most; the scene's own, but not more than 50, if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    cycles: Option<u64>,
    /// The window ends before errors grow so many times
    #[arg(long, value_name = "X", default_value_t = 1e3, value_parser = growth, allow_negative_numbers = true)]
    growth: f64,
    /// Most steps of one run
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
}

fn growth(word: &str) -> Result<f64, String> {
    word.parse().ok().filter(|x| (1.0..=1e6).contains(x)).ok_or_else(|| "a number from 1 to 1e6".to_owned())
}

/// What is compared if nobody says.
const USUAL: [&str; 8] = ["flank", "rk4", "rk4+cubic", "newmark", "verlet", "euler", "tsit45", "bdf"];
/// Cycles if nobody says.
const CYCLES: u64 = 50;
/// Flank is run so long in each repetition that a clock can tell.
const MEASURABLE: Duration = Duration::from_millis(3);
/// One setting is not timed longer than this, repetitions and all.
const PATIENCE: Duration = Duration::from_secs(6);

/// Compares methods on a scene.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let session = Session::open(arguments.scene.as_deref())?;
    let problem = problem(&session, arguments.cycles);
    let contenders = contenders(arguments, &problem)?;
    let (input, force, files) = (arguments.scene.as_deref(), arguments.force, Comparison::files());
    let request = arguments.out.as_deref().map(|folder| Request { folder, command: "compare", input, force, files });
    request.as_ref().map(Request::check).transpose()?;
    catch_interrupt();

    let truth = Truth::find(&problem, arguments.growth)?;
    let cycles = truth.window.cycles;
    let plan: Vec<(&Contender, Setting)> = contenders
        .iter()
        .flat_map(|c| c.settings(cycles, arguments.most_steps).into_iter().map(move |s| (c, s)))
        .collect();
    if let Some(idle) = contenders.iter().find(|c| !plan.iter().any(|(p, _)| p.name == c.name)) {
        let problem = format!(
            "no run of {cycles} cycles fits into --most-steps {}: allow {} or more",
            arguments.most_steps,
            47 * cycles
        );
        return Err(AccuracyError::Word { word: idle.name.clone(), problem }.into());
    }
    let bar = counting("runs", arguments.quiet);
    bar.set_length(plan.len() as u64);
    let (mut rows, mut times, mut stopped) = (Vec::new(), Vec::new(), Vec::new());
    for (contender, setting) in plan {
        if interrupted() {
            bar.finish_and_clear();
            return print("interrupted: nothing was written\n").map(|()| Done::Partly);
        }
        let run = contender.perform(&problem, cycles, setting)?;
        let score = score(&truth, &run, problem.period);
        stopped.push(run.stopped);
        rows.push(Row { contender, setting, score, work: run.work });
        times.push(time(contender, setting, &problem, cycles, arguments.repetitions)?);
        bar.inc(1);
    }
    bar.finish_and_clear();

    let comparison = Comparison {
        session: &session,
        problem: &problem,
        truth: &truth,
        rows: &rows,
        times: &times,
        stopped: &stopped,
    };
    let summaries = comparison.summaries(&contenders);
    if let Some(request) = &request {
        comparison.write(&mut request.open()?, &summaries)?;
    }
    if !arguments.quiet {
        print(&comparison.text(&summaries, arguments.out.as_deref()))?;
    }
    Ok(Done::Completely)
}

fn problem(session: &Session, cycles: Option<u64>) -> Problem<'_> {
    let run = &session.case.built.run;
    let clock = session.case.clock();
    let [from, _, end] = session.instants;
    let span = clock.between(from, end);
    let period = run.period.or_else(|| clock.period().map(|t| t.value())).unwrap_or(span);
    let own = match run.duration {
        Length::Cycles(n) => n,
        // OK to convert: whole cycles within the run.
        Length::Until(_) => ((span / period * (1.0 + 1e-12)).floor() as u64).max(1),
    };
    Problem {
        structure: &session.case.structure,
        start: session.start.clone(),
        period,
        cycles: cycles.unwrap_or(own.min(CYCLES)),
        choice: run.method,
        tolerance: run.tolerance,
    }
}

fn contenders(arguments: &Arguments, problem: &Problem<'_>) -> Result<Vec<Contender>, CliError> {
    let mut faults = Vec::new();
    let mut found: Vec<Contender> = Vec::new();
    let words: Vec<&str> = if arguments.methods.is_empty() {
        USUAL.to_vec()
    } else {
        // Flank is what the others are measured against.
        std::iter::once("flank").chain(arguments.methods.iter().map(String::as_str)).collect()
    };
    for word in words {
        match Contender::parse(word) {
            Ok(contender) if found.iter().any(|c| c.name == contender.name) => {}
            Ok(contender) if contender.applies_to(problem.structure) => found.push(contender),
            Ok(_) if arguments.methods.is_empty() => {}
            Ok(contender) => faults.push(AccuracyError::Word {
                word: word.to_owned(),
                problem: match contender.kind {
                    Kind::Adaptive(_) if cfg!(feature = "diffsol") => {
                        "it needs a force at every contact, and a rigid one has none".to_owned()
                    }
                    _ => "not part of this build: it needs the cargo feature diffsol".to_owned(),
                },
            }),
            Err(error) => faults.push(error),
        }
    }
    if faults.is_empty() { Ok(found) } else { Err(CliError::Methods(faults)) }
}

fn time(
    contender: &Contender,
    setting: Setting,
    problem: &Problem<'_>,
    cycles: u64,
    repetitions: u16,
) -> Result<Time, CliError> {
    let flank = Contender::parse("flank")?;
    let once = |contender: &Contender, setting: Setting| -> Result<f64, CliError> {
        let watch = Stopwatch::now();
        let mut runs = 0u32;
        while runs == 0 || watch.elapsed() < MEASURABLE {
            contender.solve(problem, cycles, setting)?;
            runs += 1;
        }
        Ok(watch.elapsed().as_secs_f64() / f64::from(runs) / cycles as f64)
    };
    let (mut theirs, mut ours, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let watch = Stopwatch::now();
    while ratios.is_empty() || (ratios.len() < usize::from(repetitions) && watch.elapsed() < PATIENCE) {
        let (a, b) = (once(&flank, Setting::RoundOff)?, once(contender, setting)?);
        ours.push(a);
        theirs.push(b);
        ratios.push(b / a);
    }
    let repetitions = ratios.len();
    let [seconds_per_cycle, flank_seconds_per_cycle, ratio] = [theirs, ours, ratios].map(median);
    Ok(Time { seconds_per_cycle, flank_seconds_per_cycle, ratio, repetitions })
}

pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + values[middle]) } else { values[middle] }
}
