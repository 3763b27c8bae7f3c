//! Assembly of a [`Spec`] into a [`Structure`]: all data of a step, computed once.

use std::collections::HashMap;

use nalgebra::DVector;
use smallvec::{SmallVec, smallvec};

use super::{
    ContactSpec, Flanks, LoadSchedule, Spec, check::AssembleError, columns::VectorColumns, contact_mode::contact_mode,
    schedule::Schedule, symmetry::Symmetry, twofold::conserves,
};
use crate::{
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear},
    },
    hybrid::{Clock, ContactMode, Instant, Mode, Wide},
    linalg::Inverse,
    vectors::Instructions,
};

/// One value for each contact, or for some contacts. Up to 16 need no allocation.
pub(crate) type PerContact<T> = SmallVec<[T; 16]>;

/// A zero for each of `count` contacts.
pub(crate) fn zeros(count: usize) -> PerContact<f64> {
    smallvec![0.0; count]
}

/// A sparse vector: pairs of degree of freedom and value.
pub(crate) type Sparse = Vec<(u32, f64)>;

fn sparse<'a>(values: impl IntoIterator<Item = &'a f64>) -> Sparse {
    values.into_iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(i, v)| (i as u32, *v)).collect()
}

/// `Σ row_i x_i`.
pub(crate) fn dot(row: &Sparse, x: &[f64]) -> f64 {
    row.iter().fold(0.0, |s, (i, g)| s + g * x[*i as usize])
}

/// Returns `Σ row_i x_i`, rounded once if x has two doubles: the terms of an ill-conditioned mass matrix cancel.
fn along(row: &Sparse, x: &[Wide]) -> f64 {
    if x.iter().all(|x| x.lo == 0.0) {
        return row.iter().fold(0.0, |sum, (i, g)| sum + g * x[*i as usize].hi);
    }
    row.iter().fold(Wide::default(), |sum, (i, g)| sum + x[*i as usize] * *g).value()
}

/// One frequency of the forcing; its phase is evaluated once a step and shared by all harmonics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Oscillator {
    pub omega: f64,
    /// `Some(h)` if `ω = h ω₀` exactly, with ω₀ the clock's.
    pub order: Option<u32>,
}

/// `cosine · cos ωt + sine · sin ωt` for the oscillator at `index`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wave {
    pub index: usize,
    pub cosine: f64,
    pub sine: f64,
}

impl Wave {
    /// Returns the time derivative.
    pub fn rate(&self, omega: f64) -> Self {
        Self { index: self.index, cosine: omega * self.sine, sine: -omega * self.cosine }
    }
}

/// A harmonic load over M, `cosine cos ωt + sine sin ωt`, as accelerations, m/s².
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LoadWave {
    pub index: usize,
    pub cosine: Vec<f64>,
    pub sine: Vec<f64>,
}

impl LoadWave {
    /// `max_i √M_ii |a_i|` with `√M_ii` in `weights`.
    pub fn size(&self, weights: &[f64]) -> f64 {
        let amplitudes = self.cosine.iter().zip(&self.sine).map(|(c, s)| libm::hypot(*c, *s));
        amplitudes.zip(weights).fold(0.0, |m: f64, (a, w)| m.max(a * w))
    }
}

/// The stiffness of one contact, ready to be expanded.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Spring {
    Constant(f64),
    /// `mean + Σ waves` (waves in N/m).
    Waves(f64, Vec<Wave>),
    Scheduled(Schedule),
}

/// One element of a [`Structure`]: a contact, the back flank of a contact, or a load with a schedule.
///
/// A back flank with different data is the drive flank of a reversed element, after the contacts in the list. A load is an element without
/// a direction. Its deflection is constantly 1, so that the force of its spring `k(t) δ` is the factor of the load. It acts in every mode,
/// has no guard, and comes after all flanks.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Specification of the element.
    pub spec: ContactSpec,
    pub(crate) direction: Sparse,
    /// `M⁻¹ g`.
    pub(crate) push: Sparse,
    /// `gᵀ M⁻¹ g`, 1/kg: the inverse of the effective mass of the contact.
    pub(crate) mobility: f64,
    /// `Σ |g_i|/√M_ii`: largest contribution of a unit weighted rate to the rate of the contact.
    pub(crate) across: f64,
    /// `max √M_ii |M⁻¹g|_i`: weighted acceleration by a unit force.
    pub(crate) push_norm: f64,
    /// Sum of the amplitudes, N/m, and fastest frequency, rad/s, of a stiffness with oscillators.
    pub(crate) swing: (f64, f64),
    pub(crate) error: Vec<Wave>,
    /// `ė` as waves.
    pub(crate) error_rate: Vec<Wave>,
    /// Largest stiffness of its schedule, N/m.
    pub(crate) stiffest: f64,
    /// Sums of the sizes of all terms of e, m, ė, m/s, and ë, m/s².
    pub(crate) error_sizes: [f64; 3],
    /// `1/√(gᵀM⁻¹g)`: makes the rate of the contact comparable with weighted rates.
    pub(crate) weight: f64,
    pub(crate) spring: Spring,
    /// `gᵀ M⁻¹ g_j` of every contact j, 1/kg: the acceleration of this contact by a unit force of contact j.
    pub(crate) couplings: Vec<f64>,
    /// Index of the latched approach speed in the state, if any.
    pub(crate) latch: Option<usize>,
    /// Index of the element of its back flank, if that differs.
    pub(crate) back: Option<usize>,
}

