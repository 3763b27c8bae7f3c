//! Action of a contact in a mode: the only link between contact laws and the states of contacts.
//!
//! A contact without an [`ActiveContact`] only has a deflection, which its guards may watch. Everything else about forces, energies, guards and
//! methods is derived from it.

use super::{
    assemble::{Contact, Spring, Structure},
    contact_mode::{ContactMode, Watch, contact_mode, piece},
    schedule::Schedule,
};
use crate::{
    gear::contact::{Law, PowerLaw},
    hybrid::{Instant, Mode},
};

/// A contact and its law, with the parameters of the mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ActiveContact {
    pub contact: usize,
    /// +1 on the drive flank, −1 on the back flank, 0 where the law acts on the deflection itself.
    pub side: f64,
    /// True if the force acts; otherwise it is only watched.
    pub is_carried: bool,
    pub force: Force,
}

/// The force along the direction of a contact, N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Force {
    /// `k (δ − σ b) + c δ̇`.
    Linear { stiffness: Elasticity, damping: f64 },
    /// `σ K pⁿ (1 + χ ṗ)` with `p = σ δ − b ≥ 0` and `χ = D/v`; `latch` is the index of v in the state; without one, χ is zero.
    Power { law: PowerLaw, stiffness: f64, latch: Option<usize> },
    /// The force that keeps `δ̈ = 0`.
    Held,
}

/// A stiffness in one mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Elasticity {
    Constant(f64),
    /// Value at the start of piece `number` of the schedule, N/m, and slope, N/(m s).
    Ramp {
        value: f64,
        slope: f64,
        number: u32,
    },
    /// Follows the oscillators.
    Waves,
}

impl Elasticity {
    /// Returns whether the stiffness varies along a step, as a series.
    pub fn varies(self) -> bool {
        !matches!(self, Self::Constant(_))
    }
}

impl Force {
    /// Returns the damping of a linear law, N s/m.
    pub fn damping(&self) -> Option<f64> {
        if let Self::Linear { damping, .. } = self { Some(*damping) } else { None }
    }

    /// Returns χ of a power law in the state `x`, s/m.
    pub fn chi(&self, x: &[f64]) -> f64 {
        match self {
            Self::Power { law, latch: Some(latch), .. } => law.hysteresis / x[*latch],
            _ => 0.0,
        }
    }
}

impl ActiveContact {
    pub fn is_held(&self) -> bool {
        self.force == Force::Held
    }
}

impl Structure {
    /// Returns the side of the flank that contact `j` presses in `mode`, and whether the force is carried; `None` if there is no force.
    fn pressing(&self, mode: &Mode, j: usize) -> Option<(f64, bool)> {
        let state = contact_mode(mode, j);
        match self.contacts[j].spec.law {
            Law::Bilateral(_) => Some((0.0, true)),
            Law::Rigid(_) if !state.is_closed() => None,
            _ if state == ContactMode::Separated => None,
            _ => Some((state.side(), state.is_closed())),
        }
    }

    /// Iterates over the contacts: the schedule of the stiffness of each, if it has one.
    pub(crate) fn schedules(&self) -> impl Iterator<Item = Option<&Schedule>> {
        self.contacts.iter().map(|c| if let Spring::Scheduled(schedule) = &c.spring { Some(schedule) } else { None })
    }

    /// Returns the schedule of the force of contact `j` in `mode`. Switches of other schedules have no effect.
    pub(crate) fn followed(&self, mode: &Mode, j: usize) -> Option<&Schedule> {
        match &self.contacts[j].spring {
            Spring::Scheduled(schedule) if !self.contacts[j].spec.law.is_rigid() => {
                self.pressing(mode, j).map(|_| schedule)
            }
            _ => None,
        }
    }

    /// Returns the action of contact `j` in `mode`, if any.
    pub(crate) fn acting(&self, mode: &Mode, j: usize) -> Option<ActiveContact> {
        let (side, is_carried) = self.pressing(mode, j)?;
        let c = &self.contacts[j];
        let force = match c.spec.law {
            Law::Bilateral(l) | Law::KelvinVoigt(l, _) => {
                Force::Linear { stiffness: c.elasticity(piece(mode, j)), damping: l.damping }
            }
            Law::Power(law) => Force::Power { law, stiffness: c.spec.stiffness.mean(), latch: c.latch },
            Law::Rigid(_) => Force::Held,
        };
        Some(ActiveContact { contact: j, side, is_carried, force })
    }

