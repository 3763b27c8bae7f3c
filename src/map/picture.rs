//! Pictures of maps, basins and diagrams.

use super::{
    basins::BasinResult,
    cell::Impacts,
    diagram::{BANDS, BranchLine, EXPONENTS, PHASES, Points, SECTIONS, SPEEDS, ThinPoints},
    edges::Measured,
    tally::{Class, PictureCell, Tally},
};
use crate::{
    plot::{Axis, Colour, Figure, Guide, Panel, Raster, SEQUENCE, Series, Style},
    sweep::Grid,
};

/// Periods with a colour of their own; the last one stands for all longer ones.
const PERIODS: [(u64, Colour); 8] = [
    (1, [0xd6, 0xe6, 0xf4]),
    (2, [0x6b, 0xae, 0xd6]),
    (3, [0x00, 0x9e, 0x73]),
    (4, [0x21, 0x71, 0xb5]),
    (5, [0xf0, 0xe4, 0x42]),
    (6, [0x7f, 0xcd, 0xa0]),
    (8, [0x08, 0x30, 0x6b]),
    (u64::MAX, [0x99, 0x8e, 0xc3]),
];
/// The other kinds, and failed cells.
const KINDS: [(&str, Colour); 5] = [
    ("chaotic", [0xe6, 0x9f, 0x00]),
    ("quasi-periodic", [0xcc, 0x79, 0xa7]),
    ("transient", [0xd5, 0x5e, 0x00]),
    ("undecided", [0x00, 0x00, 0x00]),
    ("failed", [0x80, 0x86, 0x8e]),
];
/// Colours of exponents: below zero, from far to near; above it, from near to far.
const BELOW: [Colour; 4] = [[0x21, 0x66, 0xac], [0x67, 0xa9, 0xcf], [0xb0, 0xd3, 0xe8], [0xe4, 0xf0, 0xf6]];
const ABOVE: [Colour; 4] = [[0xfd, 0xe0, 0xc5], [0xfc, 0xa6, 0x5d], [0xe6, 0x61, 0x01], [0x8a, 0x2c, 0x02]];
/// Colours of no impacts, of impacts on one flank, on both.
const IMPACTS: [Colour; 3] = [SEQUENCE[1], SEQUENCE[4], SEQUENCE[7]];
/// Colour of a missing value.
const NONE: Colour = [0xcf, 0xcf, 0xcf];

/// Returns the look of a class: its index, its name without counts, and its colour.
pub(super) fn look((kind, period): &Class) -> (usize, String, Colour) {
    if let Some(period) = period {
        let place = PERIODS.iter().position(|(p, _)| period <= p && (*p == *period || *p == u64::MAX));
        let place = place.unwrap_or(PERIODS.len() - 1);
        let (p, colour) = PERIODS[place];
        let name = if p == u64::MAX { "other periods".to_owned() } else { format!("period {p}") };
        return (place, name, colour);
    }
    let place = KINDS.iter().position(|(name, _)| name == kind).unwrap_or(KINDS.len() - 1);
    (PERIODS.len() + place, kind.clone(), KINDS[place].1)
}

/// Returns a number with separated thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Position of the shown cells along one number: upwards, cells of equal size.
struct Side {
    axis: Axis,
    ends: [f64; 2],
    cells: usize,
    is_flipped: bool,
}

impl Side {
    /// Returns the side of an axis. Equal ratios have a logarithmic axis; values that were listed are numbered.
    fn new(axis: &crate::sweep::Axis, cells: usize, dimensionless: bool) -> Self {
        let [first, last] = [axis.value(0), axis.value(axis.count() - 1)];
        let drawn = Axis::of_number(&axis.pointer, dimensionless);
        if axis.is_list() || axis.is_geometric() && first < 0.0 {
            let label = format!("value of {}, by its number", drawn.label);
            let ends = [0.5, axis.count() as f64 + 0.5];
            return Self { axis: Axis::new(label, ""), ends, cells, is_flipped: false };
        }
        // A cell reaches half a step to both sides of its value.
        let half = 0.5 / (cells.max(2) - 1) as f64;
        let [a, b] = if axis.is_geometric() {
            let ratio = libm::pow(last / first, half);
            [first / ratio, last * ratio]
        } else {
            [first - half * (last - first), last + half * (last - first)]
        };
        let drawn = Axis { logarithmic: axis.is_geometric(), ..drawn };
        Self { axis: drawn, ends: [a.min(b), a.max(b)], cells, is_flipped: first > last }
    }
}

