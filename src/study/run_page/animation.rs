//! Animation of the train in a recorded motion.

use super::{MotionRecord, colour, state_name};
use crate::{
    hybrid::{ContactMode, ContactView},
    plot::{AnimatedContact, AnimatedGear, Animation},
    system::Flanks,
};

/// Frames of a cycle, and most frames of an animation.
const FRAMES: usize = 100;
const MOST_FRAMES: usize = 400;
/// Maximum number of contacts of an animation.
const GAUGES: usize = 8;
/// Share of the train's size at which the largest motion beside the mean rotation is drawn.
const DRAWN: f64 = 0.015;

impl MotionRecord {
    /// Returns the train over a period of its motion; over a cycle without a period, over the run without forcing.
    pub fn animation(&self) -> Option<Animation> {
        let r = &self.recording;
        let structure = &self.simulation.structure;
        let n = structure.freedoms();
        let cycles = self.cycles.map(|_| self.motion.as_ref().and_then(|m| m.period).unwrap_or(1) as usize);
        let span = cycles.map_or(r.t.len(), |cycles| cycles * self.per_cycle()).min(r.t.len());
        let frames = cycles.map_or(MOST_FRAMES, |cycles| cycles * FRAMES).min(MOST_FRAMES).min(span);
        if frames < 2 || r.spells.is_empty() {
            return None;
        }
        let places: Vec<usize> = (0..frames).map(|k| k * span / frames).collect();
        let drawing = self.simulation.drawing.as_ref().filter(|drawing| {
            drawing.points.len() == r.spells.len() && drawing.gears.iter().all(|gear| gear.motion[0].len() == n)
        });
        let value = |row: &[f64], i: usize| (0..n).fold(0.0, |sum, k| sum + row[k] * r.x[k][i]);
        let mut gears = Vec::new();
        let toothed = drawing.iter().flat_map(|drawing| &drawing.gears).filter(|gear| gear.teeth > 0);
        for gear in toothed {
            let mut motion: Vec<[f64; 3]> =
                places.iter().map(|i| [0, 1, 2].map(|part| value(&gear.motion[part], *i))).collect();
            for part in 0..3 {
                let mean = motion.iter().map(|m| m[part]).sum::<f64>() / frames as f64;
                motion.iter_mut().for_each(|m| m[part] -= mean);
            }
            let interval = r.t[places[1]] - r.t[places[0]];
            gears.push(AnimatedGear {
                name: gear.name.clone(),
                centre: gear.centre,
                radius: gear.radius,
                teeth: gear.teeth,
                is_ring: gear.is_ring,
                angle: gear.angle,
                turn: gear.speed * interval,
                motion,
            });
        }
        let size = gears.iter().map(|g| g.radius + g.centre[0].abs().max(g.centre[1].abs())).fold(0.0, f64::max);
        let moved = |g: &AnimatedGear| {
            let radius = g.radius;
            let largest = g.motion.iter().map(move |[x, y, turn]| libm::hypot(*x, *y).max((radius * turn).abs()));
            largest.fold(0.0, f64::max)
        };
        let largest = gears.iter().map(moved).fold(0.0, f64::max);
        // A round number, which the caption states.
        let factor = if largest > 0.0 { round_down(DRAWN * size / largest) } else { 1.0 };
        gears.iter_mut().flat_map(|g| &mut g.motion).for_each(|m| m.iter_mut().for_each(|part| *part *= factor));
        let mut states: Vec<(String, usize)> = Vec::new();
        for mode in [ContactMode::Separated, ContactMode::Drive, ContactMode::Back] {
            states.push((state_name(mode).to_owned(), colour(mode)));
        }
        let spec = structure.spec();
        let contacts = (0..r.spells.len()).take(if drawing.is_some() { usize::MAX } else { GAUGES });
        let contacts: Vec<AnimatedContact> = contacts
            .map(|j| {
                let b = spec.contacts[j].half_backlash;
                let flanks = if spec.contacts[j].flanks == Flanks::Both { vec![b, -b] } else { vec![b] };
                let state = places.iter().map(|i| {
                    let at = r.t[*i];
                    let spell = r.spells[j].iter().rev().find(|spell| spell.from <= at);
                    let mode = spell.map_or(ContactMode::Separated, |spell| spell.mode);
                    let name = state_name(mode);
                    states.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
                        states.push((name.to_owned(), colour(mode)));
                        states.len() - 1
                    })
                });
                AnimatedContact {
                    name: structure.contact_name(j).to_owned(),
                    point: drawing.map(|drawing| drawing.points[j]),
                    state: state.collect(),
                    flanks: flanks.into_iter().map(|d| self.units.length.0 * d).collect(),
                    deflection: places.iter().map(|i| self.units.length.0 * r.deflection[j][*i]).collect(),
                }
            })
            .collect();
        let over = match cycles {
            None => "the run".to_owned(),
            Some(1) => "one forcing cycle".to_owned(),
            Some(cycles) => format!("{cycles} forcing cycles"),
        };
        let drawn = if gears.is_empty() {
            String::new()
        } else {
            format!(
                "The train is drawn to scale. Its motion beside the mean turning is drawn {factor} times as large. Circles: pitch points, \
                 coloured by the state of the contact. "
            )
        };
        Some(Animation {
            id: "animation".to_owned(),
            title: format!("The train in motion: {over}"),
            caption: format!("{drawn}Bars: the deflection between the flanks. Space plays, arrow keys step."),
            gears,
            contacts,
            factor,
            interval: (self.units.time.0 * (r.t[places[1]] - r.t[places[0]]), self.units.time.1.to_owned()),
            unit: self.units.length.1.to_owned(),
            states,
        })
    }
}

/// Returns the largest of 1, 2, 5, 10, … that is not above a number > 0.
fn round_down(value: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(value)));
    [5.0, 2.0].into_iter().map(|step| step * power).find(|step| *step <= value).unwrap_or(power)
}
