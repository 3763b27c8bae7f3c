//! Two numbers of a scene, each at the values of an axis.

use serde_json::{Map, Value, json};

use crate::{
    orbit::SectionMap,
    output::Fault,
    scene::{Scene, SceneError},
    simulation::{Parameter, Simulation, SimulationError},
    sweep::{Grid, GridError},
};

/// Maximum number of cells.
pub const MOST_CELLS: usize = 1_000_000_000;

/// Error of a plane over a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlaneError {
    /// Axes without a plane.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A scene that is invalid at every corner, or cannot be run there.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}

impl From<SceneError> for PlaneError {
    fn from(error: SceneError) -> Self {
        Self::Simulation(error.into())
    }
}

/// Returns the fault of an axis of one value.
pub(super) fn one_value(pointer: &str) -> Fault {
    let fault = Fault::new(pointer, "an axis of one value", "two values at least: FROM:TO:COUNT");
    fault.remedy(
        "write a value that does not change into the scene; flank diagram takes one axis, flank map and basins two",
    )
}

/// Reads two axes with two values at least.
pub(super) fn two_axes(texts: &[impl AsRef<str>]) -> Result<Grid, GridError> {
    let grid = Grid::parse_up_to(texts, MOST_CELLS)?;
    let mut faults = Vec::new();
    if grid.axes().len() != 2 {
        faults.push(Fault::new("the axes", format!("{} of them", grid.axes().len()), "two of them"));
    }
    for axis in grid.axes().iter().filter(|axis| axis.count() < 2) {
        faults.push(one_value(&axis.pointer));
    }
    if faults.is_empty() { Ok(grid) } else { Err(GridError(faults)) }
}

/// Returns the fault of a number that has to be whole.
pub(super) fn whole(scene: &Scene, number: &Parameter) -> Option<Fault> {
    let is_whole = |fault: &Fault| fault.pointer == number.pointer() && fault.allowed.starts_with("a whole number");
    let between = number.value().floor() + 0.5;
    let refused = number.set(scene, between).is_err_and(|error| error.faults.iter().any(is_whole));
    let fault = || Fault::new(number.pointer(), "a whole number", "a number that may have any value");
    refused.then(|| fault().remedy("flank sweep takes whole numbers"))
}

/// Returns the fault of a value that its key does not allow.
fn outside(scene: &Scene, number: &Parameter, value: f64) -> Option<Fault> {
    let error = number.set(scene, value).err()?;
    error.faults.into_iter().find(|fault| fault.pointer == number.pointer())
}

/// Coordinate or velocity that is varied.
#[derive(Clone, Copy, Debug)]
pub(super) struct StateComponent {
    pub is_velocity: bool,
    pub freedom: usize,
}

/// Reads `/initial/q/I` or `/initial/v/I`, with a number or a name of a freedom.
pub(super) fn varied(pointer: &str, freedoms: &[String]) -> Result<StateComponent, Fault> {
    let fault = |found: &str| {
        let allowed = format!("/initial/q/I or /initial/v/I, with I from 0 to {}", freedoms.len() - 1);
        Fault::new(pointer, found, allowed).remedy("flank map varies other numbers")
    };
    let rest = pointer.strip_prefix("/initial/").ok_or_else(|| fault("no coordinate or velocity of the start"))?;
    let (which, name) = rest.split_once('/').ok_or_else(|| fault("no coordinate or velocity of the start"))?;
    let is_velocity = match which {
        "q" => false,
        "v" => true,
        _ => return Err(fault("no coordinate or velocity of the start")),
    };
    let by_name = freedoms.iter().position(|freedom| freedom == name);
    let freedom = by_name.or_else(|| name.parse().ok().filter(|i: &usize| *i < freedoms.len()));
    Ok(StateComponent { is_velocity, freedom: freedom.ok_or_else(|| fault("a freedom that the train does not have"))? })
}

/// Scene over two of its numbers.
#[derive(Clone, Debug)]
pub struct Plane {
    scene: Scene,
    grid: Grid,
    /// First number; its values are set together with the second one.
    first: Parameter,
    second: Parameter,
    values: [Vec<f64>; 2],
    /// Simulation of the scene itself.
    own: Simulation,
}

