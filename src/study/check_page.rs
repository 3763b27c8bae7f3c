//! Page of a scene before it runs: the train, its stiffnesses, errors and loads, and its critical speeds.

use std::f64::consts::TAU;

use super::figures::{Quantity, Units, family, mesh_frequency, number, representatives, speed};
use crate::{
    gear::Stiffness,
    hybrid::ContactView,
    output::{Table, five_digits},
    plot::{Axis, Figure, Guide, Item, Note, Panel, Report, Section, Series, Style, Tile},
    scene::Scene,
    simulation::Simulation,
    system::{equilibrium, quasi_static},
    train::GearDrawing,
};

/// Names of the figures that a page may have.
pub const FIGURES: [&str; 5] = ["train", "stiffness", "error", "loads", "campbell"];

/// Samples of a curve over time.
const SAMPLES: u32 = 2400;
/// Highest speed of a Campbell diagram, relative to the scene's own.
const REACH: f64 = 2.0;
/// Highest frequency of the diagram, relative to the highest mode that an order meets.
const ABOVE: f64 = 1.1;
/// Space around a train, as a share of its size.
const ROOM: f64 = 0.06;
/// Maximum number of contacts drawn one by one.
const MOST: usize = 6;

/// Returns the page of a scene.
#[must_use]
pub fn page(scene: &Scene, simulation: &Simulation) -> Report {
    let report = simulation.report();
    let view = View { scene, simulation, units: Units::of(simulation) };
    let mut critical = Vec::new();
    let campbell = speed(scene).and_then(|speed| view.campbell(&speed, &mut critical));
    let drawn = [view.train(), view.stiffness(), view.error(), view.loads()];
    let mut figures: Vec<Item> = drawn.into_iter().flatten().map(Item::Figure).collect();
    figures.extend(campbell.map(Item::Figure));
    if !critical.is_empty() {
        let head = ["mode", "Hz", "order", "critical speed, rev/min", "of the scene's speed"];
        figures.push(Table::new(head).with(critical).titled("Critical speeds", "Where an order meets a mode.").into());
    }
    Report {
        title: simulation.title().to_owned(),
        summary: (report.remarks.iter().map(|remark| format!("{remark}.")))
            .chain(report.warnings.iter().map(|warning| format!("Warning: {warning}.")))
            .collect(),
        sections: vec![
            Section::new("The train", "", figures),
            Section::new("Numbers", "", report.tables().into_iter().map(Item::from).collect()),
        ],
        provenance: vec![
            format!("flank {}", env!("CARGO_PKG_VERSION")),
            format!("scene {}; SHA-256 {}", scene.name(), scene.hash()),
        ],
        files: Some("figures".to_owned()),
    }
}

/// Scene that is drawn.
struct View<'s> {
    scene: &'s Scene,
    simulation: &'s Simulation,
    units: Units,
}

