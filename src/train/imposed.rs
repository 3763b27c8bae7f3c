//! Degrees of freedom with a given motion.

use nalgebra::DVector;

use crate::{
    gear::Harmonic,
    system::{LoadHarmonic, Spec},
};

/// Removes the degrees of freedom after the named ones; number `i` moves by the sum of `motions[i]`, each `a cos(ω t + φ)`.
///
/// The other degrees of freedom receive `−M_k ü − C_k u̇ − K_k u` of each removed one k, and each contact the error `−g_k u`.
pub(super) fn impose(mut spec: Spec, motions: &[Vec<Harmonic>]) -> Spec {
    let n = spec.freedoms.len();
    let mut loads = Vec::new();
    for (i, motion) in motions.iter().enumerate() {
        let of = |matrix: &nalgebra::DMatrix<f64>| -> DVector<f64> { matrix.column(n + i).rows(0, n).into_owned() };
        let (mass, damping, stiffness) = (of(&spec.mass), of(&spec.damping), of(&spec.stiffness));
        for h in motion {
            let in_phase = (&mass * (h.omega * h.omega) - &stiffness) * h.amplitude;
            // The derivative of the cosine is a cosine a quarter turn ahead.
            let ahead = &damping * (-h.omega * h.amplitude);
            for (vector, phase) in [(in_phase, h.phase), (ahead, h.phase + std::f64::consts::FRAC_PI_2)] {
                if vector.iter().any(|x| *x != 0.0) {
                    loads.push(LoadHarmonic { vector: vector.iter().copied().collect(), omega: h.omega, phase });
                }
            }
            for contact in spec.contacts.iter_mut().filter(|contact| contact.direction[n + i] != 0.0) {
                let amplitude = -contact.direction[n + i] * h.amplitude;
                contact.errors_mut().for_each(|error| error.push(Harmonic { amplitude, ..*h }));
            }
        }
    }
    let kept = |matrix: nalgebra::DMatrix<f64>| matrix.view((0, 0), (n, n)).into_owned();
    spec.load_harmonics.iter_mut().for_each(|load| load.vector.truncate(n));
    spec.load_harmonics.extend(loads);
    spec.load_schedules.iter_mut().for_each(|load| load.vector.truncate(n));
    spec.contacts.iter_mut().for_each(|contact| contact.direction.truncate(n));
    // The force would contain a part of the given motion, which is not in the state.
    spec.bearings.retain(|bearing| bearing.springs.iter().all(|s| s.direction[n..].iter().all(|d| *d == 0.0)));
    spec.bearings.iter_mut().flat_map(|b| &mut b.springs).for_each(|spring| spring.direction.truncate(n));
    spec.load.truncate(n);
    Spec { mass: kept(spec.mass), damping: kept(spec.damping), stiffness: kept(spec.stiffness), ..spec }
}
