//! The structure with every contact closed, at rest or in small motions.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::{ContactSpec, Flanks, Spec, spec::sum_at};
use crate::{
    gear::contact::PowerLaw,
    linalg::{EigenError, Modes, natural_modes},
};

/// Returns `K + Σ k̄_j g_j g_jᵀ`, N/m, `[n × n]`: supports and every mesh at its mean stiffness, or at the given stiffnesses, one per
/// contact (as from [`tangent_stiffness`]).
#[must_use]
pub fn bonded_stiffness(spec: &Spec, contacts: Option<&[f64]>) -> DMatrix<f64> {
    let mut total = spec.stiffness.clone();
    for (j, contact) in spec.contacts.iter().enumerate() {
        let k = contacts.and_then(|given| given.get(j).copied()).unwrap_or_else(|| contact.stiffness.mean());
        let g = DVector::from_column_slice(&contact.direction);
        // The product of directions first: symmetric to the last bit.
        total += k * (&g * g.transpose());
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
    /// Coordinates q, m, `[n]`; those of least norm if the structure can move freely.
    pub position: Vec<f64>,
    /// Contact forces, N, one per contact; a negative force means that the contact would have to pull.
    pub forces: Vec<f64>,
}

impl Equilibrium {
    /// Returns whether contact `j` would have to pull on its flank, by more than 1e-9 of the largest force.
    #[must_use]
    pub fn pulls(&self, spec: &Spec, is_back: &[bool], j: usize) -> bool {
        let largest = self.forces.iter().fold(0.0, |m: f64, force| m.max(force.abs()));
        let push = if is_back[j] { -self.forces[j] } else { self.forces[j] };
        !spec.contacts[j].law.is_bilateral() && push < -1e-9 * largest
    }
}

/// Reason for which there is no [`Equilibrium`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EquilibriumError {
    /// The loads do not balance on a structure that can move freely.
    #[error("no equilibrium: the loads leave {residual} N unbalanced on free motions")]
    Unbalanced {
        /// Largest unbalanced force, N.
        residual: f64,
    },
    /// The force of a rigid contact has no stiffness.
    #[error("{contact}: contact stiffness is inf; it must be finite for an equilibrium")]
    Rigid {
        /// Name of the contact.
        contact: String,
    },
}

/// Solves `K q + Σ g F(gᵀq − e₀ − b) = f₀` for contacts on their drive flanks at mean stiffness: `F = k̄ p` for linear laws, `F = K |p|ⁿ
/// sign p` for power laws (Newton's method). Every law is continued to p < 0 as if it could pull, so that "closed" has one meaning: an
/// unloaded contact lies on its flank.
///
/// Free motions (eigenvalues below `16 n ε ‖·‖`) carry no load in an equilibrium.
///
/// # Errors
/// [`EquilibriumError::Unbalanced`] if more than 1e-9 of the largest load (and rounding) remains (a load on a free motion);
/// [`EquilibriumError::Rigid`] for a rigid contact, whose force has no stiffness.
pub fn equilibrium(spec: &Spec) -> Result<Equilibrium, EquilibriumError> {
    let load = DVector::from_column_slice(&spec.resting_load());
    let scale = load.amax();
    let mut penetrations = Vec::with_capacity(spec.contacts.len());
    for contact in &spec.contacts {
        // From above, Newton's method descends on a convex force without overshooting.
        if contact.law.is_rigid() {
            return Err(EquilibriumError::Rigid { contact: contact.name.clone() });
        }
        penetrations.push(contact.law.power().map_or(0.0, |law| loaded(contact, law, scale)));
    }
    let directions: Vec<_> = spec.contacts.iter().map(|c| DVector::from_column_slice(&c.direction)).collect();
    if let Some(position) = unloaded(spec, &directions).filter(|_| scale == 0.0) {
        return Ok(Equilibrium {
            position: position.iter().copied().collect(),
            forces: vec![0.0; spec.contacts.len()],
        });
    }
    // The forces of flanks away from the origin cancel; their rounding does not.
    let flanks = spec.contacts.iter().zip(&directions).map(|(contact, g)| {
        (contact.stiffness.mean() * (contact.error_offset + contact.half_backlash)).abs() * g.amax()
    });
    let allowed = f64::max(1.0e-9 * scale, 64.0 * f64::EPSILON * flanks.fold(0.0, f64::max));
    let mut best: Option<(f64, DVector<f64>)> = None;
    loop {
        let forces: Vec<[f64; 2]> = spec.contacts.iter().zip(&penetrations).map(|(c, &p)| force(c, p, scale)).collect();
        let tangents: Vec<f64> = forces.iter().map(|f| f[1]).collect();
        let mut push = load.clone();
        for ((contact, g), ([f, k], p)) in spec.contacts.iter().zip(&directions).zip(forces.iter().zip(&penetrations)) {
            push += (k * (p + contact.error_offset + contact.half_backlash) - f) * g;
        }
        let position = least_solution(&bonded_stiffness(spec, Some(&tangents)), &push);
        let mut rest = &load - &spec.stiffness * &position;
        for ((contact, g), p) in spec.contacts.iter().zip(&directions).zip(&mut penetrations) {
            *p = g.dot(&position) - contact.error_offset - contact.half_backlash;
            rest -= force(contact, *p, scale)[0] * g;
        }
        let residual = rest.amax();
        // The iteration ends where round-off stops the descent.
        match &best {
            Some((least, position)) if residual >= *least => {
                if *least > allowed {
                    return Err(EquilibriumError::Unbalanced { residual: *least });
                }
                let forces = spec
                    .contacts
                    .iter()
                    .zip(&directions)
                    .map(|(c, g)| force(c, g.dot(position) - c.error_offset - c.half_backlash, scale)[0])
                    .collect();
                return Ok(Equilibrium { position: position.iter().copied().collect(), forces });
            }
            _ if residual.is_nan() => return Err(EquilibriumError::Unbalanced { residual }),
            _ => best = Some((residual, position)),
        }
    }
}

