//! The assembled train in wide numbers. It takes the doubles of a [`Spec`] as exact.

use flank::{
    gear::{
        Harmonic, Stiffness,
        contact::{Law as SpecLaw, Release, Restitution},
    },
    system::{BackFlank, ContactSpec, Flanks, Spec},
};

use super::{
    linear,
    wide::{Wide, near, sin_cos, wide},
};

/// `c cos ωt + s sin ωt`.
pub struct Wave {
    pub oscillator: usize,
    pub c: Wide,
    pub s: Wide,
}

pub enum Spring {
    Constant(Wide),
    Waves(Wide, Vec<Wave>),
    /// Starts, values and slopes of the pieces of one period.
    Pieces {
        period: Wide,
        origin: Wide,
        pieces: Vec<[Wide; 3]>,
    },
    /// Times, then value and slope before the first and from each one on.
    Listed(Vec<Wide>, Vec<[Wide; 2]>),
}

pub enum Law {
    Bilateral(Wide),
    /// Damping; whether it lets go at zero force.
    KelvinVoigt(Wide, bool),
    /// `K p^(p/q) (1 + D ṗ/v₀)`.
    Power {
        p: usize,
        q: usize,
        d: Wide,
        floor: Wide,
        initial: Wide,
    },
    Rigid(Return),
}

/// Restitution by approach speed: straight lines between points, or one that is read in doubles.
pub enum Return {
    Lines(Vec<[Wide; 2]>),
    Doubles(Restitution),
}

impl Return {
    fn new(restitution: Restitution, t: &dyn Fn(f64) -> Wide) -> Self {
        match restitution {
            Restitution::Constant(e) => Self::Lines(vec![[wide(0.0), t(e)]]),
            Restitution::Table { points, count } => {
                Self::Lines(points[..count].iter().map(|point| point.map(t)).collect())
            }
            Restitution::Power { at_speed, .. } => {
                let Restitution::Power { speed, exponent, smallest_speed, .. } = restitution else { unreachable!() };
                Self::Doubles(Restitution::Power { at_speed: near(t(at_speed)), speed, exponent, smallest_speed })
            }
        }
    }

    pub fn at(&self, speed: Wide) -> Wide {
        let points = match self {
            Self::Doubles(law) => return wide(law.at(near(speed))),
            Self::Lines(points) => points,
        };
        let next = points.iter().position(|[v, _]| near(*v - speed) > 0.0).unwrap_or(points.len());
        match (next, points.get(next)) {
            (0, _) => points[0][1],
            (_, None) => points[points.len() - 1][1],
            (_, Some([v1, e1])) => {
                let [v0, e0] = points[next - 1];
                e0 + (*e1 - e0) * (speed - v0) / (*v1 - v0)
            }
        }
    }

    /// Speed below which it is constant.
    pub fn steady(&self) -> f64 {
        match self {
            Self::Doubles(law) => law.steady_speed(),
            Self::Lines(points) if points.len() == 1 => f64::INFINITY,
            Self::Lines(points) => near(points[0][0]),
        }
    }
}

pub struct Contact {
    pub g: Vec<Wide>,
    /// `M⁻¹ g`.
    pub push: Vec<Wide>,
    pub offset: Wide,
    pub error: Vec<Wave>,
    pub b: Wide,
    pub both: bool,
    pub spring: Spring,
    pub law: Law,
}

pub struct Model {
    pub n: usize,
    /// Rows of `M⁻¹K` and `M⁻¹C`.
    pub k: Vec<Vec<Wide>>,
    pub c: Vec<Vec<Wide>>,
    pub load: Vec<Wide>,
    pub omegas: Vec<Wide>,
    /// `M⁻¹ f` of each harmonic load: oscillator, cosine part, sine part.
    pub loads: Vec<(usize, Vec<Wide>, Vec<Wide>)>,
    /// Schedules of loads, and their accelerations for a value of one.
    pub load_schedules: Vec<(Spring, Vec<Wide>)>,
    /// The contacts; behind them back flanks that differ, as drive flanks that are turned round.
    pub contacts: Vec<Contact>,
    /// The contacts of those.
    pub back_of: Vec<usize>,
    /// `G M⁻¹ Gᵀ`.
    pub mobility: Vec<Vec<Wide>>,
    /// `√M_ii`.
    pub weights: Vec<f64>,
}

/// Changes the numbers of a train by a relative amount, the same for equal numbers, so that symmetry stays; or one of them.
#[derive(Clone, Copy)]
pub struct Tweak {
    pub amount: f64,
    pub seed: u64,
    /// Value of a number, and the change of all numbers of this value.
    pub moved: [f64; 2],
    /// Relative change of all frequencies.
    pub faster: f64,
}

impl Tweak {
    pub const NONE: Self = Self { amount: 0.0, seed: 0, moved: [f64::NAN, 0.0], faster: 0.0 };

