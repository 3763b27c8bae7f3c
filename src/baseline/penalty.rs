//! Train of a penalty code: one right-hand side for all modes of a mesh.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{
    Ramp,
    forcing::{ForcedContact, Forcing, Moment, Wave, wave},
};
use crate::{
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Release},
    },
    hybrid::{Clock, Instant},
    system::{Flanks, Structure},
};

/// Contact without modes.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    pub law: Law,
    pub half_backlash: f64,
    pub has_back: bool,
    /// Nonzero entries of `g` and `M⁻¹ g`.
    pub direction: Vec<(u32, f64)>,
    pub push: Vec<(u32, f64)>,
    /// Mobility `gᵀ M⁻¹ g`, 1/kg.
    pub mobility: f64,
    pub stiffness: Stiffness,
    pub stiffness_waves: Vec<Wave>,
    pub error: Vec<Wave>,
    pub error_rate: Vec<Wave>,
    pub error_offset: f64,
}

impl Contact {
    /// Returns the deflection and its rate.
    #[inline]
    pub fn deflection(&self, forced: &ForcedContact, q: &[f64], v: &[f64]) -> [f64; 2] {
        let [e, de] = forced.error;
        self.direction.iter().fold([-e, -de], |[d, r], (i, g)| [d + g * q[*i as usize], r + g * v[*i as usize]])
    }

    /// Returns the penetration beyond a flank, positive on it, and the flank's side.
    #[inline]
    pub fn penetration(&self, d: f64) -> (f64, f64) {
        if self.has_back && d < 0.0 { (-d - self.half_backlash, -1.0) } else { (d - self.half_backlash, 1.0) }
    }

    pub fn is_rigid(&self) -> bool {
        self.law.is_rigid()
    }

    /// Stores the approach speed at the end of a step, with penetration `p` on the flank of `side` and the rate `r` of the deflection.
    /// Outside contact it is the present speed: the stages of the step that enters contact need one.
    pub fn latch(&self, (p, side): (f64, f64), r: f64, touch: &mut Touch) {
        if let Law::Power(law) = self.law {
            if p <= 0.0 {
                touch.latch = r.abs().max(law.speed_floor);
            } else if !touch.touched {
                touch.latch = (side * r).max(law.speed_floor);
            }
        }
        touch.touched = p > 0.0;
    }
}

/// Train of a penalty code: `q̈ = M⁻¹ (f − C q̇ − K q − Σ g F(δ, δ̇, t))`, with F the law at the present deflection, zero inside the gap,
/// sharp or smoothed.
///
/// Laws with hysteresis use the speed at the start of the step that enters contact, and from its end on the speed there. Forces that a law
/// restricts to pushing are cut at zero. Rigid contacts have no force; a step that ends beyond a flank is mirrored in it.
#[derive(Clone, Debug)]
pub struct Penalty {
    pub(super) clock: Clock,
    pub(super) n: usize,
    /// Rows of `M⁻¹K` and `M⁻¹C`, side by side.
    pub(super) rows: Vec<Vec<(u32, f64, f64)>>,
    pub(super) load: Vec<f64>,
    pub(super) load_waves: Vec<(usize, Vec<f64>, Vec<f64>)>,
    /// Loads with a schedule, over M.
    pub(super) load_schedules: Vec<(Stiffness, Vec<f64>)>,
    pub(super) frequencies: Vec<f64>,
    pub(super) contacts: Vec<Contact>,
    /// Contacts whose stiffness or error changes in time.
    pub(super) varying: Vec<usize>,
    pub(super) ramp: Ramp,
    mass: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

/// Point of a fixed-step solution.
#[derive(Clone, Debug, Default)]
pub struct StepPoint {
    /// Coordinates, m, `[n]`.
    pub q: Vec<f64>,
    /// Velocities, m/s, `[n]`.
    pub v: Vec<f64>,
    /// The contacts.
    pub contacts: Vec<Touch>,
    pub(super) moment: Moment,
}

impl StepPoint {
    /// Returns the force of each contact, N.
    pub(super) fn forces(&self) -> impl Iterator<Item = f64> {
        self.contacts.iter().map(|touch| touch.force)
    }
}

/// Contact at a [`StepPoint`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touch {
    /// Deflection and its rate, m, m/s.
    pub deflection: [f64; 2],
    /// Force along its direction, N.
    pub force: f64,
    /// Approach speed that the contact latched last, m/s.
    pub latch: f64,
    /// Strike of a rigid contact on the step that ended here, if there was one.
    pub(super) strike: Option<Strike>,
    /// True if the contact was beyond a flank at the end of the step.
    pub(super) touched: bool,
}

