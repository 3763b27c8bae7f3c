//! Lyapunov exponents: how fast neighbouring motions part, by the tangent and its factors.
//!
//! Columns of the tangent are made orthonormal again and again, `W X = Q R`, W the scales of the components; the exponents are the means
//! of `ln R_ii` over time (Benettin et al. 1980, with jumps Müller 1995). Their sum is the mean rate of volumes, which is known by itself:
//! the divergence of the field along arcs, and `ln |det|` of the jumps.

use std::ops::ControlFlow;

use serde::Serialize;

use super::{Drift, SectionMap, Tangent};
use crate::{
    engine::{Jumped, Observer, Outcome, State},
    hybrid::Mode,
    integrate::DenseStep,
    simulation::{Simulation, SimulationError},
    system::Columns,
    task::{Progress, Task},
};

/// Cycles dropped at least.
const DROPPED: u64 = 1000;
/// Cycles averaged at most, unless their number is given.
const MOST: u64 = 1_000_000;
/// Band of the largest exponent that is good enough, as a share of the largest in size.
const BAND: f64 = 1e-3;
/// Blocks that a band is estimated from.
const BLOCKS: usize = 40;
/// Correlation of neighbouring blocks above which a band is doubled.
const CORRELATED: f64 = 0.2;
/// Rates times time after which columns are made orthonormal at the latest: they have then turned to each other by a factor of 1e3.
const TURNED: f64 = 7.0;
/// A column this much smaller than the largest, after contacts have come to rest, is rounding: the derivative has lost a rank.
const LOST: f64 = 1e-11;

/// What is asked for.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lyapunov {
    /// Cycles averaged; without it, until the band of the largest exponent is small.
    pub cycles: Option<u64>,
    /// The exponents of resets alone too, to show what leaving saltation out does.
    pub without_saltation: bool,
    /// Finite-time exponents over this many cycles from the start, too.
    pub finite: Option<u64>,
}

/// Exponents, and what they are worth. `null` is −∞.
#[derive(Clone, Debug, Serialize)]
pub struct Exponents {
    /// Largest first, one for each displacement and velocity that does not drift; then `null`, one for each rank that rest takes and for
    /// each latched speed.
    pub exponents: Vec<Option<f64>>,
    /// One standard error each.
    pub band: Vec<Option<f64>>,
    /// Their sum, of those that are finite.
    pub sum: f64,
    /// The value that the sum must have; `null` where contacts rest or latch speeds.
    pub sum_rule: Option<f64>,
    /// Cycles averaged.
    pub cycles: u64,
    /// Cycles dropped before.
    pub dropped: u64,
    /// `1/s`, or `1/time` where the scene has no units.
    pub unit: &'static str,
    /// Directions of drift left out, each with exponent 0.
    pub drift: usize,
    /// Why it stopped before the band was small enough, if so.
    pub reason: Option<String>,
    /// What only the derivative of each reset gives, without the change of event times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_saltation: Option<WithoutSaltation>,
    /// Finite-time exponents of the first cycles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub finite: Option<Finite>,
    /// How the means of the exponents went on: cycles averaged, mean and band of each.
    #[serde(skip)]
    pub course: Vec<(u64, Vec<f64>, Vec<f64>)>,
}

/// What one gets without saltation.
#[derive(Clone, Debug, Serialize)]
pub struct WithoutSaltation {
    /// Which way of leaving it out.
    pub way: &'static str,
    /// As [`Exponents::exponents`].
    pub exponents: Vec<Option<f64>>,
}

/// Exponents of a number of cycles from the start, the columns starting as the unit matrix.
#[derive(Clone, Debug, Serialize)]
pub struct Finite {
    /// How many cycles.
    pub cycles: u64,
    /// In the order of the columns.
    pub exponents: Vec<Option<f64>>,
}

/// A tangent whose columns are kept orthonormal.
pub(super) struct Frame<'s> {
    tangent: Tangent<'s>,
    drift: &'s Drift,
    /// Momenta of the drift, `M ρ`, and `ρᵀMρ`.
    momenta: Vec<(Vec<f64>, f64)>,
    n: usize,
    /// Scale of velocities.
    scale: f64,
    /// `Σ ln R_ii` since they were taken.
    logs: Vec<f64>,
    /// Columns whose rank has been lost since they were looked at.
    lost: Vec<bool>,
    /// Columns that are zero now, as contacts rest.
    zero: Vec<bool>,
    turned: f64,
    /// The mode, while contacts rest in it.
    resting: Option<Mode>,
}

