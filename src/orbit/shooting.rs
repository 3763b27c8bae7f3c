//! Shooting: the runs between the sections of an orbit, and the equations that close it.
//!
//! Single shooting has one section. Multiple shooting has one for each cycle, and all are solved for at once. The amplification of one cycle
//! does not multiply that of the next: orbits are found whose whole period would amplify rounding beyond all bounds.

use std::mem::take;

use nalgebra::{Complex, DMatrix, DVector};

use super::{
    Drift, Orbit, SectionMap,
    section::{Image, Section, SpareEngine},
    unknowns::Unknowns,
    words::WordObserver,
};
use crate::{simulation::SimulationError, system::Variation, tangent::zeros};

/// Maximum number of unknowns: their matrix is full, and its solution costs the cube.
pub(super) const MOST: usize = 600;
/// Share of the largest singular value below which a singular value belongs to an undetermined direction.
const NEUTRAL: f64 = 1e-12;
/// Passes over the period that turn the factors of its derivative to its invariant directions.
const PASSES: usize = 8;

/// Runs from the sections of an orbit to the next ones.
pub(super) struct Shots {
    pub sections: Vec<Section>,
    /// Cycles of each run.
    pub cycles: u64,
    images: Vec<Image>,
    /// All runs as one image.
    pub whole: Image,
    pub unknowns: Unknowns,
    /// End of each run minus the start of the next one, in unknowns, one after the other.
    pub off: DVector<f64>,
    /// Largest norm of these differences.
    pub residual: f64,
}

/// Returns the images of successive steps as one, with `steps` in a cycle, which takes their sections, and the sizes of the last one.
fn joined(images: &mut [Image], steps: usize) -> Option<Image> {
    let last = images.last_mut()?;
    let (sizes, end) = (take(&mut last.sizes), last.end.clone());
    let between = images.iter_mut().flat_map(|image| take(&mut image.between)).collect();
    let mut whole = Image { sizes, end, between, ..images[0].clone() };
    for image in &images[1..] {
        whole.by_number = &image.jacobian * &whole.by_number + &image.by_number;
        whole.jacobian = &image.jacobian * &whole.jacobian;
        whole.latched.iter_mut().zip(&image.latched).for_each(|(a, b)| *a |= b);
        whole.dead.extend(image.dead.iter().cloned());
        whole.volume += image.volume;
        whole.log_determinant = whole.log_determinant.zip(image.log_determinant).map(|(a, b)| a + b);
        whole.corner = whole.corner.or_else(|| image.corner.clone());
        whole.has_event_at_section |= image.has_event_at_section;
        whole.pieces += image.pieces;
    }
    whole.between = whole.between.into_iter().skip(steps - 1).step_by(steps).collect();
    whole.zeros = zeros(&whole.dead, &whole.latched);
    Some(whole)
}

/// Returns `J_i y_i − y_{i+1}` for all cycles, the last one followed by the first, as a matrix over all y.
pub(super) fn cyclic(factors: &[DMatrix<f64>]) -> DMatrix<f64> {
    let (cycles, m) = (factors.len(), factors.first().map_or(0, DMatrix::nrows));
    let mut matrix = DMatrix::zeros(cycles * m, cycles * m);
    for (i, factor) in factors.iter().enumerate() {
        matrix.view_mut((i * m, i * m), (m, m)).copy_from(factor);
        let next = (i + 1) % cycles;
        (0..m).for_each(|l| matrix[(i * m + l, next * m + l)] -= 1.0);
    }
    matrix
}

