//! Error of a step while power laws are closed, from its defect.
//!
//! In the clock of the step the truncated series are polynomials `z(θ)`, and their defect in `z′ = f(z)` is known: the
//! terms of f from order N on, `N` the last order kept. Sums of absolute coefficients bound these terms, products of
//! all orders included. With `D = Σ_{k≥N} |d_k|/(k+1)` and B a bound on `|∂f/∂z|` over the step, the error obeys
//! `|e|′ ≤ B|e| + |d|`, and so `|e| ≤ exp(B) D`, for the four parts of z together: the root y, the time, displacements
//! and deflections, velocities. This is a proof up to the square of the error, which enters B, and up to rounding.
//! `pⁿ` of a contact that does not own the clock is no polynomial. Its series u has the residual `R = p u′ − n p′ u`,
//! and `|pⁿ − u| ≤ (max p/min p)ⁿ Σ|R_k|/(k+1)/min p`.

use super::sizes::{Factor, Sizes, beyond, largest_of, paired, sizes, tails, total};
use crate::{
    gear::contact::PowerLaw,
    hybrid::Jet,
    kernel::{
        Elasticity, Expansion, Force, LANES, ORDER, ROUNDING, ROW, Series, StepRows,
        series::{
            clock::StepClock,
            clocked::Room,
            fours::{ContactAction, FourSeries, FourSums},
        },
    },
    system::{Contact, Spring, Structure, Wave, zeros},
    vectors::Path,
};

/// Bounds on the error of a step in a root clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Defect {
    /// Error of the root y.
    pub root: f64,
    /// Error of the time, s.
    pub time: f64,
    /// Error of displacements over `1/√M_ii` and of deflections over `Contact::across`.
    pub stretch: f64,
    /// Error of velocities, in the same weights.
    pub rate: f64,
    /// Error of accelerations, in the same weights.
    pub acceleration: f64,
    /// Factors on the error of accelerations of an error of the stretches and of the rates.
    pub felt: [f64; 2],
}

impl Defect {
    /// Returns the error of the deflection of `c`, m.
    pub fn of_deflection(&self, c: &Contact) -> f64 {
        self.stretch * c.across
    }

    /// Returns the error of the force that holds `c`, N.
    pub fn of_force(&self, s: &Structure, c: &Contact) -> f64 {
        (self.acceleration * c.across + self.time * s.wave_size(&c.error, 3)) * c.effective_mass()
    }
}

/// Data that are the same for all lengths of a step: for each order the largest size of all bodies, contacts or oscillators. Products of
/// such sizes bound those of each single one.
pub struct Largest {
    /// Weighted velocities and accelerations.
    pub velocity: Sizes,
    acceleration: Sizes,
    /// Rates of contacts over `Contact::across`.
    rate: Sizes,
    /// Rates as weighted velocities of the mass at the contact.
    pub felt: Sizes,
    /// Sum `|cos| + |sin|` of the oscillators.
    ring: Sizes,
}

/// Bound on the Jacobian of the accelerations, and truncation of the forces.
#[derive(Default)]
struct Forces {
    by_root: f64,
    by_time: f64,
    by_stretch: f64,
    by_rate: f64,
    missing: f64,
}

impl Structure {
    /// Returns `Σ ωᵏ |amplitude|`.
    pub(in crate::kernel) fn wave_size(&self, waves: &[Wave], k: i32) -> f64 {
        waves.iter().map(|w| self.oscillators[w.index].omega.powi(k) * libm::hypot(w.cosine, w.sine)).sum()
    }
}

