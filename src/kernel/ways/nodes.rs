//! Polynomials on `[0, 1]` by their values at the zeros of a Chebyshev polynomial: integrals, coefficients, bounds beyond the interval.
//!
//! With `x = 2θ − 1` the nodes are the zeros of `T_S(x)`, in pairs ±x. Even and odd parts go through matrices of half the order each. A
//! function that is analytic inside the ellipse with foci ±1 and half axes of sum ρ, and at most M there, has Chebyshev coefficients of at
//! most `2Mρ⁻ᵏ`. At the nodes a `T_k` beyond the interpolant equals one of its own, so the error of the interpolant is at most
//!
//! ```text
//! 2 Σ_{k≥S} 2Mρ⁻ᵏ = 4M ρ⁻ˢ/(1 − 1/ρ)
//! ```

#![allow(clippy::needless_range_loop)] // index loops over fixed sizes are what the compiler unrolls

use std::sync::LazyLock;

use crate::{
    hybrid::Wide,
    poly::Row,
    vectors::{Path, fused},
};

/// Number of pairs of nodes; the next constant: number of nodes.
const PAIRS: usize = 11;
pub const NODES: usize = 2 * PAIRS;
/// Number of values of one side: one of each pair and an end, in whole vectors of four.
const SIDE: usize = PAIRS + 1;
/// Number of values: at positive x and x = 1, then at −x. It suffices for coefficients: a second integral has `NODES + 2`.
pub const LANES: usize = 2 * SIDE;
/// Index of the value at the end.
pub const END: usize = PAIRS;
/// Largest factor from values at the nodes to a value of their interpolant: `(2/π)(ln S + γ + ln(8/π))` is 2.93.
pub const LEBESGUE: f64 = 3.0;
/// Roundings of a sum over the nodes, relative to the sum of the sizes of its terms: one for each pair, one for the factor, one for
/// the product where it is rounded by itself, one each for the pair, the two parts and the two ends.
pub const SUMMED: f64 = (PAIRS + 6) as f64 * 0.5 * f64::EPSILON;
/// Sums of half axes of the ellipses on which functions are bounded.
const ELLIPSES: [f64; 5] = [7.0, 6.0, 8.5, 5.0, 11.0];

/// Factor that covers the rounding of sums of sizes.
pub const ROUNDED: f64 = 1.001;

/// Values, or coefficients: the even ones, then the odd ones.
pub type Values = [f64; LANES];
/// Number of fours of one half.
const SIDE_FOURS: usize = SIDE / 4;
/// Values four side by side.
pub type Fours<P> = Row<P, { 2 * SIDE_FOURS }>;
type Half = [f64; SIDE];
type Matrix = [Half; PAIRS];

/// Mask of the nodes: the ends are not nodes.
const INSIDE: Half = {
    let mut inside = [1.0; SIDE];
    inside[END] = 0.0;
    inside
};

/// Constants of one ellipse.
pub struct Ellipse {
    /// `ρᵏ`, at least the largest size of `T_k` on it.
    pub powers: Values,
    /// Error bound of an interpolant, relative to a bound of the function on the ellipse.
    pub share: f64,
}

/// Constants of the nodes. Of two matrices, the first applies to the even part of a function, the second to the odd part.
pub struct Nodes {
    /// Places θ of the nodes.
    pub theta: Values,
    /// Integral over θ from the middle.
    once: [Matrix; 2],
    /// Integral of this integral.
    twice: [Matrix; 2],
    /// Values to even and odd Chebyshev coefficients.
    coefficients: [Matrix; 2],
    /// Inverse of `coefficients`.
    values: [Matrix; 2],
    pub ellipses: [Ellipse; ELLIPSES.len()],
}

/// Returns `T_0(x) … T_{count−1}(x)`.
fn chebyshev(x: Wide, count: usize) -> Vec<Wide> {
    let mut t = vec![Wide::from(1.0), x];
    for k in 2..count {
        t.push(x * t[k - 1] * 2.0 - t[k - 2]);
    }
    t
}

