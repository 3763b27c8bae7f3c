//! Simplifications of any train.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use crate::{
    gear::{
        Piece, Stiffness,
        contact::{Law, Linear, Release, damped_restitution, restitution},
    },
    study::figures::family,
    system::{ContactSpec, Spec, Structure, equilibrium, tangent_stiffness},
    train::TrainError,
};

/// Spring and damper that replace a power law.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LinearLaw {
    /// Contact to which they belong.
    pub contact: String,
    /// Tangent stiffness under the static load, N/m.
    pub stiffness: f64,
    /// Damping with the restitution of the power law in a free impact, N s/m.
    pub damping: f64,
}

/// Returns linear laws for the power laws of a train: `k = n K^{1/n} F^{1−1/n}` under the static force F, and `c = 2 ζ √(k m)` with `m =
/// 1/(gᵀ M⁻¹ g)`. ζ follows from the restitution of a free impact, released at zero force. There are none without a force on a contact at
/// rest.
pub fn linear_laws(structure: &Structure) -> Result<Vec<LinearLaw>, TrainError> {
    let rest = equilibrium(structure.spec())?;
    let tangents = tangent_stiffness(structure.spec(), &rest);
    let mut laws = Vec::new();
    for ((contact, &stiffness), &force) in structure.contacts().iter().zip(&tangents).zip(&rest.forces) {
        let Law::Power(law) = contact.spec.law else { continue };
        if force <= 0.0 {
            let name = format!("the static force of {}", contact.spec.name);
            return Err(TrainError::Value { name, value: force, wanted: "> 0 for a tangent stiffness" });
        }
        let zeta = damping_ratio(restitution(law.hysteresis));
        let damping = 2.0 * zeta * (stiffness * contact.effective_mass()).sqrt();
        laws.push(LinearLaw { contact: contact.spec.name.clone(), stiffness, damping });
    }
    Ok(laws)
}

/// Returns the damping ratio ζ whose free impact, released at zero force, has the restitution `e`, in (0, 1].
pub fn damping_ratio(e: f64) -> f64 {
    // The restitution falls with ζ; 64 is beyond the damping of any power law of a scene.
    let (mut low, mut high) = (0.0, 64.0);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high || e >= 1.0 {
            return low;
        }
        if damped_restitution(middle, Release::Force) > e { low = middle } else { high = middle }
    }
}

/// Replaces power laws by the linear ones of their contact, or of its family.
pub fn linear(spec: &mut Spec, laws: &[LinearLaw]) {
    for contact in &mut spec.contacts {
        let same = laws.iter().find(|law| law.contact == contact.name);
        let law = same.or_else(|| laws.iter().find(|law| family(&law.contact) == family(&contact.name)));
        if let (Law::Power(_), Some(law)) = (contact.law, law) {
            contact.law = Law::KelvinVoigt(Linear { damping: law.damping }, Release::Force);
            contact.schedules_mut().for_each(|schedule| *schedule = Stiffness::Constant(law.stiffness));
        }
    }
}

/// Drops errors and harmonic loads of frequency `omega` and above, rad/s.
pub fn excitation_below(spec: &mut Spec, omega: f64) {
    spec.load_harmonics.retain(|load| load.omega < omega);
    spec.contacts.iter_mut().flat_map(ContactSpec::errors_mut).for_each(|error| error.retain(|h| h.omega < omega));
}

/// Returns the frequencies of errors and harmonic loads, rad/s, highest first.
pub fn excitations(spec: &Spec) -> Vec<f64> {
    let loads = spec.load_harmonics.iter().filter(|load| load.vector.iter().any(|f| *f != 0.0)).map(|load| load.omega);
    let errors =
        spec.contacts.iter().flat_map(ContactSpec::errors).flatten().filter(|h| h.amplitude != 0.0).map(|h| h.omega);
    falling(loads.chain(errors))
}

/// Drops stiffness harmonics of frequency `omega` and above, rad/s.
pub fn stiffness_below(spec: &mut Spec, omega: f64) {
    for schedule in spec.contacts.iter_mut().flat_map(ContactSpec::schedules_mut) {
        if let Stiffness::Harmonic { mean, harmonics } = schedule {
            harmonics.retain(|h| h.omega < omega);
            if harmonics.is_empty() {
                *schedule = Stiffness::Constant(*mean);
            }
        }
    }
}

