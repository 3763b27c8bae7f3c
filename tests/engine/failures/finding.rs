//! Finding events: A1 to A16.

use std::f64::consts::{PI, TAU};

use flank::{
    engine::{EngineError, Options, State},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{
        Clock,
        ContactMode::{Back, Drive, Separated},
        GuardId, GuardSet, HybridSystem, Instant, Jet, JetField, JetRequest, Jump, Mode, ModelError, VectorField,
    },
    integrate::IntegrateError,
    system::{Structure, contact_mode},
    train::{WalledOscillator, Walls},
};
use proptest::prelude::*;

use crate::events::support::{
    Course, Log, Moving, Run, attempt, ball, engine, ghost, masses, modes, product, run, run_from, state, walled,
};

fn elastic() -> Law {
    Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection)
}

/// A1. Free flight across the gap 2 that goes ε too far and comes back, on a flank with a spring.
///
/// The load is 1, the start at the drive flank with speed u = √(2(2 + ε)). The back flank is reached with v = √(2ε) and
/// the spring of stiffness 1 holds it for `2 arctan v`: from `p″ = −1 − p`, `p(0) = 0`, `p′(0) = v`.
#[test]
fn a1_a_flight_that_just_reaches_the_back_flank_and_returns_is_two_events() {
    let s = walled(&WalledOscillator {
        load: 1.0,
        ..WalledOscillator::new(1.0, Walls::Between { half_gap: 1.0 }, elastic(), Stiffness::Constant(1.0))
    });
    for exponent in 1..=12 {
        let depth = 10f64.powi(-exponent);
        let u = (2.0 * (2.0 + depth)).sqrt();
        let run = run(&s, &[1.0], &[-u], 3.0);
        assert_eq!(modes(&run.events(), 0), [Back, Separated], "{depth:e}");
        let (v, held) = ((2.0 * depth).sqrt(), run.times()[1] - run.times()[0]);
        // u and the depth reached are rounded, by some ε₀ of 2: v by that over v.
        assert!((held - 2.0 * v.atan()).abs() <= 32.0 * f64::EPSILON / v, "{depth:e}: {held:e}");
    }
}

