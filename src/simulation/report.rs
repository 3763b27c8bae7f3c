//! Contents of a scene: speeds, meshes, modes beside the orders that excite them.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use super::Simulation;
use crate::system::{bonded_modes, contact_mode};

/// Harmonics of a mesh frequency that are listed.
const HARMONICS: u32 = 5;
/// Freedoms that name a mode.
const NAMED: usize = 3;
/// Least share of the kinetic energy of a freedom that names a mode.
const SHARE: f64 = 0.05;

/// Contents of a scene, as `flank check --json` writes them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Name of the scene.
    pub name: String,
    /// Kind of its train.
    pub kind: String,
    /// SHA-256 of the resolved scene.
    pub sha256: Option<String>,
    /// Names of the freedoms.
    pub freedoms: Vec<String>,
    /// Tells that all numbers are in dimensionless form, without the units of their keys.
    pub is_dimensionless: bool,
    /// Length of a cycle, s.
    pub cycle_s: Option<f64>,
    /// Cycles after which all that is forced repeats, if it does.
    pub common_cycle: Option<u64>,
    /// Mean speeds of the shafts of a gearbox.
    pub speeds: Vec<Speed>,
    /// Meshes whose teeth are given.
    pub meshes: Vec<MeshOfTeeth>,
    /// Contacts.
    pub contacts: Vec<ContactAtStart>,
    /// Natural modes, every contact closed at its mean stiffness; those of laws that are not linear are orders of magnitude.
    pub modes: Vec<Mode>,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// Mean speed of a shaft or a loose gear.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Speed {
    /// Its name.
    pub name: String,
    /// Speed, rev/min, counter-clockwise positive.
    pub speed_rpm: f64,
    /// Frequency of its rotation, Hz.
    pub frequency_hz: f64,
}

/// A mesh with its clock and its geometry.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshOfTeeth {
    /// Its name.
    pub name: String,
    /// Mesh frequency, Hz.
    pub frequency_hz: f64,
    /// Mesh phases, periods, one for each of its contacts.
    pub phases: Vec<f64>,
    /// Transverse contact ratio; none where the rack is a guess.
    pub contact_ratio: Option<f64>,
    /// Overlap ratio.
    pub overlap_ratio: Option<f64>,
    /// Working pressure angle in the transverse plane, degrees.
    pub working_angle_deg: Option<f64>,
    /// Centre distance, m.
    pub centre_distance_m: Option<f64>,
    /// Base radii, m.
    pub base_radii_m: Option<[f64; 2]>,
}

/// A contact and how it starts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactAtStart {
    /// Its name.
    pub name: String,
    /// Half the total backlash, m.
    pub half_backlash_m: f64,
    /// Mean stiffness, N/m (of a power law of exponent n N/mⁿ).
    pub mean_stiffness: f64,
    /// Its mode at the start; none if the scene has no start that fits.
    pub starts: Option<String>,
}

/// A natural mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mode {
    /// Natural frequency, Hz; in dimensionless form rad per unit of time.
    pub frequency_hz: f64,
    /// Freedoms with the largest shares of its kinetic energy.
    pub moves: Vec<Share>,
    /// The nearest order of what excites it.
    pub nearest: Option<Order>,
}

/// Share of a freedom in the kinetic energy of a mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The freedom.
    pub freedom: String,
    /// Share, `[0, 1]`.
    pub share: f64,
}

/// A frequency that excites a train.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Order {
    /// Mesh, shaft or load that excites, with its order.
    pub of: String,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Its distance from the mode, relative to the mode.
    pub apart: f64,
}