/// Rigid contact found beyond a flank at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strike {
    /// +1 on the drive flank, −1 on the back flank.
    pub side: f64,
    /// Place on the step, `[0, 1]`, at which the straight line between the deflections passes the flank.
    pub place: f64,
}

fn entries(values: &[f64]) -> Vec<(u32, f64)> {
    values.iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(i, v)| (i as u32, *v)).collect()
}

impl Penalty {
    /// Returns the penalty form of a train that was assembled for the engine.
    #[must_use]
    pub fn new(structure: &Structure, ramp: Ramp) -> Self {
        let spec = structure.spec();
        let n = spec.freedoms.len();
        let mass = Cholesky::new(spec.mass.clone()).expect("a structure has a positive definite mass matrix");
        let over_mass = |v: &[f64]| mass.solve(&DVector::from_column_slice(v)).as_slice().to_vec();
        let mut frequencies = Vec::new();
        let load_waves = spec.load_harmonics.iter().map(|l| {
            let (i, c, s) = wave(&Harmonic { omega: l.omega, amplitude: 1.0, phase: l.phase }, 1.0, &mut frequencies);
            let a = over_mass(&l.vector);
            (i, a.iter().map(|a| a * c).collect(), a.iter().map(|a| a * s).collect())
        });
        let load_waves = load_waves.collect();
        let contacts = spec.contacts.iter().map(|c| {
            let error: Vec<Wave> = c.error.iter().map(|h| wave(h, 1.0, &mut frequencies)).collect();
            let rate = |(i, cosine, sine): &Wave| (*i, frequencies[*i] * sine, -frequencies[*i] * cosine);
            let error_rate = error.iter().map(rate).collect();
            let push = over_mass(&c.direction);
            let stiffness_waves = match &c.stiffness {
                Stiffness::Harmonic { mean, harmonics } => {
                    harmonics.iter().map(|h| wave(h, *mean, &mut frequencies)).collect()
                }
                _ => Vec::new(),
            };
            Contact {
                law: c.law,
                half_backlash: c.half_backlash,
                has_back: c.flanks == Flanks::Both,
                direction: entries(&c.direction),
                mobility: c.direction.iter().zip(&push).map(|(g, p)| g * p).sum(),
                push: entries(&push),
                stiffness: c.stiffness.clone(),
                stiffness_waves,
                error,
                error_rate,
                error_offset: c.error_offset,
            }
        });
        let contacts: Vec<Contact> = contacts.collect();
        let varies = |c: &Contact| !matches!(c.stiffness, Stiffness::Constant(_)) || !c.error.is_empty();
        let (k, c) = (mass.solve(&spec.stiffness), mass.solve(&spec.damping));
        let row = |i: usize| {
            let entries = (0..n).map(|j| (j as u32, k[(i, j)], c[(i, j)]));
            entries.filter(|(_, k, c)| *k != 0.0 || *c != 0.0).collect()
        };
        Self {
            clock: *structure.clock(),
            n,
            rows: (0..n).map(row).collect(),
            load: over_mass(&spec.load),
            load_waves,
            load_schedules: spec.load_schedules.iter().map(|l| (l.factor.clone(), over_mass(&l.vector))).collect(),
            frequencies,
            varying: (0..contacts.len()).filter(|j| varies(&contacts[*j])).collect(),
            contacts,
            ramp,
            mass: spec.mass.clone(),
            stiffness: spec.stiffness.clone(),
        }
    }

    /// Returns the number of contacts.
    pub(crate) fn contacts(&self) -> usize {
        self.contacts.len()
    }