/// Position of the shown cells of a grid: the first number to the right, the second one upwards.
pub(super) struct CellLayout {
    sides: [Side; 2],
}

impl CellLayout {
    pub fn new(grid: &Grid, cells: [usize; 2], dimensionless: bool) -> Self {
        Self { sides: [0, 1].map(|i| Side::new(&grid.axes()[i], cells[i], dimensionless)) }
    }

    pub fn panel(&self, title: &str, raster: Raster) -> Panel {
        let [x, y] = [0, 1].map(|i| self.sides[i].axis.clone().between(self.sides[i].ends[0], self.sides[i].ends[1]));
        Panel { title: title.to_owned(), x, y, raster: Some(raster), ..Panel::default() }
    }

    /// Returns the image of `class` of each cell, the second number fastest.
    pub fn raster(&self, class: impl Fn(usize) -> u8, classes: Vec<(String, Colour)>) -> Raster {
        let [x, y] = &self.sides;
        let mut points = Vec::with_capacity(x.cells * y.cells);
        for row in 0..y.cells {
            for column in 0..x.cells {
                let i = if x.is_flipped { x.cells - 1 - column } else { column };
                let j = if y.is_flipped { row } else { y.cells - 1 - row };
                points.push(class(i * y.cells + j));
            }
        }
        Raster { x: x.ends, y: y.ends, columns: x.cells, points, classes, ..Raster::default() }
    }
}

/// Draws a map of `name` over `grid`; `measure` is the title of its last panel.
#[must_use]
pub fn figure(name: &str, grid: &Grid, tally: &Tally, measure: &str, dimensionless: bool) -> Figure {
    let place = CellLayout::new(grid, tally.size(), dimensionless);
    let unit = if dimensionless { "" } else { ", 1/s" };
    let shown = tally.shown();
    let panel = |title: &str, raster: Raster| place.panel(title, raster);
    // Classes of one look are merged.
    let mut looks: Vec<(usize, String, Colour, u64)> = Vec::new();
    for (class, _, count) in tally.classes() {
        let (rank, name, colour) = look(class);
        match looks.iter_mut().find(|known| known.0 == rank) {
            Some(known) => known.3 += count,
            None => looks.push((rank, name, colour, count)),
        }
    }
    looks.sort_by_key(|look| look.0);
    let mut of_class = vec![0; tally.classes().count()];
    for (class, number, _) in tally.classes() {
        let (rank, ..) = look(class);
        of_class[number] = looks.iter().position(|look| look.0 == rank).unwrap_or(0) as u8;
    }
    let names = looks.iter().map(|(_, name, colour, count)| (format!("{name} ({})", grouped(*count)), *colour));
    let kinds = place.raster(|i| of_class[shown[i].class], names.collect());
    let struck = Impacts::ALL.map(Impacts::word).into_iter().chain(["not known"]).zip(tally.impacts());
    let struck =
        struck.zip(IMPACTS.into_iter().chain([NONE])).filter(|((name, count), _)| *count > 0 || *name != "not known");
    let struck = struck.map(|((name, count), colour)| (format!("{name} ({})", grouped(count)), colour));
    let panels = vec![
        panel("kind of motion, with cells of each", kinds),
        panel("flanks that are struck, with cells of each", place.raster(|i| shown[i].impacts as u8, struck.collect())),
        panel(&format!("largest exponent{unit}"), exponents(&place, shown)),
        panel(measure, measures(&place, &shown.iter().map(|cell| cell.measure).collect::<Vec<_>>())),
    ];
    let counts = tally.kinds();
    let shares = counts
        .iter()
        .map(|(kind, count)| format!("{:.2} % {kind}", 100.0 * *count as f64 / tally.cells().max(1) as f64));
    Figure {
        id: "map".to_owned(),
        title: format!("Motions of {name} over two numbers"),
        caption: format!("{} cells: {}.", grouped(tally.cells() as u64), shares.collect::<Vec<_>>().join(", ")),
        columns: 1,
        panels,
    }
}

