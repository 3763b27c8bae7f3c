//! Figures of the kinds that a study draws, with made-up numbers.
#![allow(dead_code, reason = "each test uses its part")]

use std::f64::consts::TAU;

use flank::plot::{Axis, Band, Figure, Guide, Note, Panel, Series, Style, Tile};

fn sampled(count: usize, end: f64, f: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    (0..count).map(|i| end * i as f64 / (count - 1) as f64).map(|t| (t, f(t))).unzip()
}

fn figure(id: &str, title: &str, columns: usize, panels: Vec<Panel>) -> Figure {
    let caption = format!("{title}; made-up numbers.");
    Figure { id: id.into(), title: title.into(), caption, columns, panels }
}

/// Two mesh forces over time, contact modes shaded, events marked.
pub fn forces(samples: usize) -> Figure {
    let sun = |t: f64| 250.0 * (0.2 + (TAU * t / 5.0).sin() + 0.4 * (3.0 * TAU * t / 5.0).cos()).max(0.0);
    let ring = |t: f64| 180.0 * (0.6 + (TAU * t / 5.0 + 1.0).sin());
    let panel = |title: &str, name: &str, colour, force: &dyn Fn(f64) -> f64| {
        let (t, f) = sampled(samples, 20.0, force);
        let band =
            |(from, to, name, colour): (f64, f64, &str, usize)| Band { x: [from, to], name: name.into(), colour };
        let apart = (0..4).map(|i| (2.6 + 5.0 * i as f64, 4.8 + 5.0 * i as f64, "separated", 0));
        let back = (0..4).map(|i| (3.3 + 5.0 * i as f64, 3.6 + 5.0 * i as f64, "back contact", 2));
        let marks: Vec<f64> = (0..4).flat_map(|i| [2.6 + 5.0 * i as f64, 4.8 + 5.0 * i as f64]).collect();
        let heights = marks.iter().map(|t| force(*t)).collect();
        Panel {
            title: title.into(),
            x: Axis::new("time", "ms").between(0.0, 20.0),
            y: Axis::new("mesh force", "N"),
            series: vec![
                Series::line(name, colour, t, f),
                Series::line("events", 6, marks, heights).styled(Style::Marks),
            ],
            bands: apart.chain(back).map(band).collect(),
            guides: vec![Guide::Horizontal { y: 142.0, name: "static 142 N".into() }],
            ..Panel::default()
        }
    };
    let panels = vec![panel("Sun–planet 1", "sun–planet", 0, &sun), panel("Ring–planet 1", "ring–planet", 1, &ring)];
    figure("mesh-forces", "Mesh forces at 500 rpm without load", 1, panels)
}

/// A spectrum with natural frequencies.
pub fn spectrum() -> Figure {
    let (f, a): (Vec<f64>, Vec<f64>) =
        (1..=15).map(|k| (100.0 * f64::from(k), 300.0 / (1.0 + (f64::from(k) - 4.0).powi(2)))).unzip();
    let natural = [(229.0, "f₁ 229 Hz"), (241.0, "f₂ 241 Hz"), (880.0, "f₃ 880 Hz"), (1410.0, "f₄ 1410 Hz")];
    let panel = Panel {
        x: Axis::new("frequency", "Hz").between(0.0, 1550.0),
        y: Axis::new("force amplitude", "N"),
        series: vec![Series::line("sun–planet", 0, f, a).styled(Style::Stems)],
        guides: natural.map(|(x, name)| Guide::Vertical { x, name: name.into() }).to_vec(),
        notes: vec![Note { at: [400.0, 300.0], text: "4 × mesh frequency".into() }],
        ..Panel::default()
    };
    figure("spectrum", "Spectrum of the sun–planet force at 500 rpm", 1, vec![panel])
}

