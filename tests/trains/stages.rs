//! Planetary stages: natural frequencies, freedoms, phases and checks, against published and independently computed numbers.

use std::f64::consts::TAU;

use crate::presets::{
    ReferenceDamping, ReferenceStiffness, lin_parker, reference, reference_float, reference_heavy, reference_hertz,
    reference_light,
};
use approx::assert_relative_eq;
use flank::gear::contact::Law;
use flank::gear::{MeshStiffness, PathOfContact, Waveform};
use flank::linalg::multiplicities;
use flank::system::Flanks;
use flank::system::{bonded_modes, bonded_stiffness};
use flank::train::planetary::{Family, FamilyError, FamilyModes, families};
use flank::train::{Freedoms, Phasing, Planetary, Support, TrainError, Warning};

fn hertz(stage: &Planetary, freedoms: &Freedoms) -> Vec<f64> {
    bonded_modes(&stage.assemble(freedoms).expect("a stage")).expect("stable").hertz()
}

fn named(names: &[&str]) -> Freedoms {
    Freedoms::Named(names.iter().map(ToString::to_string).collect())
}

fn default_stage() -> Planetary {
    reference(&ReferenceStiffness::DEFAULT, &ReferenceDamping::DEFAULT).expect("gears that mesh")
}

/// Every value of `expected` (frequency, multiplicity), in rising order, to `tolerance` Hz.
fn assert_spectrum(frequencies: &[f64], expected: &[(f64, usize)], tolerance: f64) {
    let flat: Vec<f64> = expected.iter().flat_map(|&(f, count)| std::iter::repeat_n(f, count)).collect();
    assert_eq!(frequencies.len(), flat.len(), "{frequencies:?}");
    for (got, want) in frequencies.iter().zip(&flat) {
        assert!((got - want).abs() <= tolerance, "{got} against {want} Hz");
    }
}

/// Lin & Parker 1999, N = 3, recomputed to 25 digits.
const LIN_PARKER_3: [(f64, usize); 12] = [
    (0.0, 1),
    (743.163_896_525_717_7, 2),
    (1_102.419_330_540_35, 2),
    (1_475.747_229_993_266, 1),
    (1_896.019_942_407_954, 2),
    (1_930.346_569_608_508_8, 1),
    (2_276.380_115_717_255, 2),
    (2_658.324_423_547_39, 1),
    (6_986.298_221_729_212, 2),
    (7_462.803_434_345_869, 1),
    (9_647.913_216_604_46, 2),
    (11_775.265_785_475_283, 1),
];

/// Lin & Parker 1999, N = 5, recomputed to 25 digits.
const LIN_PARKER_5: [(f64, usize); 15] = [
    (0.0, 1),
    (710.045_193_574_495_7, 2),
    (1_072.012_392_302_056, 2),
    (1_567.397_659_407_976_7, 1),
    (1_808.180_882_040_793, 2),
    (1_888.077_132_458_465_5, 2),
    (2_006.078_475_524_972_3, 1),
    (2_425.295_368_360_982_7, 2),
    (2_614.795_688_525_953, 1),
    (5_963.760_021_608_515, 2),
    (6_981.705_167_044_027, 2),
    (7_382.379_931_872_634, 2),
    (8_065.389_945_689_17, 1),
    (11_172.308_654_013_032, 2),
    (14_253.092_354_349_566, 1),
];

#[test]
fn lin_parker_to_nine_digits() {
    for (planets, table) in [(3, &LIN_PARKER_3[..]), (5, &LIN_PARKER_5[..])] {
        let found = hertz(&lin_parker(planets), &Freedoms::FullCarrier);
        assert_eq!(found[0], 0.0);
        let groups = multiplicities(&found, 1.0e-9);
        assert_eq!(groups.len(), table.len());
        for (got, want) in groups.iter().zip(table) {
            assert_eq!(got.1, want.1, "{got:?}");
            assert_relative_eq!(got.0, want.0, max_relative = 1.0e-9);
        }
    }
}

/// The printed table (0.1 Hz): six rotational, six double translational, three planet modes of multiplicity N − 3.
#[test]
fn lin_parker_four_planets() {
    let expected = [
        (0.0, 1),
        (727.3, 2),
        (1091.2, 2),
        (1536.5, 1),
        (1808.2, 1),
        (1892.8, 2),
        (1970.6, 1),
        (2342.5, 2),
        (2625.7, 1),
        (5963.8, 1),
        (6981.7, 1),
        (7189.9, 2),
        (7773.6, 1),
        (10437.6, 2),
        (13071.1, 1),
    ];
    assert_spectrum(&hertz(&lin_parker(4), &Freedoms::FullCarrier), &expected, 0.06);
}

