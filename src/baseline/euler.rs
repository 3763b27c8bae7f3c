use super::{
    Penalty, Point,
    drive::{Counters, Stepper},
    forcing::Forcing,
};

/// Semi-implicit (symplectic) Euler, one evaluation a step: `v⁺ = v + h a(t, q, v)`, `q⁺ = q + h v⁺`. Order 1.
pub(super) struct SemiImplicitEuler {
    a: Vec<f64>,
}

impl SemiImplicitEuler {
    pub fn new(model: &Penalty) -> Self {
        Self { a: vec![0.0; model.n] }
    }
}

impl Stepper for SemiImplicitEuler {
    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut Point, h: f64, _: &mut Counters) {
        model.accelerations(&point.moment, &point.q, &point.v, point.forces(), &mut self.a);
        for ((q, v), a) in point.q.iter_mut().zip(&mut point.v).zip(&self.a) {
            *v += h * a;
            *q += h * *v;
        }
        forcing.advance(model, &mut point.moment);
    }
}
