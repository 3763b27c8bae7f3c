//! `flank stability`.

use std::path::{Path, PathBuf};

use super::{
    Completion, axis, open, pictures::Pictures, print, progress::counted, report_line, request, threads, wrapped,
};
use crate::{
    Error, Simulation,
    accuracy::{
        Contender, SolverKind,
        stability::{LongRunRule, Map, MapPlan, Reference},
    },
    output::Fault,
    train::Quantity,
};

/// Arguments of `flank stability`.
#[derive(Debug, clap::Args)]
pub struct StabilityArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Fixed-step methods: rk4, newmark, hht[=ALPHA], generalized-alpha[=RHO], euler, verlet, each with +tanh=SIGMA,
    /// +sqrt=SIGMA, +poly=SIGMA for a smoothed flank
    #[arg(long, value_name = "M1,M2,…", value_delimiter = ',', num_args = 1.., default_value = "rk4,newmark")]
    methods: Vec<String>,
    /// Quantity of every contact that is multiplied
    #[arg(long, value_enum, default_value = "stiffness")]
    over: Abscissa,
    /// Factors: FROM:TO:COUNT, the same with :log for equal ratios, or V1,V2,…; 1 is always among them
    #[arg(long, value_name = "AXIS", default_value = "0.1:10:13:log")]
    factors: String,
    /// Steps a cycle: FROM:TO:COUNT, the same with :log for equal ratios, or V1,V2,…; made odd, so that no change of stiffness falls on a step by
    /// chance
    #[arg(long, value_name = "AXIS", default_value = "5:10000:15:log")]
    steps: String,
    /// Maximum number of cycles of a run
    #[arg(long, value_name = "N", default_value_t = LongRunRule::default().cycles, value_parser = clap::value_parser!(u64).range(10..=100_000))]
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
    #[command(flatten)]
    pictures: Pictures,
}

/// See [`Quantity`].
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Abscissa {
    /// Stiffness; the damping ratio stays
    Stiffness,
    /// Damping
    Damping,
    /// Backlash
    Backlash,
}

/// Steps in common use: a thousand per cycle, and these, s.
const USED: [(f64, &str); 2] = [(1e-5, "1e-5 s"), (1e-6, "1e-6 s")];
/// Methods of which a map can be made.
const FIXED: [&str; 6] = ["rk4", "newmark", "hht", "generalized-alpha", "euler", "verlet"];
/// Maximum number of cells of a map.
const MOST: usize = 100_000;

/// Makes the map.
pub fn execute(arguments: &StabilityArguments) -> Result<Completion, Error> {
    let form = arguments.pictures.print()?;
    let simulation = open(arguments.scene.as_deref())?;
    let plan = plan(arguments, &simulation, Map::cycle_length(&simulation)?)?;
    // Before the work: a folder in use is reported at once. It is opened after the work: an interrupted map leaves no files.
    let (out, scene) = (arguments.out.as_deref(), arguments.scene.as_deref());
    let request = request(out, "stability", scene, arguments.force, Map::files(plan.over))?;
    let cells = plan.factors.len() * plan.steps.len() + plan.references.len();
    let pool = threads(arguments.threads)?;
    let map = counted(cells * plan.methods.len(), 0, "runs", arguments.quiet, |task| {
        pool.install(|| Map::make(&simulation, &plan, task))
    })?;
    let Some(map) = map else {
        return print("interrupted: a map is written as a whole, so nothing is kept\n")
            .map(|()| Completion::Interrupted);
    };
    if let Some(request) = &request {
        map.write(&mut request.open()?, &simulation, &form)?;
    }
    if !arguments.quiet {
        print(&text(&simulation, &map, out))?;
    }
    let judged = map.rows.iter().any(|row| row.error.is_none());
    Ok(if judged { Completion::Completely } else { Completion::Partly })
}