impl Expansion<'_> {
    #[inline(always)]
    pub fn largest<P: Path>(&self, path: P, room: &Room, out: &Jet) -> Largest {
        let (s, rows) = (self.s, &out.rows);
        let zero = [0.0; ROW];
        let mut largest = Largest { velocity: zero, acceleration: zero, rate: zero, felt: zero, ring: zero };
        let blocks = &s.columns.blocks;
        for (sizes, rows) in
            [(&mut largest.velocity, &room.velocities), (&mut largest.acceleration, &room.accelerations)]
        {
            for (size, row) in sizes.iter_mut().zip(rows.chunks_exact(rows.len() / ROW)) {
                let mut most = path.all(0.0);
                for (x, block) in row.iter().zip(blocks) {
                    let weighted = path.times(path.sizes(path.four(*x)), path.four(block.weights));
                    most = path.larger(weighted, most);
                }
                *size = largest_of(&path.numbers(most));
            }
        }
        for k in 0..ROW {
            let [mut rates, mut felt] = [path.all(0.0); 2];
            for four in &room.fours {
                let rate = path.sizes(path.four(four.rate[k]));
                rates = path.larger(path.times(rate, path.four(four.per_across)), rates);
                felt = path.larger(path.times(rate, path.four(four.weight)), felt);
            }
            (largest.rate[k], largest.felt[k]) = (largest_of(&path.numbers(rates)), largest_of(&path.numbers(felt)));
        }
        for i in 0..s.oscillators.len() {
            let [cosines, sines] = &rows.oscillators[i];
            let both = cosines.iter().zip(sines).map(|(c, s)| c.abs() + s.abs());
            largest.ring.iter_mut().zip(both).for_each(|(m, r)| *m = m.max(r));
        }
        largest
    }

    /// Returns the largest ratio of an error up to `theta` to the size of its quantity, and the errors.
    #[inline(always)]
    pub fn defect<P: Path>(
        &self,
        path: P,
        clock: &StepClock,
        theta: f64,
        largest: &Largest,
        fours: &[FourSeries],
        out: &Jet,
    ) -> (f64, Defect) {
        let (s, rows) = (self.s, &out.rows);
        let (span, errors) = (self.h * theta, &self.motion.forcing.errors);
        let mut powers = [1.0; ROW];
        (1..ROW).for_each(|k| powers[k] = powers[k - 1] * theta);
        let per = span / ROW as f64;
        let owner = clock.owner.filter(|_| !clock.is_plain());
        let root = Root::new(owner.map(|owner| (owner, clock.root)), &powers, rows);
        let w = Factor::new(sizes(&rows.clock.weight, &powers), root.left);
        // Truncation of the products with w, and sizes of their other factor.
        let tails = tails(&w.sizes, ORDER);
        let through = |other: &Sizes| paired(other, &tails) + w.missing * total(other);
        let mut d = Defect { time: per * (w.sizes[ORDER] + w.missing), ..Defect::default() };
        let [velocity, accelerations, rates, felt, ring] =
            [&largest.velocity, &largest.acceleration, &largest.rate, &largest.felt, &largest.ring]
                .map(|series| sizes(series, &powers));
        d.stretch = per * f64::max(through(&velocity), through(&rates));
        d.rate = per * through(&accelerations);
        d.time += per * through(&ring);
        let (moved, acceleration) = (total(&velocity), total(&accelerations));
        let speed = moved.max(total(&rates));
        let mut size = moved.max(total(&felt));
        let [by_stretch, by_rate] = self.motion.forcing.norms;
        let mut forces = Forces { by_stretch, by_rate, ..Forces::default() };
        for l in &s.load_waves {
            forces.by_time += l.size(&s.weights) * s.oscillators[l.index].omega;
        }
        let mut least = f64::INFINITY;
        for (chunk, four) in fours.iter().enumerate() {
            let contacts = LANES * chunk..s.contacts.len().min(LANES * chunk + LANES);
            let sums = if four.does.iter().any(ContactAction::presses) {
                four.sums(path, &powers)
            } else {
                FourSums::default()
            };
            for (l, j) in contacts.enumerate() {
                let (c, part) = (&s.contacts[j], &self.motion.parts[j]);
                let push = c.push_norm;
                if owner == Some(j) {
                    d.root = per * four.rate[ORDER][l].abs() * powers[ORDER];
                }
                match four.does[l] {
                    ContactAction::Nothing | ContactAction::Watched => continue,
                    ContactAction::Spring | ContactAction::Else => {
                        self.linear_defect(j, &powers, rows, &mut forces);
                        continue;
                    }
                    ContactAction::Pressed | ContactAction::AsOwner(_) | ContactAction::Alone(_) => {}
                }
                let Some(power @ Force::Power { law, stiffness, .. }) = part.force() else { continue };
                let (k, e, chi) = (push * stiffness, law.exponent.value(), power.chi(self.request.x));
                let [p, f] = [sums.penetration[l], sums.factor[l]];
                let pressed = law.exponent.power(p);
                let missing = match four.does[l] {
                    ContactAction::Pressed => {
                        let (least, slope) = (2.0 * sums.start[l] - p, if p > 0.0 { e * pressed / p } else { 0.0 });
                        forces.by_stretch += k * slope * f * c.across;
                        match least > 0.0 {
                            true => e * sums.shortened[l] * law.exponent.power(p / least) / least,
                            false => f64::INFINITY,
                        }
                    }
                    _ => {
                        let penetration = |j: usize| sizes(&rows.contacts[j].penetration, &powers);
                        let goes = matches!(four.does[l], ContactAction::AsOwner(_));
                        let owner = if goes { clock.owner } else { Some(j).filter(|j| clock.owner == Some(*j)) };
                        if let Some(i) = owner.filter(|_| clock.root == law.exponent.q) {
                            let left = root.power(law, k * f, (i, penetration(i)), c, &mut forces);
                            let apart = || sizes(&rows.contacts[j].apart, &powers);
                            let rounding = ROUNDING * rows.size(j);
                            left + if goes { root.beside(law, &apart(), rounding) } else { 0.0 }
                        } else {
                            let slope = if p > 0.0 { e * pressed / p } else { 0.0 };
                            forces.by_stretch += k * slope * f * c.across;
                            missing_power(&penetration(j), &sizes(&rows.contacts[j].power, &powers), e)
                        }
                    }
                };
                forces.by_rate += k * pressed * chi * c.across;
                forces.by_time += k * pressed * chi * errors[j][2].sum;
                forces.missing += k * (sums.product[l] + missing * f);
                // A penetration p within its rounding does not resolve speeds below p times the frequency of the contact.
                size = size.max((e * c.spec.stiffness.mean() * pressed * p).sqrt());
                least = least.min(p / c.across);
            }
        }
        let held = self.projector(&mut forces);
        d.rate += per * w.total * held * forces.missing;
        let swing = self.motion.forcing.swing;
        let (own_swing, own_across) = owner.map_or((0.0, 0.0), |j| (errors[j][2].sum, s.contacts[j].across));
        // Rows and columns: root, time, stretch, rate.
        let b = [
            [0.0, span * own_swing, 0.0, span * own_across],
            [span * root.by_root, 0.0, 0.0, 0.0],
            [span * root.by_root * speed, span * w.total * swing, 0.0, span * w.total],
            [
                span * (root.by_root * acceleration + w.total * held * forces.by_root),
                span * w.total * held * forces.by_time,
                span * w.total * held * forces.by_stretch,
                span * w.total * held * forces.by_rate,
            ],
        ];
        let [at_root, time, stretch, rate] = grown(path, &b, [d.root, d.time, d.stretch, d.rate]);
        let elapsed = match clock.is_plain() {
            true => span,
            false => out.time.iter().zip(&powers).map(|(t, power)| t.abs() * power).sum::<f64>(),
        };
        let parts = [(rate, size), (stretch, least), (at_root, root.y.total), (time, elapsed)];
        // Without motion there is no error. A comparison with NaN is false.
        let share = parts.iter().fold(0.0, |m: f64, (e, size)| match e / size {
            _ if *e == 0.0 => m,
            ratio if ratio <= m => m,
            ratio if ratio > m => ratio,
            _ => f64::INFINITY,
        });
        let felt = forces.by_time * time + forces.by_stretch * stretch + forces.by_rate * rate + forces.missing;
        let acceleration = held * (forces.by_root * at_root + felt);
        let felt = [held * forces.by_stretch, held * forces.by_rate];
        (share, Defect { root: at_root, time, stretch, rate, acceleration, felt })
    }

    /// Adds the defect of a linear law to `forces`.
    fn linear_defect(&self, j: usize, powers: &Sizes, rows: &StepRows, forces: &mut Forces) {
        let (c, errors) = (&self.s.contacts[j], &self.motion.forcing.errors[j]);
        let push = c.push_norm;
        let Some((stiffness, damping)) = self.motion.parts[j].carried_linear() else { return };
        forces.by_stretch += push * c.across * c.stiffest;
        forces.by_rate += push * c.across * damping;
        forces.by_time += push * damping * errors[2].sum;
        if !stiffness.varies() {
            return;
        }
        let by_time = match (stiffness, &c.spring) {
            (Elasticity::Ramp { slope, .. }, _) => slope.abs(),
            (_, Spring::Waves(_, waves)) => self.s.wave_size(waves, 1),
            _ => 0.0,
        };
        let penetration = sizes(&rows.contacts[j].penetration, powers);
        forces.by_time += push * by_time * total(&penetration);
        forces.missing += push * beyond(&sizes(&rows.contacts[j].stiffness, powers), &penetration, ORDER + 1);
    }

    /// Returns the truncation of the product `k(t) p` of contact `j` in a root clock, N.
    pub fn rooted_product_tail(&self, j: usize, out: &Jet) -> f64 {
        if !matches!(self.motion.parts[j].force(), Some(Force::Linear { stiffness, .. }) if stiffness.varies()) {
            return 0.0;
        }
        let sizes = |row: &Series| -> Sizes { std::array::from_fn(|k| row[k].abs() * out.reach.powi(k as i32)) };
        let contact = &out.rows.contacts[j];
        beyond(&sizes(&contact.stiffness), &sizes(&contact.penetration), ORDER + 1)
    }

    /// Returns the norm of the projector that holds the rigid contacts at rest, and adds the part of their flanks to `forces`.
    fn projector(&self, forces: &mut Forces) -> f64 {
        let s = self.s;
        let Some(held) = &self.motion.held else { return 1.0 };
        let mut norm = 1.0;
        for (k, &j) in held.contacts().iter().enumerate() {
            let mut f = zeros(held.contacts().len());
            f[k] = 1.0;
            held.solve(&mut f);
            for (f, &i) in f.iter().zip(held.contacts()) {
                let push = s.contacts[i].push_norm;
                norm += push * f.abs() * s.contacts[j].across;
                forces.by_time += push * f.abs() * s.wave_size(&s.contacts[j].error, 3);
            }
        }
        norm
    }
}

