//! Switching times with more digits than a double holds.

use flank::{
    hybrid::Wide,
    scene::{Scene, SceneError},
    train::Structure,
};

use crate::support::run;

/// A mass that a load of 1 N holds against a spring of 1 N/m, which becomes 4 N/m at `times`.
fn held(times: &str, load: &str) -> Result<Scene, SceneError> {
    let stiffness = format!(r#"{{ "kind": "switched", "levels": [1, 4], "times_s": {times} }}"#);
    let law = r#"{ "kind": "kelvin-voigt", "damping_n_s_per_m": 0 }"#;
    let contact = format!(
        r#"{{ "direction": [1], "flanks": "drive", "half_backlash_m": 0, "stiffness": {stiffness}, "law": {law} }}"#
    );
    let train = format!(r#"{{ "kind": "matrices", "mass_kg": [1], "load_n": [1], {load} "contacts": [{contact}] }}"#);
    Scene::from_json(
        &format!(r#"{{ "flank": 1, "train": {train}, "initial": {{ "q": [1] }}, "run": {{ "t_end_s": 1 }} }}"#),
        "held",
    )
}

/// With 4 N/m the mass leaves the flank where `cos 2t = −1/3` after the switch.
#[test]
fn a_switch_happens_at_the_instant_that_is_written() {
    let flight = 0.5 * (-1.0f64 / 3.0).acos();
    // A harmonic of no amplitude gives the clock a period.
    let harmonic = r#""load_harmonics": [{ "vector_n": [0], "frequency_rad_per_s": 0.7 }],"#;
    for (text, own) in [
        ("\"1000.1\"", "1000.1"),
        ("1000.1", "1000.1000000000000227373675443232059478759765625"),
        ("\"1000.1000000000000000000000000001\"", "1000.1000000000000000000000000001"),
        ("\"0.00010001e7\"", "1000.1"),
    ] {
        for load in ["", harmonic] {
            let scene = held(&format!("[{text}]"), load).unwrap();
            let structure = Structure::new(scene.build().unwrap().spec).unwrap();
            let run = run(&structure, &[1.0], &[0.0], 1010.0);
            let released = run.records.iter().find(|record| !record.fired.is_empty()).unwrap();
            let after = structure.clock().time(released.at) - Wide::parse(own).unwrap();
            // The time after the switch, not since the start, sets the error.
            let off = (after - flight.into()).value();
            assert!(off.abs() <= 8.0 * f64::EPSILON * flight, "{text} {load}: {off}");
        }
    }
}

#[test]
fn times_as_text_are_checked_and_kept() {
    let scene = held(r#"[1, "1.0000000000000000000001", "2.5e0"]"#, "").unwrap();
    let shown = scene.resolved().pointer("/train/contacts/0/stiffness/times_s").unwrap().to_string();
    assert_eq!(shown, r#"[1.0,"1.0000000000000000000001","2.5e0"]"#);
    assert_eq!(Scene::from_value(scene.resolved().clone(), "again").unwrap().resolved(), scene.resolved());
    assert_ne!(scene.hash(), held("[1, 1.0000000000000002, 2.5]", "").unwrap().hash());
    for (times, at, said) in [
        (r#"["1,5"]"#, "/times_s/0", "a decimal number in quotation marks"),
        (r#"[1, "nan"]"#, "/times_s/1", "write digits"),
        (r#"["1e400"]"#, "/times_s/0", "below 1.8e308"),
        (r#"[true]"#, "/times_s/0", "a finite number; or a decimal number in quotation marks"),
        (r#"["1.00000000000000000000000002", "1.00000000000000000000000001"]"#, "/times_s", "times that rise strictly"),
        (r#"["1", 1]"#, "/times_s", "times that rise strictly"),
    ] {
        let error = held(times, "").unwrap_err();
        assert!(error.faults.iter().any(|fault| fault.pointer.ends_with(at)), "{times}: {error}");
        assert!(error.to_string().contains(said), "{times}: {error}");
    }
}