impl Contact {
    /// Returns the effective mass of the contact, `1/(gᵀ M⁻¹ g)`, kg.
    #[must_use]
    pub fn effective_mass(&self) -> f64 {
        1.0 / self.mobility
    }

    /// Returns the index of the latched approach speed in the state, if its law has one.
    #[must_use]
    pub fn latch(&self) -> Option<usize> {
        self.latch
    }

    /// Returns the element of load number `i`, with acceleration `−accelerations` times its factor.
    fn loading(i: usize, load: &LoadSchedule, (accelerations, weights): (&[Wide], &[f64]), clock: &Clock) -> Self {
        let push: Vec<f64> = accelerations.iter().map(|p| p.value()).collect();
        let n = push.len();
        let spec = ContactSpec {
            name: format!("load {}", i + 1),
            direction: vec![0.0; n],
            error: Vec::new(),
            error_offset: -1.0,
            half_backlash: 0.0,
            flanks: Flanks::Drive,
            stiffness: load.factor.clone(),
            law: Law::Bilateral(Linear { damping: 0.0 }),
            gap_damping: 0.0,
            back: None,
        };
        Self {
            direction: Sparse::new(),
            mobility: 0.0,
            across: 0.0,
            push_norm: push.iter().zip(weights).fold(0.0, |m: f64, (p, w)| m.max(p.abs() * w)),
            push: sparse(&push),
            swing: (0.0, 0.0),
            error: Vec::new(),
            error_rate: Vec::new(),
            stiffest: load.factor.maximum(),
            error_sizes: [0.0; 3],
            weight: 1.0,
            spring: Spring::Scheduled(Schedule::new(&load.factor, clock)),
            couplings: Vec::new(),
            latch: None,
            back: None,
            spec,
        }
    }

    pub(crate) fn gap(&self) -> f64 {
        self.spec.half_backlash
    }

    /// Returns the deflection, m, at which the spring is unstretched on the side of its flank: the gap, but zero for a bilateral mesh.
    pub(crate) fn offset(&self) -> f64 {
        if self.spec.law.is_bilateral() { 0.0 } else { self.gap() }
    }

    pub(crate) fn has_back(&self) -> bool {
        self.spec.flanks == Flanks::Both
    }
}

/// An assembled train: state `x = (q, q̇, latched speeds)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    pub(crate) spec: Spec,
    pub(crate) n: usize,
    pub(crate) dim: usize,
    pub(crate) clock: Clock,
    pub(crate) oscillators: Vec<Oscillator>,
    /// `M⁻¹ f₀`.
    pub(crate) load: Vec<f64>,
    /// Sums of the sizes of the loads over M, m/s², and of the stiffnesses over M, 1/s², for each degree of freedom.
    pub(crate) pulls: Vec<[f64; 2]>,
    pub(crate) load_waves: Vec<LoadWave>,
    /// Columns of M, of the symmetric part of C (the rest does no work), and of K.
    pub(crate) forms: [Vec<Sparse>; 3],
    /// Rows of `M⁻¹ K` and `M⁻¹ C` together: column, stiffness, damping.
    pub(crate) rows: Vec<Vec<(u32, f64, f64)>>,
    pub(crate) columns: VectorColumns,
    /// Contacts, back flanks with different data, and loads with schedules.
    pub(crate) contacts: Vec<Contact>,
    /// Contacts of those back flanks.
    pub(crate) back_of: Vec<usize>,
    /// `√M_ii`, the weights that make different kinds of degrees of freedom comparable.
    pub(crate) weights: Vec<f64>,
    /// Classes of equal degrees of freedom and contacts.
    pub(crate) symmetry: Symmetry,
    /// True without forcing and losses: errors then never decay, and the state keeps its low part.
    pub(crate) is_conservative: bool,
    /// Instruction set for the sums of its series.
    pub(crate) instructions: Instructions,
}

