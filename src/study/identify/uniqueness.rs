//! Uniqueness of a solution: directions that the targets determine or leave open.

use std::fmt;

use nalgebra::DMatrix;
use serde::Serialize;

use super::Parameter;

/// Share of the largest singular value below which one is rounding: that of natural frequencies, some 1e-13, over the step of the
/// differences, 1e-5, with a margin.
const RANK: f64 = 1e-6;
/// Change of a number within one standard deviation of the targets above which a direction is weak.
const WEAK: f64 = 0.5;
/// Share of a direction below which a number is not mentioned.
const SMALL: f64 = 0.02;
/// Share above which a number takes part in a free direction: null vectors carry the rounding of the Jacobian.
const TAKES_PART: f64 = 1e-4;

/// Determination of the numbers near the solution, by the singular values of `∂r/∂x` `[targets × numbers]`. Here r is in standard
/// deviations and x are the logarithms of the numbers (shares of their range if a bound is not positive).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Uniqueness {
    /// Count of the numbers to find.
    pub unknowns: usize,
    /// Count of the targets.
    pub targets: usize,
    /// Count of directions that change the targets.
    pub rank: usize,
    /// Singular values, falling, one per number: standard deviations for a factor e (or the whole range).
    pub singular_values: Vec<f64>,
    /// Directions that change no target, to first order. Each has one number (the first) that no other has.
    pub free: Vec<NumberDirection>,
    /// Directions that change the targets only a little.
    pub weak: Vec<NumberDirection>,
    /// Correlation of the numbers' errors; none for a number that is not determined.
    pub correlation: Vec<Vec<Option<f64>>>,
}

/// Numbers that change together, the one that changes most first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NumberDirection {
    /// Changes of the numbers, at least one.
    pub moves: Vec<NumberShare>,
    /// Change of the first number within one standard deviation of the targets, to first order, %; none for a free direction.
    pub within_sigma_percent: Option<f64>,
}

/// Part of a number in a direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NumberShare {
    /// Pointers of the number.
    pub number: String,
    /// Its change for 1 % of the first one, %.
    pub percent: f64,
    /// True if this is a share of its range, and not of its value.
    pub of_range: bool,
}

impl Uniqueness {
    /// Returns the uniqueness from the Jacobian, with the variance of each coordinate that it determines.
    pub(super) fn new(jacobian: &DMatrix<f64>, parameters: &[Parameter]) -> (Self, Vec<Option<f64>>) {
        let (targets, unknowns) = jacobian.shape();
        // Rows of zeros make the decomposition return every direction, without other effect.
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
            let mut direction = NumberDirection::new(v.column(i).iter().copied(), parameters);
            direction.within_sigma_percent = Some(100.0 * v.column(i).amax() / singular_values[i]);
            direction
        });
        let free = echelon(null)
            .column_iter()
            .map(|column| NumberDirection::new(column.iter().copied(), parameters))
            .collect();
        let weak = weak.collect();
        (Self { unknowns, targets, rank, singular_values, free, weak, correlation }, variances)
    }

    /// Returns whether no direction is free.
    #[must_use]
    pub fn is_unique(&self) -> bool {
        self.rank == self.unknowns
    }
}

impl NumberDirection {
    fn new(column: impl Iterator<Item = f64>, parameters: &[Parameter]) -> Self {
        let part =
            |(p, percent): (&Parameter, f64)| NumberShare { number: p.name(), percent, of_range: !p.is_logarithmic() };
        let mut moves: Vec<NumberShare> = parameters.iter().zip(column).map(part).collect();
        moves.sort_by(|a, b| b.percent.abs().total_cmp(&a.percent.abs()));
        let first = moves[0].percent;
        moves.iter_mut().for_each(|part| part.percent /= first);
        moves.retain(|part| part.percent.abs() >= SMALL);
        Self { moves, within_sigma_percent: None }
    }
}

/// Returns the same space by columns that each have a separate number: Gauss–Jordan elimination with complete pivoting.
fn echelon(mut space: DMatrix<f64>) -> DMatrix<f64> {
    let mut own: Vec<usize> = Vec::new();
    for i in 0..space.ncols() {
        let places = (i..space.ncols()).flat_map(|column| (0..space.nrows()).map(move |row| (row, column)));
        let left = places.filter(|(row, _)| !own.contains(row));
        let Some((row, column)) = left.max_by(|a, b| space[*a].abs().total_cmp(&space[*b].abs())) else { break };
        own.push(row);
        space.swap_columns(i, column);
        let pivot = space.column(i) / space[(row, i)];
        for other in (0..space.ncols()).filter(|other| *other != i) {
            let factor = space[(row, other)];
            space.column_mut(other).axpy(-factor, &pivot, 1.0);
        }
        space.set_column(i, &pivot);
    }
    space
}

impl fmt::Display for Uniqueness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (unknowns, targets) = (counted(self.unknowns, "number"), counted(self.targets, "target"));
        if self.is_unique() {
            write!(f, "Unique near the solution: {unknowns} from {targets}.")?;
        } else {
            let left = counted(self.unknowns - self.rank, "direction");
            write!(f, "Not unique: {unknowns} from {targets}. No target changes, to first order, along {left}:")?;
        }
        for direction in &self.free {
            write!(f, "\n  {direction}")?;
        }
        if !self.weak.is_empty() {
            write!(f, "\nWeakly determined: the standard deviations of the targets let move")?;
        }
        for direction in &self.weak {
            write!(f, "\n  {direction}")?;
        }
        Ok(())
    }
}

impl fmt::Display for NumberDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let first = &self.moves[0];
        match self.within_sigma_percent {
            // Beyond 100 %, first order gives no number.
            Some(reach) if reach > 100.0 => write!(f, "{} by more than its own size", first.number)?,
            Some(reach) => write!(f, "{} by {reach:.0} %{}", first.number, of_range(first))?,
            None if self.moves.len() == 1 => return write!(f, "{} by any amount", first.number),
            None => write!(f, "{} by +1 %{}", first.number, of_range(first))?,
        }
        if self.within_sigma_percent.is_some() && self.moves.len() > 1 {
            write!(f, "; for each +1 %{} of it", of_range(first))?;
        }
        let part = |part: &NumberShare| format!("{} by {:+.2} %{}", part.number, part.percent, of_range(part));
        let others = self.moves[1..].iter().map(part).collect::<Vec<_>>().join(", ");
        if others.is_empty() { Ok(()) } else { write!(f, ", {others}") }
    }
}

fn of_range(part: &NumberShare) -> &'static str {
    if part.of_range { " of its range" } else { "" }
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
