//! What a step shows besides its state and guards: deflections, forces and powers as series in θ.
//!
//! They are products of series that the recurrence has formed; a series without terms is None.

use super::{FACTOR, FORCE, LANES, Layout, Motion, PENETRATION, POWER, RATE, ROW, STIFFNESS};
use crate::{
    gear::contact::PowerLaw,
    hybrid::{Jet, Shown},
    system::{Elasticity, Force, Spring, Wave},
};

type Series = [f64; ROW];

/// Room for the product of two series. It is kept whole: where a step holds to rounding, its square needs more orders than it.
const TWICE: usize = 2 * ROW - 1;

type Product = [f64; TWICE];

#[inline(always)]
fn gather(orders: impl Iterator<Item = f64>) -> Series {
    let mut series = [0.0; ROW];
    series.iter_mut().zip(orders).for_each(|(s, c)| *s = c);
    series
}

/// Adds `factor a b`; of a product that is longer than a series, up to the highest power kept.
#[inline(always)]
fn add_product(sum: &mut Product, factor: f64, a: &Series, b: &[f64]) {
    for (i, a) in a.iter().enumerate() {
        let a = factor * a;
        sum[i..].iter_mut().zip(b).for_each(|(s, b)| *s += a * b);
    }
}

/// Adds `factor a²`.
#[inline(always)]
fn add_square(sum: &mut Product, factor: f64, a: &Series) {
    for (i, c) in a.iter().enumerate() {
        let once = factor * c;
        sum[2 * i] += once * c;
        sum[2 * i + 1..].iter_mut().zip(&a[i + 1..]).for_each(|(s, b)| *s += 2.0 * once * b);
    }
}

#[inline(always)]
fn scaled<const N: usize>(factor: f64, mut series: [f64; N]) -> [f64; N] {
    series.iter_mut().for_each(|c| *c *= factor);
    series
}

#[inline(always)]
fn sum<const N: usize>(mut series: impl Iterator<Item = [f64; N]>) -> Option<[f64; N]> {
    let mut sum = series.next()?;
    for series in series {
        sum.iter_mut().zip(&series).for_each(|(s, c)| *s += c);
    }
    Some(sum)
}

impl Motion<'_> {
    /// Adds the terms of a quantity to `out`.
    #[inline(always)]
    pub(super) fn shown(&self, step: &Jet, what: Shown, out: &mut Vec<f64>) {
        let mut powers = [1.0; ROW];
        for k in 1..ROW {
            powers[k] = powers[k - 1] * step.reach;
        }
        let rows = Rows { motion: self, step, is_pressed: step.is_estimate, powers };
        let mut sum = [0.0; TWICE];
        let mut is_any = false;
        match what {
            Shown::Time if !step.time.is_empty() => {
                return out.extend(step.time.iter().zip(&powers).map(|(t, p)| t * p));
            }
            Shown::Time => return out.extend([0.0, step.span * step.reach]),
            Shown::Deflection(j) => return out.extend_from_slice(&rows.deflection(j)),
            Shown::Transmission(j) => return out.extend_from_slice(&rows.transmission(j)),
            Shown::Force(j) => return rows.force(j).iter().for_each(|force| out.extend_from_slice(force)),
            Shown::Loss(j) => is_any = rows.loss(j, &mut sum),
            Shown::ByDeflection(j) | Shown::ByRate(j) | Shown::ByLatch(j) => {
                return rows.change(j, what).iter().for_each(|change| out.extend_from_slice(change));
            }
            Shown::Load => {
                rows.load(&mut sum);
                is_any = true;
            }
            Shown::Damping => is_any = rows.damping(&mut sum),
            Shown::Error | Shown::Parametric | Shown::Contacts => {
                for j in 0..self.parts.len() {
                    is_any |= match what {
                        Shown::Error => rows.error(j, &mut sum),
                        Shown::Parametric => rows.parametric(j, &mut sum),
                        _ => rows.loss(j, &mut sum),
                    };
                }
            }
        }
        if is_any {
            out.extend_from_slice(&sum);
        }
    }
}

