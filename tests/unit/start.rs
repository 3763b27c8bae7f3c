//! Deflections in vectors against deflections one by one.

use nalgebra::DMatrix;

use super::*;
use crate::{
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Linear, Release},
    },
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
