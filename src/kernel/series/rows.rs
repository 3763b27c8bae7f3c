//! Quantities of a step besides its state and guards: deflections and forces as series in θ, and powers at the places of a quadrature.
//!
//! They follow from series that the recurrence has formed; a series without terms is None.

use smallvec::SmallVec;

use crate::{
    gear::contact::PowerLaw,
    hybrid::{ContactRows, Jet, Power, SAMPLES, Samples, StepQuantity},
    kernel::{LANES, Motion, ROW, Series},
    system::{Elasticity, Force, Spring, Wave},
    vectors::{Path, fused},
};

/// Number of degrees of freedom whose samples need no allocation.
const MANY: usize = 32;

#[inline(always)]
fn gather(orders: impl Iterator<Item = f64>) -> Series {
    let mut series = [0.0; ROW];
    series.iter_mut().zip(orders).for_each(|(s, c)| *s = c);
    series
}

/// Returns `a b` up to the highest power kept, for an `a` with few terms.
#[inline(always)]
fn times(a: &Series, b: &Series) -> Series {
    let mut product = [0.0; ROW];
    for (i, a) in a.iter().enumerate().filter(|(_, a)| **a != 0.0) {
        product[i..].iter_mut().zip(b).for_each(|(s, b)| *s += a * b);
    }
    product
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
    pub fn shown(&self, step: &Jet, what: StepQuantity, out: &mut Vec<f64>) {
        let mut powers = [1.0; ROW];
        for k in 1..ROW {
            powers[k] = powers[k - 1] * step.reach;
        }
        let rows = Rows { motion: self, step, is_pressed: step.is_estimate, powers };
        let series = match what {
            StepQuantity::Time if !step.time.is_empty() => {
                return out.extend(step.time.iter().zip(&powers).map(|(t, p)| t * p));
            }
            StepQuantity::Time => return out.extend([0.0, step.span * step.reach]),
            StepQuantity::State(i) => Some(rows.every(step.dim, &step.state[i..])),
            StepQuantity::Deflection(j) => {
                let (flank, sense) = self.structure.flank_in(&self.mode, j);
                Some(scaled(sense, rows.deflection(flank)))
            }
            StepQuantity::Transmission(j) => Some(rows.transmission(j)),
            StepQuantity::Force(j) => {
                let (flank, sense) = self.structure.flank_in(&self.mode, j);
                rows.force(flank).map(|series| scaled(sense, series))
            }
            StepQuantity::ByDeflection(j) | StepQuantity::ByRate(j) | StepQuantity::ByLatch(j) => rows.change(j, what),
        };
        series.iter().for_each(|series| out.extend_from_slice(series));
    }

    /// Returns a power at the places `thetas`.
    #[inline(always)]
    pub fn sampled<P: Path>(&self, step: &Jet, what: Power, thetas: &Samples) -> Samples {
        let mut powers = [1.0; ROW];
        for k in 1..ROW {
            powers[k] = powers[k - 1] * step.reach;
        }
        let rows = Rows { motion: self, step, is_pressed: step.is_estimate, powers };
        let mut sum = [0.0; SAMPLES];
        match what {
            Power::Loss(j) => rows.loss::<P>(self.structure.flank_in(&self.mode, j).0, thetas, &mut sum),
            Power::Load => rows.load::<P>(thetas, &mut sum),
            Power::Damping => rows.damping::<P>(thetas, &mut sum),
            Power::Error => (0..self.parts.len()).for_each(|j| rows.error::<P>(j, thetas, &mut sum)),
            Power::Parametric => (0..self.parts.len()).for_each(|j| rows.parametric::<P>(j, thetas, &mut sum)),
            Power::Contacts => (0..self.parts.len()).for_each(|j| rows.loss::<P>(j, thetas, &mut sum)),
        }
        sum
    }
}

/// Returns the values of a series at `thetas`.
#[inline(always)]
fn values<P: Path>(series: &Series, thetas: &Samples) -> Samples {
    let mut values = [0.0; SAMPLES];
    for c in series.iter().rev() {
        for i in 0..SAMPLES {
            values[i] = fused::<P>(values[i], thetas[i], *c);
        }
    }
    values
}

