//! Newmark's method and its generalisations.

use nalgebra::{DMatrix, DVector, Dyn, LU};

use super::{
    Penalty, StepPoint,
    drive::{Counters, Stepper},
    forcing::Forcing,
};

/// The generalised-α method (Chung & Hulbert 1993), of which Newmark's and HHT-α are cases:
///
/// ```text
/// q⁺ = q + h v + h² ((½ − β) a + β a⁺),    v⁺ = v + h ((1 − γ) a + γ a⁺)
/// M ((1 − α_m) a⁺ + α_m a) + (1 − α_f) r⁺ + α_f r = 0,    r = C v + K q + Σ g F − f
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alpha {
    /// Parameter α_m.
    pub mass: f64,
    /// Parameter α_f.
    pub force: f64,
    /// Parameter β.
    pub beta: f64,
    /// Parameter γ.
    pub gamma: f64,
}

impl Alpha {
    /// Average acceleration, β = 1/4, γ = 1/2 (Newmark 1959): order 2, no numerical damping.
    pub const NEWMARK: Self = Self { mass: 0.0, force: 0.0, beta: 0.25, gamma: 0.5 };

    /// HHT-α (Hilber, Hughes & Taylor 1977), `alpha` in `[0, 1/3]`: order 2, high frequencies damped; 0 is Newmark.
    #[must_use]
    pub fn hht(alpha: f64) -> Self {
        Self { mass: 0.0, force: alpha, beta: 0.25 * (1.0 + alpha) * (1.0 + alpha), gamma: 0.5 + alpha }
    }

    /// Generalised-α with spectral radius `rho` at infinite frequency, `[0, 1]`: order 2, least damping of low frequencies.
    #[must_use]
    pub fn generalised(rho: f64) -> Self {
        let (mass, force) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        let gamma = 0.5 - mass + force;
        Self { mass, force, beta: 0.25 * (gamma + 0.5) * (gamma + 0.5), gamma }
    }
}

/// Maximum number of Newton iterations of a step; more count as unconverged.
const MOST: u32 = 40;
/// Newton's correction of a deflection at which the iteration stops, relative to its size, its change in a step and the backlash.
const TOLERANCE: f64 = 1e-14;

/// Solver of the method. The structure is linear, so Newton's iteration treats the contacts alone: with `S = (1 − α_m) + (1 − α_f) M⁻¹(γhC
/// + βh²K)`, factorised once, `a⁺ = S⁻¹ (free − (1 − α_f) Σ M⁻¹g F)`. The unknowns are the `gᵀa⁺`, one for each contact.
pub(super) struct GeneralisedAlpha {
    alpha: Alpha,
    /// Factorised matrix S.
    free: LU<f64, Dyn, Dyn>,
    /// Vectors `(1 − α_f) S⁻¹ M⁻¹ g`, one for each contact.
    answers: Vec<DVector<f64>>,
    /// Matrix `gᵀ answers`, `[m × m]`.
    coupling: DMatrix<f64>,
    /// Accelerations a of the method, and those of the equations of motion at the same point.
    a: Vec<f64>,
    true_a: Vec<f64>,
    started: bool,
    end: DVector<f64>,
    predicted: [Vec<f64>; 2],
    /// Accelerations `gᵀ a⁺` of each contact: without contact forces, and the unknowns.
    without: Vec<f64>,
    unknowns: Vec<f64>,
    force: Vec<f64>,
    /// Slopes at which `newton` was factorised; they change when a contact opens or closes, not from step to step.
    slopes: Vec<f64>,
    newton: Option<LU<f64, Dyn, Dyn>>,
    residual: DVector<f64>,
}

impl GeneralisedAlpha {
    pub fn new(model: &Penalty, alpha: Alpha, h: f64) -> Self {
        let (n, m) = (model.n, model.contacts.len());
        let mut s = DMatrix::identity(n, n) * (1.0 - alpha.mass);
        for (i, row) in model.rows.iter().enumerate() {
            for (j, k, c) in row {
                s[(i, *j as usize)] += (1.0 - alpha.force) * (alpha.gamma * h * c + alpha.beta * h * h * k);
            }
        }
        let free = s.lu();
        let mut answers = Vec::with_capacity(m);
        for c in &model.contacts {
            let mut push = DVector::zeros(n);
            c.push.iter().for_each(|(i, p)| push[*i as usize] = (1.0 - alpha.force) * p);
            free.solve_mut(&mut push);
            answers.push(push);
        }
        let dot = |i: usize, j: usize| {
            model.contacts[i].direction.iter().map(|(k, g)| g * answers[j][*k as usize]).sum::<f64>()
        };
        let coupling = DMatrix::from_fn(m, m, dot);
        Self {
            alpha,
            free,
            answers,
            coupling,
            a: vec![0.0; n],
            true_a: vec![0.0; n],
            started: false,
            end: DVector::zeros(n),
            predicted: [vec![0.0; n], vec![0.0; n]],
            without: vec![0.0; m],
            unknowns: vec![0.0; m],
            force: vec![0.0; m],
            slopes: vec![f64::NAN; m],
            newton: None,
            residual: DVector::zeros(m),
        }
    }