/// Returns the [`equilibrium`] with each contact on the flank that the load presses, and for each whether that is its back flank. A contact
/// that pulls on one flank is moved to the other. Without convergence all stay on their drive flanks, and some pull.
///
/// # Errors
/// [`EquilibriumError`], for the same reasons as [`equilibrium`].
pub fn pressed(spec: &Spec) -> Result<(Equilibrium, Vec<bool>), EquilibriumError> {
    let on_drive = equilibrium(spec)?;
    let mut turned = spec.clone();
    let mut is_back = vec![false; spec.contacts.len()];
    let mut at = on_drive.clone();
    for _ in 0..=spec.contacts.len() {
        let pulling: Vec<usize> = (0..is_back.len())
            .filter(|j| turned.contacts[*j].flanks == Flanks::Both && at.pulls(&turned, &is_back, *j))
            .collect();
        if pulling.is_empty() {
            return Ok((at, is_back));
        }
        for j in pulling {
            is_back[j] = !is_back[j];
            exchange(&mut turned.contacts[j]);
        }
        at = equilibrium(&turned)?;
    }
    let len = is_back.len();
    Ok((on_drive, vec![false; len]))
}

/// Exchanges the places of the flanks of a contact.
fn exchange(contact: &mut ContactSpec) {
    contact.half_backlash *= -1.0;
    if let Some(back) = &mut contact.back {
        std::mem::swap(&mut contact.stiffness, &mut back.stiffness);
        std::mem::swap(&mut contact.error, &mut back.error);
        std::mem::swap(&mut contact.error_offset, &mut back.error_offset);
    }
}

/// Returns the state that follows the errors at time `t`, s, without inertia, and its velocities. Flanks are [`pressed`] with the errors of
/// that time, and `(K + Σ k_j g_j g_jᵀ) q̇ = Σ k_j g_j ė_j` with the [`tangent_stiffness`] k_j. Loads keep their means.
///
/// # Errors
/// [`EquilibriumError`], for the same reasons as [`equilibrium`].
pub fn quasi_static(spec: &Spec, t: f64) -> Result<(Equilibrium, Vec<bool>, Vec<f64>), EquilibriumError> {
    let mut moved = spec.clone();
    for contact in &mut moved.contacts {
        contact.error_offset += contact.error_at(t)[0];
        if let Some(back) = &mut contact.back {
            back.error_offset += sum_at(&back.error, t)[0];
        }
    }
    let (at, is_back) = pressed(&moved)?;
    moved.contacts.iter_mut().zip(&is_back).filter(|(_, is_back)| **is_back).for_each(|(c, _)| exchange(c));
    let stiffness = tangent_stiffness(&moved, &at);
    let mut push = DVector::zeros(spec.freedoms.len());
    for (contact, k) in moved.contacts.iter().zip(&stiffness) {
        push += k * contact.error_at(t)[1] * DVector::from_column_slice(&contact.direction);
    }
    let velocity = least_solution(&bonded_stiffness(&moved, Some(&stiffness)), &push);
    Ok((at, is_back, velocity.iter().copied().collect()))
}