/// Adds `factor a b`.
#[inline(always)]
fn add(sum: &mut Samples, factor: f64, a: &Samples, b: &Samples) {
    for i in 0..SAMPLES {
        sum[i] += factor * a[i] * b[i];
    }
}

struct Rows<'a> {
    motion: &'a Motion<'a>,
    step: &'a Jet,
    /// True if power laws are closed: all series that the recurrence has formed are available.
    is_pressed: bool,
    /// Powers of the reach. A step may be far shorter than the scale of its coefficients, whose products would overflow.
    powers: Series,
}

impl Rows<'_> {
    /// Returns a series in θ whose coefficients are `stride` apart.
    #[inline(always)]
    fn every(&self, stride: usize, values: &[f64]) -> Series {
        let (mut series, mut at) = ([0.0; ROW], 0);
        for (c, power) in series.iter_mut().zip(&self.powers) {
            *c = values[at] * power;
            at += stride;
        }
        series
    }

    /// Returns the force of contact `j`, if it is carried.
    fn force_of(&self, j: usize) -> Option<Force> {
        self.motion.parts[j].acting.filter(|a| a.is_carried).map(|a| a.force)
    }

    #[inline(always)]
    fn at_reach(&self, series: &Series) -> Series {
        std::array::from_fn(|k| series[k] * self.powers[k])
    }

    fn contact(&self, j: usize) -> &ContactRows {
        &self.step.rows.contacts[j]
    }

    #[inline(always)]
    fn deflection(&self, j: usize) -> Series {
        let deflections = &self.step.rows.deflections[j / LANES];
        std::array::from_fn(|k| deflections[k][j % LANES] * self.powers[k])
    }

    #[inline(always)]
    fn transmission(&self, j: usize) -> Series {
        let terms = self.motion.structure.contacts[j].direction.iter();
        let displacement = |i: u32| self.every(self.step.dim, &self.step.state[i as usize..]);
        sum(terms.map(|(i, g)| scaled(*g, displacement(*i)))).unwrap_or([0.0; ROW])
    }

    /// Returns `δ − σ b`.
    #[inline(always)]
    fn stretch(&self, j: usize) -> Series {
        let mut stretch = self.deflection(j);
        stretch[0] = self.step.rows.stretch(j);
        stretch
    }

    /// Returns `δ̇`, which the linear recurrence does not keep.
    #[inline(always)]
    fn rate(&self, j: usize) -> Series {
        if !self.motion.is_linear {
            return self.at_reach(&self.contact(j).rate);
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
                    // The linear recurrence does not form the last order of these forces.
                    _ => times(&self.stiffness(j), &self.stretch(j)),
                };
                if damping != 0.0 {
                    series.iter_mut().zip(self.rate(j)).for_each(|(f, r)| *f += damping * r);
                }
                Some(series)
            }
            // The contact leaves at this very instant.
            Force::Power { .. } if !self.is_pressed => None,
            _ => Some(self.at_reach(&self.contact(j).force)),
        }
    }

    /// Returns a varying stiffness, in plain time.
    #[inline(always)]
    fn stiffness(&self, j: usize) -> Series {
        let Spring::Waves(mean, waves) = &self.motion.structure.contacts[j].spring else {
            let Some(Force::Linear { stiffness: Elasticity::Ramp { slope, .. }, .. }) = self.force_of(j) else {
                return [0.0; ROW];
            };
            let mut ramp = [0.0; ROW];
            (ramp[0], ramp[1]) =
                (self.at_reach(&self.contact(j).stiffness)[0], slope * self.step.span * self.step.reach);
            return ramp;
        };
        let mut series = self.follow(waves.iter().copied()).unwrap_or([0.0; ROW]);
        series[0] += mean;
        series
    }

    /// Adds `c δ̇²`, or `K pⁿ χ ṗ²`, if there is such a power.
    #[inline(always)]
    fn loss<P: Path>(&self, j: usize, thetas: &Samples, sum: &mut Samples) {
        match self.force_of(j) {
            Some(Force::Linear { damping, .. }) if damping != 0.0 => {
                let rate = values::<P>(&self.rate(j), thetas);
                add(sum, damping, &rate, &rate);
            }
            Some(force @ Force::Power { stiffness, .. }) if self.is_pressed && force.chi(&self.step.state) != 0.0 => {
                let (rate, power) = (
                    values::<P>(&self.at_reach(&self.contact(j).rate), thetas),
                    values::<P>(&self.at_reach(&self.contact(j).power), thetas),
                );
                let squares = std::array::from_fn(|i| rate[i] * rate[i]);
                add(sum, force.chi(&self.step.state) * stiffness, &power, &squares);
            }
            _ => {}
        }
    }

    /// Adds `−F ė`, if the error moves and the force is carried.
    #[inline(always)]
    fn error<P: Path>(&self, j: usize, thetas: &Samples, sum: &mut Samples) {
        let contact = &self.motion.structure.contacts[j];
        let Some(rate) = self.follow(contact.error_rate.iter().copied()) else { return };
        let Some(force) = self.force(j) else { return };
        add(sum, -1.0, &values::<P>(&force, thetas), &values::<P>(&rate, thetas));
    }

    /// Adds `½ k̇ (δ − σ b)²`, if the stiffness moves.
    #[inline(always)]
    fn parametric<P: Path>(&self, j: usize, thetas: &Samples, sum: &mut Samples) {
        let s = self.motion.structure;
        if s.is_load(j) {
            return;
        }
        let Some(Force::Linear { stiffness, .. }) = self.force_of(j) else { return };
        let rate = match (stiffness, &s.contacts[j].spring) {
            (Elasticity::Ramp { slope, .. }, _) => Some(std::array::from_fn(|k| if k == 0 { slope } else { 0.0 })),
            (Elasticity::Waves, Spring::Waves(_, waves)) => {
                self.follow(waves.iter().map(|w| w.rate(s.oscillators[w.index].omega)))
            }
            _ => None,
        };
        let Some(rate) = rate else { return };
        let stretch = values::<P>(&self.stretch(j), thetas);
        let squares = std::array::from_fn(|i| stretch[i] * stretch[i]);
        add(sum, 0.5, &values::<P>(&rate, thetas), &squares);
    }

    /// Returns the derivative of the force of contact `j` with respect to `what`, times `dt/dθ`; `None` for zero.
    fn change(&self, j: usize, what: StepQuantity) -> Option<Series> {
        let force = self.force_of(j)?;
        let clock: Series = match !self.step.time.is_empty() {
            true => gather(
                self.step.time[1..].iter().zip(&self.powers[1..]).enumerate().map(|(k, (t, p))| (k + 1) as f64 * t * p),
            ),
            false => gather(std::iter::once(self.step.span * self.step.reach)),
        };
        match (force, what) {
            (Force::Linear { stiffness: Elasticity::Constant(k), .. }, StepQuantity::ByDeflection(_)) => {
                Some(scaled(k, clock))
            }
            (Force::Linear { .. }, StepQuantity::ByDeflection(_)) if self.is_pressed => {
                Some(times(&clock, &self.at_reach(&self.contact(j).stiffness)))
            }
            (Force::Linear { .. }, StepQuantity::ByDeflection(_)) => Some(times(&clock, &self.stiffness(j))),
            (Force::Linear { damping, .. }, StepQuantity::ByRate(_)) => Some(scaled(damping, clock)),
            // The contact leaves at this very instant.
            (Force::Power { .. }, _) if !self.is_pressed => None,
            (Force::Power { law, stiffness, .. }, StepQuantity::ByDeflection(_)) => {
                // A force that is left out does not change either.
                if self.at_reach(&self.contact(j).power).iter().all(|c| *c == 0.0) {
                    return None;
                }
                let n = law.exponent.value();
                let slope = scaled(n * stiffness, times(&clock, &self.slope(j, law)?));
                Some(times(&slope, &self.at_reach(&self.contact(j).factor)))
            }
            (Force::Power { stiffness, latch: Some(latch), .. }, _) => {
                let chi = force.chi(&self.step.state);
                let damped = scaled(chi * stiffness, times(&clock, &self.at_reach(&self.contact(j).power)));
                match what {
                    StepQuantity::ByRate(_) => Some(damped),
                    _ => Some(scaled(
                        -self.step.state[latch].recip(),
                        times(&damped, &self.at_reach(&self.contact(j).rate)),
                    )),
                }
            }
            _ => None,
        }
    }

    /// Returns `pⁿ⁻¹` of a closed power law; `None` if it has no series, and the force is left out.
    fn slope(&self, j: usize, law: PowerLaw) -> Option<Series> {
        let p = self.at_reach(&self.contact(j).penetration);
        let owner = self.step.rows.owner;
        let (m, q) = (law.exponent.p as usize, law.exponent.q as usize);
        let owns = owner == Some(j) || self.motion.goes_with(owner, j, &self.step.state, &self.step.rows);
        // `p = y^q`: `pⁿ⁻¹ = y^(m − q)`, products only; also for whole exponents, with `y = p`. No small penetration is a divisor.
        if owns || q == 1 {
            let y = if owns { self.at_reach(self.step.rows.clock.y(1)) } else { p };
            let mut power: Series = gather(std::iter::once(1.0));
            for _ in 0..m - q {
                power = times(&power, &y);
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

    /// Returns the velocity along a vector `[n]`.
    #[inline(always)]
    fn along(&self, vector: &[f64]) -> Series {
        let terms = vector.iter().enumerate().filter(|(_, c)| **c != 0.0);
        sum(terms.map(|(i, c)| scaled(*c, self.velocity(i)))).unwrap_or([0.0; ROW])
    }

    #[inline(always)]
    fn load<P: Path>(&self, thetas: &Samples, sum: &mut Samples) {
        let s = self.motion.structure;
        add(sum, 1.0, &[1.0; SAMPLES], &values::<P>(&self.along(&s.spec.load), thetas));
        for (load, wave) in s.spec.load_harmonics.iter().zip(&s.load_waves) {
            let (sin, cos) = libm::sincos(load.phase);
            if let Some(force) = self.follow([Wave { index: wave.index, cosine: cos, sine: -sin }].into_iter()) {
                add(sum, 1.0, &values::<P>(&force, thetas), &values::<P>(&self.along(&load.vector), thetas));
            }
        }
        for (load, j) in s.spec.load_schedules.iter().zip(s.flanks()..) {
            if let Some(force) = self.force(j) {
                add(sum, 1.0, &values::<P>(&force, thetas), &values::<P>(&self.along(&load.vector), thetas));
            }
        }
    }

    /// Adds `q̇ᵀ C q̇`, each pair of degrees of freedom once, if there is damping.
    #[inline(always)]
    fn damping<P: Path>(&self, thetas: &Samples, sum: &mut Samples) {
        let n = self.motion.structure.n;
        let mut velocities: SmallVec<[Samples; MANY]> = SmallVec::with_capacity(n);
        for i in 0..n {
            velocities.push(values::<P>(&self.velocity(i), thetas));
        }
        for (i, column) in self.motion.structure.forms[1].iter().enumerate() {
            for (j, c) in column.iter().map(|(j, c)| (*j as usize, *c)).filter(|(j, _)| *j <= i) {
                add(sum, if i == j { c } else { 2.0 * c }, &velocities[i], &velocities[j]);
            }
        }
    }

    /// Returns a sum of oscillators. The linear recurrence does not keep them: in plain time each order follows from the one before.
    #[inline(always)]
    fn follow(&self, waves: impl Iterator<Item = Wave>) -> Option<Series> {
        sum(waves.map(|w| {
            let [cosine, sine] = &self.step.rows.oscillators[w.index];
            if self.is_pressed {
                return std::array::from_fn(|k| (w.cosine * cosine[k] + w.sine * sine[k]) * self.powers[k]);
            }
            let omega = self.motion.structure.oscillators[w.index].omega;
            let (mut cos, mut sin) = (cosine[0], sine[0]);
            std::array::from_fn(|k| {
                let value = w.cosine * cos + w.sine * sin;
                let f = self.step.span * self.step.reach * omega / (k + 1) as f64;
                (cos, sin) = (-f * sin, f * cos);
                value
            })
        }))
    }
}
