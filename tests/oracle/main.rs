//! An oracle of the project's own: event sequences of random scenes in 32 digits, against Flank's.
//!
//! It shares no code with Flank's integrators, bounds and event location: it takes the assembled numbers of a scene
//! ([`flank::system::Spec`]) and goes its own slow way. Taylor series of order 40 (72 under power laws, in the clock of a root
//! near a flank), first roots by halving with exclusion, complementarity by enumeration ([`rest`], [`strike`]), sums of
//! accumulating impacts. Where doubles cannot tell what happens (a touch within 1e-14 of its terms, a sequence that a change of
//! the inputs by 1e-15 changes) the rest of a scene is *ambiguous* and not judged.
//!
//! ```text
//! cargo test --test oracle                 a sample of every class, and the oracle against closed forms
//! .ci/nightly                              200 scenes of every class, table at the end
//! .ci/nightly --class A,B --count 50 --seed 7
//! FLANK_ORACLE_SCENE=scene.json cargo test --test oracle -- --ignored --nocapture replay
//! ```
//!
//! The exact derivative of a motion is compared with differences of the oracle's runs ([`derivative`]).
//!
//! A scene that fails is printed as JSON, cut where the comparison ends, with the first difference.

mod arcs;
mod bars;
mod closed_forms;
mod derivative;
mod drift;
mod flank_run;
mod instant;
mod judge;
mod linear;
mod model;
mod nightly;
mod powers;
mod rest;
mod roots;
mod scenes;
mod sequence;
mod series;
mod state;
mod step;
mod strike;
mod transforms;
mod wide;

use std::time::Duration;

use flank::scene::Scene;

/// Events of one scene, both ways, from the file that `FLANK_ORACLE_SCENE` names.
#[test]
#[ignore = "a tool: needs FLANK_ORACLE_SCENE"]
fn replay() {
    let path = std::env::var("FLANK_ORACLE_SCENE").unwrap();
    let value: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let built = Scene::from_value(value.clone(), "replay").unwrap().build().unwrap();
    let truth = judge::truth(&built, 1000);
    for (e, s) in truth.sequence.events.iter().zip(&truth.sensitivity) {
        println!("{} {} {:?} {s:.3e}", wide::decimal(e.t), built.spec.contacts[e.contact].name, e.kind);
    }
    println!("# {:?}, until {:e}, {:?}", truth.sequence.ending, truth.until, truth.ambiguous);
    let judged = judge::judge(&value, 1000, Duration::from_secs(60));
    println!("# {:?}, {} events, worst {:.2e}", judged.verdict, judged.events, judged.worst);
    println!("# oracle {:.2} s, Flank {:.2} s", judged.oracle_seconds, judged.flank_seconds);
}

/// All classes: what `.ci/nightly` runs.
#[test]
#[ignore = "takes minutes: .ci/nightly runs it"]
fn nightly_table() {
    let table = nightly::nightly(&nightly::Plan::from_environment());
    let bad: usize = table.iter().map(|(letter, l)| l.bad(letter)).sum();
    assert_eq!(bad, 0, "scenes that are wrong, alarmed or refused");
}

/// Errors of event times over whole runs, against uncertainty and inherited uncertainty: a table, and scenes with an error above ten bars.
#[test]
#[ignore = "takes minutes: .ci/nightly runs it"]
fn nightly_bars() {
    let [count, beyond, worst] = nightly::bars(&nightly::Plan::from_environment());
    assert!(
        beyond <= 0.01 * count && worst < 1e5,
        "{beyond} of {count} events beyond their bars, the worst {worst:.1e} times"
    );
}

/// Errors of event times over one arc, from Flank's own states, against the uncertainties stated for them.
#[test]
#[ignore = "takes minutes: .ci/nightly runs it"]
fn nightly_arcs() {
    let table = nightly::arcs(&nightly::Plan::from_environment());
    let bad: Vec<String> = table
        .iter()
        .filter(|a| a.beyond + a.other > 0)
        .map(|a| format!("{}: {} of {} arcs, median {:.1e}", a.letter, a.beyond + a.other, a.count, a.median))
        .collect();
    assert!(bad.is_empty(), "arcs beyond their uncertainty: {}", bad.join("; "));
}

/// Accuracy on request: over an arc no event is off by more than it states.
#[test]
fn arcs_on_request() {
    for tolerance in [1e-3, 1e-6, 1e-9] {
        let plan = nightly::Plan {
            classes: ["D", "E", "F", "J", "K", "L", "S"].iter().map(ToString::to_string).collect(),
            count: 4,
            seed: 5,
            budget: 12,
            limit: Duration::from_secs(20),
            tell: true,
            tolerance,
        };
        let table = nightly::arcs(&plan);
        assert!(table.iter().map(|a| a.count).sum::<usize>() > 100);
        let bad: Vec<_> = table.iter().filter(|a| a.beyond + a.other > 0).map(|a| a.letter).collect();
        assert!(bad.is_empty(), "{tolerance:e}: {bad:?}");
    }
}

/// The gearboxes that the oracle judges could be made: no number in them is warned of. Starts beside a flank, and drags whose sign the
/// motion could change, are warned of rightly.
#[test]
fn random_gearboxes_are_plausible() {
    let class = scenes::CLASSES.iter().find(|class| class.letter == "Y").unwrap();
    for index in 0..200 {
        let scene = class.scene(1, index);
        let warnings = Scene::from_value(scene.clone(), "random").unwrap().build().unwrap().warnings;
        let odd = |warning: &&flank::scene::Warning| {
            warning.pointer != "/initial" && !warning.message.contains("the constant drag could change its sign")
        };
        assert_eq!(warnings.iter().find(odd), None, "{index}: {scene}");
    }
}

/// A few scenes of every class. The oracle tells what is right; what Flank gets wrong is counted by `.ci/nightly`.
#[test]
fn sample() {
    let classes =
        ["A", "B", "C", "D", "E", "F", "G", "J", "K", "L", "N", "O", "P", "Q", "R", "S", "T", "U", "V", "X", "Y", "Z"];
    let plan = nightly::Plan {
        classes: classes.iter().map(ToString::to_string).collect(),
        count: 6,
        seed: 2,
        budget: 20,
        limit: Duration::from_secs(20),
        tell: true,
        tolerance: 0.0,
    };
    let table = nightly::nightly(&plan);
    let ambiguous: usize = table.iter().map(|(_, l)| l.ambiguous).sum();
    let tried: usize = table.iter().map(|(_, l)| l.tried).sum();
    assert!(10 * ambiguous <= tried, "{ambiguous} of {tried} scenes are ambiguous");
    let bad: usize = table.iter().map(|(letter, l)| l.bad(letter)).sum();
    assert_eq!(bad, 0, "scenes that are wrong, alarmed or refused");
}