    pub fn of(self, x: f64) -> Wide {
        if x == self.moved[0] {
            return wide(x) + wide(self.moved[1]);
        }
        if self.amount == 0.0 {
            return wide(x);
        }
        let mut z = x.abs().to_bits() ^ self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let sign = if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 };
        wide(x) * (wide(1.0) + wide(sign * self.amount))
    }
}

impl Model {
    pub fn new(spec: &Spec, tweak: Tweak) -> Self {
        let n = spec.freedoms.len();
        let t = |x: f64| tweak.of(x);
        let faster = wide(1.0) + wide(tweak.faster);
        let matrix = |m: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<Wide>> {
            (0..n).map(|i| (0..n).map(|j| t(m(i, j))).collect()).collect()
        };
        let mass = matrix(&|i, j| spec.mass[(i, j)]);
        let over_mass = |v: &[Wide]| linear::solve(&mass, v);
        let columns = |m: Vec<Vec<Wide>>| -> Vec<Vec<Wide>> {
            let solved: Vec<Vec<Wide>> =
                (0..n).map(|j| over_mass(&m.iter().map(|row| row[j]).collect::<Vec<_>>())).collect();
            (0..n).map(|i| (0..n).map(|j| solved[j][i]).collect()).collect()
        };
        let mut omegas: Vec<f64> = Vec::new();
        let mut index = |omega: f64| {
            omegas.iter().position(|w| *w == omega).unwrap_or_else(|| {
                omegas.push(omega);
                omegas.len() - 1
            })
        };
        let wave = |h: &Harmonic, scale: Wide, index: &mut dyn FnMut(f64) -> usize| {
            let (sin, cos) = sin_cos(t(h.phase));
            let a = scale * t(h.amplitude);
            Wave { oscillator: index(h.omega), c: a * cos, s: -(a * sin) }
        };
        let mut damping = matrix(&|i, j| spec.damping[(i, j)]);
        for c in spec.contacts.iter().filter(|c| c.gap_damping > 0.0) {
            let g: Vec<Wide> = c.direction.iter().map(|x| t(*x)).collect();
            for (row, gi) in damping.iter_mut().zip(&g) {
                row.iter_mut().zip(&g).for_each(|(entry, gj)| *entry = *entry + t(c.gap_damping) * *gi * *gj);
            }
        }
        let mut loads: Vec<_> = spec
            .load_harmonics
            .iter()
            .map(|l| {
                let (sin, cos) = sin_cos(t(l.phase));
                let a = over_mass(&l.vector.iter().map(|x| t(*x)).collect::<Vec<_>>());
                let part = |f: Wide| a.iter().map(|x| *x * f).collect();
                (index(l.omega), part(cos), part(-sin))
            })
            .collect();
        let pieces = |schedule: &Stiffness| match schedule {
            Stiffness::Periodic { period, origin, pieces } => Spring::Pieces {
                period: t(*period) / faster,
                origin: t(*origin),
                pieces: pieces.iter().map(|p| [t(p.start), t(p.value), t(p.slope) * faster]).collect(),
            },
            Stiffness::Listed { times, values, slopes } => Spring::Listed(
                times.iter().map(|[high, low]| t(*high) + wide(*low)).collect(),
                values.iter().zip(slopes).map(|(value, slope)| [t(*value), t(*slope)]).collect(),
            ),
            Stiffness::Constant(k) | Stiffness::Harmonic { mean: k, .. } => Spring::Constant(t(*k)),
        };
        let load_schedules = spec
            .load_schedules
            .iter()
            .map(|l| (pieces(&l.factor), over_mass(&l.vector.iter().map(|x| t(*x)).collect::<Vec<_>>())));
        let load_schedules = load_schedules.collect();
        let mut contact = |c: &ContactSpec, back: Option<&BackFlank>| {
            let turned = wide(if back.is_some() { -1.0 } else { 1.0 });
            let g: Vec<Wide> = c.direction.iter().map(|x| turned * t(*x)).collect();
            let (stiffness, error, offset) = match back {
                Some(back) => (&back.stiffness, &back.error, back.error_offset),
                None => (&c.stiffness, &c.error, c.error_offset),
            };
            Contact {
                push: over_mass(&g),
                g,
                offset: turned * t(offset),
                error: error.iter().map(|h| wave(h, turned, &mut index)).collect(),
                b: if matches!(c.law, SpecLaw::Bilateral(_)) { wide(0.0) } else { t(c.half_backlash) },
                both: c.flanks == Flanks::Both && c.back.is_none(),
                spring: match stiffness {
                    Stiffness::Harmonic { mean, harmonics } => {
                        Spring::Waves(t(*mean), harmonics.iter().map(|h| wave(h, t(*mean), &mut index)).collect())
                    }
                    other => pieces(other),
                },
                law: match c.law {
                    SpecLaw::Bilateral(l) => Law::Bilateral(t(l.damping)),
                    SpecLaw::KelvinVoigt(l, r) => Law::KelvinVoigt(t(l.damping), r == Release::Force),
                    SpecLaw::Rigid(l) => Law::Rigid(Return::new(l.restitution, &t)),
                    SpecLaw::Power(l) => Law::Power {
                        p: l.exponent.p as usize,
                        q: l.exponent.q as usize,
                        d: t(l.hysteresis),
                        floor: t(l.speed_floor),
                        initial: t(l.initial_speed),
                    },
                },
            }
        };
        let mut contacts: Vec<Contact> = spec.contacts.iter().map(|c| contact(c, None)).collect();
        let back_of: Vec<usize> = (0..spec.contacts.len()).filter(|j| spec.contacts[*j].back.is_some()).collect();
        contacts.extend(back_of.iter().map(|j| contact(&spec.contacts[*j], spec.contacts[*j].back.as_ref())));
        for (c, own) in spec.contacts.iter().zip(&contacts).filter(|(c, _)| c.gap_damping > 0.0) {
            for w in &own.error {
                let omega = wide(omegas[w.oscillator]) * faster;
                let part = |f: Wide| own.push.iter().map(|p| *p * f * omega * t(c.gap_damping)).collect();
                loads.push((w.oscillator, part(w.s), part(-w.c)));
            }
        }
        let mobility = contacts.iter().map(|a| contacts.iter().map(|b| linear::dot(&a.g, &b.push)).collect()).collect();
        // No amount moves frequencies: Flank's clock has their exact doubles too, and a change of them would grow with time.
        let omegas = omegas.into_iter().map(|omega| wide(omega) * faster).collect();
        Self {
            n,
            k: columns(matrix(&|i, j| spec.stiffness[(i, j)])),
            c: columns(damping),
            load: over_mass(&spec.load.iter().map(|x| t(*x)).collect::<Vec<_>>()),
            omegas,
            loads,
            load_schedules,
            contacts,
            back_of,
            mobility,
            weights: (0..n).map(|i| near(mass[i][i]).sqrt()).collect(),
        }
    }

