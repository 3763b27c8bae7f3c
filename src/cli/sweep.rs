//! `flank sweep`.

use std::path::PathBuf;

use flank::{
    scene::{Scene, SceneError},
    study::{
        Case, StudyError,
        steady::{ContactSteady, Rule, Seed, Steady, steady},
    },
    sweep::{
        Begin, Cell, Ending, Entry, Grid, Journal, Outcome, Plan, Seeding, SweepError, Work, number, request, run,
    },
};
use serde_json::{Value, json};

use super::{
    CliError, Done, print,
    progress::{catch_interrupt, counting, interrupt},
    session,
};

/// Arguments of `flank sweep`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// A number to vary, by JSON pointer: POINTER=FROM:TO:COUNT, the same with :log for equal ratios, or
    /// POINTER=V1,V2,…; once or twice, the last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    /// Where a point starts: as the scene says, or from the end of its neighbour along the last axis
    #[arg(long, value_enum, default_value = "fresh")]
    seed: Start,
    /// Folder of sweep.csv, sweep.jsonl and sweep.json
    #[arg(long, value_name = "DIR", default_value = "sweep")]
    out: PathBuf,
    /// Go on with a sweep that was broken off
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Relative distance from a periodic orbit at which the transient is over [default: 1e-9]
    #[arg(long, value_name = "REL", value_parser = tolerance)]
    tolerance: Option<f64>,
    /// Cycles after which a motion counts as irregular [default: 400]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    max_cycles: Option<u64>,
    /// Cycles measured [default: 4 of a periodic motion, 200 of an irregular one; always whole periods]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    measure_cycles: Option<u64>,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// See [`Seeding`].
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Start {
    /// Each point as the scene says
    Fresh,
    /// Each from the one before it
    Up,
    /// Each from the one after it
    Down,
    /// Up and down, two rows a point
    Both,
}

/// Below rounding nothing settles; above a tenth everything does.
fn tolerance(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|value| (1e-13..=0.1).contains(value));
    value.ok_or_else(|| "a number from 1e-13 to 0.1 is wanted".to_owned())
}

/// Sweeps a scene.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let scene = session::read(arguments.scene.as_deref())?;
    let grid = Grid::parse(&arguments.vary)?;
    let dimensionless = corners(&scene, &grid)?;
    let seeding = match arguments.seed {
        Start::Fresh => Seeding::Fresh,
        Start::Up => Seeding::Up,
        Start::Down => Seeding::Down,
        Start::Both => Seeding::Both,
    };
    let (plan, rule) = (Plan::new(grid, seeding), rule(arguments));
    let mut header = plan.header();
    header.insert("flank".to_owned(), env!("CARGO_PKG_VERSION").into());
    header.insert("scene_sha256".to_owned(), scene.hash().into());
    header.insert("rule".to_owned(), json!(rule));

    let begin = match (arguments.resume, arguments.force) {
        (true, _) => Begin::Resume,
        (_, true) => Begin::Replace,
        _ => Begin::New,
    };
    if begin != Begin::New {
        request(&arguments.out, arguments.scene.as_deref(), begin).check()?;
    }
    let out = arguments.out.display();
    let say = |text: String| if arguments.quiet { Ok(()) } else { print(&text) };
    let Some(mut journal) = Journal::<Steady, Seed>::open(&arguments.out, begin, header, plan.rows())? else {
        say(format!("{out} holds the whole sweep\n"))?;
        return Ok(Done::Completely);
    };
    catch_interrupt();
    let bar = counting("rows", arguments.quiet);
    bar.set_length(plan.rows() as u64);
    bar.set_position(journal.kept() as u64);
    bar.reset_eta();
    let point = |cell: &Cell, seed: Option<&Seed>| -> Result<(Steady, Seed), StudyError> {
        let scene = at(&scene, plan.grid(), &cell.values)?;
        let steady = steady(&scene, seed, &rule, interrupt())?;
        let end = steady.end.clone();
        Ok((steady, end))
    };
    let threads = arguments.threads.map_or(0, usize::from);
    let work = Work { point, progress: |done, _| bar.set_position(done as u64), interrupted: interrupt(), threads };
    let ending = run(&plan, &mut journal, &work);
    bar.finish_and_clear();
    if ending? == Ending::Interrupted {
        let (kept, all) = (journal.kept(), plan.rows());
        say(format!("interrupted: {kept} of {all} rows are kept in {out}; the same command with --resume goes on\n"))?;
        return Ok(Done::Partly);
    }
    let contacts = contacts(&plan, &mut journal)?;
    let tally = journal.finish(&plan, &columns(&contacts, dimensionless), |steady| cells(&contacts, steady))?;
    let failed = match tally.failed {
        0 => String::new(),
        failed => format!(", {failed} of them failed (column error)"),
    };
    say(format!("{} rows{failed}: {}\n", tally.rows, arguments.out.join("sweep.csv").display()))?;
    Ok(if tally.failed < tally.rows { Done::Completely } else { Done::Partly })
}

fn rule(arguments: &Arguments) -> Rule {
    let mut rule = Rule::default();
    if let Some(tolerance) = arguments.tolerance {
        rule.settling.tolerance = tolerance;
    }
    if let Some(cycles) = arguments.max_cycles {
        rule.settling.most_cycles = cycles;
    }
    if let Some(cycles) = arguments.measure_cycles {
        (rule.measured_cycles, rule.irregular_cycles) = (cycles, cycles);
    }
    rule
}

