//! Animation of a train, for a page.

use serde_json::{Value, json};

use super::{draw::palette::hex, report::rounded};
use crate::plot::Theme;

/// Motion in frames at equal intervals of time. Lengths are in one unit throughout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Name in the page: lower-case words joined by `-`.
    pub id: String,
    /// Title.
    pub title: String,
    /// Words below it.
    pub caption: String,
    /// Gears in place; none for a train without gears.
    pub gears: Vec<AnimatedGear>,
    /// Contacts.
    pub contacts: Vec<AnimatedContact>,
    /// Factor by which the motion beside the mean rotation is enlarged.
    pub factor: f64,
    /// Time between two frames, and its unit.
    pub interval: (f64, String),
    /// Unit of deflections.
    pub unit: String,
    /// Names of the states of contacts, with the indices of their tile colours.
    pub states: Vec<(String, usize)>,
}

/// A gear of an animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnimatedGear {
    /// Its name.
    pub name: String,
    /// Centre at rest.
    pub centre: [f64; 2],
    /// Pitch radius.
    pub radius: f64,
    /// Tooth number.
    pub teeth: u32,
    /// True if its teeth point inwards.
    pub is_ring: bool,
    /// Angle of a tooth (of a ring: of a space) in the first frame, rad.
    pub angle: f64,
    /// Mean rotation from frame to frame, rad.
    pub turn: f64,
    /// Displacements x and y, and rotation, rad, of each frame, enlarged as drawn.
    pub motion: Vec<[f64; 3]>,
}

/// A contact of an animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AnimatedContact {
    /// Its name.
    pub name: String,
    /// Pitch point, if gears are known.
    pub point: Option<[f64; 2]>,
    /// Flanks: the drive flank, and the back flank if there is one.
    pub flanks: Vec<f64>,
    /// Deflection of each frame.
    pub deflection: Vec<f64>,
    /// Index of its state in each frame.
    pub state: Vec<usize>,
}

impl Animation {
    /// Returns the data of the page's script. Places are rounded to a ten-thousandth of the train's size.
    pub(super) fn data(&self) -> Value {
        let reach = |gear: &AnimatedGear| gear.radius + gear.centre[0].abs().max(gear.centre[1].abs());
        let size = self.gears.iter().map(reach).fold(f64::MIN_POSITIVE, f64::max);
        let place = |value: f64| rounded(value, 100.0 * size, false);
        let gears = self.gears.iter().map(|gear| {
            let motion: Vec<Value> = gear
                .motion
                .iter()
                .flat_map(|[x, y, turn]| [place(*x), place(*y), rounded(*turn, 100.0, false)])
                .collect();
            json!({
                "name": gear.name, "centre": gear.centre.map(place), "radius": place(gear.radius), "teeth": gear.teeth,
                "ring": gear.is_ring, "angle": gear.angle, "turn": gear.turn, "motion": motion,
            })
        });
        let contacts = self.contacts.iter().map(|contact| {
            let ends = contact.deflection.iter().chain(&contact.flanks);
            let [low, high] =
                ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], d| [low.min(*d), high.max(*d)]);
            let deflection: Vec<Value> =
                contact.deflection.iter().map(|d| rounded(*d, 100.0 * (high - low), false)).collect();
            let state: String = contact.state.iter().map(usize::to_string).collect();
            json!({
                "name": contact.name, "point": contact.point.map(|point| point.map(place)), "flanks": contact.flanks,
                "deflection": deflection, "state": state,
            })
        });
        let colours = |theme: Theme| -> Vec<String> {
            self.states.iter().map(|(_, number)| hex(theme.colours().tile(*number))).collect()
        };
        json!({
            "gears": gears.collect::<Vec<_>>(),
            "contacts": contacts.collect::<Vec<_>>(),
            "factor": self.factor,
            "interval": self.interval.0,
            "timeUnit": self.interval.1,
            "unit": self.unit,
            "states": self.states.iter().map(|(name, _)| name).collect::<Vec<_>>(),
            "colours": { "light": colours(Theme::Light), "dark": colours(Theme::Dark) },
        })
    }
}
