//! Where the numbers of the presets come from: each stage computed from its gears and sources, beside which the files of
//! `src/scene/presets` are held.
//!
//! *Reference stage*: an epicyclic set with floating sun, elastically held ring and three planets whose data, excitation
//! and vibro-impact were published ("Nonlinear Vibroimpact Characteristics of a Planetary Gear Transmission System",
//! below: the paper). Tooth data, masses and inertias are the paper's (table 1); what it leaves open (stiffnesses,
//! damping, errors) was identified by fitting its natural frequencies, mean forces and contact-loss fractions, or taken
//! from ISO 6336 and Hertz, as each constant says. With its three equally spaced planets `(Z_s + Z_r)/N` is not whole and
//! its inertias exceed what the bodies can have: `Planetary::warnings` lists both.

#![allow(dead_code)] // no test uses all of it

use flank::gear::contact::{Hysteresis, Law, PowerLaw, Ratio, coefficient};
use flank::gear::geometry::hertz_stiffness;
use flank::gear::phase::equally_spaced;
use flank::gear::{BasicRack, Gear, GeometryError, Material, MeshHarmonic, MeshKind, MeshStiffness};
use flank::train::{Body, Load, Mesh, Phasing, Planet, Planetary, StageGeometry, Support, Teeth, TrainError};

/// Gears of the reference stage: module 3 mm, 28°, teeth 34/31/96, shifts −0.02/0.02/0.02, face width 42 mm (the paper);
/// addendum 1 and dedendum 1.25 modules (standard rack).
#[must_use]
pub fn reference_geometry() -> StageGeometry {
    StageGeometry {
        rack: BasicRack {
            module: 3.0e-3,
            pressure_angle: 28.0f64.to_radians(),
            helix_angle: 0.0,
            addendum: 1.0,
            dedendum: 1.25,
        },
        sun: Gear { teeth: 34, shift: -0.02 },
        planet: Gear { teeth: 31, shift: 0.02 },
        ring: Gear { teeth: 96, shift: 0.02 },
        face_width: 42.0e-3,
    }
}

/// Stiffnesses of the reference stage that the paper leaves open, N/m; rotations on `u = r θ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceStiffness {
    /// Sun mesh.
    pub sun_mesh: f64,
    /// Ring mesh.
    pub ring_mesh: f64,
    /// Planet bearing.
    pub planet_bearing: f64,
    /// Sun support.
    pub sun: f64,
    /// Ring support.
    pub ring: f64,
    /// Sun rotation to ground (input shaft).
    pub sun_rotation: f64,
    /// Carrier rotation to ground (output shaft).
    pub carrier_rotation: f64,
    /// Ring rotation to ground.
    pub ring_rotation: f64,
    /// Rotary mass `I_c/r_c²` of the carrier with its rigidly coupled output, kg.
    pub carrier_rotary_mass: f64,
}

impl ReferenceStiffness {
    /// Mesh stiffnesses from ISO 6336-1 method B at low load, rounded; the rest identified from the paper's natural
    /// frequencies (412, 889, 919, 1046, 1791 Hz) and mean mesh force (774 N); the ring's rotation all but fixed.
    pub const DEFAULT: Self = Self {
        sun_mesh: 5.5e8,
        ring_mesh: 6.7e8,
        planet_bearing: 9.57e7,
        sun: 5.0e5,
        ring: 9.70e8,
        sun_rotation: 2.4e7,
        carrier_rotation: 5.0e8,
        ring_rotation: 1.0e10,
        carrier_rotary_mass: 20.0,
    };

    /// The set that meets all five of the paper's frequencies, with a mesh 4.4 times softer than ISO 6336 gives.
    pub const EXACT_FREQUENCIES: Self = Self {
        sun_mesh: 1.9091e8,
        ring_mesh: 1.9091e8,
        planet_bearing: 1.0008e8,
        sun: 0.0,
        ring: 1.9207e9,
        sun_rotation: 5.09e7,
        carrier_rotation: 9.45e10,
        ring_rotation: 5.06e8,
        carrier_rotary_mass: 3.5,
    };
}