/// Colours of attractors: of the set of Okabe and Ito, then others of other lightness.
const ATTRACTORS: [Colour; 12] = [
    [0x56, 0xb4, 0xe9],
    [0xe6, 0x9f, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0xf0, 0xe4, 0x42],
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0xc7, 0xe9, 0xb4],
    [0x54, 0x27, 0x88],
    [0x8c, 0x51, 0x0a],
    [0xb2, 0xab, 0xd2],
    [0x35, 0x97, 0x8f],
];
/// Maximum number of characters of a word in a legend.
const LONGEST: usize = 23;

/// Draws the basins of `name` over `grid`: the end of each start, and the number of cycles to it.
#[must_use]
pub fn basins_figure(name: &str, grid: &Grid, found: &BasinResult, dimensionless: bool) -> Figure {
    let BasinResult { attractors, boundary, figures } = found;
    let place = CellLayout::new(grid, boundary.size(), dimensionless);
    let (shown, count) = (boundary.shown(), attractors.len());
    let panel = |title: &str, raster: Raster| place.panel(title, raster);
    // Attractors beyond the last colour share it.
    let coloured = count.min(ATTRACTORS.len());
    let percent = |i: usize| 100.0 * figures.fractions[i].fraction;
    let mut classes: Vec<(String, Colour)> = attractors[..coloured]
        .iter()
        .enumerate()
        .map(|(i, attractor)| {
            let word: String = attractor.word.iter().flat_map(|word| word.chars()).take(LONGEST).collect();
            let more = if attractor.word.as_ref().is_some_and(|word| word.len() > LONGEST) { " …" } else { "" };
            let what = match attractor.period_cycles {
                Some(period) => format!("period {period}"),
                None => attractor.kind.word().to_owned(),
            };
            let word = if word.is_empty() { word } else { format!(", {word}{more}") };
            (format!("{i}: {what}{word} ({:.2} %)", percent(i)), ATTRACTORS[i])
        })
        .collect();
    let others: f64 = (coloured..count).map(percent).sum();
    if count > coloured {
        classes.push((format!("{} others ({others:.2} %)", count - coloured), NONE));
    }
    let mut last = [0; 2];
    for (i, (name, colour)) in [("open", [0; 3]), ("failed", [0x80, 0x86, 0x8e])].into_iter().enumerate() {
        last[i] = classes.len() as u8;
        if percent(count + i) > 0.0 {
            classes.push((format!("{name} ({:.2} %)", percent(count + i)), colour));
        }
    }
    let ends = place.raster(
        |i| match shown[i].0 as usize {
            end if end < coloured => end as u8,
            end if end < count => coloured as u8,
            end => last[end - count],
        },
        classes,
    );
    let cycles: Vec<Option<f64>> = shown.iter().map(|(_, cycles)| cycles.map(|c| c as f64)).collect();
    let number = |measured: &Measured| format!("{:.3} ± {:.3}", measured.value, measured.standard_error);
    let known = |measured: &Option<Measured>| measured.as_ref().map_or_else(|| "too few starts".to_owned(), number);
    let (dimension, entropy) = (known(&figures.boundary_dimension), known(&figures.basin_entropy));
    Figure {
        id: "basins".to_owned(),
        title: format!("Where the starts of {name} end"),
        caption: format!(
            "{} starts. Dimension of the boundary: {dimension}. Basin entropy: {entropy}.",
            grouped(figures.starts as u64)
        ),
        columns: 1,
        panels: vec![
            panel("attractor, with the share of starts that end there", ends),
            panel("cycles until it is reached", measures(&place, &cycles)),
        ],
    }
}

/// Room above and below the points, in their range.
const MARGIN: f64 = 0.04;
/// Maximum number of starts with colours of their own.
const MOST_STARTS: usize = 6;

