//! Two gears in mesh: their stage, and the rules for values that it does not give.

use super::{
    ledger::{Ledger, Source},
    model::Component,
    quantity::{Unit, given, number},
    teeth::{DEDENDUM, Teeth},
};
use crate::gear::{
    BasicRack, MeshGeometry, MeshKind,
    geometry::{involute, iso_mesh_stiffness},
};

/// Ratio of the module to the usual backlash.
const BACKLASH: f64 = 20.0;
/// Difference below which centre distances are equal, m: files round them.
const SAME_DISTANCE: f64 = 1e-6;
/// Largest difference between a centre distance and that of the teeth, modules: half of the usual backlash opens it by less.
const PLAY: f64 = 0.1;

/// Two gears in mesh, with the places of their numbers in the scene.
pub(super) struct Pair<'a> {
    pub stage: &'a Component,
    pub teeth: [&'a Teeth; 2],
    /// Pointers of the gears, the rack and the keys of the mesh.
    pub gears: [String; 2],
    pub rack: String,
    pub mesh: String,
}

impl Pair<'_> {
    fn kind(&self) -> MeshKind {
        if self.teeth.iter().any(|teeth| teeth.is_ring) { MeshKind::Internal } else { MeshKind::External }
    }

    /// Returns the rack of both gears, and writes it if `is_new`.
    pub fn rack(&self, ledger: &mut Ledger<'_>, is_new: bool) -> Option<BasicRack> {
        let [one, two] = self.teeth;
        let mut same = true;
        let turned = if self.kind() == MeshKind::External { -1.0 } else { 1.0 };
        // A gear without a given helix angle has that of its partner.
        let helix = match [one.has_helix, two.has_helix] {
            [false, true] => [turned * two.helix, two.helix],
            [true, false] => [one.helix, turned * one.helix],
            _ => [one.helix, two.helix],
        };
        for (name, a, b) in [
            ("normal_module", one.module, two.module),
            ("normal_pressure_angle", one.angle, two.angle),
            ("helix_angle_reference_diameter", helix[0].abs(), helix[1].abs()),
        ] {
            if (a - b).abs() > 1e-9 * a.abs().max(b.abs()) {
                same = false;
                let found = format!("{name} {a} of {} and {b} of {}", one.place, two.place);
                ledger.fault(&self.stage.place(), found, "one value for both gears", "mend the file");
            }
        }
        let hands = helix.map(|helix| if helix == 0.0 { 0.0 } else { helix.signum() });
        if hands[0] != turned * hands[1] {
            same = false;
            let found = format!("helix angles {} and {} deg", one.helix, two.helix);
            ledger.fault(
                &self.stage.place(),
                found,
                "opposite hands of two external gears, equal ones with a ring",
                "mend the sign in the file",
            );
        }
        let dedendum = match [&one.dedendum, &two.dedendum] {
            [Some((a, from)), Some((b, _))] if a == b => Some((*a, from.clone())),
            _ => None,
        };
        let rack = BasicRack {
            module: one.module,
            pressure_angle: one.angle.to_radians(),
            helix_angle: helix[0].abs().to_radians(),
            addendum: 1.0,
            dedendum: dedendum.as_ref().map_or(DEDENDUM, |(h, _)| *h),
        };
        if !same || !is_new {
            return same.then_some(rack);
        }
        let from = |name: &str| format!("{}: {name}", one.place);
        ledger.write(&format!("{}/module_m", self.rack), one.module, Source::File, from("normal_module"));
        ledger.write(
            &format!("{}/pressure_angle_deg", self.rack),
            one.angle,
            Source::File,
            from("normal_pressure_angle"),
        );
        if helix[0] != 0.0 {
            ledger.write(
                &format!("{}/helix_angle_deg", self.rack),
                helix[0].abs(),
                Source::File,
                from("helix_angle_reference_diameter"),
            );
            ledger.plain(&format!("{}/hand", self.gears[0]), if helix[0] > 0.0 { "right" } else { "left" });
        }
        let pointer = format!("{}/dedendum", self.rack);
        match dedendum {
            Some((h, from)) => ledger.write(&pointer, h, Source::File, from),
            None => ledger.usual(&pointer, DEDENDUM, "dedendum of both gears, modules"),
        }
        ledger.usual(&format!("{}/addendum", self.rack), 1.0, "addendum, modules: tip circles at m_n (1 + x)");
        Some(rack)
    }

    /// Returns the sum of the profile shifts (of a ring: shift of the ring less that of the pinion) at a centre distance.
    fn sum_of_shifts(&self, rack: &BasicRack, distance: f64) -> Option<f64> {
        let [z1, z2] = self.teeth.map(|teeth| f64::from(teeth.number));
        let z = if self.kind() == MeshKind::External { z1 + z2 } else { (z2 - z1).abs() };
        let angle = rack.transverse_angle();
        let cosine = 0.5 * rack.transverse_module() * z * libm::cos(angle) / distance;
        (cosine < 1.0)
            .then(|| (involute(libm::acos(cosine)) - involute(angle)) * z / (2.0 * libm::tan(rack.pressure_angle)))
    }

    /// Returns the centre distance of the stage, m, with its origin.
    pub fn distance(&self, ledger: &mut Ledger<'_>) -> Option<(f64, String)> {
        given(ledger, self.stage, "center_distance", Unit::Length).filter(|(a, _)| *a > 0.0)
    }

    /// Returns the profile shifts, with the signs of Flank: positive towards thicker spaces for a ring; `known` come from other meshes.
    pub fn shifts(&self, ledger: &mut Ledger<'_>, rack: &BasicRack, known: [Option<f64>; 2]) -> [f64; 2] {
        let distance = self.distance(ledger).map(|(a, _)| a);
        let ring = self.teeth.iter().position(|teeth| teeth.is_ring);
        let sum = distance.and_then(|a| self.sum_of_shifts(rack, a));
        let of_teeth = [0, 1].map(|k| self.teeth[k].shift.as_ref().map(|(x, _)| *x));
        let mut shifts = [0, 1].map(|k| known[k].or(of_teeth[k]));
        // The shift of one gear by the sum and the known shift `x` of the other one.
        let other = |k: usize, x: f64| {
            sum.map(|sum| match ring {
                None => sum - x,
                Some(ring) if ring == k => x - sum,
                Some(_) => sum + x,
            })
        };
        if let (Some(r), [Some(a), Some(b)]) = (ring, shifts)
            && known[r].is_none()
            && let Some(fit) = other(1 - r, [a, b][1 - r])
            && (fit + [a, b][r]).abs() < (fit - [a, b][r]).abs()
        {
            // Some writers count the shift of a ring towards its outside, some towards its centre: the centre distance decides.
            shifts[r] = Some(-[a, b][r]);
            ledger.notes.push(format!(
                "{}: the sign of the profile shift is turned: so it fits the centre distance",
                self.teeth[r].place
            ));
        }
        let free = 0.5
            * rack.transverse_module()
            * match ring {
                None => f64::from(self.teeth[0].number + self.teeth[1].number),
                Some(_) => f64::from(self.teeth[0].number.abs_diff(self.teeth[1].number)),
            };
        let (values, source, from) = match shifts {
            [Some(a), Some(b)] => ([a, b], Source::File, None),
            _ if distance.is_none_or(|a| (a - free).abs() < SAME_DISTANCE)
                && shifts.iter().flatten().all(|x| *x == 0.0) =>
            {
                (
                    [0.0; 2],
                    Source::Rule,
                    Some(if distance.is_some() {
                        "none: the centre distance is that of teeth without shift"
                    } else {
                        "none in the file"
                    }),
                )
            }
            [Some(a), None] => (
                [a, other(0, a).unwrap_or(0.0)],
                Source::Rule,
                Some("from the centre distance and the shift of the other gear"),
            ),
            [None, Some(b)] => (
                [other(1, b).unwrap_or(0.0), b],
                Source::Rule,
                Some("from the centre distance and the shift of the other gear"),
            ),
            [None, None] => {
                let half = 0.5 * sum.unwrap_or(0.0);
                (
                    [
                        if ring == Some(0) {
                            half
                        } else if ring == Some(1) {
                            -half
                        } else {
                            half
                        },
                        half,
                    ],
                    Source::Default,
                    Some("half of the sum that the centre distance gives"),
                )
            }
        };
        for k in 0..2 {
            if known[k].is_some() {
                continue;
            }
            let own = self.teeth[k].shift.as_ref().map(|(_, from)| from.clone());
            let (source, from) = match (own, from) {
                (Some(own), _) => (Source::File, own),
                (None, Some(rule)) => (source, rule.to_owned()),
                (None, None) => continue,
            };
            let pointer = format!("{}/profile_shift", self.gears[k]);
            if source == Source::Default {
                ledger.usual(&pointer, values[k], &from)
            } else {
                ledger.write(&pointer, values[k], source, from)
            }
        }
        values
    }

    /// Writes backlash and stiffness of the mesh.
    pub fn write_mesh(&self, ledger: &mut Ledger<'_>, rack: &BasicRack, shifts: [f64; 2]) {
        let kind = self.kind();
        let [one, two] = [0, 1].map(|k| self.teeth[k].gear(shifts[k]));
        let geometry = MeshGeometry::new(rack, one, two, kind).and_then(|free| match self.distance(ledger) {
            Some((a, _)) if (a - free.centre_distance).abs() > PLAY * rack.module => {
                ledger.fault(
                    &format!("{}: center_distance", self.stage.place()),
                    format!("{a:.6} m"),
                    &format!("the {:.6} m of the teeth, to {PLAY} of a module", free.centre_distance),
                    "mend tooth numbers, profile shifts or the distance in the file",
                );
                Ok(free)
            }
            Some((a, _)) => MeshGeometry::at_distance(rack, one, two, kind, a),
            None => Ok(free),
        });
        let geometry = match geometry {
            Ok(geometry) => geometry,
            Err(error) => {
                return ledger.fault(&self.stage.place(), error.to_string(), "two gears that mesh", "mend the file");
            }
        };
        let limits = ["minimum_normal_backlash", "maximum_normal_backlash"]
            .map(|name| number(ledger, self.stage, name, Unit::Length));
        let pointer = format!("{}/total_backlash_m", self.mesh);
        match limits {
            [Some(least), Some(most)] => {
                let from =
                    format!("{}: mean of minimum_normal_backlash and maximum_normal_backlash", self.stage.place());
                ledger.write(&pointer, 0.5 * (least + most), Source::Rule, from);
            }
            [Some(one), None] | [None, Some(one)] => {
                ledger.write(
                    &pointer,
                    one,
                    Source::File,
                    format!("{}: the one limit of its normal backlash", self.stage.place()),
                );
            }
            [None, None] => ledger.usual(&pointer, rack.module / BACKLASH, "normal backlash: 0.05 modules"),
        }
        let ratio = given(ledger, self.stage, "radial_contact_ratio", Unit::One);
        let tips = self.teeth.iter().all(|teeth| teeth.tip.is_some());
        let by_tips = tips.then(|| self.ratio_of_tips(ledger, rack, &geometry, shifts)).flatten();
        let pointer = format!("{}/stiffness/contact_ratio", self.mesh);
        let ratio = match (ratio, by_tips) {
            (Some((ratio, from)), _) if (1.0..4.0).contains(&ratio) => {
                ledger.write(&pointer, ratio, Source::File, from);
                ratio
            }
            (_, Some(ratio)) => {
                ledger.write(&pointer, ratio, Source::Rule, "from the tip circles of both gears");
                ratio
            }
            _ => geometry.path.contact_ratio(),
        };
        ledger.plain(&format!("{}/stiffness/kind", self.mesh), "tooth-pairs");
        let width = self.teeth[0].width.min(self.teeth[1].width);
        let pointer = format!("{}/stiffness/mean", self.mesh);
        let name = "mean_mesh_stiffness_for_transverse_load_iso_6336_2019";
        if let Some((each, from)) = given(ledger, self.stage, name, Unit::PerWidth) {
            let along = width / libm::cos(rack.base_helix()).powi(2);
            ledger.write(&pointer, each * along, Source::Rule, format!("{from}, times b/cos² β_b"));
        } else {
            let mean = iso_mesh_stiffness(rack, one, two, kind, ratio, width);
            ledger.write(&pointer, mean, Source::Rule, "c_γ b/cos² β_b, ISO 6336-1 method B, solid discs of steel");
        }
    }

    /// Returns the contact ratio by the tip circles of the file, if both are plausible.
    fn ratio_of_tips(
        &self,
        ledger: &mut Ledger<'_>,
        rack: &BasicRack,
        geometry: &MeshGeometry,
        shifts: [f64; 2],
    ) -> Option<f64> {
        let [one, two] = [0, 1].map(|k| {
            let tip = self.teeth[k].radii(ledger, shifts[k], rack.helix_angle)[0];
            (Some(tip) == self.teeth[k].tip).then(|| (tip * tip - geometry.base_radii[k].powi(2)).max(0.0).sqrt())
        });
        let sine = geometry.centre_distance * libm::sin(geometry.pressure_angle);
        let ring = self.teeth.iter().position(|teeth| teeth.is_ring);
        let length = match ring {
            None => one? + two? - sine,
            Some(0) => two? - one? + sine,
            Some(_) => one? - two? + sine,
        };
        let pitch = std::f64::consts::PI * rack.transverse_module() * libm::cos(rack.transverse_angle());
        Some(length / pitch).filter(|ratio| (1.0..4.0).contains(ratio))
    }
}
