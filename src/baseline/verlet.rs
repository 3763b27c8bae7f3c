use super::{
    Penalty, Point,
    drive::{Counters, Stepper},
    forcing::Forcing,
};

/// Velocity Verlet: `q⁺ = q + h v + ½ h² a`, `v⁺ = v + ½ h (a + a⁺)`. Order 2.
///
/// Damping makes `a⁺` depend on `v⁺`; it is evaluated at the predicted velocity `v + h a`, which keeps the order. (At the
/// half-step velocity, as codes for undamped particles do, it would fall to 1.)
pub(super) struct Verlet {
    a: Vec<f64>,
    end: Vec<f64>,
    predicted: Vec<f64>,
    force: Vec<f64>,
}

impl Verlet {
    pub fn new(model: &Penalty) -> Self {
        let vector = || vec![0.0; model.n];
        Self { a: vector(), end: vector(), predicted: vector(), force: vec![0.0; model.contacts.len()] }
    }
}

impl Stepper for Verlet {
    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut Point, h: f64, counters: &mut Counters) {
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
