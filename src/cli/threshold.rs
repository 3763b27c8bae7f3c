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
    study::rattle::{LoadThreshold, Loss, Rattle},
    sweep::GridError,
};

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
    let vary = arguments.vary.as_deref().map(axis).transpose().map_err(GridError)?;
    let bar = running(arguments.quiet);
    let progress = |_| bar.tick();
    let working = catch_interrupt();
    let task = cancellable(&progress);
    let found = LoadThreshold::find(&scene, vary, arguments.by, task);
    drop(working);
    bar.finish_and_clear();
    let LoadThreshold { pointer, range, threshold, shared, .. } = &match found {
        Err(_) if task.is_cancelled() => return Ok(Completion::Interrupted),
        Ok(found) if arguments.json => {
            print(&format!("{:#}\n", json!(found)))?;
            return Ok(Completion::Completely);
        }
        found => found?,
    };
    print(&text(pointer, *range, arguments.by, threshold))?;
    if *shared {
        print(
            "before it the start of the scene leads to another motion, which has the event: sweep both ways to see both\n",
        )?;
    }
    Ok(Completion::Completely)
}

/// Reads `POINTER=FROM:TO`.
fn axis(text: &str) -> Result<(String, [f64; 2]), Vec<Fault>> {
    let read = || {
        let (pointer, ends) = text.split_once('=')?;
        let (from, to) = ends.split_once(':')?;
        let [from, to] = [from, to].map(|end| end.parse::<f64>().ok().filter(|end| end.is_finite()));
        Some((pointer.to_owned(), [from?, to?]))
    };
    read().ok_or_else(|| vec![Fault::new(text, "no range", "POINTER=FROM:TO, such as /train/torque_nm=1:200")])
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
