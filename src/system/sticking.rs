//! Rigid contacts at rest, and the multipliers that hold them.

use smallvec::SmallVec;

use super::{
    assemble::{PerContact, Structure, zeros},
    contact_mode::contact_mode,
};
use crate::hybrid::Mode;

/// The resting contacts of a mode, and the factors of their mobility matrix `W = G M⁻¹ Gᵀ`.
///
/// `W = L D Lᵀ`; a pivot that vanishes belongs to a contact that the previous ones already hold. The motion does not depend on the
/// distribution of the load among such contacts. The multipliers of least norm treat equal contacts equally: with `B = L √D` and `S = BᵀB`
/// they are `B S⁻² Bᵀ r`.
#[derive(Debug)]
pub(crate) struct Sticking {
    set: PerContact<usize>,
    factor: SmallVec<[PerContact<f64>; 4]>,
    pivot: PerContact<f64>,
    /// Cholesky factor of S, if a contact is redundant.
    shared: Option<Vec<PerContact<f64>>>,
}

/// Ratio of a pivot to its diagonal entry below which the contact is redundant: far above rounding (10⁻¹⁶ times the number of contacts),
/// far below any mass ratio of a gear train.
const REDUNDANT: f64 = 1e-12;

impl Sticking {
    /// Factors the resting contacts of `mode`; `None` if there are none.
    pub fn new(s: &Structure, mode: &Mode) -> Option<Self> {
        let resting = |j: &usize| s.contacts[*j].spec.law.is_rigid() && contact_mode(mode, *j).is_closed();
        let mut resting = (0..s.contacts.len()).filter(resting).peekable();
        resting.peek()?;
        Some(Self::of(s, resting))
    }

    /// Factors the given contacts, closed or not.
    pub fn of(s: &Structure, contacts: impl Iterator<Item = usize>) -> Self {
        let set: PerContact<usize> = contacts.collect();
        let mut factor: SmallVec<[PerContact<f64>; 4]> = SmallVec::new();
        let mut pivot = zeros(set.len());
        for i in 0..set.len() {
            let mut row = zeros(set.len());
            for j in 0..=i {
                let w = s.coupling(set[i], set[j]);
                let other = factor.get(j).unwrap_or(&row);
                let known: f64 = (0..j).map(|k| row[k] * other[k] * pivot[k]).sum();
                if i == j {
                    let p = w - known;
                    pivot[i] = if p > REDUNDANT * w { p } else { 0.0 };
                    row[i] = 1.0;
                } else {
                    row[j] = if pivot[j] > 0.0 { (w - known) / pivot[j] } else { 0.0 };
                }
            }
            factor.push(row);
        }
        let mut sticking = Self { set, factor, pivot, shared: None };
        if sticking.pivot.contains(&0.0) {
            sticking.share();
        }
        sticking
    }

    /// Returns `B_ij`, zero in the columns of redundant contacts.
    fn half(&self, i: usize, j: usize) -> f64 {
        if i < j { 0.0 } else { self.factor[i][j] * self.pivot[j].sqrt() }
    }

    /// Factors S; redundant contacts get a one on the diagonal.
    fn share(&mut self) {
        let mut s = vec![zeros(self.set.len()); self.set.len()];
        for i in 0..self.set.len() {
            for j in 0..=i {
                let gram: f64 = (i..self.set.len()).map(|k| self.half(k, i) * self.half(k, j)).sum();
                let known: f64 = (0..j).map(|k| s[i][k] * s[j][k]).sum();
                s[i][j] = match i == j {
                    true if self.pivot[i] == 0.0 => 1.0,
                    true => (gram - known).sqrt(),
                    false => (gram - known) / s[j][j],
                };
            }
        }
        self.shared = Some(s);
    }

    /// Replaces `r` by `B S⁻² Bᵀ r`.
    fn solve_shared(&self, s: &[PerContact<f64>], r: &mut [f64]) {
        let n = self.set.len();
        let mut y = zeros(n);
        for (j, y) in y[..n].iter_mut().enumerate() {
            *y = (j..n).map(|i| self.half(i, j) * r[i]).sum();
        }
        for _ in 0..2 {
            for i in 0..n {
                y[i] = (y[i] - (0..i).map(|k| s[i][k] * y[k]).sum::<f64>()) / s[i][i];
            }
            for i in (0..n).rev() {
                y[i] = (y[i] - (i + 1..n).map(|k| s[k][i] * y[k]).sum::<f64>()) / s[i][i];
            }
        }
        for (i, r) in r[..n].iter_mut().enumerate() {
            *r = (0..=i).map(|j| self.half(i, j) * y[j]).sum();
        }
    }

    /// Returns whether some of the contacts hold others.
    pub fn is_redundant(&self) -> bool {
        self.shared.is_some()
    }

    /// Returns whether these contacts hold contact `j`: its direction is a combination of theirs.
    pub fn holds(&self, s: &Structure, j: usize) -> bool {
        let mut row = zeros(self.set.len());
        let mut left = s.coupling(j, j);
        for i in 0..self.set.len() {
            let known: f64 = (0..i).map(|k| self.factor[i][k] * row[k] * self.pivot[k]).sum();
            if self.pivot[i] > 0.0 {
                row[i] = (s.coupling(j, self.set[i]) - known) / self.pivot[i];
                left -= row[i] * row[i] * self.pivot[i];
            }
        }
        left <= REDUNDANT * s.coupling(j, j)
    }

    /// Returns the number of contacts that the others do not hold.
    pub fn independent(&self) -> usize {
        self.pivot.iter().filter(|pivot| **pivot > 0.0).count()
    }

    pub fn contacts(&self) -> &[usize] {
        &self.set
    }

    /// Returns column `k` of `W⁻¹`.
    pub fn inverse_column(&self, k: usize) -> PerContact<f64> {
        let mut column = zeros(self.set.len());
        column[k] = 1.0;
        self.solve(&mut column);
        column
    }

    /// Solves `W f = r` in place.
    pub fn solve(&self, r: &mut [f64]) {
        if let Some(shared) = &self.shared {
            return self.solve_shared(shared, r);
        }
        for i in 0..self.set.len() {
            let known: f64 = (0..i).map(|j| self.factor[i][j] * r[j]).sum();
            r[i] -= known;
        }
        for (r, p) in r.iter_mut().zip(&self.pivot) {
            *r = if *p > 0.0 { *r / p } else { 0.0 };
        }
        for i in (0..self.set.len()).rev() {
            let known: f64 = (i + 1..self.set.len()).map(|j| self.factor[j][i] * r[j]).sum();
            r[i] -= known;
        }
    }
}
