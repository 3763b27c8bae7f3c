//! Multiple shooting: an orbit as a section for each cycle of its period, all solved for at once. The amplification of one cycle does not
//! multiply that of the next: orbits are found whose whole period would amplify rounding beyond all bounds.

use nalgebra::{Complex, DMatrix, DVector};

use super::{
    Drift, INTERRUPTED, NewtonFailure, Orbit, SectionMap,
    newton::{CLOSED, HALVINGS, LONGEST, Options, SAME, STEPS, UNLIKE},
    section::{Image, Section},
    unknowns::Unknowns,
    words::WordObserver,
};
use crate::{simulation::SimulationError, system::Variation, tangent::zeros};

/// Maximum number of unknowns: their matrix is full, and its solution costs the cube.
const MOST: usize = 600;
/// Passes over the period that turn the factors of its derivative to its invariant directions.
const PASSES: usize = 8;

/// Ends of all cycles from their sections.
pub(super) struct Shots {
    sections: Vec<Section>,
    images: Vec<Image>,
    /// All cycles as one image.
    whole: Image,
    unknowns: Unknowns,
    /// End of each cycle minus the start of the next one, in scales.
    off: Vec<DVector<f64>>,
    /// Largest norm of these differences.
    residual: f64,
}

/// Returns the images of successive steps as one, with `steps` in a cycle; the word and the sizes of the last one are those of all.
fn joined(images: &[Image], steps: usize) -> Option<Image> {
    let (mut whole, last) = (images.first()?.clone(), images.last()?);
    (whole.word, whole.sizes) = (last.word.clone(), last.sizes.clone());
    for image in &images[1..] {
        whole.end = image.end.clone();
        whole.between.extend(image.between.iter().cloned());
        whole.by_number = &image.jacobian * &whole.by_number + &image.by_number;
        whole.jacobian = &image.jacobian * &whole.jacobian;
        whole.latched.iter_mut().zip(&image.latched).for_each(|(a, b)| *a |= b);
        whole.dead.extend(image.dead.iter().cloned());
        whole.volume += image.volume;
        whole.corner = whole.corner.or_else(|| image.corner.clone());
        whole.has_event_at_section |= image.has_event_at_section;
        whole.pieces += image.pieces;
    }
    whole.between = whole.between.into_iter().skip(steps - 1).step_by(steps).collect();
    whole.zeros = zeros(&whole.dead, &whole.latched);
    Some(whole)
}

/// Returns `J_i y_i − y_{i+1}` for all cycles, the last one followed by the first, as a matrix over all y.
fn cyclic(factors: &[DMatrix<f64>]) -> DMatrix<f64> {
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
    pub fn new(
        map: &SectionMap<'_>,
        mut sections: Vec<Section>,
        variations: &[Variation],
        drift: &Drift,
    ) -> Result<Self, SimulationError> {
        let structure = &map.simulation().structure;
        let moving = 2 * structure.freedoms();
        let (images, whole) = loop {
            let mut words = WordObserver::new(structure, &sections[0].x);
            let image = |(i, section)| map.at_step(i).image_with((section, 1), variations, &mut words);
            let images = sections.iter().enumerate().map(image).collect::<Result<Vec<_>, _>>()?;
            let whole = joined(&images, map.steps())
                .ok_or_else(|| map.simulation().missing("an orbit has at least one cycle"))?;
            // A latched speed that no cycle writes is no unknown and keeps its value over the period.
            let unwritten = (0..whole.latched.len()).filter(|i| !whole.latched[*i]).map(|i| moving + i);
            let kept: Vec<(usize, f64)> = unwritten.map(|i| (i, sections[0].x[i])).collect();
            if sections.iter().all(|section| kept.iter().all(|(i, speed)| section.x[*i] == *speed)) {
                break (images, whole);
            }
            sections.iter_mut().for_each(|section| kept.iter().for_each(|(i, speed)| section.x[*i] = *speed));
        };
        let unknowns = Unknowns::new(map, &whole, drift);
        let next = sections.iter().cycle().skip(1);
        let off: Vec<_> = images.iter().zip(next).map(|(i, next)| unknowns.between(&next.x, &i.end.x)).collect();
        let largest = |m: f64, r: f64| if m.is_nan() || r.is_nan() { f64::NAN } else { m.max(r) };
        let residual = off.iter().map(DVector::norm).fold(0.0, largest);
        Ok(Self { sections, images, whole, unknowns, off, residual })
    }

    /// Returns the derivative of each cycle, in unknowns.
    pub fn factors(&self) -> Vec<DMatrix<f64>> {
        self.images.iter().map(|image| self.unknowns.reduced(&image.jacobian)).collect()
    }

    /// Returns Newton's step of each section.
    fn step(&self) -> Option<Vec<DVector<f64>>> {
        let m = self.unknowns.count();
        let off = DVector::from_iterator(self.off.len() * m, self.off.iter().flat_map(|off| off.iter().map(|o| -o)));
        let step = cyclic(&self.factors()).lu().solve(&off)?;
        let parts = step.as_slice().chunks_exact(m.max(1)).map(DVector::from_column_slice).collect();
        step.iter().all(|s| s.is_finite()).then_some(parts)
    }

    /// Returns the sections after a share of the step, with the modes of contacts at the end of the cycle before.
    fn moved(&self, step: &[DVector<f64>], share: f64) -> Vec<Section> {
        let before = self.images.iter().cycle().skip(self.images.len() - 1);
        let each = self.sections.iter().zip(step).zip(before);
        each.map(|((section, step), before)| {
            let change = self.unknowns.lifted(step);
            let x = section.x.iter().zip(&change).map(|(x, change)| x + share * change).collect();
            Section { x, contacts: before.end.contacts.clone() }
        })
        .collect()
    }
}

