//! Unknowns of Newton's method: the components of a section that return, in scales, without drift.

use nalgebra::{DMatrix, DVector};

use super::{
    SectionMap,
    section::{Image, Section},
};
use crate::{gear::Stiffness, simulation::Simulation, system::ContactSpec};

/// Reason for which a search ends at once.
pub(super) const ACCELERATES: &str =
    "the train as a whole has no drag, and a constant load pushes it: it accelerates for ever";
/// A constant load along a drift below this share of its terms is rounding.
const BALANCED: f64 = 1e-12;
/// Share of the largest singular value below which a direction strains no spring and no contact.
const UNFELT: f64 = 1e-10;
/// Least size of a displacement, as a share of half a backlash.
const LEAST: f64 = 1e-9;

/// Directions in which a whole train moves without any spring or contact: they do not return, and are no unknowns.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Drift {
    /// Displacements, orthogonal, `[n]` each.
    pub directions: Vec<Vec<f64>>,
    /// True if no damper acts along the direction, so that speeds along it are free as well.
    pub is_free: Vec<bool>,
}

/// Returns the part of displacements `y` along a drift, weighted by the mass.
fn drift_share(simulation: &Simulation, direction: &[f64], y: &[f64]) -> f64 {
    let mass = &simulation.structure.spec().mass;
    let weigh = |y: &[f64]| -> f64 {
        (0..y.len()).map(|i| direction[i] * (0..y.len()).map(|j| mass[(i, j)] * y[j]).sum::<f64>()).sum()
    };
    weigh(y) / weigh(direction)
}

impl Drift {
    /// Returns whether a constant load pushes along an undamped drift.
    pub(super) fn accelerates(&self, simulation: &Simulation) -> bool {
        let load = &simulation.structure.spec().load;
        self.directions.iter().zip(&self.is_free).filter(|(_, is_free)| **is_free).any(|(direction, _)| {
            let terms = direction.iter().zip(load).map(|(d, f)| d * f);
            terms.clone().sum::<f64>().abs() > BALANCED * terms.map(f64::abs).sum::<f64>()
        })
    }

    /// Moves `section` along the drift to the place of `start`.
    pub(super) fn take_back(&self, simulation: &Simulation, section: &mut Section, start: &Section) {
        let n = simulation.structure.freedoms();
        for direction in &self.directions {
            let off: Vec<f64> = section.x[..n].iter().zip(&start.x).map(|(x, s)| x - s).collect();
            let share = drift_share(simulation, direction, &off);
            section.x[..n].iter_mut().zip(direction).for_each(|(x, d)| *x -= share * d);
        }
    }
}

/// Returns the distance of two sections, in scales, without drift and latched speeds.
pub(crate) fn distance(
    map: &SectionMap<'_>,
    a: &impl AsRef<[f64]>,
    b: &impl AsRef<[f64]>,
    scales: &[f64],
    drift: &Drift,
) -> f64 {
    let n = map.simulation().structure.freedoms();
    let off = a.as_ref().iter().zip(b.as_ref()).map(|(a, b)| b - a);
    if drift.directions.is_empty() {
        return off.zip(&scales[..2 * n]).map(|(off, scale)| (off / scale).powi(2)).sum::<f64>().sqrt();
    }
    let mut off: Vec<f64> = off.collect();
    for (direction, is_free) in drift.directions.iter().zip(&drift.is_free) {
        for part in off[..2 * n].chunks_exact_mut(n).take(1 + usize::from(*is_free)) {
            let share = drift_share(map.simulation(), direction, part);
            part.iter_mut().zip(direction).for_each(|(off, d)| *off -= share * d);
        }
    }
    off[..2 * n].iter().zip(scales).map(|(off, scale)| (off / scale).powi(2)).sum::<f64>().sqrt()
}

impl SectionMap<'_> {
    /// Returns the drift of the train: null vectors of K that strain no contact.
    #[must_use]
    pub fn drift(&self) -> Drift {
        let spec = self.simulation().structure.spec();
        let n = spec.freedoms.len();
        let weight: Vec<f64> = (0..n).map(|i| spec.mass[(i, i)].sqrt()).collect();
        let stiffest = spec
            .contacts
            .iter()
            .flat_map(ContactSpec::schedules)
            .map(Stiffness::maximum)
            .fold(spec.stiffness.amax(), f64::max)
            .max(1e-300);
        let contacts = spec.contacts.len();
        let stacked = DMatrix::from_fn(n + contacts, n, |i, j| {
            let entry =
                if i < n { spec.stiffness[(i, j)] / stiffest / weight[i] } else { spec.contacts[i - n].direction[j] };
            entry / weight[j]
        });
        let svd = stacked.svd(false, true);
        let Some(v) = svd.v_t else { return Drift::default() };
        let largest = svd.singular_values.max();
        let mut drift = Drift::default();
        for (i, value) in svd.singular_values.iter().enumerate() {
            if *value <= UNFELT * largest {
                let direction: Vec<f64> = v.row(i).iter().zip(&weight).map(|(c, w)| c / w).collect();
                let damped = &spec.damping * DVector::from_column_slice(&direction);
                drift.is_free.push(damped.amax() <= UNFELT * spec.damping.amax());
                drift.directions.push(direction);
            }
        }
        drift
    }

    /// Returns the scales of the components from their `sizes`, `[dim]`: one each of displacements, of velocities, of each latched speed.
    pub(crate) fn scales(&self, sizes: &[f64]) -> Vec<f64> {
        let n = self.simulation().structure.freedoms();
        let backlash = self.simulation().structure.spec().contacts.iter().map(|c| c.half_backlash).fold(0.0, f64::max);
        let omega = self.simulation().clock().omega();
        let largest = |sizes: &[f64]| sizes.iter().fold(0.0, |m: f64, s| m.max(*s));
        // Displacements or velocities may be zero at sections: each size is at least the other one converted by the frequency.
        let (q, v) = (largest(&sizes[..n]).max(LEAST * backlash), largest(&sizes[n..2 * n]));
        let q = q.max(v / omega).max(f64::MIN_POSITIVE);
        let v = v.max(omega * q);
        let latched = sizes[2 * n..].iter().map(|size| size.max(f64::MIN_POSITIVE));
        std::iter::repeat_n(q, n).chain(std::iter::repeat_n(v, n)).chain(latched).collect()
    }

    /// Returns the scales from the states of some sections.
    pub(crate) fn scales_of(&self, sections: &[impl AsRef<[f64]>]) -> Vec<f64> {
        let dim = sections.first().map_or(0, |section| section.as_ref().len());
        let size = |i: usize| sections.iter().map(|section| section.as_ref()[i].abs()).fold(0.0, f64::max);
        self.scales(&(0..dim).map(size).collect::<Vec<_>>())
    }
}

