//! What a step shows is what the system has at each of its points.

use std::ops::ControlFlow;

use flank::{
    engine::{Engine, Observer, Options, State},
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{ContactView, HybridSystem, Mode, Power, PowerBalance, SAMPLES, StepQuantity},
    integrate::{DenseStep, Taylor},
    poly::eval,
    system::{ContactSpec, Spec, Structure},
};
use nalgebra::DMatrix;

use super::trains::{self, Case, mesh, rigid};

/// What a step is asked for.
enum Asked {
    Row(StepQuantity),
    Sample(Power),
}

/// Compares every row with the system, at points of each step, relative to the largest value met of its kind.
struct Compare<'s> {
    structure: &'s Structure,
    largest: [f64; 9],
    worst: [f64; 9],
    row: Vec<f64>,
}

impl Observer for Compare<'_> {
    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let s = self.structure;
        let mut x = vec![0.0; s.dim()];
        for theta in [0.0, 0.31 * until, 0.77 * until, until] {
            step.state(theta, &mut x);
            let at = s.clock().advance(step.start(), step.time(theta));
            let mut values = [0.0; SAMPLES];
            let mut compare = |kind: usize, what: Asked, value: f64| {
                let found = match what {
                    Asked::Row(what) => {
                        assert!(step.show(what, &mut self.row), "{what:?}");
                        eval(&self.row, theta)
                    }
                    Asked::Sample(what) => {
                        assert!(step.sample(what, &[theta; SAMPLES], &mut values), "{what:?}");
                        values[0]
                    }
                };
                self.largest[kind] = self.largest[kind].max(value.abs());
                self.worst[kind] = self.worst[kind].max((found - value).abs());
            };
            for j in 0..s.contact_count() {
                compare(
                    0,
                    Asked::Row(StepQuantity::Deflection(j)),
                    ContactView::deflection(s, j, s.contact_mode(j, mode).side(), at, &x).0,
                );
                compare(1, Asked::Row(StepQuantity::Transmission(j)), s.transmission(j, &x));
                compare(2, Asked::Row(StepQuantity::Force(j)), s.force(j, mode, at, &x));
                compare(3, Asked::Sample(Power::Loss(j)), s.dissipation(j, mode, at, &x));
            }
            let powers = s.powers(mode, at, &x);
            compare(4, Asked::Sample(Power::Load), powers.load);
            compare(5, Asked::Sample(Power::Error), powers.error);
            compare(6, Asked::Sample(Power::Parametric), powers.parametric);
            compare(7, Asked::Sample(Power::Damping), powers.damping);
            compare(8, Asked::Sample(Power::Contacts), powers.contact);
        }
        ControlFlow::Continue(())
    }
}

/// A mass that comes to rest on a table, and one on it that a spring of varying stiffness and a hard one push: the recurrence changes
/// between that for linear modes and that for rest.
fn stacked(law: Law, harmonic: bool) -> Case {
    let stiffness = if harmonic {
        Stiffness::Harmonic { mean: 40.0, harmonics: vec![Harmonic { omega: 3.1, amplitude: 15.0, phase: 0.4 }] }
    } else {
        Stiffness::rectangular(50.0, 30.0, 1.7, 0.6, 0.2)
    };
    let error = vec![Harmonic { omega: 3.1, amplitude: 0.02, phase: 0.1 }];
    let between = ContactSpec { stiffness, law, error, half_backlash: 0.1, ..mesh(&[1.0, -1.0]) };
    let on_table = ContactSpec { direction: vec![-1.0, 0.0], ..rigid(0.3, -1.0, 0.0) };
    let spec = Spec {
        freedoms: vec!["x".into(), "y".into()],
        mass: DMatrix::from_diagonal_element(2, 2, 1.0),
        damping: DMatrix::from_row_slice(2, 2, &[0.2, -0.1, -0.1, 0.3]),
        stiffness: DMatrix::zeros(2, 2),
        load: vec![-2.0, -1.0],
        load_harmonics: Vec::new(),
        contacts: vec![on_table, between],
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    };
    Case { spec, q: vec![0.5, 1.0], v: vec![0.0; 2], end: 0.0 }
}

#[test]
fn rows_of_steps_equal_values_at_their_points() {
    let linear = Linear { damping: 0.4 };
    let laws = [Law::KelvinVoigt(linear, Release::Deflection), Law::KelvinVoigt(linear, Release::Force)];
    let stacks = laws.iter().flat_map(|law| [true, false].map(|harmonic| stacked(*law, harmonic)));
    let others =
        [trains::parametric(), trains::rectangular(), trains::hertz_pair(), trains::planetary(), trains::chatter()];
    for (number, case) in stacks.chain(others).enumerate() {
        let structure = Structure::new(case.spec.clone()).unwrap();
        let clock = structure.clock();
        let start = structure.start(clock.instant(0.0), &case.q, &case.v).unwrap();
        let state = State { at: clock.instant(0.0), x: start.x, jump: start.jump };
        let mut engine = Engine::new(&structure, Box::new(Taylor::default()), Options::default(), state);
        let mut compare = Compare { structure: &structure, largest: [0.0; 9], worst: [0.0; 9], row: Vec::new() };
        // A step is asked for all that is left: for long at first, then for little.
        for end in [4.0, 4.01, 20.0, 20.01] {
            engine.run(clock.instant(end), &mut compare).unwrap();
        }
        for kind in 0..9 {
            // Some roundings for each of the 25 orders; 15 are met at most. An order left over from another step is off by any factor.
            let (worst, largest) = (compare.worst[kind], compare.largest[kind]);
            assert!(worst <= 64.0 * f64::EPSILON * largest, "case {number}, row {kind}: {worst:e} of {largest:e}");
        }
    }
}