/// Damping of the reference stage that the paper leaves open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceDamping {
    /// Ratio ζ_b of supports and planet bearings.
    pub supports: f64,
    /// Ratio of the sun's rotation.
    pub sun_rotation: f64,
    /// Viscous damping of each planet's rotation, N s/m.
    pub planet_rotation: f64,
    /// Ratio of the meshes; linear laws only.
    pub mesh: f64,
}

impl ReferenceDamping {
    /// Identified from the paper's contact-loss fractions under light load; the mesh ratio is an engineering value.
    pub const DEFAULT: Self = Self { supports: 0.0972, sun_rotation: 0.40, planet_rotation: 158.7, mesh: 0.05 };
    /// Identified from the order of the paper's floating regimes (regular, quasi-periodic, irregular with speed).
    pub const FLOAT: Self = Self { supports: 0.05, sun_rotation: 0.2, planet_rotation: 80.0, mesh: 0.05 };
}

/// Masses, kg, and moments of inertia, kg m² (the paper, table 1).
const SUN_INERTIA: (f64, f64) = (2.7, 0.008);
const PLANET_INERTIA: (f64, f64) = (2.5, 0.007);
const RING_INERTIA: (f64, f64) = (5.3, 0.178);

/// Density of steel, kg/m³.
const STEEL_DENSITY: f64 = 7850.0;

/// Restitution entered in the law of Lankarani & Nikravesh (identified), speed floor and first speed, m/s.
const RESTITUTION: f64 = 0.743;
const SPEED_FLOOR: f64 = 1.0e-4;
const INITIAL_SPEED: f64 = 1.0e-2;

/// Drag torque at the output: constant, N m, and per sun speed, N m/(rev/min) (identified).
const DRAG: f64 = 1.566_790_503_528_166_2;
const DRAG_PER_RPM: f64 = 0.048_381_113_350_704_91;

/// Errors as (amplitude m, phase rad) of harmonics 1, 2, … (identified, light load: from contact-loss fractions; heavy
/// load: from the harmonics of the mesh forces, least amplitudes).
const LIGHT_SUN_ERROR: [(f64, f64); 2] =
    [(2.906_48e-6, 1.187_522_023_056_941_9), (1.662_506_56e-6, 0.491_858_738_934_297_43)];
const LIGHT_RING_ERROR: [(f64, f64); 2] = [(1.88e-6, 0.0), (1.075_36e-6, 4.4)];
const HEAVY_SUN_ERROR: [(f64, f64); 4] = [(7.99e-6, 0.736), (2.29e-6, 0.67), (6.62e-6, 1.258), (2.55e-6, 2.185)];
const HEAVY_RING_ERROR: [(f64, f64); 4] = [(0.55e-6, 4.279), (1.64e-6, 1.937), (2.49e-6, 2.608), (0.16e-6, 5.226)];

fn harmonics(table: &[(f64, f64)]) -> Vec<MeshHarmonic> {
    table
        .iter()
        .enumerate()
        .map(|(i, &(amplitude, phase))| MeshHarmonic { order: (i + 1) as f64, amplitude, phase })
        .collect()
}

