//! Gear geometry, mesh phases and mesh stiffness against independently computed numbers.

use crate::presets::reference_geometry;
use approx::assert_relative_eq;
use flank::gear::geometry::{inverse_involute, involute, iso_mesh_stiffness, low_load_factor};
use flank::gear::phase::{assemblable, assembly_pitch, equally_spaced, nearest_assemblable};
use flank::gear::{
    BasicRack, Gear, GeometryError, MeshGeometry, MeshHarmonic, MeshKind, MeshStiffness, PathOfContact, Stiffness,
    Waveform,
};
use flank::linalg::{EigenError, multiplicities, natural_modes};
use flank::train::StageGeometry;
use nalgebra::{DMatrix, dmatrix};
use proptest::prelude::*;

/// Spur teeth of 20°.
fn rack(module: f64) -> BasicRack {
    BasicRack { module, pressure_angle: 20.0f64.to_radians(), helix_angle: 0.0, addendum: 1.0, dedendum: 1.25 }
}

/// Expected values to all digits of double precision; 1e-13 leaves room for the order of operations.
#[test]
fn reference_stage() {
    let gears = reference_geometry();
    let (sun, ring) = (gears.sun_mesh().unwrap(), gears.ring_mesh().unwrap());
    let near = |got: f64, want: f64| assert_relative_eq!(got, want, max_relative = 1.0e-13);
    near(sun.base_radii[0], 0.045_030_327_235_805_28);
    near(sun.base_radii[1], 0.041_057_063_067_940_1);
    near(ring.base_radii[1], 0.127_144_453_371_685_5);
    near(sun.centre_distance, 0.0975);
    near(ring.centre_distance, 0.0975);
    near(sun.base_pitch, 0.008_321_585_013_691_19);
    near(sun.path.approach, 0.712_322_872_134_820_3);
    near(sun.path.recess, 0.691_208_913_204_479_5);
    near(ring.path.approach, 0.782_552_359_833_048_8);
    near(ring.path.recess, 0.712_322_872_134_820_3);
    near(sun.path.contact_ratio(), 1.403_531_785_339_3);
    near(ring.path.contact_ratio(), 1.494_875_231_967_869);
    near(sun.tip_radii[0], 53.94e-3);
    near(ring.tip_radii[1], 141.06e-3);
    // Printed to three digits: -0.00677.
    assert!((gears.ring_phase() - (1.0 - 0.006_77)).abs() < 5.0e-6);
}

/// Polar angle of a drawn involute of a base circle, from where it begins, at radius `r`: of the point itself, by halving.
fn drawn(base: f64, r: f64) -> f64 {
    let point = |unrolled: f64| {
        let (sine, cosine) = unrolled.sin_cos();
        [base * (cosine + unrolled * sine), base * (sine - unrolled * cosine)]
    };
    let (mut low, mut high) = (0.0, 3.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let [x, y] = point(middle);
        if x.hypot(y) < r { low = middle } else { high = middle }
    }
    let [x, y] = point(low);
    y.atan2(x)
}

/// A planet with its sun at angle 0 and the ring's teeth at angle π, turning clockwise: the time, in mesh periods, from when one flank of a
/// drawn tooth passes the working circle of the sun's mesh at 0 to when the other flank of a tooth passes that of the ring's mesh at π.
fn contact_of_the_ring(gears: &StageGeometry, sun: &MeshGeometry, ring: &MeshGeometry) -> f64 {
    let [zs, zp, zr] = [gears.sun, gears.planet, gears.ring].map(|gear| f64::from(gear.teeth));
    let base = sun.base_radii[1];
    let reference = gears.planet.pitch_radius(&gears.rack);
    let half_at = |r: f64| {
        let on_reference = 0.5 * gears.planet.tooth_thickness(&gears.rack) / reference;
        on_reference + drawn(base, reference) - drawn(base, r)
    };
    // Working circles divide the centre distances as the teeth.
    let (at_sun, at_ring) = (sun.centre_distance * zp / (zs + zp), ring.centre_distance * zp / (zr - zp));
    let centre_of_tooth = -half_at(at_sun);
    let leading = centre_of_tooth - half_at(at_ring);
    let turn = std::f64::consts::TAU / zp;
    ((leading - std::f64::consts::PI) / turn).rem_euclid(1.0)
}