/// A2. `x = sin t` below a flank at 1: ten touches at π/2 + 2πk in ten turns, no change of mode.
#[test]
fn a2_ten_exact_grazes_of_a_sine_are_ten_touches_and_no_contact() {
    let s = walled(&WalledOscillator {
        stiffness: 1.0,
        ..WalledOscillator::new(1.0, Walls::Above { position: 1.0 }, ghost(), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[0.0], &[1.0], 20.0 * PI);
    assert_eq!((run.events().len(), run.counters.grazes, run.records.len()), (0, 10, 10));
    for k in 0..10 {
        // Known to √(2u/|g″|), u = 64 ε₀ of terms that sum to 2.
        let exact = 0.5 * PI + TAU * k as f64;
        assert!((run.time(k) - exact).abs() <= (256.0 * f64::EPSILON).sqrt(), "{k}: {:e}", run.time(k) - exact);
    }
}

/// A5. A ball on a floor, gravity 1, e = ½: flight k lasts 2·2⁻ᵏ. Forty of them, each by its own length.
#[test]
fn a5_forty_ever_shorter_flights_keep_their_relative_accuracy() {
    let s = ball(0.5);
    let options = Options { chatter_fraction: 1e-15, max_events: 41, ..Options::default() };
    let mut log = Log::default();
    engine(&s, state(&s, &[0.0], &[1.0]), options).run(s.clock().instant(5.0), &mut log).unwrap();
    let impacts: Vec<_> = log.records.iter().filter(|r| !r.start).collect();
    assert_eq!(impacts.len(), 41);
    for (k, pair) in impacts.windows(2).enumerate() {
        let exact = 2.0 * 0.5f64.powi(k as i32 + 1);
        let flight = s.clock().between(pair[0].at, pair[1].at);
        assert!((flight / exact - 1.0).abs() <= 1e-13, "{k}: {:e}", flight / exact - 1.0);
    }
}

/// A6. A start at rest on a flank under a load that presses is contact on that flank, whichever it is; under none, none.
#[test]
fn a6_a_start_on_either_flank_is_decided_by_the_first_derivative_that_is_not_zero() {
    for (load, at, expected) in [
        (0.5, 1.0, Drive),
        (0.5, -1.0, Separated),
        (-0.5, -1.0, Back),
        (-0.5, 1.0, Separated),
        (0.0, 1.0, Separated),
        (0.0, -1.0, Separated),
        (1e-300, 1.0, Drive),
        (-1e-300, -1.0, Back),
    ] {
        let s = walled(&WalledOscillator {
            load,
            ..WalledOscillator::new(1.0, Walls::Between { half_gap: 1.0 }, elastic(), Stiffness::Constant(1.0))
        });
        let run = run(&s, &[at], &[0.0], 0.1);
        assert_eq!((contact_mode(&run.records[0].to, 0), run.records.len()), (expected, 1), "{load} {at}");
    }
}

/// A6. At rest on the flank with a load that is zero but grows: `x″ = sin t`, so the third derivative decides.
#[test]
fn a6_a_load_that_only_begins_to_press_is_contact_from_the_start() {
    for (amplitude, expected) in [(1.0, Drive), (-1.0, Separated)] {
        let s = walled(&WalledOscillator {
            load_harmonics: vec![Harmonic::sine(1.0, amplitude, 0.0)],
            ..WalledOscillator::new(1.0, Walls::Above { position: 1.0 }, elastic(), Stiffness::Constant(1.0))
        });
        let run = run(&s, &[1.0], &[0.0], 0.5);
        assert_eq!((contact_mode(&run.records[0].to, 0), run.records.len()), (expected, 1), "{amplitude}");
    }
}

fn pieces(s: &Structure, from: State, ends: &[f64]) -> Vec<f64> {
    let (mut times, mut at) = (Vec::new(), from);
    for end in ends {
        let part = run_from(s, at, s.clock().instant(*end));
        times.extend(part.times());
        at = part.state;
    }
    times
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// A7. The ball of A5 has impacts at 2, 3, 3.5, 3.75, … Runs that are cut at, or a few units in the last place
    /// beside, any of them have each of them once.
    #[test]
    fn a7_runs_cut_at_their_own_impacts_have_each_of_them_once(
        cuts in prop::collection::vec((0u32..8, -4i64..=4), 1..6),
    ) {
        let s = ball(0.5);
        let exact: Vec<f64> = (0..8).map(|k| 4.0 - 2.0 * 0.5f64.powi(k)).collect();
        let mut ends: Vec<f64> =
            cuts.iter().map(|(k, ulps)| f64::from_bits((exact[*k as usize].to_bits() as i64 + ulps) as u64)).collect();
        ends.push(3.99);
        ends.sort_by(f64::total_cmp);
        let found = pieces(&s, state(&s, &[0.0], &[1.0]), &ends);
        prop_assert_eq!(found.len(), 8, "{:?}", found);
        for (a, b) in found.iter().zip(&exact) {
            // A cut that comes up to four units (of 2ε₀) early takes the impact along, if that is within its uncertainty;
            // the speed lost by it shortens all later flights, in all by twice as much. Five cuts do so in turn.
            prop_assert!((a - b).abs() <= 5.0 * 24.0 * f64::EPSILON, "{} {}", a, b);
        }
    }
}

/// A8. `(1 − t)ⁿ` goes through zero once where n is odd, and only touches it where n is even. Around t = 1 the value
/// cannot be told from zero; what is logged besides the one crossing is a touch in there.
#[test]
fn a8_odd_orders_cross_once_and_even_orders_touch() {
    for n in 1..=9 {
        let odd = n % 2 == 1;
        let run = Course::with_roots(if odd { -1.0 } else { 1.0 }, &vec![1.0; n]).run(2.5);
        assert_eq!(run.events().len(), usize::from(odd), "order {n}");
        assert!(odd || run.counters.grazes > 0, "order {n}");
        // The bound on the value is 4 ε₀ Σ|c| 2.5ᵏ = 4 ε₀ 3.5ⁿ; within twice that it is zero.
        let known = (8.0 * f64::EPSILON * 3.5f64.powi(n as i32)).powf(1.0 / n as f64);
        for i in 0..run.records.len() {
            assert!((run.time(i) - 1.0).abs() <= known, "order {n}: {}", run.time(i));
        }
    }
}

/// A user's own system: a [`Course`] whose guard is `scale` times its state, and perhaps no number at all.
struct Scaled {
    course: Course,
    scale: f64,
}

impl JetField for Moving<'_, Scaled> {
    fn jet(&self, request: &JetRequest<'_>, out: &mut Jet) {
        Moving(&self.0.course, self.1.clone()).jet(request, out);
        out.guard_series.iter_mut().for_each(|c| *c *= self.0.scale);
        out.rounding.iter_mut().for_each(|r| *r *= self.0.scale);
    }
}

impl VectorField for Scaled {
    fn eval(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], dx: &mut [f64]) {
        self.course.eval(mode, base, t, x, dx);
    }
    fn jac_mul(&self, mode: &Mode, base: Instant, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) {
        self.course.jac_mul(mode, base, t, x, v, jv);
    }
}

