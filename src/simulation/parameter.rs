//! Parameter: a number of a scene that is varied, with the numbers that move with it.

use serde_json::Value;

use crate::scene::{BuiltScene, Fault, Scene, SceneError};

/// Numbers of a scene that move together. The first takes the value; each further frequency is multiplied by the ratio of that to the
/// scene's value, each period is divided by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pointer: String,
    /// Value of the scene.
    value: f64,
    /// Other numbers with the scene's values; true for those that are divided.
    others: Vec<(String, f64, bool)>,
    /// Values between which the scene is known to be valid.
    holds: Option<[f64; 2]>,
    /// Numbers with values other than the scene's.
    beside: Vec<(String, f64)>,
}

/// Distance beyond a range to which a scene is checked, as a share of it or of its end: differences of its numbers reach so far.
const MARGIN: f64 = 0.1;

/// Returns whether the last key of a pointer names a period.
fn is_period(pointer: &str) -> bool {
    let key = pointer.rsplit('/').find(|key| key.parse::<usize>().is_err());
    key.is_some_and(|key| key.starts_with("period"))
}

impl Parameter {
    /// Returns the parameter of the numbers at `pointers` of a resolved scene.
    ///
    /// # Errors
    /// The fault of the numbers, in words.
    pub fn new(resolved: &Value, pointers: &[&str]) -> Result<Self, String> {
        if resolved.is_null() {
            return Err("it was built in Rust and has no numbers with pointers; make a Variation of trains".to_owned());
        }
        let number = |pointer: &&str| {
            let value = resolved.pointer(pointer).and_then(Value::as_f64);
            let value = value
                .ok_or_else(|| format!("there is no number at {pointer:?}; see the resolved scene for its pointers"))?;
            Ok::<_, String>(((*pointer).to_owned(), value, is_period(pointer)))
        };
        let mut all = pointers.iter().map(number).collect::<Result<Vec<_>, _>>()?;
        let Some((pointer, value, inverse)) = all.first().cloned() else {
            return Err("no pointer is given".to_owned());
        };
        let others: Vec<_> =
            all.drain(1..).map(|(other, value, is_period)| (other, value, is_period != inverse)).collect();
        if value == 0.0 && !others.is_empty() {
            return Err(format!("{pointer} is zero in the scene: the others cannot follow it by a factor"));
        }
        Ok(Self { pointer, value, others, holds: None, beside: Vec::new() })
    }

    /// Returns the parameter of the numbers at `pointers` of a scene, whose own value must lie between the `ends`: a continuation begins
    /// there.
    ///
    /// # Errors
    /// The fault of the numbers or of the range.
    pub fn around(scene: &Scene, pointers: &[&str], ends: [f64; 2]) -> Result<Self, Fault> {
        let place = pointers.join(",");
        let parameter = Self::new(scene.resolved(), pointers)
            .map_err(|reason| Fault::new(&place, reason, "pointers to numbers of the scene"))?;
        let value = parameter.value();
        if (ends[0].min(ends[1])..=ends[0].max(ends[1])).contains(&value) {
            return Ok(parameter);
        }
        let found = format!("a range without the scene's own value, {value}");
        Err(Fault::new(&place, found, "a range around it: the first orbit is that of the scene"))
    }

    /// Returns the pointer of the first number.
    #[must_use]
    pub fn pointer(&self) -> &str {
        &self.pointer
    }

    /// Returns the scene's value of the first number.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Returns the pointers of all numbers.
    pub fn pointers(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.pointer.as_str()).chain(self.others.iter().map(|(pointer, ..)| pointer.as_str()))
    }

    /// Returns the same numbers, with those of another parameter held at `value`.
    #[must_use]
    pub fn beside(&self, other: &Self, value: f64) -> Self {
        let beside = other.values(value).into_iter().map(|(pointer, value)| (pointer.to_owned(), value)).collect();
        Self { beside, ..self.clone() }
    }

    /// Returns the values of all numbers with the first at `value`.
    fn values(&self, value: f64) -> Vec<(&str, f64)> {
        let factor = value / self.value;
        let others = self
            .others
            .iter()
            .map(|(pointer, own, inverse)| (pointer.as_str(), own * if *inverse { factor.recip() } else { factor }));
        let beside = self.beside.iter().map(|(pointer, value)| (pointer.as_str(), *value));
        std::iter::once((self.pointer.as_str(), value)).chain(others).chain(beside).collect()
    }

    /// Returns the scene with the first number at `value`, and the others moved with it.
    ///
    /// # Errors
    /// [`SceneError`] if the scene is invalid there.
    pub fn set(&self, scene: &Scene, value: f64) -> Result<Scene, SceneError> {
        scene.with_all(self.values(value).into_iter().map(|(pointer, value)| (pointer, Value::from(value))))
    }

    /// Checks that the scene is valid from `from` to `to` and slightly beyond. [`build`](Self::build) is several times as fast there, as
    /// the ranges of keys have no gaps.
    ///
    /// # Errors
    /// [`SceneError`] if the scene is invalid at one of the ends.
    pub fn checked(mut self, scene: &Scene, [from, to]: [f64; 2]) -> Result<Self, SceneError> {
        let beyond = |end: f64, other: f64| -> Result<f64, SceneError> {
            self.set(scene, end)?;
            let further = end + MARGIN * (end - other).signum() * end.abs().max((end - other).abs());
            Ok(if self.set(scene, further).is_ok() { further } else { end })
        };
        self.holds = Some([beyond(from.min(to), from.max(to))?, beyond(from.max(to), from.min(to))?]);
        Ok(self)
    }

    /// Returns the train that the scene builds with the first number at `value`.
    ///
    /// # Errors
    /// [`SceneError`] if the scene is invalid there.
    pub fn build(&self, scene: &Scene, value: f64) -> Result<BuiltScene, SceneError> {
        match self.holds {
            Some([low, high]) if (low..=high).contains(&value) => scene.build_with(self.values(value)),
            _ => self.set(scene, value)?.build(),
        }
    }
}
