//! Figures of a recorded motion.

use super::{MotionRecord, SHOWN, colour, state_name};
use crate::{
    analysis::Spectrum,
    hybrid::ContactView,
    plot::{Axis, Figure, Guide, Note, Panel, Series, Style, Tile},
    study::{
        figures::{lines, representatives},
        steady::window,
    },
    system::Flanks,
};

/// Cycles drawn as a curve in phase space.
const CURVE: u64 = 16;
/// Maximum number of contacts drawn: the first ones of their families.
const MOST: usize = 4;
/// Highest order of a spectrum, and smallest amplitude drawn, relative to the largest.
const HIGHEST: f64 = 24.0;
const SMALLEST: f64 = 1e-9;

impl MotionRecord {
    /// Returns the figures, in the order of the page.
    pub fn figures(&self) -> impl Iterator<Item = Figure> {
        [self.states(), self.deflections(), self.impacts(), self.portraits(), self.spectra()].into_iter().flatten()
    }

    /// Returns indices and names of the contacts drawn one by one.
    fn contacts(&self) -> Vec<(usize, String)> {
        let name = |(j, _)| (j, self.simulation.structure.contact_name(j).to_owned());
        representatives(&self.simulation).into_iter().take(MOST).map(name).collect()
    }

    fn over(&self) -> String {
        match self.cycles {
            Some(_) => match (self.until().0 / self.recording.period).round() {
                1.0 => "a forcing cycle of the motion".to_owned(),
                cycles => format!("{cycles} forcing cycles of the motion"),
            },
            None => "the run".to_owned(),
        }
    }

    /// Returns the samples per cycle.
    pub fn per_cycle(&self) -> usize {
        self.recording.per_cycle as usize
    }

    /// Returns the end of curves over time, s, and the number of samples up to there.
    fn until(&self) -> (f64, usize) {
        let samples = self.recording.t.len();
        match self.cycles {
            Some(cycles) => {
                // A long period, or a cycle of all forcing, is not cut.
                let period = self.motion.as_ref().and_then(|motion| motion.period).unwrap_or(1);
                let most = if self.simulation.periods_per_cycle() > SHOWN { 1 } else { SHOWN.max(period.min(CURVE)) };
                let cycles = cycles.min(most);
                (cycles as f64 * self.recording.period, (cycles as usize * self.per_cycle() + 1).min(samples))
            }
            None => (self.recording.t.last().copied().unwrap_or_default(), samples),
        }
    }

    fn time_axis(&self) -> Axis {
        let (factor, unit) = self.units.time;
        Axis::new("time", unit).between(0.0, factor * self.until().0)
    }

    /// Draws the state of every contact over time.
    fn states(&self) -> Option<Figure> {
        let (factor, end) = (self.units.time.0, self.until().0);
        let spells = &self.recording.spells;
        let count = spells.len();
        if count == 0 {
            return None;
        }
        let (mut tiles, mut notes) = (Vec::new(), Vec::new());
        for (j, spells) in spells.iter().enumerate() {
            let row = (count - 1 - j) as f64;
            for spell in spells.iter().filter(|spell| spell.from < end) {
                tiles.push(Tile {
                    x: [factor * spell.from, factor * spell.to.min(end)],
                    y: [row, row + 0.55],
                    name: state_name(spell.mode).to_owned(),
                    colour: colour(spell.mode),
                });
            }
            let text = self.simulation.structure.contact_name(j).to_owned();
            notes.push(Note { at: [0.0, row + 0.58], text });
        }
        let panel = Panel {
            x: self.time_axis(),
            y: Axis { places: true, ..Axis::new("contact", "").between(-0.15, count as f64 + 0.1) },
            height: Some((0.25 + 0.125 * count as f64).min(1.0)),
            tiles,
            notes,
            ..Panel::default()
        };
        Some(self.figure(
            "states",
            "Contact and separation",
            "The state of each contact, from event to event.",
            vec![panel],
        ))
    }

    fn figure(&self, id: &str, title: &str, caption: &str, panels: Vec<Panel>) -> Figure {
        Figure {
            id: id.to_owned(),
            title: format!("{title}: {}", self.over()),
            caption: caption.to_owned(),
            columns: panels.len().clamp(1, 2),
            panels,
        }
    }

