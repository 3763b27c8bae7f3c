//! Mean speeds from tooth numbers, exactly: linear conditions with whole coefficients, solved in fractions.

use num_rational::Ratio;
use num_traits::{CheckedDiv, CheckedMul, CheckedSub, Zero};

/// A speed relative to the given one.
pub(super) type Speed = Ratio<i128>;

/// A condition `Σ c ω = value` on speeds.
#[derive(Clone, Debug)]
pub(super) struct Condition {
    /// Name of the condition in messages.
    pub name: String,
    /// Numbers of the bodies and their coefficients.
    pub terms: Vec<(usize, i128)>,
    pub value: i128,
}

/// Reason for which conditions do not determine the speeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum SpeedFault {
    /// No condition fixes these bodies.
    Free(Vec<usize>),
    /// These conditions contradict each other.
    Contradiction(Vec<usize>),
    /// The fractions leave the range of 128 bits.
    Range,
}

/// Conditions in reduced form (Gauss and Jordan). A row has the coefficients, the value, and the multiples of the given conditions that it
/// consists of.
struct Elimination {
    rows: Vec<Vec<Speed>>,
    bodies: usize,
}

impl Elimination {
    fn new(bodies: usize, conditions: &[Condition]) -> Self {
        let row = |(i, condition): (usize, &Condition)| {
            let mut row = vec![Speed::zero(); bodies + 1 + conditions.len()];
            condition.terms.iter().for_each(|(body, c)| row[*body] += c);
            row[bodies] = Speed::from(condition.value);
            row[bodies + 1 + i] = Speed::from(1);
            row
        };
        Self { rows: conditions.iter().enumerate().map(row).collect(), bodies }
    }

    /// Reduces the rows; returns the row that determines each body, if any.
    fn run(&mut self) -> Option<Vec<Option<usize>>> {
        let mut next = 0;
        let mut pivots = vec![None; self.bodies];
        for (body, pivot) in pivots.iter_mut().enumerate() {
            let Some(found) = (next..self.rows.len()).find(|i| !self.rows[*i][body].is_zero()) else { continue };
            self.rows.swap(next, found);
            let scale = self.rows[next][body];
            let own: Option<Vec<Speed>> = self.rows[next].iter().map(|x| x.checked_div(&scale)).collect();
            let own = own?;
            for (i, row) in self.rows.iter_mut().enumerate() {
                let factor = row[body];
                if i != next && !factor.is_zero() {
                    for (x, y) in row.iter_mut().zip(&own) {
                        *x = x.checked_sub(&y.checked_mul(&factor)?)?;
                    }
                }
            }
            self.rows[next] = own;
            *pivot = Some(next);
            next += 1;
        }
        Some(pivots)
    }
}

/// Computes the speeds of `bodies` bodies.
pub(super) fn speeds(bodies: usize, conditions: &[Condition]) -> Result<Vec<Speed>, SpeedFault> {
    let mut elimination = Elimination::new(bodies, conditions);
    let pivots = elimination.run().ok_or(SpeedFault::Range)?;
    let is_empty = |row: &&Vec<Speed>| row[..bodies].iter().all(Zero::is_zero) && !row[bodies].is_zero();
    if let Some(row) = elimination.rows.iter().find(is_empty) {
        let used = row[bodies + 1..].iter().enumerate().filter(|(_, multiple)| !multiple.is_zero());
        return Err(SpeedFault::Contradiction(used.map(|(i, _)| i).collect()));
    }
    // A body is determined if its row contains no other one.
    let alone = |row: usize| elimination.rows[row][..bodies].iter().filter(|x| !x.is_zero()).count() == 1;
    let free: Vec<usize> = (0..bodies).filter(|body| !pivots[*body].is_some_and(alone)).collect();
    if !free.is_empty() {
        return Err(SpeedFault::Free(free));
    }
    Ok(pivots.into_iter().flatten().map(|row| elimination.rows[row][bodies]).collect())
}
