//! Figures as data and as pictures.
#![cfg(feature = "plot")]

use crate::figures;
use std::sync::Arc;

use flank::plot::{
    Axis, Figure, Guide, Item, Panel, Print, Raster, Report, SEQUENCE, Section, Series, Style, Table, TableCell, Theme,
    Verdict,
};
use resvg::{
    tiny_skia::Pixmap,
    usvg::{Group, Node, Options, Rect, Tree, fontdb::Database, roxmltree::Document},
};
use serde_json::Value;

/// The fields of a CSV text (RFC 4180).
fn rows(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut field, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match (c, quoted) {
            ('"', true) if chars.peek() == Some(&'"') => field.push(chars.next().unwrap()),
            ('"', _) => quoted = !quoted,
            (',', false) => row.push(std::mem::take(&mut field)),
            ('\r', false) => {
                assert_eq!(chars.next(), Some('\n'));
                row.push(std::mem::take(&mut field));
                rows.push(std::mem::take(&mut row));
            }
            _ => field.push(c),
        }
    }
    assert!(!quoted && field.is_empty() && row.is_empty(), "the last row ends");
    rows
}

#[test]
fn csv_holds_every_number_in_full() {
    for figure in figures::all().into_iter().chain([figures::hard()]) {
        let table = rows(&figure.csv());
        assert_eq!(
            table[0].join(" "),
            "panel panel_title kind name x x_label x_unit y y_label y_unit value value_unit"
        );
        let mut rest = table[1..].iter();
        let number = |field: &str| field.parse::<f64>().unwrap().to_bits();
        for (i, panel) in figure.panels.iter().enumerate() {
            for series in &panel.series {
                for (x, y) in series.x.iter().zip(&series.y) {
                    let row = rest.next().unwrap();
                    assert_eq!(row[..4], [&(i + 1).to_string(), &panel.title, "series", &series.name]);
                    assert_eq!([number(&row[4]), number(&row[7])], [x.to_bits(), y.to_bits()]);
                    let axes = [&panel.x.label, &panel.x.unit, &panel.y.label, &panel.y.unit];
                    assert_eq!([&row[5], &row[6], &row[8], &row[9]], axes);
                }
            }
            let slanted = panel.guides.iter().filter(|guide| matches!(guide, Guide::Slanted { .. })).count();
            let others = 2 * (panel.bands.len() + panel.tiles.len()) + panel.guides.len() + slanted + panel.notes.len();
            assert!(rest.by_ref().take(others).all(|row| ["band", "tile", "guide", "note"].contains(&row[2].as_str())));
        }
        assert_eq!(rest.next(), None);
    }
}

#[test]
fn an_axis_says_which_number_of_a_scene_it_shows() {
    for (pointer, label, unit) in [
        ("/train/speed_rpm", "speed", "rev/min"),
        ("/train/transmission_error/0/frequency,/train/period_s", "transmission error 0, frequency", ""),
        ("/train/sun/mesh/stiffness_n_per_m", "sun, mesh, stiffness", "N/m"),
        ("/train/load/drag_torque_nm_per_rpm", "load, drag torque", "N m/(rev/min)"),
        ("/train/law/restitution", "law, restitution", ""),
        ("/initial/q/u_s", "q u_s at the start", "m"),
        ("/initial/v/0", "v 0 at the start", "m/s"),
    ] {
        let axis = Axis::of_number(pointer, false);
        assert_eq!((axis.label.as_str(), axis.unit.as_str()), (label, unit));
    }
    assert_eq!(Axis::of_number("/initial/q/0", true).unit, "");
}