/// Returns the Chebyshev coefficients of the integral over θ from the middle, `x = 0`.
fn integrated(a: &[Wide]) -> Vec<Wide> {
    let at = |k: usize| a.get(k).copied().unwrap_or_default();
    let mut b = vec![Wide::default()];
    for k in 1..=a.len() {
        let lower = at(k - 1) * if k == 1 { 2.0 } else { 1.0 };
        b.push(Wide::quotient(lower - at(k + 1), (4 * k) as f64));
    }
    // T_k(0) is 0, or ±1 in turn.
    b[0] = (2..b.len()).step_by(2).fold(b[0], |sum, k| if k % 4 == 0 { sum - b[k] } else { sum + b[k] });
    b
}

fn value_of(a: &[Wide], basis: &[Wide]) -> Wide {
    a.iter().zip(basis).fold(Wide::default(), |sum, (a, t)| sum + *a * *t)
}

/// Table of the constants, formed in two doubles and rounded once.
static TABLE: LazyLock<Box<Nodes>> = LazyLock::new(|| {
    let node = |l: usize| {
        let angle = std::f64::consts::PI * (2 * l + 1) as f64 / (2 * NODES) as f64;
        let first = Wide::from(libm::cos(angle));
        // One step of Newton's method squares an error of 1e-16.
        let t = chebyshev(first, NODES + 1)[NODES];
        first - Wide::quotient(t, NODES as f64 * libm::sin(NODES as f64 * angle) / libm::sin(angle))
    };
    let x: Vec<Wide> = (0..PAIRS).map(node).chain([1.0.into()]).collect();
    let basis: Vec<Vec<Wide>> = x.iter().map(|x| chebyshev(*x, LANES)).collect();
    let ellipses = ELLIPSES.map(|rho: f64| Ellipse {
        powers: std::array::from_fn(|l| rho.powi((2 * (l % SIDE) + l / SIDE) as i32)),
        share: ROUNDED * 4.0 * rho.powi(-(NODES as i32)) / (1.0 - rho.recip()),
    });
    let theta = |l: usize| {
        let x = if l < SIDE { x[l] } else { x[l - SIDE] * -1.0 };
        ((x + 1.0.into()) * 0.5).value()
    };
    let zero = [[[0.0; SIDE]; PAIRS]; 2];
    let mut table = Box::new(Nodes {
        theta: std::array::from_fn(theta),
        once: zero,
        twice: zero,
        coefficients: zero,
        values: zero,
        ellipses,
    });
    for odd in 0..2 {
        for i in 0..PAIRS {
            // One at x_i, ±1 at −x_i.
            let of = |k: usize| if k % 2 == odd { basis[i][k] * if k == 0 { 2.0 } else { 4.0 } } else { 0.0.into() };
            let unit: Vec<Wide> = (0..NODES).map(|k| Wide::quotient(of(k), NODES as f64)).collect();
            let once = integrated(&unit);
            let twice = integrated(&once);
            for l in 0..SIDE {
                table.once[odd][i][l] = value_of(&once, &basis[l]).value();
                table.twice[odd][i][l] = value_of(&twice, &basis[l]).value();
                table.coefficients[odd][i][l] = unit.get(2 * l + odd).map_or(0.0, |c| c.value());
                table.values[odd][i][l] = basis[l][2 * i + odd].value();
            }
        }
    }
    table
});

/// Loads values.
#[inline(always)]
pub fn fours<P: Path>(path: P, values: &Values) -> Fours<P> {
    let mut fours = [path.all(0.0); 2 * SIDE_FOURS];
    for (four, values) in fours.iter_mut().zip(values.as_chunks::<4>().0) {
        *four = path.four(*values);
    }
    fours
}

/// Stores values.
#[inline(always)]
pub fn numbers<P: Path>(path: P, fours: &Fours<P>) -> Values {
    let mut values = [0.0; LANES];
    for (values, four) in values.as_chunks_mut::<4>().0.iter_mut().zip(fours) {
        *values = path.numbers(*four);
    }
    values
}

/// Returns the even and the odd part.
#[inline(always)]
fn parts<P: Path>(path: P, f: &Fours<P>) -> Values {
    let (half, mut parts) = (path.all(0.5), *f);
    for i in 0..SIDE_FOURS {
        parts[i] = path.times(half, path.plus(f[i], f[i + SIDE_FOURS]));
        parts[i + SIDE_FOURS] = path.times(half, path.minus(f[i], f[i + SIDE_FOURS]));
    }
    numbers(path, &parts)
}