impl Shots {
    pub fn new<'s>(
        (map, spare): (&SectionMap<'s>, &mut SpareEngine<'s>),
        (mut sections, cycles): (Vec<Section>, u64),
        variations: &[Variation],
        drift: &Drift,
    ) -> Result<Self, SimulationError> {
        let structure = &map.simulation().structure;
        let moving = 2 * structure.freedoms();
        let (images, whole) = loop {
            let mut words = WordObserver::new(structure, &sections[0].x);
            let image = |(i, section)| map.at_step(i).image_with(spare, (section, cycles), variations, &mut words);
            let mut images = sections.iter().enumerate().map(image).collect::<Result<Vec<_>, _>>()?;
            let mut whole = joined(&mut images, map.steps())
                .ok_or_else(|| map.simulation().missing("an orbit has at least one cycle"))?;
            // A latched speed that no cycle writes is no unknown and keeps its value over the period.
            let unwritten = (0..whole.latched.len()).filter(|i| !whole.latched[*i]).map(|i| moving + i);
            let kept: Vec<(usize, f64)> = unwritten.map(|i| (i, sections[0].x[i])).collect();
            if sections.iter().all(|section| kept.iter().all(|(i, speed)| section.x[*i] == *speed)) {
                whole.word = words.into_word();
                break (images, whole);
            }
            sections.iter_mut().for_each(|section| kept.iter().for_each(|(i, speed)| section.x[*i] = *speed));
        };
        let unknowns = Unknowns::new(map, &whole, drift);
        let ends = images.iter().map(|image| &image.end);
        let off = between(&unknowns, &sections, ends);
        let mut shots = Self { sections, cycles, images, whole, unknowns, off, residual: 0.0 };
        shots.residual = shots.largest(&shots.off);
        Ok(shots)
    }

    /// Returns the derivative of each cycle, in unknowns.
    pub fn factors(&self) -> Vec<DMatrix<f64>> {
        self.images.iter().map(|image| self.unknowns.reduced(&image.jacobian)).collect()
    }

    /// Returns the largest norm of the parts of a vector that belong to one section.
    pub fn largest(&self, y: &DVector<f64>) -> f64 {
        let m = self.unknowns.count();
        let larger = |m: f64, r: f64| if m.is_nan() || r.is_nan() { f64::NAN } else { m.max(r) };
        (0..self.sections.len()).map(|i| y.rows(i * m, m).norm()).fold(0.0, larger)
    }

    /// Returns Newton's step. That from one section has no part along undetermined directions, and the singular values are returned too.
    pub fn step(&self) -> Result<(DVector<f64>, Option<Svd>), &'static str> {
        if !self.residual.is_finite() {
            return Err("the motion leaves the range of numbers");
        }
        if self.unknowns.count() == 0 {
            return Err("the train drifts as a whole: nothing of its state returns");
        }
        let derivative = cyclic(&self.factors());
        if derivative.iter().any(|entry| !entry.is_finite()) {
            return Err("the derivative leaves the range of numbers");
        }
        let (step, svd) = if self.sections.len() == 1 {
            let svd = derivative.svd(true, true);
            (svd.solve(&-&self.off, NEUTRAL * svd.singular_values.max()).ok(), Some(svd))
        } else {
            (derivative.lu().solve(&-&self.off), None)
        };
        let step = step.filter(|step| step.iter().all(|s| s.is_finite()));
        Ok((step.ok_or("the derivative cannot be inverted")?, svd))
    }

    /// Returns `sections` after a step, with the modes of contacts at the end of the run before.
    pub fn moved(&self, sections: &[Section], step: &DVector<f64>) -> Vec<Section> {
        let before = self.images.iter().cycle().skip(self.images.len() - 1);
        let each = sections.iter().enumerate().zip(before);
        let m = self.unknowns.count();
        each.map(|((i, section), before)| {
            let change = self.unknowns.lifted(&step.rows(i * m, m).into_owned());
            let x = section.x.iter().zip(&change).map(|(x, change)| x + change).collect();
            Section { x, contacts: before.end.contacts.clone() }
        })
        .collect()
    }

    /// Returns `off` of other sections, by runs without a derivative; `None` if one fails.
    pub fn off_at<'s>(
        &self,
        (map, spare): (&SectionMap<'s>, &mut SpareEngine<'s>),
        sections: &[Section],
    ) -> Option<DVector<f64>> {
        let run = |(i, section)| map.at_step(i).follow_by(spare, section, self.cycles).ok();
        let ends: Vec<Section> = sections.iter().enumerate().map(run).collect::<Option<_>>()?;
        Some(between(&self.unknowns, sections, ends.iter())).filter(|off| off.norm().is_finite())
    }

    /// Returns whether contacts start each run as the run before leaves them.
    pub fn is_alike(&self) -> bool {
        let next = self.sections.iter().cycle().skip(1);
        self.images.iter().zip(next).all(|(image, next)| image.end.contacts == next.contacts)
    }
}