/// Regression values of the identified set, printed to 0.01 Hz.
#[test]
fn reference_stage_full() {
    let expected = [
        (431.39, 2),
        (434.01, 1),
        (869.05, 1),
        (882.63, 2),
        (1060.39, 1),
        (1785.12, 2),
        (2974.95, 1),
        (4123.48, 2),
        (4215.57, 2),
        (4460.28, 1),
        (5504.81, 1),
    ];
    assert_spectrum(&hertz(&default_stage(), &Freedoms::Full), &expected, 0.05);
}

#[test]
fn reference_stage_with_the_ring_held() {
    let stage = default_stage();
    let in_phase = Freedoms::InPhase;
    let all = stage.assemble(&Freedoms::Full).unwrap().freedoms;
    let without: Vec<&str> = all.iter().map(String::as_str).filter(|name| *name != "u_r").collect();
    let full = hertz(&stage, &named(&without));
    for f in [434.87, 870.56, 1061.99, 3393.69, 4460.35] {
        assert!(full.iter().any(|g| (g - f).abs() <= 0.05), "{f} not in {full:?}");
    }
    assert_spectrum(
        &hertz(&stage, &in_phase),
        &[434.01, 869.05, 1060.39, 2974.95, 4460.28, 5504.81].map(|f| (f, 1)),
        0.05,
    );
}

#[test]
fn reference_stage_torsional() {
    let mut stage = default_stage();
    let expected = [(533.82, 1), (2056.41, 1), (2727.97, 2), (3944.35, 1), (5369.84, 1)];
    assert_spectrum(&hertz(&stage, &Freedoms::Torsional), &expected, 0.05);
    let held = named(&["u_s", "u_1", "u_2", "u_3", "u_c"]);
    assert_spectrum(&hertz(&stage, &held), &[(535.22, 1), (2275.24, 1), (2727.97, 2), (3976.82, 1)], 0.05);
    stage.sun.rotation = Support::FREE;
    stage.carrier.rotation = Support::FREE;
    let free = hertz(&stage, &held);
    assert_eq!(free[0], 0.0);
    assert_spectrum(&free, &[(0.0, 1), (2228.46, 1), (2727.97, 2), (3962.02, 1)], 0.05);
}

/// The set that meets the paper's frequencies: printed values to 0.1 Hz, parameters to 4 digits.
#[test]
fn exact_frequencies() {
    let stage = reference(&ReferenceStiffness::EXACT_FREQUENCIES, &ReferenceDamping::DEFAULT).unwrap();
    let found = hertz(&stage, &Freedoms::Full);
    for f in [412.0, 889.0, 1791.0, 2483.7, 3335.2, 512.5, 919.0, 1045.8] {
        assert!(found.iter().any(|g| (g - f).abs() <= 0.3), "{f} not in {found:?}");
    }
}

/// In-phase motion is a motion of the full stage: its frequencies are the full one's single frequencies.
#[test]
fn in_phase_frequencies_are_the_rotational_ones() {
    for planets in 3..=6 {
        let stage = lin_parker(planets);
        let single: Vec<f64> = multiplicities(&hertz(&stage, &Freedoms::FullCarrier), 1.0e-9)
            .into_iter()
            .filter_map(|(f, count)| (count == 1).then_some(f))
            .collect();
        for f in hertz(&stage, &Freedoms::InPhase) {
            assert!(single.iter().any(|g| (f - g).abs() <= 1.0e-9 * g.max(1.0)), "{f} not in {single:?}");
        }
    }
}

