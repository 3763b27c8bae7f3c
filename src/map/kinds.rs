//! Kind of the motion in every cell of a plane.

use std::path::{Path, PathBuf};

use serde_json::{Map as Header, Value, json};

use super::{
    cell::{Cell, CellRule},
    plane::{Plane, PlaneError},
    tally::Tally,
};
use crate::{
    ensemble::in_order,
    output::{Folder, OutputError, csv_line, in_a_line, number},
    scene::Scene,
    study::{Measures, StudyError, measured},
    sweep::{Begin, CommandFiles, Ending, GridError, Records, Rows, Share, SweepError},
    task::Task,
};

/// Measure of every map, unless others are given.
const APART: &str = "apart_fraction";
/// Columns before those of contacts: two numbers and these.
pub(super) const FIRST: [&str; 4] = ["kind", "period_cycles", "word", "exponent"];
/// Columns after them.
pub(super) const LAST: [&str; 3] = ["impacts", "cycles", "error"];

/// Values of the columns of measures.
type Values = Vec<Option<f64>>;

/// Map over two numbers of a scene: in each cell the motion from the scene's start.
///
/// ```no_run
/// use flank::{Task, map::{CellRule, KindMap}, scene::Scene, sweep::{Begin, Share}};
///
/// let scene = Scene::from_file("examples/scenes/kahraman-singh.json")?;
/// let axes = ["/train/transmission_error/0/frequency=0.4:2:50", "/train/mean_load=0.02:0.3:50"];
/// let map = KindMap::new(scene, &axes, CellRule::default(), &["apart_fraction"])?;
/// let mut lines = map.open("map".as_ref(), Begin::New, Share::ALL)?.expect("a new map is open");
/// map.run(&mut lines, Task::default())?;
/// let tally = map.finish(lines, |_, _| Ok(()))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct KindMap {
    plane: Plane,
    rule: CellRule,
    columns: Vec<String>,
    measures: Measures,
}

impl KindMap {
    /// Files of `flank map`.
    pub const FILES: CommandFiles = CommandFiles { command: "map", files: &["map.rows", "map.json", "map.csv"] };

    /// Returns a map over `axes` of `scene` with further `columns` of contacts, by their names in `sweep.csv` without unit; the share of
    /// time separated if none are given.
    ///
    /// # Errors
    /// [`PlaneError`] as [`Plane::new`], and for an unknown column.
    pub fn new(
        scene: Scene,
        axes: &[impl AsRef<str>],
        rule: CellRule,
        columns: &[impl AsRef<str>],
    ) -> Result<Self, PlaneError> {
        let columns: Vec<String> = columns.iter().map(|name| name.as_ref().to_owned()).collect();
        let columns = if columns.is_empty() { vec![APART.to_owned()] } else { columns };
        let measures = Measures::named(&columns).map_err(GridError)?;
        let plane = Plane::new(scene, axes)?;
        let measures = measures.of(&plane.own().structure);
        Ok(Self { plane, rule, columns, measures })
    }

    /// Returns the cells.
    #[must_use]
    pub fn plane(&self) -> &Plane {
        &self.plane
    }

    /// Returns the title of the last panel of a picture.
    #[must_use]
    pub fn shown(&self) -> String {
        self.measures.title(self.plane.own().dimensionless)
    }

    /// Returns the values on which the rows depend.
    #[must_use]
    pub fn header(&self) -> Header<String, Value> {
        let mut header = self.plane.header();
        header.insert("rule".to_owned(), json!(self.rule));
        header.insert("columns".to_owned(), json!(self.columns));
        header
    }

    /// Opens the file of rows in `folder`.
    ///
    /// # Errors
    /// Errors of [`Records::open`].
    pub fn open(&self, folder: &Path, begin: Begin, share: Share) -> Result<Option<Records>, SweepError> {
        Records::open(folder, Self::FILES, (begin, share), self.header(), Rows::alone(self.plane.cells()))
    }

    /// Returns the rows of several parts, which are in `folders`, as those of an undivided run, to be finished in `out`.
    ///
    /// # Errors
    /// Errors of [`Records::merged`].
    pub fn merged(&self, folders: (&[PathBuf], usize), out: (&Path, Begin)) -> Result<Records, SweepError> {
        Records::merged(folders, Self::FILES, out, self.header(), Rows::alone(self.plane.cells()))
    }

