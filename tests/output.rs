//! Numbers, names and tables as text.

use flank::output::{Table, csv_line, five_digits, label};

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
