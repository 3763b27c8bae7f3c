//! Sounds: impacts stand at their exact times, and as loud as their momentum.

use std::f64::consts::TAU;

use flank::{
    Simulation, Task,
    scene::Scene,
    study::sound::{Blow, PathMode, RATE, TransferPath, impacts, render, spectrum},
};

/// One mode: between two samples its pointer turns by a known factor, but for an impact, whose time and momentum follow from what is left.
/// The pointer's other part is read from the next sample.
fn recovered(samples: &[f64], mode: PathMode) -> Vec<Blow> {
    let step = f64::from(RATE).recip();
    let omega = TAU * mode.frequency_hz;
    let (decay, turn) = (mode.damping_ratio * omega, omega * (1.0 - mode.damping_ratio.powi(2)).sqrt());
    let size = (-decay * step).exp();
    let (sin, cos) = (turn * step).sin_cos();
    // y_{n+1} = size (x sin + y cos).
    let pointer = |n: usize| [(samples[n + 1] / size - samples[n] * cos) / sin, samples[n]];
    let mut blows: Vec<Blow> = Vec::new();
    for n in 0..samples.len() - 2 {
        let ([x, y], [x1, y1]) = (pointer(n), pointer(n + 1));
        let [by_x, by_y] = [x1 - size * (x * cos - y * sin), y1 - size * (x * sin + y * cos)];
        let loud = by_x.hypot(by_y);
        // An impact disturbs the reading at its own sample too: the one before shows half of it.
        if loud > 1e-3 && blows.last().is_none_or(|last| (n + 1) as f64 * step - last.time > 2.0 * step) {
            let next = pointer(n + 2);
            let [before_x, before_y] = pointer(n - 1);
            // Two samples on, undisturbed, less what was there two samples before the impact.
            let (sin3, cos3) = (3.0 * turn * step).sin_cos();
            let damped = (-3.0 * decay * step).exp();
            let rest = [
                next[0] - damped * (before_x * cos3 - before_y * sin3),
                next[1] - damped * (before_x * sin3 + before_y * cos3),
            ];
            let ago = rest[1].atan2(rest[0]) / turn;
            blows.push(Blow {
                time: (n + 2) as f64 * step - ago,
                momentum: rest[0].hypot(rest[1]) * (decay * ago).exp(),
            });
        }
    }
    blows
}

#[test]
fn impacts_are_recovered_to_a_fraction_of_a_sample() {
    let mode = PathMode { frequency_hz: 1500.0, damping_ratio: 0.05, amplitude: 1.0 };
    // Some 6 ms apart, at no simple part of a sample.
    let blows: Vec<Blow> = (1..40)
        .map(|i| Blow {
            time: 6.1e-3 * f64::from(i) + 1e-4 * (f64::from(i) * 1.7).sin(),
            momentum: 0.5 + 0.01 * f64::from(i),
        })
        .collect();
    let path = TransferPath { modes: vec![mode] };
    let samples = render(&blows, &path, 0.3);
    // As a file has them.
    let samples: Vec<f64> = samples.into_iter().map(|sample| f64::from(sample as f32)).collect();
    let found = recovered(&samples, mode);
    assert_eq!(found.len(), blows.len());
    for (found, blow) in found.iter().zip(&blows) {
        assert!((found.time - blow.time).abs() * f64::from(RATE) < 1e-3, "{found:?} {blow:?}");
        assert!((found.momentum - blow.momentum).abs() < 1e-4, "{found:?} {blow:?}");
    }
}

/// A sound is the sum of the responses to its impacts.
#[test]
fn a_sound_is_the_sum_of_responses() {
    let path = TransferPath::placeholder();
    let blows = [Blow { time: 1.234e-3, momentum: 2.0 }, Blow { time: 7.0e-3, momentum: 0.3 }];
    for (n, sample) in render(&blows, &path, 0.02).into_iter().enumerate() {
        let t = n as f64 / f64::from(RATE);
        let mut sum = 0.0;
        for blow in blows.iter().filter(|blow| blow.time <= t) {
            for mode in &path.modes {
                let (omega, since) = (TAU * mode.frequency_hz, t - blow.time);
                let turn = omega * (1.0 - mode.damping_ratio.powi(2)).sqrt();
                sum +=
                    blow.momentum * mode.amplitude * (-mode.damping_ratio * omega * since).exp() * (turn * since).sin();
            }
        }
        // Rounding of a thousand turns of a pointer.
        assert!((sample - sum).abs() < 1e-11, "{n}: {sample} {sum}");
    }
}

/// The impacts of a run that is periodic with one impact of each of three ring meshes: effective mass times approach speed.
#[test]
fn momentum_is_effective_mass_times_speed() {
    let simulation = Simulation::from_file("examples/scenes/reference-light.json").unwrap();
    let seconds = 10.5 * simulation.period().unwrap();
    let blows = impacts(&simulation, seconds, Task::default()).unwrap();
    assert_eq!(blows.len(), 3 * blows.len().div_ceil(3));
    assert!((30..=33).contains(&blows.len()), "{}", blows.len());
    let record = simulation.run().unwrap();
    let speed = record.contacts[3].impacts.speed_max.unwrap();
    let mass = simulation.structure.contacts()[3].effective_mass();
    for blow in &blows {
        assert!((blow.momentum - mass * speed).abs() < 1e-9 * blow.momentum, "{blow:?}");
        assert!((0.0..seconds).contains(&blow.time));
    }
    let dimensionless = Scene::from_file("examples/scenes/kahraman-singh.json").unwrap();
    let error = impacts(&Simulation::from_scene(dimensionless).unwrap(), 1.0, Task::default()).unwrap_err();
    assert!(error.to_string().contains("dimensionless"), "{error}");
}

#[test]
fn a_path_out_of_range_is_refused_with_every_fault() {
    let bad = PathMode { frequency_hz: 30_000.0, damping_ratio: 0.0, amplitude: f64::NAN };
    assert_eq!(TransferPath { modes: vec![bad] }.check().unwrap_err().len(), 3);
    assert_eq!(TransferPath { modes: vec![] }.check().unwrap_err().len(), 1);
    TransferPath::placeholder().check().unwrap();
}

/// A sine of amplitude a has the level 20 lg a at its frequency, and nothing near it elsewhere.
#[test]
fn a_spectrum_has_the_level_of_a_sine() {
    // A whole number of bins of 48000/8192 Hz.
    let frequency = 200.0 * f64::from(RATE) / 8192.0;
    let samples: Vec<f64> =
        (0..RATE).map(|n| 0.25 * (TAU * frequency * f64::from(n) / f64::from(RATE)).sin()).collect();
    let figure = spectrum(&samples, &TransferPath::placeholder());
    let line = &figure.panels[0].series[0];
    let loudest = line.y.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    assert!((line.x[loudest] - frequency).abs() < 1e-9 && (line.y[loudest] - 20.0 * 0.25f64.log10()).abs() < 1e-3);
    let far = line.x.iter().zip(&line.y).filter(|(f, _)| (*f / frequency - 1.0).abs() > 0.05).map(|(_, y)| *y);
    assert!(far.fold(f64::NEG_INFINITY, f64::max) < -100.0);
}