    /// Iterates over the contacts that carry force in `mode`.
    pub(crate) fn carrying(&self, mode: &Mode) -> impl Iterator<Item = ActiveContact> {
        (0..self.contacts.len()).filter_map(move |j| self.acting(mode, j)).filter(|a| a.is_carried)
    }

    /// Returns the stiffness of a linear law, N/m, and its rate of change, N/(m s).
    pub(crate) fn stiffness_at(&self, j: usize, stiffness: Elasticity, at: Instant) -> (f64, f64) {
        match (stiffness, &self.contacts[j].spring) {
            (Elasticity::Constant(k), _) => (k, 0.0),
            (Elasticity::Ramp { value, slope, number }, Spring::Scheduled(s)) => {
                (value + slope * s.elapsed(&self.clock, at, number), slope)
            }
            (_, Spring::Waves(mean, waves)) => waves.iter().fold((*mean, 0.0), |(k, dk), w| {
                let o = self.oscillators[w.index];
                let (sin, cos) = self.clock.sincos(o.omega, o.order, at);
                (k + w.cosine * cos + w.sine * sin, dk + o.omega * (w.sine * cos - w.cosine * sin))
            }),
            (_, spring) => unreachable!("{stiffness:?} of {spring:?}"),
        }
    }

    /// Returns `1 + χ ṗ` of a power law, `rate` = δ̇; 1 for any other law.
    pub(crate) fn factor(&self, acting: &ActiveContact, rate: f64, x: &[f64]) -> f64 {
        1.0 + acting.force.chi(x) * (acting.side * rate)
    }

    /// Returns the force of the law along g, N, carried or not; zero for a held contact.
    pub(crate) fn law_force(&self, acting: &ActiveContact, at: Instant, x: &[f64]) -> f64 {
        self.force_of_deflection(acting, (at, x), self.deflection(acting.contact, at, x))
    }

    /// Returns the same force, for a given deflection and rate of the contact.
    pub(crate) fn force_of_deflection(
        &self,
        acting: &ActiveContact,
        (at, x): (Instant, &[f64]),
        (d, rate): (f64, f64),
    ) -> f64 {
        let (c, side) = (&self.contacts[acting.contact], acting.side);
        match acting.force {
            Force::Linear { stiffness, damping } => {
                self.stiffness_at(acting.contact, stiffness, at).0 * (d - side * c.gap()) + damping * rate
            }
            Force::Power { law, stiffness, .. } => {
                let p = (side * d - c.gap()).max(0.0);
                side * stiffness * libm::pow(p, law.exponent.value()) * self.factor(acting, rate, x)
            }
            Force::Held => 0.0,
        }
    }

    /// Returns the change of the force for a change `(d1, r1)` of deflection and rate, and `x1` of the state.
    pub(crate) fn force_change(
        &self,
        acting: &ActiveContact,
        at: Instant,
        x: &[f64],
        [d1, r1]: [f64; 2],
        x1: &[f64],
    ) -> f64 {
        match acting.force {
            Force::Linear { stiffness, damping } => {
                self.stiffness_at(acting.contact, stiffness, at).0 * d1 + damping * r1
            }
            Force::Power { law, stiffness: k, latch } => {
                let (d, r) = self.deflection(acting.contact, at, x);
                let (side, n) = (acting.side, law.exponent.value());
                let p = (side * d - self.contacts[acting.contact].gap()).max(0.0);
                let by_p = k * n * libm::pow(p, n - 1.0) * self.factor(acting, r, x);
                let by_rate = k * libm::pow(p, n) * acting.force.chi(x);
                let by_latch =
                    latch.and_then(|i| x1.get(i)).map_or(0.0, |change| self.force_by_latch(acting, at, x) * change);
                by_p * d1 + by_rate * r1 + by_latch
            }
            Force::Held => 0.0,
        }
    }

    /// Returns the derivative of the force of a power law with respect to its latched speed, kg/s.
    pub(crate) fn force_by_latch(&self, acting: &ActiveContact, at: Instant, x: &[f64]) -> f64 {
        let Force::Power { law, stiffness, latch: Some(latch) } = acting.force else { return 0.0 };
        let (d, r) = self.deflection(acting.contact, at, x);
        let p = (acting.side * d - self.contacts[acting.contact].gap()).max(0.0);
        -stiffness * libm::pow(p, law.exponent.value()) * acting.force.chi(x) * r / x[latch]
    }

