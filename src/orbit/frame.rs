//! Columns of the tangent that are kept orthonormal, and the logarithms of their factors.

use std::ops::ControlFlow;

use smallvec::{SmallVec, smallvec};

use super::{Drift, Tangent};
use crate::{
    engine::{JumpRecord, Observer, State},
    hybrid::{Columns, HybridSystem, Instant, LaneRecords, Mode},
    integrate::DenseStep,
    simulation::Simulation,
};

/// Ratio to the largest column below which a column is rounding after contacts have come to rest: the derivative has lost a rank.
const LOST: f64 = 1e-11;
/// Longest time between two orthonormalisations, times the rate: columns have then turned to each other by a factor of 1e3.
const TURNED: f64 = 7.0;
/// Size of a column below which its factor is taken out after a lane. Its inverse is the upper limit.
const SMALL: f64 = 1e-30;
/// Tangent whose columns are kept orthonormal.
pub(crate) struct Frame<'s> {
    pub(super) tangent: Tangent<'s>,
    drift: &'s Drift,
    /// Momenta of the drift, `M ρ`, and `ρᵀMρ`.
    momenta: Vec<(Vec<f64>, f64)>,
    n: usize,
    /// Scale of velocities.
    scale: f64,
    /// Sum `Σ ln R_ii` since the last call of `take`.
    logs: SmallVec<[f64; 4]>,
    /// Columns whose rank has been lost since the last call of `has_lost`.
    pub lost: Vec<bool>,
    /// Columns that are zero at present, as contacts rest.
    zero: Vec<bool>,
    turned: f64,
    /// Mode while contacts rest in it.
    resting: Option<Mode>,
}

/// Columns of a frame between two cycles, to resume from.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct FrameState {
    columns: Vec<f64>,
    lost: Vec<bool>,
    zero: Vec<bool>,
}

/// Returns the scale of velocities for a unit scale of displacements: the forcing's angular frequency, 1/s; 1 if dimensionless.
pub(crate) fn rate_scale(simulation: &Simulation) -> f64 {
    if simulation.dimensionless { 1.0 } else { simulation.clock().omega() }
}

/// Returns one column for the largest exponent, along no symmetry of a train.
fn column(simulation: &Simulation) -> Columns {
    let (structure, scale) = (&simulation.structure, rate_scale(simulation));
    let n = structure.freedoms();
    let latches = structure.dim() - 2 * n;
    let values = (0..2 * n).map(|i| (1.0 + (i as f64 + 2.0).sqrt().fract()) * if i < n { 1.0 } else { scale });
    Columns { count: 1, values: values.chain(std::iter::repeat_n(0.0, latches)).collect() }
}

impl<'s> Frame<'s> {
    pub(super) fn new(simulation: &'s Simulation, drift: &'s Drift, scale: f64) -> Self {
        let structure = &simulation.structure;
        let n = structure.freedoms();
        let left_out: usize = drift.is_free.iter().map(|free| 1 + usize::from(*free)).sum();
        let count = 2 * n - left_out;
        let dim = structure.dim();
        // Unit columns; those most along a drift are left out, and the first factors remove the remainder of it from the others.
        let mut values = vec![0.0; dim * count];
        let mut kept: Vec<usize> = (0..2 * n).collect();
        for (direction, is_free) in drift.directions.iter().zip(&drift.is_free) {
            let along =
                (0..n).filter(|i| kept.contains(i)).max_by(|a, b| direction[*a].abs().total_cmp(&direction[*b].abs()));
            if let Some(i) = along {
                kept.retain(|k| *k != i && !(*is_free && *k == n + i));
            }
        }
        kept.iter().enumerate().for_each(|(column, i)| values[i * count + column] = 1.0);
        Self::of(simulation, drift, scale, Columns { count, values })
    }

    /// Returns the frame of one column, for the largest exponent.
    pub fn single(simulation: &'s Simulation, drift: &'s Drift) -> Self {
        Self::of(simulation, drift, rate_scale(simulation), column(simulation))
    }

