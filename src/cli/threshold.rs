//! `flank threshold`.

use std::path::PathBuf;

use serde_json::json;

use super::{
    Completion, print,
    progress::{cancellable, catch_interrupt, running},
    read_scene,
};
use crate::{
    Error,
    output::Fault,
    scene::Scene,
    study::{
        rattle::{Loss, Rattle, RattleSearch, load_of},
        steady::Rule,
    },
    sweep::GridError,
};

/// Largest load tried without a range, in loads of the scene.
const MOST: f64 = 512.0;

/// Arguments of `flank threshold`.
#[derive(Debug, clap::Args)]
pub struct ThresholdArguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// Number to vary, by JSON pointer, to its end with contact kept, where the search begins; from a thousandth of the load of the scene
    /// to eight times it, or more, if left out
    #[arg(long, value_name = "POINTER=FROM:TO")]
    vary: Option<String>,
    /// Event that counts as loss of contact
    #[arg(long, value_enum, default_value = "deflection")]
    by: Loss,
    /// Print the same as JSON
    #[arg(long)]
    json: bool,
    /// Print nothing but the result
    #[arg(long, short)]
    quiet: bool,
}

/// Finds a threshold.
pub fn execute(arguments: &ThresholdArguments) -> Result<Completion, Error> {
    let scene = read_scene(arguments.scene.as_deref())?;
    let (pointer, range) = range(arguments, &scene).map_err(GridError)?;
    if scene.built().spec.contacts.iter().any(|contact| contact.law.is_rigid()) {
        let fault = Fault::new(
            "/train",
            "a rigid contact, which rests on its flank without a margin",
            "compliant contact laws",
        );
        return Err(Error::Arguments(vec![fault.remedy("give the contact a stiffness, or use flank sweep")]));
    }
    let search = RattleSearch { scene: &scene, pointer: &pointer, range, loss: arguments.by, rule: Rule::default() };
    let bar = running(arguments.quiet);
    let progress = |_| bar.tick();
    let working = catch_interrupt();
    let task = cancellable(&progress);
    let mut search = search;
    let mut found = search.run(task);
    // Without a range the load grows until the teeth keep contact.
    while let (None, Ok(Rattle::Always { value }), true) =
        (&arguments.vary, &found, search.range[1] / search.range[0] < 1e3 * MOST)
    {
        search.range[1] = 8.0 * value;
        found = search.run(task);
    }
    let range = search.range;
    let shared = found.as_ref().map_or(Ok(false), |found| search.is_shared(found, task));
    drop(working);
    bar.finish_and_clear();
    let found = match found {
        Err(_) if task.is_cancelled() => return Ok(Completion::Interrupted),
        found => found?,
    };
    let shared = shared?;
    let result =
        json!({ "pointer": pointer, "range": range, "by": arguments.by, "threshold": found, "shared": shared });
    print(&if arguments.json { format!("{result:#}\n") } else { text(&pointer, range, arguments.by, &found) })?;
    if shared && !arguments.json {
        print(
            "before it the start of the scene leads to another motion, which has the event: sweep both ways to see both\n",
        )?;
    }
    Ok(Completion::Completely)
}

/// Returns the number and its range: the end without loss of contact last.
fn range(arguments: &ThresholdArguments, scene: &Scene) -> Result<(String, [f64; 2]), Vec<Fault>> {
    let Some(text) = &arguments.vary else {
        return load_of(scene).map(|(pointer, load)| (pointer, [1e-3 * load, 8.0 * load])).ok_or_else(|| {
            let found = "no load that is a number in this train";
            vec![Fault::new("--vary", found, "POINTER=FROM:TO").remedy("name the number to vary, and its range")]
        });
    };
    let read = || {
        let (pointer, ends) = text.split_once('=')?;
        let (from, to) = ends.split_once(':')?;
        let [from, to] = [from, to].map(|end| end.parse::<f64>().ok().filter(|end| end.is_finite()));
        Some((pointer.to_owned(), [from?, to?]))
    };
    let is_number = |pointer: &str| scene.resolved().pointer(pointer).is_some_and(serde_json::Value::is_number);
    let fault = |found: &str, allowed: &str| vec![Fault::new(text, found, allowed)];
    let (pointer, range) =
        read().ok_or_else(|| fault("no range", "POINTER=FROM:TO, such as /train/torque_nm=1:200"))?;
    if !is_number(&pointer) {
        return Err(fault("a pointer to no number", "a pointer to a number of the resolved scene"));
    }
    if range[0] == range[1] { Err(fault("a range without length", "two different ends")) } else { Ok((pointer, range)) }
}

fn text(pointer: &str, [low, high]: [f64; 2], by: Loss, found: &Rattle) -> String {
    let event = match by {
        Loss::Deflection => "leaves its drive flank",
        Loss::Force => "carries no force for a time",
        Loss::BackFlank => "strikes its back flank",
    };
    match found {
        Rattle::Never => format!("no mesh {event} from {high} to {low} ({pointer})\n"),
        Rattle::Always { value } => {
            format!(
                "a mesh {event} at {value} already ({pointer}): begin the range with a larger load. Where the stiffness varies, its \
                 variation alone can lift the teeth at a speed, whatever the load\n"
            )
        }
        Rattle::Graze { value, uncertainty, contact } => {
            let side = if low < high { "below" } else { "above" };
            format!("{contact} {event} {side} {value} ({pointer}), to {uncertainty:.1e}: a graze\n")
        }
        Rattle::Bracket { with, without, margin, contact, motion } => format!(
            "a mesh {event} at {with} and not at {without} ({pointer}); there the motion is {motion}, and {contact} has a margin of \
             {margin:.3e}: it jumps, no graze\n"
        ),
    }
}
