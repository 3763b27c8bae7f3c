//! Conditions under which a [`Spec`] can be assembled.

use super::{ContactSpec, Flanks, Spec, contact_mode::MAX_PIECES};
use crate::gear::{Harmonic, Stiffness};

/// Reason for which a [`Spec`] cannot be assembled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AssembleError {
    /// A vector or matrix has the wrong shape.
    #[error("{what} has {found} entries, and {expected} are needed (one for each freedom)")]
    Shape {
        /// Name of the array.
        what: String,
        /// Number of entries found.
        found: usize,
        /// Number of entries needed.
        expected: usize,
    },
    /// The mass matrix is not symmetric positive definite.
    #[error("the mass matrix is not symmetric positive definite")]
    Mass,
    /// A number is not finite.
    #[error("{what} is not a finite number")]
    NotFinite {
        /// Name of the quantity.
        what: String,
    },
    /// Invalid contact or load: a value out of its range, or parts that do not fit together.
    #[error("{contact}: {problem}")]
    Contact {
        /// Name of the contact or load.
        contact: String,
        /// Problem, in words.
        problem: &'static str,
    },
}

fn finite<'a>(what: &str, values: impl IntoIterator<Item = &'a f64>) -> Result<(), AssembleError> {
    if values.into_iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(AssembleError::NotFinite { what: what.to_owned() })
    }
}

fn require(ok: bool, name: &str, problem: &'static str) -> Result<(), AssembleError> {
    if ok { Ok(()) } else { Err(AssembleError::Contact { contact: name.to_owned(), problem }) }
}

fn of_waves(waves: &[Harmonic]) -> impl Iterator<Item = &f64> {
    waves.iter().flat_map(|h| [&h.amplitude, &h.omega, &h.phase])
}

impl Spec {
    /// Checks that a [`Structure`](super::Structure) can be assembled from the specification.
    ///
    /// # Errors
    /// [`AssembleError`] if shapes do not fit, the mass matrix is not symmetric, or a number is not finite or out of its range, and if
    /// the parts of a contact do not fit together. Only its factorisation shows whether the mass matrix is positive definite.
    pub fn check(&self) -> Result<(), AssembleError> {
        let n = self.freedoms.len();
        let shape = |what: &str, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(AssembleError::Shape { what: what.into(), found, expected }) }
        };
        let matrices =
            [("mass matrix", &self.mass), ("damping matrix", &self.damping), ("stiffness matrix", &self.stiffness)];
        for (what, m) in matrices {
            shape(what, m.len(), n * n)?;
            shape(what, m.nrows(), n)?;
            finite(what, m.iter())?;
        }
        shape("constant load", self.load.len(), n)?;
        finite("constant load", &self.load)?;
        finite("base frequency", &self.omega)?;
        for l in &self.load_harmonics {
            shape("harmonic load", l.vector.len(), n)?;
            finite("harmonic load", l.vector.iter().chain([&l.omega, &l.phase]))?;
        }
        for (i, l) in self.load_schedules.iter().enumerate() {
            let name = format!("load {}", i + 1);
            shape(&name, l.vector.len(), n)?;
            finite(&name, &l.vector)?;
            let require = |ok: bool, problem| require(ok, &name, problem);
            check_schedule(&name, &l.factor, require)?;
            require(!matches!(l.factor, Stiffness::Harmonic { .. }), "harmonics are no part of its schedule")?;
        }
        let m = &self.mass;
        let differ = |i, j| (m[(i, j)] - m[(j, i)]).abs() > 1e-12 * (m[(i, i)] * m[(j, j)]).abs().sqrt();
        if (0..n).any(|i| (0..i).any(|j| differ(i, j))) {
            return Err(AssembleError::Mass);
        }
        // Guards are numbered in 16 bits.
        shape("list of contacts", self.contacts.len(), self.contacts.len().min(usize::from(u16::MAX) / 3))?;
        for c in &self.contacts {
            shape(&format!("direction of {}", c.name), c.direction.len(), n)?;
            self.check_contact(c)?;
        }
        Ok(())
    }

    fn check_contact(&self, c: &ContactSpec) -> Result<(), AssembleError> {
        let require = |ok: bool, problem| require(ok, &c.name, problem);
        finite(&format!("direction of {}", c.name), &c.direction)?;
        finite(&format!("gap of {}", c.name), [&c.half_backlash, &c.error_offset])?;
        finite(&format!("error of {}", c.name), of_waves(&c.error))?;
        require(c.direction.iter().any(|g| *g != 0.0), "its direction is zero: no freedom moves it")?;
        check_schedule(&format!("stiffness of {}", c.name), &c.stiffness, require)?;
        require((0.0..f64::INFINITY).contains(&c.gap_damping), "its gap damping must be finite and >= 0")?;
        if let Some(back) = &c.back {
            finite(&format!("back flank of {}", c.name), of_waves(&back.error).chain([&back.error_offset]))?;
            check_schedule(&format!("back flank of {}", c.name), &back.stiffness, require)?;
            require(c.flanks == Flanks::Both && !c.law.is_bilateral(), "a back flank of its own needs two flanks")?;
            require(c.narrowest_gap() > 0.0, "the errors of its flanks close the gap: it would jam")?;
        }
        if let Some(problem) = c.law.fault() {
            require(false, problem)?;
        }
        let is_constant = c.schedules().all(|k| matches!(k, Stiffness::Constant(_)));
        require(c.law.power().is_none() || is_constant, "a power law needs a constant stiffness")?;
        require(
            c.flanks == Flanks::Drive || c.half_backlash > 0.0 || c.law.is_bilateral(),
            "a two-flank contact needs a positive half backlash; without backlash use a bilateral law",
        )
    }
}

/// Checks a stiffness or the factor of a load, named `what`.
fn check_schedule(
    what: &str,
    schedule: &Stiffness,
    require: impl Fn(bool, &'static str) -> Result<(), AssembleError>,
) -> Result<(), AssembleError> {
    match schedule {
        Stiffness::Constant(k) => finite(what, [k]),
        Stiffness::Harmonic { mean, harmonics } => finite(what, [mean].into_iter().chain(of_waves(harmonics))),
        Stiffness::Periodic { period, origin, pieces } => {
            let numbers = pieces.iter().flat_map(|p| [&p.start, &p.value, &p.slope]);
            finite(what, [period, origin].into_iter().chain(numbers))?;
            require(*period > 0.0, "a schedule that repeats needs a period > 0")?;
            require((1..=MAX_PIECES).contains(&pieces.len()), "a schedule that repeats needs 1 to 8192 pieces")
        }
        Stiffness::Listed { times, values, slopes } => {
            finite(what, times.iter().flatten().chain(values).chain(slopes))?;
            let fits = values.len() == times.len() + 1 && slopes.len() == values.len();
            require(fits, "a schedule needs a value and a slope before the first time and at each time")?;
            let ends = [slopes.first(), slopes.last()].into_iter().flatten().all(|slope| *slope == 0.0);
            require(ends, "a schedule must be constant before its first and after its last time")?;
            // Pieces with the same value and no slope count once.
            let ramps = slopes.iter().filter(|slope| **slope != 0.0).count();
            let mut levels: Vec<u64> = values
                .iter()
                .zip(slopes)
                .filter(|(_, slope)| **slope == 0.0)
                .map(|(value, _)| value.to_bits())
                .collect();
            levels.sort_unstable();
            levels.dedup();
            require(ramps + levels.len() <= MAX_PIECES, "a schedule needs at most 8192 pieces that differ")
        }
    }
}
