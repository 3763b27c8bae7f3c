//! Taylor series of the motion in one mode, by recurrence in a clock θ:
//!
//! `t = t₀ + h θ^Q` (Q = 1 is plain time; Q > 1 opens power laws with fractional exponents that start at an exact zero),
//! or `dt = h q y^(q−1) dθ` with `y = p^(1/q)` of a power-law contact that nears its flank.

use flank::hybrid::ContactMode;

use super::{
    linear::dot,
    model::{Law, Model, Spring},
    powers::{Chain, Root, product},
    rest::Rest,
    state::State,
    wide::{Wide, near, root, sin_cos, size, wide},
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    Fraction(usize),
    /// Of this contact.
    Root(usize),
}

/// The series of one step; all `[order + 1]`.
pub struct Series {
    pub clock: Clock,
    pub h: Wide,
    pub q: Vec<Vec<Wide>>,
    pub v: Vec<Vec<Wide>>,
    /// Time since the start of the step.
    pub time: Vec<Wide>,
    /// Penetration on its side, of contacts that are not separated; `y` for the owner of a root clock.
    pub depth: Vec<Vec<Wide>>,
    /// `σF` of Kelvin-Voigt laws, `1 + χ ṗ` of power laws, `σλ` of rigid contacts at rest.
    pub force: Vec<Vec<Wide>>,
    /// Oscillators.
    cos: Vec<Vec<Wide>>,
    sin: Vec<Vec<Wide>>,
    /// Sizes of the terms of the acceleration along each contact at rest.
    held_size: Vec<Vec<f64>>,
}

/// `K(t)` as a series.
struct Stiffness {
    series: Vec<Wide>,
    slope: Wide,
    is_constant: bool,
}

struct Builder<'a> {
    m: &'a Model,
    s: &'a State,
    out: Series,
    tau: Vec<Wide>,
    chain: Option<Chain>,
    powers: Vec<Option<Power>>,
    stiffness: Vec<Stiffness>,
    delta: Vec<Vec<Wide>>,
    rate: Vec<Vec<Wide>>,
    accelerations: Vec<Vec<Wide>>,
}

/// How a power of a penetration is built up.
enum Power {
    Whole(Chain),
    Ratio(Root),
}

/// Expands the motion. Contacts of `rest` are held, or decided upon, order by order.
pub fn expand(m: &Model, s: &State, clock: Clock, h: f64, order: usize, rest: &mut Rest) -> Series {
    let mut b = Builder::new(m, s, clock, wide(h));
    for k in 0..=order {
        b.order(k, rest);
    }
    b.out
}

impl<'a> Builder<'a> {
    fn new(m: &'a Model, s: &'a State, clock: Clock, h: Wide) -> Self {
        let angles: Vec<(Wide, Wide)> = m.omegas.iter().map(|w| sin_cos(*w * s.t)).collect();
        let count = m.contacts.len();
        let zeros = match clock {
            Clock::Fraction(q) => q,
            Clock::Root(_) => 1,
        };
        let (mut chain, mut depth) = (None, vec![Vec::new(); count]);
        let powers = (0..count)
            .map(|j| match m.contacts[j].law {
                Law::Power { p, q, .. } if s.contacts[j].mode != ContactMode::Separated => {
                    if clock == Clock::Root(j) {
                        let mut powers = Chain::new(&[q - 1, p]);
                        let y = root(-s.gap(m, j, s.contacts[j].side).0, q);
                        powers.push(y);
                        depth[j].push(y);
                        chain = Some(powers);
                        None
                    } else if q == 1 {
                        Some(Power::Whole(Chain::new(&[p])))
                    } else {
                        Some(Power::Ratio(Root::new(p, q, s.contacts[j].zeros * zeros)))
                    }
                }
                _ => None,
            })
            .collect();
        let stiffness = m
            .contacts
            .iter()
            .map(|c| {
                let (_, slope) = c.spring.at(s.t);
                Stiffness {
                    series: Vec::new(),
                    slope,
                    is_constant: !matches!(c.spring, Spring::Waves(..)) && slope == wide(0.0),
                }
            })
            .collect();
        let out = Series {
            clock,
            h,
            q: s.q.iter().map(|x| vec![*x]).collect(),
            v: s.v.iter().map(|x| vec![*x]).collect(),
            time: vec![wide(0.0)],
            depth,
            force: vec![Vec::new(); count],
            cos: angles.iter().map(|a| vec![a.1]).collect(),
            sin: angles.iter().map(|a| vec![a.0]).collect(),
            held_size: vec![Vec::new(); count],
        };
        let empty = || vec![Vec::new(); count];
        let accelerations = vec![Vec::new(); m.n];
        Self { m, s, out, tau: Vec::new(), chain, powers, stiffness, delta: empty(), rate: empty(), accelerations }
    }