/// Root y of the penetration of the owner, if it is the clock, and its powers.
struct Root<'a> {
    y: Factor,
    /// Truncations of y², y³, ….
    missing: [f64; 17],
    /// Truncation of w.
    left: f64,
    /// Bound on `|∂w/∂y|`.
    by_root: f64,
    powers: &'a Sizes,
    rows: &'a StepRows,
}

impl<'a> Root<'a> {
    #[inline(always)]
    fn new(owner: Option<(usize, u32)>, powers: &'a Sizes, rows: &'a StepRows) -> Self {
        let mut missing = [0.0; 17];
        let Some((_, root)) = owner else {
            return Self { y: Factor::new([0.0; ROW], 0.0), missing, left: 0.0, by_root: 0.0, powers, rows };
        };
        let y_to = |m: usize| sizes(rows.clock.y(m), powers);
        let y = Factor::new(y_to(1), 0.0);
        for m in 2..root as usize {
            missing[m] = Factor::new(y_to(m - 1), missing[m - 1]).product(&y);
        }
        let by_root = match root {
            2 => 2.0,
            q => f64::from(q) * f64::from(q - 1) * total(&y_to(q as usize - 2)),
        };
        let left = f64::from(root) * missing[root as usize - 1];
        Self { y, missing, left, by_root, powers, rows }
    }

