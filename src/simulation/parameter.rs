//! A number of a scene that is varied, and those that go with it.

use serde_json::Value;

use crate::scene::{Built, Scene, SceneError};

/// Numbers of a scene that move together. The first takes the value; each further frequency moves by the same factor from the scene's
/// value, each period by its inverse.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pointer: String,
    /// The scene's value.
    value: f64,
    /// The others with the scene's values, and whether each moves by the inverse of the first's factor.
    others: Vec<(String, f64, bool)>,
    /// Values between which the scene is known to hold.
    holds: Option<[f64; 2]>,
    /// Numbers that are not the scene's.
    beside: Vec<(String, f64)>,
}

/// How far beyond a range a scene is checked, as a share of it or of its end: what differences of its numbers reach.
const MARGIN: f64 = 0.1;

/// Whether the last key of a pointer names a period.
fn is_period(pointer: &str) -> bool {
    let key = pointer.rsplit('/').find(|key| key.parse::<usize>().is_err());
    key.is_some_and(|key| key.starts_with("period"))
}

impl Parameter {
    /// The numbers at `pointers` of a resolved scene.
    ///
    /// # Errors
    /// What is wrong with them, in words.
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

    /// The pointer of the first.
    #[must_use]
    pub fn pointer(&self) -> &str {
        &self.pointer
    }

    /// The scene's value of the first.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.value
    }

    /// The pointers of all.
    pub fn pointers(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.pointer.as_str()).chain(self.others.iter().map(|(pointer, ..)| pointer.as_str()))
    }

    /// The same numbers with others at `value` of their own.
    #[must_use]
    pub fn beside(&self, other: &Self, value: f64) -> Self {
        let beside = other.values(value).into_iter().map(|(pointer, value)| (pointer.to_owned(), value)).collect();
        Self { beside, ..self.clone() }
    }

    /// The values of all numbers with the first at `value`.
    fn values(&self, value: f64) -> Vec<(&str, f64)> {
        let factor = value / self.value;
        let others = self
            .others
            .iter()
            .map(|(pointer, own, inverse)| (pointer.as_str(), own * if *inverse { factor.recip() } else { factor }));
        let beside = self.beside.iter().map(|(pointer, value)| (pointer.as_str(), *value));
        std::iter::once((self.pointer.as_str(), value)).chain(others).chain(beside).collect()
    }

    /// The scene with the first at `value`, and the others moved with it.
    ///
    /// # Errors
    /// [`SceneError`] if the scene does not hold there.
    pub fn set(&self, scene: &Scene, value: f64) -> Result<Scene, SceneError> {
        scene.with_all(self.values(value).into_iter().map(|(pointer, value)| (pointer, Value::from(value))))
    }

    /// Looks where the scene holds, from `from` to `to` and a little beyond: [`build`](Self::build) is several times as fast there, as the
    /// ranges of keys have no gaps.
    ///
    /// # Errors
    /// [`SceneError`] if the scene does not hold at one of the ends.
    pub fn checked(mut self, scene: &Scene, [from, to]: [f64; 2]) -> Result<Self, SceneError> {
        let beyond = |end: f64, other: f64| -> Result<f64, SceneError> {
            self.set(scene, end)?;
            let further = end + MARGIN * (end - other).signum() * end.abs().max((end - other).abs());
            Ok(if self.set(scene, further).is_ok() { further } else { end })
        };
        self.holds = Some([beyond(from.min(to), from.max(to))?, beyond(from.max(to), from.min(to))?]);
        Ok(self)
    }

    /// What the scene builds with the first at `value`.
    ///
    /// # Errors
    /// [`SceneError`] if the scene does not hold there.
    pub fn build(&self, scene: &Scene, value: f64) -> Result<Built, SceneError> {
        match self.holds {
            Some([low, high]) if (low..=high).contains(&value) => scene.build_with(self.values(value)),
            _ => self.set(scene, value)?.build(),
        }
    }
}