    /// `Σ (c cos + s sin)` at order k.
    fn waves(&self, waves: &[super::model::Wave], k: usize) -> Wide {
        waves
            .iter()
            .fold(wide(0.0), |s, w| s + w.c * self.out.cos[w.oscillator][k] + w.s * self.out.sin[w.oscillator][k])
    }

    /// The first and second derivative of an error in time, at order k.
    fn error_rates(&self, waves: &[super::model::Wave], k: usize) -> (Wide, Wide) {
        waves.iter().fold((wide(0.0), wide(0.0)), |(d, dd), w| {
            let (o, c, s) = (self.m.omegas[w.oscillator], self.out.cos[w.oscillator][k], self.out.sin[w.oscillator][k]);
            (d + o * (w.s * c - w.c * s), dd - o * o * (w.c * c + w.s * s))
        })
    }

    /// `(dt/dθ · f)` at order k.
    fn by_clock(&self, f: &[Wide], k: usize) -> Wide {
        match self.out.clock {
            Clock::Fraction(q) if k + 1 >= q => self.out.h * wide(q as f64) * f[k + 1 - q],
            Clock::Fraction(_) => wide(0.0),
            Clock::Root(_) => product(&self.tau, f, k),
        }
    }

    fn order(&mut self, k: usize, rest: &mut Rest) {
        let m = self.m;
        let column = |x: &[Vec<Wide>]| -> Vec<Wide> { x.iter().map(|x| x[k]).collect() };
        let (q, v) = (column(&self.out.q), column(&self.out.v));
        for (j, c) in m.contacts.iter().enumerate() {
            let e = self.waves(&c.error, k) + if k == 0 { c.offset } else { wide(0.0) };
            let (rate, _) = self.error_rates(&c.error, k);
            self.delta[j].push(dot(&c.g, &q) - e);
            self.rate[j].push(dot(&c.g, &v) - rate);
            self.push_stiffness(j, k);
        }
        if let (Clock::Root(j), Some(chain)) = (self.out.clock, &self.chain) {
            let Law::Power { q, .. } = m.contacts[j].law else { return };
            self.tau.push(self.out.h * wide(q as f64) * chain.get(q - 1, k));
        }
        // Accelerations without contacts at rest.
        let mut a: Vec<Wide> = (0..m.n).map(|i| -(dot(&m.k[i], &q) + dot(&m.c[i], &v))).collect();
        let mut sizes: Vec<f64> = (0..m.n)
            .map(|i| (0..m.n).map(|l| near(m.k[i][l] * q[l]).abs() + near(m.c[i][l] * v[l]).abs()).sum())
            .collect();
        if k == 0 {
            (0..m.n).for_each(|i| {
                a[i] = a[i] + m.load[i];
                sizes[i] += size(m.load[i]);
            });
        }
        for (schedule, vector) in &m.load_schedules {
            let (value, slope) = schedule.at(self.s.t);
            let factor = if k == 0 { value } else { slope * self.out.time[k] };
            (0..m.n).for_each(|i| {
                a[i] = a[i] + vector[i] * factor;
                sizes[i] += size(vector[i] * factor);
            });
        }
        for (o, cos, sin) in &m.loads {
            let (c, s) = (self.out.cos[*o][k], self.out.sin[*o][k]);
            let swing = size(c) + size(s);
            (0..m.n).for_each(|i| {
                a[i] = a[i] + cos[i] * c + sin[i] * s;
                sizes[i] += (size(cos[i]) + size(sin[i])) * swing;
            });
        }
        for j in 0..m.contacts.len() {
            let f = self.law_force(j, k);
            if self.s.contacts[j].mode == ContactMode::Drive || self.s.contacts[j].mode == ContactMode::Back {
                (0..m.n).for_each(|i| {
                    let push = m.contacts[j].push[i] * f;
                    a[i] = a[i] - push;
                    sizes[i] += size(push);
                });
            }
        }
        if !rest.contacts.is_empty() {
            let needs: Vec<(Wide, f64)> = rest
                .contacts
                .iter()
                .map(|held| {
                    let c = &m.contacts[held.contact];
                    let (_, dd) = self.error_rates(&c.error, k);
                    let terms: f64 = c.g.iter().zip(&sizes).map(|(g, s)| near(*g).abs() * s).sum();
                    let shaken: f64 =
                        c.error.iter().map(|w| near(m.omegas[w.oscillator]).powi(2) * self.out.swing(w, k)).sum();
                    (dot(&c.g, &a) - dd, terms + shaken)
                })
                .collect();
            rest.contacts.iter().zip(&needs).for_each(|(held, n)| self.out.held_size[held.contact].push(n.1));
            for (held, force) in rest.contacts.clone().iter().zip(rest.solve(m, k, &needs)) {
                self.out.force[held.contact].push(force);
                let f = wide(held.side) * force;
                (0..m.n).for_each(|i| a[i] = a[i] - m.contacts[held.contact].push[i] * f);
            }
        }
        self.advance(k, &a);
    }

