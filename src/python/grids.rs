//! Work over many points: sweeps, maps, basins. They write the files of the command, and return the table.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use numpy::IntoPyArray;
use pyo3::prelude::*;

use flank::{
    Error, Task,
    map::{Basins, CellRule, KindMap, basins_figure, figure, sweep_figure},
    output::Fault,
    plot::Print,
    study::{SteadySweep, steady::Rule},
    sweep::{Begin, Ending, Grid, Plan, Records, Seeding, Share},
};

use crate::{error::raised, scene::Scene, work::pooled};

/// Name of a column, its values, and the words that its values count, if it has words.
type Column<'py> = (String, Bound<'py, PyAny>, Option<Vec<String>>);

/// Settings of the storage and the threads.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct GridSettings {
    out: PathBuf,
    replace: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
}

/// Columns of the table, and the exception that interrupted the work; then there is no table.
type GridTable<'py> = (Vec<Column<'py>>, Option<PyErr>);

/// Does work in a folder, and reads the table that it writes there. `words` are the columns that have words even where they are empty.
fn tabled<'py>(
    py: Python<'py>,
    settings: GridSettings,
    (table, words): (&str, &[&str]),
    work: impl FnOnce(&Path, Begin, Task<'_>) -> Result<Ending, Error> + Send,
) -> PyResult<GridTable<'py>> {
    let GridSettings { out, replace, threads, progress } = settings;
    let begin = if replace { Begin::Replace } else { Begin::Resume };
    let done = pooled(py, threads, progress, |task| match work(&out, begin, task)? {
        Ending::Complete => read(&out.join(table), words).map(Some),
        _ => Ok(None),
    })?;
    let read = done.result.map_err(raised)?;
    match (read, done.cancelled) {
        (_, Some(cancelled)) => Ok((Vec::new(), Some(cancelled))),
        (None, None) => {
            Err(raised(Error::Unread(out.display().to_string(), std::io::Error::other("the work is not complete"))))
        }
        (Some(columns), None) => {
            let column = |(name, cells)| match cells {
                Cells::Numbers(values) => (name, values.into_pyarray(py).into_any(), None),
                Cells::Words { places, words, .. } => (name, places.into_pyarray(py).into_any(), Some(words)),
            };
            Ok((columns.into_iter().map(column).collect(), None))
        }
    }
}

/// Values of a column.
enum Cells {
    Numbers(Vec<f64>),
    /// Places in a list of words.
    Words {
        places: Vec<i32>,
        words: Vec<String>,
        known: HashMap<String, i32>,
    },
}

/// Reads a table. A column without words holds numbers; an empty cell of it is NaN.
fn read(path: &Path, words: &[&str]) -> Result<Vec<(String, Cells)>, Error> {
    let unread = |error: std::io::Error| Error::Unread(path.display().to_string(), error);
    let mut reader = csv::Reader::from_path(path).map_err(|error| unread(error.into()))?;
    let names: Vec<String> =
        reader.headers().map_err(|error| unread(error.into()))?.iter().map(str::to_owned).collect();
    let cells = |name: &String| match words.contains(&name.as_str()) {
        true => Cells::Words { places: Vec::new(), words: Vec::new(), known: HashMap::new() },
        false => Cells::Numbers(Vec::new()),
    };
    let mut all: Vec<Cells> = names.iter().map(cells).collect();
    let mut row = csv::StringRecord::new();
    while reader.read_record(&mut row).map_err(|error| unread(error.into()))? {
        for (cells, text) in all.iter_mut().zip(&row) {
            match cells {
                Cells::Numbers(values) => values.push(match text {
                    "true" => 1.0,
                    "false" => 0.0,
                    "" => f64::NAN,
                    text => {
                        text.parse().map_err(|_| unread(std::io::Error::other(format!("{text:?} is no number"))))?
                    }
                }),
                Cells::Words { places, words, known } => {
                    let place = known.get(text).copied().unwrap_or_else(|| {
                        // Exact: a table has fewer than 2³¹ rows.
                        let place = words.len() as i32;
                        words.push(text.to_owned());
                        known.insert(text.to_owned(), place);
                        place
                    });
                    places.push(place);
                }
            }
        }
    }
    Ok(names.into_iter().zip(all).collect())
}

/// Reports the rows that an earlier call has finished.
fn resumed(records: &Records, task: Task<'_>) {
    (0..records.count()).for_each(|_| task.advance());
}

/// Returns the name of a scene without folder and ending, as the command writes it into figures.
fn stem(name: &str) -> String {
    Path::new(name).file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// Settings of a sweep.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct SweepSettings {
    seed: String,
    columns: Vec<String>,
    tolerance: Option<f64>,
    max_cycles: Option<u64>,
    measure_cycles: Option<u64>,
}