/// Returns the stiffness of every contact for small motions about an equilibrium, N/m: the mean stiffness of a linear law, `n K^{1/n}
/// F^{1−1/n}` of a power law under the force F (0 if nothing presses on it).
#[must_use]
pub fn tangent_stiffness(spec: &Spec, at: &Equilibrium) -> Vec<f64> {
    let tangent = |(c, force): (&ContactSpec, &f64)| c.law.slope(c.stiffness.mean(), *force);
    spec.contacts.iter().zip(&at.forces).map(tangent).collect()
}

/// Places all contacts on their flanks by unsupported coordinates alone, without any force; `None` if that does not close them.
fn unloaded(spec: &Spec, directions: &[DVector<f64>]) -> Option<DVector<f64>> {
    let is_free = |i: usize| spec.stiffness.row(i).iter().chain(&spec.stiffness.column(i)).all(|k| *k == 0.0);
    let free = DVector::from_fn(spec.freedoms.len(), |i, _| f64::from(u8::from(is_free(i))));
    let (mut a, mut b) = (DMatrix::zeros(free.len(), free.len()), DVector::zeros(free.len()));
    for (contact, g) in spec.contacts.iter().zip(directions) {
        let g = g.component_mul(&free);
        a += &g * g.transpose();
        b += (contact.error_offset + contact.half_backlash) * g;
    }
    let position = least_solution(&a, &b).component_mul(&free);
    let is_closed = |(contact, g): (&ContactSpec, &DVector<f64>)| {
        let (place, reach) = (contact.error_offset + contact.half_backlash, g.abs().dot(&position.abs()));
        (g.dot(&position) - place).abs() <= 64.0 * f64::EPSILON * (place.abs() + reach)
    };
    spec.contacts.iter().zip(directions).all(is_closed).then_some(position)
}

/// Returns the penetration of a power law under the whole load.
fn loaded(contact: &ContactSpec, law: PowerLaw, load: f64) -> f64 {
    libm::pow(load / contact.stiffness.mean(), law.exponent.value().recip())
}

/// Returns the force, N, and its slope, N/m, at penetration p, m, on the drive flank, at mean stiffness. Near p = 0 the slope of a power
/// law is replaced by that of a chord: below a millionth of the penetration under the whole load, or everywhere without load.
fn force(contact: &ContactSpec, p: f64, load: f64) -> [f64; 2] {
    let k = contact.stiffness.mean();
    match contact.law.power().filter(|_| load > 0.0) {
        Some(law) => {
            let n = law.exponent.value();
            let least = 1.0e-6 * loaded(contact, law, load);
            let chord = k * libm::pow(p.abs().max(least), n - 1.0);
            [chord * p, if p.abs() < least { chord } else { n * chord }]
        }
        None => [k * p, k],
    }
}

/// Returns the shortest `x` with `A x = b` on the range of the symmetric matrix A, with one step of refinement: springs of 1e10 N/m beside
/// 1e5 N/m cost the eigenvectors their last digits.
fn least_solution(a: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let eigen = SymmetricEigen::new(a.clone());
    let floor = 16.0 * a.nrows() as f64 * f64::EPSILON * eigen.eigenvalues.amax();
    let solve = |b: &DVector<f64>| {
        let mut x = eigen.eigenvectors.tr_mul(b);
        for (x, &value) in x.iter_mut().zip(&eigen.eigenvalues) {
            *x = if value.abs() <= floor { 0.0 } else { *x / value };
        }
        &eigen.eigenvectors * x
    };
    let first = solve(b);
    let correction = solve(&(b - a * &first));
    first + correction
}
