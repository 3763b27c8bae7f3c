//! `flank stability`.

use std::path::{Path, PathBuf};

use flank::{
    accuracy::{
        Contender, Kind,
        stability::{self, Map, Outcome, Plan, Reference, Rule, Start, Subject},
    },
    output::Request,
    plot::{self, Item, Report, Section},
    scene::Scene,
    study::Case,
    sweep::{Axis, Fault, Values, number},
    train::Quantity,
};
use serde_json::json;

use super::{
    CliError, Done,
    advise::wrapped,
    print,
    progress::{catch_interrupt, counting, interrupt},
    session,
    study::{REPORT, forms, write},
    table::{self, Table},
};

/// Arguments of `flank stability`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Fixed-step methods: rk4, newmark, hht[=ALPHA], generalized-alpha[=RHO], euler, verlet, each with +tanh=SIGMA,
    /// +sqrt=SIGMA, +poly=SIGMA for a smoothed flank
    #[arg(long, value_name = "M1,M2,…", value_delimiter = ',', num_args = 1.., default_value = "rk4,newmark")]
    methods: Vec<String>,
    /// What of every contact is multiplied
    #[arg(long, value_enum, default_value = "stiffness")]
    over: Over,
    /// Factors: FROM:TO:COUNT[:log] or V1,V2,…; 1 is always among them
    #[arg(long, value_name = "AXIS", default_value = "0.1:10:13:log")]
    factors: String,
    /// Steps a cycle: FROM:TO:COUNT[:log], made odd, so that no change of stiffness falls on a step by chance; or V1,V2,…
    #[arg(long, value_name = "AXIS", default_value = "5:10000:15:log")]
    steps: String,
    /// Cycles of a run, at most
    #[arg(long, value_name = "N", default_value_t = Rule::default().cycles, value_parser = clap::value_parser!(u64).range(10..=100_000))]
    cycles: u64,
    /// Folder of report.html, stability.json, stability.csv and the figure
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a folder that is not empty
    #[arg(long, requires = "out")]
    force: bool,
    /// Threads; as many as there are cores if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
}

/// See [`Quantity`].
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Over {
    /// Stiffness; the damping ratio stays
    Stiffness,
    /// Damping
    Damping,
    /// Backlash
    Backlash,
}

const TABLE: &str = "stability.csv";
const MAP: &str = "stability.json";

/// Steps that people use: a thousand a cycle, and these, s.
const USED: [(f64, &str); 2] = [(1e-5, "1e-5 s"), (1e-6, "1e-6 s")];
/// Methods that a map can be made of.
const FIXED: [&str; 6] = ["rk4", "newmark", "hht", "generalized-alpha", "euler", "verlet"];
/// Most cells of a map.
const MOST: usize = 100_000;

/// Makes the map.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let scene = session::read(arguments.scene.as_deref())?;
    let case = Case::new(&scene)?;
    let subject = subject(&scene, &case)?;
    let plan = plan(arguments, &subject, case.built.dimensionless)?;
    // Before the work: a folder in use is told at once. It is opened after it: a map broken off leaves nothing behind.
    let figure = forms(&format!("stability-{}", plan.over.word()));
    let files = figure.into_iter().chain([TABLE, MAP, REPORT].map(String::from)).collect();
    let (input, force) = (arguments.scene.as_deref(), arguments.force);
    let request = arguments.out.as_deref().map(|folder| Request { folder, command: "stability", input, force, files });
    request.as_ref().map(Request::check).transpose()?;

    catch_interrupt();
    let bar = counting("runs", arguments.quiet);
    let cells = plan.factors.len() * plan.steps.len() + plan.references.len();
    bar.set_length((cells * plan.methods.len()) as u64);
    let pool = session::threads(arguments.threads)?;
    let map = pool.install(|| stability::map(&subject, &plan, interrupt(), &|| bar.inc(1)));
    bar.finish_and_clear();
    let Some(map) = map else {
        return print("interrupted: a map is written as a whole, so nothing is kept\n").map(|()| Done::Partly);
    };

    let name = scene.resolved()["name"].as_str().filter(|name| !name.is_empty()).unwrap_or(scene.name());
    let figure = stability::figure(name, &map);
    let unit = if case.built.dimensionless { "" } else { "s" };
    if let Some(request) = &request {
        let mut folder = request.open()?;
        folder.bytes(TABLE, csv(&map).as_bytes())?;
        write(&mut folder, &figure)?;
        folder.bytes(REPORT, report(&scene, &map, unit, figure).html().as_bytes())?;
        let scene = json!({ "name": scene.name(), "sha256": scene.hash() });
        folder.complete(MAP, &json!({ "flank": env!("CARGO_PKG_VERSION"), "scene": scene, "map": map }))?;
    }
    if !arguments.quiet {
        print(&text(&scene, &map, unit, arguments.out.as_deref()))?;
    }
    let judged = map.rows.iter().any(|row| row.error.is_none());
    Ok(if judged { Done::Completely } else { Done::Partly })
}