/// Sweeps a scene over `axes`, in the form of the command.
#[pyfunction]
pub fn sweep<'py>(
    py: Python<'py>,
    scene: &Scene,
    axes: Vec<String>,
    settings: SweepSettings,
    grid: GridSettings,
) -> PyResult<GridTable<'py>> {
    let SweepSettings { seed, columns, tolerance, max_cycles, measure_cycles } = settings;
    let seeding: Seeding = serde_json::from_value(seed.as_str().into()).map_err(|_| {
        let allowed = "fresh, up, down or both";
        raised(Error::Arguments(vec![Fault::new("seed", format!("{seed:?}"), allowed)]))
    })?;
    let mut rule = Rule::default();
    rule.approach.tolerance = tolerance.unwrap_or(rule.approach.tolerance);
    rule.approach.most_cycles = max_cycles.unwrap_or(rule.approach.most_cycles);
    if let Some(cycles) = measure_cycles {
        (rule.measured_cycles, rule.irregular_cycles) = (cycles, cycles);
    }
    let plan = Plan::new(Grid::parse(&axes).map_err(raised)?, seeding);
    let sweep = SteadySweep::new(scene.scene().clone(), plan, rule).map_err(raised)?;
    let sweep = sweep.with_columns(&columns).map_err(|faults| raised(Error::Arguments(faults)))?;
    let name = stem(scene.scene().name());
    let words = ["direction", "kind", "word", "reason", "error"];
    tabled(py, grid, ("sweep.csv", &words), |folder, begin, task| {
        let Some(mut journal) = sweep.open(folder, begin, Share::ALL)? else { return Ok(Ending::Complete) };
        resumed(journal.records(), task);
        let ending = sweep.run(&mut journal, task)?;
        if ending == Ending::Complete {
            sweep.finish(journal, |rows, folder| {
                match sweep_figure(&name, sweep.plan(), rows, sweep.dimensionless()) {
                    Some(figure) => figure.draw_into(folder, &Print::default()),
                    None => Ok(()),
                }
            })?;
        }
        Ok(ending)
    })
}

fn rule((transient, further): (u64, u64)) -> CellRule {
    CellRule { transient_cycles: transient, further_cycles: further, ..CellRule::default() }
}

/// Maps the kinds of motion over two `axes`.
#[pyfunction]
pub fn kinds<'py>(
    py: Python<'py>,
    scene: &Scene,
    axes: Vec<String>,
    columns: Vec<String>,
    cycles: (u64, u64),
    grid: GridSettings,
) -> PyResult<GridTable<'py>> {
    let map = KindMap::new(scene.scene().clone(), &axes, rule(cycles), &columns).map_err(raised)?;
    let name = stem(scene.scene().name());
    tabled(py, grid, ("map.csv", &["kind", "word", "impacts", "error"]), |folder, begin, task| {
        let Some(mut rows) = map.open(folder, begin, Share::ALL)? else { return Ok(Ending::Complete) };
        resumed(&rows, task);
        let ending = map.run(&mut rows, task)?;
        if ending == Ending::Complete {
            let (grid, dimensionless) = (map.plane().grid(), map.plane().own().dimensionless);
            map.finish(rows, |tally, folder| {
                figure(&name, grid, tally, &map.shown(), dimensionless).draw_into(folder, &Print::default())
            })?;
        }
        Ok(ending)
    })
}

/// Finds the basins of a plane of starts. The folder has its attractors in `attractors.json`.
#[pyfunction]
pub fn basins<'py>(
    py: Python<'py>,
    scene: &Scene,
    axes: Vec<String>,
    cycles: (u64, u64),
    grid: GridSettings,
) -> PyResult<GridTable<'py>> {
    let basins = Basins::new(scene.scene().clone(), &axes, rule(cycles)).map_err(raised)?;
    let name = stem(scene.scene().name());
    tabled(py, grid, ("basins.csv", &["attractor", "error"]), |folder, begin, task| {
        let Some(mut rows) = basins.open(folder, begin, Share::ALL)? else { return Ok(Ending::Complete) };
        let Some(survey) = basins.survey(task).map_err(Error::from)? else { return Ok(Ending::Interrupted) };
        resumed(&rows, task);
        let ending = basins.run(&mut rows, &survey, task)?;
        if ending == Ending::Complete {
            let dimensionless = basins.simulation().dimensionless;
            basins.finish(rows, &survey, |found, folder| {
                basins_figure(&name, basins.grid(), found, dimensionless).draw_into(folder, &Print::default())
            })?;
        }
        Ok(ending)
    })
}