    /// Draws the deflections within the backlash.
    fn deflections(&self) -> Option<Figure> {
        let (time, length) = (self.units.time.0, self.units.length);
        let count = self.until().1;
        let panel = |(j, name): (usize, String)| {
            let spec = &self.simulation.structure.spec().contacts[j];
            let at = |y: f64, name: &str| Guide::Horizontal { y: length.0 * y, name: name.to_owned() };
            let b = spec.half_backlash;
            let mut guides = vec![at(b, "drive flank")];
            if spec.flanks == Flanks::Both {
                guides.push(at(-b, "back flank"));
            }
            let x: Vec<f64> = self.recording.t[..count].iter().map(|t| time * t).collect();
            let y: Vec<f64> = self.recording.deflection[j][..count].iter().map(|d| length.0 * d).collect();
            let ends = y
                .iter()
                .chain([&(length.0 * b)])
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)]);
            let ends = if ends[0] < 0.0 { [ends[0].min(-length.0 * b), ends[1]] } else { ends };
            let room = 0.06 * (ends[1] - ends[0]).max(f64::MIN_POSITIVE);
            Panel {
                title: name.clone(),
                x: self.time_axis(),
                y: Axis::new("deflection", length.1).between(ends[0] - room, ends[1] + room),
                series: vec![Series::line("deflection", 0, x, y)],
                guides,
                ..Panel::default()
            }
        };
        let panels: Vec<Panel> = self.contacts().into_iter().map(panel).collect();
        let caption = "Beyond a flank's line the flank is pressed; between the lines the mesh is separated.";
        (!panels.is_empty()).then(|| self.figure("deflection", "Deflection within the backlash", caption, panels))
    }

    /// Draws approach speeds over the phase.
    fn impacts(&self) -> Option<Figure> {
        let speed = if self.simulation.dimensionless { (1.0, "") } else { (1e3, "mm/s") };
        let x = match self.cycles {
            Some(_) => Axis::new("phase in the forcing cycle", "").between(0.0, 1.0),
            None => Axis::new("time", self.units.time.1),
        };
        let factor = if self.cycles.is_some() { 1.0 } else { self.units.time.0 };
        let panel = |(j, name): (usize, String)| {
            let of = |side: f64| {
                let own = self.impacts.iter().filter(move |impact| impact.contact == j && impact.side == side);
                let (x, y): (Vec<f64>, Vec<f64>) =
                    own.map(|impact| (factor * impact.at, speed.0 * impact.speed)).unzip();
                let (name, style, colour) = if side > 0.0 {
                    ("on the drive flank", Style::Points, 0)
                } else {
                    ("on the back flank", Style::Marks, 1)
                };
                Series { name: name.to_owned(), x, y, style, colour }
            };
            let series: Vec<Series> = [of(1.0), of(-1.0)].into_iter().filter(|series| !series.x.is_empty()).collect();
            let largest = series.iter().flat_map(|series| &series.y).fold(0.0, |most: f64, y| most.max(*y));
            let y = Axis::new("approach speed", speed.1).between(0.0, 1.08 * largest);
            Panel { title: name, x: x.clone(), y, series, ..Panel::default() }
        };
        let panels = self.contacts().into_iter().map(panel).filter(|panel| !panel.series.is_empty());
        let panels: Vec<Panel> = panels.collect();
        let over = self.cycles.map_or_else(|| "the run".to_owned(), |cycles| format!("{cycles} cycles"));
        (!panels.is_empty()).then(|| Figure {
            id: "impacts".to_owned(),
            title: format!("Impacts: {over}"),
            caption: "Speed at which the flanks close, just before each impact.".to_owned(),
            columns: panels.len().clamp(1, 2),
            panels,
        })
    }

    /// Draws phase portraits with their section.
    fn portraits(&self) -> Option<Figure> {
        let structure = &self.simulation.structure;
        let (length, n) = (self.units.length, structure.freedoms());
        let speed = if self.simulation.dimensionless { (1.0, "") } else { (1e3, "mm/s") };
        let t = &self.recording.t;
        let curve = match self.cycles {
            Some(_) => (CURVE as usize * self.per_cycle() + 1).min(t.len()),
            None => t.len(),
        };
        let panel = |(j, name): (usize, String)| {
            // Rate of gᵀq: that of the deflection without the rate of the error.
            let g = &structure.spec().contacts[j].direction;
            let state = |i: usize, from: usize| (0..n).fold(0.0, |sum, k| sum + g[k] * self.recording.x[from + k][i]);
            let point = |i: usize| (length.0 * state(i, 0), speed.0 * state(i, n));
            let (x, y): (Vec<f64>, Vec<f64>) = (0..curve).map(point).unzip();
            let mut series = vec![Series::line("motion", 0, x, y).styled(Style::Hairline)];
            if self.cycles.is_some() {
                let (x, y): (Vec<f64>, Vec<f64>) = (0..t.len()).step_by(self.per_cycle()).map(point).unzip();
                series.push(Series::line("start of each forcing cycle", 1, x, y).styled(Style::Points));
            }
            Panel {
                title: name,
                x: Axis::new("transmission error", length.1),
                y: Axis::new("its rate", speed.1),
                series,
                ..Panel::default()
            }
        };
        let panels: Vec<Panel> = self.contacts().into_iter().map(panel).collect();
        let caption = "Dynamic transmission error (deflection plus error) and its rate. A closed curve is a periodic motion; its points are as many \
                       as its period has forcing cycles.";
        let over = self.cycles.map_or_else(|| "the run".to_owned(), |cycles| format!("{} cycles", cycles.min(CURVE)));
        (!panels.is_empty()).then(|| Figure {
            id: "phase-portrait".to_owned(),
            title: format!("Phase portrait: {over}"),
            caption: caption.to_owned(),
            columns: panels.len().clamp(1, 2),
            panels,
        })
    }

    /// Draws spectra of the dynamic transmission error.
    fn spectra(&self) -> Option<Figure> {
        let (motion, cycles) = (self.motion.as_ref()?, self.cycles?);
        let structure = &self.simulation.structure;
        let n = structure.freedoms();
        let samples = cycles as usize * self.per_cycle();
        let panel = |(j, name): (usize, String)| {
            let g = &structure.spec().contacts[j].direction;
            let value = |i: usize| self.units.length.0 * (0..n).fold(0.0, |sum, k| sum + g[k] * self.recording.x[k][i]);
            let values: Vec<f64> = (0..samples.min(self.recording.t.len())).map(value).collect();
            let spectrum = Spectrum::new(&values, f64::from(self.recording.per_cycle), window(motion));
            let lines = lines(&spectrum, HIGHEST);
            let largest = lines.iter().fold(0.0, |most: f64, (_, a)| most.max(*a));
            let (x, y): (Vec<f64>, Vec<f64>) = lines.into_iter().filter(|(_, a)| *a > SMALLEST * largest).unzip();
            let style = if motion.period.is_some() { Style::Stems } else { Style::Line };
            let low = libm::pow(10.0, libm::floor(libm::log10(y.iter().fold(largest, |least: f64, a| least.min(*a)))));
            Panel {
                title: name,
                x: Axis::new("frequency / forcing frequency", "").between(0.0, HIGHEST),
                y: Axis {
                    logarithmic: true,
                    ..Axis::new("amplitude", self.units.length.1).between(low, 2.0 * largest)
                },
                series: vec![Series { name: String::new(), x, y, style, colour: 0 }],
                ..Panel::default()
            }
        };
        let still = |panel: &Panel| panel.series.iter().all(|series| series.x.is_empty());
        let panels: Vec<Panel> = self.contacts().into_iter().map(panel).filter(|panel| !still(panel)).collect();
        (!panels.is_empty()).then(|| Figure {
            id: "spectrum".to_owned(),
            title: format!("Spectrum of the dynamic transmission error: {cycles} cycles"),
            caption: match motion.period {
                Some(_) => "Over whole periods, without a window.".to_owned(),
                None => "With a Hann window.".to_owned(),
            },
            columns: panels.len().clamp(1, 2),
            panels,
        })
    }
}