fn subject(scene: &Scene, case: &Case) -> Result<Subject, CliError> {
    let built = &case.built;
    let period = built.run.period.ok_or_else(|| {
        case.missing("it has no cycles to compare; give it a forcing with a period, or a period of its run")
    })?;
    let start = match scene.resolved()["initial"].as_str() {
        Some("static") => Start::Equilibrium,
        _ => Start::At(built.q0.clone(), built.v0.clone()),
    };
    Ok(Subject {
        spec: built.spec.clone(),
        start,
        at: built.run.instants(case.clock())[0],
        period,
        choice: built.run.method,
        tolerance: built.run.tolerance,
    })
}

/// What the arguments ask for; every fault at once.
fn plan(arguments: &Arguments, subject: &Subject, dimensionless: bool) -> Result<Plan, CliError> {
    let mut faults = Vec::new();
    let over = match arguments.over {
        Over::Stiffness => Quantity::Stiffness,
        Over::Damping => Quantity::Damping,
        Over::Backlash => Quantity::Backlash,
    };
    if !subject.spec.has(over) {
        let word = over.word();
        faults.push(fault(
            "--over",
            format!("{word}, of which no contact of this scene has any"),
            format!("a quantity that its contacts have: vary another one, or give a contact some {word}"),
        ));
    }
    let known = |word: &str| word.split(['+', '=']).next().is_some_and(|base| FIXED.contains(&base));
    let method = |found: String| fault("--methods", found, format!("methods of fixed steps: {}", FIXED.join(", ")));
    let mut methods: Vec<Contender> = Vec::new();
    for word in &arguments.methods {
        match Contender::parse(word) {
            Ok(method) if matches!(method.kind, Kind::Fixed(_)) => methods.push(method),
            Ok(_) => faults.push(method(format!("{word}, which chooses its own steps"))),
            // What is wrong with a known one; the others are not to be had here.
            Err(error) if known(word) => faults.push(method(error.to_string())),
            Err(_) => faults.push(method(format!("{word:?}, which is none"))),
        }
    }
    let mut factors = values("factors", &arguments.factors, (1e-6, 1e6), &mut faults);
    let mut steps: Vec<u64> = Vec::new();
    let range = arguments.steps.contains(':');
    for value in values("steps", &arguments.steps, (4.0, 1e7), &mut faults) {
        if !range && value.fract() != 0.0 {
            faults.push(fault("--steps", value.to_string(), "whole numbers of steps"));
        }
        // OK to convert: at most 10⁷.
        let whole = value.round() as u64;
        steps.push(if range { whole | 1 } else { whole });
    }
    steps.sort_unstable();
    steps.dedup();
    factors.push(1.0);
    factors.sort_by(f64::total_cmp);
    // 1 itself, not its neighbour by rounding.
    factors.retain(|factor| *factor == 1.0 || (factor - 1.0).abs() > 1e-9);
    factors.dedup();
    let cells = factors.len() * steps.len() * methods.len();
    if cells > MOST {
        faults.push(fault("--factors and --steps", format!("{cells} runs"), format!("at most {MOST}")));
    }
    if !faults.is_empty() {
        return Err(CliError::Arguments(faults));
    }
    let most = steps.last().copied().unwrap_or(0);
    let used = USED.iter().filter(|_| !dimensionless).map(|(step, name)| {
        // OK to convert: anything larger than the map is left out.
        Reference { name: (*name).to_owned(), steps_per_cycle: (subject.period / step).ceil() as u64 }
    });
    let thousand = Reference { name: "1000 steps".to_owned(), steps_per_cycle: 1000 };
    let references =
        std::iter::once(thousand).chain(used).filter(|r| (4..=most).contains(&r.steps_per_cycle)).collect();
    let rule = Rule { cycles: arguments.cycles, ..Rule::default() };
    Ok(Plan { over, factors, steps, methods, references, rule })
}