    fn of(simulation: &'s Simulation, drift: &'s Drift, scale: f64, columns: Columns) -> Self {
        let structure = &simulation.structure;
        let (n, count, spec) = (structure.freedoms(), columns.count, structure.spec());
        let momenta = drift.directions.iter().map(|direction| {
            let momentum: Vec<f64> = (0..n).map(|i| (0..n).map(|j| spec.mass[(i, j)] * direction[j]).sum()).collect();
            let weight = momentum.iter().zip(direction).map(|(m, d)| m * d).sum();
            (momentum, weight)
        });
        let mut frame = Self {
            tangent: Tangent::of(structure, columns),
            drift,
            momenta: momenta.collect(),
            n,
            scale,
            logs: smallvec![0.0; count],
            lost: vec![false; count],
            zero: vec![false; count],
            turned: 0.0,
            resting: None,
        };
        frame.orthonormalise();
        frame.logs.fill(0.0);
        frame
    }

    /// Starts at `state`, where contacts may rest.
    pub fn start(&mut self, state: &State) {
        self.tangent.start(state);
        self.rest(&state.jump.mode);
        self.orthonormalise();
        self.logs.fill(0.0);
    }

    /// Returns the columns from which the frame resumes, after its factors have been taken.
    pub(super) fn held(&self) -> FrameState {
        FrameState { columns: self.tangent.columns.values.clone(), lost: self.lost.clone(), zero: self.zero.clone() }
    }

    /// Resumes from kept columns.
    pub(super) fn hold(&mut self, held: &FrameState) {
        self.tangent.columns.values.clone_from(&held.columns);
        self.lost.clone_from(&held.lost);
        self.zero.clone_from(&held.zero);
    }

    /// Stores the mode if contacts rest in it.
    fn rest(&mut self, mode: &Mode) {
        self.resting = self.tangent.rests.then(|| mode.clone());
    }

    /// Returns whether a column has lost its rank since the last call.
    pub(super) fn has_lost(&mut self) -> bool {
        let lost = self.lost.contains(&true);
        self.lost.clone_from(&self.zero);
        lost
    }

    /// Begins the averages: earlier rests and latched speeds have no part in them.
    pub(super) fn begin(&mut self) {
        self.lost.clone_from(&self.zero);
        let first = 2 * self.n * self.tangent.columns.count;
        self.tangent.columns.values[first..].fill(0.0);
    }

    /// Takes the factors out of the columns. Columns whose rank contacts at rest have taken become zero.
    fn orthonormalise(&mut self) {
        // Rounding in directions that contacts at rest forbid does not decay as the columns do.
        if let Some(mode) = &self.resting {
            self.tangent.restrain(mode);
        }
        let Self { tangent, drift, momenta, n, scale, logs, lost, zero, .. } = self;
        let (n, m) = (*n, tangent.columns.count);
        let values = &mut tangent.columns.values;
        for ((momentum, weight), (direction, is_free)) in
            momenta.iter().zip(drift.directions.iter().zip(&drift.is_free))
        {
            for first in [0, n].into_iter().take(1 + usize::from(*is_free)) {
                for l in 0..m {
                    let share: f64 = (0..n).map(|i| momentum[i] * values[(first + i) * m + l]).sum::<f64>() / *weight;
                    (0..n).for_each(|i| values[(first + i) * m + l] -= share * direction[i]);
                }
            }
        }
        // Latched speeds have no length: they follow from displacements and velocities, and change with them. Vectors are treated one after
        // the other, velocities in units of the scale.
        let rows = values.len() / m;
        let unit = |i: usize| if i < n || i >= 2 * n { 1.0 } else { *scale };
        let mut vectors: SmallVec<[SmallVec<[f64; 4]>; 1]> =
            (0..m).map(|l| (0..rows).map(|i| values[i * m + l] / unit(i)).collect()).collect();
        let norm = |vector: &[f64]| vector[..2 * n].iter().map(|c| c * c).sum::<f64>().sqrt();
        // Columns had length one before contacts at rest shortened them.
        let mut largest = if tangent.rests || tangent.dies { 1.0f64 } else { 0.0 };
        for l in 0..m {
            if zero[l] {
                continue;
            }
            let (done, rest) = vectors.split_at_mut(l);
            let vector = &mut rest[0];
            largest = largest.max(norm(vector));
            let mut log = 0.0;
            for _ in 0..2 {
                for (other, _) in done.iter().zip(&*zero).filter(|(_, zero)| !**zero) {
                    let dot: f64 = other[..2 * n].iter().zip(&vector[..2 * n]).map(|(a, b)| a * b).sum();
                    vector.iter_mut().zip(other).for_each(|(v, o)| *v -= dot * o);
                }
                let size = norm(vector);
                if (tangent.rests || tangent.dies) && size <= LOST * largest || size == 0.0 {
                    (lost[l], zero[l]) = (true, true);
                    vector.fill(0.0);
                    break;
                }
                log += libm::log(size);
                vector.iter_mut().for_each(|v| *v /= size);
            }
            logs[l] += log;
        }
        for (l, vector) in vectors.iter().enumerate() {
            vector.iter().enumerate().for_each(|(i, v)| values[i * m + l] = v * unit(i));
        }
        self.turned = 0.0;
    }