/// Linear, constant mesh stiffness, no error: the reference stage as a structure, equally spaced planets, phases 0.
///
/// # Errors
/// [`GeometryError`] never in fact: the gears are given.
pub fn reference(stiffness: &ReferenceStiffness, damping: &ReferenceDamping) -> Result<Planetary, GeometryError> {
    let gears = reference_geometry();
    let (sun_mesh, ring_mesh) = (gears.sun_mesh()?, gears.ring_mesh()?);
    let ratio = |k: f64| Support::ratio(k, damping.supports);
    let [sun_base, planet_base] = sun_mesh.base_radii;
    let sun = Body {
        outer_radius: Some(sun_mesh.tip_radii[0]),
        translation: ratio(stiffness.sun),
        rotation: Support::ratio(stiffness.sun_rotation, damping.sun_rotation),
        ..Body::new(SUN_INERTIA.0, SUN_INERTIA.1, sun_base)
    };
    let planet = Body {
        outer_radius: Some(sun_mesh.tip_radii[1]),
        translation: ratio(stiffness.planet_bearing),
        rotation: Support::viscous(0.0, damping.planet_rotation),
        ..Body::new(PLANET_INERTIA.0, PLANET_INERTIA.1, planet_base)
    };
    // A steel annulus of the ring's mass outside its pitch circle reaches this far.
    let area = RING_INERTIA.0 / (STEEL_DENSITY * gears.face_width);
    let ring_outer = (gears.ring.pitch_radius(&gears.rack).powi(2) + area / std::f64::consts::PI).sqrt();
    let ring = Body {
        outer_radius: Some(ring_outer),
        translation: ratio(stiffness.ring),
        rotation: ratio(stiffness.ring_rotation),
        ..Body::new(RING_INERTIA.0, RING_INERTIA.1, ring_mesh.base_radii[1])
    };
    let centre_distance = sun_mesh.centre_distance;
    let carrier = Body {
        // The paper holds the carrier's centre and gives no mass: taken equal to the rotary mass.
        mass: stiffness.carrier_rotary_mass,
        rotary_mass: stiffness.carrier_rotary_mass,
        rotation: ratio(stiffness.carrier_rotation),
        ..Body::new(1.0, 1.0, centre_distance)
    };
    let planets = equally_spaced(3)
        .into_iter()
        .map(|position| Planet {
            position,
            body: planet,
            sun_mesh: Mesh::bilateral(stiffness.sun_mesh, damping.mesh, [sun.rotary_mass, planet.rotary_mass]),
            ring_mesh: Mesh::bilateral(stiffness.ring_mesh, damping.mesh, [planet.rotary_mass, ring.rotary_mass]),
        })
        .collect();
    Ok(Planetary {
        teeth: gears.teeth(),
        sun_pressure_angle: sun_mesh.pressure_angle,
        ring_pressure_angle: ring_mesh.pressure_angle,
        base_helix: 0.0,
        ring_phase: gears.ring_phase(),
        sun,
        ring,
        carrier,
        planets,
        rpm: 0.0,
        load: Load::default(),
        gyroscopic: false,
    })
}

/// Heavy load: linear meshes that never separate, four error harmonics, meshes in phase, no drag.
///
/// `rpm` of the sun; `output_torque` at the carrier, N m. The paper's case is 500 rev/min, 500 N m.
///
/// # Errors
/// [`GeometryError`] never in fact.
pub fn reference_heavy(rpm: f64, output_torque: f64) -> Result<Planetary, GeometryError> {
    let mut stage = reference(&ReferenceStiffness::DEFAULT, &ReferenceDamping::DEFAULT)?;
    stage.rpm = rpm;
    stage.load.output_torque = output_torque;
    for planet in &mut stage.planets {
        planet.sun_mesh.error = harmonics(&HEAVY_SUN_ERROR);
        planet.ring_mesh.error = harmonics(&HEAVY_RING_ERROR);
    }
    Ok(stage)
}

/// Light load: Hertz contacts with the hysteresis of Lankarani & Nikravesh, two error harmonics, meshes in phase, drag
/// growing with speed. Backlash is taken as never crossed: drive flanks only, deflection counted from contact.
///
/// `rpm` of the sun; `output_torque` at the carrier beside the drag, N m.
///
/// # Errors
/// [`GeometryError`] never in fact.
pub fn reference_light(rpm: f64, output_torque: f64) -> Result<Planetary, GeometryError> {
    light(rpm, output_torque, &ReferenceDamping::DEFAULT, DRAG_PER_RPM)
}

