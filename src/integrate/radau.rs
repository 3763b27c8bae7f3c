//! Radau IIA with nine stages, order 17: steps across fast rates that the motion does not show.
//!
//! The collocation polynomial `X(θ)` of degree 9 has `X(0) = x` and `X′(c_i) = h f(t + c_i h, X(c_i))`. Its Chebyshev coefficients measure
//! its accuracy: a free oscillation of amplitude δ that is stepped over appears as 0.185 δ in the last one.

use std::sync::LazyLock;

use nalgebra::{DMatrix, DVector, Dyn, LU, SMatrix};

use crate::hybrid::{Instant, Mode, VectorField};

/// Number of stages.
pub(super) const STAGES: usize = 9;
/// Nodes of the polynomial: the start and the stages.
const NODES: usize = STAGES + 1;
/// Largest last coefficient relative to the size of a component.
pub(super) const RESOLVED: f64 = 2e-14;
/// Ratio of a hidden amplitude to the last coefficient that it causes.
pub(super) const HIDDEN: f64 = 1.0 / 0.185;
/// Final size of Newton's corrections, relative to the component. Ten times this suffices if the corrections stop falling.
const CONVERGED: f64 = 0.05 * RESOLVED;
/// Factor by which Newton's corrections must fall, or the matrix is recomputed.
const FALL: f64 = 0.05;
const MAX_CORRECTIONS: usize = 16;

/// The method: nodes, weights, and the map from node values to Chebyshev coefficients.
#[derive(Clone, Debug)]
pub struct Tableau {
    /// `c_i`, rising, the last one 1.
    pub nodes: [f64; STAGES],
    /// `a_ij`; the last row are the weights.
    pub weights: SMatrix<f64, STAGES, STAGES>,
    /// Map from values at 0 and at the nodes to coefficients of `T_k(2θ − 1)`.
    chebyshev: SMatrix<f64, NODES, NODES>,
}

/// Returns the zeros of Jacobi's `P_8^(1,0)` and 1, on `[0, 1]`: the nodes of Radau's quadrature.
fn nodes() -> [f64; STAGES] {
    let value = |x: f64| {
        let (mut before, mut now) = ((0.0, 0.0), (1.0, 0.0));
        for k in 1..STAGES {
            let k = k as f64;
            let (a, b, c) = (4.0 * k * k - 1.0, (k - 1.0) * (2.0 * k + 1.0), (k + 1.0) * (2.0 * k - 1.0));
            let next = (a * x + 1.0) * now.0 - b * before.0;
            let slope = (a * x + 1.0) * now.1 + a * now.0 - b * before.1;
            (before, now) = (now, (next / c, slope / c));
        }
        now
    };
    let mut found = [1.0; STAGES];
    for i in 0..STAGES - 1 {
        let mut x = -libm::cos(std::f64::consts::PI * (i as f64 + 0.5) / STAGES as f64);
        for _ in 0..50 {
            let (p, slope) = value(x);
            // Newton's method, with the zeros already found divided out.
            let others: f64 = found[..i].iter().map(|y| 1.0 / (x - (2.0 * y - 1.0))).sum();
            let step = p / (slope - p * others);
            x -= step;
            if step.abs() <= f64::EPSILON {
                break;
            }
        }
        found[i] = 0.5 * (1.0 + x);
    }
    found
}

/// Returns `B A⁻¹` with a step of refinement.
fn over<const N: usize>(b: &SMatrix<f64, N, N>, a: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    // The bases are orthogonal or nearly so: their matrices have inverses.
    let inverse = a.try_inverse().unwrap_or_else(SMatrix::identity);
    let first = b * inverse;
    first + (b - first * a) * inverse
}

impl Default for Tableau {
    /// Computes the method from its definition.
    fn default() -> Self {
        let nodes = nodes();
        // Legendre's polynomials at the nodes, and their integrals (P_{k+1} − P_{k−1})/(2(2k+1)) from 0.
        let mut values = SMatrix::<f64, STAGES, STAGES>::zeros();
        let mut integrals = values;
        for (i, c) in nodes.iter().enumerate() {
            let x = 2.0 * c - 1.0;
            let mut p = [1.0; STAGES + 1];
            p[1] = x;
            for k in 1..STAGES {
                p[k + 1] = ((2 * k + 1) as f64 * x * p[k] - k as f64 * p[k - 1]) / (k + 1) as f64;
            }
            for k in 0..STAGES {
                values[(i, k)] = p[k];
                integrals[(i, k)] = if k == 0 { *c } else { (p[k + 1] - p[k - 1]) / (2 * (2 * k + 1)) as f64 };
            }
        }
        let at = |i: usize| if i == 0 { 0.0 } else { nodes[i - 1] };
        let mut basis = SMatrix::<f64, NODES, NODES>::zeros();
        for i in 0..NODES {
            for k in 0..NODES {
                basis[(i, k)] = libm::cos(k as f64 * libm::acos((2.0 * at(i) - 1.0).clamp(-1.0, 1.0)));
            }
        }
        Self { weights: over(&integrals, &values), chebyshev: over(&SMatrix::identity(), &basis), nodes }
    }
}

