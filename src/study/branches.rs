//! Branches of orbits with the measures of their contacts, as files.

use rayon::prelude::*;

use super::{
    StudyError,
    measures::Measures,
    steady::{Steady, of_orbit},
};
#[cfg(feature = "plot")]
use super::{figures::families, steady::ContactSteady};
#[cfg(feature = "plot")]
use crate::{
    branch::SpecialKind,
    output::five_digits,
    plot::{Axis, Band, Figure, Note, Panel, Series, Style},
    simulation::Parameter,
};
use crate::{
    branch::{Branch, BranchPoint, Codimension, Curve, Family, Special},
    orbit::{self, Motion, components},
    output::{csv_line, number},
    task::Task,
};

/// Maximum number of families of contacts drawn.
#[cfg(feature = "plot")]
const MOST: usize = 3;
/// Maximum number of special points of a panel with numbers beside them.
#[cfg(feature = "plot")]
const NUMBERED: usize = 16;
/// Largest multiplier drawn.
#[cfg(feature = "plot")]
const LARGEST: f64 = 3.0;
/// Colour of the first kind of special point.
#[cfg(feature = "plot")]
const FIRST_COLOUR: usize = 1;
/// Kinds of special points.
#[cfg(feature = "plot")]
const KINDS: [SpecialKind; 9] = [
    SpecialKind::Fold,
    SpecialKind::PeriodDoubling,
    SpecialKind::Torus,
    SpecialKind::Symmetry,
    SpecialKind::GrazingSoft,
    SpecialKind::GrazingDamped,
    SpecialKind::GrazingRigid,
    SpecialKind::Stick,
    SpecialKind::Coincidence,
];

/// Branches that are measured as they are finished.
#[derive(Debug)]
#[non_exhaustive]
pub struct Branches {
    family: Family,
    /// Names of the components of the state.
    components: Vec<String>,
    dimensionless: bool,
    /// Branches so far.
    pub branches: Vec<Branch>,
    /// Measures of their points; none if the orbit could not be run again.
    pub measures: Vec<Vec<Option<Steady>>>,
}

impl Branches {
    /// Returns an empty set of branches of `family`.
    ///
    /// # Errors
    /// [`StudyError`] if the scene cannot be assembled.
    pub fn new(family: Family) -> Result<Self, StudyError> {
        let simulation = family.own()?;
        let components = components(&simulation);
        let dimensionless = simulation.dimensionless;
        Ok(Self { family, components, dimensionless, branches: Vec::new(), measures: Vec::new() })
    }

    /// Adds further branches, and measures their points.
    pub fn take(&mut self, branches: &[Branch], task: Task<'_>) {
        for branch in &branches[self.branches.len()..] {
            let measure = |point: &BranchPoint| self.measure(point, task);
            self.measures.push(branch.points.par_iter().map(measure).collect());
            self.branches.push(branch.clone());
        }
    }

    fn measure(&self, point: &BranchPoint, task: Task<'_>) -> Option<Steady> {
        let simulation = self.family.at(point.value).ok()?;
        let motion = Motion {
            kind: orbit::MotionKind::Periodic,
            period: Some(point.period),
            word: Some(point.word.clone()),
            multiplier: Some(point.multiplier),
            exponent: None,
            rotation: None,
            cycles: 0,
            distance: point.residual,
            reason: None,
        };
        of_orbit(&simulation, &point.section, motion, task).ok()
    }

    /// Returns the table of points: `branches.csv`.
    #[must_use]
    pub fn table(&self) -> String {
        let head = ["branch", "parameter", "period_cycles", "word", "stable", "multiplier"].map(String::from);
        let mut usual = Measures::usual();
        if let Some(first) = self.measures.iter().flatten().flatten().next() {
            usual.take(first);
        }
        let measures = usual.columns(self.dimensionless);
        let mut text = csv_line(head.into_iter().chain(self.components.iter().cloned()).chain(measures)) + "\n";
        for (i, (branch, measures)) in self.branches.iter().zip(&self.measures).enumerate() {
            for (point, steady) in branch.points.iter().zip(measures) {
                let mut cells = vec![
                    i.to_string(),
                    number(point.value),
                    point.period.to_string(),
                    point.word.clone(),
                    point.is_stable.to_string(),
                    number(point.multiplier),
                ];
                cells.extend(point.section.x.iter().map(|x| number(*x)));
                let measured = usual.values(steady.as_ref()).into_iter();
                cells.extend(measured.map(|value| value.map_or_else(String::new, number)));
                text += &(csv_line(cells) + "\n");
            }
        }
        text
    }

    /// Returns all special points.
    pub fn specials(&self) -> impl Iterator<Item = &Special> {
        self.branches.iter().flat_map(|branch| &branch.specials)
    }