#[test]
fn the_ring_phase_is_that_of_drawn_involutes() {
    let rack = rack(2.0e-3);
    let mut largest: f64 = 0.0;
    for (teeth, shifts) in [
        ([34, 31, 96], [0.0, 0.0, 0.0]),
        ([24, 31, 87], [0.35, 0.25, 0.6]),
        ([30, 20, 71], [0.3, 0.4, -0.2]),
        ([17, 28, 73], [0.5, 0.45, 0.7]),
        ([40, 31, 101], [-0.2, 0.1, -0.3]),
    ] {
        let gear = |i: usize| Gear { teeth: teeth[i], shift: shifts[i] };
        let gears = StageGeometry { rack, sun: gear(0), planet: gear(1), ring: gear(2), face_width: 0.02 };
        // The clock of the ring's mesh is ahead by minus the time of its contact, and behind by γ_rs.
        let (sun, ring) = (gears.sun_mesh().unwrap(), gears.ring_mesh().unwrap());
        let off = (gears.ring_phase() - contact_of_the_ring(&gears, &sun, &ring)).rem_euclid(1.0);
        assert!(off.min(1.0 - off) < 1e-12, "{teeth:?} {shifts:?}: {off}");
        let without = (0.5 * f64::from(teeth[1])
            - gears.planet.tooth_thickness(&rack) / (std::f64::consts::PI * rack.module))
            .rem_euclid(1.0);
        largest = largest.max((gears.ring_phase() - without).abs());
    }
    // What the involute terms are worth: without them the phase was off by this.
    assert!(largest > 0.05, "{largest}");
}

/// A textbook pair: the working angle must satisfy its own equation, and the shifts widen the centre distance.
#[test]
fn profile_shift() {
    let rack = rack(2.0e-3);
    let (pinion, wheel) = (Gear { teeth: 20, shift: 0.3 }, Gear { teeth: 40, shift: 0.2 });
    let mesh = MeshGeometry::new(&rack, pinion, wheel, MeshKind::External).unwrap();
    let want = involute(rack.pressure_angle) + 2.0 * rack.pressure_angle.tan() * 0.5 / 60.0;
    assert_relative_eq!(involute(mesh.pressure_angle), want, max_relative = 1.0e-13);
    let standard = 60.0e-3 * rack.pressure_angle.cos() / mesh.pressure_angle.cos();
    assert_relative_eq!(mesh.centre_distance, standard, max_relative = 1.0e-13);
    let small = MeshGeometry::new(&rack, wheel, pinion, MeshKind::Internal);
    assert_eq!(small, Err(GeometryError::Ring { pinion: 40, ring: 20 }));
    let negative = Gear { teeth: 40, shift: -2.0 };
    assert!(matches!(
        MeshGeometry::new(&rack, pinion, negative, MeshKind::External),
        Err(GeometryError::PressureAngle(_) | GeometryError::Tip { .. })
    ));
}

/// ISO 6336-1 method B, printed to four digits, and the low-load factor at 500 N m.
#[test]
fn iso_stiffness() {
    let gears = reference_geometry();
    let stiffness = |a, b, kind, mesh: MeshGeometry| {
        iso_mesh_stiffness(&gears.rack, a, b, kind, mesh.path.contact_ratio(), gears.face_width)
    };
    let sun = stiffness(gears.sun, gears.planet, MeshKind::External, gears.sun_mesh().unwrap());
    let ring = stiffness(gears.planet, gears.ring, MeshKind::Internal, gears.ring_mesh().unwrap());
    assert_relative_eq!(sun, 8.276e8, max_relative = 1.0e-4);
    assert_relative_eq!(ring, 1.0019e9, max_relative = 1.0e-4);
    assert_relative_eq!(low_load_factor(2.0e5), 1.0);
    assert_relative_eq!(low_load_factor(1.0e5 / 16.0), 0.5);
}