/// Singular values and vectors.
pub(crate) type Svd = nalgebra::SVD<f64, nalgebra::Dyn, nalgebra::Dyn>;

/// Returns the inverse without undetermined directions.
pub(super) fn pseudo_inverse(svd: Svd) -> Result<DMatrix<f64>, &'static str> {
    let least = NEUTRAL * svd.singular_values.max();
    svd.pseudo_inverse(least)
}

/// Returns the end of each run minus the start of the next one, in unknowns.
fn between<'a>(unknowns: &Unknowns, sections: &[Section], ends: impl Iterator<Item = &'a Section>) -> DVector<f64> {
    let next = sections.iter().cycle().skip(1);
    let all: Vec<f64> =
        ends.zip(next).flat_map(|(end, next)| unknowns.between(&next.x, &end.x).data.as_vec().clone()).collect();
    DVector::from_vec(all)
}

impl SectionMap<'_> {
    /// Returns the derivative of the start of an orbit by numbers of the train, `[dim, count]`; a drifting body keeps its place. For each
    /// cycle `J_i dx_i − dx_{i+1} = −∂x_{i+1}/∂α`.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails; [`SimulationError::Missing`] if a multiplier is 1 and the orbit ends.
    pub fn orbit_by(&self, orbit: &Orbit, variations: &[Variation]) -> Result<DMatrix<f64>, SimulationError> {
        let mut sections = orbit.image.between.clone();
        sections.rotate_right(1);
        sections[0] = orbit.section.clone();
        let Shots { images, whole, unknowns, .. } =
            Shots::new((self, &mut None), (sections, 1), variations, &self.drift())?;
        // A long period that was found as a whole is solved as a whole.
        let images = if images.len() * unknowns.count() > MOST { vec![whole] } else { images };
        let factors: Vec<_> = images.iter().map(|image| unknowns.reduced(&image.jacobian)).collect();
        let m = unknowns.count();
        let mut by_number = DMatrix::zeros(images.len() * m, variations.len());
        for (i, image) in images.iter().enumerate() {
            by_number.rows_mut(i * m, m).copy_from(&-unknowns.columns(&image.by_number));
        }
        let solved = cyclic(&factors).lu().solve(&by_number);
        let solved =
            solved.ok_or_else(|| self.simulation().missing("its orbit has a multiplier 1: it turns back there"))?;
        let lifted = |column: usize| unknowns.lifted(&solved.view((0, column), (m, 1)).column(0).into_owned());
        let columns: Vec<DVector<f64>> = (0..variations.len()).map(lifted).collect();
        Ok(DMatrix::from_columns(&columns))
    }
}

/// Returns the eigenvalues of the product of `factors`, the first one applied first. The product would lose entries small beside its
/// largest. Its factors are made triangular one after the other, `J Q = Q' R`. The product of triangles keeps the digits of each row (after
/// the periodic QR of Bojanczyk, Golub and Van Dooren 1992).
pub(super) fn eigenvalues(factors: &[DMatrix<f64>]) -> Vec<Complex<f64>> {
    let Some(size @ 1..) = factors.first().map(DMatrix::nrows) else { return Vec::new() };
    if let [factor] = factors {
        // Squares of small entries are below the range of numbers. A power of two as unit changes no digit.
        let exponent = libm::frexp(factor.amax()).1.clamp(-1000, 1000);
        let (unit, inverse) = (libm::ldexp(1.0, exponent), libm::ldexp(1.0, -exponent));
        return (factor * inverse).complex_eigenvalues().iter().map(|m| m * unit).collect();
    }
    let mut q = DMatrix::identity(size, size);
    let mut turned = q.clone();
    for _ in 0..PASSES {
        let (start, mut product) = (q.clone(), DMatrix::identity(size, size));
        for factor in factors {
            let qr = (factor * &q).qr();
            (q, product) = (qr.q(), qr.r() * product);
        }
        // The whole is similar to `R Qᵀ₀ Q`, and nearer to a triangle with each pass.
        turned = product * start.transpose() * &q;
    }
    turned.complex_eigenvalues().iter().copied().collect()
}
