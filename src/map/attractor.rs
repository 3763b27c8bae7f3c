//! Attractors, on which starts end.

use serde::{Deserialize, Serialize};

use super::cell::Cell;
use crate::{
    orbit::{Drift, MotionKind, Section, SectionMap, rest::NEUTRAL, unknowns::distance},
    simulation::SimulationError,
    system::ContactMode,
};

/// Distance within which two orbits are the same.
const SAME: f64 = 1e-5;
/// Steps from the latched speeds of one orbit to those of another: one, or small ones if that leads elsewhere.
const WALKS: [u32; 2] = [1, 8];
/// Standard deviations within which the means of two irregular motions are the same.
const ALIKE: f64 = 0.5;

/// End of a start.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Attractor {
    /// Kind of the motion.
    pub kind: MotionKind,
    /// Period, cycles, of an orbit.
    pub period_cycles: Option<u64>,
    /// Word of an orbit.
    pub word: Option<String>,
    /// Flanks that are struck.
    pub impacts: String,
    /// Largest exponent, 1/s.
    pub exponent: Option<f64>,
    /// States of an orbit at the starts of its cycles; for any other motion one state.
    pub states: Vec<Vec<f64>>,
    /// Mean and standard deviation of each component at the starts of cycles, for a motion without an orbit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub averages: Vec<[f64; 2]>,
    /// True if there is an orbit for each start. Either a contact that the orbit never loses keeps the approach speed of its last closure,
    /// or the train can rest anywhere in its gaps.
    pub is_family: bool,
    rests: bool,
    scales: Vec<f64>,
    /// Mode of each contact at the first of the states.
    contacts: Vec<ContactMode>,
}

impl Attractor {
    pub(super) fn new(map: &SectionMap<'_>, cell: Cell) -> Result<Self, SimulationError> {
        let Cell { motion, exponent, impacts, section, averages, .. } = cell;
        let mut sections = vec![section];
        for _ in 1..motion.period.unwrap_or(1) {
            sections.push(map.follow(&sections[sections.len() - 1], 1)?);
        }
        let scales = map.scales_of(&sections);
        let contacts = sections[0].contacts.clone();
        let keeps = |period| Ok::<_, SimulationError>(map.image(&sections[0], period)?.latched.contains(&false));
        let rests = motion.word.as_deref() == Some("") && motion.multiplier.is_some_and(|m| (m - 1.0).abs() <= NEUTRAL);
        let is_family = rests || motion.period.map_or(Ok(false), keeps)?;
        let states = sections.into_iter().map(|section| section.x).collect();
        let (kind, period_cycles, word, impacts) = (motion.kind, motion.period, motion.word, impacts.word().to_owned());
        Ok(Self { kind, period_cycles, word, impacts, exponent, states, averages, is_family, rests, scales, contacts })
    }

    /// Returns whether a state at the start of a cycle is within `reach` of its orbit.
    pub(super) fn holds(&self, map: &SectionMap<'_>, drift: &Drift, x: &[f64], reach: f64) -> bool {
        let near = |state: &Vec<f64>| {
            if drift.directions.is_empty() {
                let n = x.len().min(2 * map.simulation().structure.freedoms());
                let off = |i: usize| ((x[i] - state[i]) / self.scales[i]).abs();
                // Most states differ by their first component.
                return off(0) <= reach && (0..n).map(|i| off(i).powi(2)).sum::<f64>().sqrt() <= reach;
            }
            distance(map, state, &x, &self.scales, drift) <= reach
        };
        self.period_cycles.is_some() && self.states.iter().any(near)
    }

    /// Returns whether this orbit becomes `other` as the latched speeds become those of `other`.
    fn leads_to(&self, other: &Self, period: u64, map: &SectionMap<'_>, drift: &Drift) -> bool {
        let n = 2 * map.simulation().structure.freedoms();
        let [from, to] = [&self.states[0][n..], &other.states[0][n..]];
        WALKS.into_iter().any(|steps| {
            let mut section = Section { x: self.states[0].clone(), contacts: self.contacts.clone() };
            let arrives = (1..=steps).all(|step| {
                let share = f64::from(step) / f64::from(steps);
                (section.x[n..].iter_mut().zip(from).zip(to))
                    .for_each(|((x, from), to)| *x = from + share * (to - from));
                map.solve(&section, period, drift).is_ok_and(|orbit| {
                    section = orbit.section;
                    orbit.period == period
                })
            });
            arrives && other.holds(map, drift, &section.x, SAME)
        })
    }

    /// Returns whether `other` is the same attractor.
    pub(super) fn is(&self, map: &SectionMap<'_>, drift: &Drift, other: &Self) -> bool {
        if self.kind != other.kind || self.period_cycles != other.period_cycles {
            return false;
        }
        if let Some(period) = self.period_cycles {
            return self.holds(map, drift, &other.states[0], SAME)
                || self.rests && other.rests && self.contacts == other.contacts
                || self.is_family && self.word == other.word && other.leads_to(self, period, map, drift);
        }
        // A constant component, such as a speed latched once, belongs to the start and not to the motion.
        let is_alike = |(a, b): (&[f64; 2], &[f64; 2])| {
            let spread = a[1].max(b[1]);
            spread == 0.0 || (a[0] - b[0]).abs() <= ALIKE * spread
        };
        self.impacts == other.impacts && self.averages.iter().zip(&other.averages).all(is_alike)
    }
}
