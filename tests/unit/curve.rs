use approx::assert_relative_eq;

use super::*;

/// A smooth curve, its mean and its harmonics of orders 1 and 3.
fn smooth(x: f64) -> f64 {
    2.0 + 1.5 * libm::cos(TAU * x + 0.4) + 0.25 * libm::cos(3.0 * TAU * x - 1.1)
}

fn sampled(places: Vec<f64>) -> Curve {
    let values = places.iter().map(|x| smooth(*x)).collect();
    Curve::new(places, values)
}

#[test]
fn even_points_give_the_harmonics_of_a_smooth_curve() {
    // With any first place; eight points are more than twice the highest order.
    for first in [0.0, 0.01] {
        for n in [8, 9, 64] {
            let series =
                sampled((0..n).map(|i| first + f64::from(i) / f64::from(n)).collect()).series(None, CurveShape::Spline);
            assert_relative_eq!(series.mean, 2.0, max_relative = 1e-14);
            let [one, three] = series.harmonics[..] else { panic!("{series:?}") };
            assert_eq!((one.order, three.order), (1.0, 3.0));
            assert_relative_eq!(one.amplitude, 1.5, max_relative = 1e-14);
            assert_relative_eq!(one.phase, 0.4, max_relative = 1e-13);
            assert_relative_eq!(three.amplitude, 0.25, max_relative = 1e-13);
            assert_relative_eq!(three.phase, -1.1, max_relative = 1e-13);
            assert!(series.residual[0] < 1e-14);
        }
    }
}

/// The largest error of the two harmonics from `n` uneven points.
fn error(n: u32, through: CurveShape) -> f64 {
    let place = |i: u32| {
        let x = f64::from(i) / f64::from(n);
        x + 0.3 / TAU * libm::sin(TAU * x)
    };
    let series = sampled((0..n).map(place).collect()).series(Some(3), through);
    let of = |order: f64, amplitude: f64, phase: f64| {
        let h = series.harmonics.iter().find(|h| h.order == order).unwrap();
        let part = |trig: fn(f64) -> f64| h.amplitude * trig(h.phase) - amplitude * trig(phase);
        part(libm::cos).abs().max(part(libm::sin).abs())
    };
    of(1.0, 1.5, 0.4).max(of(3.0, 0.25, -1.1))
}

#[test]
fn uneven_points_converge_with_the_order_of_what_is_drawn_through_them() {
    for (through, order) in [(CurveShape::Lines, 2.0), (CurveShape::Spline, 4.0)] {
        let seen = libm::log2(error(64, through) / error(128, through));
        assert!((seen - order).abs() < 0.3, "{through:?}: {seen}");
    }
    // Two and three points have splines too.
    for places in [vec![0.0, 0.4], vec![0.1, 0.2, 0.9]] {
        assert!(sampled(places).series(None, CurveShape::Spline).mean.is_finite());
    }
}

#[test]
fn lines_meet_the_points() {
    let curve = Curve::new(vec![0.1, 0.5, 0.6, 0.9], vec![1.0, 3.0, 3.0, 3.0]);
    let pieces = curve.pieces(2.0);
    // Two lines of no change are one.
    assert_eq!(pieces.iter().map(|piece| piece.start).collect::<Vec<_>>(), [0.1, 0.5, 0.9]);
    assert_relative_eq!(pieces[0].slope, 2.0 / (0.4 * 2.0), max_relative = 1e-15);
    assert_relative_eq!(pieces[2].slope, -2.0 / (0.2 * 2.0), max_relative = 1e-14);
    assert_relative_eq!(curve.mean(), 0.4 * 2.0 + 0.4 * 3.0 + 0.2 * 2.0, max_relative = 1e-14);
}