/// Unknowns `y = Bᵀ S⁻¹ x`: S the scales, B an orthonormal basis of the components that neither drift nor stay constant.
#[derive(Clone, Debug)]
pub(crate) struct Unknowns {
    /// Scales S, `[dim]`.
    pub scales: Vec<f64>,
    /// Basis B, `[dim, unknowns]`.
    basis: DMatrix<f64>,
}

impl Unknowns {
    /// Returns the unknowns of a motion with a known `image`.
    pub fn new(map: &SectionMap<'_>, image: &Image, drift: &Drift) -> Self {
        let scales = map.scales(&image.sizes);
        let (n, dim) = (map.simulation().structure.freedoms(), scales.len());
        let mut out: Vec<DVector<f64>> = Vec::new();
        for (direction, is_free) in drift.directions.iter().zip(&drift.is_free) {
            for first in if *is_free { vec![0, n] } else { vec![0] } {
                let mut column = DVector::zeros(dim);
                (0..n).for_each(|i| column[first + i] = direction[i] / scales[first + i]);
                out.push(column);
            }
        }
        for (i, _) in image.latched.iter().enumerate().filter(|(_, latched)| !**latched) {
            out.push(DVector::from_fn(dim, |k, _| if k == 2 * n + i { 1.0 } else { 0.0 }));
        }
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let left_out = out.len();
        for column in out.into_iter().chain((0..dim).map(|i| DVector::from_fn(dim, |k, _| f64::from(u8::from(k == i)))))
        {
            // Normalised, however large the scales are.
            let mut left = column.normalize();
            for _ in 0..2 {
                basis.iter().for_each(|b| left -= b * b.dot(&left));
            }
            let norm = left.norm();
            if basis.len() < dim && norm > 1e-6 {
                basis.push(left / norm);
            }
        }
        let kept = &basis[left_out.min(basis.len())..];
        Self { basis: DMatrix::from_fn(dim, kept.len(), |i, l| kept[l][i]), scales }
    }

    /// Returns the number of unknowns.
    pub fn count(&self) -> usize {
        self.basis.ncols()
    }

    /// Returns `to − from` of two states, in unknowns.
    pub fn between(&self, from: &[f64], to: &[f64]) -> DVector<f64> {
        self.basis.transpose() * DVector::from_fn(self.scales.len(), |i, _| (to[i] - from[i]) / self.scales[i])
    }

    /// Returns a derivative of states, `[dim, count]`, in unknowns.
    pub fn columns(&self, derivative: &DMatrix<f64>) -> DMatrix<f64> {
        self.basis.transpose()
            * DMatrix::from_fn(derivative.nrows(), derivative.ncols(), |i, l| derivative[(i, l)] / self.scales[i])
    }

    /// Returns a derivative of states by states, `[dim, dim]`, in unknowns.
    pub fn reduced(&self, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        self.columns(&DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, j| jacobian[(i, j)] * self.scales[j]))
            * &self.basis
    }

    /// Returns the change of the state from one of the unknowns: `S B y`.
    pub fn lifted(&self, y: &DVector<f64>) -> DVector<f64> {
        let mut x = &self.basis * y;
        x.iter_mut().zip(&self.scales).for_each(|(x, scale)| *x *= scale);
        x
    }

    /// Returns a row over states from one over unknowns: `S⁻¹ B r`.
    pub fn row(&self, row: &DVector<f64>) -> DVector<f64> {
        let mut over = &self.basis * row;
        over.iter_mut().zip(&self.scales).for_each(|(r, scale)| *r /= scale);
        over
    }

    /// Returns a row over unknowns from one over states: `Bᵀ S r`.
    pub fn row_of(&self, row: &DVector<f64>) -> DVector<f64> {
        self.basis.transpose() * DVector::from_fn(self.scales.len(), |i, _| row[i] * self.scales[i])
    }
}