    /// Coefficients k + 1 of all that the clock drives.
    fn advance(&mut self, k: usize, a: &[Wide]) {
        let over = wide((k + 1) as f64);
        for i in 0..self.m.n {
            let next = self.by_clock(&self.out.v[i], k) / over;
            self.out.q[i].push(next);
        }
        for (i, a) in a.iter().enumerate() {
            self.accelerations[i].push(*a);
            let next = self.by_clock(&self.accelerations[i], k) / over;
            self.out.v[i].push(next);
        }
        for o in 0..self.m.omegas.len() {
            let w = self.m.omegas[o];
            let (c, s) = (self.by_clock(&self.out.cos[o], k), self.by_clock(&self.out.sin[o], k));
            self.out.cos[o].push(-(w * s) / over);
            self.out.sin[o].push(w * c / over);
        }
        let time = match self.out.clock {
            Clock::Fraction(q) => {
                if k + 1 == q {
                    self.out.h
                } else {
                    wide(0.0)
                }
            }
            Clock::Root(_) => self.tau[k] / over,
        };
        self.out.time.push(time);
        if let (Clock::Root(j), Some(chain)) = (self.out.clock, &mut self.chain) {
            let y = self.out.h * wide(self.s.contacts[j].side) * self.rate[j][k] / over;
            chain.push(y);
            self.out.depth[j].push(y);
        }
    }

    fn push_stiffness(&mut self, j: usize, k: usize) {
        let spring = &self.m.contacts[j].spring;
        let value = match spring {
            Spring::Waves(mean, waves) => self.waves(waves, k) + if k == 0 { *mean } else { wide(0.0) },
            _ if k == 0 => spring.at(self.s.t).0,
            _ => self.stiffness[j].slope * self.out.time[k],
        };
        self.stiffness[j].series.push(value);
    }