/// Returns the points by their tags: closures by flank, others by start.
fn tagged(points: &ThinPoints, shown: usize, starts: usize) -> Vec<Series> {
    let is_struck = shown == PHASES || shown == SPEEDS;
    let count = if is_struck {
        2
    } else if starts <= MOST_STARTS {
        starts
    } else {
        1
    };
    let of = |tag: usize| {
        let (x, y): (Vec<f64>, Vec<f64>) =
            points.points().filter(|(own, _)| *own == tag || count == 1).map(|(_, [x, y])| (x, y)).unzip();
        let name = match tag {
            _ if count == 1 => String::new(),
            _ if is_struck => format!("{} flank", if tag == 0 { "drive" } else { "back" }),
            start => format!("start {start}"),
        };
        Series::line(name, tag, x, y).styled(Style::Points)
    };
    (0..count).map(of).filter(|series| !series.x.is_empty()).collect()
}

/// Draws a diagram of `name` over `pointer`: section points with branches over them, phases and speeds of impacts, exponents.
#[must_use]
pub fn diagram_figure(
    name: &str,
    (pointer, first, dimensionless): (&str, &str, bool),
    points: &Points,
    branches: &[BranchLine],
) -> Figure {
    let unit = |unit: &'static str| if dimensionless { "" } else { unit };
    let [low, high] = points.ends;
    let x = Axis::of_number(pointer, dimensionless);
    let title = format!("Motions of {name} against {}", x.label);
    let x = x.between(low, high);
    // Each direction has a separate column: its points would hide those of the other one.
    let directions: Vec<usize> =
        (0..2).filter(|down| points.shown.iter().any(|shown| !shown[*down].is_empty())).collect();
    let row = |shown: usize, title: &str, y: Axis| {
        let seen = [Some(shown), (shown == EXPONENTS).then_some(BANDS)];
        let of_points =
            directions.iter().flat_map(|down| seen.into_iter().flatten().map(|shown| &points.shown[shown][*down]));
        let of_points = of_points.flat_map(|points| points.points().map(|(_, [_, y])| y));
        let of_orbits = branches.iter().filter(|_| shown == SECTIONS).flat_map(|line| line.y.iter().copied());
        let [low, high] =
            of_points.chain(of_orbits).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let room = MARGIN * (high - low);
        let y = if y.range.is_none() && low < high { y.between(low - room, high + room) } else { y };
        let panel = |down: &usize| Panel {
            title: format!("{title}, {}", ["upwards", "downwards"][*down]),
            x: x.clone(),
            y: y.clone(),
            series: tagged(&points.shown[shown][*down], shown, points.starts),
            ..Panel::default()
        };
        directions.iter().map(panel).collect::<Vec<_>>()
    };
    let mut panels = row(SECTIONS, "states at the starts of cycles", Axis::new(first, unit("m")));
    let orbits = branches.iter().map(|line| {
        let (name, style) =
            if line.is_stable { ("stable orbits", Style::Line) } else { ("unstable orbits", Style::Dashed) };
        Series::line(name, 6, line.x.clone(), line.y.clone()).styled(style)
    });
    panels.iter_mut().for_each(|panel| panel.series.extend(orbits.clone()));
    panels.extend(row(PHASES, "contacts gained: phase", Axis::new("part of the period", "").between(0.0, 1.0)));
    panels.extend(row(SPEEDS, "contacts gained: speed of approach", Axis::new("speed", unit("m/s"))));
    panels.extend(
        row(EXPONENTS, "largest exponent", Axis::new("exponent", unit("1/s"))).into_iter().zip(&directions).map(
            |(mut panel, down)| {
                let (x, y) = points.shown[BANDS][*down].points().map(|(_, [x, y])| (x, y)).unzip();
                let ends = Series::line("ends of the exponent's band", 7, x, y).styled(Style::Points);
                panel.series.insert(0, ends);
                Panel { guides: vec![Guide::Horizontal { y: 0.0, name: String::new() }], ..panel }
            },
        ),
    );
    Figure {
        id: "diagram".to_owned(),
        title,
        caption: "Section points, impacts and largest exponents of the motions that are reached in each direction."
            .to_owned(),
        columns: directions.len().max(1),
        panels,
    }
}