    /// Restarts columns that were zero, as contacts are released: any directions at right angles to the others.
    fn seed(&mut self) {
        let (n, m) = (self.n, self.tangent.columns.count);
        for l in (0..m).filter(|l| self.zero[*l]).collect::<Vec<_>>() {
            let weight = |i: usize| if i < n { 1.0 } else { self.scale };
            // The unit vector with the least part in the others.
            let covered = |i: usize| {
                let row = self.tangent.columns.row(i);
                row.iter().map(|c| (c / weight(i)).powi(2)).sum::<f64>()
            };
            let best = (0..2 * n).min_by(|a, b| covered(*a).total_cmp(&covered(*b)));
            let Some(best) = best else { return };
            let scale = weight(best);
            self.tangent.columns.values[best * m + l] = scale;
            self.zero[l] = false;
            let logs = self.logs.clone();
            self.orthonormalise();
            self.logs = logs;
        }
    }

    fn turn(&mut self, mode: &Mode, time: f64) {
        self.turned += self.tangent.rate(mode) * time;
        if self.turned > TURNED {
            self.orthonormalise();
        }
    }

    /// Returns whether a part of the motion could not be resolved.
    pub fn is_unresolved(&self) -> bool {
        self.tangent.is_unresolved
    }

    /// Returns the logarithms since the last call.
    pub fn take(&mut self) -> SmallVec<[f64; 4]> {
        self.orthonormalise();
        let count = self.logs.len();
        std::mem::replace(&mut self.logs, smallvec![0.0; count])
    }
}

impl Observer for Frame<'_> {
    fn wants_steps(&self, mode: &Mode, until: Instant) -> bool {
        self.tangent.wants_steps(mode, until)
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        // Several columns turn to each other, and need their factors taken out on the way.
        if self.tangent.columns.count > 1 { None } else { self.tangent.records() }
    }

    fn skip(&mut self, _: Instant) -> ControlFlow<()> {
        let size = self.tangent.columns.values.iter().fold(0.0, |m: f64, value| m.max(value.abs()));
        if !(SMALL..=SMALL.recip()).contains(&size) {
            self.orthonormalise();
        }
        ControlFlow::Continue(())
    }

    fn leap(&mut self, mode: &Mode, time: f64) -> ControlFlow<()> {
        self.tangent.leap(mode, time)?;
        self.turn(mode, time);
        ControlFlow::Continue(())
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        self.tangent.step(mode, step, until)?;
        self.turn(mode, step.time(until));
        ControlFlow::Continue(())
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        // The turn of the columns so far must not mix with the effect of an impact. Soft contacts change them little.
        let is_impact = !jumped.to.struck.is_empty() || jumped.settles || self.tangent.rests;
        if is_impact {
            self.orthonormalise();
        }
        self.tangent.jump(jumped);
        self.tangent.forget(&jumped.to.mode);
        self.rest(&jumped.to.mode);
        if is_impact || self.tangent.rests {
            self.orthonormalise();
        }
        self.tangent.dies = false;
        if !self.tangent.rests && self.zero.contains(&true) {
            self.seed();
        }
    }
}