/// The scene at a point.
fn at(scene: &Scene, grid: &Grid, values: &[f64]) -> Result<Scene, SceneError> {
    // Whole numbers are written as such: some keys take no others. Below 2⁵³ nothing is lost.
    let json = |v: f64| if v.fract() == 0.0 && v.abs() < 9e15 { Value::from(v as i64) } else { Value::from(v) };
    scene.with_all(grid.axes().iter().zip(values).map(|(axis, value)| (axis.pointer.as_str(), json(*value))))
}

/// Checks that the scene holds at both ends of every axis, with each other. Says whether it is dimensionless.
fn corners(scene: &Scene, grid: &Grid) -> Result<bool, CliError> {
    let mut corners = vec![Vec::new()];
    for axis in grid.axes() {
        let ends = [0, axis.count() - 1].map(|i| axis.value(i));
        corners = corners.iter().flat_map(|corner: &Vec<f64>| ends.map(|end| [&corner[..], &[end]].concat())).collect();
    }
    let (mut scenes, mut faults) = (Vec::new(), Vec::new());
    for corner in corners {
        match at(scene, grid, &corner) {
            Ok(scene) => scenes.push(scene),
            Err(error) => faults.extend(error.faults),
        }
    }
    if !faults.is_empty() {
        faults = faults.iter().enumerate().filter(|(i, f)| !faults[..*i].contains(f)).map(|(_, f)| f.clone()).collect();
        return Err(SceneError { name: scene.name().to_owned(), faults }.into());
    }
    let mut dimensionless = false;
    for scene in &scenes {
        let case = Case::new(scene)?;
        case.period()?;
        case.start()?;
        dimensionless = case.built.dimensionless;
    }
    Ok(dimensionless)
}

/// Names of the contacts of all rows: where the train itself is varied, not every row has each.
fn contacts(plan: &Plan, journal: &mut Journal<Steady, Seed>) -> Result<Vec<String>, SweepError> {
    let mut names = Vec::new();
    for row in 0..plan.rows() {
        if let Some(Entry { outcome: Outcome::Done { result, .. }, .. }) = journal.entry(row)? {
            for (name, _) in named(&result) {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
    }
    Ok(names)
}

/// Contacts and their names, those that have been given before with a number.
fn named(steady: &Steady) -> impl Iterator<Item = (String, &ContactSteady)> {
    steady.contacts.iter().enumerate().map(|(j, contact)| {
        let name = &contact.report.name;
        let before = steady.contacts[..j].iter().filter(|other| other.report.name == *name).count();
        (if before == 0 { name.clone() } else { format!("{name} ({})", before + 1) }, contact)
    })
}

/// What is told of a contact: the name of the column, its unit, the value.
type Measure = (&'static str, &'static str, fn(&ContactSteady) -> Option<f64>);

const MEASURES: [Measure; 14] = [
    ("apart_fraction", "", |c| Some(c.report.apart_fraction)),
    ("no_force_fraction", "", |c| Some(c.report.no_force_fraction)),
    ("separations_per_cycle", "", |c| c.report.separations_per_cycle),
    ("contacts_per_cycle", "", |c| c.report.contacts_per_cycle),
    ("no_force_mean", "_s", |c| c.report.durations.mean),
    ("no_force_longest", "_s", |c| c.report.durations.max),
    ("force_mean", "_n", |c| Some(c.report.force_mean)),
    ("force_min", "_n", |c| c.report.force_min),
    ("force_max", "_n", |c| c.report.force_max),
    ("force_amplitude", "_n", |c| Some(c.force_amplitude)),
    ("force_harmonic_1", "_n", |c| c.force_harmonics.first().copied()),
    ("force_harmonic_2", "_n", |c| c.force_harmonics.get(1).copied()),
    ("deflection_min", "_m", |c| c.report.deflection_min),
    ("deflection_max", "_m", |c| c.report.deflection_max),
];

/// Columns of the table. A dimensionless train has no units.
fn columns(contacts: &[String], dimensionless: bool) -> Vec<String> {
    let with = |unit: &'static str| if dimensionless { "" } else { unit };
    let orbit = ["seeded", "orbit", "period_cycles", "transient_cycles", "orbit_distance", "measured_cycles"];
    let mut columns: Vec<String> = orbit.map(String::from).to_vec();
    columns.extend([format!("cycle{}", with("_s")), "events".to_owned(), "grazes".to_owned()]);
    for contact in contacts {
        columns.extend(MEASURES.map(|(name, unit, _)| format!("{contact} {name}{}", with(unit))));
    }
    columns
}

/// A row of the table.
fn cells(contacts: &[String], steady: &Steady) -> Vec<String> {
    let settled = &steady.settled;
    let mut cells = vec![
        steady.seeded.to_string(),
        settled.word().to_owned(),
        settled.period.map_or_else(String::new, |period| period.to_string()),
        settled.cycles.to_string(),
        number(settled.distance),
        steady.measured_cycles.to_string(),
        number(steady.period_s),
        steady.events.to_string(),
        steady.grazes.to_string(),
    ];
    for name in contacts {
        let contact = named(steady).find(|(other, _)| other == name).map(|(_, contact)| contact);
        cells.extend(MEASURES.map(|(_, _, measure)| contact.and_then(measure).map_or_else(String::new, number)));
    }
    cells
}
