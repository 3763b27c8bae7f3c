//! A planetary stage: sun, N planets on a carrier, ring; the sun drives, the carrier delivers.
//!
//! Frame: turning with the carrier at its mean speed. Planet i sits at ψ_i, its coordinates radial (ξ) and
//! tangential (η); rotations `u = r θ` counter-clockwise positive; α the working pressure angle of the mesh:
//!
//! ```text
//! δ_sun,i  = −x_s sin(ψ_i − α) + y_s cos(ψ_i − α) + u_s − ξ_i sin α − η_i cos α + u_i − e
//! δ_ring,i = −x_r sin(ψ_i + α) + y_r cos(ψ_i + α) + u_r + ξ_i sin α − η_i cos α − u_i − e
//! bearing:  ξ_i − x_c cos ψ_i − y_c sin ψ_i,      η_i − u_c + x_c sin ψ_i − y_c cos ψ_i
//! ```
//!
//! ```
//! use flank::{scene::Scene, system::bonded_modes};
//!
//! let stage = r#"{ "flank": 1, "train": { "kind": "planetary", "preset": "lin-parker" }, "run": { "t_end_s": 1 } }"#;
//! let hertz = bonded_modes(&Scene::from_json(stage, "lin-parker")?.build()?.spec)?.hertz();
//! assert!((hertz[1] - 743.2).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The kinematics are those of Lin & Parker, J. Vib. Acoust. 121 (1999).

mod assemble;
mod family;
mod freedoms;
mod stage;
mod warning;

use std::f64::consts::TAU;

pub use family::{Family, FamilyError, FamilyModes, families};
pub use freedoms::Freedoms;
pub use stage::StageGeometry;
pub use warning::Warning;

use super::body::Body;
use super::error::TrainError;
use super::mesh::Mesh;
use crate::gear::phase::{equally_spaced, nearest_assemblable, ring_phases, sun_phases};

/// Tooth numbers of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Teeth {
    /// Sun Z_s, > 0.
    pub sun: u32,
    /// Planets Z_p, > 0.
    pub planet: u32,
    /// Ring Z_r, > 0.
    pub ring: u32,
}

impl Teeth {
    /// Speed ratio sun to carrier with the ring held, `i = 1 + Z_r/Z_s`.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        1.0 + f64::from(self.ring) / f64::from(self.sun)
    }

    /// Mesh frequency with the ring held, `f_m = (n/60) Z_s Z_r/(Z_s + Z_r)`, Hz; `rpm` n of the sun.
    #[must_use]
    pub fn mesh_frequency(&self, rpm: f64) -> f64 {
        let (sun, ring) = (f64::from(self.sun), f64::from(self.ring));
        rpm / 60.0 * sun * ring / (sun + ring)
    }

    /// Carrier speed with the ring held, `ω_c = (2π n/60) Z_s/(Z_s + Z_r)`, rad/s; `rpm` n of the sun.
    #[must_use]
    pub fn carrier_speed(&self, rpm: f64) -> f64 {
        TAU * rpm / 60.0 / self.ratio()
    }
}

/// One planet and its two meshes.
#[derive(Clone, Debug, PartialEq)]
pub struct Planet {
    /// Position ψ on the carrier, rad, counter-clockwise from x.
    pub position: f64,
    /// The planet, radius = base radius; its `translation` is the bearing on the carrier.
    pub body: Body,
    /// Mesh with the sun.
    pub sun_mesh: Mesh,
    /// Mesh with the ring.
    pub ring_mesh: Mesh,
}

/// Loads of the stage. The drag torque is a load at the output: `T_out = torque + drag + drag_per_rpm · n`, and the input torque is `T_in =
/// T_out/i`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Load {
    /// Torque taken off at the carrier, N m.
    pub output_torque: f64,
    /// Constant drag torque at the carrier, N m.
    pub drag: f64,
    /// Drag torque at the carrier per sun speed, N m/(rev/min).
    pub drag_per_rpm: f64,
    /// Drag force D against each planet's rotation on its base circle, N: it acts towards +u.
    pub planet_drag: f64,
}

impl Load {
    /// Total torque at the carrier, drag included, N m; `rpm` of the sun.
    #[must_use]
    pub fn total_output(&self, rpm: f64) -> f64 {
        self.output_torque + self.drag + self.drag_per_rpm * rpm
    }
}

