//! Contact laws.

use super::node::Node;
use crate::gear::contact::{self, Hysteresis, Law, Linear, MOST_POINTS, PowerLaw, Ratio, Release, Restitution, Rigid};

pub(super) const MODELS: [(&str, Hysteresis); 8] = [
    ("none", Hysteresis::None),
    ("hunt-crossley", Hysteresis::HuntCrossley),
    ("herbert-mcwhannell", Hysteresis::HerbertMcWhannell),
    ("lankarani-nikravesh", Hysteresis::LankaraniNikravesh),
    ("gonthier", Hysteresis::Gonthier),
    ("flores", Hysteresis::Flores),
    ("hu-guo", Hysteresis::HuGuo),
    ("exact", Hysteresis::Exact),
];

pub(super) fn read_release(node: &Node) -> Release {
    if node.text() == "deflection" { Release::Deflection } else { Release::Force }
}

/// Reads a law; a damping ratio is left to the mesh, which has the gears.
pub(super) fn read(node: &Node) -> Law {
    let damping = node.at_unit("damping", "n_s_per_m").written().map_or(0.0, |damping| damping.number());
    let linear = || Linear { damping };
    match node.at("kind").text() {
        "bilateral" => Law::Bilateral(linear()),
        "kelvin-voigt" => Law::KelvinVoigt(linear(), read_release(&node.at("release"))),
        "rigid" => Law::Rigid(Rigid { restitution: restitution(&node.at("restitution")) }),
        _ => Law::Power(PowerLaw {
            exponent: exponent(&node.at("exponent")),
            hysteresis: hysteresis(node),
            speed_floor: node.at_unit("speed_floor", "m_per_s").number(),
            initial_speed: node.at_unit("initial_speed", "m_per_s").number(),
        }),
    }
}

/// Reads a restitution, constant or by the approach speed.
fn restitution(node: &Node) -> Restitution {
    let speed = |stem: &str| node.at_unit(stem, "m_per_s").number();
    let found = match node.at("kind").text() {
        "power" => Restitution::Power {
            at_speed: node.at("restitution").number(),
            speed: speed("speed"),
            exponent: node.at("exponent").number(),
            smallest_speed: speed("smallest_speed"),
        },
        "table" => {
            let rows = node.at("points").items();
            let mut points = [[0.0; 2]; MOST_POINTS];
            for (point, row) in points.iter_mut().zip(&rows) {
                point.copy_from_slice(&row.vector(2));
            }
            Restitution::Table { points, count: rows.len() }
        }
        _ => Restitution::Constant(node.number()),
    };
    if let Some((name, value, wanted)) = found.fault() {
        node.fault(format!("a {name} of {value}"), wanted, "correct it");
    }
    found
}

/// Reads an exponent as a ratio; otherwise a fault, and Hertz's exponent.
fn exponent(node: &Node) -> Ratio {
    let ratio = if node.is_text() {
        let parts = node
            .text()
            .split_once('/')
            .or(Some((node.text(), "1")))
            .and_then(|(p, q)| Some((p.trim().parse().ok()?, q.trim().parse().ok()?)));
        parts.and_then(|(p, q): (u32, u32)| Ratio::from_f64(f64::from(p) / f64::from(q)))
    } else {
        Ratio::from_f64(node.number())
    };
    match ratio {
        // Below one the force rises with infinite slope at the start of contact: no law of teeth does so.
        Some(ratio) if (1.0..=5.0).contains(&ratio.value()) => ratio,
        _ => {
            node.refuse(
                format!("a ratio p/q from 1 to 5 of whole numbers, q up to {}", Ratio::MAX_DENOMINATOR),
                "write it to full precision or as a ratio, such as 1.5 or \"10/9\"",
            );
            Ratio { p: 3, q: 2 }
        }
    }
}

fn hysteresis(node: &Node) -> f64 {
    if let Some(coefficient) = node.at("hysteresis_coefficient").written() {
        if node.at("restitution").written().is_some() {
            node.at("restitution").refuse(
                "nothing beside hysteresis_coefficient",
                "remove restitution, or name a formula under hysteresis",
            );
        }
        return coefficient.number();
    }
    let name = node.at("hysteresis").text();
    let model = MODELS.iter().find(|(word, _)| *word == name).map_or(Hysteresis::None, |(_, model)| *model);
    match node.at("restitution").written() {
        _ if model == Hysteresis::None => 0.0,
        Some(e) => {
            let coefficient = contact::coefficient(model, e.number());
            let obtained = contact::restitution(coefficient);
            if (obtained - e.number()).abs() > 0.01 {
                e.warn(format!(
                    "a free impact under \"{name}\" returns {obtained:.4}, not {}; \"exact\" returns what is asked",
                    e.number()
                ));
            }
            coefficient
        }
        None => {
            node.at("restitution")
                .refuse("a number in (0, 1]", format!("add restitution: \"{name}\" computes its damping from it"));
            0.0
        }
    }
}
