//! The numbers that the paper leaves open, found again from what it prints.

use serde_json::json;

use super::{Comparison, Verdict, numbers, statement};
use crate::{
    scene::Scene,
    study::{
        StudyError,
        identify::{Identification, Parameter, Target, identify},
    },
};

const BEARING: &str = "/train/planet/translation/stiffness_n_per_m";
const RING: &str = "/train/ring/translation/stiffness_n_per_m";
const SUN: &str = "/train/sun/translation/stiffness_n_per_m";
const SUN_TURN: &str = "/train/sun/rotation/stiffness_n_per_m";
const RING_TURN: &str = "/train/ring/rotation/stiffness_n_per_m";
const CARRIER_TURN: &str = "/train/carrier/rotation/stiffness_n_per_m";
const CARRIER_MASS: &str = "/train/carrier/rotary_mass_kg";
const SUN_MESH: &str = "/train/sun_mesh/stiffness";
const RING_MESH: &str = "/train/ring_mesh/stiffness";

/// One question: which numbers (words, value of the preset), from which values.
struct Question {
    preset: &'static str,
    vary: &'static [(&'static str, &'static [&'static str], [f64; 2])],
    targets: &'static [&'static str],
}

const QUESTIONS: [Question; 4] = [
    Question {
        preset: "reference-heavy",
        vary: &[("planet bearing", &[BEARING], [1e7, 1e9])],
        targets: &["translational:2=889"],
    },
    Question {
        preset: "reference-heavy",
        vary: &[("ring support", &[RING], [1e8, 1e10])],
        targets: &["translational:3=1791"],
    },
    Question {
        preset: "reference-heavy",
        vary: &[("sun shaft", &[SUN_TURN], [1e6, 1e9]), ("carrier shaft", &[CARRIER_TURN], [1e7, 1e11])],
        targets: &["rotational:3=1046", "force:sun-planet 1=774"],
    },
    Question {
        preset: "exact-frequencies",
        vary: &[
            ("both meshes", &[SUN_MESH, RING_MESH], [5e7, 2e9]),
            ("planet bearing", &[BEARING], [1e7, 1e9]),
            ("ring support", &[RING], [1e8, 1e10]),
        ],
        targets: &["translational:1=412", "translational:2=889", "translational:3=1791"],
    },
];

/// All nine numbers from all that the paper prints.
const ALL: Question = Question {
    preset: "reference-heavy",
    vary: &[
        ("sun mesh", &[SUN_MESH], [1e8, 1e9]),
        ("ring mesh", &[RING_MESH], [1e8, 1e9]),
        ("planet bearing", &[BEARING], [1e7, 1e9]),
        ("sun support", &[SUN], [1e4, 1e8]),
        ("ring support", &[RING], [1e8, 1e10]),
        ("sun shaft", &[SUN_TURN], [1e6, 1e9]),
        ("carrier shaft", &[CARRIER_TURN], [1e7, 1e11]),
        ("ring rotation", &[RING_TURN], [1e8, 1e11]),
        ("carrier rotary mass", &[CARRIER_MASS], [1.0, 100.0]),
    ],
    targets: &[
        "translational:1=412",
        "translational:2=889",
        "rotational:2=919",
        "rotational:3=1046",
        "translational:3=1791",
        "force:sun-planet 1=774",
    ],
};

impl Question {
    fn answer(&self) -> Result<Identification, StudyError> {
        let train = json!({ "kind": "planetary", "preset": self.preset, "load": { "output_torque_nm": 500 } });
        let scene = Scene::from_value(json!({ "flank": 1, "train": train, "run": { "t_end_s": 1 } }), self.preset)?;
        let parameters = self.vary.iter().map(|(_, pointers, [low, high])| Parameter {
            pointers: pointers.iter().map(|pointer| (*pointer).to_owned()).collect(),
            low: *low,
            high: *high,
        });
        let targets = self.targets.iter().filter_map(|target| target.parse::<Target>().ok());
        Ok(identify(&scene, &parameters.collect::<Vec<_>>(), &targets.collect::<Vec<_>>())?)
    }
}

/// The identified numbers: the preset's, and those that the printed values give back, with residuals.
///
/// # Errors
/// [`StudyError`] never in fact: the questions are part of the library.
pub fn identified() -> Result<Vec<Comparison>, StudyError> {
    let mut rows = Vec::new();
    for question in &QUESTIONS {
        let answer = question.answer()?;
        let residuals: Vec<String> =
            answer.targets.iter().map(|t| format!("{} {} {} got {:.2}", t.quantity, t.wanted, t.unit, t.got)).collect();
        let unique = match (answer.uniqueness.is_unique(), answer.solutions.len()) {
            (false, _) => "not unique".to_owned(),
            (true, 1) => "unique within the bounds".to_owned(),
            (true, n) => {
                let other = answer.solutions[1].values.iter().map(|v| format!("{v:.2e}")).collect::<Vec<_>>();
                format!("{n} solutions; another: {} N/m", other.join(", "))
            }
        };
        let note = format!("from {}; {unique}", residuals.join(", "));
        for ((words, ..), found) in question.vary.iter().zip(&answer.parameters) {
            let row =
                numbers("preset", &format!("{words}, {}", question.preset), (found.own, found.found), "N/m", &note);
            rows.push(Comparison {
                found: format!("{:.4e} N/m", found.found),
                published: format!("{:e} N/m", found.own),
                ..row
            });
        }
    }
    let all = ALL.answer()?;
    let words = all.uniqueness.to_string();
    let first = words.split([':', '.']).next().unwrap_or_default().to_owned();
    let off = all.targets.iter().map(|t| 100.0 * t.relative_residual.unwrap_or(0.0).abs()).fold(0.0, f64::max);
    rows.push(
        statement(
            "text",
            "all nine open numbers from five frequencies and one force",
            "one set",
            format!(
                "{}: {} numbers from {} targets, {} free directions; largest residual {off:.1} %",
                first.to_lowercase(),
                all.uniqueness.unknowns,
                all.uniqueness.targets,
                all.uniqueness.free.len()
            ),
            if all.uniqueness.is_unique() { Verdict::Agrees } else { Verdict::Deviates },
        )
        .noting("the bearing and a nearly free sun are what every fit has in common"),
    );
    Ok(rows)
}
