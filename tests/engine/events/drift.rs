//! Motion without loss for 10⁴ periods, against periods in closed form.

use std::ops::ControlFlow;

use flank::{
    engine::{Observer, Options},
    event::EventRecord,
    gear::{
        Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{Clock, Instant, Wide},
    system::{ContactSpec, Flanks, Spec, Structure},
};
use nalgebra::DMatrix;

use super::support::{ball, engine, rigid, state};

/// Periods run.
const PERIODS: u32 = 10_000;
/// Starts of each kind.
const STARTS: u32 = 32;

/// The instants of the first event and of the one `left` events later.
struct Ends {
    left: u32,
    first: Option<Instant>,
    last: Option<Instant>,
}

impl Observer for Ends {
    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        assert!(!record.graze);
        if record.start {
            return ControlFlow::Continue(());
        }
        if self.first.is_none() {
            self.first = Some(record.at);
        } else {
            self.left -= 1;
        }
        if self.left > 0 {
            return ControlFlow::Continue(());
        }
        self.last = Some(record.at);
        ControlFlow::Break(())
    }
}

/// One start: the train, its state, the events in a period and the period, s.
struct Motion {
    train: Structure,
    q: Vec<f64>,
    v: Vec<f64>,
    events: u32,
    period: Wide,
}

impl Motion {
    /// How late the motion is after [`PERIODS`], in periods.
    fn late(&self) -> f64 {
        let mut ends = Ends { left: self.events * PERIODS, first: None, last: None };
        let clock: Clock = *self.train.clock();
        let start = state(&self.train, &self.q, &self.v);
        let end = clock.instant(f64::from(PERIODS + 2) * self.period.value());
        engine(&self.train, start, Options::default()).run(end, &mut ends).unwrap();
        let took = clock.time(ends.last.unwrap()) - clock.time(ends.first.unwrap());
        (took - self.period * f64::from(PERIODS)).value() / self.period.value()
    }
}

/// Masses in a row with one contact of half the gap `gap` along `direction`, under `load` on the first.
fn train(
    masses: &[f64],
    support: f64,
    load: f64,
    contact: (&[f64], f64, Flanks),
    law: Law,
    stiffness: f64,
) -> Structure {
    let n = masses.len();
    let (direction, gap, flanks) = contact;
    let mut loads = vec![0.0; n];
    loads[0] = load;
    Structure::new(Spec {
        freedoms: (0..n).map(|i| format!("x_{i}")).collect(),
        mass: DMatrix::from_diagonal(&masses.to_vec().into()),
        damping: DMatrix::zeros(n, n),
        stiffness: DMatrix::identity(n, n) * support,
        load: loads,
        load_harmonics: Vec::new(),
        contacts: vec![ContactSpec {
            name: "contact".to_owned(),
            direction: direction.to_vec(),
            error: Vec::new(),
            error_offset: 0.0,
            half_backlash: gap,
            flanks,
            stiffness: Stiffness::Constant(stiffness),
            law,
            gap_damping: 0.0,
            back: None,
        }],
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    })
    .unwrap()
}

fn elastic(release: Release) -> Law {
    Law::KelvinVoigt(Linear { damping: 0.0 }, release)
}

/// Numbers between 0 and 1 that differ from start to start.
fn draw(start: u32, number: u32) -> f64 {
    (f64::from(start * 7 + number + 1) * 0.618_033_988_749_894_9).fract()
}

/// Free flight of mass m between flanks at ±b of stiffness k under the load f, entered from the middle at speed v:
/// `ṗ² = v² ± 2 f b/m` on the flanks, where the mass stays `(π ± 2 atan(f/(m ω p)))/ω`, and flies `4b/(p₊ + p₋)` between them.
fn pair_period(m: f64, k: f64, b: f64, f: f64, v: f64) -> Wide {
    let omega = (k / m).sqrt();
    let [more, less] = [1.0, -1.0].map(|side| (v * v + side * 2.0 * f * b / m).sqrt());
    let turned = (f / (m * omega * more)).atan() - (f / (m * omega * less)).atan();
    Wide::quotient(Wide::TAU + (2.0 * turned).into(), omega) + (8.0 * b / (more + less)).into()
}

fn pair(start: u32, load: f64, release: Release) -> Motion {
    let (m, k, b) = (0.6 + draw(start, 0), 0.7 + draw(start, 1), 0.5 + draw(start, 2));
    let f = load * (0.5 + 0.5 * draw(start, 4));
    let v = (4.0 * f * b / m).sqrt() + 0.8 + draw(start, 3);
    let train = train(&[m], 0.0, f, (&[1.0], b, Flanks::Both), elastic(release), k);
    Motion { train, q: vec![0.0], v: vec![v], events: 4, period: pair_period(m, k, b, f, v) }
}

/// `√a` in two doubles.
fn root(a: Wide) -> Wide {
    let root = a.value().sqrt();
    Wide::sum(root, (a - Wide::product(root, root)).value() / (2.0 * root))
}