impl Simulation {
    /// Returns the contents of the scene.
    #[must_use]
    pub fn report(&self) -> Report {
        let spec = self.structure.spec();
        let start = self.start().ok();
        let contacts = spec.contacts.iter().enumerate().map(|(j, contact)| ContactAtStart {
            name: contact.name.clone(),
            half_backlash_m: contact.half_backlash,
            mean_stiffness: contact.stiffness.mean(),
            starts: start.as_ref().map(|start| contact_mode(&start.jump.mode, j).name().to_owned()),
        });
        let speeds = self.speeds.iter().map(|(name, speed)| Speed {
            name: name.clone(),
            speed_rpm: speed * 30.0 / PI,
            frequency_hz: speed.abs() / TAU,
        });
        let meshes = self.meshes.iter().map(|mesh| {
            let geometry = mesh.is_given.then_some(&mesh.geometry);
            MeshOfTeeth {
                name: mesh.name.clone(),
                frequency_hz: mesh.frequency,
                phases: mesh.phases.clone(),
                contact_ratio: geometry.map(|g| g.path.contact_ratio()),
                overlap_ratio: geometry.map(|g| g.path.overlap),
                working_angle_deg: geometry.map(|g| g.pressure_angle.to_degrees()),
                centre_distance_m: geometry.map(|g| g.centre_distance),
                base_radii_m: geometry.map(|g| g.base_radii),
            }
        });
        Report {
            name: self.name.clone(),
            kind: self.kind().to_owned(),
            sha256: self.hash(),
            freedoms: spec.freedoms.clone(),
            is_dimensionless: self.dimensionless,
            cycle_s: self.settings.period,
            common_cycle: self.structure.common_cycle().ok(),
            speeds: speeds.collect(),
            meshes: meshes.collect(),
            contacts: contacts.collect(),
            modes: self.modes(),
            warnings: self.warnings_in_words(),
        }
    }

    fn modes(&self) -> Vec<Mode> {
        let spec = self.structure.spec();
        let Ok(modes) = bonded_modes(spec) else { return vec![] };
        let orders = self.orders();
        let momenta = &spec.mass * &modes.shapes;
        let frequencies = if self.dimensionless { modes.omega.clone() } else { modes.hertz() };
        let mode = |(k, frequency): (usize, f64)| {
            let share = |i: usize| modes.shapes[(i, k)] * momenta[(i, k)];
            let mut moves: Vec<Share> = (0..spec.freedoms.len())
                .map(|i| Share { freedom: spec.freedoms[i].clone(), share: share(i) })
                .collect();
            moves.sort_by(|a, b| b.share.total_cmp(&a.share));
            moves.truncate(NAMED);
            moves.retain(|one| one.share >= SHARE);
            let apart = |hz: f64| (hz - frequency).abs() / frequency;
            let nearest = orders.iter().min_by(|a, b| apart(a.1).total_cmp(&apart(b.1))).filter(|_| frequency > 0.0);
            let nearest = nearest.map(|(of, hz)| Order { of: of.clone(), frequency_hz: *hz, apart: apart(*hz) });
            Mode { frequency_hz: frequency, moves, nearest }
        };
        frequencies.into_iter().enumerate().map(mode).collect()
    }

    /// All that excites: harmonics of the meshes, rotations of the shafts, loads, with their frequencies, Hz.
    fn orders(&self) -> Vec<(String, f64)> {
        let meshes = self.meshes.iter().filter(|mesh| mesh.frequency > 0.0).flat_map(|mesh| {
            (1..=HARMONICS).map(move |n| (format!("{} x {n}", mesh.name), f64::from(n) * mesh.frequency))
        });
        let shafts = self.speeds.iter().filter(|(_, speed)| *speed != 0.0);
        let shafts = shafts.map(|(name, speed)| (format!("{name} x 1"), speed.abs() / TAU));
        let loads = &self.structure.spec().load_harmonics;
        let loads = loads.iter().enumerate().map(|(i, load)| (format!("load {}", i + 1), load.omega / TAU));
        let all = meshes.chain(shafts).chain(loads);
        if self.dimensionless { all.map(|(name, hz)| (name, hz * TAU)).collect() } else { all.collect() }
    }
}
