//! Ranges of four polynomials against their values.

use super::*;
use crate::vectors::{Instructions, Work};

const ROW: usize = 25;

struct Ranges<'a>(&'a [[f64; 4]; ROW], &'a [f64; ROW]);

impl Work for Ranges<'_> {
    type Output = [[f64; 4]; 3];

    fn on<P: Path>(self, path: P) -> Self::Output {
        let FourRanges { range: [least, most], sizes } = FourRanges::new(path, self.0, self.1);
        [least, most, sizes].map(|four| path.numbers(four))
    }
}

#[test]
fn ranges_of_four_polynomials_contain_all_their_values() {
    for trial in 0..400 {
        let reach = 0.2 + 0.004 * f64::from(trial);
        let powers: [f64; ROW] = std::array::from_fn(|k| reach.powi(k as i32));
        let rows: [[f64; 4]; ROW] = std::array::from_fn(|k| {
            std::array::from_fn(|l| {
                libm::sin(f64::from(trial) + 37.0 * (4 * k + l) as f64) * 0.7f64.powi((k * l) as i32)
            })
        });
        for [least, most, sizes] in
            [Baseline.run(Ranges(&rows, &powers)), Instructions::best().run(Ranges(&rows, &powers))]
        {
            for l in 0..4 {
                // 25 terms, each with a few roundings.
                let rounding = 100.0 * f64::EPSILON * sizes[l];
                for place in 0..=64 {
                    let theta = f64::from(place) / 64.0;
                    let terms = (1..ROW).map(|k| rows[k][l] * powers[k] * theta.powi(k as i32));
                    let value: f64 = terms.sum();
                    assert!(
                        value >= least[l] - rounding && value <= most[l] + rounding,
                        "{trial} {l} {theta}: {value}"
                    );
                }
            }
        }
    }
}

#[test]
fn ranges_are_narrower_than_the_sizes_of_the_terms() {
    // θ − θ², between 0 and 1/4. Its Bernstein coefficients of degree 6 are i/6 − i(i − 1)/30, at most 0.3.
    let (mut rows, powers) = ([[0.0; 4]; ROW], [1.0; ROW]);
    (rows[1], rows[2]) = ([1.0; 4], [-1.0; 4]);
    let [least, most, sizes] = Baseline.run(Ranges(&rows, &powers));
    assert!(least[0].abs() <= 1e-15 && (most[0] - 0.3).abs() <= 1e-15 && sizes[0] == 2.0);
}

#[test]
fn bounds_contain_all_values_of_a_polynomial() {
    for trial in 0..600 {
        let degree = trial % 26;
        let c = |k: usize| libm::sin((trial + 53 * k) as f64) * 0.6f64.powi((k * (trial % 4)) as i32);
        let p: Vec<f64> = (0..degree).map(c).collect();
        let [largest, smallest] = bounds(&p);
        for place in 0..=64 {
            let value = crate::poly::eval(&p, f64::from(place) / 64.0);
            assert!(smallest <= value && value <= largest, "{trial} {place}");
        }
    }
    // The low-degree part decides where its coefficients do.
    assert_eq!(bounds(&[1.0, -2.0, 1.0]).map(f64::round), [1.0, 0.0]);
}
