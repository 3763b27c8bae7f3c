//! Numbers with more digits than a double holds: written, read, and as switching times.

use flank::{
    hybrid::Wide,
    scene::{Scene, SceneError},
    system::Structure,
};

use super::support::run;

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

#[test]
fn two_pi_has_its_known_digits() {
    assert_eq!(Wide::TAU.decimal(32), "6.283185307179586476925286766559");
    assert_eq!((Wide::TAU * -1e6).decimal(30), "-6283185.30717958647692528676656");
}

#[test]
fn doubles_are_written_exactly() {
    assert_eq!(Wide::from(0.1).decimal(40), "0.1000000000000000055511151231257827021182");
    assert_eq!(Wide::from(0.5).decimal(30), "0.5");
    assert_eq!(Wide::from(1.0 / 1024.0).decimal(30), "0.0009765625");
    assert_eq!(Wide::from(2f64.powi(80)).decimal(30), "1.208925819614629174706176e24");
    assert_eq!(Wide::from(2f64.powi(60)).decimal(30), "1152921504606846976");
    assert_eq!(Wide::from(f64::from_bits(1)).decimal(5), "4.9407e-324");
    assert_eq!(Wide::from(0.0).decimal(5), "0");
}

#[test]
fn the_remainder_counts() {
    assert!(Wide::sum(1.0, 1e-25).decimal(40).starts_with("1.0000000000000000000000001"));
    assert!(Wide::sum(1.0, -1e-25).decimal(40).starts_with("0.9999999999999999999999999"));
}

#[test]
fn seventeen_digits_give_the_double_back() {
    let mut bits: u64 = 0x9e37_79b9_7f4a_7c15;
    for _ in 0..20_000 {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let v = f64::from_bits(bits);
        if v.is_finite() {
            assert_eq!(Wide::from(v).decimal(17).parse::<f64>(), Ok(v));
            // Forty digits against the standard library's exact ones (its ties go to even).
            let theirs = format!("{v:.39e}");
            let (digits, exponent) = theirs.split_once('e').unwrap_or_default();
            let ours = Wide::from(v).decimal(40);
            let (mine, place) = ours.split_once('e').unwrap_or((&ours, exponent));
            if ours.contains('e') {
                assert!(digits.starts_with(mine) && place == exponent, "{ours} {theirs}");
            }
        }
    }
}

#[test]
fn what_is_written_is_read_back() {
    let mut bits: u64 = 0x9e37_79b9_7f4a_7c15;
    let mut random = || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        bits
    };
    for _ in 0..2_000 {
        let hi = f64::from_bits(random());
        // A remainder of any size below half a unit in the last place of `hi`.
        let share = (random() >> 12) as f64 / 2f64.powi(53 + (random() % 40) as i32);
        let w = Wide::sum(hi, hi * f64::EPSILON * 0.49 * (share - 0.25));
        if w.hi.is_finite() && w.hi.abs() > 1e-290 {
            // All digits of both parts.
            assert_eq!(Wide::parse(&w.decimal(1_500)), Some(w), "{w:?}");
            assert_eq!(Wide::parse(&format!("{:e}", w.hi)).map(|w| w.hi), Some(w.hi));
        }
    }
    // Half way between two remainders, but for a digit behind a million zeros.
    let (low, gap) = (2f64.powi(-60), 2f64.powi(-112));
    let half = Wide { hi: low, lo: 0.5 * gap }.decimal(200);
    let (digits, exponent) = half.split_once('e').expect("a small number");
    // One and that.
    let text = |tail: &str| format!("1{}{digits}{}{tail}e{exponent}", "0".repeat(18), "0".repeat(1_000_000));
    assert_eq!(exponent, "-19");
    assert_eq!(Wide::parse(&text("")), Some(Wide { hi: 1.0, lo: low }));
    assert_eq!(Wide::parse(&text("1")), Some(Wide { hi: 1.0, lo: low + gap }));
}

#[test]
fn only_decimals_are_read() {
    for text in [
        "",
        "-",
        "1e",
        "1,5",
        " 1",
        "1 ",
        "inf",
        "-Infinity",
        "nan",
        "0x10",
        "1e400",
        "1_000",
        "1.2.3",
        "e5",
        "1e10000",
        "1e-99999999999999999999",
        "٣",
    ] {
        assert_eq!(Wide::parse(text), None, "{text:?}");
    }
    for (text, hi, lo) in [
        ("0", 0.0, 0.0),
        ("-0.0e5", 0.0, 0.0),
        ("1e-400", 0.0, 0.0),
        ("+.5", 0.5, 0.0),
        ("5.", 5.0, 0.0),
        ("25e-2", 0.25, 0.0),
        ("-1E3", -1000.0, 0.0),
        ("1e23", 1e23, 8_388_608.0),
        ("9007199254740993", 9_007_199_254_740_992.0, 1.0),
        ("-0.1", -0.1, 5.551_115_123_125_783e-18),
        ("1.00000000000000000000000000000001", 1.0, 1e-32),
    ] {
        assert_eq!(Wide::parse(text), Some(Wide { hi, lo }), "{text:?}");
    }
}

#[test]
fn rounding_carries_through_nines() {
    assert_eq!(Wide::from(0.999_999).decimal(3), "1");
    assert_eq!(Wide::from(129.5).decimal(3), "130");
    assert_eq!(Wide::from(1295.0).decimal(2), "1300");
}
