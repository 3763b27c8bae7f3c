//! Powers of penetrations with a recurrence of their own: of the owner of a clock, and of contacts that start or leave.

use super::{
    clock::StepClock,
    fours::{ContactAction, FourSeries},
};
use crate::{
    gear::contact::PowerLaw,
    hybrid::ContactRows,
    kernel::{Expansion, LANES, StepRows, product},
};

/// Relative change that is far below rounding.
const UNFELT: f64 = f64::EPSILON / 64.0;

impl Expansion<'_> {
    /// Forms the powers of penetrations at order `k` that have a recurrence of their own.
    #[inline(never)] // a call of its own keeps the recurrence small
    pub fn lone_powers(
        &self,
        clock: &StepClock,
        chunk: usize,
        four: &FourSeries,
        k: usize,
        power: &mut [f64; LANES],
        rows: &mut StepRows,
    ) {
        for (l, does) in four.does.iter().enumerate() {
            let j = LANES * chunk + l;
            match (does, clock.owner) {
                (ContactAction::Alone(law), _) => {
                    rows.contacts[j].penetration[k] = four.penetration[k][l];
                    self.power(clock, j, *law, (k, four.side[l] * four.rate[0][l]), rows);
                    power[l] = rows.contacts[j].power[k];
                }
                // Equal contacts stay equal to the last bit.
                (ContactAction::AsOwner(law), Some(owner)) => {
                    rows.contacts[j].apart[k] = four.penetration[k][l] - rows.contacts[owner].penetration[k];
                    let slope = rows.clock.y((law.exponent.p - law.exponent.q) as usize);
                    let changed = law.exponent.value() * product(slope, &rows.contacts[j].apart, k);
                    power[l] = rows.contacts[owner].power[k] + changed;
                }
                _ => {}
            }
        }
    }

    /// Returns whether contact `j` leaves and is so near its end that the rest of its force changes neither its rate nor, in
    /// proportion, its penetration: by `K p^(n+1)/(m ṗ²)` in the remaining time `p/|ṗ|`. If it leaves together with the
    /// owner of the clock, its branch point would shorten every step.
    pub fn leaves_unfelt(&self, j: usize, law: PowerLaw, rate: f64, rows: &StepRows) -> bool {
        let c = &self.s.contacts[j];
        let p = rows.contacts[j].penetration[0];
        let energy = |p: f64| c.spec.stiffness.mean() * c.mobility * law.exponent.power(p) * p;
        rate < 0.0 && p > 0.0 && energy(p) <= UNFELT * rate * rate
    }

    /// Forms `pⁿ` at order `k` of a contact with the `rate` ṗ at the start.
    fn power(&self, clock: &StepClock, j: usize, law: PowerLaw, (k, rate): (usize, f64), rows: &mut StepRows) {
        let exponent = law.exponent;
        if clock.owner == Some(j) && clock.root == exponent.q {
            // n = a + r/q: pⁿ = p^a y^r, products only.
            let (a, r) = ((exponent.p / exponent.q) as usize, (exponent.p % exponent.q) as usize);
            let (contact, own) = (&mut rows.contacts[j], &mut rows.clock);
            let p = &contact.penetration;
            for m in 2..=a {
                own.penetration[m - 2][k] = product(own.p(m - 1, p), p, k);
            }
            contact.power[k] = match (a, r) {
                (0, r) => own.y(r)[k],
                (a, 0) => own.p(a, p)[k],
                (a, r) => product(own.p(a, p), own.y(r), k),
            };
            return;
        }
        // Another contact's clock, or plain time. If this contact starts here, p = θ^m β with m exact zeros in front
        // (the owner's q; twice as many from rest), and pⁿ = θ^(mn) βⁿ; βⁿ by the recurrence of a power of a series. Where mn
        // is not whole there is no power series: the force is left out, and the step so short that it changes nothing.
        let n = exponent.value();
        let is_left_out = k == 0 && self.leaves_unfelt(j, law, rate, rows);
        let ContactRows { penetration: p, power: u, .. } = &mut rows.contacts[j];
        if k > 0 && u[0] == 0.0 && p[0] > 0.0 || is_left_out {
            u[k] = 0.0;
            return;
        }
        let m = p[..=k].iter().position(|c| *c != 0.0);
        let Some(m) = m.filter(|m| (m * exponent.p as usize).is_multiple_of(exponent.q as usize)) else {
            u[k] = 0.0;
            return;
        };
        let shift = m * exponent.p as usize / exponent.q as usize;
        if k < shift {
            u[k] = 0.0;
            return;
        }
        let i = k - shift;
        u[k] = if i == 0 {
            exponent.power(p[m].max(0.0))
        } else {
            let sum: f64 = (1..=i).map(|l| (l as f64 * (n + 1.0) - i as f64) * p[m + l] * u[k - l]).sum();
            sum / (i as f64 * p[m])
        };
    }
}