/// Start of a step.
#[derive(Clone, Copy)]
pub(super) struct From<'a> {
    pub field: &'a dyn VectorField,
    pub mode: &'a Mode,
    pub at: Instant,
    pub x: &'a [f64],
}

/// The method, computed once for all engines.
static TABLEAU: LazyLock<Tableau> = LazyLock::new(Tableau::default);

/// Radau step with its working space.
#[derive(Debug)]
pub(super) struct Radau {
    tableau: &'static Tableau,
    /// `X(c_i) − x`, stage by stage.
    z: DVector<f64>,
    slopes: Vec<f64>,
    scratch: Vec<f64>,
    lu: Option<LU<f64, Dyn, Dyn>>,
}

impl Default for Radau {
    fn default() -> Self {
        let (z, slopes, scratch) = (DVector::default(), Vec::new(), Vec::new());
        Self { tableau: &TABLEAU, z, slopes, scratch, lu: None }
    }
}

impl Radau {
    /// Attempts a step of length `h`; `sizes` are those of the components. Returns the largest ratio of a last coefficient to [`RESOLVED`]
    /// times the size of its component; `None` if Newton's method fails.
    pub fn attempt(&mut self, from: From<'_>, h: f64, sizes: &[f64]) -> Option<f64> {
        let d = from.x.len();
        self.z = DVector::zeros(STAGES * d);
        self.slopes.resize(STAGES * d, 0.0);
        self.scratch.resize(3 * d, 0.0);
        self.lu = None;
        let (mut before, mut converged) = (f64::INFINITY, false);
        for _ in 0..MAX_CORRECTIONS {
            if self.lu.is_none() {
                self.factor(from, h);
            }
            let correction = self.correction(from, h)?;
            self.z += &correction;
            let parts = correction.iter().enumerate().map(|(k, c)| c.abs() / sizes[k % d]);
            let size = parts.fold(0.0, |m: f64, r| if r.is_nan() { f64::INFINITY } else { m.max(r) });
            if size <= CONVERGED || size <= 10.0 * CONVERGED && size >= 0.5 * before {
                converged = true;
                break;
            }
            if !size.is_finite() {
                return None;
            }
            if size > FALL * before || before.is_infinite() {
                self.lu = None;
            }
            before = size;
        }
        let last =
            |i: usize| (0..STAGES).map(|k| self.tableau.chebyshev[(STAGES, k + 1)] * self.z[k * d + i]).sum::<f64>();
        converged.then(|| sizes.iter().enumerate().fold(0.0, |m: f64, (i, s)| m.max(last(i).abs() / (RESOLVED * s))))
    }

    fn factor(&mut self, from: From<'_>, h: f64) {
        let d = from.x.len();
        let mut m = DMatrix::identity(STAGES * d, STAGES * d);
        let (x, rest) = self.scratch.split_at_mut(d);
        let (unit, column) = rest.split_at_mut(d);
        for (j, c) in self.tableau.nodes.iter().enumerate() {
            x.iter_mut().enumerate().for_each(|(i, x)| *x = from.x[i] + self.z[j * d + i]);
            for k in 0..d {
                unit.fill(0.0);
                unit[k] = 1.0;
                from.field.jac_mul(from.mode, from.at, c * h, x, unit, column);
                for i in 0..STAGES {
                    let a = h * self.tableau.weights[(i, j)];
                    column.iter().enumerate().for_each(|(l, v)| m[(i * d + l, j * d + k)] -= a * v);
                }
            }
        }
        self.lu = Some(m.lu());
    }

    /// Returns the correction of the stages by Newton's method.
    fn correction(&mut self, from: From<'_>, h: f64) -> Option<DVector<f64>> {
        let d = from.x.len();
        let x = &mut self.scratch[..d];
        for (j, (c, f)) in self.tableau.nodes.iter().zip(self.slopes.chunks_exact_mut(d)).enumerate() {
            x.iter_mut().enumerate().for_each(|(i, x)| *x = from.x[i] + self.z[j * d + i]);
            from.field.eval(from.mode, from.at, c * h, x, f);
        }
        let mut residual = -&self.z;
        for i in 0..STAGES {
            for j in 0..STAGES {
                let a = h * self.tableau.weights[(i, j)];
                (0..d).for_each(|k| residual[i * d + k] += a * self.slopes[j * d + k]);
            }
        }
        self.lu.as_ref()?.solve(&residual)
    }

    /// Replaces the state `x` at the start of the step by the state at its end.
    pub fn advance(&self, x: &mut [f64]) {
        let d = x.len();
        x.iter_mut().enumerate().for_each(|(i, x)| *x += self.z[(STAGES - 1) * d + i]);
    }

    /// Writes the polynomial in powers of θ, row k the coefficients of `θᵏ`; `powers` are those of `T_k(2θ − 1)`.
    pub fn write(&self, x: &[f64], powers: impl Fn(usize, usize) -> f64, rows: &mut Vec<f64>) {
        let d = x.len();
        rows.clear();
        rows.resize(NODES * d, 0.0);
        for i in 0..d {
            for k in 0..NODES {
                let c: f64 = (0..STAGES).map(|j| self.tableau.chebyshev[(k, j + 1)] * self.z[j * d + i]).sum();
                (1..=k).for_each(|l| rows[l * d + i] += c * powers(k, l));
            }
            rows[i] = x[i];
        }
    }
}