fn fault(argument: &str, found: impl Into<String>, allowed: impl Into<String>) -> Fault {
    Fault { argument: argument.to_owned(), found: found.into(), allowed: allowed.into() }
}

/// The values of an axis, all of them in a range.
fn values(name: &str, text: &str, (low, high): (f64, f64), faults: &mut Vec<Fault>) -> Vec<f64> {
    // An axis has a pointer in a sweep; here it has the name of its argument.
    let axis = match Axis::parse(&format!("/{name}={text}")) {
        Ok(axis) => axis,
        Err(found) => {
            faults.extend(found);
            return Vec::new();
        }
    };
    let ends: Vec<f64> = match &axis.values {
        Values::Range { from, to, count, .. } if *count <= MOST => vec![*from, *to],
        Values::List { values } if values.len() <= MOST => values.clone(),
        _ => {
            let found = format!("{} values", axis.count());
            faults.push(fault(&format!("--{name}"), found, format!("at most {MOST}")));
            return Vec::new();
        }
    };
    let outside = ends.iter().filter(|value| !(low..=high).contains(*value));
    faults.extend(outside.map(|value| fault(&format!("--{name}"), value.to_string(), format!("{low} to {high}"))));
    (0..axis.count()).map(|i| axis.value(i)).collect()
}

/// One line for each method: what it needs where the factor is 1, and over all factors.
fn summary(map: &Map, unit: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let step = if unit.is_empty() { "its step".to_owned() } else { format!("its step, {unit}") };
    let mut head = ["method", "sequence from", "motion from", &step, "limit", "all factors"].map(String::from).to_vec();
    head.extend(map.references.iter().map(|reference| reference.name.clone()));
    let one = map.rows.iter().find(|row| row.factor == 1.0);
    let rows = map.methods.iter().enumerate().map(|(i, method)| {
        let fewest = |holds: fn(Outcome) -> bool| one.and_then(|row| map.fewest(i, row, holds));
        let limit = one.and_then(|row| row.limit_steps_per_cycle.get(i).copied().flatten());
        let right = fewest(|outcome| outcome == Outcome::Right);
        let mut cells = vec![
            method.clone(),
            steps(fewest(Outcome::has_right_sequence)),
            steps(right),
            table::number(right.map(|n| map.period_s / n as f64)),
            match (limit, map.limits[i]) {
                (Some(limit), _) => format!("{limit:.1}"),
                (None, Some(_)) => "unknown".to_owned(),
                (None, None) => "any step".to_owned(),
            },
            over_all(map, i),
        ];
        for (k, _) in map.references.iter().enumerate() {
            let cell = one.and_then(|row| row.references.get(i)?.get(k));
            cells.push(cell.map_or_else(|| "-".to_owned(), |cell| word_of(cell.outcome)));
        }
        cells
    });
    let rows = rows.collect();
    (head, rows)
}

/// A number of steps, or `none`.
fn steps(n: Option<u64>) -> String {
    n.map_or_else(|| "none".to_owned(), |n| n.to_string())
}

/// Fewest steps with the right sequence over all factors that could be judged.
fn over_all(map: &Map, method: usize) -> String {
    let judged = map.rows.iter().filter(|row| row.error.is_none());
    let all: Vec<Option<u64>> = judged.map(|row| map.fewest(method, row, Outcome::has_right_sequence)).collect();
    let found = || all.iter().flatten();
    let none = all.iter().filter(|n| n.is_none()).count();
    let range = match (found().min(), found().max()) {
        (Some(least), Some(most)) if least == most => least.to_string(),
        (Some(least), Some(most)) => format!("{least} to {most}"),
        _ => return "none".to_owned(),
    };
    if none == 0 { range } else { format!("{range}, none at {none} of {}", all.len()) }
}

/// One line for each factor.
fn listing(map: &Map) -> (Vec<String>, Vec<Vec<String>>) {
    let mut head = ["factor", "cycles", "events", "motion", "Flank's steps"].map(String::from).to_vec();
    head.extend(map.methods.iter().cloned());
    let rows = map.rows.iter().map(|row| {
        let factor = table::number(row.factor);
        let (Some(own), Some(window)) = (&row.own, &row.window) else {
            return vec![factor, row.error.clone().unwrap_or_default()];
        };
        let mut cells = vec![
            factor,
            window.cycles.to_string(),
            row.events.to_string(),
            own.to_string(),
            format!("{:.1}", own.steps_per_cycle),
        ];
        for i in 0..map.methods.len() {
            let limit = row.limit_steps_per_cycle[i].map_or_else(|| "-".to_owned(), |n| format!("{n:.1}"));
            let sequence = steps(map.fewest(i, row, Outcome::has_right_sequence));
            let motion = steps(map.fewest(i, row, |outcome| outcome == Outcome::Right));
            cells.push(format!("{limit} / {sequence} / {motion}"));
        }
        cells
    });
    let rows = rows.collect();
    (head, rows)
}

