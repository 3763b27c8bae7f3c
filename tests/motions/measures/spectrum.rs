//! Spectra of signals that are known.

use std::f64::consts::TAU;

use flank::analysis::{Spectrum, Sum, Window};

fn wave(n: usize, per_turn: f64, amplitude: f64, phase: f64) -> Vec<f64> {
    (0..n).map(|i| 3.0 + amplitude * (TAU * i as f64 / per_turn + phase).cos()).collect()
}

#[test]
fn a_line_on_a_bin_reads_its_amplitude_with_every_window() {
    for window in [Window::Rectangular, Window::Hann, Window::BlackmanHarris, Window::FlatTop] {
        for n in [960, 961] {
            let samples: Vec<f64> =
                (0..n).map(|i| 3.0 + 0.7 * (TAU * 40.0 * i as f64 / n as f64 + 0.4).cos()).collect();
            let s = Spectrum::new(&samples, n as f64, window);
            assert!((s.at(40.0) - 0.7).abs() < 1e-13, "{window:?} {n}: {}", s.at(40.0));
            assert!((s.phase[40] - 0.4).abs() < 1e-12);
            assert!((s.amplitude[0] - 3.0).abs() < 1e-13);
            assert_eq!(s.amplitude.len(), n / 2 + 1);
        }
    }
}

#[test]
fn whole_periods_leak_nothing() {
    let s = Spectrum::new(&wave(1024, 64.0, 1.0, 0.0), 64.0, Window::Rectangular);
    assert_eq!(s.lines(1e-9).len(), 1);
}

#[test]
fn a_flat_top_reads_lines_between_bins() {
    for shift in [0.1, 0.25, 0.5] {
        let s = Spectrum::new(&wave(2000, 2000.0 / (100.0 + shift), 1.0, 0.3), 2000.0, Window::FlatTop);
        let read = s.lines(0.5)[0].1;
        // Largest error of HFT70: 0.0065 dB.
        assert!((read - 1.0).abs() < 7.5e-4, "{shift}: {read}");
    }
}

#[test]
fn few_samples_are_no_trouble() {
    assert!(Spectrum::new(&[], 1.0, Window::Hann).amplitude.is_empty());
    assert_eq!(Spectrum::new(&[2.0], 1.0, Window::Hann).amplitude, [2.0]);
}

#[test]
fn small_terms_are_not_lost() {
    let mut sum = Sum::default();
    for term in [1e16, 1.0, 1.0, -1e16] {
        sum.add(term);
    }
    assert_eq!(sum.value(), 2.0);
}
