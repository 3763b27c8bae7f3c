//! Contents of a scene: speeds, meshes, and modes with the orders that excite them.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use super::Simulation;
use crate::{
    hybrid::ContactView,
    linalg::multiplicities,
    output::{Table, five_digits as number},
    system::{ContactSpec, Flanks, bonded_modes},
};

/// Harmonics of a mesh frequency that are listed.
const HARMONICS: u32 = 5;
/// Freedoms that name a mode.
const NAMED: usize = 3;
/// Least share of the kinetic energy of a freedom that names a mode.
const SHARE: f64 = 0.05;
/// Frequencies closer than this, relative, are one.
const SAME: f64 = 1e-9;

/// Contents of a scene, in the form of `flank check --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Name of the scene.
    pub name: String,
    /// Kind of its train.
    pub kind: String,
    /// SHA-256 of the resolved scene.
    pub sha256: Option<String>,
    /// Names of the freedoms.
    pub freedoms: Vec<String>,
    /// True if all numbers are in dimensionless form, without the units of their keys.
    pub is_dimensionless: bool,
    /// Length of a cycle, s.
    pub cycle_s: Option<f64>,
    /// Cycles after which all forcing repeats, if it does.
    pub common_cycle: Option<u64>,
    /// Mean speeds of the shafts of a gearbox.
    pub speeds: Vec<Speed>,
    /// Meshes whose teeth are given.
    pub meshes: Vec<MeshOfTeeth>,
    /// Contacts.
    pub contacts: Vec<ContactAtStart>,
    /// Natural modes, every contact closed at its mean stiffness; those of nonlinear laws are orders of magnitude.
    pub modes: Vec<Mode>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Remarks: fit of series to measured curves.
    pub remarks: Vec<String>,
}

/// Mean speed of a shaft or a loose gear.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Speed {
    /// Its name.
    pub name: String,
    /// Speed, rev/min, counter-clockwise positive.
    pub speed_rpm: f64,
    /// Frequency of its rotation, Hz.
    pub frequency_hz: f64,
}

/// Mesh with its frequency and its geometry.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MeshOfTeeth {
    /// Its name.
    pub name: String,
    /// Mesh frequency, Hz.
    pub frequency_hz: f64,
    /// Mesh phases, periods, one for each of its contacts.
    pub phases: Vec<f64>,
    /// Transverse contact ratio; none if the rack is a guess.
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

/// Contact and its start.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ContactAtStart {
    /// Its name.
    pub name: String,
    /// Half the total backlash, m.
    pub half_backlash_m: f64,
    /// Mean stiffness, N/m (of a power law of exponent n N/mⁿ).
    pub mean_stiffness: f64,
    /// Its law, in words.
    pub law: &'static str,
    /// Modes of the contact.
    pub modes: String,
    /// Guards of the contact.
    pub guards: String,
    /// Mode at the start; none if the scene has no start that fits.
    pub starts: Option<String>,
}

/// A natural mode.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Mode {
    /// Natural frequency, Hz; in dimensionless form rad per unit of time.
    pub frequency_hz: f64,
    /// Freedoms with the largest shares of its kinetic energy.
    pub moves: Vec<Share>,
    /// Nearest order of the excitation.
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
#[non_exhaustive]
pub struct Order {
    /// Mesh, shaft or load that excites, with its order.
    pub of: String,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Distance from the mode, relative to the mode.
    pub apart: f64,
}

