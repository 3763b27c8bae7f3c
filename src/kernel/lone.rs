//! Powers of penetrations with a recurrence of their own: of the owner of a clock, and of contacts that start or leave.

use super::{
    Expansion, LANES, PENETRATION, POWER, STIFFNESS,
    clock::StepClock,
    fours::{ContactAction, FourSeries},
    product,
};
use crate::gear::contact::PowerLaw;

/// Relative change that is far below rounding.
const UNFELT: f64 = f64::EPSILON / 64.0;

impl Expansion<'_> {
    /// Forms the powers of penetrations at order `k` that have a recurrence of their own.
    #[inline(never)] // a call of its own keeps the recurrence small
    pub(super) fn lone_powers(
        &self,
        clock: &StepClock,
        chunk: usize,
        four: &FourSeries,
        k: usize,
        power: &mut [f64; LANES],
        work: &mut [f64],
    ) {
        let layout = self.layout;
        for (l, does) in four.does.iter().enumerate() {
            let j = LANES * chunk + l;
            match (does, clock.owner) {
                (ContactAction::Alone(law), _) => {
                    work[layout.of(j, PENETRATION) + k] = four.penetration[k][l];
                    self.power(clock, j, *law, (k, four.side[l] * four.rate[0][l]), work);
                    power[l] = work[layout.of(j, POWER) + k];
                }
                // Equal contacts stay equal to the last bit.
                (ContactAction::AsOwner(law), Some(owner)) => {
                    let (own, apart) = (layout.of(owner, PENETRATION) + k, layout.of(j, STIFFNESS));
                    work[apart + k] = four.penetration[k][l] - work[own];
                    let slope = layout.y((law.exponent.p - law.exponent.q) as usize);
                    let changed = law.exponent.value() * product(work, slope, apart, k);
                    power[l] = work[layout.of(owner, POWER) + k] + changed;
                }
                _ => {}
            }
        }
    }

    /// Returns whether contact `j` leaves and is so near its end that the rest of its force changes neither its rate nor, in
    /// proportion, its penetration: by `K p^(n+1)/(m ṗ²)` in the remaining time `p/|ṗ|`. If it leaves together with the
    /// owner of the clock, its branch point would shorten every step.
    pub(super) fn leaves_unfelt(&self, j: usize, law: PowerLaw, rate: f64, work: &[f64]) -> bool {
        let c = &self.s.contacts[j];
        let p = work[self.layout.of(j, PENETRATION)];
        let energy = |p: f64| c.spec.stiffness.mean() * c.mobility * law.exponent.power(p) * p;
        rate < 0.0 && p > 0.0 && energy(p) <= UNFELT * rate * rate
    }

    /// Forms `pⁿ` at order `k` of a contact with the `rate` ṗ at the start.
    fn power(&self, clock: &StepClock, j: usize, law: PowerLaw, (k, rate): (usize, f64), work: &mut [f64]) {
        let layout = self.layout;
        let (p, u) = (layout.of(j, PENETRATION), layout.of(j, POWER));
        let exponent = law.exponent;
        if clock.owner == Some(j) && clock.root == exponent.q {
            // n = a + r/q: pⁿ = p^a y^r, products only.
            let (a, r) = ((exponent.p / exponent.q) as usize, (exponent.p % exponent.q) as usize);
            let mut series = p;
            for m in 2..=a {
                let next = layout.y(16 + m - 1);
                work[next + k] = product(work, series, p, k);
                series = next;
            }
            work[u + k] = match (a, r) {
                (0, r) => work[layout.y(r) + k],
                (_, 0) => work[series + k],
                (_, r) => product(work, series, layout.y(r), k),
            };
            return;
        }
        // Another contact's clock, or plain time. If this contact starts here, p = θ^m β with m exact zeros in front
        // (the owner's q; twice as many from rest), and pⁿ = θ^(mn) βⁿ; βⁿ by the recurrence of a power of a series. Where mn
        // is not whole there is no power series: the force is left out, and the step so short that it changes nothing.
        let n = exponent.value();
        if k > 0 && work[u] == 0.0 && work[p] > 0.0 || k == 0 && self.leaves_unfelt(j, law, rate, work) {
            work[u + k] = 0.0;
            return;
        }
        let m = work[p..=p + k].iter().position(|c| *c != 0.0);
        let Some(m) = m.filter(|m| (m * exponent.p as usize).is_multiple_of(exponent.q as usize)) else {
            work[u + k] = 0.0;
            return;
        };
        let shift = m * exponent.p as usize / exponent.q as usize;
        if k < shift {
            work[u + k] = 0.0;
            return;
        }
        let i = k - shift;
        work[u + k] = if i == 0 {
            exponent.power(work[p + m].max(0.0))
        } else {
            let sum: f64 = (1..=i).map(|l| (l as f64 * (n + 1.0) - i as f64) * work[p + m + l] * work[u + k - l]).sum();
            sum / (i as f64 * work[p + m])
        };
    }
}
