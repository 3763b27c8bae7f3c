//! `flank basins`.

use std::{fmt::Write, path::PathBuf};

use flank::{
    map::{Basins, BasinsError, Found, Measured, basins_figure},
    output::Table,
    sweep::{Begin, Ending},
};

use super::{
    CliError, Done,
    map::{RuleArguments, Work, stem},
    pictures::Pictures,
    progress::counted,
    read_scene, threads,
};

/// Attractors in the table that is printed.
const MOST: usize = 20;

/// Arguments of `flank basins`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scene file; the reference scene if left out
    scene: Option<PathBuf>,
    /// A coordinate or velocity of the start: /initial/q/I=FROM:TO:COUNT or /initial/v/I=FROM:TO:COUNT, I a number or the name of a
    /// freedom; twice, the last one runs fastest
    #[arg(long, value_name = "AXIS", required = true)]
    vary: Vec<String>,
    #[command(flatten)]
    rule: RuleArguments,
    #[command(flatten)]
    work: Work,
    /// Folder of basins.csv, attractors.json, basins.json and the figure
    #[arg(long, value_name = "DIR", default_value = "basins")]
    out: PathBuf,
    #[command(flatten)]
    pictures: Pictures,
}

/// What was found, for the terminal.
fn text(found: &Found) -> String {
    let Found { attractors, figures, .. } = found;
    let rows = attractors.iter().take(MOST).enumerate().map(|(i, attractor)| {
        let share = &figures.fractions[i];
        vec![
            i.to_string(),
            attractor.kind.word().to_owned(),
            attractor.period_cycles.map_or_else(String::new, |period| period.to_string()),
            attractor.word.clone().unwrap_or_default(),
            format!("{:.5} ± {:.5}", share.fraction, share.standard_error),
        ]
    });
    let mut out = Table::new(["attractor", "kind", "period", "word", "share of starts"]).with(rows).to_string();
    if attractors.len() > MOST {
        let _ = writeln!(out, "{} more attractors: attractors.json", attractors.len() - MOST);
    }
    let number = |measured: &Option<Measured>| {
        measured.map_or_else(|| "too few points".to_owned(), |m| format!("{:.4} ± {:.4}", m.value, m.standard_error))
    };
    for share in &figures.fractions[attractors.len()..] {
        let _ = writeln!(out, "{}: {:.4} %", share.attractor, 100.0 * share.fraction);
    }
    let _ = writeln!(out, "uncertainty exponent: {}", number(&figures.uncertainty_exponent));
    let _ = writeln!(out, "dimension of the boundary: {}", number(&figures.boundary_dimension));
    let _ = writeln!(out, "basin entropy: {}", number(&figures.basin_entropy));
    let _ = writeln!(out, "boundary entropy: {}", number(&figures.boundary_entropy));
    out
}

impl From<BasinsError> for CliError {
    fn from(error: BasinsError) -> Self {
        match error {
            BasinsError::Simulation(error) => error.into(),
            BasinsError::Sweep(error) => error.into(),
            error => Self::file("basins", std::io::Error::other(error)),
        }
    }
}

/// Finds where each start ends.
pub fn execute(arguments: &Arguments) -> Result<Done, CliError> {
    let Arguments { work, out, .. } = arguments;
    let form = arguments.pictures.print()?;
    let scene = read_scene(arguments.scene.as_deref())?;
    let name = stem(scene.name());
    let basins = Basins::new(scene, &arguments.vary, arguments.rule.rule())?;
    let begin = work.begin();
    if begin != Begin::New {
        Basins::FILES.request(begin, out, arguments.scene.as_deref()).check()?;
    }
    let starts = basins.starts();
    let Some(mut lines) = basins.open(out, begin)? else {
        work.say(&format!("{} holds the basins\n", out.display()))?;
        return Ok(Done::Completely);
    };
    let pool = threads(work.threads)?;
    let (ending, attractors) =
        counted(starts, lines.count(), "starts", work.quiet, |task| pool.install(|| basins.run(&mut lines, task)))?;
    if ending == Ending::Interrupted {
        return work.interrupted(&format!("{} of {starts} starts", lines.count()), out);
    }
    let found = basins.finish(lines, attractors, |found, folder| {
        basins_figure(&name, basins.grid(), found, basins.simulation().dimensionless).draw_into(folder, &form)
    })?;
    work.say(&format!("{}{} starts: {}\n", text(&found), found.figures.starts, out.join("basins.csv").display()))?;
    let failed = found.figures.fractions.last().is_some_and(|failed| failed.fraction >= 1.0);
    Ok(if failed { Done::Partly } else { Done::Completely })
}