impl Structure {
    /// Assembles a train.
    ///
    /// # Errors
    /// [`AssembleError`] as [`Spec::check`].
    pub fn new(spec: Spec) -> Result<Self, AssembleError> {
        let n = spec.freedoms.len();
        spec.check()?;
        let spec = spec.with_gap_dampers();
        let back_of: Vec<usize> = (0..spec.contacts.len()).filter(|j| spec.contacts[*j].back.is_some()).collect();
        let flanks: Vec<ContactSpec> = spec.flanks().collect();
        let inverse = Inverse::new(&spec.mass).ok_or(AssembleError::Mass)?;
        let (clock, oscillators, places) = find_oscillators(&spec);
        let wave = |h: &Harmonic, scale: f64| Wave {
            // OK to index: `find_oscillators` collected every frequency of the spec.
            index: places[&h.omega.to_bits()],
            cosine: scale * h.amplitude * libm::cos(h.phase),
            sine: -scale * h.amplitude * libm::sin(h.phase),
        };
        let load_waves: Vec<LoadWave> = spec
            .load_harmonics
            .iter()
            .map(|l| {
                let w = wave(&Harmonic { omega: l.omega, amplitude: 1.0, phase: l.phase }, 1.0);
                let a = inverse.solve(&l.vector);
                LoadWave {
                    index: w.index,
                    cosine: a.iter().map(|v| v * w.cosine).collect(),
                    sine: a.iter().map(|v| v * w.sine).collect(),
                }
            })
            .collect();
        let weights: Vec<f64> = (0..n).map(|i| spec.mass[(i, i)].sqrt()).collect();
        let mut dim = 2 * n;
        let mut contacts = Vec::with_capacity(flanks.len());
        let mut pushes = Vec::with_capacity(flanks.len());
        for c in &flanks {
            let wide = inverse.wide(&DVector::from_column_slice(&c.direction));
            let push: Vec<f64> = wide.iter().map(|p| p.value()).collect();
            let mobility = along(&sparse(&c.direction), &wide);
            let error: Vec<Wave> = c.error.iter().map(|h| wave(h, 1.0)).collect();
            let latch = c.law.is_latched().then(|| {
                dim += 1;
                dim - 1
            });
            let spring = match &c.stiffness {
                Stiffness::Constant(k) => Spring::Constant(*k),
                Stiffness::Harmonic { mean, harmonics } => {
                    Spring::Waves(*mean, harmonics.iter().map(|h| wave(h, *mean)).collect())
                }
                scheduled => Spring::Scheduled(Schedule::new(scheduled, &clock)),
            };
            let error_rate: Vec<Wave> = error.iter().map(|w| w.rate(oscillators[w.index].omega)).collect();
            let size = |w: &Wave| w.cosine.abs() + w.sine.abs();
            pushes.push(wide);
            contacts.push(Contact {
                error_sizes: [
                    error.iter().map(size).sum(),
                    error_rate.iter().map(size).sum(),
                    error.iter().map(|w| oscillators[w.index].omega.powi(2) * size(w)).sum(),
                ],
                direction: sparse(&c.direction),
                mobility,
                weight: mobility.sqrt().recip(),
                across: c.direction.iter().zip(&weights).map(|(g, w)| g.abs() / w).sum(),
                push_norm: push.iter().zip(&weights).fold(0.0, |m: f64, (p, w)| m.max(p.abs() * w)),
                push: sparse(&push),
                error_rate,
                error,
                swing: match &spring {
                    Spring::Waves(_, waves) => swing(waves, &oscillators),
                    _ => (0.0, 0.0),
                },
                spring,
                couplings: Vec::new(),
                latch,
                stiffest: c.stiffness.maximum(),
                back: None,
                spec: c.clone(),
            });
        }
        for (k, j) in back_of.iter().enumerate() {
            contacts[*j].back = Some(spec.contacts.len() + k);
        }
        for (i, load) in spec.load_schedules.iter().enumerate() {
            let wide = inverse.wide(&-DVector::from_column_slice(&load.vector));
            contacts.push(Contact::loading(i, load, (&wide, &weights), &clock));
            pushes.push(wide);
        }
        for contact in &mut contacts {
            contact.couplings = pushes.iter().map(|push| along(&contact.direction, push)).collect();
        }
        let (k, c) = (inverse.solve_matrix(&spec.stiffness), inverse.solve_matrix(&spec.damping));
        let rows: Vec<Vec<(u32, f64, f64)>> = (0..n)
            .map(|i| {
                (0..n)
                    .filter(|j| k[(i, *j)] != 0.0 || c[(i, *j)] != 0.0)
                    .map(|j| (j as u32, k[(i, j)], c[(i, j)]))
                    .collect()
            })
            .collect();
        let load = inverse.solve(&spec.load);
        let pull = |i: usize| {
            let waves: f64 = load_waves.iter().map(|w| w.cosine[i].abs() + w.sine[i].abs()).sum();
            [load[i].abs() + waves, rows[i].iter().map(|(_, k, _)| k.abs()).sum()]
        };
        let structure = Self {
            columns: VectorColumns::new(&k, &c, &contacts, (&load, &load_waves, &weights)),
            pulls: (0..n).map(pull).collect(),
            load,
            rows,
            n,
            dim,
            clock,
            oscillators,
            load_waves,
            forms: [spec.mass.clone(), (&spec.damping + spec.damping.transpose()) * 0.5, spec.stiffness.clone()]
                .map(|m| m.column_iter().map(|column| sparse(column.as_slice())).collect()),
            contacts,
            back_of,
            weights,
            symmetry: Symmetry::new(&spec, &flanks),
            is_conservative: conserves(&spec),
            instructions: Instructions::best(),
            spec,
        };
        Ok(structure)
    }