    /// Returns the energy in the spring, J; zero if no force is carried.
    pub(crate) fn stored_in(&self, acting: Option<ActiveContact>, at: Instant, x: &[f64]) -> f64 {
        let Some(a) = acting.filter(|a| a.is_carried) else { return 0.0 };
        let p = self.penetration(&a, self.deflection(a.contact, at, x).0);
        match a.force {
            Force::Linear { stiffness, .. } => 0.5 * self.stiffness_at(a.contact, stiffness, at).0 * p * p,
            Force::Power { law, stiffness, .. } => {
                let n = law.exponent.value();
                let p = p.max(0.0);
                stiffness * libm::pow(p, n + 1.0) / (n + 1.0)
            }
            Force::Held => 0.0,
        }
    }

    /// Returns the powers of a contact, W: dissipation, and work of a varying stiffness.
    pub(crate) fn contact_powers(&self, acting: Option<ActiveContact>, at: Instant, x: &[f64]) -> (f64, f64) {
        let Some(a) = acting.filter(|a| a.is_carried) else { return (0.0, 0.0) };
        let (d, rate) = self.deflection(a.contact, at, x);
        let p = self.penetration(&a, d);
        match a.force {
            Force::Linear { stiffness, damping } => {
                (damping * rate * rate, 0.5 * self.stiffness_at(a.contact, stiffness, at).1 * p * p)
            }
            Force::Power { law, stiffness, .. } => {
                let elastic = stiffness * libm::pow(p.max(0.0), law.exponent.value());
                (elastic * (self.factor(&a, rate, x) - 1.0) * (a.side * rate), 0.0)
            }
            Force::Held => (0.0, 0.0),
        }
    }

    /// Returns `σ δ − b`, m; δ itself where the law acts on δ.
    fn penetration(&self, a: &ActiveContact, deflection: f64) -> f64 {
        if a.side == 0.0 { deflection } else { a.side * deflection - self.contacts[a.contact].gap() }
    }

    /// Returns the quantities watched on contact `j` in `mode`, with the signs that make them positive inside.
    pub(crate) fn watched(&self, mode: &Mode, j: usize) -> &'static [(Watch, f64)] {
        let (c, state) = (&self.contacts[j], contact_mode(mode, j));
        match c.spec.law {
            Law::Bilateral(_) => &[],
            // The force reaches zero no later than the deflection does.
            Law::KelvinVoigt(..) if state.is_closed() && c.spec.law.release_damping().is_some() => {
                &[(Watch::Force, 1.0)]
            }
            Law::KelvinVoigt(..) => watches(state, c.spec.law.release_damping().is_some(), c.has_back()),
            Law::Power(_) => watches(state, c.latch.is_some(), c.has_back()),
            Law::Rigid(_) if state.is_closed() => &[(Watch::Force, 1.0)],
            // Held on its flank by other contacts.
            Law::Rigid(_) if state.side() != 0.0 => &[],
            Law::Rigid(_) => watches(state, false, c.has_back()),
        }
    }
}

impl Contact {
    /// Returns the stiffness in piece `number` of its schedule.
    fn elasticity(&self, number: u32) -> Elasticity {
        match &self.spring {
            Spring::Constant(k) => Elasticity::Constant(*k),
            Spring::Waves(..) => Elasticity::Waves,
            Spring::Scheduled(schedule) => match schedule.law(number) {
                (value, 0.0) => Elasticity::Constant(value),
                (value, slope) => Elasticity::Ramp { value, slope, number },
            },
        }
    }
}

/// Returns the watches of a state, with the signs that make the guards positive inside. `b − δ`, `δ + b` and the compressive force are the
/// positive directions of the three watches in the separated state.
fn watches(state: ContactMode, releases_by_force: bool, back: bool) -> &'static [(Watch, f64)] {
    use ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated};
    match state {
        Separated if back => &[(Watch::DriveFlank, 1.0), (Watch::BackFlank, 1.0)],
        Separated => &[(Watch::DriveFlank, 1.0)],
        Drive if releases_by_force => &[(Watch::DriveFlank, -1.0), (Watch::Force, 1.0)],
        Back if releases_by_force => &[(Watch::BackFlank, -1.0), (Watch::Force, 1.0)],
        Drive => &[(Watch::DriveFlank, -1.0)],
        Back => &[(Watch::BackFlank, -1.0)],
        DriveDetached => &[(Watch::DriveFlank, -1.0), (Watch::Force, -1.0)],
        BackDetached => &[(Watch::BackFlank, -1.0), (Watch::Force, -1.0)],
    }
}