impl View<'_> {
    /// Draws the train to scale, each gear with its teeth.
    fn train(&self) -> Option<Figure> {
        let drawing = self.scene.built().drawing.as_ref()?;
        let mut panel = Panel { equal_scales: true, ..Panel::default() };
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let gears = || drawing.gears.iter().filter(|gear| gear.teeth > 0);
        let mut names: Vec<&str> = gears().map(|gear| family(&gear.name)).collect();
        names.dedup();
        for gear in gears() {
            let colour = names.iter().position(|name| *name == family(&gear.name)).unwrap_or_default();
            let (x, y) = outline(gear);
            for (i, values) in [&x, &y].into_iter().enumerate() {
                low[i] = values.iter().fold(low[i], |low: f64, value| low.min(*value));
                high[i] = values.iter().fold(high[i], |high: f64, value| high.max(*value));
            }
            let name = format!("{}, {} teeth", family(&gear.name), gear.teeth);
            panel.series.push(Series::line(name, colour, x, y));
        }
        let (x, y) = drawing.points.iter().map(|point| (MM * point[0], MM * point[1])).unzip();
        let points = Series { name: "pitch points".to_owned(), x, y, style: Style::Marks, colour: 7 };
        panel.series.push(points);
        let room = ROOM * (high[0] - low[0]).max(high[1] - low[1]);
        panel.x = Axis::new("x", "mm").between(low[0] - room, high[0] + room);
        panel.y = Axis::new("y", "mm").between(low[1] - room, high[1] + room);
        Some(Figure {
            id: "train".to_owned(),
            title: "The train, to scale".to_owned(),
            caption: "Tooth heights are those of a standard rack on the working pitch circles.".to_owned(),
            columns: 1,
            panels: vec![panel],
        })
    }

    /// Returns a panel for the first contact of each family that has `values` over a time, s.
    fn over_a_time(&self, y: &Axis, values: impl Fn(usize) -> Option<(f64, Box<dyn Fn(f64) -> f64>)>) -> Vec<Panel> {
        let panel = |(j, _): (usize, String)| {
            let (period, value) = values(j)?;
            let times = (0..=SAMPLES).map(|i| period * f64::from(i) / f64::from(SAMPLES));
            let (x, values) = times.map(|t| (self.units.time.0 * t, value(t))).unzip();
            Some(Panel {
                title: self.simulation.structure.contact_name(j).to_owned(),
                x: Axis::new("time", self.units.time.1).between(0.0, self.units.time.0 * period),
                y: y.clone(),
                series: vec![Series::line("", 0, x, values)],
                ..Panel::default()
            })
        };
        representatives(self.simulation).into_iter().take(MOST).filter_map(panel).collect()
    }

    /// Draws the stiffnesses over a mesh period.
    fn stiffness(&self) -> Option<Figure> {
        let contacts = &self.simulation.structure.spec().contacts;
        let unit = if self.simulation.dimensionless { "" } else { "N/m" };
        let panels = self.over_a_time(&Axis::new("stiffness", unit), |j| match &contacts[j].stiffness {
            Stiffness::Constant(_) => None,
            varying => {
                let (period, varying) = (mesh_frequency(self.simulation, j).ok()?.recip(), varying.clone());
                Some((period, Box::new(move |t| varying.at(t))))
            }
        });
        over("stiffness", "Mesh stiffness over a mesh period", "Of the first mesh of each family.", panels)
    }

    /// Draws the transmission errors over the period of their slowest harmonic.
    fn error(&self) -> Option<Figure> {
        let contacts = &self.simulation.structure.spec().contacts;
        let (factor, unit) = self.units.length;
        let panels = self.over_a_time(&Axis::new("transmission error", unit), |j| {
            let contact = contacts[j].clone();
            let slowest = contact.error.iter().map(|harmonic| harmonic.omega).fold(f64::INFINITY, f64::min);
            let value = move |t: f64| factor * (contact.error_at(t)[0] + contact.error_offset);
            (slowest.is_finite() && slowest > 0.0).then(|| (TAU / slowest, Box::new(value) as Box<dyn Fn(f64) -> f64>))
        });
        let caption =
            "Of the first mesh of each family, over its slowest harmonic. A positive error opens the drive flank.";
        over("error", "Transmission error", caption, panels)
    }

    /// Draws the force of each contact at rest under the mean load.
    fn loads(&self) -> Option<Figure> {
        let spec = self.simulation.structure.spec();
        let found = equilibrium(spec).or_else(|_| quasi_static(spec, 0.0).map(|(found, ..)| found));
        let forces = found.ok()?.forces;
        let count = forces.len();
        let row = |j: usize| (count - 1 - j) as f64;
        let unit = self.units.force;
        let tiles = forces.iter().enumerate().map(|(j, force)| Tile {
            x: [force.min(0.0), force.max(0.0)],
            y: [row(j), row(j) + 0.55],
            name: String::new(),
            colour: 0,
        });
        let notes = forces.iter().enumerate().map(|(j, force)| Note {
            at: [0.0, row(j) + 0.58],
            text: format!("{}: {} {unit}", self.simulation.structure.contact_name(j), five_digits(*force)),
        });
        let largest = forces.iter().fold(0.0, |most: f64, force| most.max(force.abs()));
        let panel = Panel {
            x: Axis::new("force", unit)
                .between(0.0_f64.min(forces.iter().copied().fold(0.0, f64::min)), 1.05 * largest),
            y: Axis { places: true, ..Axis::new("contact", "").between(-0.15, count as f64 + 0.1) },
            height: Some((0.25 + 0.125 * count as f64).min(1.0)),
            tiles: tiles.collect(),
            notes: notes.collect(),
            ..Panel::default()
        };
        (count > 0 && largest > 0.0).then(|| Figure {
            id: "loads".to_owned(),
            title: "Forces of the contacts at rest under the mean load".to_owned(),
            caption: "Each mesh at its mean stiffness, on its drive flank.".to_owned(),
            columns: 1,
            panels: vec![panel],
        })
    }

    /// Draws natural frequencies and the orders that excite them over the speed; each crossing adds a row of `critical`.
    fn campbell(&self, Quantity { pointer, axis }: &Quantity, critical: &mut Vec<Vec<String>>) -> Option<Figure> {
        let own = number(self.scene, pointer).ok().filter(|own| *own != 0.0)?;
        let report = self.simulation.report();
        // Meshes of one frequency, such as those of a planetary stage, excite equally.
        let mut orders: Vec<(String, f64)> = Vec::new();
        for (name, hertz) in self.simulation.orders() {
            match orders.iter_mut().find(|(_, known)| (*known - hertz).abs() <= 1e-9 * hertz) {
                Some((known, _)) => *known = format!("{known}, {name}"),
                None => orders.push((name, hertz)),
            }
        }
        let fastest = REACH * own.abs();
        let reach = orders.iter().fold(0.0, |most: f64, (_, hertz)| most.max(REACH * hertz));
        let modes: Vec<f64> = report.modes.iter().map(|mode| mode.frequency_hz).filter(|hertz| *hertz > 0.0).collect();
        let met = modes.iter().copied().filter(|hertz| *hertz <= reach).fold(0.0, f64::max);
        if met == 0.0 {
            return None;
        }
        let top = ABOVE * met;
        let mut guides = Vec::new();
        let mut seen: Vec<f64> = Vec::new();
        for hertz in modes.iter().copied().filter(|hertz| *hertz <= top) {
            if seen.last().is_none_or(|last| hertz > last * (1.0 + 1e-6)) {
                seen.push(hertz);
                guides.push(Guide::Horizontal { y: hertz, name: format!("{} Hz", five_digits(hertz)) });
            }
        }
        let (mut x, mut y) = (Vec::new(), Vec::new());
        let mut rows = Vec::new();
        for (name, hertz) in &orders {
            let share = (top / (REACH * hertz)).min(1.0);
            guides.push(Guide::Slanted {
                from: [0.0; 2],
                to: [share * fastest, share * REACH * hertz],
                name: name.clone(),
            });
            for (k, mode) in seen.iter().enumerate().filter(|(_, mode)| **mode <= REACH * hertz) {
                let at = own.abs() * mode / hertz;
                x.push(at);
                y.push(*mode);
                let cells = [format!("f{}", k + 1), five_digits(*mode), name.clone(), five_digits(at)];
                rows.push((at, cells.into_iter().chain([five_digits(at / own.abs())]).collect::<Vec<_>>()));
            }
        }
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        critical.extend(rows.into_iter().map(|(_, cells)| cells));
        guides.push(Guide::Vertical { x: own.abs(), name: "the scene's speed".to_owned() });
        let panel = Panel {
            x: axis.clone().between(0.0, fastest),
            y: Axis::new("frequency", "Hz").between(0.0, top),
            series: vec![Series { name: "critical speeds".to_owned(), x, y, style: Style::Marks, colour: 1 }],
            guides,
            ..Panel::default()
        };
        Some(Figure {
            id: "campbell".to_owned(),
            title: "Campbell diagram".to_owned(),
            caption: "Level lines: natural frequencies, every contact closed at its mean stiffness. Slanted lines: orders of meshes, shafts and \
                      loads."
                .to_owned(),
            columns: 1,
            panels: vec![panel],
        })
    }
}