impl SectionMap<'_> {
    /// Returns the orbit near `trail`, which has a section for each step of the period: for each cycle, unless the map is divided.
    ///
    /// # Errors
    /// [`NewtonFailure`], if Newton's method does not converge, or if the period has more than 600 unknowns.
    pub fn shoot(&self, trail: &[Section], drift: &Drift) -> Result<Orbit, NewtonFailure> {
        self.shoot_from(trail, drift, Options::default())
    }

    /// Returns the orbit of [`shoot`](Self::shoot), with the patience and the task of `options`.
    pub(super) fn shoot_from(
        &self,
        trail: &[Section],
        drift: &Drift,
        Options { patience, task, .. }: Options<'_>,
    ) -> Result<Orbit, NewtonFailure> {
        let missed = |residual: f64, reason: &str| NewtonFailure { residual, reason: reason.to_owned() };
        let dim = trail.first().map_or(0, |section| section.x.len());
        if trail.len() * dim > MOST {
            return Err(missed(f64::INFINITY, "the period has too many unknowns for multiple shooting"));
        }
        self.repeats().map_err(|error| missed(f64::INFINITY, &error.to_string()))?;
        let shots = |sections| Shots::new(self, sections, &[], drift);
        let mut now = shots(trail.to_vec()).map_err(|error| missed(f64::INFINITY, &error.to_string()))?;
        let first = now.residual;
        for count in 0..STEPS {
            if task.is_cancelled() {
                return Err(missed(now.residual, INTERRUPTED));
            }
            if patience.is_some_and(|steps| count == steps) && now.residual > 0.5 * first {
                return Err(missed(now.residual, "Newton's method does not converge from here"));
            }
            if now.unknowns.count() == 0 {
                return Err(missed(now.residual, "the train drifts as a whole: nothing of its state returns"));
            }
            let Some(step) = now.step() else { return Err(missed(now.residual, "the derivative cannot be inverted")) };
            let length = step.iter().map(DVector::norm).fold(0.0, f64::max);
            let is_closed = now.residual <= CLOSED;
            if is_closed && length <= 1e-13 {
                return self.assemble(now, drift);
            }
            if length > LONGEST {
                return Err(missed(now.residual, "a step of Newton's method leaves the range of the motion"));
            }
            let halvings = if is_closed { 0 } else { HALVINGS };
            let next = (0..=halvings).find_map(|halved| {
                let trial = shots(now.moved(&step, 0.5f64.powi(halved))).ok()?;
                (trial.residual < now.residual).then_some(trial)
            });
            match next {
                Some(next) => now = next,
                None if is_closed => return self.assemble(now, drift),
                None => return Err(missed(now.residual, "no step of Newton's method makes the residual smaller")),
            }
        }
        if now.residual <= CLOSED {
            return self.assemble(now, drift);
        }
        Err(missed(now.residual, "Newton's method does not converge"))
    }

    /// Returns the orbit from converged shots, with its smallest period.
    fn assemble(&self, shots: Shots, drift: &Drift) -> Result<Orbit, NewtonFailure> {
        let cycles = shots.sections.len();
        let mut next = shots.sections.iter().cycle().skip(1);
        if shots.images.iter().any(|image| next.next().is_some_and(|next| next.contacts != image.end.contacts)) {
            return Err(NewtonFailure { residual: shots.residual, reason: UNLIKE.to_owned() });
        }
        let apart = |i: usize| shots.unknowns.between(&shots.sections[0].x, &shots.sections[i].x).norm();
        if let Some(shorter) = (self.steps()..cycles)
            .step_by(self.steps())
            .find(|shorter| cycles.is_multiple_of(*shorter) && apart(*shorter) <= SAME)
        {
            return self.shoot(&shots.sections[..shorter], drift);
        }
        let factors = shots.factors();
        let condition = cyclic(&factors).singular_values().min();
        let Shots { mut sections, whole, unknowns, residual, .. } = shots;
        Ok(Orbit::of(sections.swap_remove(0), whole, (&unknowns, &factors), residual, condition.recip()))
    }

    /// Returns the derivative of the start of an orbit by numbers of the train, `[dim, count]`; a drifting body keeps its place. For each
    /// cycle `J_i dx_i − dx_{i+1} = −∂x_{i+1}/∂α`.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails; [`SimulationError::Missing`] if a multiplier is 1 and the orbit ends.
    pub fn orbit_by(&self, orbit: &Orbit, variations: &[Variation]) -> Result<DMatrix<f64>, SimulationError> {
        let mut sections = orbit.image.between.clone();
        sections.rotate_right(1);
        sections[0] = orbit.section.clone();
        let Shots { images, whole, unknowns, .. } = Shots::new(self, sections, variations, &self.drift())?;
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
    let Some(size) = factors.first().map(DMatrix::nrows) else { return Vec::new() };
    if let [factor] = factors {
        return factor.complex_eigenvalues().iter().copied().collect();
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
