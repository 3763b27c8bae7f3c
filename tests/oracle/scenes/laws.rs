//! Contact laws at random.

use serde_json::{Value, json};

use super::random::Random;

pub fn rigid(restitution: f64) -> Value {
    json!({ "kind": "rigid", "restitution": restitution })
}

/// Restitution: 0 as often as not.
pub fn restitution(r: &mut Random) -> f64 {
    if r.chance(0.5) { 0.0 } else { r.of(0.1, 0.85) }
}

/// A restitution that depends on the approach speed.
pub fn by_speed(r: &mut Random) -> Value {
    if r.chance(0.3) {
        let (e, smallest) = (r.of(0.3, 0.7), r.log(1e-4, 0.05));
        // Below one at the smallest speed: (smallest/speed)^exponent above e.
        let (speed, most) = (r.log(0.1, 5.0), 0.9 * e.ln());
        let exponent = crate::scenes::random::round(r.of(0.1, 1.0) * most / (smallest / speed).ln());
        return json!({ "kind": "power", "restitution": e, "speed_m_per_s": speed, "exponent": exponent, "smallest_speed_m_per_s": smallest });
    }
    let mut speed = r.log(1e-4, 0.3);
    let points: Vec<Value> = (0..1 + r.below(5))
        .map(|_| {
            speed = crate::scenes::random::round(speed * r.log(1.5, 10.0));
            json!([speed, r.of(0.1, 0.95)])
        })
        .collect();
    json!({ "kind": "table", "points": points })
}

pub const EXPONENTS: [&str; 8] = ["3/2", "5/4", "6/5", "10/9", "4/3", "5/2", "2", "7/5"];

/// A power law with one of the exponents.
pub fn power(r: &mut Random, exponents: &[&str]) -> Value {
    let exponent = r.pick(exponents);
    match r.below(4) {
        0 => json!({ "kind": "power", "exponent": exponent, "hysteresis": "none" }),
        1 => json!({ "kind": "power", "exponent": exponent, "hysteresis_coefficient": r.of(0.05, 0.6) }),
        _ => {
            let formula = r.pick(&["exact", "flores", "hunt-crossley", "lankarani-nikravesh"]);
            json!({ "kind": "power", "exponent": exponent, "hysteresis": formula, "restitution": r.of(0.4, 0.95) })
        }
    }
}

/// A Kelvin-Voigt law of a gear mesh.
pub fn soft_mesh(r: &mut Random) -> Value {
    let release = r.pick(&["force", "deflection"]);
    json!({ "kind": "kelvin-voigt", "damping_ratio": r.of(0.0, 0.12), "release": release })
}

/// A Kelvin-Voigt law with a damping.
pub fn soft(r: &mut Random, damping: f64) -> Value {
    let release = r.pick(&["force", "deflection"]);
    json!({ "kind": "kelvin-voigt", "damping_n_s_per_m": r.of(0.0, damping), "release": release })
}
