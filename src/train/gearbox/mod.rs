//! A gearbox: shafts with gears, meshes between the gears, springs between the shafts.
//!
//! A shaft turns about a fixed axis, or is carried around by another shaft, as planets are by their carrier. Rotations are counted as
//! `u = r θ`, counter-clockwise positive, with one radius r for each shaft. The first gear of a mesh drives: where it pushes forward,
//! the drive flank is in contact.
//!
//! ```
//! use flank::scene::Scene;
//!
//! let text = r#"{ "flank": 1,
//!     "train": { "kind": "gearbox",
//!         "rack": { "module_m": 0.003, "pressure_angle_deg": 20 },
//!         "mesh": { "law": { "kind": "kelvin-voigt" }, "stiffness": 3e8, "total_backlash_m": 1e-4 },
//!         "shafts": [
//!             { "name": "in", "speed_rpm": 3000, "torque_nm": 60, "inertia_kg_m2": 0.0018, "gears": [{ "name": "a", "teeth": 30 }] },
//!             { "name": "out", "torque_nm": "balance", "inertia_kg_m2": 0.0085, "gears": [{ "name": "b", "teeth": 45 }] }],
//!         "meshes": [{ "gears": ["a", "b"] }] },
//!     "run": { "cycles": 10 } }"#;
//! let spec = Scene::from_json(text, "pair")?.build()?.spec;
//! assert_eq!(spec.freedoms, ["u_in", "u_out"]);
//! assert_eq!(spec.contacts[0].name, "a-b");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod kinematics;
mod layout;
mod loads;
mod phases;

pub use layout::{Layout, PlacedMesh};

use super::Support;
use crate::gear::{BasicRack, Gear, Harmonic, MeshKind};

/// Hand of a helix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    /// Right: seen along the axis, the teeth turn counter-clockwise as they come nearer.
    Right,
    /// Left.
    Left,
}

impl Hand {
    fn other(self) -> Self {
        if self == Self::Right { Self::Left } else { Self::Right }
    }
}

/// Torque that a shaft receives from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Torque {
    /// Given, N m: positive drives, negative brakes.
    Given(f64),
    /// The torque that keeps the mean speed.
    Balance,
}

/// Friction torque against a rotation, `T₀ + c ω`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drag {
    /// Constant part T₀, N m, ≥ 0.
    pub constant: f64,
    /// Viscous part c, N m s/rad, ≥ 0.
    pub viscous: f64,
}

/// A harmonic of the rotation of a shaft, `a cos(k θ + φ)` with its mean angle θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Order k, > 0: ½ acts every second turn.
    pub order: f64,
    /// Amplitude a.
    pub amplitude: Amplitude,
    /// Phase φ, rad.
    pub phase: f64,
}

/// Quantity of an order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amplitude {
    /// Torque, N m, positive in the direction of the mean rotation.
    Torque(f64),
    /// Angle, rad.
    Angle(f64),
    /// Speed, rad/s.
    Speed(f64),
    /// Angular acceleration, rad/s².
    Acceleration(f64),
}

/// A shaft.
#[derive(Clone, Debug, PartialEq)]
pub struct Shaft {
    /// Name.
    pub name: String,
    /// Centre in the plane, m, where it is given.
    pub position: Option<[f64; 2]>,
    /// The shaft that carries it around, and its position ψ there, rad.
    pub carried: Option<(usize, f64)>,
    /// Error of the position of its axis, m, along x and y; for a carried shaft radial and tangential.
    pub offset: [f64; 2],
    /// True if the shaft stands still on average.
    pub is_fixed: bool,
    /// Mean speed, rev/min, counter-clockwise positive, where it is given.
    pub rpm: Option<f64>,
    /// Mass of the shaft alone, kg.
    pub mass: f64,
    /// Moment of inertia of the shaft alone, kg m².
    pub inertia: f64,
    /// Radius for its rotation, m, where it is given.
    pub radius: Option<f64>,
    /// Bearing of its centre; without one the centre is fixed.
    pub translation: Option<Support>,
    /// Bearing along the axis; without one the shaft is fixed there.
    pub axial: Option<Support>,
    /// Spring and damper that hold its rotation about the mean one: N m/rad, N m s/rad.
    pub rotation: Support,
    /// External torque.
    pub torque: Torque,
    /// Friction in its bearings, against the frame or what carries it.
    pub drag: Drag,
    /// Torques by order.
    pub orders: Vec<Order>,
    /// Given motion, if any; the rotation is then no degree of freedom.
    pub motion: Vec<Order>,
}