impl<'s> Frame<'s> {
    fn new(simulation: &'s Simulation, drift: &'s Drift, scale: f64) -> Self {
        let structure = &simulation.structure;
        let n = structure.freedoms();
        let left_out: usize = drift.is_free.iter().map(|free| 1 + usize::from(*free)).sum();
        let count = 2 * n - left_out;
        let dim = 2 * n + structure.contacts().iter().filter(|c| c.latch().is_some()).count();
        // Unit columns; those most along a drift are left out, and what is left of it in the others goes with the first factors.
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

    /// One column, for the largest exponent.
    pub(super) fn single(simulation: &'s Simulation, drift: &'s Drift, scale: f64) -> Self {
        let structure = &simulation.structure;
        let n = structure.freedoms();
        let latches = structure.contacts().iter().filter(|c| c.latch().is_some()).count();
        // Along no symmetry of a train.
        let values = (0..2 * n).map(|i| (1.0 + (i as f64 + 2.0).sqrt().fract()) * if i < n { 1.0 } else { scale });
        let values = values.chain(std::iter::repeat_n(0.0, latches)).collect();
        Self::of(simulation, drift, scale, Columns { count: 1, values })
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
            logs: vec![0.0; count],
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
    pub(super) fn start(&mut self, state: &State) {
        self.tangent.start(state);
        self.rest(&state.jump.mode);
        self.orthonormalise();
        self.logs.fill(0.0);
    }

    /// Keeps in mind what contacts at rest in `mode` allow.
    fn rest(&mut self, mode: &Mode) {
        self.resting = self.tangent.rests.then(|| mode.clone());
    }

    /// Takes the averages to begin here: nothing that rested or latched before has a part in them.
    fn begin(&mut self) {
        self.lost.clone_from(&self.zero);
        let first = 2 * self.n * self.tangent.columns.count;
        self.tangent.columns.values[first..].fill(0.0);
    }

    /// Takes the factors out of the columns. Those without a length of their own, as contacts at rest have taken their rank, become zero.
    fn orthonormalise(&mut self) {
        // Rounding along what contacts at rest do not allow does not decay as the columns do.
        if let Some(mode) = &self.resting {
            self.tangent.restrain(mode);
        }
        let Self { tangent, drift, momenta, n, scale, logs, lost, zero, .. } = self;
        let (n, m) = (*n, tangent.columns.count);
        let values = &mut tangent.columns.values;
        for ((momentum, weight), (direction, is_free)) in
            momenta.iter().zip(drift.directions.iter().zip(&drift.is_free))
        {
            for first in if *is_free { vec![0, n] } else { vec![0] } {
                for l in 0..m {
                    let share: f64 = (0..n).map(|i| momentum[i] * values[(first + i) * m + l]).sum::<f64>() / *weight;
                    (0..n).for_each(|i| values[(first + i) * m + l] -= share * direction[i]);
                }
            }
        }
        // Latched speeds have no length: they follow from displacements and velocities, and go with them. One vector after the other,
        // velocities in units of the scale.
        let rows = values.len() / m;
        let unit = |i: usize| if i < n || i >= 2 * n { 1.0 } else { *scale };
        let mut vectors: Vec<Vec<f64>> =
            (0..m).map(|l| (0..rows).map(|i| values[i * m + l] / unit(i)).collect()).collect();
        let norm = |vector: &[f64]| vector[..2 * n].iter().map(|c| c * c).sum::<f64>().sqrt();
        let mut largest = 0.0f64;
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

    /// Contacts let go: columns that were zero have a direction again, any one, at right angles to the others.
    fn seed(&mut self) {
        let (n, m) = (self.n, self.tangent.columns.count);
        for l in (0..m).filter(|l| self.zero[*l]).collect::<Vec<_>>() {
            let weight = |i: usize| if i < n { 1.0 } else { self.scale };
            // Of all units the one that the others have least of.
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

    /// Whether a part of the motion could not be resolved.
    pub(super) fn is_unresolved(&self) -> bool {
        self.tangent.is_unresolved
    }

    /// The logarithms since the last time.
    pub(super) fn take(&mut self) -> Vec<f64> {
        self.orthonormalise();
        let count = self.logs.len();
        std::mem::replace(&mut self.logs, vec![0.0; count])
    }
}

impl Observer for Frame<'_> {
    fn wants_steps(&self, mode: &Mode) -> bool {
        self.tangent.wants_steps(mode)
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

    fn jump(&mut self, jumped: &Jumped<'_>) {
        // What the columns have turned by so far is not to be mixed with what an impact does. Soft contacts change them little.
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

/// Means of the columns of `rows`, and their standard errors from blocks.
pub(super) fn means(rows: &[Vec<f64>], period: f64) -> (Vec<f64>, Vec<f64>) {
    let count = rows.first().map_or(0, Vec::len);
    let mean = |rows: &[Vec<f64>], l: usize| rows.iter().map(|row| row[l]).sum::<f64>() / (rows.len() as f64 * period);
    let band = |l: usize| {
        let length = rows.len() / BLOCKS;
        if length == 0 {
            return f64::NAN;
        }
        // The last blocks: what does not fill one is left out at the front.
        let blocks: Vec<f64> = rows[rows.len() - BLOCKS * length..].chunks_exact(length).map(|b| mean(b, l)).collect();
        let middle = blocks.iter().sum::<f64>() / BLOCKS as f64;
        let off: Vec<f64> = blocks.iter().map(|b| b - middle).collect();
        let squares: f64 = off.iter().map(|o| o * o).sum();
        let neighbours: f64 = off.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let error = (squares / (BLOCKS * (BLOCKS - 1)) as f64).sqrt();
        let error = if squares > 0.0 && neighbours / squares > CORRELATED { 2.0 * error } else { error };
        // What turns regularly averages out over blocks of a fitting length. The range over which the sum strays from its mean shows it.
        let (mean, mut sum, mut low, mut high) = (mean(rows, l) * period, 0.0, 0.0f64, 0.0f64);
        for row in rows {
            sum += row[l] - mean;
            (low, high) = (low.min(sum), high.max(sum));
        }
        error.max(0.5 * (high - low) / (rows.len() as f64 * period))
    };
    ((0..count).map(|l| mean(rows, l)).collect(), (0..count).map(band).collect())
}

impl Lyapunov {
    /// The exponents of the motion that the scene runs to.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails, or for a train without a forcing period.
    pub fn run(&self, simulation: &Simulation, task: Task<'_>) -> Result<Exponents, SimulationError> {
        let map = SectionMap::new(simulation)?;
        let (drift, period) = (map.drift(), simulation.period()?);
        let scale = if simulation.dimensionless { 1.0 } else { simulation.clock().omega() };
        let finite = self.finite.map(|cycles| self.finite_time(&map, &drift, cycles, period)).transpose()?;
        let run = &simulation.settings;
        let [from, _, end] = simulation.instants();
        let least = self.cycles.unwrap_or_else(|| (end.cycle - from.cycle).max(1) as u64);
        let most = self.cycles.unwrap_or(MOST.max(least));
        let dropped = DROPPED.max(run.transient_cycles);
        let start = map.state(&map.start()?)?;
        let framed = || {
            let mut frame = Frame::new(simulation, &drift, scale);
            frame.start(&start);
            frame
        };
        let mut frame = framed();
        let mut bare = self.without_saltation.then(|| {
            let mut bare = framed();
            bare.tangent.without_saltation();
            bare
        });
        let mut engine = simulation.engine(start.clone())?;
        let (mut rows, mut bare_rows, mut course) = (Vec::new(), Vec::new(), Vec::new());
        let (mut volume, mut reason, mut next_look, mut next_point) = (0.0, None, least, 2 * BLOCKS as u64);
        let clock = simulation.clock();
        let first = engine.state().at.cycle;
        for cycle in 1..=dropped + most {
            let outcome = engine.run(clock.at(first + cycle as i64, 0.0), &mut (&mut frame, &mut bare))?;
            let (logs, bare_logs) = (frame.take(), bare.as_mut().map(Frame::take));
            if cycle == dropped {
                frame.begin();
                bare.iter_mut().for_each(Frame::begin);
            }
            if cycle > dropped {
                rows.push(logs);
                bare_rows.extend(bare_logs);
                volume += frame.tangent.volume;
            }
            frame.tangent.volume = 0.0;
            if frame.tangent.is_unresolved {
                return Err(simulation.missing("the derivative along a step of its motion cannot be resolved"));
            }
            if outcome != Outcome::ReachedEnd || task.is_cancelled() {
                reason =
                    Some(if task.is_cancelled() { "interrupted" } else { "the limit on events is reached" }.to_owned());
                break;
            }
            let averaged = rows.len() as u64;
            if cycle % 64 == 0 {
                task.report(Progress::Share(cycle as f64 / (dropped + most) as f64));
            }
            if cycle <= dropped || averaged < next_look.min(next_point) {
                continue;
            }
            let (mean, band) = means(&rows, period);
            let largest =
                mean.iter().zip(&frame.lost).filter(|(_, lost)| !**lost).fold(0.0, |m: f64, (e, _)| m.max(e.abs()));
            // The band of the largest that is finite; none is, where rest takes all.
            let first = (0..mean.len()).filter(|l| !frame.lost[*l]).max_by(|a, b| mean[*a].total_cmp(&mean[*b]));
            let is_good = first.is_none_or(|l| band[l] <= BAND * largest);
            course.push((averaged, mean, band));
            next_point = averaged + averaged / 8 + 1;
            if averaged < next_look {
                continue;
            }
            if self.cycles.is_none() && is_good {
                break;
            }
            next_look = (averaged + averaged / 8 + 1).min(most);
            if averaged == most && !is_good && self.cycles.is_none() {
                reason = Some(format!("stopped after {most} cycles, before the band was below {BAND} of the largest"));
            }
        }
        let (mean, band) = means(&rows, period);
        let latches = engine.state().x.len() - 2 * simulation.structure.freedoms();
        let null = |values: &[f64], lost: &[bool]| -> Vec<Option<f64>> {
            let mut order: Vec<usize> = (0..values.len()).filter(|l| !lost[*l]).collect();
            order.sort_by(|a, b| mean[*b].total_cmp(&mean[*a]));
            let known = order.iter().map(|l| Some(values[*l]).filter(|v| v.is_finite()));
            known.chain(std::iter::repeat_n(None, values.len() - order.len() + latches)).collect()
        };
        let sum_rule = volume / (rows.len() as f64 * period);
        let bare = bare.map(|bare| {
            let (mut values, _) = means(&bare_rows, period);
            values.retain(|v| v.is_finite());
            values.sort_by(|a, b| b.total_cmp(a));
            WithoutSaltation {
                way: "the derivative of each reset alone, without the change of event times",
                exponents: values
                    .into_iter()
                    .map(Some)
                    .chain(std::iter::repeat_n(None, bare.lost.iter().filter(|l| **l).count() + latches))
                    .collect(),
            }
        });
        let exponents = null(&mean, &frame.lost);
        Ok(Exponents {
            sum: exponents.iter().flatten().sum(),
            band: null(&band, &frame.lost),
            exponents,
            sum_rule: (sum_rule.is_finite() && latches == 0).then_some(sum_rule),
            cycles: rows.len() as u64,
            dropped,
            unit: if simulation.dimensionless { "1/time" } else { "1/s" },
            drift: drift.is_free.iter().map(|free| 1 + usize::from(*free)).sum(),
            reason,
            without_saltation: bare,
            finite,
            course,
        })
    }

    fn finite_time(
        &self,
        map: &SectionMap<'_>,
        drift: &Drift,
        cycles: u64,
        period: f64,
    ) -> Result<Finite, SimulationError> {
        let simulation = map.simulation();
        let start = map.state(&map.start()?)?;
        let mut frame = Frame::new(simulation, drift, 1.0);
        frame.start(&start);
        let mut engine = simulation.engine(start)?;
        let first = engine.state().at.cycle;
        let outcome = engine.run(simulation.clock().at(first + cycles as i64, 0.0), &mut frame)?;
        if outcome != Outcome::ReachedEnd {
            return Err(simulation.missing("its run stops before the cycles asked for; raise its limit on events"));
        }
        let logs = frame.take();
        let exponent = |(log, lost): (&f64, &bool)| (!lost).then_some(log / (cycles as f64 * period));
        Ok(Finite { cycles, exponents: logs.iter().zip(&frame.lost).map(exponent).collect() })
    }
}