/// Returns the frequencies of stiffness harmonics, rad/s, highest first.
pub fn stiffness_harmonics(spec: &Spec) -> Vec<f64> {
    falling(spec.contacts.iter().flat_map(ContactSpec::schedules).flat_map(|schedule| match schedule {
        Stiffness::Harmonic { harmonics, .. } => harmonics.iter().map(|h| h.omega).collect(),
        _ => Vec::new(),
    }))
}

fn falling(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values.dedup();
    values
}

/// Replaces every stiffness by its mean.
pub fn mean_stiffness(spec: &mut Spec) {
    for schedule in spec.contacts.iter_mut().flat_map(ContactSpec::schedules_mut) {
        *schedule = Stiffness::Constant(schedule.mean());
    }
}

/// Returns whether any stiffness varies.
pub fn varies(spec: &Spec) -> bool {
    spec.contacts.iter().flat_map(ContactSpec::schedules).any(|k| !matches!(k, Stiffness::Constant(_)))
}

/// Returns whether any stiffness has ramps.
pub fn has_ramps(spec: &Spec) -> bool {
    spec.contacts.iter().flat_map(ContactSpec::schedules).any(|schedule| match schedule {
        Stiffness::Periodic { pieces, .. } => pieces.iter().any(|piece| piece.slope != 0.0),
        _ => false,
    })
}

/// Replaces every ramp by a step in its middle.
pub fn stepped(spec: &mut Spec) {
    for schedule in spec.contacts.iter_mut().flat_map(ContactSpec::schedules_mut) {
        if let Stiffness::Periodic { period, origin, pieces } = schedule {
            let levels = levels(*period, pieces);
            // Pieces are counted from the first one on: the origin moves there, and stays in the first period.
            let first = levels.first().map_or(0.0, |level| level.start);
            let past = (*origin / *period + first).rem_euclid(1.0);
            *origin = if past == 0.0 { 0.0 } else { (past - 1.0) * *period };
            *pieces = levels.iter().map(|level| Piece { start: level.start - first, ..*level }).collect();
        }
    }
}

/// Returns the levels of a schedule whose ramps are steps; ramps that continue from piece to piece are one.
fn levels(period: f64, pieces: &[Piece]) -> Vec<Piece> {
    let count = pieces.len();
    let width = |i: usize| pieces.get(i + 1).map_or(1.0 + pieces[0].start, |next| next.start) - pieces[i].start;
    let end = |i: usize| pieces[i].value + pieces[i].slope * width(i) * period;
    let scale = pieces.iter().map(|piece| piece.value.abs()).fold(0.0, f64::max);
    let near = |a: f64, b: f64| (a - b).abs() <= 1.0e-9 * scale;
    let goes_on = |i: usize| {
        let before = (i + count - 1) % count;
        let slopes = [pieces[before].slope, pieces[i].slope].map(|slope| slope * period);
        slopes[1] != 0.0 && near(slopes[0], slopes[1]) && near(end(before), pieces[i].value)
    };
    let mut levels: Vec<Piece> = Vec::new();
    for i in (0..count).filter(|&i| !goes_on(i)) {
        // The ramp from here over all pieces that continue it.
        let (mut last, mut length) = (i, width(i));
        while goes_on((last + 1) % count) && (last + 1) % count != i {
            last = (last + 1) % count;
            length += width(last);
        }
        let level = |start: f64, value: f64| Piece { start: start.rem_euclid(1.0), value, slope: 0.0 };
        levels.push(level(pieces[i].start, pieces[i].value));
        if !near(pieces[i].value, end(last)) {
            levels.push(level(pieces[i].start + 0.5 * length, end(last)));
        }
    }
    levels.sort_by(|a, b| a.start.total_cmp(&b.start));
    let before = |i: usize| levels[(i + levels.len() - 1) % levels.len()].value;
    let kept: Vec<Piece> =
        (0..levels.len()).filter(|&i| !near(before(i), levels[i].value)).map(|i| levels[i]).collect();
    if kept.is_empty() { levels.into_iter().take(1).collect() } else { kept }
}

/// Projects by `q = P z`: M, C, K become `Pᵀ M P` and so on, loads and directions `Pᵀ f`, `Pᵀ g`.
fn project(spec: &mut Spec, p: &DMatrix<f64>, names: Vec<String>) {
    let reduced = |v: &[f64]| p.tr_mul(&DVector::from_column_slice(v)).as_slice().to_vec();
    let symmetric = |m: DMatrix<f64>| 0.5 * (&m + m.transpose());
    spec.mass = symmetric(p.tr_mul(&spec.mass) * p);
    spec.damping = p.tr_mul(&spec.damping) * p;
    spec.stiffness = symmetric(p.tr_mul(&spec.stiffness) * p);
    spec.load = reduced(&spec.load);
    spec.load_harmonics.iter_mut().for_each(|load| load.vector = reduced(&load.vector));
    spec.contacts.iter_mut().for_each(|contact| contact.direction = reduced(&contact.direction));
    spec.freedoms = names;
}