/// Spectra stacked by speed, with orders and natural frequencies.
pub fn waterfall() -> Figure {
    let speeds = (0..25).map(|i| 500.0 + 2500.0 * f64::from(i) / 24.0);
    let curve = |speed: f64| {
        let (f, y) = sampled(600, 6000.0, |f| {
            let near = |order: f64| {
                let at = order * speed * 0.5;
                let gain = 1.0 / (((at - 1800.0) / 500.0).powi(2) + 0.3);
                400.0 * gain / order / (1.0 + ((f - at) / 15.0).powi(2))
            };
            speed + (1..=6).map(|k| near(f64::from(k))).sum::<f64>()
        });
        Series::line("spectrum of the sun–planet force", 0, f, y).styled(Style::Hairline)
    };
    let order = |k: f64| Guide::Slanted {
        from: [250.0 * k, 500.0],
        to: [(1500.0 * k).min(6000.0), (6000.0 / 0.5 / k).min(3000.0)],
        name: format!("{k}×"),
    };
    let natural = [1121.0, 1784.0, 1797.0, 3204.0, 5340.0];
    let vertical = |(i, x): (usize, &f64)| Guide::Vertical { x: *x, name: format!("f{} {x:.0} Hz", i + 1) };
    let panel = Panel {
        x: Axis::new("frequency", "Hz").between(0.0, 6000.0),
        y: Axis::new("sun speed, amplitudes on top (1 N = 2 rpm)", "rpm"),
        series: speeds.map(curve).collect(),
        guides: natural.iter().enumerate().map(vertical).chain((1..=6).map(|k| order(f64::from(k)))).collect(),
        ..Panel::default()
    };
    figure("waterfall", "Waterfall of the sun–planet force", 1, vec![panel])
}

/// A measure against load, with published points.
pub fn against_load() -> Figure {
    let (load, apart) = sampled(41, 40.0, |t| (0.35 * (1.0 - t / 21.0).max(0.0)).sqrt() * 0.6);
    let (some, published) = ([0.0, 5.0, 10.0, 15.0, 20.5, 21.0], [0.35, 0.31, 0.26, 0.19, 0.08, 0.0]);
    let left = Panel {
        title: "Time apart".into(),
        x: Axis::new("load", "N m"),
        y: Axis::new("part of the mesh period", ""),
        series: vec![
            Series::line("Flank", 0, load.clone(), apart.clone()).styled(Style::Joined),
            Series::line("published", 1, some.to_vec(), published.to_vec()).styled(Style::Marks),
        ],
        guides: vec![Guide::Vertical { x: 20.97, name: "threshold 20.97 N m".into() }],
        ..Panel::default()
    };
    let residual: Vec<f64> = apart.iter().map(|a| 1e-9 * (a + 1e-3)).collect();
    let right = Panel {
        title: "Error of the time apart".into(),
        x: Axis::new("load", "N m"),
        y: Axis { logarithmic: true, ..Axis::new("error", "s") },
        series: vec![Series::line("error", 2, load, residual).styled(Style::Dashed)],
        ..Panel::default()
    };
    figure("apart-vs-load", "Mesh-apart duration against load", 2, vec![left, right])
}

/// Floating trajectories: two rows of four panels, equal scales.
pub fn trajectories() -> Figure {
    let panel = |row: usize, speed: f64| {
        let size = if row == 0 { 20.0 } else { 6.0 } * (1.0 + speed / 1000.0);
        let (x, y) = (0..2000)
            .map(|i| TAU * f64::from(i) / 2000.0)
            .map(|a| (a, size * (0.4 + 0.3 * (12.0 * a + speed).cos() + 0.1 * (37.0 * a).sin())))
            .map(|(a, r)| (r * a.cos(), r * a.sin()))
            .unzip();
        let body = if row == 0 { "sun" } else { "ring" };
        Panel {
            title: format!("{body}, {speed} rpm"),
            x: Axis::new("x", "µm"),
            y: Axis::new("y", "µm"),
            equal_scales: true,
            series: vec![Series::line(body, row, x, y).styled(Style::Hairline)],
            ..Panel::default()
        }
    };
    let panels = (0..2).flat_map(|row| [100.0, 300.0, 1000.0, 2000.0].map(|speed| panel(row, speed))).collect();
    figure("trajectories", "Floating of sun and ring over one carrier turn", 4, panels)
}