/// Light load with a floating sun: mesh phases from tooth numbers, constant drag only, lighter damping.
///
/// # Errors
/// [`TrainError`] never in fact.
pub fn reference_float(rpm: f64, output_torque: f64) -> Result<Planetary, TrainError> {
    light(rpm, output_torque, &ReferenceDamping::FLOAT, 0.0)?.phased(&Phasing::Teeth)
}

fn light(rpm: f64, torque: f64, damping: &ReferenceDamping, drag_per_rpm: f64) -> Result<Planetary, GeometryError> {
    let mut stage = reference(&ReferenceStiffness::DEFAULT, damping)?;
    stage.rpm = rpm;
    stage.load = Load { output_torque: torque, drag: DRAG, drag_per_rpm, planet_drag: 0.0 };
    let law = Law::Power(PowerLaw {
        exponent: Ratio { p: 3, q: 2 },
        hysteresis: coefficient(Hysteresis::LankaraniNikravesh, RESTITUTION),
        speed_floor: SPEED_FLOOR,
        initial_speed: INITIAL_SPEED,
    });
    let [sun_stiffness, ring_stiffness] = reference_hertz()?;
    for planet in &mut stage.planets {
        let hertz = |stiffness, error: &[(f64, f64)]| Mesh {
            error: harmonics(error),
            ..Mesh::new(law, MeshStiffness::Constant(stiffness))
        };
        planet.sun_mesh = hertz(sun_stiffness, &LIGHT_SUN_ERROR);
        planet.ring_mesh = hertz(ring_stiffness, &LIGHT_RING_ERROR);
    }
    Ok(stage)
}

/// Hertz stiffnesses of the reference stage's sun and ring mesh, N/m^1.5 (the paper's sphere formula; steel).
///
/// # Errors
/// [`GeometryError`] never in fact.
pub fn reference_hertz() -> Result<[f64; 2], GeometryError> {
    let gears = reference_geometry();
    let steel = [Material::STEEL; 2];
    let sun = hertz_stiffness(gears.sun_mesh()?.curvature_radii(), MeshKind::External, steel);
    let ring = hertz_stiffness(gears.ring_mesh()?.curvature_radii(), MeshKind::Internal, steel);
    Ok([sun, ring])
}

/// The stage of Lin & Parker (J. Vib. Acoust. 121, 1999, 316) with `planets` equally spaced planets, ≥ 1; their tables
/// use all freedoms of `Freedoms::FullCarrier`. No damping, error or load.
///
/// The paper gives rotary masses only: radii are 1 m here, so that a torque in N m reads as a force in N, and tooth
/// numbers (27/35/99, usual for this stage) set no more than a mesh frequency, should a speed be given.
#[must_use]
pub fn lin_parker(planets: usize) -> Planetary {
    let body = |mass: f64, rotary_mass: f64, translation: f64, rotation: f64| Body {
        translation: Support::viscous(translation, 0.0),
        rotation: Support::viscous(rotation, 0.0),
        ..Body::new(mass, rotary_mass, 1.0)
    };
    let (bearing, mesh) = (1.0e8, 5.0e8);
    let planet = body(0.66, 0.61, bearing, 0.0);
    let (sun, ring) = (body(0.4, 0.39, bearing, 0.0), body(2.35, 3.0, bearing, 1.0e9));
    Planetary {
        teeth: Teeth { sun: 27, planet: 35, ring: 99 },
        sun_pressure_angle: 24.6f64.to_radians(),
        ring_pressure_angle: 24.6f64.to_radians(),
        base_helix: 0.0,
        ring_phase: 0.0,
        sun,
        ring,
        carrier: body(5.43, 6.29, bearing, 0.0),
        planets: equally_spaced(planets)
            .into_iter()
            .map(|position| Planet {
                position,
                body: planet,
                sun_mesh: Mesh::bilateral(mesh, 0.0, [sun.rotary_mass, planet.rotary_mass]),
                ring_mesh: Mesh::bilateral(mesh, 0.0, [planet.rotary_mass, ring.rotary_mass]),
            })
            .collect(),
        rpm: 0.0,
        load: Load::default(),
        gyroscopic: false,
    }
}
