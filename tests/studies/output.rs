//! Numbers, names and tables as text.

use flank::{
    output::{Table, csv_line, five_digits, label, visible},
    scene::Scene,
};

#[test]
fn numbers_keep_five_digits() {
    for (value, text) in [
        (0.0, "0"),
        (1.0, "1"),
        (0.05, "0.05"),
        (123.456_78, "123.46"),
        (-9.81, "-9.81"),
        (3.2e-5, "3.2000e-5"),
        (5e8, "5.0000e8"),
        (100_000.0, "100000"),
    ] {
        assert_eq!(five_digits(value), text);
    }
    assert_eq!(five_digits(None), "-");
}

#[test]
fn fields_are_quoted_where_they_need_it() {
    assert_eq!(csv_line(["plain", "a,b", "say \"so\"", ""]), "plain,\"a,b\",\"say \"\"so\"\"\",");
}

/// A table that is too wide for a terminal has shorter names; one that would not fit anyway keeps them.
#[test]
fn long_names_lose_their_middle() {
    let name = "first gear of the first stage-second gear of the first stage";
    let table = |columns: usize| {
        let cells = || std::iter::repeat_n("12345678".to_owned(), columns);
        Table::new([vec!["contact".to_owned()], cells().collect()].concat())
            .with([[vec![name.to_owned()], cells().collect()].concat()])
            .fit()
            .to_string()
    };
    let widest = |text: &str| text.lines().map(|line| line.chars().count()).max();
    assert!(table(3).contains(name));
    let fitted = table(6);
    assert_eq!(widest(&fitted), Some(100));
    assert!(fitted.contains("  first gear of the … of the first stage  "), "{fitted}");
    assert!(table(9).contains(name));
}

#[test]
fn columns_line_up() {
    let table = Table::new(["name", "value"]).with([vec!["a".to_owned(), "1".to_owned()], vec!["longer".to_owned()]]);
    assert_eq!(table.to_string(), "  name    value\n  a           1\n  longer\n");
    assert_eq!(label(flank::plot::Verdict::Agrees), "agrees");
}

/// What a terminal would obey or a spreadsheet compute is written so that it is only read.
#[test]
fn names_are_data() {
    let name = "a\u{1b}[31mb\nc\u{202e}d\u{7f} Zahnrad 齿轮";
    assert_eq!(visible(name), r"a\u{1b}[31mb\u{a}c\u{202e}d\u{7f} Zahnrad 齿轮");
    assert_eq!(csv_line(["=1+1", "-5.0e-3", "+x", "@a", "-", "a\"b", "1"]), "'=1+1,-5.0e-3,'+x,'@a,-,\"a\"\"b\",1");
    let scene = r#"{ "flank": 1, "name": "one\ntwo\u001b[2J", "note": "two\nlines",
        "train": { "kind": "wall", "mass_kg": 1, "wall": { "side": "below", "position_m": 0 }, "law": { "kind": "rigid", "restitution": 0.8 } },
        "initial": { "q": [1] }, "run": { "t_end_s": 1 } }"#;
    let scene = Scene::from_json(scene, "file\rname").unwrap();
    assert_eq!(scene.name(), r"file\u{d}name");
    assert_eq!(scene.given()["name"], r"one\u{a}two\u{1b}[2J");
    assert_eq!(scene.given()["note"], "two\nlines");
}