/// Millimetres per metre.
const MM: f64 = 1e3;

/// Returns the outline of a gear with its teeth, mm: as high as those of a standard rack, with straight flanks.
fn outline(gear: &GearDrawing) -> (Vec<f64>, Vec<f64>) {
    let pitch = TAU / f64::from(gear.teeth);
    let module = 2.0 * gear.radius / f64::from(gear.teeth);
    let inward = if gear.is_ring { -1.0 } else { 1.0 };
    let [tip, root] = [gear.radius + inward * module, gear.radius - inward * 1.25 * module];
    // A ring has a space at its angle.
    let shift = if gear.is_ring { 0.5 } else { 0.0 };
    let corners = [(-0.34, root), (-0.14, tip), (0.14, tip), (0.34, root)];
    let point = |k: u32, (part, radius): (f64, f64)| {
        let (sin, cos) = libm::sincos(gear.angle + (f64::from(k) + shift + part) * pitch);
        (MM * (gear.centre[0] + radius * cos), MM * (gear.centre[1] + radius * sin))
    };
    let teeth = (0..gear.teeth).flat_map(|k| corners.map(|corner| point(k, corner)));
    teeth.chain([point(0, corners[0])]).unzip()
}

fn over(id: &str, title: &str, caption: &str, panels: Vec<Panel>) -> Option<Figure> {
    (!panels.is_empty()).then(|| Figure {
        id: id.to_owned(),
        title: title.to_owned(),
        caption: caption.to_owned(),
        columns: panels.len().clamp(1, 2),
        panels,
    })
}
