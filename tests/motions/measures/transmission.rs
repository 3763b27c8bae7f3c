use std::{f64::consts::PI, ops::ControlFlow};

use flank::{
    analysis::{Grid, Sample, Trajectory, TransmissionError},
    hybrid::ContactView,
    system::Structure,
};

use super::trains::{self, Case, rigid, run, single};

/// A ball that keeps bouncing: arcs of a parabola, whose Fourier series is known.
#[test]
fn harmonics_of_a_bouncing_ball_are_those_of_its_parabolas() {
    let (g, period) = (9.81, 0.4);
    let (square, cycles) = (g * period * period, 7.0);
    let mut spec = single(0.0, -g, None, vec![rigid(1.0, -1.0, 0.0)]);
    spec.omega = Some(2.0 * PI / period);
    let case = Case { spec, q: vec![square / 8.0], v: vec![0.0], end: cycles * period };
    let structure = Structure::new(case.spec.clone()).unwrap();
    // From the middle of a flight on; gᵀq is minus the height.
    let from = structure.clock().at(2, 0.0);
    let mut transmission = TransmissionError::new(&structure, [0], 8, Some(from));
    run(&structure, &case, &mut transmission);
    let [report] = &transmission.reports()[..] else { panic!("one contact") };
    assert_eq!(report.name, "wall");
    // A few roundings of the largest value for each of some 20 pieces.
    let tolerance = 1e-14 * square;
    assert!((report.mean + square / 12.0).abs() < tolerance, "{}", report.mean);
    assert!((report.rms - 0.5 * square / 180f64.sqrt()).abs() < tolerance, "{}", report.rms);
    for harmonic in report.harmonics.as_ref().unwrap() {
        let m = f64::from(harmonic.order);
        let exact = square / (2.0 * (PI * m).powi(2));
        assert!((harmonic.amplitude - exact).abs() < tolerance, "{m}: {} - {exact}", harmonic.amplitude);
        let phase = if harmonic.order % 2 == 1 { PI } else { 0.0 };
        let off = (harmonic.phase - phase).rem_euclid(2.0 * PI);
        assert!(off.min(2.0 * PI - off) < 4.0 * tolerance / exact, "{m}: {}", harmonic.phase);
    }

    // Harmonics need whole cycles.
    let mut transmission = TransmissionError::new(&structure, [0], 8, Some(structure.clock().at(2, 0.1 * period)));
    run(&structure, &case, &mut transmission);
    assert_eq!(transmission.reports()[0].harmonics, None);
}

/// Sums over 4096 samples a cycle, 1.7e-3 apart, of motions whose acceleration has some steps of 0.1 at most in five cycles: at each
/// Simpson's rule is wrong by that times the cube of the distance, of 35 in all.
#[test]
fn harmonics_equal_sums_over_samples() {
    const PER_CYCLE: u32 = 4096;
    for (case, omega) in [(trains::hertz_pair(), 0.9), (trains::rectangular(), 0.75), (trains::single_sided(), 0.9)] {
        let (first, last) = (3, 8);
        let structure = Structure::new(case.spec.clone()).unwrap();
        let cycle = 2.0 * PI / omega;
        let [from, to] = [first, last].map(|n| structure.clock().at(n, 0.0));
        let case = Case { end: structure.clock().time(to).value(), ..case };
        assert!((case.end - last as f64 * cycle).abs() < 1e-12);
        let mut values = Vec::new();
        let mut samples =
            Trajectory::new(&structure, Grid::Phases { per_cycle: PER_CYCLE }, from, |sample: &Sample<'_>| {
                values.push(structure.transmission(0, sample.x));
                ControlFlow::Continue(())
            });
        let mut transmission = TransmissionError::new(&structure, [0], 8, Some(from));
        let (state, _) = run(&structure, &case, &mut (&mut transmission, &mut samples));
        drop(samples);
        let count = (last - first) as usize * PER_CYCLE as usize;
        // The end may be rounded to before the last sample or after it.
        values.truncate(count);
        values.push(structure.transmission(0, &state.x));
        let report = &transmission.reports()[0];
        let sum = |f: &dyn Fn(usize, f64) -> f64| {
            // Simpson's rule.
            let weight = |i: usize| if i == 0 || i == count { 1.0 } else { (2 + 2 * (i % 2)) as f64 };
            values.iter().enumerate().map(|(i, x)| weight(i) * f(i, *x)).sum::<f64>() / (3.0 * count as f64)
        };
        let mean = sum(&|_, x| x);
        assert!((report.mean - mean).abs() < 1e-9, "{omega}: {} for {mean}", report.mean);
        let rms = sum(&|_, x| (x - mean) * (x - mean)).sqrt();
        assert!((report.rms - rms).abs() < 1e-9, "{omega}: {} for {rms}", report.rms);
        for harmonic in report.harmonics.as_ref().unwrap() {
            let angle = |i: usize| 2.0 * PI * f64::from(harmonic.order) * i as f64 / f64::from(PER_CYCLE);
            let [c, s] = [sum(&|i, x| 2.0 * x * angle(i).cos()), sum(&|i, x| 2.0 * x * angle(i).sin())];
            let (sin, cos) = harmonic.phase.sin_cos();
            let off = (harmonic.amplitude * cos - c).hypot(-harmonic.amplitude * sin - s);
            assert!(off < 1e-9, "{harmonic:?} for {c} {s}");
        }
    }
}