    /// `F` along `g` at order k, by the law, carried or not; fills the guarded force.
    fn law_force(&mut self, j: usize, k: usize) -> Wide {
        let (c, status) = (&self.m.contacts[j], self.s.contacts[j]);
        let side = wide(status.side);
        let is_open = status.mode == ContactMode::Separated;
        match c.law {
            Law::Rigid(_) => wide(0.0),
            Law::Bilateral(damping) => self.elastic(j, k, false) + damping * self.rate[j][k],
            _ if is_open => wide(0.0),
            Law::KelvinVoigt(damping, _) => {
                let mut p = side * self.delta[j][k] - if k == 0 { c.b } else { wide(0.0) };
                if k < status.zeros && self.out.clock == Clock::Fraction(1) {
                    p = wide(0.0);
                }
                self.out.depth[j].push(p);
                let f = self.elastic(j, k, true) + damping * side * self.rate[j][k];
                self.out.force[j].push(if k == 0 && status.force_zero { wide(0.0) } else { f });
                side * f
            }
            Law::Power { p, d, .. } => {
                let zeros = match (&self.powers[j], self.out.clock) {
                    (Some(Power::Ratio(r)), _) => r.zeros,
                    (_, Clock::Fraction(q)) => q * status.zeros,
                    _ => status.zeros,
                };
                let mut x = side * self.delta[j][k] - if k == 0 { c.b } else { wide(0.0) };
                if k < zeros {
                    x = wide(0.0);
                }
                if let Some(power) = &mut self.powers[j] {
                    self.out.depth[j].push(x);
                    match power {
                        Power::Ratio(r) => r.push(&self.out.depth[j]),
                        Power::Whole(chain) => chain.push(x),
                    }
                }
                let chi = if d == wide(0.0) { d } else { d / self.s.latches[j] };
                let factor = chi * side * self.rate[j][k] + wide(if k == 0 { 1.0 } else { 0.0 });
                self.out.force[j].push(if k == 0 && status.force_zero { wide(0.0) } else { factor });
                let elastic = |i: usize| match (&self.powers[j], &self.chain) {
                    (Some(Power::Ratio(r)), _) => r.series[i],
                    (Some(Power::Whole(chain)), _) | (None, Some(chain)) => chain.get(p, i),
                    _ => wide(0.0),
                };
                let stiffness = self.stiffness[j].series[0];
                let value = if d == wide(0.0) {
                    elastic(k)
                } else {
                    (0..=k).fold(wide(0.0), |s, i| s + elastic(i) * self.out.force[j][k - i])
                };
                side * stiffness * value
            }
        }
    }

    /// `K p` (or `K δ`) at order k.
    fn elastic(&self, j: usize, k: usize, of_depth: bool) -> Wide {
        let x = if of_depth { &self.out.depth[j] } else { &self.delta[j] };
        let spring = &self.stiffness[j];
        if spring.is_constant { spring.series[0] * x[k] } else { product(&spring.series, x, k) }
    }
}

impl Series {
    /// Gap to the flank on `side` at order k.
    pub fn gap(&self, m: &Model, j: usize, side: f64, k: usize) -> Wide {
        let c = &m.contacts[j];
        let q: Vec<Wide> = self.q.iter().map(|q| q[k]).collect();
        let e = c.error.iter().fold(if k == 0 { c.offset } else { wide(0.0) }, |e, w| {
            e + w.c * self.cos[w.oscillator][k] + w.s * self.sin[w.oscillator][k]
        });
        let d = wide(side) * (dot(&c.g, &q) - e);
        if k == 0 { c.b - d } else { -d }
    }

    /// Largest that a wave's order k is at any phase, about.
    fn swing(&self, w: &super::model::Wave, k: usize) -> f64 {
        (size(w.c) + size(w.s)) * (size(self.cos[w.oscillator][k]) + size(self.sin[w.oscillator][k]))
    }

    /// Sum of the sizes of the terms of the gap at order k.
    pub fn gap_size(&self, m: &Model, j: usize, k: usize) -> f64 {
        let c = &m.contacts[j];
        let q: f64 = c.g.iter().zip(&self.q).map(|(g, q)| near(*g * q[k]).abs()).sum();
        let e: f64 = c.error.iter().map(|w| self.swing(w, k)).sum();
        q + e + if k == 0 { near(c.b).abs() + near(c.offset).abs() } else { 0.0 }
    }

    /// The same for the guarded force.
    pub fn force_size(&self, m: &Model, j: usize, k: usize) -> f64 {
        let c = &m.contacts[j];
        let rate = || -> f64 { c.g.iter().zip(&self.v).map(|(g, v)| near(*g * v[k]).abs()).sum() };
        match c.law {
            Law::Rigid(_) => self.held_size[j][k] / near(m.mobility[j][j]),
            Law::KelvinVoigt(d, _) => c.spring.largest() * self.gap_size(m, j, k) + near(d) * rate(),
            _ => size(self.force[j][k]) + if k == 0 { 1.0 } else { 0.0 },
        }
    }
}
