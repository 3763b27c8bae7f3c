//! Explicit methods, and the choice among all.

use super::{
    Alpha, Penalty, StepPoint,
    alpha::GeneralisedAlpha,
    drive::{Counters, Stepper},
    forcing::{Forcing, Moment},
};

/// A fixed-step method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// The classical Runge–Kutta method.
    Rk4,
    /// Newmark, HHT-α, generalised-α.
    Alpha(Alpha),
    /// Semi-implicit Euler.
    SemiImplicitEuler,
    /// Velocity Verlet.
    Verlet,
}

impl Method {
    /// Returns the order on smooth problems.
    #[must_use]
    pub fn order(self) -> u32 {
        match self {
            Self::Rk4 => 4,
            Self::Alpha(_) | Self::Verlet => 2,
            Self::SemiImplicitEuler => 1,
        }
    }

    /// Returns the largest `h ω` without growth of an undamped oscillation of frequency ω; `None` for an unconditionally stable method.
    ///
    /// The limit is `2√2` for RK4, 2 for semi-implicit Euler and velocity Verlet.
    #[must_use]
    pub fn stability_limit(self) -> Option<f64> {
        match self {
            Self::Rk4 => Some(2.0 * std::f64::consts::SQRT_2),
            Self::Alpha(_) => None,
            Self::SemiImplicitEuler | Self::Verlet => Some(2.0),
        }
    }

    pub(super) fn stepper(self, model: &Penalty, h: f64) -> Box<dyn Stepper> {
        match self {
            Self::Rk4 => Box::new(RungeKutta::new(model)),
            Self::Alpha(alpha) => Box::new(GeneralisedAlpha::new(model, alpha, h)),
            Self::SemiImplicitEuler => Box::new(SemiImplicitEuler::new(model)),
            Self::Verlet => Box::new(Verlet::new(model)),
        }
    }
}

/// Classical Runge–Kutta method of order 4, four evaluations a step.
///
/// On a force with a kink it has order 2 if the kink lies inside steps, and order 1 if the force jumps.
struct RungeKutta {
    middle: Moment,
    q: Vec<f64>,
    force: Vec<f64>,
    stages: [Stage; 4],
}

/// Derivatives at a stage.
struct Stage {
    /// Derivatives of coordinates: velocities.
    v: Vec<f64>,
    /// Derivatives of velocities: accelerations.
    a: Vec<f64>,
}

impl RungeKutta {
    fn new(model: &Penalty) -> Self {
        let vector = || vec![0.0; model.n];
        let stages = std::array::from_fn(|_| Stage { v: vector(), a: vector() });
        Self { middle: model.moment(), q: vector(), force: vec![0.0; model.contacts.len()], stages }
    }
}

impl Stepper for RungeKutta {
    fn strides(&self) -> u32 {
        2
    }

    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut StepPoint, h: f64, counters: &mut Counters) {
        let Self { middle, q, force, stages: [s1, s2, s3, s4] } = self;
        let StepPoint { q: q0, v: v0, contacts, moment } = point;
        let mut stage = |moment: &Moment, before: &Stage, now: &mut Stage, dt: f64| {
            let slopes = before.v.iter().zip(&before.a);
            for (((q, v), (q0, v0)), (dq, dv)) in q.iter_mut().zip(&mut now.v).zip(q0.iter().zip(v0.iter())).zip(slopes)
            {
                *q = q0 + dt * dq;
                *v = v0 + dt * dv;
            }
            model.forces(moment, q, &now.v, contacts, force);
            model.accelerations(moment, q, &now.v, force.iter().copied(), &mut now.a);
        };
        s1.v.copy_from_slice(v0);
        model.accelerations(moment, q0, v0, contacts.iter().map(|touch| touch.force), &mut s1.a);
        forcing.advance(model, middle);
        stage(middle, s1, s2, 0.5 * h);
        stage(middle, s2, s3, 0.5 * h);
        forcing.advance(model, moment);
        stage(moment, s3, s4, h);
        let sum = |[a, b, c, d]: [f64; 4]| h / 6.0 * (a + 2.0 * (b + c) + d);
        for k in 0..model.n {
            q0[k] += sum([s1.v[k], s2.v[k], s3.v[k], s4.v[k]]);
            v0[k] += sum([s1.a[k], s2.a[k], s3.a[k], s4.a[k]]);
        }
        counters.evaluations += 3;
    }
}

/// Semi-implicit (symplectic) Euler, one evaluation a step: `v⁺ = v + h a(t, q, v)`, `q⁺ = q + h v⁺`. Order 1.
struct SemiImplicitEuler {
    a: Vec<f64>,
}

impl SemiImplicitEuler {
    fn new(model: &Penalty) -> Self {
        Self { a: vec![0.0; model.n] }
    }
}

impl Stepper for SemiImplicitEuler {
    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut StepPoint, h: f64, _: &mut Counters) {
        model.accelerations(&point.moment, &point.q, &point.v, point.forces(), &mut self.a);
        for ((q, v), a) in point.q.iter_mut().zip(&mut point.v).zip(&self.a) {
            *v += h * a;
            *q += h * *v;
        }
        forcing.advance(model, &mut point.moment);
    }
}

/// Velocity Verlet: `q⁺ = q + h v + ½ h² a`, `v⁺ = v + ½ h (a + a⁺)`. Order 2.
///
/// Damping makes `a⁺` depend on `v⁺`; it is evaluated at the predicted velocity `v + h a`, which keeps the order. (At the
/// half-step velocity, as codes for undamped particles do, it would fall to 1.)
struct Verlet {
    a: Vec<f64>,
    end: Vec<f64>,
    predicted: Vec<f64>,
    force: Vec<f64>,
}

impl Verlet {
    fn new(model: &Penalty) -> Self {
        let vector = || vec![0.0; model.n];
        Self { a: vector(), end: vector(), predicted: vector(), force: vec![0.0; model.contacts.len()] }
    }
}

impl Stepper for Verlet {
    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut StepPoint, h: f64, counters: &mut Counters) {
        model.accelerations(&point.moment, &point.q, &point.v, point.forces(), &mut self.a);
        for (k, predicted) in self.predicted.iter_mut().enumerate() {
            point.q[k] += h * point.v[k] + 0.5 * h * h * self.a[k];
            *predicted = point.v[k] + h * self.a[k];
        }
        forcing.advance(model, &mut point.moment);
        model.forces(&point.moment, &point.q, &self.predicted, &point.contacts, &mut self.force);
        model.accelerations(&point.moment, &point.q, &self.predicted, self.force.iter().copied(), &mut self.end);
        for ((v, a), end) in point.v.iter_mut().zip(&self.a).zip(&self.end) {
            *v += 0.5 * h * (a + end);
        }
        counters.evaluations += 1;
    }
}
