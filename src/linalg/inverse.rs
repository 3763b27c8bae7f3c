//! `M⁻¹ b` to the last digit, for a symmetric positive definite M.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::hybrid::Wide;

/// Maximum number of rounds of refinement. Each gains a factor `n κ ε`; a gain below two ends the refinement.
const ROUNDS: usize = 60;

/// The inverse of a mass matrix.
#[derive(Clone, Debug)]
pub(crate) struct Inverse {
    matrix: DMatrix<f64>,
    cholesky: Cholesky<f64, Dyn>,
    /// True if no entry off the diagonal is non-zero: the Cholesky factor alone is exact to rounding.
    is_diagonal: bool,
}

impl Inverse {
    /// Factors `matrix`; `None` if it is not positive definite.
    pub fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        let n = matrix.nrows();
        let is_diagonal = (0..n).all(|i| (0..i).all(|j| matrix[(i, j)] == 0.0));
        Some(Self { cholesky: Cholesky::new(matrix.clone())?, matrix: matrix.clone(), is_diagonal })
    }

    /// Returns `M⁻¹ b` in two doubles, refined by residuals in two doubles (Higham 2002, §12.1). A plain solution is wrong by `n κ ε`.
    pub fn wide(&self, b: &DVector<f64>) -> Vec<Wide> {
        let mut x: Vec<Wide> = self.cholesky.solve(b).iter().map(|x| Wide::from(*x)).collect();
        if self.is_diagonal {
            return x;
        }
        let mut last = f64::INFINITY;
        for _ in 0..ROUNDS {
            let residual = |i: usize| {
                let terms = x.iter().enumerate().map(|(j, x)| *x * self.matrix[(i, j)]);
                terms.fold(Wide::from(b[i]), |sum, term| sum - term).value()
            };
            let correction = self.cholesky.solve(&DVector::from_fn(x.len(), |i, _| residual(i)));
            // Degrees of freedom with different units are compared by their diagonals.
            let weighted = correction.iter().enumerate().map(|(i, c)| c.abs() * self.matrix[(i, i)].sqrt());
            let size = weighted.fold(0.0, f64::max);
            if !(size > 0.0 && size < 0.5 * last) {
                break;
            }
            last = size;
            x.iter_mut().zip(&correction).for_each(|(x, c)| *x = x.plus(*c));
        }
        x
    }

    /// Returns `M⁻¹ b` rounded once.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.wide(&DVector::from_column_slice(b)).into_iter().map(Wide::value).collect()
    }

    /// Returns `M⁻¹ B` rounded once.
    pub fn solve_matrix(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let columns: Vec<f64> = b.column_iter().flat_map(|column| self.solve(column.as_slice())).collect();
        DMatrix::from_vec(b.nrows(), b.ncols(), columns)
    }
}
