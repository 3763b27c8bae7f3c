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
    /// Accelerations and velocities of the four stages.
    a: [Vec<f64>; 4],
    w: [Vec<f64>; 4],
}

impl RungeKutta {
    pub fn new(model: &Penalty) -> Self {
        let vector = || vec![0.0; model.n];
        let stages = || [vector(), vector(), vector(), vector()];
        let force = vec![0.0; model.contacts.len()];
        Self { middle: model.moment(), q: vector(), force, a: stages(), w: stages() }
    }

    /// Stage `I` from stage `I − 1` over the time `dt`.
    #[inline(always)]
    fn stage<const I: usize>(&mut self, model: &Penalty, moment: &Moment, point: &Point, dt: f64) {
        let (before, now) = self.w.split_at_mut(I);
        let (w, v) = (&before[I - 1], &mut now[0]);
        for k in 0..model.n {
            self.q[k] = point.q[k] + dt * w[k];
            v[k] = point.v[k] + dt * self.a[I - 1][k];
        }
        model.forces(moment, &self.q, v, &point.contacts, &mut self.force);
        model.accelerations(moment, &self.q, v, self.force.iter().copied(), &mut self.a[I]);
    }
}

impl Stepper for RungeKutta {
    fn strides(&self) -> u32 {
        2
    }

    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut Point, h: f64, counters: &mut Counters) {
        model.accelerations(&point.moment, &point.q, &point.v, point.forces(), &mut self.a[0]);
        self.w[0].copy_from_slice(&point.v);
        let mut middle = std::mem::take(&mut self.middle);
        forcing.advance(model, &mut middle);
        self.stage::<1>(model, &middle, point, 0.5 * h);
        self.stage::<2>(model, &middle, point, 0.5 * h);
        self.middle = middle;
        let mut end = std::mem::take(&mut point.moment);
        forcing.advance(model, &mut end);
        self.stage::<3>(model, &end, point, h);
        point.moment = end;
        for k in 0..model.n {
            point.q[k] += h / 6.0 * (self.w[0][k] + 2.0 * (self.w[1][k] + self.w[2][k]) + self.w[3][k]);
            point.v[k] += h / 6.0 * (self.a[0][k] + 2.0 * (self.a[1][k] + self.a[2][k]) + self.a[3][k]);
        }
        counters.evaluations += 3;
    }
}