fn rules(map: &Map, unit: &str) -> String {
    let length = format!("{} {unit}", table::number(map.period_s));
    format!(
        "A cycle is {}{}. Steps are steps a cycle; \"from\": the fewest on the map from which on every finer step is right too. By \
         factor, of each method: its limit / right sequence from / right motion from.",
        length.trim_end(),
        if unit.is_empty() { " long, without unit" } else { "" }
    )
}

fn text(scene: &Scene, map: &Map, unit: &str, out: Option<&Path>) -> String {
    let told = |(head, rows): (Vec<String>, Vec<Vec<String>>)| Table::new(head).with(rows).to_string();
    let mut text = format!("{}: factors on the {} of every contact\n\n", scene.name(), map.over.word());
    text += &told(summary(map, unit));
    text += "\n";
    text += &told(listing(map));
    text += &format!("\n{}", wrapped(&rules(map, unit)));
    text + &out.map_or_else(String::new, |out| format!("report: {}\n", out.join("report.html").display()))
}

fn report(scene: &Scene, map: &Map, unit: &str, figure: plot::Figure) -> Report {
    let table = |title: &str, (head, rows): (Vec<String>, Vec<Vec<String>>)| {
        let rows = rows.into_iter().map(|row| row.into_iter().map(plot::Cell::from).collect()).collect();
        Item::Table(plot::Table { title: title.to_owned(), head, rows, note: String::new() })
    };
    let rule = &map.rule;
    Report {
        title: figure.title.clone(),
        summary: vec![rules(map, unit)],
        sections: vec![
            Section {
                title: "Map".to_owned(),
                text: String::new(),
                items: vec![Item::Figure(figure), table("With the factor 1", summary(map, unit))],
            },
            Section {
                title: "Every factor".to_owned(),
                text: String::new(),
                items: vec![table("Steps a cycle that are needed", listing(map))],
            },
        ],
        provenance: vec![
            format!("flank {}", env!("CARGO_PKG_VERSION")),
            format!("scene {}; SHA-256 of the scene {}", scene.name(), scene.hash()),
            format!(
                "Sequences over at most {} cycles with growth of errors below {:e}; motions over at most {} cycles, settled within \
                 {:e}, one orbit within {}, statistics within {}.",
                rule.window, rule.growth, rule.cycles, rule.settled, rule.apart, rule.statistics
            ),
        ],
        files: Some("figures".to_owned()),
    }
}

/// One row a cell; those of the engine have the method `flank`.
fn csv(map: &Map) -> String {
    let mut text =
        "factor,method,steps_per_cycle,step,outcome,missed,spurious,period_cycles,distance,cycles\r\n".to_owned();
    for row in &map.rows {
        let factor = number(row.factor);
        if let Some(own) = &row.own {
            let word = own.period.map(|period| period.to_string()).unwrap_or_default();
            let (steps, step) = (number(own.steps_per_cycle), number(map.period_s / own.steps_per_cycle));
            text +=
                &format!("{factor},flank,{steps},{step},{},0,0,{word},,{}\r\n", word_of(row.own_outcome()), own.cycles);
        }
        for (method, cells) in map.methods.iter().zip(&row.cells) {
            for cell in cells {
                let step = number(map.period_s / cell.steps_per_cycle as f64);
                let period = cell.period.map(|period| period.to_string()).unwrap_or_default();
                let distance = cell.distance.map(number).unwrap_or_default();
                text += &format!(
                    "{factor},{method},{},{step},{},{},{},{period},{distance},{}\r\n",
                    cell.steps_per_cycle,
                    word_of(cell.outcome),
                    cell.missed,
                    cell.spurious,
                    cell.cycles
                );
            }
        }
    }
    text
}

/// The word of an outcome in data files.
fn word_of(outcome: Outcome) -> String {
    json!(outcome).as_str().unwrap_or_default().to_owned()
}