/// Out-of-range values are named, not simulated.
#[test]
fn bad_values_are_named() {
    let name = |change: &dyn Fn(&mut Planetary)| {
        let mut stage = reference_heavy(500.0, 500.0).unwrap();
        change(&mut stage);
        match stage.assemble(&Freedoms::Full).unwrap_err() {
            TrainError::Value { name, .. } => name,
            other => panic!("{other}"),
        }
    };
    assert_eq!(name(&|s| s.sun.mass = 0.0), "sun: mass");
    assert_eq!(name(&|s| s.planets[1].body.translation.stiffness = f64::NAN), "planet 2: translation stiffness");
    assert_eq!(
        name(&|s| s.planets[0].sun_mesh.half_backlash = 1e-5),
        "sun-planet 1: half backlash of a bilateral mesh"
    );
    assert_eq!(name(&|s| s.planets[2].ring_mesh.error[0].order = 0.0), "ring-planet 3: error order");
    let path = PathOfContact { approach: 0.7, recess: 0.7, overlap: 0.0 };
    let pairs = |waveform, modulation| MeshStiffness::Pairs { mean: 1e8, path, waveform, modulation };
    let stiffness = |k: MeshStiffness| name(&move |s| s.planets[0].sun_mesh.stiffness = k.clone());
    assert_eq!(stiffness(pairs(Waveform::Rectangular, 1.5)), "sun-planet 1: modulation");
    assert_eq!(stiffness(pairs(Waveform::Trapezoidal { ramp: 0.8 }, 0.5)), "sun-planet 1: ramp");
    assert_eq!(stiffness(pairs(Waveform::Fourier { harmonics: 0 }, 0.5)), "sun-planet 1: harmonics");
    assert_eq!(stiffness(MeshStiffness::Rectangular { high: 1.0, low: 0.5, duty: 1.0 }), "sun-planet 1: duty");
}

#[test]
fn matrices_are_symmetric_and_rigid_motion_is_free() {
    let stage = lin_parker(4);
    let spec = stage.assemble(&Freedoms::FullCarrier).unwrap();
    assert_eq!(spec.freedoms.len(), 21);
    let total = bonded_stiffness(&spec, None);
    assert_eq!(total, total.transpose());
    assert_eq!(spec.mass, spec.mass.transpose());
    let mut stage = default_stage();
    stage.rpm = 3000.0;
    stage.gyroscopic = true;
    let spec = stage.assemble(&Freedoms::FullCarrier).unwrap();
    // The Coriolis part of C is skew.
    stage.gyroscopic = false;
    let skew = &spec.damping - stage.assemble(&Freedoms::FullCarrier).unwrap().damping;
    assert_relative_eq!(skew.clone(), -skew.transpose(), epsilon = 1.0e-9);
    let (row, column) = (0, 1);
    assert_relative_eq!(skew[(row, column)], -2.0 * 2.7 * stage.carrier_speed(), max_relative = 1.0e-12);
    // All centres moving together with the carrier frame's origin: planets keep their pins, meshes see nothing.
    let names = ["x_s", "x_c", "x_r"];
    let held = stage.assemble(&named(&names)).unwrap();
    for contact in &held.contacts {
        assert!(contact.direction.iter().sum::<f64>().abs() < 1.0e-15, "{contact:?}");
    }
    // Everything turning with the carrier by one angle.
    let spins = stage.assemble(&Freedoms::Torsional).unwrap();
    let radii = [stage.sun.radius, stage.planets[0].body.radius, stage.carrier.radius, stage.ring.radius];
    for contact in &spins.contacts {
        let [s, p, c, r] = radii;
        let q = [s, p, p, p, c, r];
        let stretch: f64 = contact.direction.iter().zip(q).map(|(g, q)| g * q).sum();
        assert!(stretch.abs() < 1.0e-15, "{} {stretch}", contact.name);
    }
}

