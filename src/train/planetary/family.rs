//! Natural modes of a symmetric stage, by family.

use std::{collections::BTreeMap, f64::consts::TAU, fmt};

use nalgebra::DMatrix;
use thiserror::Error;

use crate::linalg::{EigenError, Modes, natural_modes};
use crate::system::Spec;

/// Family of the modes of a symmetric stage, by moving bodies (Lin & Parker, J. Vib. Acoust. 121, 1999, 316).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// All planets move alike; the central bodies turn and their centres rest. Single frequencies.
    Rotational,
    /// The centres of the central bodies move, none of them turns. Frequencies in pairs.
    Translational,
    /// Planets move against one another, the central bodies rest. Frequencies N − 3 times (N − 1 times where the
    /// centres are held).
    Planet,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 3] = [Self::Rotational, Self::Translational, Self::Planet];

    /// Returns the name in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rotational => "rotational",
            Self::Translational => "translational",
            Self::Planet => "planet",
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The natural modes of one family.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FamilyModes {
    /// The family.
    pub family: Family,
    /// Multiplicity of each of its frequencies, ≥ 1.
    pub multiplicity: usize,
    /// Frequencies with their repetitions, rising; shapes in all degrees of freedom of the stage, `[n × modes]`.
    pub modes: Modes,
}

impl FamilyModes {
    /// The different frequencies, rising, Hz: the mean of each group of equal ones, whose rounding errors differ.
    #[must_use]
    pub fn hertz(&self) -> Vec<f64> {
        self.modes
            .hertz()
            .chunks(self.multiplicity)
            .map(|group| group.iter().sum::<f64>() / group.len() as f64)
            .collect()
    }
}

/// Reason for which the modes of a train do not fall into families.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FamilyError {
    /// The degrees of freedom are not those of a stage with alike planets.
    #[error("the freedoms are not those of a planetary stage that treats its planets alike")]
    Freedoms,
    /// The matrices couple the families.
    #[error("the stage is not symmetric: its planets differ, or are not equally spaced and numbered in order")]
    Asymmetric,
    /// There are no modes at all.
    #[error(transparent)]
    Modes(#[from] EigenError),
}

/// Coupling between families up to this share of the largest entry is rounding of positions.
const COUPLING: f64 = 1e-6;

/// Returns the natural modes of a stage by family, each from its part of the structure. Rotational: rotations of the central bodies and the
/// common motion of the planets. Translational: centres and the first harmonic `cos(2π i/N), sin(2π i/N)` over the planets i. Planet: their
/// higher harmonics. Symmetry separates the parts, so the family of a frequency is certain even at crossings.
///
/// `stiffness` is `K` with contacts closed, N/m, `[n × n]` ([`bonded_stiffness`](crate::system::bonded_stiffness)).
/// Families without degrees of freedom are omitted.
///
/// # Errors
/// [`FamilyError`] names the reason.
pub fn families(spec: &Spec, stiffness: &DMatrix<f64>) -> Result<Vec<FamilyModes>, FamilyError> {
    let bases = bases(&spec.freedoms)?;
    for (i, (_, _, left)) in bases.iter().enumerate() {
        for (_, _, right) in &bases[..i] {
            let coupled = |matrix: &DMatrix<f64>| left.tr_mul(matrix) * right;
            if [&spec.mass, stiffness].iter().any(|matrix| coupled(matrix).amax() > COUPLING * matrix.amax()) {
                return Err(FamilyError::Asymmetric);
            }
        }
    }
    let part = |(family, multiplicity, basis): (Family, usize, DMatrix<f64>)| {
        let reduce = |matrix: &DMatrix<f64>| {
            let reduced = basis.tr_mul(matrix) * &basis;
            0.5 * (&reduced + reduced.transpose())
        };
        let own = natural_modes(&reduce(stiffness), &reduce(&spec.mass))?;
        let modes = Modes { omega: own.omega, shapes: basis * own.shapes };
        Ok(FamilyModes { family, multiplicity, modes })
    };
    bases.into_iter().map(part).collect()
}

/// Returns each family with its multiplicity and an orthonormal basis of its motions, `[n × degrees of freedom of the family]`.
fn bases(freedoms: &[String]) -> Result<Vec<(Family, usize, DMatrix<f64>)>, FamilyError> {
    let mut columns: BTreeMap<Family, Vec<Vec<f64>>> = BTreeMap::new();
    let unit = |row: usize| (0..freedoms.len()).map(|i| f64::from(i == row)).collect::<Vec<f64>>();
    let row_of = |name: &str| freedoms.iter().position(|freedom| freedom == name);
    // Rows of each kind of planet motion, by number of the planet.
    let mut planets: BTreeMap<&str, BTreeMap<usize, usize>> = BTreeMap::new();
    for (row, name) in freedoms.iter().enumerate() {
        let numbered = name.split_once('_').and_then(|(stem, rest)| Some((stem, rest.parse::<usize>().ok()?)));
        match (name.as_str(), numbered) {
            // Central rotations; in the in-phase reduction also the one planet in place of all.
            ("u_s" | "u_c" | "u_r" | "xi" | "eta" | "u", _) => {
                columns.entry(Family::Rotational).or_default().push(unit(row));
            }
            ("x_s" | "x_c" | "x_r" | "y_s" | "y_c" | "y_r", _) => {
                let partner = if name.starts_with('x') { name.replace('x', "y") } else { name.replace('y', "x") };
                row_of(&partner).ok_or(FamilyError::Freedoms)?;
                columns.entry(Family::Translational).or_default().push(unit(row));
            }
            (_, Some((stem @ ("xi" | "eta" | "u"), number))) => {
                planets.entry(stem).or_default().insert(number, row);
            }
            _ => return Err(FamilyError::Freedoms),
        }
    }
    // Otherwise the train is a gear pair, whose degrees of freedom have numbers too.
    if columns.is_empty() {
        return Err(FamilyError::Freedoms);
    }
    let count = planets.values().map(BTreeMap::len).max().unwrap_or(0);
    let centres_move = columns.contains_key(&Family::Translational);
    for rows in planets.values() {
        if !rows.keys().copied().eq(1..=count) {
            return Err(FamilyError::Freedoms);
        }
        for harmonic in 0..=count / 2 {
            let family = match harmonic {
                0 => Family::Rotational,
                1 if centres_move => Family::Translational,
                _ => Family::Planet,
            };
            let single = harmonic == 0 || 2 * harmonic == count;
            for quarter in if single { &[0.0][..] } else { &[0.0, 0.25] } {
                let mut column = vec![0.0; freedoms.len()];
                for (i, &row) in rows.values().enumerate() {
                    let turns = (harmonic * i % count) as f64 / count as f64;
                    column[row] =
                        libm::cos(TAU * (turns - quarter)) * (if single { 1.0 } else { 2.0 } / count as f64).sqrt();
                }
                columns.entry(family).or_default().push(column);
            }
        }
    }
    let multiplicity = |family| match family {
        Family::Rotational => 1,
        Family::Translational => {
            if count == 2 {
                1
            } else {
                2
            }
        }
        Family::Planet => count - if centres_move { 3 } else { 1 },
    };
    let matrix = |columns: &[Vec<f64>]| DMatrix::from_fn(freedoms.len(), columns.len(), |row, i| columns[i][row]);
    Ok(columns.into_iter().map(|(family, columns)| (family, multiplicity(family), matrix(&columns))).collect())
}