    /// Returns the table of special points: `special.csv`.
    #[must_use]
    pub fn special_table(&self) -> String {
        let head = [
            "kind",
            "parameter",
            "period_cycles",
            "word",
            "residual",
            "multiplier_re",
            "multiplier_im",
            "branch",
            "turns",
            "uncertainty",
        ];
        let mut text = csv_line(head) + "\n";
        for special in self.specials() {
            let cells = [
                special.kind.word().to_owned(),
                number(special.value),
                special.period.to_string(),
                special.word.clone(),
                number(special.residual),
                number(special.multiplier.re),
                number(special.multiplier.im),
                special.branch.to_string(),
                special.turns.to_string(),
                number(special.uncertainty),
            ];
            text += &(csv_line(cells) + "\n");
        }
        text
    }

    /// Draws deflection amplitude, time separated and largest multiplier over the parameter, for the first contact of each family.
    #[cfg(feature = "plot")]
    #[must_use]
    pub fn figure(&self, name: &str) -> Figure {
        let unit = |unit: &'static str| if self.dimensionless { "" } else { unit };
        let amplitude = |c: &ContactSteady| Some(0.5 * (c.report.deflection_max? - c.report.deflection_min?));
        let first = self.measures.iter().flatten().flatten().next();
        let mut families = first.map(families).unwrap_or_default();
        families.truncate(MOST);
        let mut panels = Vec::new();
        for (j, name) in families {
            let of = |value: &dyn Fn(&ContactSteady) -> Option<f64>, steady: &Option<Steady>| {
                steady.as_ref().and_then(|steady| value(steady.contacts.get(j)?))
            };
            let amplitudes = |_: &BranchPoint, steady: &Option<Steady>| of(&amplitude, steady);
            let apart = |_: &BranchPoint, steady: &Option<Steady>| of(&|c| Some(c.report.apart_fraction), steady);
            for (label, unit, value) in [
                (
                    "amplitude of the deflection",
                    unit("m"),
                    &amplitudes as &dyn Fn(&BranchPoint, &Option<Steady>) -> Option<f64>,
                ),
                ("time apart / period", "", &apart),
            ] {
                panels.push(Panel {
                    bands: self.double_sided(j),
                    ..self.panel(&format!("{name}: {label}"), unit, value)
                });
            }
        }
        panels.push(self.panel("largest multiplier", "", &|point, _| Some(point.multiplier).filter(|m| *m <= LARGEST)));
        let counted = |kind: SpecialKind| (kind, self.specials().filter(|special| special.kind == kind).count());
        let counts = KINDS.map(counted).into_iter().filter(|(_, count)| *count > 0);
        let counts: Vec<String> = counts.map(|(kind, count)| format!("{count} {}", kind.word())).collect();
        let levels = if self.branches.len() > 1 {
            "Colours: levels of branches, from doublings and broken symmetries. "
        } else {
            ""
        };
        Figure {
            id: "branches".to_owned(),
            title: format!("Orbits of {name} against {}", self.axis().label),
            caption: format!(
                "Full lines: stable; dashed: unstable. {levels}Special points: {}. Multipliers above {LARGEST} are not drawn.",
                if counts.is_empty() { "none".to_owned() } else { counts.join(", ") }
            ),
            columns: 1,
            panels,
        }
    }

    /// Draws the curves of special points in the plane of both numbers.
    #[cfg(feature = "plot")]
    #[must_use]
    pub fn plane(&self, curves: &[Curve], name: &str) -> Figure {
        let second = self.family.second().map_or("", Parameter::pointer);
        let mut panel = Panel { x: self.axis(), y: Axis::of_number(second, self.dimensionless), ..Panel::default() };
        for (i, curve) in curves.iter().enumerate() {
            let period = curve.points.first().map_or(0, |point| point.period);
            let (x, y) = curve.points.iter().map(|point| (point.value, point.second)).unzip();
            panel.series.push(Series::line(format!("curve {i}, period {period}"), i, x, y));
        }
        let marks = [Codimension::Cusp, Codimension::Turn, Codimension::End];
        for (colour, special) in marks.into_iter().enumerate() {
            let all = curves.iter().flat_map(|curve| &curve.points);
            let of_kind = all.filter(|point| point.codimension_two == Some(special));
            let (x, y): (Vec<f64>, Vec<f64>) = of_kind.map(|point| (point.value, point.second)).unzip();
            if !x.is_empty() {
                panel.series.push(Series::line(special.word(), FIRST_COLOUR + colour, x, y).styled(Style::Marks));
            }
        }
        let kind = curves.first().map_or("special point", |curve| curve.kind.word());
        Figure {
            id: "curves".to_owned(),
            title: format!("{kind} of {name} in the plane of two numbers"),
            caption: "Where special points of the motion lie. Marked: cusps, where both numbers turn; turns, where two points meet and \
                      vanish; ends within the ranges."
                .to_owned(),
            columns: 1,
            panels: vec![panel],
        }
    }