/// Returns exponents in classes: four equal parts down to the least and up to the largest but one in fifty.
fn exponents(place: &CellLayout, shown: &[PictureCell]) -> Raster {
    let reach = |sign: f64| {
        let mut sizes: Vec<f64> =
            shown.iter().filter_map(|cell| cell.exponent).map(|e| sign * e).filter(|e| *e > 0.0).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get((sizes.len() * 49 / 50).min(sizes.len().saturating_sub(1))).copied().map(rounded)
    };
    let (low, high) = (reach(-1.0), reach(1.0));
    let mut classes = Vec::new();
    let mut edges = Vec::new();
    if let Some(low) = low {
        for (part, colour) in BELOW.iter().enumerate() {
            let [from, to] = [4 - part, 3 - part].map(|part| -low * part as f64 / 4.0);
            let name =
                if part == 0 { format!("below {}", short(to)) } else { format!("{} to {}", short(from), short(to)) };
            classes.push((name, *colour));
            edges.push(to);
        }
    }
    if let Some(high) = high {
        for (part, colour) in ABOVE.iter().enumerate() {
            let [from, to] = [part, part + 1].map(|part| high * part as f64 / 4.0);
            let name =
                if part == 3 { format!("above {}", short(from)) } else { format!("{} to {}", short(from), short(to)) };
            classes.push((name, *colour));
            edges.push(if part == 3 { f64::INFINITY } else { to });
        }
    }
    let none = classes.len() as u8;
    if shown.iter().any(|cell| cell.exponent.is_none()) {
        classes.push(("none".to_owned(), NONE));
    }
    let class = |i: usize| {
        let place = shown[i].exponent.map(|e| edges.iter().position(|edge| e < *edge).unwrap_or(edges.len() - 1));
        place.map_or(none, |place| place as u8)
    };
    place.raster(class, classes)
}

/// Returns a measure in eight equal parts from its least to its largest value; zero apart.
pub(super) fn measures(place: &CellLayout, shown: &[Option<f64>]) -> Raster {
    let values = || shown.iter().copied().flatten();
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let (has_zero, low, high) = (low == 0.0, low, if high > low { high } else { low + 1.0 });
    let parts = SEQUENCE.len() - usize::from(has_zero);
    let edge = |part: usize| low + (high - low) * part as f64 / parts as f64;
    let mut classes = Vec::new();
    if has_zero {
        classes.push(("0".to_owned(), [0xff, 0xff, 0xff]));
    }
    for part in 0..parts {
        let colour = SEQUENCE[part + usize::from(has_zero)];
        classes.push((format!("{} to {}", short(edge(part)), short(edge(part + 1))), colour));
    }
    let none = classes.len() as u8;
    if shown.iter().any(Option::is_none) {
        classes.push(("none".to_owned(), NONE));
    }
    let class = |i: usize| match shown[i] {
        None => none,
        Some(0.0) if has_zero => 0,
        Some(value) => {
            let part = ((value - low) / (high - low) * parts as f64) as usize;
            (part.min(parts - 1) + usize::from(has_zero)) as u8
        }
    };
    place.raster(class, classes)
}

/// Returns a number with three digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{value:.2e}");
    let value: f64 = text.parse().unwrap_or(value);
    if (1e-3..1e5).contains(&value.abs()) { format!("{value}") } else { text }
}

/// Returns the next number above with one digit.
fn rounded(value: f64) -> f64 {
    let scale = libm::pow(10.0, libm::log10(value).floor());
    (value / scale).ceil() * scale
}

#[cfg(test)]
mod tests {
    use super::Side;
    use crate::sweep;

    #[test]
    fn cells_have_one_size_on_the_axis_of_their_values() {
        let side = |text: &str| Side::new(&sweep::Axis::parse(text).unwrap(), 3, true);
        let linear = side("/a=4:0:3");
        assert_eq!((linear.ends, linear.is_flipped, linear.axis.logarithmic), ([-1.0, 5.0], true, false));
        // Half a ratio of ten to both sides.
        let geometric = side("/a=0.01:1:3:log");
        assert!(geometric.axis.logarithmic && (geometric.ends[0] * geometric.ends[1] / 0.01 - 1.0).abs() < 1e-12);
        assert!((geometric.ends[1] - 10f64.sqrt()).abs() < 1e-12);
        for text in ["/a=0.4,0.5,2", "/a=-4:-1:3:log"] {
            let numbered = side(text);
            assert_eq!((numbered.ends, numbered.axis.label.as_str()), ([0.5, 3.5], "value of a, by its number"));
        }
    }
}
