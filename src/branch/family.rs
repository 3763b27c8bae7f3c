//! The trains along a parameter.

use super::node::Place;
use crate::{
    scene::Scene,
    simulation::{Parameter, Simulation, SimulationError},
    system::Variation,
};

/// A scene with one or two of its numbers free.
#[derive(Clone, Debug)]
pub struct Family {
    scene: Scene,
    /// The number, and those that go with it.
    pub parameter: Parameter,
    /// The range, `from < to`; ends included.
    pub from: f64,
    /// Its other end.
    pub to: f64,
    /// The second number and its range.
    second: Option<(Parameter, [f64; 2])>,
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
        Simulation::from_scene(&scene)?.period()?;
        let parameter = checked(&scene, parameter, ends)?;
        let [from, to] = ends;
        Ok(Self { scene, parameter, from: from.min(to), to: from.max(to), second: None })
    }

    /// The same with a second number free between `ends`.
    ///
    /// # Errors
    /// As [`new`](Self::new); also if one pointer is that of both numbers.
    pub fn with(mut self, second: Parameter, ends: [f64; 2]) -> Result<Self, SimulationError> {
        if let Some(shared) = second.pointers().find(|pointer| self.parameter.pointers().any(|other| other == *pointer))
        {
            return Err(self.own()?.missing(format!("{shared} is one of the first numbers and of the second ones")));
        }
        let second = checked(&self.scene, second, ends)?;
        self.second = Some((second, [ends[0].min(ends[1]), ends[0].max(ends[1])]));
        Ok(self)
    }

    /// Lengths of both ranges; 1 of a second number that there is not.
    #[must_use]
    pub fn ranges(&self) -> [f64; 2] {
        [self.range(), self.second.as_ref().map_or(1.0, |(_, [from, to])| to - from)]
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

    /// Whether both values lie in their ranges.
    #[must_use]
    pub fn holds(&self, [value, second]: Place) -> bool {
        let [_, [from, to]] = self.borders();
        self.contains(value) && (from..=to).contains(&second)
    }

    /// The second number, if there is one.
    #[must_use]
    pub fn second(&self) -> Option<&Parameter> {
        self.second.as_ref().map(|(second, _)| second)
    }

    /// Ends of both ranges.
    #[must_use]
    pub fn borders(&self) -> [[f64; 2]; 2] {
        [[self.from, self.to], self.second.as_ref().map_or([0.0; 2], |(_, ends)| *ends)]
    }

    /// The scene's values.
    #[must_use]
    pub fn own_place(&self) -> Place {
        [self.parameter.value(), self.second.as_ref().map_or(0.0, |(second, _)| second.value())]
    }

    /// The train at the scene's own values, with the scene's start.
    ///
    /// # Errors
    /// [`SimulationError`] if it cannot be assembled.
    pub fn own(&self) -> Result<Simulation, SimulationError> {
        Simulation::from_scene(&self.scene)?.in_common_cycles()
    }

    /// The train at `value`, the second number as the scene has it.
    ///
    /// # Errors
    /// [`SimulationError`] if the scene does not hold there.
    pub fn at(&self, value: f64) -> Result<Simulation, SimulationError> {
        self.train([value, self.own_place()[1]])
    }

    /// The train at both values.
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

    /// How the train `of` at some values changes with the first `numbers` of them.
    ///
    /// # Errors
    /// As [`Simulation::variation`].
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

/// A parameter by which the motion has a derivative, and of which the scene holds between `ends`.
fn checked(scene: &Scene, parameter: Parameter, ends: [f64; 2]) -> Result<Parameter, SimulationError> {
    Simulation::from_scene(scene)?.variation_by(&parameter)?;
    Ok(parameter.checked(scene, ends)?)
}
