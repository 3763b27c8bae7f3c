//! Trains along a parameter.

use super::node::Place;
use crate::{
    scene::Scene,
    simulation::{Parameter, Simulation, SimulationError},
    system::Variation,
};

/// A scene with one or two of its numbers free.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Family {
    scene: Scene,
    /// Parameter, with the numbers of the scene that it sets.
    pub parameter: Parameter,
    /// Lower end of the range, `from < to`; included.
    pub from: f64,
    /// Upper end of the range; included.
    pub to: f64,
    /// The second number and its range.
    second: Option<(Parameter, [f64; 2])>,
}

impl Family {
    /// Returns the family of `scene` between the values `from` and `to` of `parameter`, in either order.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene has no forcing period, if its motion has no derivative by the parameter, or if it does not hold at
    /// one of the ends.
    pub fn new(scene: &Scene, parameter: Parameter, ends: [f64; 2]) -> Result<Self, SimulationError> {
        // Numbers from a preset or a default need a place in the document.
        let scene = Scene::from_value(scene.resolved().clone(), scene.name())?;
        Simulation::from_scene(&scene)?.period()?;
        let parameter = checked(&scene, parameter, ends)?;
        let [from, to] = ends;
        Ok(Self { scene, parameter, from: from.min(to), to: from.max(to), second: None })
    }

    /// Returns the family with a second number free between `ends`.
    ///
    /// # Errors
    /// Errors of [`new`](Self::new); also if one pointer is that of both numbers.
    pub fn with(mut self, second: Parameter, ends: [f64; 2]) -> Result<Self, SimulationError> {
        if let Some(shared) = second.pointers().find(|pointer| self.parameter.pointers().any(|other| other == *pointer))
        {
            return Err(self.own()?.missing(format!("{shared} is one of the first numbers and of the second ones")));
        }
        let second = checked(&self.scene, second, ends)?;
        self.second = Some((second, [ends[0].min(ends[1]), ends[0].max(ends[1])]));
        Ok(self)
    }

    /// Returns the lengths of both ranges; 1 for an absent second number.
    #[must_use]
    pub fn ranges(&self) -> [f64; 2] {
        [self.range(), self.second.as_ref().map_or(1.0, |(_, [from, to])| to - from)]
    }

    /// Returns the length of the range.
    #[must_use]
    pub fn range(&self) -> f64 {
        self.to - self.from
    }

    /// Returns whether a value lies in the range.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        (self.from..=self.to).contains(&value)
    }

    /// Returns whether both values lie in their ranges.
    #[must_use]
    pub fn holds(&self, [value, second]: Place) -> bool {
        let [_, [from, to]] = self.borders();
        self.contains(value) && (from..=to).contains(&second)
    }

    /// Returns the second number, if there is one.
    #[must_use]
    pub fn second(&self) -> Option<&Parameter> {
        self.second.as_ref().map(|(second, _)| second)
    }

    /// Returns the ends of both ranges.
    #[must_use]
    pub fn borders(&self) -> [[f64; 2]; 2] {
        [[self.from, self.to], self.second.as_ref().map_or([0.0; 2], |(_, ends)| *ends)]
    }

    /// Returns the values of the scene.
    #[must_use]
    pub fn own_place(&self) -> Place {
        [self.parameter.value(), self.second.as_ref().map_or(0.0, |(second, _)| second.value())]
    }

    /// Returns the train at the values of the scene, with the start of the scene.
    ///
    /// # Errors
    /// [`SimulationError`] if it cannot be assembled.
    pub fn own(&self) -> Result<Simulation, SimulationError> {
        Simulation::from_scene(&self.scene)?.in_common_cycles()
    }

    /// Returns the train at `value`, with the second number of the scene.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene does not hold there.
    pub fn at(&self, value: f64) -> Result<Simulation, SimulationError> {
        self.train([value, self.own_place()[1]])
    }

    /// Returns the train at both values.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene does not hold there.
    pub fn train(&self, [value, second]: Place) -> Result<Simulation, SimulationError> {
        let built = match &self.second {
            Some((other, _)) => self.parameter.beside(other, second).build(&self.scene, value)?,
            None => self.parameter.build(&self.scene, value)?,
        };
        Simulation::from_built(self.scene.name(), built)?.in_common_cycles()
    }

    /// Returns the derivatives of the train `of` at some values by the first `numbers` of them.
    ///
    /// # Errors
    /// Errors of [`Simulation::variation`].
    pub fn variations(
        &self,
        of: &Simulation,
        [value, second]: Place,
        numbers: usize,
    ) -> Result<Vec<Variation>, SimulationError> {
        let Some((other, _)) = &self.second else {
            return Ok(vec![of.variation_at(&self.scene, &self.parameter, value)?]);
        };
        let mut all = vec![of.variation_at(&self.scene, &self.parameter.beside(other, second), value)?];
        if numbers > 1 {
            all.push(of.variation_at(&self.scene, &other.beside(&self.parameter, value), second)?);
        }
        Ok(all)
    }
}

/// Returns a parameter by which the motion has a derivative, after a check that the scene is valid between `ends`.
fn checked(scene: &Scene, parameter: Parameter, ends: [f64; 2]) -> Result<Parameter, SimulationError> {
    Simulation::from_scene(scene)?.variation_by(&parameter)?;
    Ok(parameter.checked(scene, ends)?)
}