/// Reads the plan from the arguments; an error lists every fault.
fn plan(arguments: &StabilityArguments, simulation: &Simulation, period: f64) -> Result<MapPlan, Error> {
    let mut faults = Vec::new();
    let over = match arguments.over {
        Abscissa::Stiffness => Quantity::Stiffness,
        Abscissa::Damping => Quantity::Damping,
        Abscissa::Backlash => Quantity::Backlash,
    };
    if !simulation.structure.spec().has(over) {
        let word = over.word();
        let found = format!("{word}, of which no contact of this scene has any");
        let allowed = format!("a quantity that its contacts have: vary another one, or give a contact some {word}");
        faults.push(Fault::new("--over", found, allowed));
    }
    let known = |word: &str| word.split(['+', '=']).next().is_some_and(|base| FIXED.contains(&base));
    let method =
        |found: String| Fault::new("--methods", found, format!("methods of fixed steps: {}", FIXED.join(", ")));
    let mut methods: Vec<Contender> = Vec::new();
    for word in &arguments.methods {
        match Contender::parse(word) {
            Ok(method) if matches!(method.kind, SolverKind::Fixed(_)) => methods.push(method),
            Ok(_) => faults.push(method(format!("{word}, which chooses its own steps"))),
            // Fault of a known method; the others are not available here.
            Err(error) if known(word) => faults.push(method(error.to_string())),
            Err(_) => faults.push(method(format!("{word:?}, which is none"))),
        }
    }
    let mut factors = values("factors", &arguments.factors, (1e-6, 1e6), &mut faults);
    let mut steps: Vec<u64> = Vec::new();
    let range = arguments.steps.contains(':');
    for value in values("steps", &arguments.steps, (4.0, 1e7), &mut faults) {
        if !range && value.fract() != 0.0 {
            faults.push(Fault::new("--steps", value.to_string(), "whole numbers of steps"));
        }
        // Exact: at most 10⁷.
        let whole = value.round() as u64;
        steps.push(if range { whole | 1 } else { whole });
    }
    steps.sort_unstable();
    steps.dedup();
    factors.push(1.0);
    factors.sort_by(f64::total_cmp);
    // 1 itself, not a neighbour by rounding.
    factors.retain(|factor| *factor == 1.0 || (factor - 1.0).abs() > 1e-9);
    factors.dedup();
    let cells = factors.len() * steps.len() * methods.len();
    if cells > MOST {
        faults.push(Fault::new("--factors and --steps", format!("{cells} runs"), format!("at most {MOST}")));
    }
    if !faults.is_empty() {
        return Err(Error::Arguments(faults));
    }
    let most = steps.last().copied().unwrap_or(0);
    let used = USED.iter().filter(|_| !simulation.dimensionless).map(|(step, name)| {
        // Exact: steps beyond the map are left out.
        Reference { name: (*name).to_owned(), steps_per_cycle: (period / step).ceil() as u64 }
    });
    let thousand = Reference { name: "1000 steps".to_owned(), steps_per_cycle: 1000 };
    let references =
        std::iter::once(thousand).chain(used).filter(|r| (4..=most).contains(&r.steps_per_cycle)).collect();
    let rule = LongRunRule { cycles: arguments.cycles, ..LongRunRule::default() };
    Ok(MapPlan { over, factors, steps, methods, references, rule })
}

/// Returns the values of an axis, all of them in a range.
fn values(name: &str, text: &str, (low, high): (f64, f64), faults: &mut Vec<Fault>) -> Vec<f64> {
    let Some(axis) = axis(name, text, faults) else { return Vec::new() };
    if axis.count() > MOST {
        let found = format!("{} values", axis.count());
        faults.push(Fault::new(&format!("--{name}"), found, format!("at most {MOST}")));
        return Vec::new();
    }
    // The ends of a range bound all its values.
    let ends = if text.contains(':') { vec![axis.value(0), axis.value(axis.count() - 1)] } else { axis.all() };
    let outside = ends.iter().filter(|value| !(low..=high).contains(*value));
    faults.extend(outside.map(|value| Fault::new(&format!("--{name}"), value.to_string(), format!("{low} to {high}"))));
    axis.all()
}

fn text(simulation: &Simulation, map: &Map, out: Option<&Path>) -> String {
    let unit = simulation.unit("s");
    let mut text = format!("{}: factors on the {} of every contact\n\n", simulation.name, map.over.word());
    text += &format!("{}\n{}\n{}\n", map.summary_table(unit), map.factor_table(), wrapped(&map.rules(unit), ""));
    text + &report_line(out)
}