    /// Returns the same train with another instruction set than the best one.
    #[must_use]
    pub fn by(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// Returns the instruction set of the train.
    #[must_use]
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// Returns the specification of the train.
    #[must_use]
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// Returns the number of degrees of freedom.
    #[must_use]
    pub fn freedoms(&self) -> usize {
        self.n
    }

    /// Returns the forcing clock.
    #[must_use]
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Returns the contacts.
    #[must_use]
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts[..self.spec.contacts.len()]
    }

    /// Returns the number of flanks: elements other than loads.
    pub(crate) fn flanks(&self) -> usize {
        self.spec.contacts.len() + self.back_of.len()
    }

    /// Returns whether element `j` is a load.
    pub(crate) fn is_load(&self, j: usize) -> bool {
        j >= self.flanks()
    }

    /// Returns the contact of element `j`, which is no load, and the sense of its direction.
    pub(crate) fn contact_of(&self, j: usize) -> (usize, f64) {
        match j.checked_sub(self.spec.contacts.len()) {
            Some(back) => (self.back_of[back], -1.0),
            None => (j, 1.0),
        }
    }

    /// Returns the element of contact `j` that carries its force in `mode`, and the sense of its direction.
    pub(crate) fn flank_in(&self, mode: &Mode, j: usize) -> (usize, f64) {
        let back = self.contacts[j].back.filter(|back| contact_mode(mode, *back) != ContactMode::Separated);
        back.map_or((j, 1.0), |back| (back, -1.0))
    }

    /// Passes the index and `(cos ωt, sin ωt)` of every oscillator to `out`.
    pub(crate) fn oscillate(&self, at: Instant, mut out: impl FnMut(usize, f64, f64)) {
        for (i, o) in self.oscillators.iter().enumerate() {
            let (s, c) = self.clock.sincos(o.omega, o.order, at);
            out(i, c, s);
        }
    }
}

/// Returns the sum of the amplitudes, N/m, and the fastest frequency, rad/s, of a stiffness with oscillators.
fn swing(waves: &[Wave], oscillators: &[Oscillator]) -> (f64, f64) {
    waves.iter().fold((0.0, 0.0), |(sum, fastest): (f64, f64), w| {
        (sum + libm::hypot(w.cosine, w.sine), fastest.max(oscillators[w.index].omega))
    })
}

/// Returns the clock, the distinct frequencies, and the index of each by its bits. Without a named base frequency, the lowest one is the
/// base if all others are its multiples. Otherwise the first one is the base, and the others have independent angles.
fn find_oscillators(spec: &Spec) -> (Clock, Vec<Oscillator>, HashMap<u64, usize>) {
    let (mut omegas, mut places) = (Vec::new(), HashMap::new());
    let mut meet = |w: f64| {
        places.entry(w.to_bits()).or_insert_with(|| {
            omegas.push(w);
            omegas.len() - 1
        });
    };
    spec.load_harmonics.iter().for_each(|l| meet(l.omega));
    for c in spec.flanks() {
        c.error.iter().for_each(|h| meet(h.omega));
        if let Stiffness::Harmonic { harmonics, .. } = &c.stiffness {
            harmonics.iter().for_each(|h| meet(h.omega));
        }
    }
    let order = |w: f64, base: f64| {
        let h = (w / base).round();
        // A multiple to one unit in the last place counts as one: 3 · 0.3 stands for 0.9.
        ((1.0..1e6).contains(&h) && (h * base - w).abs() <= f64::EPSILON * w).then_some(h as u32)
    };
    let lowest = omegas.iter().copied().fold(f64::INFINITY, f64::min);
    let base = spec.omega.or_else(|| {
        let common = omegas.iter().all(|w| order(*w, lowest).is_some());
        omegas.first().map(|first| if common { lowest } else { *first })
    });
    let oscillators =
        omegas.iter().map(|&omega| Oscillator { omega, order: base.and_then(|b| order(omega, b)) }).collect();
    (Clock::new(base), oscillators, places)
}