#[test]
fn json_holds_every_number_in_full() {
    for figure in figures::all().into_iter().chain([figures::hard()]) {
        let read: Value = serde_json::from_str(&figure.json()).unwrap();
        assert_eq!(read["title"], figure.title.as_str());
        for (panel, value) in figure.panels.iter().zip(read["panels"].as_array().unwrap()) {
            assert_eq!(value["y"]["unit"], panel.y.unit.as_str());
            for (series, value) in panel.series.iter().zip(value["series"].as_array().unwrap()) {
                for (numbers, name) in [(&series.x, "x"), (&series.y, "y")] {
                    let read: Vec<u64> =
                        value[name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap().to_bits()).collect();
                    assert_eq!(read, numbers.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
                }
            }
        }
    }
}

/// All texts of an SVG, those of one title broken into lines joined again.
fn texts(drawn: &str) -> String {
    let document = Document::parse(drawn).unwrap();
    let nodes = document.descendants().filter(|node| node.has_tag_name("text"));
    nodes.map(|node| node.text().unwrap().trim().to_owned()).collect::<Vec<_>>().join(" ")
}

/// All that a figure must say.
fn words(figure: &Figure) -> Vec<String> {
    let mut words = vec![figure.title.clone()];
    for panel in &figure.panels {
        words.extend([panel.title.clone(), panel.x.label.clone(), panel.x.unit.clone()]);
        words.extend([panel.y.label.clone(), panel.y.unit.clone()]);
        words.extend(panel.series.iter().map(|series| series.name.clone()));
        words.extend(panel.bands.iter().map(|band| band.name.clone()));
        words.extend(panel.tiles.iter().map(|tile| tile.name.clone()));
        words.extend(panel.notes.iter().map(|note| note.text.clone()));
        words.extend(panel.guides.iter().map(|guide| match guide {
            Guide::Vertical { name, .. } | Guide::Horizontal { name, .. } | Guide::Slanted { name, .. } => name.clone(),
        }));
    }
    words.into_iter().map(|word| word.replace(|c: char| c.is_control(), " ").trim().to_owned()).collect()
}

#[test]
fn a_picture_says_what_the_figure_says() {
    for figure in figures::all().into_iter().chain([figures::hard()]) {
        for theme in [Theme::Light, Theme::Dark] {
            let drawn = texts(&figure.svg(theme));
            for word in words(&figure) {
                assert!(drawn.contains(&word), "{}: `{word}` is missing", figure.id);
            }
        }
        assert_ne!(figure.svg(Theme::Light), figure.svg(Theme::Dark));
    }
}

fn tree(figure: &Figure) -> Tree {
    let mut fonts = Database::new();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.load_font_data(dejavu::sans::bold().to_vec());
    let options = Options { fontdb: Arc::new(fonts), ..Options::default() };
    Tree::from_str(&figure.svg(Theme::Light), &options).unwrap()
}

/// The letters' boxes, and those of all shapes.
fn boxes(group: &Group, letters: &mut Vec<(String, Rect)>, shapes: &mut Vec<Rect>) {
    for node in group.children() {
        match node {
            Node::Group(group) => boxes(group, letters, shapes),
            Node::Text(text) => {
                let words = text.chunks().iter().map(|chunk| chunk.text()).collect();
                letters.push((words, text.abs_bounding_box()));
            }
            other => shapes.push(other.abs_bounding_box()),
        }
    }
}

#[test]
fn words_do_not_overlap_and_nothing_leaves_the_sheet() {
    for figure in figures::all().into_iter().chain([figures::hard()]) {
        let tree = tree(&figure);
        let (mut letters, mut shapes) = (Vec::new(), Vec::new());
        boxes(tree.root(), &mut letters, &mut shapes);
        // No font is missing: every word has letters.
        assert!(letters.len() > 10 && letters.iter().all(|(_, room)| room.width() > 0.0), "{}", figure.id);
        for (i, (words, a)) in letters.iter().enumerate() {
            for (others, b) in &letters[..i] {
                let apart =
                    a.left() >= b.right() || b.left() >= a.right() || a.top() >= b.bottom() || b.top() >= a.bottom();
                assert!(apart, "{}: `{words}` lies on `{others}`: {a:?} {b:?}", figure.id);
            }
        }
        let [width, height] = [tree.size().width(), tree.size().height()];
        for room in letters.iter().map(|(_, room)| room).chain(&shapes) {
            let inside = room.left() >= 0.0 && room.top() >= 0.0 && room.right() <= width && room.bottom() <= height;
            assert!(inside, "{}: {room:?}", figure.id);
        }
    }
}

#[test]
fn the_names_of_guides_do_not_hide_the_stems_they_mark() {
    let mut figure = figures::spectrum();
    let panel = &mut figure.panels[0];
    panel.notes.clear();
    panel.guides = panel.series[0].x.iter().map(|x| Guide::Vertical { x: *x, name: "harmonic".into() }).collect();
    let tree = tree(&figure);
    let (mut letters, mut shapes) = (Vec::new(), Vec::new());
    boxes(tree.root(), &mut letters, &mut shapes);
    // The points on top of the stems are the only circles of this size.
    let is_top = |room: &&Rect| (room.width() - 3.8).abs() < 0.01 && (room.height() - 3.8).abs() < 0.01;
    let tops: Vec<&Rect> = shapes.iter().filter(is_top).collect();
    assert_eq!(tops.len(), figure.panels[0].guides.len());
    let names: Vec<&Rect> = letters.iter().filter(|(words, _)| words == "harmonic").map(|(_, room)| room).collect();
    assert_eq!(names.len(), tops.len());
    for (name, top) in names.iter().flat_map(|name| tops.iter().map(move |top| (name, top))) {
        let apart = name.left() >= top.right()
            || top.left() >= name.right()
            || name.bottom() <= top.top()
            || top.bottom() <= name.top();
        assert!(apart, "{name:?} {top:?}");
    }
}

#[test]
fn a_png_has_its_size_and_its_colours() {
    let figure = figures::forces(500);
    let drawn = figure.svg(Theme::Light);
    let document = Document::parse(&drawn).unwrap();
    let side = |name: &str| document.root_element().attribute(name).unwrap().parse::<f64>().unwrap();
    for scale in [1.0, 2.0, 0.5] {
        let picture = Pixmap::decode_png(&figure.png(scale)).unwrap();
        let expected = [side("width") * scale, side("height") * scale].map(|length| length.round() as u32);
        assert_eq!([picture.width(), picture.height()], expected);
    }
    let picture = Pixmap::decode_png(&figure.png(2.0)).unwrap();
    let count = |rgb: [u8; 3]| picture.pixels().iter().filter(|p| [p.red(), p.green(), p.blue()] == rgb).count();
    // The curves: 1.5 px wide, and longer than the frame is wide (over 700 px), at two pixels to one.
    for series in [[0x00, 0x72, 0xb2], [0xd5, 0x5e, 0x00]] {
        assert!(count(series) > 700 * 3, "{series:x?}: {}", count(series));
    }
    let paper = count([0xff, 0xff, 0xff]) as f64 / picture.pixels().len() as f64;
    assert!((0.4..0.9).contains(&paper), "{paper}");
}

#[test]
fn equal_figures_give_equal_bytes() {
    let figure = figures::waterfall();
    let drawn = (figure.svg(Theme::Dark), figure.png(1.0), figure.csv());
    let others = std::thread::spawn(|| {
        let figure = figures::waterfall();
        assert!(!figures::spectrum().svg(Theme::Dark).is_empty());
        (figure.svg(Theme::Dark), figure.png(1.0), figure.csv())
    });
    assert!(drawn == others.join().unwrap());
}

#[test]
fn odd_figures_are_drawn_and_say_what_is_missing() {
    let with = |x: Axis, y: Axis, points: &[(f64, f64)], style| {
        let (xs, ys) = points.iter().copied().unzip();
        let panel = Panel { x, y, series: vec![Series::line("s", 0, xs, ys).styled(style)], ..Panel::default() };
        Figure { id: "odd".into(), title: "odd".into(), panels: vec![panel], ..Figure::default() }
    };
    let plain = || Axis::new("x", "m");
    let logarithmic = || Axis { logarithmic: true, ..Axis::new("y", "m") };
    let figures = [
        (Figure::default(), 0),
        (Figure { panels: vec![Panel::default(), Panel::default()], columns: 9, ..Figure::default() }, 0),
        (with(plain(), plain(), &[], Style::Line), 0),
        (with(plain(), plain(), &[(1.0, 2.0)], Style::Line), 0),
        (with(plain(), plain(), &[(0.0, 0.0)], Style::Stems), 0),
        (with(plain(), plain(), &[(1.0, 5.0), (2.0, 5.0), (3.0, 5.0)], Style::Joined), 0),
        (with(plain(), plain(), &[(1.0, 5.0), (2.0, 5.0 + 1e-15)], Style::Line), 0),
        (with(plain(), plain(), &[(-1e300, 1e-300), (1e300, 2e-300)], Style::Line), 0),
        (
            with(
                plain(),
                plain(),
                &[(1e-320, 1e308), (f64::NAN, 1.0), (1.0, f64::INFINITY), (2.0, 2.0)],
                Style::Points,
            ),
            3,
        ),
        (with(plain().between(0.4, 0.6), plain().between(1.0, -1.0), &[(0.0, 0.0), (1.0, 9.0)], Style::Dashed), 0),
        (with(plain(), logarithmic(), &[(0.0, -1.0), (1.0, 0.0), (2.0, 1e-9), (3.0, 1e9)], Style::Line), 2),
        (with(logarithmic(), logarithmic(), &[(-1.0, -1.0)], Style::Marks), 1),
        (with(plain(), logarithmic().between(-1.0, 10.0), &[(1.0, 2.0), (2.0, 3.0)], Style::Stems), 0),
    ];
    for (i, (figure, missing)) in figures.into_iter().enumerate() {
        let drawn = figure.svg(Theme::Light);
        let words = texts(&drawn);
        assert!(!words.contains("NaN") && !words.contains("inf"), "{i}: {words}");
        let expected = if missing == 1 { "1 point has" } else { &format!("{missing} points have") };
        let said = words.contains(&format!("{expected} no place on these axes"));
        assert_eq!(said, missing > 0, "{i}: {words}");
        let picture = Pixmap::decode_png(&figure.png(1.0)).unwrap();
        assert!(figure.panels.is_empty() || picture.pixels().iter().any(|pixel| pixel.red() < 0xa0), "{i}");
        let (mut letters, mut shapes) = (Vec::new(), Vec::new());
        let tree = tree(&figure);
        boxes(tree.root(), &mut letters, &mut shapes);
        let inside = |room: &Rect| {
            room.left() >= 0.0 && room.right() <= tree.size().width() && room.bottom() <= tree.size().height()
        };
        assert!(shapes.iter().all(inside), "{i}");
        let section = Section { items: vec![Item::Figure(figure)], ..Section::default() };
        let page = Report { sections: vec![section], ..Report::default() }.html();
        assert!(page.contains("<figure id=\"odd\">") || page.contains("<figure id=\"\">"));
    }
}

fn report(figures: Vec<Figure>) -> Report {
    let table = Table {
        title: "Numbers".into(),
        head: ["quantity", "Flank", "verdict"].map(String::from).to_vec(),
        rows: vec![vec!["<i>k</i>".into(), "1".into(), TableCell::judged("differs", Verdict::Deviates)]],
        note: "a & b".into(),
    };
    let items = figures.into_iter().map(Item::Figure).chain([Item::Table(table)]).collect();
    Report {
        title: "Study <1>".into(),
        summary: vec!["First.".into(), "Second.".into()],
        sections: vec![Section { title: "All & everything".into(), text: "One.\n\nTwo.".into(), items }],
        provenance: vec!["Flank <test>".into()],
        files: Some("figures/".into()),
    }
}

#[test]
fn the_page_needs_nothing_else() {
    let page = report(figures::all().into_iter().chain([figures::hard()]).collect());
    let html = page.html();
    assert_eq!(html, page.html());
    // A namespace is a name, and a clip path lies in the page.
    let ours = html.replace("http://www.w3.org/2000/svg", "").replace("url(#", "");
    assert!(ours.contains("default-src 'none'"));
    for forbidden in ["http:", "https:", "url(", "@import", "fetch(", "XMLHttpRequest", "src="] {
        assert!(!ours.contains(forbidden), "{forbidden}");
    }
    for expected in [
        "<h1>Study &lt;1&gt;</h1>",
        "<a href=\"#section-1\">All &amp; everything</a>",
        "<td class=\"deviates\"><span>≠</span> differs</td>",
        "<td>&lt;i&gt;k&lt;/i&gt;</td>",
        "href=\"figures/waterfall.csv\"",
        "figures/mesh-forces.svg",
    ] {
        assert!(ours.contains(expected), "{expected}");
    }
    // Every script element of ours ends where it should: one for each figure, and the page's own.
    assert_eq!(ours.matches("</script>").count(), figures::all().len() + 1 + 1);
}

#[test]
fn a_large_page_stays_below_four_megabytes() {
    let mut all = figures::all();
    all.extend([figures::forces(24_000), figures::forces(24_000), figures::spectrum(), figures::against_load()]);
    all.extend([figures::mode_shapes(), figures::waterfall()]);
    let points: usize = all.iter().flat_map(|f| &f.panels).flat_map(|p| &p.series).map(|s| s.x.len()).sum();
    assert!(all.len() == 13 && points > 100_000, "{} figures, {points} points", all.len());
    let length = report(all).html().len();
    assert!(length < 4_000_000, "{length}");
}

/// A figure for a paper has the width that is asked for, in millimetres, and letters of the size that is asked for; PDF and PNG follow.
#[test]
fn figures_have_the_size_that_a_paper_wants() {
    let figure = figures::all().into_iter().find(|figure| figure.columns > 1).unwrap();
    for (size, width, height) in [("85mm", 85.0, None), ("178mm", 178.0, None), ("120x80mm", 120.0, Some(80.0))] {
        for points in [7.0, 10.0] {
            let print = Print::default().sized(size).unwrap().lettered(points).unwrap();
            let svg = figure.printed(&print, Theme::Light);
            assert!(svg.contains(&format!("width=\"{width:.3}mm\"")), "{}", &svg[..200]);
            let of = |name: &str| svg.split_once(&format!("{name}=\"")).unwrap().1.split_once("mm").unwrap().0;
            if let Some(height) = height {
                // Whole pixels of the sheet.
                assert!((of("height").parse::<f64>().unwrap() - height).abs() < 0.4, "{}", of("height"));
            }
            // Numbers at axes: 11 pixels of the sheet, which is scaled to the width.
            let sheet: f64 = svg.split_once("viewBox=\"0 0 ").unwrap().1.split_once(' ').unwrap().0.parse().unwrap();
            let letters = 11.0 * width / (sheet / 10.0) / 25.4 * 72.0;
            assert!((letters - points).abs() < 0.02 * points, "{size}: {letters} for {points}");
            let pdf = figure.pdf(&print).unwrap();
            assert!(pdf.starts_with(b"%PDF-") && pdf == figure.pdf(&print).unwrap());
        }
    }
    // One panel without the figure's title has fewer words.
    let one = Print { panels: vec![2], has_titles: false, ..Print::default() };
    let words = |svg: &str| svg.matches("<text").count();
    assert!(words(&figure.printed(&one, Theme::Light)) < words(&figure.svg(Theme::Light)));
    for bad in ["8mm", "wide", "85x", "1x2x3", "2000mm"] {
        assert!(Print::default().sized(bad).is_err(), "{bad}");
    }
    assert!(Print::default().lettered(2.0).is_err());
}

/// Two rows of three cells: classes of 6 dB up to the largest value, values in the data, and pixels in the page's data.
#[test]
fn levels_fall_into_classes() {
    let values = vec![Some(41.0), Some(36.0), None, Some(35.9), Some(-80.0), Some(0.5)];
    let raster = Raster { x: [0.0, 3.0], y: [10.0, 30.0], columns: 3, values, ..Raster::default() };
    let raster = raster.of_levels((41.0, 6.0), "dB");
    // The highest class is 36 to 42; the lowest, below 0, also holds what has no value.
    assert_eq!(raster.points, [7, 7, 0, 6, 0, 1]);
    assert_eq!((raster.classes[7].0.as_str(), raster.classes[7].1), ("36 to 42", SEQUENCE[7]));
    assert_eq!(raster.classes[0].0, "below 0");
    let panel = Panel { x: Axis::new("f", "Hz"), y: Axis::new("n", ""), raster: Some(raster), ..Panel::default() };
    let figure = Figure { id: "levels".to_owned(), columns: 1, panels: vec![panel], ..Figure::default() };
    let table = rows(&figure.csv());
    let cells: Vec<[&str; 4]> =
        table[1..].iter().map(|row| [&row[2], &row[4], &row[7], &row[10]].map(String::as_str)).collect();
    assert_eq!(cells[0], ["cell", "0.5", "25.0", "41.0"]);
    assert_eq!(cells[2], ["cell", "0.5", "15.0", "35.9"]);
    assert_eq!(cells.len(), 5);
    let items = vec![Item::Figure(figure)];
    let report = Report { sections: vec![Section::new("", "", items)], ..Report::default() };
    assert!(report.html().contains("\"points\":\"770601\""));
}