#[test]
fn assembly() {
    assert!(!assemblable(34, 96, &equally_spaced(3), 1.0e-9));
    assert!(assemblable(34, 98, &equally_spaced(3), 1.0e-9));
    assert_relative_eq!(assembly_pitch(34, 96).to_degrees(), 2.769_230_769_230_769, max_relative = 1.0e-14);
    let near = nearest_assemblable(34, 96, &equally_spaced(3));
    assert!(assemblable(34, 96, &near, 1.0e-12));
}

#[test]
fn modes_of_a_chain() {
    // Three unit masses, two unit springs: 0, 1, √3.
    let k = dmatrix![1.0, -1.0, 0.0; -1.0, 2.0, -1.0; 0.0, -1.0, 1.0];
    let modes = natural_modes(&k, &DMatrix::identity(3, 3)).unwrap();
    assert_eq!(modes.omega[0], 0.0);
    assert_relative_eq!(modes.omega[1], 1.0, max_relative = 1.0e-14);
    assert_relative_eq!(modes.omega[2], 3.0f64.sqrt(), max_relative = 1.0e-14);
    // A coupled mass matrix: shapes are orthonormal in it and diagonalise K.
    let m = dmatrix![2.0, 0.5, 0.0; 0.5, 1.0, 0.2; 0.0, 0.2, 3.0];
    let modes = natural_modes(&k, &m).unwrap();
    let unit = modes.shapes.tr_mul(&m) * &modes.shapes;
    assert_relative_eq!(unit, DMatrix::identity(3, 3), epsilon = 1.0e-14);
    let shares = modes.energy_shares(&m, 1);
    assert_relative_eq!(shares.iter().sum::<f64>(), 1.0, max_relative = 1.0e-14);
    assert_eq!(natural_modes(&-&k, &m), Err(EigenError::Stiffness));
    assert_eq!(natural_modes(&k, &-&m), Err(EigenError::Mass));
    assert_eq!(multiplicities(&[0.0, 1.0, 1.0 + 1e-12, 2.0], 1e-9), [(0.0, 1), (1.0, 2), (2.0, 1)]);
}

/// Pairs in contact at the clock τ, by counting.
fn pairs(path: PathOfContact, tau: f64) -> f64 {
    (-20..=20).filter(|&n| (-path.approach..=path.recess).contains(&(tau + f64::from(n)))).count() as f64
}

#[test]
fn a_switched_stiffness_alternates() {
    let times = vec![[1.0, 0.0], [2.5, 0.0], [4.0, 0.0]];
    let k = Stiffness::switched(times, [3.0, 5.0]);
    assert_eq!([0.0, 0.99, 1.0, 2.0, 2.5, 3.9, 4.0, 9.0].map(|t| k.at(t)), [3.0, 3.0, 5.0, 5.0, 3.0, 3.0, 5.0, 5.0]);
}

proptest! {
    #[test]
    fn involutes_invert(angle in 1.0e-3f64..1.4) {
        // The involute's slope is tan²: an error of one unit in it moves a small angle by ε inv/(angle tan²) ≈ ε/3;
        // tan − angle itself cancels, leaving ε·angle/angle³.
        let tolerance = 1.0e-15 * (4.0 + angle.powi(-2));
        prop_assert!((inverse_involute(involute(angle)).unwrap() / angle - 1.0).abs() <= tolerance);
    }

    #[test]
    fn counted_pairs(approach in 0.05f64..1.4, recess in 0.05f64..1.4, phase in -3.0f64..3.0, s in 0.0f64..=1.0,
                     t in 0.0f64..10.0) {
        let path = PathOfContact { approach, recess, overlap: 0.0 };
        let (mean, period) = (5.0e8, 2.0e-3);
        let k = Stiffness::from_contact_ratio(mean, path, Waveform::Rectangular, s, period, phase);
        prop_assert!((k.mean() / mean - 1.0).abs() < 1.0e-14);
        let tau = t + phase;
        // Away from entries and exits, where round-off decides.
        let edge = |x: f64| { let f = (tau - x).rem_euclid(1.0); f.min(1.0 - f) < 1.0e-9 };
        prop_assume!(!edge(-approach) && !edge(recess));
        let want = mean * (1.0 - s + s * pairs(path, tau) / path.contact_ratio());
        prop_assert!((k.at(t * period) / want - 1.0).abs() < 1.0e-12);
    }

    #[test]
    fn trapezoids_keep_the_mean_and_average_the_count(approach in 0.3f64..1.4, recess in 0.3f64..1.4,
                     phase in -3.0f64..3.0, ramp in 0.01f64..0.25, t in 0.0f64..10.0) {
        let path = PathOfContact { approach, recess, overlap: 0.0 };
        let (mean, period) = (5.0e8, 2.0e-3);
        let k = Stiffness::from_contact_ratio(mean, path, Waveform::Trapezoidal { ramp }, 1.0, period, phase);
        prop_assert!((k.mean() / mean - 1.0).abs() < 1.0e-11, "{k:?}");
        let Stiffness::Periodic { origin, pieces, .. } = &k else { panic!() };
        prop_assert!(pieces.len() <= 4 && pieces[0].start == 0.0 && *origin <= 0.0);
        // A ramp is the moving average of a step: the trapezoid is that of the count.
        let tau = t + phase;
        let n = 4000;
        let average = (0..n).map(|i| pairs(path, tau + ramp * (2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0)))
            .sum::<f64>() / f64::from(n);
        let want = mean * average / path.contact_ratio();
        // Two steps, each placed to within one sample.
        prop_assert!((k.at(t * period) - want).abs() <= 2.1 * mean / path.contact_ratio() / f64::from(n));
    }
}

