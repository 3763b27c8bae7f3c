//! Small systems of linear equations, and complementarity by enumeration.

use super::wide::{Wide, size, wide};

pub fn dot(a: &[Wide], b: &[Wide]) -> Wide {
    a.iter().zip(b).fold(wide(0.0), |s, (x, y)| s + *x * *y)
}

/// `A⁻¹ b` by elimination with row pivots.
pub fn solve(a: &[Vec<Wide>], b: &[Wide]) -> Vec<Wide> {
    let n = b.len();
    let mut rows: Vec<Vec<Wide>> = a.iter().zip(b).map(|(r, b)| r.iter().copied().chain([*b]).collect()).collect();
    for i in 0..n {
        let pivot = (i..n).max_by(|x, y| size(rows[*x][i]).total_cmp(&size(rows[*y][i]))).unwrap_or(i);
        rows.swap(i, pivot);
        let row = rows[i].clone();
        for (_, other) in rows.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            if other[i] != wide(0.0) {
                let f = other[i] / row[i];
                other.iter_mut().zip(&row).skip(i).for_each(|(x, r)| *x = *x - f * *r);
            }
        }
    }
    (0..n).map(|i| rows[i][n] / rows[i][i]).collect()
}

/// The independent rows of a symmetric matrix without negative eigenvalues: pivots of its Cholesky factor.
fn independent(a: &[Vec<Wide>]) -> Vec<usize> {
    let n = a.len();
    let mut rest: Vec<Vec<Wide>> = a.to_vec();
    let mut rows = Vec::new();
    while rows.len() < n {
        let left = |i: &usize| !rows.contains(i);
        // The relative pivot, so that equal contacts count as equal; the first of equals.
        let worth = |i: usize| size(rest[i][i]) / size(a[i][i]).max(f64::MIN_POSITIVE);
        let Some(i) = (0..n).filter(left).max_by(|x, y| worth(*x).total_cmp(&worth(*y)).then(y.cmp(x))) else { break };
        if worth(i) < 1e-18 {
            break;
        }
        rows.push(i);
        let row = rest[i].clone();
        for j in 0..n {
            let f = row[j] / row[i];
            for k in 0..n {
                let change = f * row[k];
                rest[j][k] = rest[j][k] - change;
            }
        }
    }
    rows.sort_unstable();
    rows
}

/// The least solution of `A x = b`, A symmetric without negative eigenvalues, b in its range.
pub fn least(a: &[Vec<Wide>], b: &[Wide]) -> Vec<Wide> {
    let rows = independent(a);
    if rows.len() == a.len() {
        return solve(a, b);
    }
    let gram: Vec<Vec<Wide>> = rows.iter().map(|i| rows.iter().map(|j| dot(&a[*i], &a[*j])).collect()).collect();
    let y = solve(&gram, &rows.iter().map(|i| b[*i]).collect::<Vec<_>>());
    (0..a.len()).map(|k| rows.iter().zip(&y).fold(wide(0.0), |s, (i, y)| s + a[*i][k] * *y)).collect()
}

/// A solution of a complementarity problem: `x` and `w = A x + b`.
pub struct Solution {
    pub x: Vec<Wide>,
    pub w: Vec<Wide>,
}

/// `w = A x + b` with `w = 0` for the contacts of `closed`, and `x ≥ 0, w ≥ 0, x w = 0` for the others.
///
/// All sets of active contacts are tried. Of those that fit, the one with the least x counts.
pub fn complementary(a: &[Vec<Wide>], b: &[Wide], closed: &[bool], slack: f64) -> Option<Solution> {
    let n = b.len();
    let free: Vec<usize> = (0..n).filter(|i| !closed[*i]).collect();
    let mut best: Option<(f64, Solution)> = None;
    for set in 0..1_u32 << free.len() {
        let active: Vec<usize> = (0..n)
            .filter(|i| closed[*i] || free.iter().position(|f| f == i).is_some_and(|k| set >> k & 1 == 1))
            .collect();
        let inner: Vec<Vec<Wide>> = active.iter().map(|i| active.iter().map(|j| a[*i][*j]).collect()).collect();
        let part = least(&inner, &active.iter().map(|i| -b[*i]).collect::<Vec<_>>());
        let mut x = vec![wide(0.0); n];
        active.iter().zip(part).for_each(|(i, p)| x[*i] = p);
        let w: Vec<Wide> = (0..n).map(|i| dot(&a[i], &x) + b[i]).collect();
        let fits = (0..n).all(|i| {
            let held = active.contains(&i);
            let force = x[i].hi() * size(a[i][i]);
            if held && size(w[i]) > slack {
                return false;
            }
            closed[i] || (w[i].hi() >= -slack && force >= -slack)
        });
        let length: f64 = x.iter().map(|x| x.hi() * x.hi()).sum();
        // The smaller set of two that give the same.
        if fits && best.as_ref().is_none_or(|(least, _)| length < *least * (1.0 - 1e-12)) {
            best = Some((length, Solution { x, w }));
        }
    }
    best.map(|(_, s)| s)
}
