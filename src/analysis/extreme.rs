//! Maxima of smooth functions on a step.

/// The largest value of a function on the nodes' interval, or `best` if that is larger.
///
/// `values` are the function at `theta` (rising), dense enough to resolve it: every interior maximum then shows in three
/// neighbouring values. A maximum that could beat `best` is refined on the function itself; the error of its value is the
/// square of that of its place, below rounding.
pub(super) fn peak(theta: &[f64], values: &[f64], mut best: f64, mut eval: impl FnMut(f64) -> f64) -> f64 {
    best = values.iter().fold(best, |b, v| b.max(*v));
    for i in 1..theta.len() - 1 {
        let (a, b, c) = (theta[i - 1], theta[i], theta[i + 1]);
        let (fa, fb, fc) = (values[i - 1], values[i], values[i + 1]);
        let (left, right) = ((fb - fa) / (b - a), (fc - fb) / (c - b));
        let curvature = (right - left) / (c - a);
        if curvature >= 0.0 || !curvature.is_finite() {
            continue;
        }
        // Newton's form of the parabola through the three values, and its vertex.
        let vertex = 0.5 * (a + b) - 0.5 * left / curvature;
        let (low, high) = match i {
            _ if left >= 0.0 && right <= 0.0 => (a, c),
            1 if vertex > a && vertex < b => (a, b),
            _ if i == theta.len() - 2 && vertex > b && vertex < c => (b, c),
            _ => continue,
        };
        let estimate = fa + (vertex - a) * (left + curvature * (vertex - b));
        // Three times what the parabola adds: it is not the function.
        if estimate + 2.0 * (estimate - fb.max(fa.max(fc))) > best {
            best = best.max(refine(low, high, &mut eval));
        }
    }
    best
}

/// Brent's search (1973): parabolas through the three best points, golden sections where they do not help.
fn refine(mut low: f64, mut high: f64, eval: &mut impl FnMut(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.381_966_011_250_105_1;
    // The value is flat to rounding within √ε of the place.
    let tolerance = 1e-8 * (high - low);
    let mut x = low + GOLDEN * (high - low);
    let mut fx = eval(x);
    let (mut w, mut fw, mut v, mut fv) = (x, fx, x, fx);
    let (mut step, mut last) = (0.0f64, 0.0f64);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (x - middle).abs() <= 2.0 * tolerance - 0.5 * (high - low) {
            break;
        }
        let (r, q) = ((x - w) * (fx - fv), (x - v) * (fx - fw));
        let (p, d) = ((x - v) * q - (x - w) * r, 2.0 * (q - r));
        let parabola = -p / d;
        let before = last;
        last = step;
        let usable = d != 0.0
            && parabola.abs() < 0.5 * before.abs()
            && x + parabola > low + tolerance
            && x + parabola < high - tolerance;
        if usable {
            step = parabola;
        } else {
            last = if x < middle { high - x } else { low - x };
            step = GOLDEN * last;
        }
        let u = if step.abs() >= tolerance { x + step } else { x + tolerance.copysign(step) };
        let fu = eval(u);
        if fu >= fx {
            if u >= x {
                low = x
            } else {
                high = x
            }
            (v, fv, w, fw, x, fx) = (w, fw, x, fx, u, fu);
        } else {
            if u < x {
                low = u
            } else {
                high = u
            }
            if fu >= fw || w == x {
                (v, fv, w, fw) = (w, fw, u, fu);
            } else if fu >= fv || v == x || v == w {
                (v, fv) = (u, fu);
            }
        }
    }
    fx
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::quadrature::Rule;

    #[test]
    fn maxima_are_found_wherever_they_lie() {
        let nodes = Rule::clenshaw_curtis(20).nodes;
        let mut asked = 0;
        for k in 0..2000 {
            let at = (f64::from(k) + 0.5) / 2000.0;
            let f = |t: f64| 2.0 - 3.0 * (t - at).powi(2) + 0.4 * (t - at).powi(3);
            let values: Vec<f64> = nodes.iter().map(|t| f(*t)).collect();
            let best = peak(&nodes, &values, f64::NEG_INFINITY, |t| {
                asked += 1;
                f(t)
            });
            assert!((best - 2.0).abs() < 1e-15, "{at}: {best}");
        }
        assert!(asked < 2000 * 20, "{asked}");
    }
}