/// Returns `Σ parts_i matrix_i` of even and odd parts, for each pair of matrices. All sums are formed together to fill the registers.
#[inline(always)]
fn products<P: Path, const N: usize>(path: P, of: [(&[Matrix; 2], &Values); N]) -> [Fours<P>; N] {
    let mut sums = [[path.all(0.0); 2 * SIDE_FOURS]; N];
    for i in 0..PAIRS {
        for n in 0..N {
            let (matrices, parts) = of[n];
            let [even, odd] = [path.all(parts[i]), path.all(parts[SIDE + i])];
            for k in 0..SIDE_FOURS {
                let [first, second] = [matrices[0][i].as_chunks::<4>().0[k], matrices[1][i].as_chunks::<4>().0[k]];
                sums[n][k] = path.fused(path.four(first), even, sums[n][k]);
                sums[n][k + SIDE_FOURS] = path.fused(path.four(second), odd, sums[n][k + SIDE_FOURS]);
            }
        }
    }
    sums
}

/// Returns both parts at the end.
#[inline(always)]
fn ends<P: Path>(path: P, parts: &Fours<P>) -> [f64; 2] {
    [path.numbers(parts[END / 4])[END % 4], path.numbers(parts[SIDE_FOURS + END / 4])[END % 4]]
}

impl Nodes {
    /// Returns the table of the constants.
    pub fn table() -> &'static Self {
        &TABLE
    }

    /// Returns `v = start + h ∫ f dθ`.
    #[inline(always)]
    pub fn integral<P: Path>(&self, path: P, f: &Fours<P>, h: f64, start: f64) -> Fours<P> {
        // The integral of an even function from the middle is odd.
        let [once] = products(path, [(&self.once, &parts(path, f))]);
        let [odd, even] = ends(path, &once);
        added(path, &once, h, path.all(fused::<P>(h, odd - even, start)))
    }

    /// Returns `v = rate + h ∫ f dθ` and `start + h ∫ v dθ`.
    #[inline(always)]
    pub fn integrals<P: Path>(&self, path: P, f: &Fours<P>, h: f64, [start, rate]: [f64; 2]) -> [Fours<P>; 2] {
        let parts = parts(path, f);
        let [once, twice] = products(path, [(&self.once, &parts), (&self.twice, &parts)]);
        // The integral of an even function from the middle is odd, the second one is even.
        let ([odd, even], [second_even, second_odd]) = (ends(path, &once), ends(path, &twice));
        let middle = fused::<P>(h, odd - even, rate);
        let v = added(path, &once, h, path.all(middle));
        let from = path.all(fused::<P>(h * h, second_odd - second_even, start));
        let (rise, square, theta) = (path.all(h * middle), path.all(h * h), fours(path, &self.theta));
        let mut y = twice;
        for i in 0..SIDE_FOURS {
            let straight = path.fused(rise, theta[i], from);
            y[i] = path.fused(square, path.plus(twice[i], twice[i + SIDE_FOURS]), straight);
            let straight = path.fused(rise, theta[i + SIDE_FOURS], from);
            y[i + SIDE_FOURS] = path.fused(square, path.minus(twice[i], twice[i + SIDE_FOURS]), straight);
        }
        [v, y]
    }

    /// Returns the Chebyshev coefficients of the interpolants of two functions.
    #[inline(always)]
    pub fn coefficients<P: Path>(&self, path: P, f: &Fours<P>, g: &Fours<P>) -> [Values; 2] {
        let [f, g] = [parts(path, f), parts(path, g)];
        let [f, g] = products(path, [(&self.coefficients, &f), (&self.coefficients, &g)]);
        [numbers(path, &f), numbers(path, &g)]
    }

    /// Bounds the differences between two functions and the polynomials with these coefficients, at the nodes.
    #[inline(always)]
    pub fn differences<P: Path>(&self, path: P, [a, b]: [&Values; 2], [f, g]: [&Fours<P>; 2]) -> [f64; 2] {
        let [a, b] = products(path, [(&self.values, a), (&self.values, b)]);
        [difference(path, &a, f), difference(path, &b, g)]
    }
}