/// Mode shapes: bodies at rest and displaced.
pub fn mode_shapes() -> Figure {
    let circle = |[x, y]: [f64; 2], r: f64| -> (Vec<f64>, Vec<f64>) {
        (0..=60).map(|i| TAU * f64::from(i) / 60.0).map(|a| (x + r * a.cos(), y + r * a.sin())).unzip()
    };
    let panel = |mode: usize, name: &str| {
        let mut series = Vec::new();
        let shift = |i: usize| [0.08 * ((mode + i) as f64).sin(), 0.08 * ((2 * mode + i) as f64).cos()];
        let bodies =
            [([0.0, 0.0], 0.35), ([0.7, 0.0], 0.3), ([-0.35, 0.606], 0.3), ([-0.35, -0.606], 0.3), ([0.0, 0.0], 1.05)];
        for (i, ([x, y], r)) in bodies.into_iter().enumerate() {
            let (at, radius) = circle([x, y], r);
            series.push(Series::line("at rest", 7, at, radius).styled(Style::Dashed));
            let [dx, dy] = shift(i);
            let (at, radius) = circle([x + dx, y + dy], r);
            series.push(Series::line("displaced", 0, at, radius));
            series.push(Series::line("centres", 1, vec![x + dx], vec![y + dy]).styled(Style::Points));
        }
        Panel {
            title: format!("{name}, {} Hz", 743 * mode),
            x: Axis::new("x", "over the centre distance"),
            y: Axis::new("y", "over the centre distance"),
            equal_scales: true,
            series,
            ..Panel::default()
        }
    };
    figure("mode-shapes", "Mode shapes", 3, vec![panel(1, "rotational"), panel(2, "translational"), panel(3, "planet")])
}

/// A map: tiles of every colour on two logarithmic axes, with a curve across them.
pub fn map() -> Figure {
    let tile = |i: usize, j: usize| Tile {
        x: [10f64.powi(i as i32), 10f64.powi(i as i32 + 1)],
        y: [0.1 * 4f64.powi(j as i32), 0.1 * 4f64.powi(j as i32 + 1)],
        name: format!("outcome {}", (i + j) % 7),
        colour: (i + j) % 7,
    };
    let axis = |label: &str| Axis { logarithmic: true, ..Axis::new(label, "") };
    let panel = Panel {
        title: "rk4".into(),
        x: axis("steps a cycle"),
        y: axis("factor on the stiffness"),
        tiles: (0..5).flat_map(|i| (0..4).map(move |j| (i, j))).map(|(i, j)| tile(i, j)).collect(),
        series: vec![Series::line("limit", 6, vec![20.0, 200.0, 2000.0], vec![0.1, 1.0, 10.0]).styled(Style::Dashed)],
        guides: vec![Guide::Vertical { x: 1000.0, name: "1000 steps".into() }],
        ..Panel::default()
    };
    figure("map", "A map of outcomes", 2, vec![panel.clone(), Panel { title: "newmark".into(), ..panel }])
}

/// A figure with every kind of thing in it, and words that are hard to write.
pub fn hard() -> Figure {
    let words = "a \"b\", <c> & 'd' $e$ %{f} </script> µ²";
    let panel = Panel {
        title: words.into(),
        x: Axis::new("time", "s, or \"s\""),
        y: Axis::new("<force>", "N & more"),
        series: vec![
            Series::line(
                words,
                3,
                vec![0.1, 0.2, 1.0 / 3.0, -0.0],
                vec![f64::MIN_POSITIVE, 1e22, -1e-7, 123_456_789.123],
            ),
            Series::line("stems", 1, vec![0.25], vec![-5e21]).styled(Style::Stems),
        ],
        bands: vec![Band { x: [0.1, 0.15], name: "band, shaded".into(), colour: 1 }],
        tiles: vec![Tile { x: [0.2, 0.3], y: [0.0, 1e22], name: "tile <1>".into(), colour: 8 }],
        guides: vec![
            Guide::Vertical { x: 0.3, name: "v".into() },
            Guide::Horizontal { y: 5e21, name: "h".into() },
            Guide::Slanted { from: [0.0, 0.0], to: [0.3, 1e22], name: "s".into() },
        ],
        notes: vec![Note { at: [0.05, 1e21], text: "line\nbreak\u{0}".into() }],
        ..Panel::default()
    };
    Figure { id: "hard".into(), title: words.into(), caption: words.into(), columns: 1, panels: vec![panel] }
}

/// All of them, but for the hard one.
pub fn all() -> Vec<Figure> {
    vec![forces(2000), spectrum(), waterfall(), against_load(), trajectories(), mode_shapes(), map()]
}