proptest! {
    #[test]
    fn lines_of_contact_are_sections_in_contact(approach in 0.2f64..1.2, recess in 0.2f64..1.2, overlap in 0.05f64..3.0,
                     phase in -3.0f64..3.0, t in 0.0f64..10.0) {
        let path = PathOfContact { approach, recess, overlap };
        prop_assume!(path.contact_ratio() + overlap > 1.0);
        let (mean, period) = (5.0e8, 2.0e-3);
        let k = Stiffness::from_contact_ratio(mean, path, Waveform::Rectangular, 1.0, period, phase);
        prop_assert!((k.mean() / mean - 1.0).abs() < 1.0e-11, "{k:?}");
        // Thin sections across the face width, each a spur gear whose clock is behind that of the last one.
        let (tau, n) = (t + phase, 4000);
        let sections = (0..n).map(|i| pairs(path, tau + overlap * ((f64::from(i) + 0.5) / f64::from(n) - 0.5)));
        let want = mean * sections.sum::<f64>() / f64::from(n) / path.contact_ratio();
        // Each end of a pair is placed to within one section, and a section has up to four ends for each pitch of the overlap.
        let bound = (2.0 + 4.0 * overlap) * mean / path.contact_ratio() / f64::from(n);
        prop_assert!((k.at(t * period) - want).abs() <= bound);
    }
}

/// The lines of contact are as long at all times if one of the two ratios is whole, and only then.
#[test]
fn lines_of_contact_of_whole_ratios() {
    let of = |recess: f64, overlap: f64| {
        let path = PathOfContact { approach: 0.75, recess, overlap };
        Stiffness::from_contact_ratio(3.0e8, path, Waveform::Rectangular, 1.0, 1.0e-3, 0.2)
    };
    for (recess, overlap) in [(0.7, 1.0), (0.7, 2.0), (0.25, 0.6), (0.25, 1.7), (1.25, 0.3)] {
        assert_eq!(of(recess, overlap), Stiffness::Constant(3.0e8));
    }
    // Near a whole ratio the variation tends to zero: 2 % of a pitch of the overlap are left over.
    let Stiffness::Periodic { pieces, .. } = of(0.7, 1.02) else { panic!() };
    let [least, most] = [f64::min, f64::max].map(|of| pieces.iter().map(|piece| piece.value).reduce(of).unwrap());
    assert!(most > least && most - least <= 3.0e8 * 0.02 / 1.45 * 1.01, "{least} {most}");
}

