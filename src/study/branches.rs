//! Branches of orbits with the measures of their contacts, as files.

use rayon::prelude::*;

use super::{
    StudyError,
    steady::{Steady, of_orbit},
    steady_sweep::{contact_cells, contact_columns, named},
};
use crate::{
    branch::{Branch, Family, Point, Special},
    orbit::{self, Motion, components},
    output::{csv_line, number},
    scene::Scene,
    simulation::Parameter,
    task::Task,
};

/// Branches that are measured as they are finished.
#[derive(Debug)]
pub struct Branches {
    family: Family,
    /// Names of the components of the state, and of the contacts.
    components: Vec<String>,
    contacts: Vec<String>,
    dimensionless: bool,
    /// The branches so far.
    pub branches: Vec<Branch>,
    /// Measures of their points; none where the orbit could not be run again.
    pub measures: Vec<Vec<Option<Steady>>>,
}

impl Branches {
    /// Without any branch yet, of `scene` along `parameter`.
    ///
    /// # Errors
    /// [`StudyError`] if the scene cannot be assembled.
    pub fn new(scene: &Scene, parameter: Parameter, ends: [f64; 2]) -> Result<Self, StudyError> {
        let family = Family::new(scene.clone(), parameter, ends)?;
        let simulation = family.own()?;
        let components = components(&simulation);
        let dimensionless = simulation.dimensionless;
        Ok(Self { family, components, contacts: Vec::new(), dimensionless, branches: Vec::new(), measures: Vec::new() })
    }

    /// Takes further branches, and measures their points.
    pub fn take(&mut self, branches: &[Branch], task: Task<'_>) {
        for branch in &branches[self.branches.len()..] {
            let measure = |point: &Point| self.measure(point, task);
            self.measures.push(branch.points.par_iter().map(measure).collect());
            self.branches.push(branch.clone());
        }
        if self.contacts.is_empty() {
            let first = self.measures.iter().flatten().flatten().next();
            self.contacts = first.map(|steady| named(steady).map(|(name, _)| name).collect()).unwrap_or_default();
        }
    }

    fn measure(&self, point: &Point, task: Task<'_>) -> Option<Steady> {
        let simulation = self.family.at(point.value).ok()?;
        let motion = Motion {
            kind: orbit::Kind::Periodic,
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

    /// The table of points: `branches.csv`.
    #[must_use]
    pub fn table(&self) -> String {
        let head = ["branch", "parameter", "period_cycles", "word", "stable", "multiplier"].map(String::from);
        let contacts = contact_columns(&self.contacts, self.dimensionless);
        let mut text = csv_line(head.into_iter().chain(self.components.iter().cloned()).chain(contacts)) + "\n";
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
                cells.extend(contact_cells(&self.contacts, steady.as_ref()));
                text += &(csv_line(cells) + "\n");
            }
        }
        text
    }

    /// All special points.
    pub fn specials(&self) -> impl Iterator<Item = &Special> {
        self.branches.iter().flat_map(|branch| &branch.specials)
    }

    /// The table of special points: `special.csv`.
    #[must_use]
    pub fn special_table(&self) -> String {
        let head =
            ["kind", "parameter", "period_cycles", "word", "residual", "multiplier_re", "multiplier_im", "branch"];
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
            ];
            text += &(csv_line(cells) + "\n");
        }
        text
    }
}
