//! Natural frequencies and mode shapes of `K v = ω² M v`.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use thiserror::Error;

/// Natural modes of an undamped linear structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// Natural angular frequencies ω, rad/s, rising, `[n]`.
    pub omega: Vec<f64>,
    /// Mode shapes as columns, `Vᵀ M V = I`, `[n × n]`.
    pub shapes: DMatrix<f64>,
}

impl Modes {
    /// Returns the natural frequencies ω/2π, Hz, rising, `[n]`.
    #[must_use]
    pub fn hertz(&self) -> Vec<f64> {
        self.omega.iter().map(|w| w / std::f64::consts::TAU).collect()
    }

    /// Returns the share of each degree of freedom in the kinetic energy of a mode, `v_i (M v)_i`, sum 1, `[n]`.
    #[must_use]
    pub fn energy_shares(&self, mass: &DMatrix<f64>, mode: usize) -> Vec<f64> {
        let shape: DVector<f64> = self.shapes.column(mode).into_owned();
        let momentum = mass * &shape;
        shape.component_mul(&momentum).iter().copied().collect()
    }
}

/// Reason for which a structure has no natural modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum EigenError {
    /// The matrices are not square or not of one size.
    #[error("mass and stiffness must be square and of one size")]
    Shape,
    /// The mass matrix is not positive definite.
    #[error("the mass matrix is not positive definite")]
    Mass,
    /// The stiffness matrix has a negative eigenvalue beyond round-off: the structure is unstable.
    #[error("the stiffness matrix is not positive semidefinite")]
    Stiffness,
}

/// Solves `K v = ω² M v`, K symmetric positive semidefinite, M symmetric positive definite.
///
/// With `M = L Lᵀ` the problem is that of the symmetric matrix `L⁻¹ K L⁻ᵀ` (Golub & Van Loan, §8.7). Eigenvalues
/// below zero by no more than round-off, `16 n ε ‖·‖`, are taken as zero: rigid-body modes.
///
/// # Errors
/// [`EigenError`] names the defect of the matrices.
pub fn natural_modes(stiffness: &DMatrix<f64>, mass: &DMatrix<f64>) -> Result<Modes, EigenError> {
    let n = mass.nrows();
    if mass.ncols() != n || stiffness.shape() != (n, n) {
        return Err(EigenError::Shape);
    }
    let lower = Cholesky::new(mass.clone()).ok_or(EigenError::Mass)?.l();
    let half = lower.solve_lower_triangular(stiffness).ok_or(EigenError::Mass)?;
    let reduced = lower.solve_lower_triangular(&half.transpose()).ok_or(EigenError::Mass)?;
    let eigen = SymmetricEigen::new(0.5 * (&reduced + reduced.transpose()));
    let round_off = 16.0 * n as f64 * f64::EPSILON * eigen.eigenvalues.amax();
    if eigen.eigenvalues.iter().any(|&value| value < -round_off) {
        return Err(EigenError::Stiffness);
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let omega = order
        .iter()
        .map(|&i| if eigen.eigenvalues[i] <= round_off { 0.0 } else { eigen.eigenvalues[i].sqrt() })
        .collect();
    let sorted = eigen.eigenvectors.select_columns(&order);
    let shapes = lower.transpose().solve_upper_triangular(&sorted).ok_or(EigenError::Mass)?;
    Ok(Modes { omega, shapes })
}

/// Groups rising values that agree with the first of their group to `tolerance` (relative): `(value, multiplicity)`.
#[must_use]
pub fn multiplicities(values: &[f64], tolerance: f64) -> Vec<(f64, usize)> {
    let mut groups: Vec<(f64, usize)> = Vec::new();
    for &value in values {
        match groups.last_mut() {
            Some((first, count)) if value - *first <= tolerance * value.abs() => *count += 1,
            _ => groups.push((value, 1)),
        }
    }
    groups
}