impl HybridSystem for Scaled {
    fn dim(&self) -> usize {
        1
    }
    fn clock(&self) -> &Clock {
        &self.course.clock
    }
    fn motion<'a>(&'a self, mode: &Mode) -> Option<Box<dyn JetField + 'a>> {
        Some(Box::new(Moving(self, mode.clone())))
    }
    fn field(&self) -> &dyn VectorField {
        self
    }
    fn guards(&self, mode: &Mode, out: &mut Vec<GuardId>) {
        HybridSystem::guards(&self.course, mode, out);
    }
    fn guard(&self, mode: &Mode, id: GuardId, at: Instant, x: &[f64]) -> f64 {
        self.scale * self.course.guard(mode, id, at, x)
    }
    fn jump(
        &self,
        from: &Jump,
        fired: &GuardSet,
        at: Instant,
        x: &mut [f64],
        _: &mut [f64],
    ) -> Result<Jump, ModelError> {
        self.course.jump(from, fired, at, x, &mut [])
    }
    fn settle(&self, from: &Jump, fired: &GuardSet, at: Instant, x: &mut [f64]) -> Result<Jump, ModelError> {
        self.course.settle(from, fired, at, x)
    }
}

fn scaled(scale: f64) -> Run {
    // Down at 0.3, up at 0.7, down at 0.71, and a touch at 0.9.
    let s = Scaled { course: Course::new(&product(-1.0, &[0.3, 0.7, 0.71])), scale };
    run_from(&s, s.course.start(), s.course.clock.instant(1.0))
}

/// A9. The sign of a guard decides, not its size: `10^±200 g` gives the log of `g`, a power of two the same bits.
#[test]
fn a9_a_guard_scaled_against_its_state_gives_the_same_log() {
    let plain = scaled(1.0);
    assert_eq!(plain.times().len(), 3);
    for scale in [2f64.powi(-800), 2f64.powi(-565), 2f64.powi(664), 2f64.powi(900)] {
        assert_eq!(scaled(scale).times(), plain.times(), "{scale:e}");
    }
    for scale in [1e-250, 1e-200, 1e-170, 1e200, 1e250] {
        let times = scaled(scale).times();
        assert_eq!(times.len(), 3, "{scale:e}");
        // Each coefficient is rounded once more, and the slopes at the roots are 0.01 and more of the size.
        assert!(times.iter().zip(plain.times()).all(|(a, b)| (a - b).abs() <= 16.0 * f64::EPSILON / 0.01), "{times:?}");
    }
}

fn not_finite(outcome: Result<flank::engine::Outcome, EngineError>, what: &str) -> f64 {
    match outcome {
        Err(EngineError::Integrate { source: IntegrateError::NotFinite { t }, .. }) => t,
        other => panic!("{what}: {other:?}"),
    }
}

/// A10. A guard that is no number although the state is one stops the run.
#[test]
fn a10_a_guard_that_is_no_number_stops_the_run() {
    for scale in [f64::NAN, f64::INFINITY] {
        let s = Scaled { course: Course::new(&[1.0, -1.0]), scale };
        let (outcome, run) = attempt(&s, s.course.start(), s.course.clock.instant(3.0));
        assert_eq!((not_finite(outcome, "guard"), run.records.len()), (0.0, 0), "{scale}");
    }
}

/// A10. A force that overflows in the middle of a run stops it there, with what was logged before.
///
/// `x″ = 1e300 x` from the flank at 1 on, which is passed at t = 1: the growth rate 1e150 leaves every double at once.
#[test]
fn a10_a_force_beyond_all_numbers_stops_the_run_where_it_arises() {
    let s = walled(&WalledOscillator::new(1.0, Walls::Above { position: 1.0 }, elastic(), Stiffness::Constant(-1e300)));
    let (outcome, run) = attempt(&s, state(&s, &[0.0], &[1.0]), s.clock().instant(3.0));
    let t = not_finite(outcome, "force");
    assert!((t - 1.0).abs() <= 1e-9, "{t}");
    assert!((run.state.x[0] - 1.0).abs() <= 1e-9, "the last good state stands");
}

/// A12. `x = sin t` through ½ ten times, the last at 8π + 5π/6: events are as good as the motion, to rounding.
#[test]
fn a12_the_tenth_crossing_is_as_accurate_as_the_first() {
    let s = walled(&WalledOscillator {
        stiffness: 1.0,
        ..WalledOscillator::new(1.0, Walls::Above { position: 0.5 }, ghost(), Stiffness::Constant(0.0))
    });
    let run = run(&s, &[0.0], &[1.0], 28.0);
    assert_eq!(run.times().len(), 10);
    for (k, t) in run.times().iter().enumerate() {
        let turn = TAU * (k / 2) as f64;
        let exact = turn + if k % 2 == 0 { PI / 6.0 } else { 5.0 * PI / 6.0 };
        // A few units for each of some four steps a turn, over the slope √¾.
        assert!((t - exact).abs() <= 16.0 * f64::EPSILON * (1.0 + exact), "{k}: {:e}", t - exact);
    }
}