impl Simulation {
    /// Returns the contents of the scene.
    #[must_use]
    pub fn report(&self) -> Report {
        let spec = self.structure.spec();
        let start = self.start().ok();
        let contacts = spec.contacts.iter().enumerate().map(|(j, contact)| {
            let (law, modes, guards) = automaton(contact);
            ContactAtStart {
                name: contact.name.clone(),
                half_backlash_m: contact.half_backlash,
                mean_stiffness: contact.stiffness.mean(),
                law,
                modes,
                guards,
                starts: start.as_ref().map(|start| self.structure.contact_mode(j, &start.jump.mode).name().to_owned()),
            }
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
            remarks: self.remarks.iter().map(ToString::to_string).collect(),
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

    /// Returns all excitations with their frequencies, Hz: harmonics of the meshes, rotations of the shafts, loads.
    pub(crate) fn orders(&self) -> Vec<(String, f64)> {
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

/// Returns law, modes and guards of a contact, in words.
fn automaton(contact: &ContactSpec) -> (&'static str, String, String) {
    let law = contact.law.words();
    if contact.law.is_bilateral() {
        return (law, "closed".to_owned(), "none".to_owned());
    }
    let can_detach = contact.law.release_damping().is_some() || contact.law.is_latched();
    let (sides, flanks) =
        if contact.flanks == Flanks::Both { ("drive, back", "delta = ±b") } else { ("drive", "delta = b") };
    if contact.law.is_rigid() {
        let where_to = if contact.flanks == Flanks::Both { "resting on either flank" } else { "resting" };
        return (law, format!("separated, {where_to}"), format!("{flanks}; F = 0"));
    }
    match can_detach {
        true => (law, format!("separated, {sides}, detached"), format!("{flanks}; F = 0")),
        false => (law, format!("separated, {sides}"), flanks.to_owned()),
    }
}

impl Report {
    /// Returns tables of the contacts, of the natural frequencies with the nearest excitations, and of the meshes.
    #[must_use]
    pub fn tables(&self) -> Vec<Table> {
        let words = |values: &[f64]| values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ");
        let contacts = self.contacts.iter().map(|c| {
            let [b, stiffness] = [c.half_backlash_m, c.mean_stiffness].map(number);
            let starts = c.starts.clone().unwrap_or_else(|| "-".to_owned());
            vec![c.name.clone(), c.law.to_owned(), b, stiffness, c.modes.clone(), c.guards.clone(), starts]
        });
        let mut tables = vec![
            Table::new(["contact", "law", "b", "mean stiffness", "modes", "guards", "starts"])
                .with(contacts)
                .titled("Contacts, delta positive towards the drive flank", ""),
        ];
        let unit = if self.is_dimensionless { "rad per unit of time" } else { "Hz" };
        let frequencies: Vec<f64> = self.modes.iter().map(|mode| mode.frequency_hz).collect();
        let mut k = 0;
        let modes = multiplicities(&frequencies, SAME).into_iter().map(|(frequency, count)| {
            let mode = &self.modes[k];
            k += count;
            let moves = mode.moves.iter().map(|share| format!("{} {:.0}", share.freedom, 100.0 * share.share));
            let mut row = vec![number(frequency), count.to_string(), moves.collect::<Vec<_>>().join(", ")];
            row.extend(match &mode.nearest {
                Some(order) => [order.of.clone(), number(order.frequency_hz), number(100.0 * order.apart)],
                None => ["-", "-", "-"].map(str::to_owned),
            });
            row
        });
        let is_linear = self.contacts.iter().all(|c| c.law.starts_with("linear") || c.law == "bilateral");
        let note = if is_linear {
            ""
        } else {
            "Laws that are not linear are taken at stiffness K: an order of magnitude at best."
        };
        let head = [unit, "times", "moves, % of its energy", "nearest order", unit, "apart %"];
        let modes = Table::new(head).with(modes);
        if !modes.rows.is_empty() {
            tables.push(modes.titled("Natural frequencies, every contact closed at its mean stiffness", note));
        }
        if !self.speeds.is_empty() {
            let rows = self.speeds.iter().map(|s| vec![s.name.clone(), number(s.speed_rpm), number(s.frequency_hz)]);
            let table = Table::new(["shaft", "rev/min", "Hz"]).with(rows);
            tables.push(table.titled("Speeds, counter-clockwise positive", ""));
        }
        if self.meshes.iter().any(|mesh| mesh.frequency_hz > 0.0) {
            let rows = self.meshes.iter().map(|m| vec![m.name.clone(), number(m.frequency_hz), words(&m.phases)]);
            let table = Table::new(["mesh", "frequency Hz", "phases, periods"]).with(rows);
            tables.push(table.titled("Mesh clocks", ""));
        }
        let geometry = self.meshes.iter().filter_map(|m| {
            let radii = words(&m.base_radii_m?.map(|r| 1e3 * r));
            let distance = m.centre_distance_m.map(|a| 1e3 * a);
            let [angle, distance, ratio, overlap] =
                [m.working_angle_deg, distance, m.contact_ratio, m.overlap_ratio].map(number);
            Some(vec![m.name.clone(), angle, distance, radii, ratio, overlap])
        });
        let geometry: Vec<Vec<String>> = geometry.collect();
        if !geometry.is_empty() {
            let head =
                ["mesh", "working angle deg", "centre distance mm", "base radii mm", "contact ratio", "overlap ratio"];
            tables.push(Table::new(head).with(geometry).titled("Mesh geometry", ""));
        }
        tables
    }
}
