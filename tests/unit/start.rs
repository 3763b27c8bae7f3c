//! Starts of contacts in vectors against those one by one.

use std::cell::RefCell;

use nalgebra::DMatrix;

use super::*;
use crate::{
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
    hybrid::{FULL_PRECISION, GuardSet},
    system::{ContactSpec, Flanks, LoadHarmonic, Spec, Structure},
    vectors::{Baseline, Instructions, Work},
};

struct Terms<'a>(&'a Structure, &'a [f64]);

impl Work for Terms<'_> {
    type Output = Vec<[Four; 2]>;

    fn on<P: Path>(self, path: P) -> Self::Output {
        self.0.columns.fours.iter().map(|four| deflection_terms(path, four, self.1)).collect()
    }
}

fn train(contacts: usize) -> Structure {
    let n = 5;
    let direction =
        |j: usize, i: usize| if (i + j).is_multiple_of(3) { 0.0 } else { libm::sin((1 + i + 7 * j) as f64) };
    let contact = |j: usize| ContactSpec {
        name: format!("contact {j}"),
        direction: (0..n).map(|i| direction(j, i)).collect(),
        error: vec![Harmonic { amplitude: 0.003 * (1 + j) as f64, omega: 2.0, phase: 0.1 }],
        error_offset: 0.01 * j as f64,
        half_backlash: 0.1,
        flanks: Flanks::Both,
        stiffness: Stiffness::Constant(10.0),
        law: Law::KelvinVoigt(Linear { damping: 0.0 }, Release::Deflection),
        gap_damping: 0.0,
        back: None,
    };
    let spec = Spec {
        freedoms: (0..n).map(|i| format!("u_{i}")).collect(),
        mass: DMatrix::identity(n, n),
        damping: DMatrix::identity(n, n),
        stiffness: DMatrix::identity(n, n),
        load: vec![0.0; n],
        load_harmonics: Vec::<LoadHarmonic>::new(),
        contacts: (0..contacts).map(contact).collect(),
        omega: None,
        bearings: vec![],
        shared: vec![],
        load_schedules: vec![],
    };
    Structure::new(spec).unwrap()
}

#[test]
fn deflections_in_vectors_have_the_bits_of_those_one_by_one() {
    // Velocities stand behind the displacements.
    let x = [0.3, -0.0, -1.7, 0.0, 1e-9, 5.0, 6.0, 7.0, 8.0, 9.0];
    for contacts in [1, 4, 5, 9] {
        let s = train(contacts);
        for terms in [Baseline.run(Terms(&s, &x)), Instructions::best().run(Terms(&s, &x))] {
            for (j, c) in s.contacts.iter().enumerate() {
                let [sums, sizes] = terms[j / LANES];
                assert_eq!(sums[j % LANES].to_bits(), dot(&c.direction, &x).to_bits());
                assert_eq!(sizes[j % LANES].to_bits(), s.deflection_size(c, &x).to_bits());
            }
        }
    }
}

struct Started<'a>(&'a Expansion<'a>);

impl Work for Started<'_> {
    type Output = StepRows;

    fn on<P: Path>(self, path: P) -> StepRows {
        let (mut jet, s) = (Jet::default(), self.0.s);
        jet.rows.fit(s.n, s.contacts.len(), s.oscillators.len());
        self.0.start(path, &mut jet);
        jet.rows
    }
}

#[test]
fn contacts_of_a_step_start_as_those_of_a_leap() {
    let s = train(9);
    let x: Vec<f64> = (0..s.dim).map(|i| 0.08 * libm::cos(2.0 + i as f64)).collect();
    let at = Instant::default();
    let mode = s.start(at, &x[..s.n], &x[s.n..]).unwrap().jump.mode;
    let motion = Motion::new(&s, &mode);
    let is_open = |j: usize| motion.parts[j].state == ContactMode::Separated;
    assert!((0..9).any(is_open) && !(0..9).all(is_open), "contacts of both kinds");
    // Every third stretch is unknown. Some guards are exactly zero: of the flank that a contact presses or has left, or of a force.
    let carried: Vec<f64> = (0..9).map(|j| if j % 3 == 0 { f64::NAN } else { 0.001 * f64::from(j - 4) }).collect();
    let drive = |j: usize| guard_id(j, Watch::DriveFlank);
    let force = |j: usize| guard_id(j, Watch::Force);
    let closed = (0..9).find(|j| !is_open(*j)).unwrap();
    let open = (0..9).find(|j| is_open(*j)).unwrap();
    for zeros in [vec![], vec![drive(open), force(closed)], vec![drive(closed)], (0..9).map(drive).collect()] {
        let (pinned, still) = (zeros.into_iter().collect::<GuardSet>(), GuardSet::default());
        let request = JetRequest {
            at,
            x: &x,
            low: &[],
            pinned: &pinned,
            still: &still,
            carried: &carried,
            span: 1.0,
            tolerance: FULL_PRECISION,
            left_out: [0.0; 2],
        };
        let room = RefCell::default();
        let step = Expansion { s: &s, motion: &motion, request: &request, room: &room, h: 1.0, is_bare: true };
        for rows in [Baseline.run(Started(&step)), Instructions::best().run(Started(&step))] {
            for (j, c) in s.contacts.iter().enumerate() {
                let by_state = dot(&c.direction, &x) - waves(c.spec.error_offset, &c.error, 0, &rows);
                let given = SpanStart::new(&request, j, rows.size(j));
                let rate = || step.rate(j, 0, &x[s.n..], &rows);
                let start = ContactStart::new(&motion, &given, j, by_state, rate);
                assert_eq!(start.deflection, rows.deflection(j, 0), "{j}");
                let stretch = if is_open(j) { rows.gap(j) } else { rows.stretch(j) };
                assert!(start.stretch == stretch || start.stretch.is_nan() && stretch.is_nan(), "{j}: {stretch}");
                if given.zeros == [false; 3] {
                    assert_eq!(start.error, ROUNDING * rows.terms[j / LANES][j % LANES], "{j}");
                }
            }
        }
    }
}