struct Rows<'a> {
    motion: &'a Motion<'a>,
    step: &'a Jet,
    /// Power laws are closed: all series that the recurrence has formed are there.
    is_pressed: bool,
    /// Of the reach. A step may be far shorter than what its coefficients belong to: their products would overflow.
    powers: Series,
}

impl Rows<'_> {
    /// A series in θ: its coefficients lie `stride` apart.
    #[inline(always)]
    fn every(&self, stride: usize, values: &[f64]) -> Series {
        let (mut series, mut at) = ([0.0; ROW], 0);
        for (c, power) in series.iter_mut().zip(&self.powers) {
            *c = values[at] * power;
            at += stride;
        }
        series
    }

    /// The force of contact `j`, if it is carried.
    fn force_of(&self, j: usize) -> Option<Force> {
        self.motion.parts[j].acting.filter(|a| a.is_carried).map(|a| a.force)
    }

    #[inline(always)]
    fn work(&self, j: usize, which: usize) -> Series {
        let start = self.motion.layout.of(j, which);
        self.every(1, &self.step.work[start..])
    }

    #[inline(always)]
    fn deflection(&self, j: usize) -> Series {
        self.every(LANES, &self.step.work[self.motion.layout.deflection(j, 0)..])
    }

    #[inline(always)]
    fn transmission(&self, j: usize) -> Series {
        let terms = self.motion.structure.contacts[j].direction.iter();
        let displacement = |i: u32| self.every(self.step.dim, &self.step.state[i as usize..]);
        sum(terms.map(|(i, g)| scaled(*g, displacement(*i)))).unwrap_or([0.0; ROW])
    }

    /// `δ − σ b`.
    #[inline(always)]
    fn stretch(&self, j: usize) -> Series {
        let mut stretch = self.deflection(j);
        stretch[0] = self.step.work[self.motion.layout.stretches + j];
        stretch
    }

    /// `δ̇`. The linear recurrence does without it.
    #[inline(always)]
    fn rate(&self, j: usize) -> Series {
        if self.is_pressed || !self.motion.is_linear {
            return self.work(j, RATE);
        }
        let deflection = self.deflection(j);
        gather(deflection[1..].iter().enumerate().map(|(k, d)| (k + 1) as f64 * d / (self.step.span * self.step.reach)))
    }

    #[inline(always)]
    fn force(&self, j: usize) -> Option<Series> {
        match self.force_of(j)? {
            Force::Linear { stiffness, damping } if self.motion.is_linear => {
                let mut series = match stiffness {
                    Elasticity::Constant(k) => scaled(k, self.stretch(j)),
                    // The linear recurrence ends without the last order of these forces.
                    _ => {
                        let mut product = [0.0; TWICE];
                        add_product(&mut product, 1.0, &self.stiffness(j), &self.stretch(j));
                        gather(product.into_iter())
                    }
                };
                if damping != 0.0 {
                    series.iter_mut().zip(self.rate(j)).for_each(|(f, r)| *f += damping * r);
                }
                Some(series)
            }
            // What is leaving at this very instant.
            Force::Power { .. } if !self.is_pressed => None,
            _ => Some(self.work(j, FORCE)),
        }
    }

    /// A stiffness that varies, in plain time.
    #[inline(always)]
    fn stiffness(&self, j: usize) -> Series {
        let Spring::Waves(mean, waves) = &self.motion.structure.contacts[j].spring else {
            // A ramp is written with all its orders.
            return self.work(j, STIFFNESS);
        };
        let mut series = self.follow(waves.iter().copied()).unwrap_or([0.0; ROW]);
        series[0] += mean;
        series
    }

    /// Adds `c δ̇²`, or `K pⁿ χ ṗ²`, if there is such a power.
    #[inline(always)]
    fn loss(&self, j: usize, sum: &mut Product) -> bool {
        match self.force_of(j) {
            Some(Force::Linear { damping, .. }) if damping != 0.0 => add_square(sum, damping, &self.rate(j)),
            Some(force @ Force::Power { stiffness, .. }) if self.is_pressed && force.chi(&self.step.state) != 0.0 => {
                let mut square = [0.0; TWICE];
                add_square(&mut square, force.chi(&self.step.state) * stiffness, &self.work(j, RATE));
                add_product(sum, 1.0, &self.work(j, POWER), &square);
            }
            _ => return false,
        }
        true
    }

    /// Adds `−F ė`, if the error moves and the force is carried.
    #[inline(always)]
    fn error(&self, j: usize, sum: &mut Product) -> bool {
        let contact = &self.motion.structure.contacts[j];
        let Some(rate) = self.follow(contact.error_rate.iter().copied()) else { return false };
        let Some(force) = self.force(j) else { return false };
        add_product(sum, -1.0, &force, &rate);
        true
    }

    /// Adds `½ k̇ (δ − σ b)²`, if the stiffness moves.
    #[inline(always)]
    fn parametric(&self, j: usize, sum: &mut Product) -> bool {
        let s = self.motion.structure;
        let Some(Force::Linear { stiffness, .. }) = self.force_of(j) else { return false };
        let rate = match (stiffness, &s.contacts[j].spring) {
            (Elasticity::Ramp { slope, .. }, _) => Some(std::array::from_fn(|k| if k == 0 { slope } else { 0.0 })),
            (Elasticity::Waves, Spring::Waves(_, waves)) => {
                self.follow(waves.iter().map(|w| w.rate(s.oscillators[w.index].omega)))
            }
            _ => None,
        };
        let Some(rate) = rate else { return false };
        let mut square = [0.0; TWICE];
        add_square(&mut square, 0.5, &self.stretch(j));
        add_product(sum, 1.0, &rate, &square);
        true
    }

    /// How the force of contact `j` changes, times `dt/dθ`; `None` for zero.
    fn change(&self, j: usize, what: Shown) -> Option<Series> {
        let force = self.force_of(j)?;
        let clock: Series = match !self.step.time.is_empty() {
            true => gather(
                self.step.time[1..].iter().zip(&self.powers[1..]).enumerate().map(|(k, (t, p))| (k + 1) as f64 * t * p),
            ),
            false => gather(std::iter::once(self.step.span * self.step.reach)),
        };
        let times = |a: &Series, b: &Series| {
            let mut product = [0.0; TWICE];
            add_product(&mut product, 1.0, a, b);
            gather(product.into_iter())
        };
        match (force, what) {
            (Force::Linear { stiffness: Elasticity::Constant(k), .. }, Shown::ByDeflection(_)) => {
                Some(scaled(k, clock))
            }
            (Force::Linear { .. }, Shown::ByDeflection(_)) if self.is_pressed => {
                Some(times(&self.work(j, STIFFNESS), &clock))
            }
            (Force::Linear { .. }, Shown::ByDeflection(_)) => Some(times(&self.stiffness(j), &clock)),
            (Force::Linear { damping, .. }, Shown::ByRate(_)) => Some(scaled(damping, clock)),
            // What is leaving at this very instant.
            (Force::Power { .. }, _) if !self.is_pressed => None,
            (Force::Power { law, stiffness, .. }, Shown::ByDeflection(_)) => {
                // A force that is left out does not change either.
                if self.work(j, POWER).iter().all(|c| *c == 0.0) {
                    return None;
                }
                let n = law.exponent.value();
                let slope = scaled(n * stiffness, times(&self.slope(j, law)?, &clock));
                Some(times(&slope, &self.work(j, FACTOR)))
            }
            (Force::Power { stiffness, latch: Some(latch), .. }, _) => {
                let chi = force.chi(&self.step.state);
                let damped = scaled(chi * stiffness, times(&self.work(j, POWER), &clock));
                match what {
                    Shown::ByRate(_) => Some(damped),
                    _ => Some(scaled(-self.step.state[latch].recip(), times(&damped, &self.work(j, RATE)))),
                }
            }
            _ => None,
        }
    }

    /// `pⁿ⁻¹` of a closed power law; `None` where it has no series, and the force is left out.
    fn slope(&self, j: usize, law: PowerLaw) -> Option<Series> {
        let layout = &self.motion.layout;
        let p = self.work(j, PENETRATION);
        let owner = Some(self.step.work[layout.owner]).filter(|owner| *owner >= 0.0).map(|owner| owner as usize);
        let (m, q) = (law.exponent.p as usize, law.exponent.q as usize);
        let owns = owner == Some(j) || self.motion.goes_with(owner, j, &self.step.state, &self.step.work);
        if owns {
            // `p = y^q`: `pⁿ⁻¹ = y^(m − q)`, products only.
            let y = self.every(1, &self.step.work[layout.y(1)..]);
            let mut power: Series = gather(std::iter::once(1.0));
            for _ in 0..m - q {
                let mut product = [0.0; TWICE];
                add_product(&mut product, 1.0, &power, &y);
                power = gather(product.into_iter());
            }
            return Some(power);
        }
        // `p = θ^s β`: `pᵉ = θ^(s e) βᵉ`, βᵉ by the recurrence of a power of a series.
        let e = law.exponent.value() - 1.0;
        let zeros = p.iter().position(|c| *c != 0.0)?;
        if p[zeros] < 0.0 || !(zeros * (m - q)).is_multiple_of(q) {
            return None;
        }
        let shift = zeros * (m - q) / q;
        let mut power = [0.0; ROW];
        if shift < ROW {
            power[shift] = libm::pow(p[zeros], e);
        }
        for i in 1..ROW.saturating_sub(shift.max(zeros)) {
            let sum: f64 =
                (1..=i).map(|l| (l as f64 * (e + 1.0) - i as f64) * p[zeros + l] * power[shift + i - l]).sum();
            power[shift + i] = sum / (i as f64 * p[zeros]);
        }
        Some(power)
    }

    #[inline(always)]
    fn velocity(&self, i: usize) -> Series {
        self.every(self.step.dim, &self.step.state[self.motion.structure.n + i..])
    }

    /// Velocities along a vector `[n]`.
    #[inline(always)]
    fn along(&self, vector: &[f64]) -> Series {
        let terms = vector.iter().enumerate().filter(|(_, c)| **c != 0.0);
        sum(terms.map(|(i, c)| scaled(*c, self.velocity(i)))).unwrap_or([0.0; ROW])
    }

    #[inline(always)]
    fn load(&self, sum: &mut Product) {
        let s = self.motion.structure;
        sum[..ROW].copy_from_slice(&self.along(&s.spec.load));
        for (load, wave) in s.spec.load_harmonics.iter().zip(&s.load_waves) {
            let (sin, cos) = libm::sincos(load.phase);
            if let Some(force) = self.follow([Wave { index: wave.index, cosine: cos, sine: -sin }].into_iter()) {
                add_product(sum, 1.0, &force, &self.along(&load.vector));
            }
        }
    }

    /// Adds `q̇ᵀ C q̇`, each pair of degrees of freedom once, if there is damping.
    #[inline(always)]
    fn damping(&self, sum: &mut Product) -> bool {
        let mut is_any = false;
        for (i, column) in self.motion.structure.forms[1].iter().enumerate() {
            for (j, c) in column.iter().map(|(j, c)| (*j as usize, *c)).filter(|(j, _)| *j <= i) {
                is_any = true;
                if i == j {
                    add_square(sum, c, &self.velocity(i));
                } else {
                    add_product(sum, 2.0 * c, &self.velocity(i), &self.velocity(j));
                }
            }
        }
        is_any
    }

    /// A sum of oscillators. The linear recurrence does not keep them: in plain time each order follows from the one before.
    #[inline(always)]
    fn follow(&self, waves: impl Iterator<Item = Wave>) -> Option<Series> {
        let work = &self.step.work;
        sum(waves.map(|w| {
            let o = Layout::oscillator(w.index);
            if self.is_pressed {
                return std::array::from_fn(|k| (w.cosine * work[o + k] + w.sine * work[o + ROW + k]) * self.powers[k]);
            }
            let omega = self.motion.structure.oscillators[w.index].omega;
            let (mut cos, mut sin) = (work[o], work[o + ROW]);
            std::array::from_fn(|k| {
                let value = w.cosine * cos + w.sine * sin;
                let f = self.step.span * self.step.reach * omega / (k + 1) as f64;
                (cos, sin) = (-f * sin, f * cos);
                value
            })
        }))
    }
}