/// A loaded mass between rigid flanks: the flights of [`pair_period`] alone, in two doubles. `f/m` has no rounding.
fn between_rigid_flanks(start: u32) -> Motion {
    let (m, b, f) = ([0.25, 1.0, 4.0][start as usize % 3], 0.5 + draw(start, 1), 0.1 + 0.2 * draw(start, 2));
    let v = (4.0 * f * b / m).sqrt() + 0.8 + draw(start, 3);
    let [more, less] = [2.0, -2.0].map(|by| root(Wide::product(v, v) + Wide::product(by * f / m, b)));
    let (speeds, path) = (more + less, 8.0 * b);
    let rounded = path / speeds.value();
    let period = Wide::sum(rounded, (Wide::from(path) - speeds * rounded).value() / speeds.value());
    let train = train(&[m], 0.0, f, (&[1.0], b, Flanks::Both), rigid(1.0), 1.0);
    Motion { train, q: vec![0.0], v: vec![v], events: 2, period }
}

/// Two masses that turn on together while they rattle against each other.
fn two_masses(start: u32) -> Motion {
    let (m, n, k, b) = (0.6 + draw(start, 0), 1.1 + draw(start, 1), 0.7 + draw(start, 2), 0.5 + draw(start, 3));
    let (v, w) = (1.3 + draw(start, 4), 0.25 * draw(start, 5));
    let train = train(&[m, n], 0.0, 0.0, (&[1.0, -1.0], b, Flanks::Both), elastic(Release::Force), k);
    let period = pair_period(m * n / (m + n), k, b, 0.0, v - w);
    Motion { train, q: vec![0.0; 2], v: vec![v, w], events: 4, period }
}

/// A mass on a spring that a wall throws back: `q = A cos ωt`, cut off at the wall.
fn on_spring(start: u32, law: Law) -> Motion {
    let (m, k, b, k_wall) = (0.6 + draw(start, 0), 0.7 + draw(start, 1), 0.4 * draw(start, 2), 3.0 + draw(start, 3));
    let v = 1.0 + draw(start, 4);
    let omega = (k / m).sqrt();
    let half = Wide::TAU * 0.5;
    let free = Wide::quotient(half + (2.0 * (b * omega / (v * v - k / m * b * b).sqrt()).atan()).into(), omega);
    let train = train(&[m], k, 0.0, (&[1.0], b, Flanks::Drive), law, k_wall);
    if matches!(law, Law::Rigid(_)) {
        return Motion { train, q: vec![0.0], v: vec![v], events: 1, period: free };
    }
    // On the wall both springs push: `q̈ = −(k/m) b − ((k + k_w)/m)(q − b)`.
    let (speed, both) = ((v * v - k / m * b * b).sqrt(), ((k + k_wall) / m).sqrt());
    let pressed = Wide::quotient(half - (2.0 * (k / m * b / (both * speed)).atan()).into(), both);
    Motion { train, q: vec![0.0], v: vec![v], events: 2, period: free + pressed }
}

fn bouncing(start: u32) -> Motion {
    let v = 0.5 + draw(start, 0);
    let q = 0.3 + draw(start, 1);
    let period = (2.0 * (v * v + 2.0 * q).sqrt()).into();
    Motion { train: ball(1.0), q: vec![q], v: vec![v], events: 1, period }
}

/// Largest, mean and standard error of the mean, in periods.
fn figures(of: impl Fn(u32) -> Motion) -> [f64; 3] {
    let late: Vec<f64> = (0..STARTS).map(|start| of(start).late()).collect();
    let n = f64::from(STARTS);
    let mean = late.iter().sum::<f64>() / n;
    let square = late.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [late.iter().fold(0.0, |m: f64, l| m.max(l.abs())), mean, (square / n).sqrt()]
}

/// The closed forms are rounded too: by some 3ε of a period, 10⁴ times over.
fn stays(of: impl Fn(u32) -> Motion) {
    let [largest, mean, error] = figures(of);
    assert!(largest <= 1e-11, "{largest:e}");
    assert!(mean.abs() <= 2.0 * error, "mean {mean:e}, standard error {error:e}");
}

#[test]
fn an_unloaded_pair_stays_on_time() {
    stays(|start| pair(start, 0.0, Release::Deflection));
}

#[test]
fn a_loaded_pair_stays_on_time() {
    stays(|start| pair(start, 0.3, Release::Force));
}

#[test]
fn a_loaded_pair_of_rigid_flanks_stays_on_time() {
    stays(between_rigid_flanks);
}

#[test]
fn two_masses_stay_on_time() {
    stays(two_masses);
}

#[test]
fn a_mass_on_a_spring_before_a_rigid_wall_stays_on_time() {
    stays(|start| on_spring(start, rigid(1.0)));
}

#[test]
fn a_mass_on_a_spring_before_a_soft_wall_stays_on_time() {
    stays(|start| on_spring(start, elastic(Release::Deflection)));
}

#[test]
fn a_bouncing_ball_stays_on_time() {
    stays(bouncing);
}
