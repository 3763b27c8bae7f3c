//! The oracle itself against closed forms, to 1e-20.

use flank::scene::Scene;
use serde_json::{Value, json};

use super::{
    judge::start,
    model::{Model, Tweak},
    sequence::{Ending, Kind, Sequence, sequence},
    wide::{Wide, sin_cos, size, wide},
};

fn told(train: Value, initial: Value, end: f64) -> Sequence {
    let value = json!({ "flank": 1, "train": train, "initial": initial, "run": { "t_end_s": end } });
    let built = Scene::from_value(value, "closed form").and_then(|s| s.build()).expect("a scene that holds");
    let m = Model::new(&built.spec, Tweak::NONE);
    let s = sequence(&m, start(&m, &built, Tweak::NONE), wide(end), 10_000);
    assert_eq!(s.ending, Ending::Reached);
    s
}

fn assert_near(got: Wide, want: Wide) {
    assert!(size(got - want) <= 1e-20 * size(want).max(1.0), "{got:?} {want:?}");
}

fn root(x: Wide) -> Wide {
    super::wide::root(x, 2)
}

fn wall(law: Value, load: f64, more: Value) -> Value {
    let mut train = json!({
        "kind": "wall", "mass_kg": 1.0, "load_n": load, "wall": { "side": "above", "position_m": 0.0 }, "law": law,
    });
    more.as_object().into_iter().flatten().for_each(|(k, v)| train[k] = v.clone());
    train
}

/// Impact k of a ball dropped from h is at `t₀ (1 + 2 Σ eᵏ)`, its rest at `t₀ (1 + e)/(1 − e)`, `t₀ = √(2h/g)`.
#[test]
fn a_ball_bounces_to_rest() {
    let s = told(wall(json!({ "kind": "rigid", "restitution": 0.5 }), 2.0, json!({})), json!({ "q": [-1.0] }), 4.0);
    let mut t = wide(1.0);
    let mut hop = wide(1.0);
    for e in s.events.iter().filter(|e| e.kind == Kind::Impact).take(30) {
        assert_near(e.t, t);
        t = t + hop;
        hop = hop * wide(0.5);
    }
    let last = s.events.last().unwrap();
    assert_eq!(last.kind, Kind::Stick);
    assert_near(last.t, wide(3.0));
}

/// A free flight onto a compliant wall: contact at L/v, half a sine inside, free again after π√(m/k).
#[test]
fn a_free_mass_meets_a_spring() {
    let law = json!({ "kind": "kelvin-voigt", "release": "deflection" });
    let train = wall(law, 0.0, json!({ "contact_stiffness": 4.0 }));
    let s = told(train, json!({ "q": [-0.75], "v": [0.25] }), 8.0);
    assert_eq!(s.events.iter().map(|e| e.kind).collect::<Vec<_>>(), [Kind::DriveContact, Kind::Separation]);
    assert_near(s.events[0].t, wide(3.0));
    // π/2 in 32 digits, as the quarter period of the cosine that is zero there.
    let mut quarter = wide(std::f64::consts::FRAC_PI_2);
    let (sin, cos) = sin_cos(quarter);
    quarter = quarter + cos / sin;
    assert_near(s.events[1].t, wide(3.0) + quarter);
}

/// A mass pressed by `1/2 + cos t` at rest lets go where the force falls through zero, at 2π/3.
#[test]
fn rest_ends_where_the_force_does() {
    let loads = json!({ "load_harmonics": [{ "amplitude_n": 1.0, "frequency_rad_per_s": 1.0 }] });
    let s = told(wall(json!({ "kind": "rigid", "restitution": 0.0 }), 0.5, loads), json!("rest"), 12.0);
    assert_eq!(s.first[0], flank::hybrid::ContactMode::Drive);
    assert_eq!(s.events[0].kind, Kind::Release);
    let (sin, cos) = sin_cos(s.events[0].t);
    assert_near(cos, wide(-0.5));
    assert_near(sin, root(wide(0.75)));
    // The flight x(t) = (t − r)²/4 − cos t + cos r + (t − r)(−sin r) ends at x = 0, where the mass sticks.
    let (r, t) = (s.events[0].t, s.events[1].t);
    let d = t - r;
    let x = d * d / wide(4.0) - sin_cos(t).1 + cos - d * sin;
    assert_eq!((s.events[1].kind, s.events[2].kind), (Kind::Impact, Kind::Stick));
    assert!(size(x) < 1e-20, "{x:?}");
}

/// An undamped Hertz contact lasts `c (m²/(K² v))^(1/5)`, `c = 2 (5/4)^(2/5) √π Γ(7/5)/Γ(9/10)`.
#[test]
fn a_hertz_contact_lasts_its_time() {
    let law = json!({ "kind": "power", "exponent": "3/2", "hysteresis": "none" });
    let lasts = |k: f64, v: f64| {
        let train = wall(law.clone(), 0.0, json!({ "contact_stiffness": k }));
        let s = told(train, json!({ "q": [-v], "v": [v] }), 40.0);
        assert_near(s.events[0].t, wide(1.0));
        s.events[1].t - s.events[0].t
    };
    let one = lasts(1.0, 1.0);
    // 2 (5/4)^(2/5) √π Γ(7/5)/Γ(9/10).
    assert_near(one, super::flank_run::decimal("3.218065459719043084535930045617480438554"));
    // K → 32 K shortens it to a quarter, v → 32 v to a half: exactly.
    assert_near(lasts(32.0, 1.0) * wide(4.0), one);
    assert_near(lasts(1.0, 32.0) * wide(2.0), one);
}

/// An elastic law returns the speed: flights and contacts between two flanks all take the same times.
#[test]
fn an_elastic_power_law_returns_its_speed() {
    let law = json!({ "kind": "power", "exponent": "5/4", "hysteresis": "none" });
    let train = json!({
        "kind": "wall", "mass_kg": 1.0, "wall": { "side": "both", "half_gap_m": 0.5 }, "law": law, "contact_stiffness": 3.0,
    });
    let s = told(train, json!({ "q": [0.0], "v": [1.0] }), 20.0);
    // Flights across the gap last exactly one second, contacts all the same time.
    let t: Vec<Wide> = s.events.iter().map(|e| e.t).collect();
    assert!(t.len() > 6);
    for i in (1..t.len() - 1).step_by(2) {
        assert_near(t[i + 1] - t[i], wide(1.0));
        assert_near(t[i] - t[i - 1], t[1] - t[0]);
    }
}
