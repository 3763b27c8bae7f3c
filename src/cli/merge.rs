//! `flank merge`.

use std::path::PathBuf;

use super::{
    Completion, basins, diagram, map,
    pictures::Pictures,
    sweep,
    work::{LongWork, Merge, PartDescription, parts},
};
use crate::{Error, Instructions, output::Fault, scene::Scene, sweep::Share};

/// Arguments of `flank merge`.
#[derive(Debug, clap::Args)]
pub struct MergeArguments {
    /// Folders of all parts
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Folder of the files of the undivided command; its name if left out
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Check that the parts are complete and belong together, and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Write into a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Print nothing
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    pictures: Pictures,
}

/// Merges the parts of divided work.
pub fn execute(arguments: &MergeArguments) -> Result<Completion, Error> {
    let PartDescription { command, part, name, scene, asked, instructions } = parts(&arguments.folders)?;
    let share: Share = part.parse().map_err(|found| {
        let fault = Fault::new("the parts", format!("{part}: {found}"), "parts that flank has written");
        Error::Arguments(vec![fault])
    })?;
    match Instructions::named(&instructions) {
        Some(set) => set.choose(),
        None => {
            let fault =
                Fault::new("the parts", format!("vector instructions {instructions:?}"), "those of this machine");
            return Err(Error::Arguments(vec![fault.remedy("merge on a machine like those of the parts")]));
        }
    }
    let scene = Scene::from_value(scene, &name)?;
    let out = arguments.out.clone().unwrap_or_else(|| PathBuf::from(&command));
    let work = LongWork::silent(arguments.quiet);
    let merge = Merge {
        folders: &arguments.folders,
        of: share.of,
        out: &out,
        force: arguments.force,
        only_check: arguments.dry_run,
        work: &work,
    };
    let pictures = &arguments.pictures;
    match command.as_str() {
        "sweep" => sweep::merge(asked, scene, pictures, &merge),
        "map" => map::merge(asked, scene, pictures, &merge),
        "basins" => basins::merge(asked, scene, pictures, &merge),
        "diagram" => diagram::merge(asked, scene, pictures, &merge),
        _ => Err(Error::Arguments(vec![Fault::new("the parts", command, "sweep, map, basins or diagram")])),
    }
}