#[test]
fn freedoms_and_names() {
    let stage = reference_light(500.0, 0.0).unwrap();
    let spec = stage.assemble(&Freedoms::Full).unwrap();
    assert_eq!(spec.freedoms.len(), 16);
    assert_eq!(stage.assemble(&Freedoms::FullCarrier).unwrap().freedoms.len(), 18);
    let names: Vec<&str> = spec.contacts.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(
        names,
        ["sun-planet 1", "sun-planet 2", "sun-planet 3", "ring-planet 1", "ring-planet 2", "ring-planet 3"]
    );
    let torsional = stage.assemble(&Freedoms::Torsional).unwrap();
    assert_eq!(torsional.freedoms, ["u_s", "u_1", "u_2", "u_3", "u_c", "u_r"]);
    let cos = 28.0f64.to_radians().cos();
    assert_relative_eq!(torsional.mass[(4, 4)], 27.5);
    assert_relative_eq!(torsional.contacts[1].direction.as_slice(), [1.0, 0.0, 1.0, 0.0, -cos, 0.0].as_slice());
    assert_relative_eq!(torsional.contacts[3].direction.as_slice(), [0.0, -1.0, 0.0, 0.0, -cos, 1.0].as_slice());
    // In the carrier's frame, carrier held: the meshes see rotations alone.
    let spins = stage.assemble(&named(&["u_s", "u_1", "u_2", "u_3", "u_r"])).unwrap();
    assert_eq!(spins.contacts[2].direction, [1.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!(spins.contacts[5].direction, [0.0, 0.0, 0.0, -1.0, 1.0]);
    let in_phase = stage.assemble(&Freedoms::InPhase).unwrap();
    assert_eq!(in_phase.freedoms, ["u_s", "u_r", "u_c", "xi", "eta", "u"]);
    assert_relative_eq!(in_phase.mass[(0, 0)] * 3.0, 3.945_297_715_394_916_7, max_relative = 1.0e-14);
    assert_relative_eq!(in_phase.mass[(5, 5)], 4.152_620_852_364_162, max_relative = 1.0e-14);
    for bad in ["u_4", "u_s"] {
        let error = stage.assemble(&named(&["u_s", bad])).unwrap_err();
        assert!(matches!(error, TrainError::Freedom { .. }), "{error}");
    }
}

#[test]
fn light_load_data() {
    let [sun, ring] = reference_hertz().unwrap();
    // Printed to five digits.
    assert_relative_eq!(sun, 1.612_681e10, max_relative = 1.0e-6);
    assert_relative_eq!(ring, 2.709_846_1e10, max_relative = 1.0e-6);
    let stage = reference_light(500.0, 0.0).unwrap();
    // Drag on the sun: 9.1 + 0.281 n newtons, printed to three digits.
    assert_relative_eq!(stage.input_torque() / stage.sun.radius, 9.1 + 0.281 * 500.0, max_relative = 1.0e-3);
    let spec = stage.assemble(&Freedoms::InPhase).unwrap();
    assert_relative_eq!(spec.omega.unwrap() / TAU, 209.230_769_230_769_2, max_relative = 1.0e-14);
    let contact = &spec.contacts[0];
    assert_eq!((contact.half_backlash, contact.flanks), (0.0, Flanks::Drive));
    let Law::Power(law) = contact.law else { panic!("{:?}", contact.law) };
    assert_relative_eq!(law.hysteresis, 0.75 * (1.0 - 0.743 * 0.743), max_relative = 1.0e-15);
    // e(0) = Σ E sin φ.
    let e0: f64 = contact.error.iter().map(|h| h.amplitude * h.phase.cos()).sum();
    let (e1, p1, e2, p2) = (2.90648e-6, 1.187_522_023_056_942, 1.662_506_56e-6, 0.491_858_738_934_297_4);
    assert_relative_eq!(e0, e1 * f64::sin(p1) + e2 * f64::sin(p2), max_relative = 1.0e-12);
    let float = reference_float(100.0, 0.0).unwrap();
    let phases: Vec<f64> = float.planets.iter().map(|p| p.sun_mesh.phase).collect();
    assert_relative_eq!(phases.as_slice(), [0.0, 2.0 / 3.0, 1.0 / 3.0].as_slice(), epsilon = 1.0e-14);
}

#[test]
fn phases_and_assembly() {
    let stage = reference_light(500.0, 0.0).unwrap();
    let warnings = stage.warnings();
    assert!(matches!(&warnings[0], Warning::NotAssemblable { nearest, .. }
        if (nearest[1].to_degrees() - 119.076_923_076_923_08).abs() < 1e-12
            && (nearest[2].to_degrees() - 240.923_076_923_076_92).abs() < 1e-12));
    // Sun, ring and three planets: inertias no such body can have.
    assert_eq!(warnings.len(), 2);
    assert!(matches!(&warnings[1], Warning::Gyration { bodies } if bodies.len() == 5));
    let placed = stage.clone().phased(&Phasing::Assemblable).unwrap();
    assert!(!placed.warnings().iter().any(|w| matches!(w, Warning::NotAssemblable { .. })));
    for (planet, want) in placed.planets.iter().zip([0.0, 0.753_846_153_846_154_7, 0.246_153_846_153_845_28]) {
        assert_relative_eq!(planet.sun_mesh.phase, want, epsilon = 1.0e-12);
        let ring = (planet.ring_mesh.phase + stage.ring_phase - want).rem_euclid(1.0);
        assert!(ring.min(1.0 - ring) < 1.0e-12);
    }
    assert!(matches!(placed.assemble(&Freedoms::InPhase), Err(TrainError::NotInPhase { planet: 2 })));
    let short = Phasing::Explicit { sun: vec![0.0; 3], ring: vec![0.0] };
    assert!(matches!(stage.phased(&short), Err(TrainError::Phases { planets: 3, got: 1 })));
}

#[test]
fn a_standing_stage_has_no_mesh_clock() {
    let stage = reference_heavy(0.0, 500.0).unwrap();
    assert!(matches!(stage.assemble(&Freedoms::Full), Err(TrainError::Standing { .. })));
}

/// Every frequency of a family, once.
fn family(stage: &Planetary, freedoms: &Freedoms, wanted: Family) -> Vec<f64> {
    let spec = stage.assemble(freedoms).expect("a stage");
    let parts = families(&spec, &bonded_stiffness(&spec, None)).expect("symmetric");
    parts.iter().find(|part| part.family == wanted).map_or(Vec::new(), FamilyModes::hertz)
}

#[test]
fn families_are_those_of_the_published_table() {
    let close = |got: Vec<f64>, want: &[f64]| {
        assert_eq!(got.len(), want.len());
        got.iter().zip(want).for_each(|(g, w)| assert!((g - w).abs() <= 0.06, "{g} against {w} Hz"));
    };
    let (stage, all) = (lin_parker(5), Freedoms::FullCarrier);
    close(family(&stage, &all, Family::Rotational), &[0.0, 1567.4, 2006.1, 2614.8, 8065.4, 14253.1]);
    close(family(&stage, &all, Family::Translational), &[710.0, 1072.0, 1888.1, 2425.3, 7382.4, 11172.3]);
    close(family(&stage, &all, Family::Planet), &[1808.2, 5963.8, 6981.7]);
    // Without centres, planets against one another move nothing else.
    let torsional = Freedoms::Torsional;
    close(family(&default_stage(), &torsional, Family::Planet), &[2727.97]);
    close(family(&default_stage(), &torsional, Family::Rotational), &[533.82, 2056.41, 3944.35, 5369.84]);
}

/// The parts together are the whole: same frequencies, same shapes up to turns within a repeated one.
#[test]
fn families_together_are_all_modes() {
    for (planets, freedoms) in
        [1, 2, 3, 4, 5, 6].into_iter().flat_map(|n| [Freedoms::FullCarrier, Freedoms::Torsional].map(|f| (n, f)))
    {
        let spec = lin_parker(planets).assemble(&freedoms).unwrap();
        let stiffness = bonded_stiffness(&spec, None);
        let parts = match families(&spec, &stiffness) {
            // One planet turns the whole stage when it moves the centres.
            Err(error) => {
                assert_eq!((planets, error), (1, FamilyError::Asymmetric));
                continue;
            }
            Ok(parts) => parts,
        };
        let whole = bonded_modes(&spec).unwrap();
        let mut found: Vec<f64> = parts.iter().flat_map(|part| part.modes.hertz()).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found.len(), whole.omega.len());
        for (got, want) in found.iter().zip(whole.hertz()) {
            assert_relative_eq!(*got, want, max_relative = 1e-9, epsilon = 1e-3);
        }
        for part in &parts {
            for group in part.modes.omega.chunks(part.multiplicity) {
                assert_relative_eq!(group[0], group[group.len() - 1], max_relative = 1e-9, epsilon = 1e-3);
            }
            for (omega, shape) in part.modes.omega.iter().zip(part.modes.shapes.column_iter()) {
                let rest = &stiffness * shape - omega * omega * &spec.mass * shape;
                // Round-off of the eigenvalue problem against its largest term.
                let highest = whole.omega.last().unwrap();
                assert!(rest.amax() <= 1e-10 * highest * highest * (&spec.mass * shape).amax(), "{}", rest.amax());
            }
        }
    }
}

#[test]
fn families_want_a_symmetric_stage() {
    let told = |stage: &Planetary, freedoms: &Freedoms| {
        let spec = stage.assemble(freedoms).unwrap();
        families(&spec, &bonded_stiffness(&spec, None)).map(|parts| parts.len())
    };
    let mut stage = default_stage();
    assert_eq!(told(&stage, &Freedoms::Full), Ok(2));
    assert_eq!(told(&stage, &named(&["u_s", "xi_1", "u_1"])), Ok(1));
    assert_eq!(told(&stage, &named(&["u_s", "xi_2", "u_2"])), Err(FamilyError::Freedoms));
    assert_eq!(told(&stage, &named(&["x_s", "u_s"])), Err(FamilyError::Freedoms));
    stage.planets[1].position += 1e-3;
    assert_eq!(told(&stage, &Freedoms::Full), Err(FamilyError::Asymmetric));
}