/// A planetary stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Planetary {
    /// Tooth numbers.
    pub teeth: Teeth,
    /// Working pressure angle of the sun meshes, rad, `[0, π/2)`.
    pub sun_pressure_angle: f64,
    /// Working pressure angle of the ring meshes, rad, `[0, π/2)`.
    pub ring_pressure_angle: f64,
    /// Base helix angle β_b of the meshes, rad: deflections along the normal of the teeth are `cos β_b` times those of spur gears.
    pub base_helix: f64,
    /// Phase between the two meshes of a planet γ_rs, periods; [`Phasing::Teeth`] reads it.
    pub ring_phase: f64,
    /// The sun, radius = base radius.
    pub sun: Body,
    /// The ring, radius = base radius.
    pub ring: Body,
    /// The carrier, radius = centre distance. Its mass and `translation` count only where x_c and y_c are free.
    pub carrier: Body,
    /// The planets, at least one.
    pub planets: Vec<Planet>,
    /// Sun speed n, rev/min, ≥ 0.
    pub rpm: f64,
    /// The load.
    pub load: Load,
    /// True if Coriolis terms `2 m ω_c (−ẏ, ẋ)` and centripetal terms `−m ω_c² (x, y)` of the turning frame act. The constant centrifugal
    /// pull on the planets is omitted, as it only shifts their rest position.
    pub gyroscopic: bool,
}

/// Source of the mesh phases.
#[derive(Clone, Debug, PartialEq)]
pub enum Phasing {
    /// From tooth numbers, the planets' positions as they are, and γ_rs.
    Teeth,
    /// Planets moved to the assemblable positions nearest to equal spacing, then as [`Phasing::Teeth`].
    Assemblable,
    /// All phases zero, γ_rs included (it is then part of the errors' phases).
    InPhase,
    /// Given phases, periods, one for each planet.
    Explicit {
        /// Sun meshes.
        sun: Vec<f64>,
        /// Ring meshes, γ_rs included.
        ring: Vec<f64>,
    },
}

impl Planetary {
    /// The planets' positions ψ, rad.
    #[must_use]
    pub fn positions(&self) -> Vec<f64> {
        self.planets.iter().map(|planet| planet.position).collect()
    }

    /// Sets the mesh phases of the stage (and for [`Phasing::Assemblable`] the positions of its planets).
    ///
    /// # Errors
    /// [`TrainError::Phases`] if explicit phases do not match the number of planets.
    pub fn phased(mut self, phasing: &Phasing) -> Result<Self, TrainError> {
        let planets = self.planets.len();
        if *phasing == Phasing::Assemblable {
            let even = equally_spaced(planets);
            let positions = nearest_assemblable(self.teeth.sun, self.teeth.ring, &even);
            self.planets.iter_mut().zip(positions).for_each(|(planet, psi)| planet.position = psi);
        }
        let (sun, ring) = match phasing {
            Phasing::Teeth | Phasing::Assemblable => {
                let positions = self.positions();
                (sun_phases(self.teeth.sun, &positions), ring_phases(self.teeth.ring, &positions, self.ring_phase))
            }
            Phasing::InPhase => (vec![0.0; planets], vec![0.0; planets]),
            Phasing::Explicit { sun, ring } => (sun.clone(), ring.clone()),
        };
        for got in [sun.len(), ring.len()] {
            if got != planets {
                return Err(TrainError::Phases { planets, got });
            }
        }
        for (planet, (sun, ring)) in self.planets.iter_mut().zip(sun.into_iter().zip(ring)) {
            planet.sun_mesh.phase = sun;
            planet.ring_mesh.phase = ring;
        }
        Ok(self)
    }

    /// Mesh frequency f_m, Hz.
    #[must_use]
    pub fn mesh_frequency(&self) -> f64 {
        self.teeth.mesh_frequency(self.rpm)
    }

    /// Mean carrier speed ω_c, rad/s.
    #[must_use]
    pub fn carrier_speed(&self) -> f64 {
        self.teeth.carrier_speed(self.rpm)
    }

    /// Torque on the sun, `T_in = T_out/i`, N m, drag included.
    #[must_use]
    pub fn input_torque(&self) -> f64 {
        self.load.total_output(self.rpm) / self.teeth.ratio()
    }
}