    /// Returns for each contact whether it is rigid.
    pub(crate) fn rigid(&self) -> Vec<bool> {
        self.contacts.iter().map(Contact::is_rigid).collect()
    }

    /// Returns the force of a contact at deflection `d`, m, and rate `r`, m/s, with stiffness `k` and latched speed `latch`. Also returns
    /// its derivatives by d and by r, which implicit methods need.
    #[inline(always)]
    pub(super) fn law(&self, c: &Contact, k: f64, [d, r]: [f64; 2], latch: f64) -> (f64, f64, f64) {
        let (law, b) = (&c.law, c.half_backlash);
        if let Law::Bilateral(l) = law {
            return (k * d + l.damping * r, k, l.damping);
        }
        if self.ramp == Ramp::Sharp {
            // On one flank at most. The back flank is the mirror image of the drive flank.
            let (p, side) = c.penetration(d);
            if p <= 0.0 {
                return (0.0, 0.0, 0.0);
            }
            let (force, by_d, by_r) = self.one_flank(law, k, p, side * r, latch);
            return (side * force, by_d, by_r);
        }
        let drive = self.one_flank(law, k, d - b, r, latch);
        if !c.has_back {
            return drive;
        }
        let back = self.one_flank(law, k, -d - b, -r, latch);
        (drive.0 - back.0, drive.1 + back.1, drive.2 + back.2)
    }

    /// Returns force and derivatives on one flank, by its penetration and the rate of that.
    #[inline(always)]
    fn one_flank(&self, law: &Law, k: f64, p: f64, rate: f64, latch: f64) -> (f64, f64, f64) {
        let [depth, closed, curvature] = self.ramp.at(p);
        match law {
            Law::KelvinVoigt(l, release) => {
                let c = l.damping;
                let force = k * depth + c * rate * closed;
                if *release == Release::Force && force < 0.0 {
                    return (0.0, 0.0, 0.0);
                }
                (force, k * closed + c * rate * curvature, c * closed)
            }
            Law::Power(l) => {
                let depth = depth.max(0.0);
                let n = l.exponent.value();
                // Exact comparison: 1.5 comes from the scene.
                let lower = if n == 1.5 { depth.sqrt() } else { libm::pow(depth, n - 1.0) };
                let chi = if l.hysteresis > 0.0 { l.hysteresis / latch } else { 0.0 };
                let factor = 1.0 + chi * rate;
                if factor < 0.0 {
                    return (0.0, 0.0, 0.0);
                }
                let elastic = k * depth * lower;
                (elastic * factor, n * k * lower * closed * factor, elastic * chi)
            }
            Law::Rigid(_) | Law::Bilateral(_) => (0.0, 0.0, 0.0),
        }
    }

    /// Returns the point with coordinates `q` and velocities `v`, `[n]` each, at an instant, in the state of a run that starts there.
    #[must_use]
    pub fn point(&self, at: Instant, q: &[f64], v: &[f64]) -> StepPoint {
        let initial = |c: &Contact| c.law.power().map_or(0.0, |l| l.initial_speed);
        let contacts = self.contacts.iter().map(|c| Touch { latch: initial(c), ..Touch::default() }).collect();
        let mut point = StepPoint { q: q.to_vec(), v: v.to_vec(), contacts, moment: self.moment() };
        Forcing::new(self, at, 0.0).moment(self, &mut point.moment);
        // A start beyond a flank latches nothing: the scene gives the speed at the start of contact.
        self.find_touched(&mut point);
        self.arrive(&mut point);
        point
    }

    /// Sets `touched` of every contact: true beyond a flank.
    pub(super) fn find_touched(&self, point: &mut StepPoint) {
        for ((c, forced), touch) in self.contacts.iter().zip(&point.moment.contacts).zip(&mut point.contacts) {
            touch.touched = c.penetration(c.deflection(forced, &point.q, &point.v)[0]).0 > 0.0;
        }
    }