/// Adds `h` times the integral from the middle, its odd part first, to `from`.
#[inline(always)]
fn added<P: Path>(path: P, integral: &Fours<P>, h: f64, from: P::Four) -> Fours<P> {
    let (h, mut v) = (path.all(h), *integral);
    for i in 0..SIDE_FOURS {
        let [odd, even] = [integral[i], integral[i + SIDE_FOURS]];
        v[i] = path.fused(h, path.plus(even, odd), from);
        v[i + SIDE_FOURS] = path.fused(h, path.minus(even, odd), from);
    }
    v
}

/// Returns a bound on the difference at the nodes between f and the function with these even and odd parts: the root of its squares.
#[inline(always)]
fn difference<P: Path>(path: P, parts: &Fours<P>, f: &Fours<P>) -> f64 {
    let mut difference = *parts;
    for i in 0..SIDE_FOURS {
        let ([even, odd], inside) = ([parts[i], parts[i + SIDE_FOURS]], path.four(INSIDE.as_chunks::<4>().0[i]));
        difference[i] = path.times(inside, path.minus(path.plus(even, odd), f[i]));
        difference[i + SIDE_FOURS] = path.times(inside, path.minus(path.minus(even, odd), f[i + SIDE_FOURS]));
    }
    dot(path, &difference, &difference).sqrt()
}

/// Factors `1/4k`, in the order of coefficients.
const QUARTERS: Values = {
    let mut quarters = [0.0; LANES];
    let mut l = 1;
    while l < LANES {
        quarters[l] = 0.25 / (2 * (l % SIDE) + l / SIDE) as f64;
        l += 1;
    }
    quarters
};

/// Returns the coefficients of `start + h ∫ a dθ`, from those of a, of which the last is zero.
#[inline(always)]
pub fn antiderivative(a: &Values, h: f64, start: f64) -> Values {
    let mut b = [0.0; LANES];
    for l in 1..SIDE {
        b[l] = h * QUARTERS[l] * (a[SIDE + l - 1] - a[SIDE + l]);
    }
    for l in 0..PAIRS {
        b[SIDE + l] = h * QUARTERS[SIDE + l] * (a[l] - a[l + 1]);
    }
    // T_0 is integrated to T_1 alone.
    b[SIDE] += h * 0.25 * a[0];
    b[LANES - 1] = h * QUARTERS[LANES - 1] * a[SIDE - 1];
    let mut sums = [0.0; 4];
    for (even, odd) in b[..SIDE].as_chunks::<4>().0.iter().zip(b[SIDE..].as_chunks::<4>().0) {
        for l in 0..4 {
            sums[l] += odd[l] - even[l];
        }
    }
    b[0] = start + ((sums[0] + sums[1]) + (sums[2] + sums[3]));
    b
}

/// Returns coefficient `k`.
pub fn coefficient(a: &Values, k: usize) -> f64 {
    a[k % 2 * SIDE + k / 2]
}

/// Returns `Σ a_k T_k(2θ − 1)`.
pub fn value(a: &Values, theta: f64) -> f64 {
    let x = 2.0 * theta - 1.0;
    let (mut b, mut before) = (0.0, 0.0);
    for k in (1..LANES).rev() {
        (b, before) = (2.0 * x * b - before + coefficient(a, k), b);
    }
    x * b - before + a[0]
}

/// Returns `Σ a_k b_k`.
#[inline(always)]
pub fn dot<P: Path>(path: P, a: &Fours<P>, b: &Fours<P>) -> f64 {
    let mut sums = path.all(0.0);
    for i in 0..2 * SIDE_FOURS {
        sums = path.fused(a[i], b[i], sums);
    }
    let [a, b, c, d] = path.numbers(sums);
    (a + b) + (c + d)
}

/// Returns `Σ |a_k|`.
#[inline(always)]
pub fn total<P: Path>(path: P, a: &Values) -> f64 {
    let mut sums = path.all(0.0);
    for four in fours(path, a) {
        sums = path.plus(sums, path.sizes(four));
    }
    let [a, b, c, d] = path.numbers(sums);
    (a + b) + (c + d)
}

/// Returns the sizes of coefficients.
#[inline(always)]
pub fn sizes<P: Path>(path: P, a: &Values) -> Fours<P> {
    let mut sizes = fours(path, a);
    for i in 0..2 * SIDE_FOURS {
        sizes[i] = path.sizes(sizes[i]);
    }
    sizes
}
