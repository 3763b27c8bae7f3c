//! What pictures are made of: scales, names side by side, lines cut at the frame, legends. A module of `plot::draw`, whose parts
//! are its own.

use serde_json::{Value, json};

use super::{
    frame::Frame,
    legend::{Symbol, entries},
    scale::{Scale, axis_label},
    words::{Ink, side_by_side},
};
use crate::plot::{Axis, Band, Panel, Series, Style, report::rounded};

fn labels(low: f64, high: f64, logarithmic: bool) -> Vec<String> {
    let axis = Axis { range: Some([low, high]), logarithmic, ..Axis::default() };
    let scale = Scale::fit(&axis, std::iter::empty(), 0.0).ticked(5);
    scale.labels().into_iter().map(|(_, text)| text).collect()
}

#[test]
fn ticks_are_round_numbers() {
    assert_eq!(labels(0.0, 1.0, false), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    assert_eq!(labels(-3.0, 3.0, false), ["−3", "−2", "−1", "0", "1", "2", "3"]);
    assert_eq!(labels(0.0, 0.05, false), ["0.00", "0.01", "0.02", "0.03", "0.04", "0.05"]);
    assert_eq!(labels(0.0, 5e8, false), ["0", "100", "200", "300", "400", "500"]);
    assert_eq!(labels(0.0, 2e-6, false), ["0.0", "0.5", "1.0", "1.5", "2.0"]);
    assert_eq!(labels(1e-7, 1.0, true), ["10⁻⁶", "10⁻⁴", "0.01", "1"]);
    assert_eq!(labels(1.0, 100.0, true), ["1", "2", "5", "10", "20", "50", "100"]);
    assert_eq!(labels(3.0, 3.4, true), ["3.0", "3.1", "3.2", "3.3", "3.4"]);
}

#[test]
fn any_values_get_a_range() {
    let fit = |values: &[f64], logarithmic| {
        let axis = Axis { logarithmic, ..Axis::default() };
        let scale = Scale::fit(&axis, values.iter().copied(), 0.05).ticked(5);
        assert!(scale.low < scale.high && scale.low.is_finite() && scale.high.is_finite(), "{values:?}");
        assert!(scale.labels().len() < 20, "{values:?}");
        (scale.low, scale.high)
    };
    assert_eq!(fit(&[], false), (0.0, 1.0));
    assert_eq!(fit(&[], true), (1.0, 10.0));
    assert_eq!(fit(&[-1.0, 0.0], true), (1.0, 10.0));
    assert_eq!(fit(&[0.0], false), (0.0, 1.0));
    assert_eq!(fit(&[0.0, 10.0], false), (0.0, 10.5));
    for values in [[1e-320, 1e-310], [1e299, 1e299], [-1e300, 1e300], [5.0, 5.0 + 1e-15], [f64::NAN, 2.0]] {
        fit(&values, false);
        fit(&values, true);
    }
}

#[test]
fn the_axis_names_its_unit() {
    assert_eq!(axis_label(&Axis::new("force", "N"), 0), "force [N]");
    assert_eq!(axis_label(&Axis::new("stiffness", "N/m"), 6), "stiffness [10⁶ N/m]");
    assert_eq!(axis_label(&Axis::new("part", ""), -6), "part [10⁻⁶]");
    assert_eq!(axis_label(&Axis::new("part", ""), 0), "part");
}

#[test]
fn names_stand_side_by_side() {
    // Far apart they stay; close ones are moved by 6 px of space; at the edge they are moved inwards.
    assert_eq!(side_by_side(&[[20.0, 20.0], [80.0, 20.0]], [0.0, 100.0]), [Some(20.0), Some(80.0)]);
    assert_eq!(side_by_side(&[[40.0, 20.0], [50.0, 20.0]], [0.0, 100.0]), [Some(40.0), Some(66.0)]);
    assert_eq!(side_by_side(&[[80.0, 20.0], [99.0, 20.0]], [0.0, 100.0]), [Some(64.0), Some(90.0)]);
    assert_eq!(side_by_side(&[[50.0, 60.0], [50.0, 60.0]], [0.0, 100.0]), [None, Some(70.0)]);
}

#[test]
fn ink_is_where_the_curve_runs() {
    let mut ink = Ink::default();
    ink.line(&[[0.0, 0.0], [100.0, 0.0], [100.0, 50.0]]);
    assert_eq!(ink.under([10.0, 10.0, 90.0, 40.0]), 0);
    assert!(ink.under([90.0, 20.0, 110.0, 40.0]) > 5);
    assert!(ink.under([-5.0, -5.0, 5.0, 5.0]) > 0);
}

#[test]
fn a_name_has_one_entry_with_all_its_looks() {
    let series = |name: &str, colour| Series { name: name.into(), colour, ..Series::default() };
    let band = Band { name: "a".into(), colour: 3, ..Band::default() };
    let first = Panel { series: vec![series("a", 0), series("", 1), series("b", 2)], ..Panel::default() };
    let second = Panel { series: vec![series("a", 1), series("a", 0)], bands: vec![band], ..Panel::default() };
    let panels = [first, second];
    let found = entries(&panels);
    assert_eq!(found.iter().map(|entry| entry.name).collect::<Vec<_>>(), ["a", "b", "a"]);
    assert!(found[0].looks == [Symbol::Series(Style::Line, 0), Symbol::Series(Style::Line, 1)]);
    assert!(found[2].looks == [Symbol::Band(3)]);
}

#[test]
fn lines_end_at_the_frame() {
    let frame = Frame { x0: 0.0, x1: 10.0, y0: 0.0, y1: 10.0 };
    let zigzag = [[-5.0, 5.0], [5.0, 5.0], [5.0, 15.0], [7.0, 15.0], [7.0, 5.0], [8.0, 5.0]];
    let pieces = frame.clipped(&zigzag);
    assert_eq!(pieces, [vec![[0.0, 5.0], [5.0, 5.0], [5.0, 10.0]], vec![[7.0, 10.0], [7.0, 5.0], [8.0, 5.0]]]);
    assert_eq!(frame.clip([-1.0, 3.0], [3.0, -1.0]), Some([[0.0, 2.0], [2.0, 0.0]]));
    assert_eq!(frame.clip([-1.0, 0.5], [0.5, -1.0]), None);
}

#[test]
fn numbers_of_the_page_are_short_and_near() {
    assert_eq!(rounded(1.0 / 3.0, 1.0, false), json!(0.333_333));
    assert_eq!(rounded(2.0, 1.0, false), json!(2));
    assert_eq!(rounded(10.000_000_123_4, 1e-6, false), json!(10.000_000_123_4));
    assert_eq!(rounded(1.234_567_89e-7, 10.0, true), json!(1.234_57e-7));
    assert_eq!(rounded(-1e-9, 1.0, false), json!(0));
    assert_eq!(rounded(f64::NAN, 1.0, false), Value::Null);
}
