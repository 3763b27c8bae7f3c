//! Orbits that a symmetry maps to each other: exchange of both flanks half a cycle later, or of equal planets.

use super::{Drift, Orbit, SearchResult, Section, SectionMap, newton::SAME, unknowns::distance};

impl Orbit {
    /// Returns whether `x` is a point of the orbit, within a distance in scales.
    pub(super) fn passes(&self, map: &SectionMap<'_>, x: &[f64], drift: &Drift, within: f64) -> bool {
        let there = Section { x: x.to_vec(), contacts: self.section.contacts.clone() };
        let scales = map.scales_of(std::slice::from_ref(&self.section));
        self.image.between.iter().any(|point| distance(map, point, &there, &scales, drift) <= within)
    }

    /// Returns the state half a cycle later with drive and back flanks exchanged; `None` if it cannot be reached.
    fn mirrored(&self, map: &SectionMap<'_>) -> Option<Vec<f64>> {
        let half = map.lead(&self.section, &map.at_phase(0.5)).ok()?;
        let moving = 2 * map.simulation().structure.freedoms();
        Some(half.x.iter().enumerate().map(|(i, x)| if i < moving { -x } else { *x }).collect())
    }

    /// Returns the states with two members exchanged in all classes of equal degrees of freedom, one for each pair of members.
    fn exchanged(&self, map: &SectionMap<'_>) -> Vec<Vec<f64>> {
        let structure = &map.simulation().structure;
        let (n, classes) = (structure.freedoms(), structure.symmetry.freedoms());
        let most = classes.iter().map(Vec::len).max().unwrap_or(0);
        let pairs = (0..most).flat_map(|a| (0..a).map(move |b| (a, b)));
        let exchange = |(a, b): (usize, usize)| {
            let mut x = self.section.x.clone();
            for class in classes.iter().filter(|class| class.len() == most) {
                for first in [0, n] {
                    x.swap(first + class[a], first + class[b]);
                }
            }
            x
        };
        pairs.map(exchange).collect()
    }
}

impl SearchResult {
    /// Sets for each orbit whether it is its own mirror image, and its earlier partner.
    pub(super) fn pair_up(&mut self, map: &SectionMap<'_>) {
        for i in 0..self.orbits.len() {
            let orbit = &self.orbits[i];
            let mirrored = orbit.mirrored(map);
            let passes = |other: &Orbit, x: &Vec<f64>| other.passes(map, x, &self.drift, SAME);
            let is_symmetric = mirrored.as_ref().is_some_and(|x| passes(orbit, x));
            let images: Vec<Vec<f64>> = mirrored.into_iter().chain(orbit.exchanged(map)).collect();
            let is_partner = |other: &&Orbit| other.period == orbit.period && images.iter().any(|x| passes(other, x));
            let partner = self.orbits[..i].iter().position(|other| is_partner(&other));
            let orbit = &mut self.orbits[i];
            (orbit.is_symmetric, orbit.partner) = (is_symmetric, partner);
        }
    }
}
