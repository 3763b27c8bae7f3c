//! What the targets determine, and what they leave open.

use std::fmt;

use nalgebra::DMatrix;
use serde::Serialize;

/// Singular values below this share of the largest are rounding: that of natural frequencies, some 1e-13, over the
/// step of the differences, 1e-5, with room to spare.
const RANK: f64 = 1e-6;
/// A direction along which one standard deviation of the targets lets a number move by more than this is weak.
const WEAK: f64 = 0.5;
/// Shares of a direction smaller than this are not worth a word.
const SMALL: f64 = 0.02;
/// A number takes part in a free direction if its share is larger: null vectors carry the rounding of the Jacobian.
const TAKES_PART: f64 = 1e-4;

/// How well the numbers are determined near the solution: by the singular values of `∂r/∂x` `[targets × numbers]`, with
/// r in standard deviations and x the logarithms of the numbers (shares of their range where a bound is not positive).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Uniqueness {
    /// Numbers sought.
    pub unknowns: usize,
    /// Targets.
    pub targets: usize,
    /// Directions that the targets see.
    pub rank: usize,
    /// Singular values, falling, one per number: standard deviations for a factor e (or the whole range).
    pub singular_values: Vec<f64>,
    /// Directions that leave every target where it is, to first order. Each has one number of its own (the first).
    pub free: Vec<Direction>,
    /// Directions that the targets see, but little.
    pub weak: Vec<Direction>,
    /// Correlation of the numbers' errors; none beside a number that is not determined.
    pub correlation: Vec<Vec<Option<f64>>>,
}

/// Numbers that move together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Direction {
    /// Pointers of the numbers, the one that moves most first.
    pub numbers: Vec<String>,
    /// How far each moves for 1 % of the first one, %.
    pub percent: Vec<f64>,
    /// How far the first may move within one standard deviation of the targets, %; none for a free direction.
    pub within_sigma_percent: Option<f64>,
}

impl Uniqueness {
    /// From the Jacobian and the names of its columns, with the variance of each coordinate it determines.
    pub(super) fn new(jacobian: &DMatrix<f64>, names: &[String]) -> (Self, Vec<Option<f64>>) {
        let (targets, unknowns) = jacobian.shape();
        // Rows of zeros change nothing but make the decomposition give every direction.
        let square = jacobian.clone().resize_vertically(targets.max(unknowns), 0.0);
        let svd = square.svd(false, true);
        let v = svd.v_t.map_or(DMatrix::zeros(unknowns, unknowns), |v_t| v_t.transpose());
        let singular_values: Vec<f64> = svd.singular_values.iter().copied().collect();
        let floor = RANK * singular_values.first().copied().unwrap_or(0.0);
        let rank = singular_values.iter().filter(|s| **s > floor).count();
        let null = v.columns_range(rank..).into_owned();
        let seen = (0..rank).map(|i| v.column(i) / singular_values[i]);
        let covariance =
            seen.fold(DMatrix::zeros(unknowns, unknowns), |sum, column| sum + &column * column.transpose());
        let determined = |j: usize| null.row(j).norm() <= TAKES_PART;
        let variances: Vec<Option<f64>> = (0..unknowns).map(|j| determined(j).then(|| covariance[(j, j)])).collect();
        let correlate = |i: usize, j: usize| Some(covariance[(i, j)] / (variances[i]? * variances[j]?).sqrt());
        let correlation = (0..unknowns).map(|i| (0..unknowns).map(|j| correlate(i, j)).collect()).collect();
        let weak = (0..rank).filter(|i| singular_values[*i] * WEAK < 1.0).map(|i| {
            let mut direction = Direction::new(v.column(i).iter().copied(), names);
            direction.within_sigma_percent = Some(100.0 * v.column(i).amax() / singular_values[i]);
            direction
        });
        let free = echelon(null).column_iter().map(|column| Direction::new(column.iter().copied(), names)).collect();
        let weak = weak.collect();
        (Self { unknowns, targets, rank, singular_values, free, weak, correlation }, variances)
    }

    /// Whether no direction is free.
    #[must_use]
    pub fn is_unique(&self) -> bool {
        self.rank == self.unknowns
    }
}

impl Direction {
    fn new(column: impl Iterator<Item = f64>, names: &[String]) -> Self {
        let mut parts: Vec<(String, f64)> = names.iter().cloned().zip(column).collect();
        parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let first = parts.first().map_or(1.0, |part| part.1);
        parts.iter_mut().for_each(|part| part.1 /= first);
        parts.retain(|part| part.1.abs() >= SMALL);
        let (numbers, percent) = parts.into_iter().unzip();
        Self { numbers, percent, within_sigma_percent: None }
    }
}

/// The same space by columns that each have a number of their own: Gauss–Jordan elimination with complete pivoting.
fn echelon(mut space: DMatrix<f64>) -> DMatrix<f64> {
    let mut taken: Vec<usize> = Vec::new();
    for i in 0..space.ncols() {
        let mut pivot = (i, 0);
        for column in i..space.ncols() {
            for row in (0..space.nrows()).filter(|row| !taken.contains(row)) {
                if space[(row, column)].abs() > space[(pivot.1, pivot.0)].abs() || taken.contains(&pivot.1) {
                    pivot = (column, row);
                }
            }
        }
        let (column, row) = pivot;
        taken.push(row);
        space.swap_columns(i, column);
        let scale = space[(row, i)];
        space.column_mut(i).unscale_mut(scale);
        for other in (0..space.ncols()).filter(|other| *other != i) {
            let factor = space[(row, other)];
            let subtracted = space.column(i) * factor;
            let mut column = space.column_mut(other);
            column -= subtracted;
        }
    }
    space
}

impl fmt::Display for Uniqueness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (unknowns, targets) = (counted(self.unknowns, "number"), counted(self.targets, "target"));
        if self.is_unique() {
            write!(f, "Unique near the solution: {targets} determine {unknowns}.")?;
        } else {
            let count = counted(self.unknowns - self.rank, "direction");
            let verb = if self.unknowns - self.rank == 1 { "leaves" } else { "leave" };
            write!(f, "Not unique: {targets} determine {} of {unknowns}; {count} {verb} every target:", self.rank)?;
        }
        for direction in &self.free {
            write!(f, "\n  {direction}")?;
        }
        if !self.weak.is_empty() {
            write!(f, "\nWeakly determined; within one standard deviation of the targets:")?;
        }
        for direction in &self.weak {
            write!(f, "\n  {direction}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let moves = |(name, percent): (&String, &f64)| format!("{name} by {percent:+.2} %");
        let parts: Vec<String> = self.numbers.iter().zip(&self.percent).map(moves).collect();
        match (self.within_sigma_percent, &parts[..]) {
            (Some(reach), _) => {
                write!(f, "{} by +-{reach:.0} %", self.numbers[0])?;
                let others = parts.iter().skip(1).cloned().collect::<Vec<_>>().join(", ");
                if others.is_empty() { Ok(()) } else { write!(f, ", for each +1 % of it {others}") }
            }
            (None, [_, _, ..]) => write!(f, "{}", parts.join(" with ")),
            (None, _) => write!(f, "{} alone", self.numbers[0]),
        }
    }
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
