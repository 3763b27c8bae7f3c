//! Contact laws.

use super::{
    node::Node,
    shape::{Object, Shape, Span, Units, at_least, choice, positive, within},
};
use crate::gear::contact::{self, Hysteresis, Law, Linear, PowerLaw, Ratio, Release, Rigid};

const MODELS: [(&str, Hysteresis); 8] = [
    ("none", Hysteresis::None),
    ("hunt-crossley", Hysteresis::HuntCrossley),
    ("herbert-mcwhannell", Hysteresis::HerbertMcWhannell),
    ("lankarani-nikravesh", Hysteresis::LankaraniNikravesh),
    ("gonthier", Hysteresis::Gonthier),
    ("flores", Hysteresis::Flores),
    ("hu-guo", Hysteresis::HuGuo),
    ("exact", Hysteresis::Exact),
];

/// A contact law by name; of a gear mesh, with damping ratios too.
pub(super) fn shape(units: Units, of_mesh: bool) -> Shape {
    let linear = |about| {
        let damping = units.key("damping", "n_s_per_m");
        let law = Object::new(about);
        if of_mesh {
            law.free(damping.clone(), at_least(0.0), "Damping in contact; 0 if neither key is written.")
                .free("damping_ratio", at_least(0.0), "2 ratio sqrt(k m1 m2/(m1 + m2)), with the rotary masses.")
                .at_most_one([damping, "damping_ratio".to_owned()])
        } else {
            law.with_default(damping, 0.0, at_least(0.0), "Damping in contact.")
        }
    };
    let bilateral = linear("Linear spring and damper that never lets go.");
    let kelvin_voigt = linear("Linear spring and damper beyond the gap.")
        .with_default("release", "force", release_shape(), RELEASE)
        .mistake("restitution", "a linear damper has a damping, not a restitution: write damping_n_s_per_m");
    let exponent = Shape::Either(vec![positive(), Shape::Text]);
    let power = Object::new("Force K p^n (1 + D p'/v0), v0 the speed at the last contact start.")
        .with_default("exponent", 1.5, exponent, "Exponent n: a number, or a ratio such as \"10/9\".")
        .free("hysteresis", choice(&MODELS.map(|(name, _)| name)), "Formula that turns the restitution into D.")
        .free("restitution", restitution(), "Restitution asked for, (0, 1].")
        .free("hysteresis_coefficient", at_least(0.0), "D itself, instead of a formula and a restitution.")
        .with_default(
            units.key("speed_floor", "m_per_s"),
            1.0e-4,
            positive(),
            "Smallest v0: below it D/v0 grows without bound.",
        )
        .with_default(units.key("initial_speed", "m_per_s"), 1.0e-2, positive(), "v0 before the first contact start.")
        .exactly_one(["hysteresis", "hysteresis_coefficient"])
        .mistake("n", "write exponent")
        .mistake("e", "write restitution")
        .mistake("coefficient", "write hysteresis_coefficient");
    let rigid = Object::new("No penetration: the gap opens with restitution times the speed it closed with.")
        .needed("restitution", within(0.0, 1.0), "Newton's coefficient of restitution.")
        .mistake("e", "write restitution");
    Shape::Variant {
        tag: "kind",
        cases: vec![("bilateral", bilateral), ("kelvin-voigt", kelvin_voigt), ("power", power), ("rigid", rigid)],
    }
}

const RELEASE: &str = "When the contact is lost: \"force\" (it never pulls) or \"deflection\" (at zero penetration; \
                       the damper may pull just before).";

/// When a Kelvin–Voigt contact is lost.
pub(super) fn release_shape() -> Shape {
    choice(&["force", "deflection"])
}

/// The release rule written here.
pub(super) fn read_release(node: &Node) -> Release {
    if node.text() == "deflection" { Release::Deflection } else { Release::Force }
}

fn restitution() -> Shape {
    Shape::Number(Span { low: Some((0.0, false)), high: Some((1.0, true)) })
}

/// The law written here; a damping ratio is left to the mesh that knows its gears.
pub(super) fn read(node: &Node) -> Law {
    let damping = node.at_unit("damping", "n_s_per_m").written().map_or(0.0, |damping| damping.number());
    let linear = || Linear { damping };
    match node.at("kind").text() {
        "bilateral" => Law::Bilateral(linear()),
        "kelvin-voigt" => Law::KelvinVoigt(linear(), read_release(&node.at("release"))),
        "rigid" => Law::Rigid(Rigid { restitution: node.at("restitution").number() }),
        _ => Law::Power(PowerLaw {
            exponent: exponent(&node.at("exponent")),
            hysteresis: hysteresis(node),
            speed_floor: node.at_unit("speed_floor", "m_per_s").number(),
            initial_speed: node.at_unit("initial_speed", "m_per_s").number(),
        }),
    }
}

/// An exponent as a ratio; a fault, and Hertz's, if it is none.
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
        // Below one the force rises with infinite slope at the start of contact: no law of teeth does.
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