impl Plane {
    /// Lays cells over `scene`, by axes in the form of [`Axis::parse`](crate::sweep::Axis::parse); a pointer may list further frequencies
    /// and periods that move with the first, `P1,P2,…`.
    ///
    /// # Errors
    /// [`PlaneError`] for other than two axes, for whole numbers, and for values that the key of a number does not allow. Also for a scene
    /// that is invalid at every corner, or whose forcing does not repeat with its cycle there. Other invalid cells fail separately.
    pub fn new(scene: Scene, axes: &[impl AsRef<str>]) -> Result<Self, PlaneError> {
        let grid = two_axes(axes)?;
        let mut faults = Vec::new();
        let mut numbers = Vec::new();
        for axis in grid.axes() {
            let pointers: Vec<&str> = axis.pointer.split(',').collect();
            match Parameter::new(scene.resolved(), &pointers) {
                Ok(parameter) => numbers.push(parameter),
                Err(reason) => faults.push(Fault::new(&axis.pointer, reason, "pointers to numbers of the scene")),
            }
        }
        let [first, second] = &numbers[..] else { return Err(GridError(faults).into()) };
        let values = [0, 1].map(|i| grid.axes()[i].all());
        let ends =
            |i: usize| values[i].iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
        let [from, to] = [ends(0), ends(1)];
        for (number, ends) in [(first, from), (second, to)] {
            match whole(&scene, number) {
                Some(fault) => faults.push(fault),
                None => faults.extend(ends.into_iter().filter_map(|end| outside(&scene, number, end))),
            }
        }
        if !faults.is_empty() {
            return Err(GridError(faults).into());
        }
        // Ranges of keys have no gaps: a scene that is valid at the four corners is valid in all cells.
        let first = match to.map(|value| first.beside(second, value).checked(&scene, from)) {
            [Ok(_), Ok(_)] => first.clone().checked(&scene, from)?,
            _ => first.clone(),
        };
        let own = Simulation::from_scene(scene.clone())?.in_common_cycles()?;
        let plane = Self { scene, grid, first, second: second.clone(), values, own };
        let line = plane.values[1].len();
        let mut refused = Vec::new();
        for cell in [0, line - 1, plane.cells() - line, plane.cells() - 1] {
            match plane.runs(cell) {
                Ok(()) => return Ok(plane),
                Err(error) => refused.push(error),
            }
        }
        Err(refused.swap_remove(0).into())
    }

    /// Checks that the scene can be run in a cell.
    fn runs(&self, cell: usize) -> Result<(), SimulationError> {
        let simulation = self.simulation(cell)?;
        SectionMap::new(&simulation)?.repeats()?;
        Ok(())
    }

    /// The axes.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the simulation of the scene itself.
    #[must_use]
    pub fn own(&self) -> &Simulation {
        &self.own
    }

    /// Returns the number of cells; the second number varies fastest.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.grid.points()
    }

    /// Returns both numbers in a cell.
    #[must_use]
    pub fn values(&self, cell: usize) -> [f64; 2] {
        let line = self.values[1].len();
        [self.values[0][cell / line], self.values[1][cell % line]]
    }

    /// Returns the simulation in a cell.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene is invalid there.
    pub fn simulation(&self, cell: usize) -> Result<Simulation, SimulationError> {
        let [first, second] = self.values(cell);
        let built = self.first.beside(&self.second, second).build(&self.scene, first)?;
        Simulation::from_built(self.scene.name(), built)?.in_common_cycles()
    }

    /// Returns the values on which rows over the plane depend.
    pub(super) fn header(&self) -> Map<String, Value> {
        let mut header = Map::new();
        header.insert("axes".to_owned(), json!(self.grid.axes()));
        header.insert("flank".to_owned(), env!("CARGO_PKG_VERSION").into());
        header.insert("instructions".to_owned(), self.own.settings.instructions.name().into());
        header.insert("scene_sha256".to_owned(), self.scene.hash().into());
        header
    }
}