    /// Returns the truncation of `pⁿ` of the owner `j`, a product of powers of y, and adds the Jacobian of its force `k pⁿ` to `forces`.
    fn power(&self, law: PowerLaw, k: f64, (j, penetration): (usize, Sizes), c: &Contact, forces: &mut Forces) -> f64 {
        let p = Factor::new(penetration, 0.0);
        let (a, r) = ((law.exponent.p / law.exponent.q) as i32, (law.exponent.p % law.exponent.q) as usize);
        let (clock, p_row, mut left) = (&self.rows.clock, &self.rows.contacts[j].penetration, 0.0);
        for m in 2..=a as usize {
            left = Factor::new(sizes(clock.p(m - 1, p_row), self.powers), left).product(&p);
        }
        let y = self.y.total;
        forces.by_stretch += k * f64::from(a) * p.total.powi(a - 1) * y.powi(r as i32) * c.across;
        if r == 0 {
            return left;
        }
        let root = Factor::new(sizes(clock.y(r), self.powers), self.missing[r]);
        forces.by_root += k * p.total.powi(a) * r as f64 * y.powi(r as i32 - 1);
        Factor::new(sizes(clock.p(a.max(1) as usize, p_row), self.powers), left).product(&root)
    }

    /// Returns the remainder of `(p + d)ⁿ` after `pⁿ + n pⁿ⁻¹ d`, `1 < n < 2`, with d of the sizes `apart`: at most `(4 d)ⁿ`. If d is the
    /// larger one, each of the three terms is at most that, and if p is, `n (n − 1)/2 pⁿ⁻² d²` is. A d within the `rounding` of the state
    /// counts as zero. The truncation of the series of the product is added.
    fn beside(&self, law: PowerLaw, apart: &Sizes, rounding: f64) -> f64 {
        let (n, m) = (law.exponent.value(), (law.exponent.p - law.exponent.q) as usize);
        let slope = Factor::new(sizes(self.rows.clock.y(m), self.powers), self.missing[m]);
        n * slope.product(&Factor::new(*apart, 0.0)) + libm::pow(4.0 * (total(apart) - rounding).max(0.0), n)
    }
}