    /// Error of contact `j` and its rate at time t, and the sum of the sizes of the error's terms.
    pub fn error(&self, j: usize, t: Wide) -> (Wide, Wide, f64) {
        let c = &self.contacts[j];
        let (mut e, mut rate, mut size) = (c.offset, wide(0.0), near(c.offset).abs());
        for w in &c.error {
            let omega = self.omegas[w.oscillator];
            let (sin, cos) = sin_cos(omega * t);
            e = e + w.c * cos + w.s * sin;
            rate = rate + omega * (w.s * cos - w.c * sin);
            size += near(w.c).abs() + near(w.s).abs();
        }
        (e, rate, size)
    }
}

impl Spring {
    /// Value and slope at time t, right after it; and the time of the last switch.
    pub fn at(&self, t: Wide) -> (Wide, Wide) {
        match self {
            Self::Constant(k) | Self::Waves(k, _) => (*k, wide(0.0)),
            Self::Listed(times, pieces) => {
                let passed = times.iter().filter(|s| **s <= t).count();
                let [value, slope] = pieces[passed];
                if passed == 0 { (value, slope) } else { (value + slope * (t - times[passed - 1]), slope) }
            }
            Self::Pieces { period, origin, pieces } => {
                let start = |k: f64, piece: &[Wide; 3]| *origin + *period * (wide(k) + piece[0]);
                let k = near((t - *origin) / *period).floor();
                let mut found = (wide(0.0), wide(0.0));
                for r in [k - 1.0, k, k + 1.0] {
                    for piece in pieces {
                        let s = start(r, piece);
                        if s <= t {
                            found = (piece[1] + piece[2] * (t - s), piece[2]);
                        }
                    }
                }
                found
            }
        }
    }

    /// The first switch after time t.
    pub fn next(&self, t: Wide) -> Option<Wide> {
        match self {
            Self::Constant(_) | Self::Waves(..) => None,
            Self::Listed(times, _) => times.iter().copied().find(|s| *s > t),
            Self::Pieces { period, origin, pieces } => {
                let k = near((t - *origin) / *period).floor();
                [k - 1.0, k, k + 1.0, k + 2.0]
                    .into_iter()
                    .flat_map(|r| pieces.iter().map(move |p| *origin + *period * (wide(r) + p[0])))
                    .find(|s| *s > t)
            }
        }
    }

    /// Its largest size.
    pub fn largest(&self) -> f64 {
        match self {
            Self::Constant(k) => near(*k),
            Self::Waves(k, waves) => near(*k) + waves.iter().map(|w| near(w.c).abs() + near(w.s).abs()).sum::<f64>(),
            // Every value that a ramp reaches is the value at which another piece starts.
            Self::Listed(_, pieces) => pieces.iter().map(|p| near(p[0]).abs()).fold(0.0, f64::max),
            Self::Pieces { pieces, .. } => pieces.iter().map(|p| near(p[1])).fold(0.0, f64::max),
        }
    }
}
