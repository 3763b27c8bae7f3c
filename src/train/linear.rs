//! The train with every contact closed: a linear structure.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::error::TrainError;
use super::spec::Spec;
use crate::linalg::{EigenError, Modes, natural_modes};

/// `K + Σ k̄_j g_j g_jᵀ`, N/m, `[n × n]`: supports and every mesh at its mean stiffness, or at the stiffnesses
/// given, one per contact (for a power law the tangent `n K^{1/n} F^{1−1/n}` at the force F).
#[must_use]
pub fn bonded_stiffness(spec: &Spec, contacts: Option<&[f64]>) -> DMatrix<f64> {
    let mut total = spec.stiffness.clone();
    for (j, contact) in spec.contacts.iter().enumerate() {
        let k = contacts.and_then(|given| given.get(j).copied()).unwrap_or_else(|| contact.stiffness.mean());
        let g = DVector::from_column_slice(&contact.direction);
        total += k * &g * g.transpose();
    }
    total
}

/// Natural modes with every contact closed at its mean stiffness; meaningful for linear laws.
///
/// # Errors
/// [`EigenError`] if the structure is unstable (centripetal terms beyond a critical speed) or a mass is missing.
pub fn bonded_modes(spec: &Spec) -> Result<Modes, EigenError> {
    natural_modes(&bonded_stiffness(spec, None), &spec.mass)
}

/// The train at rest under its constant load with every contact closed.
#[derive(Clone, Debug, PartialEq)]
pub struct Equilibrium {
    /// Coordinates q, m, `[n]`; the least ones where the structure can move freely.
    pub position: Vec<f64>,
    /// Contact forces, N, one per contact; a negative one means this contact would have to pull.
    pub forces: Vec<f64>,
}

/// Solves `(K + Σ k̄ g gᵀ) q = f₀ + Σ k̄ g (e₀ + b)` with linear contacts on the drive flank.
///
/// Free motions (eigenvalues below `16 n ε ‖·‖`) carry no load in an equilibrium; a load on one of more than
/// 1e-9 of the largest is an error.
///
/// # Errors
/// [`TrainError::Unbalanced`].
pub fn equilibrium(spec: &Spec) -> Result<Equilibrium, TrainError> {
    let n = spec.freedoms.len();
    let total = bonded_stiffness(spec, None);
    let mut load = DVector::from_column_slice(&spec.load);
    for contact in &spec.contacts {
        let push = contact.stiffness.mean() * (contact.error_offset + contact.half_backlash);
        load += push * DVector::from_column_slice(&contact.direction);
    }
    let eigen = SymmetricEigen::new(0.5 * (&total + total.transpose()));
    let floor = 16.0 * n as f64 * f64::EPSILON * eigen.eigenvalues.amax();
    let mut modal = eigen.eigenvectors.tr_mul(&load);
    let mut residual = 0.0f64;
    for (x, &value) in modal.iter_mut().zip(&eigen.eigenvalues) {
        if value.abs() <= floor {
            residual = residual.max(x.abs());
            *x = 0.0;
        } else {
            *x /= value;
        }
    }
    if residual > 1.0e-9 * load.amax() {
        return Err(TrainError::Unbalanced { residual });
    }
    let mut position = &eigen.eigenvectors * modal;
    // One step of refinement: springs of 1e10 N/m beside 1e5 N/m cost the eigenvectors their last digits.
    let correction = eigen.eigenvectors.tr_mul(&(load - &total * &position));
    let scaled = DVector::from_iterator(
        n,
        correction.iter().zip(&eigen.eigenvalues).map(|(x, v)| if v.abs() <= floor { 0.0 } else { x / v }),
    );
    position += &eigen.eigenvectors * scaled;
    let forces = spec
        .contacts
        .iter()
        .map(|contact| {
            let deflection: f64 = contact.direction.iter().zip(&position).map(|(g, q)| g * q).sum();
            contact.stiffness.mean() * (deflection - contact.error_offset - contact.half_backlash)
        })
        .collect();
    Ok(Equilibrium { position: position.iter().copied().collect(), forces })
}
