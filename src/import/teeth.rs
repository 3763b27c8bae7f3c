//! Teeth of gears.

use super::{
    ledger::{Ledger, Source},
    model::Component,
    quantity::{Unit, given},
};
use crate::gear::Gear;

/// Usual dedendum of the gear, modules (ISO 53, profile A).
pub(super) const DEDENDUM: f64 = 1.25;

/// The teeth of a gear.
#[derive(Clone, Debug)]
pub(super) struct Teeth {
    pub place: String,
    pub number: u32,
    pub is_ring: bool,
    pub module: f64,
    /// Normal pressure angle, degrees.
    pub angle: f64,
    /// Helix angle, degrees, positive for the right hand.
    pub helix: f64,
    /// True if the file gives the helix angle.
    pub has_helix: bool,
    pub width: f64,
    pub shift: Option<(f64, String)>,
    /// Dedendum of the gear, which is the addendum of its tool, modules.
    pub dedendum: Option<(f64, String)>,
    pub tip: Option<f64>,
}

/// Components with data of one gear: the gear, its flanks and its data in stages, its tool.
pub(super) struct Data<'m> {
    pub gear: &'m Component,
    pub parts: Vec<&'m Component>,
    pub tool: Option<&'m Component>,
}

impl Teeth {
    /// Reads the teeth of a gear that is written at `pointer`, and writes the numbers of the gear alone.
    pub fn read(ledger: &mut Ledger<'_>, data: &Data<'_>, pointer: &str) -> Option<Self> {
        let gear = data.gear;
        let place = gear.place();
        let is_ring = gear.kind == "ring_gear";
        let mut of = |names: &[&str], unit: Unit| {
            let places = std::iter::once(gear).chain(data.parts.iter().copied());
            let found = places.flat_map(|part| names.iter().map(move |name| (part, *name)));
            let found: Vec<_> = found.filter(|(part, name)| part.attributes.contains_key(*name)).collect();
            found.first().and_then(|(part, name)| given(ledger, part, name, unit))
        };
        let teeth = of(&["number_of_teeth"], Unit::One);
        let module = of(&["normal_module"], Unit::Length);
        let angle = of(&["normal_pressure_angle"], Unit::Angle);
        let helix = of(&["helix_angle_reference_diameter"], Unit::Angle);
        let width = of(&["face_width"], Unit::Length);
        let shift = of(&["addendum_modification_coefficient"], Unit::One);
        let millimetres = of(&["addendum_modification"], Unit::Length);
        let tip = of(&["tip_diameter"], Unit::Length).map(|(d, _)| 0.5 * d);
        let dedendum =
            data.tool.and_then(|tool| given(ledger, tool, "addendum_coefficient_reference_profile", Unit::One));
        let needed = |ledger: &mut Ledger<'_>, found: Option<(f64, String)>, what: &str| {
            if found.is_none() {
                ledger.fault(
                    &place,
                    format!("no {what}"),
                    "a gear with number_of_teeth, normal_module, normal_pressure_angle and face_width",
                    "add it to the file",
                );
            }
            found
        };
        let teeth = needed(ledger, teeth, "number_of_teeth");
        let module = needed(ledger, module, "normal_module");
        let angle = needed(ledger, angle, "normal_pressure_angle");
        let width = needed(ledger, width, "face_width");
        let ((teeth, from), (module, _), (angle, _), (width, wide)) = (teeth?, module?, angle?, width?);
        // Rings of some writers count down.
        let number = teeth.abs();
        let ranges = [
            (
                number.fract() == 0.0 && (3.0..=1e5).contains(&number),
                "number_of_teeth",
                number,
                "a whole number from 3 to 100000",
            ),
            (module > 0.0 && module < 1.0, "normal_module", module, "a module > 0 and below 1 m"),
            (angle > 0.0 && angle < 45.0, "normal_pressure_angle", angle, "an angle between 0 and 45 deg"),
            (width > 0.0, "face_width", width, "a width > 0"),
            (
                helix.as_ref().is_none_or(|(h, _)| h.abs() < 60.0),
                "helix_angle_reference_diameter",
                helix.as_ref().map_or(0.0, |h| h.0),
                "an angle between -60 and 60 deg",
            ),
        ];
        let bad: Vec<_> = ranges.iter().filter(|(good, ..)| !good).collect();
        for (_, name, value, allowed) in &bad {
            ledger.fault(&format!("{place}: {name}"), value.to_string(), allowed, "mend the file");
        }
        if !bad.is_empty() {
            return None;
        }
        let shift = shift.or(millimetres.map(|(x, from)| (x / module, from)));
        ledger.write(&format!("{pointer}/teeth"), number as u64, Source::File, from);
        ledger.write(&format!("{pointer}/face_width_m"), width, Source::File, wide);
        let has_helix = helix.is_some();
        let helix = helix.map_or(0.0, |(helix, _)| helix);
        Some(Self {
            place,
            number: number as u32,
            is_ring,
            module,
            angle,
            helix,
            has_helix,
            width,
            shift,
            dedendum,
            tip,
        })
    }

    pub fn gear(&self, shift: f64) -> Gear {
        Gear { teeth: self.number, shift }
    }

    /// Returns the radii of tip and root, m; `helix` is that of the mesh, rad. The tip is that of the file if plausible, else by the rack.
    pub fn radii(&self, ledger: &mut Ledger<'_>, shift: f64, helix: f64) -> [f64; 2] {
        let helix = libm::cos(helix);
        let (m, reference) = (self.module, 0.5 * self.module * f64::from(self.number) / helix);
        let dedendum = self.dedendum.as_ref().map_or(DEDENDUM, |(h, _)| *h);
        let outwards = if self.is_ring { -1.0 } else { 1.0 };
        let tip = reference + outwards * m * (1.0 + outwards * shift);
        let given = self.tip.filter(|given| {
            let is_near = (given - tip).abs() < m;
            if !is_near {
                ledger.notes.push(format!(
                    "{}: tip_diameter {:.4} m is not used: teeth of this module have about {:.4} m",
                    self.place,
                    2.0 * given,
                    2.0 * tip
                ));
            }
            is_near
        });
        [given.unwrap_or(tip), reference - outwards * m * (dedendum - outwards * shift)]
    }
}