    pub(super) fn moment(&self) -> Moment {
        let constant = |c: &Contact| ForcedContact {
            stiffness: if let Stiffness::Constant(k) = c.stiffness { k } else { 0.0 },
            error: [c.error_offset, 0.0],
        };
        Moment { contacts: self.contacts.iter().map(constant).collect(), load: self.load.clone() }
    }

    /// Computes forces at a state inside a step.
    #[inline]
    pub(super) fn forces(&self, moment: &Moment, q: &[f64], v: &[f64], touches: &[Touch], force: &mut [f64]) {
        let contacts = self.contacts.iter().zip(&moment.contacts).zip(touches);
        for (((c, forced), touch), f) in contacts.zip(force) {
            *f = self.law(c, forced.stiffness, c.deflection(forced, q, v), touch.latch).0;
        }
    }

    /// Computes accelerations under contact forces, m/s², `[n]`.
    #[inline]
    pub(super) fn accelerations(
        &self,
        moment: &Moment,
        q: &[f64],
        v: &[f64],
        force: impl IntoIterator<Item = f64>,
        a: &mut [f64],
    ) {
        for ((a, load), row) in a.iter_mut().zip(&moment.load).zip(&self.rows) {
            *a = row.iter().fold(*load, |a, (j, k, c)| a - k * q[*j as usize] - c * v[*j as usize]);
        }
        for (c, f) in self.contacts.iter().zip(force) {
            if f != 0.0 {
                c.push.iter().for_each(|(i, p)| a[*i as usize] -= p * f);
            }
        }
    }

    /// Completes the end of a step: deflections, impacts of rigid contacts, latched speeds, forces.
    pub(super) fn arrive(&self, point: &mut StepPoint) {
        let StepPoint { q, v, contacts, moment } = point;
        let mut struck = false;
        for ((c, forced), touch) in self.contacts.iter().zip(&moment.contacts).zip(contacts.iter_mut()) {
            let mut at = c.deflection(forced, q, v);
            let (p, side) = c.penetration(at[0]);
            touch.strike = None;
            c.latch((p, side), at[1], touch);
            if let Law::Rigid(law) = &c.law
                && p > 0.0
                && side * at[1] > 0.0
            {
                // Mirrored in the flank: as far back as the rebound speed would have moved it.
                let back = (1.0 + law.restitution.at(side * at[1])) / c.mobility;
                for (i, push) in &c.push {
                    q[*i as usize] -= push * back * side * p;
                    v[*i as usize] -= push * back * at[1];
                }
                let before = c.half_backlash - side * touch.deflection[0];
                struck = true;
                touch.strike = Some(Strike { side, place: (before / (before + p)).clamp(0.0, 1.0) });
                at = c.deflection(forced, q, v);
            }
            touch.deflection = at;
            touch.force = self.law(c, forced.stiffness, at, touch.latch).0;
        }
        if struck {
            // The impact of one contact moves the others.
            for ((c, forced), touch) in self.contacts.iter().zip(&moment.contacts).zip(contacts.iter_mut()) {
                touch.deflection = c.deflection(forced, q, v);
                touch.force = self.law(c, forced.stiffness, touch.deflection, touch.latch).0;
            }
        }
    }

    /// Returns the mechanical energy, J: kinetic, of the structure, and of the springs (sharp penetrations).
    #[must_use]
    pub fn energy(&self, point: &StepPoint) -> f64 {
        let (q, v) = (DVector::from_column_slice(&point.q), DVector::from_column_slice(&point.v));
        let springs = self.contacts.iter().enumerate().map(|(j, c)| {
            let (d, k) = (point.contacts[j].deflection[0], point.moment.contacts[j].stiffness);
            let p = c.penetration(d).0.max(0.0);
            match c.law {
                Law::Bilateral(_) => 0.5 * k * d * d,
                Law::KelvinVoigt(..) => 0.5 * k * p * p,
                Law::Power(l) => k * libm::pow(p, l.exponent.value() + 1.0) / (l.exponent.value() + 1.0),
                Law::Rigid(_) => 0.0,
            }
        });
        0.5 * v.dot(&(&self.mass * &v)) + 0.5 * q.dot(&(&self.stiffness * &q)) + springs.sum::<f64>()
    }
}
