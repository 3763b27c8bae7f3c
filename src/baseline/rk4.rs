use super::{
    Penalty, Point,
    drive::{Counters, Stepper},
    forcing::{Forcing, Moment},
};

/// The classical Runge–Kutta method of order 4, four evaluations a step.
///
/// On a force with a kink it is of order 2 once the kink falls inside steps, and of order 1 where the force jumps.
pub(super) struct RungeKutta {
    middle: Moment,
    q: Vec<f64>,
    force: Vec<f64>,
    stages: [Stage; 4],
}

/// Slopes of a stage.
struct Stage {
    /// Of coordinates: velocities.
    v: Vec<f64>,
    /// Of velocities: accelerations.
    a: Vec<f64>,
}

impl RungeKutta {
    pub fn new(model: &Penalty) -> Self {
        let vector = || vec![0.0; model.n];
        let stages = std::array::from_fn(|_| Stage { v: vector(), a: vector() });
        Self { middle: model.moment(), q: vector(), force: vec![0.0; model.contacts.len()], stages }
    }
}

impl Stepper for RungeKutta {
    fn strides(&self) -> u32 {
        2
    }

    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut Point, h: f64, counters: &mut Counters) {
        let Self { middle, q, force, stages: [s1, s2, s3, s4] } = self;
        let Point { q: q0, v: v0, contacts, moment } = point;
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