    /// Returns the first line of the table.
    #[must_use]
    pub fn head(&self) -> String {
        let pointers = self.plane.grid().axes().iter().map(|axis| axis.pointer.clone());
        let measures = self.measures.columns(self.plane.own().dimensionless);
        csv_line(pointers.chain(FIRST.map(String::from)).chain(measures).chain(LAST.map(String::from)))
    }

    /// Returns the motion in a cell. `None` if the work is interrupted.
    fn cell(&self, cell: usize, task: Task<'_>) -> Result<Option<(Cell, Values)>, StudyError> {
        let simulation = self.plane.simulation(cell)?;
        let Some(decided) = self.rule.decide(&simulation, simulation.start()?, task)? else {
            return if task.is_cancelled() { Ok(None) } else { Err(StudyError::Budget { cycle: 0 }) };
        };
        let values = if self.columns == [APART] {
            decided.apart.iter().copied().map(Some).collect()
        } else {
            let steady = measured(&simulation, &decided.section, decided.motion.clone(), task)?;
            self.measures.values(Some(&steady))
        };
        Ok(Some((decided, values)))
    }

    /// Returns a row of the table. `None` if the work is interrupted.
    fn row(&self, cell: usize, task: Task<'_>) -> Option<String> {
        let optional = |value: Option<f64>| value.map_or_else(String::new, number);
        let mut line: Vec<String> = self.plane.values(cell).map(number).to_vec();
        match self.cell(cell, task) {
            Ok(None) | Err(StudyError::Interrupted) => return None,
            Ok(Some((Cell { motion, exponent, impacts, apart, .. }, values))) => {
                let is_watched = apart.iter().all(|share| share.is_finite());
                line.extend([
                    motion.kind.word().to_owned(),
                    motion.period.map_or_else(String::new, |period| period.to_string()),
                    motion.word.unwrap_or_default(),
                    optional(exponent),
                ]);
                line.extend(values.into_iter().map(|value| optional(value.filter(|value| value.is_finite()))));
                // A motion that was not watched has no known share of time and no known impacts.
                let impacts = if is_watched { impacts.word() } else { "" };
                line.extend([impacts.to_owned(), motion.cycles.to_string(), String::new()]);
            }
            Err(error) => {
                line.push("failed".to_owned());
                let empty = FIRST.len() - 1 + self.measures.values(None).len() + LAST.len() - 1;
                line.extend(std::iter::repeat_n(String::new(), empty));
                line.push(in_a_line(&error.to_string()));
            }
        }
        Some(csv_line(line))
    }

    /// Computes every missing row, on the threads of the current pool. The row of a cell depends only on the cell.
    ///
    /// # Errors
    /// [`SweepError`] if a row cannot be stored.
    pub fn run(&self, rows: &mut Records, task: Task<'_>) -> Result<Ending, SweepError> {
        let share = rows.share();
        let work = |(): &mut (), i: usize| (!task.is_cancelled()).then(|| self.row(share.chain(i), task))?;
        for missing in rows.missing() {
            let keep = |i: usize, row: String| {
                rows.keep(share.chain(i), &row)?;
                task.advance();
                Ok::<(), SweepError>(())
            };
            in_order(missing, 1, || (), work, keep)?;
        }
        rows.sync()?;
        Ok(if rows.is_complete() { Ending::Complete } else { Ending::Interrupted })
    }

    /// Counts the cells and writes the final files. `picture` draws the map into the folder.
    ///
    /// # Errors
    /// [`SweepError::Output`] if a file cannot be read or written; the rows are kept then.
    pub fn finish(
        &self,
        mut rows: Records,
        picture: impl FnOnce(&Tally, &mut Folder) -> Result<(), OutputError>,
    ) -> Result<Tally, SweepError> {
        let axes = self.plane.grid().axes();
        let before = 2 + FIRST.len();
        let shown = self.measures.of_first().into_iter().map(|place| before + place).collect();
        let after = before + self.measures.values(None).len();
        let mut tally = Tally::new([axes[0].count(), axes[1].count()], shown, after);
        rows.in_order(|_, row, _| {
            tally.add(row);
            Ok(())
        })?;
        picture(&tally, rows.outputs())?;
        rows.table(&self.head(), |row, _| row.to_owned(), &[], tally.found())?;
        Ok(tally)
    }
}