/// A gear on a shaft.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaftGear {
    /// Name.
    pub name: String,
    /// Number of the shaft.
    pub shaft: usize,
    /// True if the gear turns freely on the shaft.
    pub is_loose: bool,
    /// True if the gear is a ring.
    pub is_ring: bool,
    /// Teeth.
    pub teeth: Gear,
    /// Hand of its teeth, where it is given.
    pub hand: Option<Hand>,
    /// Mass, kg.
    pub mass: f64,
    /// Moment of inertia, kg m².
    pub inertia: f64,
    /// Friction against the shaft of a loose gear, else against the frame.
    pub drag: Drag,
    /// Eccentricity of its teeth, m, and its direction at time 0, rad.
    pub eccentricity: (f64, f64),
    /// Angle of a tooth (of a ring: of a space) on its shaft, rad, where it is given.
    pub tooth_angle: Option<f64>,
}

/// Two gears in mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct GearMesh {
    /// Name.
    pub name: String,
    /// Numbers of the driving and of the driven gear.
    pub gears: [usize; 2],
    /// Rack of both.
    pub rack: BasicRack,
    /// Direction from the centre of the driving gear to that of the driven one, rad, where it is given.
    pub angle: Option<f64>,
    /// Distance of the centres, m; that of the teeth without backlash if left out.
    pub distance: Option<f64>,
    /// Mesh phase, periods, where it is given.
    pub phase: Option<f64>,
}

/// Springs and dampers between two shafts.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// Name.
    pub name: String,
    /// Numbers of the shafts.
    pub shafts: [usize; 2],
    /// Between the rotations: N m/rad, N m s/rad.
    pub rotation: Option<Support>,
    /// Between the centres.
    pub translation: Option<Support>,
    /// Along the axis.
    pub axial: Option<Support>,
}

/// Shafts, gears, meshes and couplings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gearbox {
    /// Shafts.
    pub shafts: Vec<Shaft>,
    /// Gears.
    pub gears: Vec<ShaftGear>,
    /// Meshes.
    pub meshes: Vec<GearMesh>,
    /// Couplings.
    pub couplings: Vec<Coupling>,
    /// Pairs of shafts with one axis.
    pub coaxial: Vec<[usize; 2]>,
}

/// A part of a gearbox, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A shaft.
    Shaft(usize),
    /// A gear.
    Gear(usize),
    /// A mesh.
    Mesh(usize),
    /// A coupling.
    Coupling(usize),
    /// The whole train.
    Train,
}

/// A fault of a gearbox.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GearboxFault {
    /// Part at fault.
    pub part: Part,
    /// Key at fault, if any.
    pub key: &'static str,
    /// The value or fact found there.
    pub found: String,
    /// The range or facts allowed.
    pub allowed: String,
    /// The remedy.
    pub remedy: String,
}

impl GearboxFault {
    fn new(
        part: Part,
        key: &'static str,
        found: impl Into<String>,
        allowed: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { part, key, found: found.into(), allowed: allowed.into(), remedy: remedy.into() }
    }
}

impl GearMesh {
    /// Numbers of pinion and wheel: a ring is the wheel.
    fn pair(&self, gears: &[ShaftGear]) -> [usize; 2] {
        let [driving, driven] = self.gears;
        if gears[driving].is_ring { [driven, driving] } else { [driving, driven] }
    }

    fn kind(&self, gears: &[ShaftGear]) -> MeshKind {
        if self.gears.iter().any(|gear| gears[*gear].is_ring) { MeshKind::Internal } else { MeshKind::External }
    }
}

impl Order {
    /// Returns the harmonic of the angle, rad, of a shaft at speed ω, rad/s; for a torque the harmonic itself, N m.
    fn harmonic(&self, omega: f64) -> Harmonic {
        use std::f64::consts::{FRAC_PI_2, PI};
        let (amplitude, lead) = match self.amplitude {
            Amplitude::Torque(amplitude) | Amplitude::Angle(amplitude) => (amplitude, 0.0),
            Amplitude::Speed(amplitude) => (amplitude / omega, -FRAC_PI_2),
            Amplitude::Acceleration(amplitude) => (amplitude / (omega * omega), PI),
        };
        Harmonic { omega, amplitude, phase: self.phase + lead }
    }
}
