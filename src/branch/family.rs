//! The trains along a parameter.

use crate::{
    scene::Scene,
    simulation::{Parameter, Simulation, SimulationError},
};

/// A scene with one of its numbers free.
#[derive(Clone, Debug)]
pub struct Family {
    scene: Scene,
    /// The number, and those that go with it.
    pub parameter: Parameter,
    /// The range, `from < to`; ends included.
    pub from: f64,
    /// Its other end.
    pub to: f64,
}

impl Family {
    /// The scene `scene` between the values `from` and `to` of `parameter`, in either order.
    #[must_use]
    pub fn new(scene: Scene, parameter: Parameter, from: f64, to: f64) -> Self {
        Self { scene, parameter, from: from.min(to), to: from.max(to) }
    }

    /// Length of the range.
    #[must_use]
    pub fn range(&self) -> f64 {
        self.to - self.from
    }

    /// Whether a value lies in the range.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        (self.from..=self.to).contains(&value)
    }

    /// The train at `value`.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene does not hold there.
    pub fn at(&self, value: f64) -> Result<Simulation, SimulationError> {
        Simulation::from_scene(self.parameter.set(&self.scene, value)?)
    }
}