/// Returns `exp(B) d`.
#[inline(always)]
fn grown<P: Path>(path: P, b: &[[f64; 4]; 4], d: [f64; 4]) -> [f64; 4] {
    let mut columns = [path.all(0.0); 4];
    for j in 0..4 {
        columns[j] = path.four([b[0][j], b[1][j], b[2][j], b[3][j]]);
    }
    let (mut sum, mut term) = (path.four(d), d);
    for k in 1..60 {
        let mut next = path.all(0.0);
        for j in 0..4 {
            next = path.fused(columns[j], path.all(term[j]), next);
        }
        let next = path.times(next, path.all(1.0 / k as f64));
        sum = path.plus(sum, next);
        term = path.numbers(next);
        let share = path.numbers(path.times(path.all(1e-3), sum));
        if term.iter().zip(&share).all(|(t, s)| t <= s) {
            return path.numbers(path.times(path.all(1.01), sum));
        }
    }
    [f64::INFINITY; 4]
}

/// Returns the truncation of the series of `pⁿ`: the whole of `pⁿ` if it has no power series in this clock and is written as zero.
#[inline(always)]
fn missing_power(p: &Sizes, power: &Sizes, n: f64) -> f64 {
    let zeros = p.iter().take_while(|c| **c == 0.0).count();
    if zeros == ROW {
        return 0.0;
    }
    let first = p[zeros];
    let others: f64 = p[zeros + 1..].iter().sum();
    if power.iter().all(|c| *c == 0.0) {
        // The term has order mn in θ in place of N, so that its integral is larger by the ratio.
        return libm::pow(first + others, n) * ROW as f64 / (zeros as f64 * n + 1.0);
    }
    let (least, most) = (first - others, first + others);
    if least <= 0.0 {
        return f64::INFINITY;
    }
    n * beyond(p, power, ORDER + 1 + zeros) * libm::pow(most / least, n) / least
}
