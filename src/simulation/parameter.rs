//! A number of a scene that is varied, and those that go with it.

use serde_json::Value;

use crate::scene::{Scene, SceneError};

/// Numbers of a scene that move together. The first takes the value; each further frequency moves by the same factor from the scene's
/// value, each period by its inverse.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pointer: String,
    /// The scene's value.
    value: f64,
    /// The others with the scene's values, and whether each moves by the inverse of the first's factor.
    others: Vec<(String, f64, bool)>,
}

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
        let Some((pointer, value, inverse)) = all.first().cloned() else { return Err("no pointer is given".to_owned()) };
        let others: Vec<_> = all.drain(1..).map(|(other, value, is_period)| (other, value, is_period != inverse)).collect();
        if value == 0.0 && !others.is_empty() {
            return Err(format!("{pointer} is zero in the scene: the others cannot follow it by a factor"));
        }
        Ok(Self { pointer, value, others })
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

    /// The scene with the first at `value`, and the others moved with it.
    ///
    /// # Errors
    /// [`SceneError`] if the scene does not hold there.
    pub fn set(&self, scene: &Scene, value: f64) -> Result<Scene, SceneError> {
        let factor = value / self.value;
        let moved = |(pointer, own, inverse): &(String, f64, bool)| {
            let factor = if *inverse { factor.recip() } else { factor };
            (pointer.clone(), own * factor)
        };
        let all: Vec<(String, f64)> =
            std::iter::once((self.pointer.clone(), value)).chain(self.others.iter().map(moved)).collect();
        scene.with_all(all.iter().map(|(pointer, value)| (pointer.as_str(), Value::from(*value))))
    }
}
