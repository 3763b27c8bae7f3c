//! The trains along a parameter.

use crate::{
    scene::Scene,
    simulation::{Parameter, Simulation, SimulationError},
    system::Variation,
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
    ///
    /// # Errors
    /// [`SimulationError`] if the scene has no forcing period, if its motion has no derivative by the parameter, or if it does not hold at
    /// one of the ends.
    pub fn new(scene: &Scene, parameter: Parameter, ends: [f64; 2]) -> Result<Self, SimulationError> {
        // What a preset or a default brings has to have a place.
        let scene = Scene::from_value(scene.resolved().clone(), scene.name())?;
        let simulation = Simulation::from_scene(&scene)?;
        simulation.period()?;
        simulation.variation_by(&parameter)?;
        let parameter = parameter.checked(&scene, ends)?;
        let [from, to] = ends;
        Ok(Self { scene, parameter, from: from.min(to), to: from.max(to) })
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

    /// The train at the scene's own value, with the scene's start.
    ///
    /// # Errors
    /// [`SimulationError`] if it cannot be assembled.
    pub fn own(&self) -> Result<Simulation, SimulationError> {
        Simulation::from_scene(&self.scene)
    }

    /// The train at `value`.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene does not hold there.
    pub fn at(&self, value: f64) -> Result<Simulation, SimulationError> {
        Simulation::from_built(self.scene.name(), self.parameter.build(&self.scene, value)?)
    }

    /// How the train `of` at `value` changes with the parameter.
    ///
    /// # Errors
    /// As [`Simulation::variation`].
    pub fn variation(&self, of: &Simulation, value: f64) -> Result<Variation, SimulationError> {
        of.variation_at(&self.scene, &self.parameter, value)
    }
}