    /// Solves for the contact forces at the end of the step.
    fn newton(&mut self, model: &Penalty, point: &StepPoint, h: f64, counters: &mut Counters) {
        let Alpha { beta, gamma, .. } = self.alpha;
        let (by_q, by_v) = (beta * h * h, gamma * h);
        let m = model.contacts.len();
        for _ in 0..MOST {
            counters.evaluations += 1;
            let mut changed = self.newton.is_none();
            for j in 0..m {
                let (c, forced) = (&model.contacts[j], &point.moment.contacts[j]);
                let [d, r] = c.deflection(forced, &self.predicted[0], &self.predicted[1]);
                let at = [d + by_q * self.unknowns[j], r + by_v * self.unknowns[j]];
                let (force, by_d, by_r) = model.law(c, forced.stiffness, at, point.contacts[j].latch);
                self.force[j] = force;
                let slope = by_d * by_q + by_r * by_v;
                // Unequal, including NaN.
                changed |= !(slope == self.slopes[j]);
                self.slopes[j] = slope;
            }
            for i in 0..m {
                let pushed: f64 = (0..m).map(|j| self.coupling[(i, j)] * self.force[j]).sum();
                self.residual[i] = self.without[i] - pushed - self.unknowns[i];
            }
            counters.iterations += 1;
            if m == 1 {
                self.residual[0] /= 1.0 + self.coupling[(0, 0)] * self.slopes[0];
            } else {
                if changed {
                    let newton = DMatrix::from_fn(m, m, |i, j| {
                        self.coupling[(i, j)] * self.slopes[j] + if i == j { 1.0 } else { 0.0 }
                    });
                    self.newton = Some(newton.lu());
                    counters.factorisations += 1;
                }
                let solved = self.newton.as_ref().is_some_and(|lu| lu.solve_mut(&mut self.residual));
                if !solved {
                    break;
                }
            }
            let mut arrived = true;
            for j in 0..m {
                self.unknowns[j] += self.residual[j];
                // A deflection passes through zero, but its change in a step does not.
                let [d, r] = point.contacts[j].deflection;
                let size = d.abs() + h * r.abs() + model.contacts[j].half_backlash.abs();
                arrived &= by_q * self.residual[j].abs() <= TOLERANCE * size;
            }
            if arrived {
                return;
            }
        }
        counters.unconverged += 1;
    }
}

impl Stepper for GeneralisedAlpha {
    fn step(&mut self, model: &Penalty, forcing: &mut Forcing, point: &mut StepPoint, h: f64, counters: &mut Counters) {
        let Alpha { mass, force, beta, gamma } = self.alpha;
        if !self.started || force != 0.0 {
            model.accelerations(&point.moment, &point.q, &point.v, point.forces(), &mut self.true_a);
        }
        if !self.started {
            self.a.copy_from_slice(&self.true_a);
            self.started = true;
        }
        let [q, v] = &mut self.predicted;
        for k in 0..model.n {
            q[k] = point.q[k] + h * (point.v[k] + h * (0.5 - beta) * self.a[k]);
            v[k] = point.v[k] + h * (1.0 - gamma) * self.a[k];
        }
        forcing.advance(model, &mut point.moment);
        model.accelerations(&point.moment, q, v, [], self.end.as_mut_slice());
        for (k, end) in self.end.iter_mut().enumerate() {
            *end = (1.0 - force) * *end - mass * self.a[k] + force * self.true_a[k];
        }
        self.free.solve_mut(&mut self.end);
        for (j, c) in model.contacts.iter().enumerate() {
            self.without[j] = c.direction.iter().map(|(i, g)| g * self.end[*i as usize]).sum();
            // The force of the step before is the first guess.
            let pushed: f64 = point.forces().enumerate().map(|(k, f)| self.coupling[(j, k)] * f).sum();
            self.unknowns[j] = self.without[j] - pushed;
        }
        self.newton(model, point, h, counters);
        for (answer, f) in self.answers.iter().zip(&self.force) {
            if *f != 0.0 {
                self.end.axpy(-f, answer, 1.0);
            }
        }
        for k in 0..model.n {
            self.a[k] = self.end[k];
            point.q[k] = self.predicted[0][k] + beta * h * h * self.a[k];
            point.v[k] = self.predicted[1][k] + gamma * h * self.a[k];
        }
    }
}