/// Holds freedoms at rest, except `η = u_c` of a planet that is `carried`; returns R of `q_kept = R q`.
pub fn drop(spec: &mut Spec, names: &[String], carried: bool) -> DMatrix<f64> {
    let all = spec.freedoms.clone();
    let kept: Vec<String> = all.iter().filter(|name| !names.contains(name)).cloned().collect();
    let matrix = |related: &dyn Fn(&String, &String) -> bool| {
        DMatrix::from_fn(all.len(), kept.len(), |i, j| f64::from(u8::from(related(&all[i], &kept[j]))))
    };
    let own = matrix(&|a, b| a == b);
    let follows = |a: &String, b: &String| carried && names.contains(a) && a == "eta" && b == "u_c";
    let p = matrix(&|a, b| a == b || follows(a, b));
    project(spec, &p, kept);
    own.transpose()
}

/// Separates the contacts, each with the motion `φ = m M⁻¹ g` from a push at the contact alone: one freedom, its deflection `z = gᵀ q`. It
/// has mass `m = 1/(gᵀ M⁻¹ g)`, supports `φᵀ K φ`, `φᵀ C φ` and harmonic loads `φᵀ f`. Its constant load makes the contact rest as in the
/// train; if the train has no such rest, it is `φᵀ f`.
///
/// A train with one contact and no supports is unchanged by this. Returns `R = (g₁ᵀ; g₂ᵀ; …)`.
pub fn alone(spec: &mut Spec) -> DMatrix<f64> {
    let (count, n) = (spec.contacts.len(), spec.freedoms.len());
    let restriction = DMatrix::from_fn(count, n, |j, i| spec.contacts[j].direction[i]);
    let inverse = spec.mass.clone().try_inverse().unwrap_or_else(|| DMatrix::zeros(n, n));
    let rest = equilibrium(spec).ok();
    let unit = |j: usize| (0..count).map(|i| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
    let (mut mass, mut damping) = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
    let (mut stiffness, mut load) = (DMatrix::zeros(count, count), vec![0.0; count]);
    let mut pushes = Vec::new();
    for j in 0..count {
        let g = DVector::from_column_slice(&spec.contacts[j].direction);
        let push = &inverse * &g;
        let m = g.dot(&push).recip();
        let phi = m * push;
        mass[(j, j)] = m;
        damping[(j, j)] = phi.dot(&(&spec.damping * &phi));
        stiffness[(j, j)] = phi.dot(&(&spec.stiffness * &phi));
        load[j] = match &rest {
            Some(rest) if rest.forces[j] > 0.0 || spec.contacts[j].law.is_bilateral() => {
                let z = g.dot(&DVector::from_column_slice(&rest.position));
                rest.forces[j] + stiffness[(j, j)] * z
            }
            _ => phi.dot(&DVector::from_column_slice(&spec.load)),
        };
        pushes.push(phi);
    }
    let of_harmonics = spec.load_harmonics.iter_mut().map(|load| &mut load.vector);
    for vector in of_harmonics.chain(spec.load_schedules.iter_mut().map(|load| &mut load.vector)) {
        let f = DVector::from_column_slice(vector);
        *vector = pushes.iter().map(|phi| phi.dot(&f)).collect();
    }
    let freedoms = spec.contacts.iter().map(|contact| contact.name.clone()).collect();
    let contacts =
        spec.contacts.iter().enumerate().map(|(j, c)| ContactSpec { direction: unit(j), ..c.clone() }).collect();
    *spec = Spec {
        freedoms,
        mass,
        damping,
        stiffness,
        load,
        contacts,
        bearings: vec![],
        load_harmonics: std::mem::take(&mut spec.load_harmonics),
        load_schedules: std::mem::take(&mut spec.load_schedules),
        shared: std::mem::take(&mut spec.shared),
        omega: spec.omega,
    };
    restriction
}

/// Returns a frequency as a multiple of that of the forcing, in words.
pub fn order(omega: f64, period: f64) -> String {
    let order = omega * period / TAU;
    let near = (order - order.round()).abs() < 1.0e-9 * order;
    if near { format!("{order:.0}") } else { format!("{order:.3}") }
}