/// The pitch of the normal section: `r_b cos β_b = m Z cos α/2`, whatever the helix angle. The other values are those of a pair of
/// 17 and 38 teeth with 20° and 15° by formulas of the transverse rack, worked out with 30 digits.
#[test]
fn helical_teeth() {
    let spur = rack(3.0e-3);
    let helical = BasicRack { helix_angle: 15.0f64.to_radians(), ..spur };
    let near = |got: f64, want: f64| assert_relative_eq!(got, want, max_relative = 4.0e-15);
    let [pinion, wheel] = [(17, 0.3), (38, -0.1)].map(|(teeth, shift)| Gear { teeth, shift });
    for gear in [pinion, wheel] {
        near(gear.base_radius(&helical) * helical.base_helix().cos(), gear.base_radius(&spur));
    }
    near(helical.overlap(0.04), 0.04 * 15.0f64.to_radians().sin() / (std::f64::consts::PI * 3.0e-3));
    let mesh = MeshGeometry::new(&helical, pinion, wheel, MeshKind::External).unwrap();
    let again = MeshGeometry::at_distance(&helical, pinion, wheel, MeshKind::External, mesh.centre_distance).unwrap();
    assert_relative_eq!(again.pressure_angle, mesh.pressure_angle, max_relative = 1.0e-14);
    near(helical.transverse_angle(), 0.36035632401741163);
    near(mesh.pressure_angle, 0.3780313113601077);
    near(mesh.base_radii[0], 0.024703932727773797);
    near(mesh.base_radii[1], 0.05522055550914143);
    near(mesh.centre_distance, 0.08599643301759947);
    assert_relative_eq!(mesh.path.approach, 0.6153419341555586, max_relative = 1.0e-13);
    assert_relative_eq!(mesh.path.recess, 0.8469242765945797, max_relative = 1.0e-13);
    let k = iso_mesh_stiffness(&helical, pinion, wheel, MeshKind::External, mesh.path.contact_ratio(), 0.04);
    assert_relative_eq!(k, 728_626_266.292_715_5, max_relative = 1.0e-13);
}

/// The series tends to the wave: the square of what is left over falls with the number of harmonics.
#[test]
fn fourier_series() {
    let path = PathOfContact { approach: 0.712, recess: 0.691, overlap: 0.0 };
    let make = |waveform| Stiffness::from_contact_ratio(1.0, path, waveform, 0.5, 1.0, 0.3);
    let wave = make(Waveform::Rectangular);
    let left = |harmonics| {
        let series = make(Waveform::Fourier { harmonics });
        (0..2000).map(|i| (series.at(f64::from(i) / 2000.0) - wave.at(f64::from(i) / 2000.0)).powi(2)).sum::<f64>()
            / 2000.0
    };
    // Parseval: what is left is Σ_{l>L} a_l²/2 ≤ (s/(π ε))² 2/L.
    for harmonics in [5, 20, 80] {
        let bound = 2.0 * (0.5 / (std::f64::consts::PI * 1.403)).powi(2) / f64::from(harmonics);
        assert!(left(harmonics) < 1.1 * bound, "{} {bound}", left(harmonics));
    }
}

#[test]
fn clocks() {
    let h = MeshHarmonic { order: 2.0, amplitude: 3.0, phase: 0.4 };
    let (f, gamma, t) = (50.0, 0.2, 0.0123);
    let tau = std::f64::consts::TAU * 2.0 * (f * t + gamma) + 0.4;
    let (sine, cosine) = (h.sine(f, gamma), h.cosine(f, gamma));
    assert_relative_eq!(sine.amplitude * (sine.omega * t + sine.phase).cos(), 3.0 * tau.sin(), max_relative = 1.0e-13);
    assert_relative_eq!(
        cosine.amplitude * (cosine.omega * t + cosine.phase).cos(),
        3.0 * tau.cos(),
        max_relative = 1e-13
    );
    let k = MeshStiffness::Rectangular { high: 1.2, low: 0.7, duty: 0.6 };
    let schedule = k.schedule(2.0, 0.25);
    // high while frac(t/T + γ) < duty.
    for (t, want) in [(0.0, 1.2), (0.69, 1.2), (0.71, 0.7), (1.49, 0.7), (1.51, 1.2)] {
        assert_relative_eq!(schedule.at(t), want);
    }
    assert!(!MeshStiffness::Constant(1.0).varies() && k.varies());
}