    /// Returns the bands of the parameter in which an orbit touches both flanks of contact `j`.
    #[cfg(feature = "plot")]
    fn double_sided(&self, j: usize) -> Vec<Band> {
        let touches = |point: &BranchPoint, side: char| {
            let tokens = point.word.split(' ').map(|token| token.trim_matches(['[', ']']));
            let place = format!("{j}{side}");
            tokens.into_iter().any(|token| token.starts_with(['c', 'i', 'z']) && token[1..] == place)
        };
        let is_double = |point: &BranchPoint| touches(point, '+') && touches(point, '-');
        let pairs = self.branches.iter().flat_map(|branch| branch.points.windows(2));
        let mut parts: Vec<[f64; 2]> = pairs
            .filter(|pair| pair.iter().all(is_double))
            .map(|pair| [pair[0].value.min(pair[1].value), pair[0].value.max(pair[1].value)])
            .collect();
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut merged: Vec<[f64; 2]> = Vec::new();
        for part in parts {
            match merged.last_mut() {
                Some(last) if part[0] <= last[1] => last[1] = last[1].max(part[1]),
                _ => merged.push(part),
            }
        }
        let band = |x| Band { x, name: "an orbit touches both flanks".to_owned(), colour: 0 };
        merged.into_iter().map(band).collect()
    }

    /// Returns the axis of the parameter.
    #[cfg(feature = "plot")]
    fn axis(&self) -> Axis {
        Axis::of_number(self.family.parameter.pointer(), self.dimensionless)
    }

    /// Returns a panel of one value of the points.
    #[cfg(feature = "plot")]
    fn panel(&self, label: &str, unit: &str, value: &dyn Fn(&BranchPoint, &Option<Steady>) -> Option<f64>) -> Panel {
        let mut panel = Panel {
            title: label.to_owned(),
            x: self.axis().between(self.family.from, self.family.to),
            y: Axis::new(label.rsplit(": ").next().unwrap_or_default(), unit),
            ..Panel::default()
        };
        for (branch, measures) in self.branches.iter().zip(&self.measures) {
            let values: Vec<Option<f64>> =
                branch.points.iter().zip(measures).map(|(point, m)| value(point, m)).collect();
            let level = branch.level as usize;
            let mut from = 0;
            while from < values.len() {
                let is_stable = branch.points[from].is_stable;
                let is_alike = |i: &usize| branch.points[*i].is_stable == is_stable && values[*i].is_some();
                let run = (from..values.len()).take_while(is_alike).count().max(1);
                // Stable and unstable lines have a common point.
                let last = (from + run).min(values.len() - 1);
                let all = (from..=last).filter_map(|i| Some((branch.points[i].value, values[i]?)));
                let (x, y): (Vec<f64>, Vec<f64>) = all.unzip();
                let (word, style) = if is_stable { ("stable", Style::Line) } else { ("unstable", Style::Dashed) };
                panel.series.push(Series::line(format!("{word}, level {level}"), level, x, y).styled(style));
                from += run;
            }
        }
        for (colour, kind) in KINDS.into_iter().enumerate() {
            let of_kind = self.specials().filter(|special| special.kind == kind);
            let points = of_kind.filter_map(|special| {
                let (points, measures) = (&self.branches[special.branch].points, &self.measures[special.branch]);
                Some((special.value, value(points.get(special.point)?, &measures[special.point])?))
            });
            let (x, y): (Vec<f64>, Vec<f64>) = points.unzip();
            if !x.is_empty() {
                let notes = x.iter().zip(&y).map(|(x, y)| Note { at: [*x, *y], text: five_digits(*x) });
                panel.notes.extend(notes);
                panel.series.push(Series::line(kind.word(), FIRST_COLOUR + colour, x, y).styled(Style::Marks));
            }
        }
        // More numbers cannot be read.
        if panel.notes.len() > NUMBERED {
            panel.notes.clear();
        }
        panel
    }
}

/// Returns the table of curves: `curves.csv`.
#[must_use]
pub fn curve_table(curves: &[Curve]) -> String {
    let head =
        ["curve", "kind", "parameter", "second", "period_cycles", "word", "codimension_two", "residual", "uncertainty"];
    let mut text = csv_line(head) + "\n";
    for (i, curve) in curves.iter().enumerate() {
        for point in &curve.points {
            let cells = [
                i.to_string(),
                curve.kind.word().to_owned(),
                number(point.value),
                number(point.second),
                point.period.to_string(),
                point.word.clone(),
                point.codimension_two.map(Codimension::word).unwrap_or_default().to_owned(),
                number(point.residual),
                number(point.uncertainty),
            ];
            text += &(csv_line(cells) + "\n");
        }
    }
    text
}