/// A14. In cycle 10⁹ (t = 6·10⁹, where doubles lie 10⁻⁶ apart) two crossings 2·10⁻⁸ apart stay two, at their distance.
#[test]
fn a14_crossings_closer_than_the_rounding_of_time_stay_apart() {
    for (cycle, half) in [(0, 1e-8f64), (1_000_000_000, 1e-8), (1_000_000_000_000, 1e-6)] {
        let s = walled(&WalledOscillator {
            load: -1.0,
            omega: Some(1.0),
            ..WalledOscillator::new(1.0, Walls::Above { position: 0.0 }, ghost(), Stiffness::Constant(0.0))
        });
        let at = s.clock().at(cycle, 0.5);
        // From the height half²/2 below the flank, upwards with √2 half: through at (√2 − 1) half, back at (√2 + 1) half.
        let start = s.start(at, &[-0.5 * half * half], &[std::f64::consts::SQRT_2 * half]).unwrap();
        let run = run_from(&s, State { at, x: start.x, jump: start.jump }, s.clock().at(cycle, 1.0));
        let events = run.events();
        assert_eq!(modes(&events, 0), [Drive, Separated], "{cycle}");
        let apart = s.clock().between(events[0].at, events[1].at);
        assert!((apart / (2.0 * half) - 1.0).abs() <= 1e-12, "{cycle}: {apart:e}");
    }
}

/// A16. Two masses whose inertias are nearly one: off the diagonal o, on it 1, both loaded by F. The first contact, b away, is at
/// `√(2b(1 + o)/F)`. M⁻¹ by doubles alone costs the condition of M in units in the last place: 4.7e-11 s for o = 1 − 1e-6.
#[test]
fn a16_a_nearly_singular_mass_matrix_costs_no_digits() {
    let (b, f) = (0.5, 0.3368);
    for o in [0.9999, 0.999_999, 0.999_999_99, 1.0 - 1e-10] {
        let mut spec = masses(&[1.0; 2], &[f; 2], &[vec![1.0, 0.0]], elastic()).spec().clone();
        spec.mass = nalgebra::dmatrix![1.0, o; o, 1.0];
        spec.contacts[0].half_backlash = b;
        let run = run(&Structure::new(spec).unwrap(), &[0.0; 2], &[0.0; 2], 2.6);
        let (first, exact) = (run.events()[0], (2.0 * b * (1.0 + o) / f).sqrt());
        let (off, allowed) = (run.times()[0] - exact, first.conditioning.time + 2.0 * f64::EPSILON * exact);
        assert!(off.abs() <= allowed, "{o}: off by {off:e}, {allowed:e} allowed");
    }
}

/// A15. Stiffness schedules of periods T, T/2 and T/3 have six different steps a cycle, of which they share some: as many
/// switches in cycle 10⁷ as in the first, at the same phases, and no sliver of an arc between two that are meant to be one.
#[test]
fn a15_schedules_that_meet_leave_no_sliver_however_late() {
    let period = TAU / 0.7;
    let mut spec = flank::train::KahramanSingh::new(0.05, 0.5, 0.05, 0.7).assemble().unwrap();
    let mesh = spec.contacts[0].clone();
    spec.contacts = [1.0, 2.0, 3.0]
        .iter()
        .map(|n| flank::system::ContactSpec {
            stiffness: Stiffness::rectangular(1.2, 0.9, period / n, 0.5, 0.0),
            ..mesh.clone()
        })
        .collect();
    let s = Structure::new(spec).unwrap();
    let phases = |cycle: i64| {
        let at = s.clock().at(cycle, 0.1);
        let start = s.start(at, &[1.2], &[0.0]).unwrap();
        let run = run_from(&s, State { at, x: start.x, jump: start.jump }, s.clock().at(cycle + 10, 0.1));
        let switches: Vec<_> =
            run.records.iter().filter(|r| r.switched).map(|r| (r.at.cycle - cycle, r.at.phase.value())).collect();
        assert_eq!(switches.len() as u64, run.counters.switches);
        switches
    };
    let first = phases(0);
    // T: 0, ½. T/2: 0, ¼, ½, ¾. T/3: 0, 1/6, 1/3, ½, 2/3, 5/6. Together eight.
    assert_eq!(first.len(), 80, "{:?}", &first[..9]);
    assert_eq!(phases(10_000_000), first);
}
