//! Lyapunov exponents: how fast neighbouring motions part, by the tangent and its factors.
//!
//! Columns of the tangent are made orthonormal again and again, `W X = Q R`, W the scales of the components; the exponents are the means
//! of `ln R_ii` over time (Benettin et al. 1980, with jumps Müller 1995). Their sum is the mean rate of volumes, which is known by itself:
//! the divergence of the field along arcs, and `ln |det|` of the jumps.

use serde::Serialize;

use super::{
    Drift, SectionMap,
    frame::{Frame, rate_scale},
    words::{Sequence, Speller, Statistics},
};
use crate::{
    engine::Outcome,
    simulation::{Simulation, SimulationError},
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
/// Cycles whose words are read.
const SPELLED: u64 = 100_000;
/// Correlation of neighbouring blocks above which a band is doubled.
const CORRELATED: f64 = 0.2;

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
    /// What the words of the averaged cycles tell, of at most the first hundred thousand.
    pub words: Statistics,
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

/// Means of the columns of `rows`, and their standard errors from blocks.
pub(crate) fn means(rows: &[impl AsRef<[f64]>], period: f64) -> (Vec<f64>, Vec<f64>) {
    let count = rows.first().map_or(0, |row| row.as_ref().len());
    let columns: Vec<Vec<f64>> = (0..count).map(|l| rows.iter().map(|row| row.as_ref()[l]).collect()).collect();
    let mean = |column: &[f64]| column.iter().sum::<f64>() / (column.len() as f64 * period);
    let band = |column: &Vec<f64>| {
        let length = column.len() / BLOCKS;
        if length == 0 {
            return f64::NAN;
        }
        // The last blocks: what does not fill one is left out at the front.
        let blocks: Vec<f64> = column[column.len() - BLOCKS * length..].chunks_exact(length).map(mean).collect();
        let middle = blocks.iter().sum::<f64>() / BLOCKS as f64;
        let off: Vec<f64> = blocks.iter().map(|b| b - middle).collect();
        let squares: f64 = off.iter().map(|o| o * o).sum();
        let neighbours: f64 = off.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let error = (squares / (BLOCKS * (BLOCKS - 1)) as f64).sqrt();
        let error = if squares > 0.0 && neighbours / squares > CORRELATED { 2.0 * error } else { error };
        // What turns regularly averages out over blocks of a fitting length. The range over which the sum strays from its mean shows it.
        let (mean, mut sum, mut low, mut high) = (mean(column) * period, 0.0, 0.0f64, 0.0f64);
        for log in column {
            sum += log - mean;
            (low, high) = (low.min(sum), high.max(sum));
        }
        error.max(0.5 * (high - low) / (column.len() as f64 * period))
    };
    (columns.iter().map(|column| mean(column)).collect(), columns.iter().map(band).collect())
}

impl Lyapunov {
    /// The exponents of the motion that the scene runs to.
    ///
    /// # Errors
    /// [`SimulationError`] if the run fails, or for a train without a forcing period.
    pub fn run(&self, simulation: &Simulation, task: Task<'_>) -> Result<Exponents, SimulationError> {
        let map = SectionMap::new(simulation)?;
        let (drift, period) = (map.drift(), simulation.period()?);
        let finite = self.finite.map(|cycles| self.finite_time(&map, &drift, cycles, period)).transpose()?;
        let run = &simulation.settings;
        let [from, _, end] = simulation.instants();
        let least = self.cycles.unwrap_or_else(|| (end.cycle - from.cycle).max(1) as u64);
        let most = self.cycles.unwrap_or(MOST.max(least));
        let dropped = DROPPED.max(run.transient_cycles);
        let start = map.state(&map.start()?)?;
        let framed = || {
            let mut frame = Frame::new(simulation, &drift, rate_scale(simulation));
            frame.start(&start);
            frame
        };
        let mut frame = framed();
        let mut bare = self.without_saltation.then(|| {
            let mut bare = framed();
            bare.tangent.without_saltation();
            bare
        });
        let mut speller = Speller::new(&simulation.structure, &start.x);
        let mut sequence = Sequence::default();
        let mut engine = simulation.engine(start.clone())?;
        let (mut rows, mut bare_rows, mut course) = (Vec::new(), Vec::new(), Vec::new());
        let (mut volume, mut reason, mut next_look, mut next_point) = (0.0, None, least, 2 * BLOCKS as u64);
        let clock = simulation.clock();
        let first = engine.state().at.cycle;
        for cycle in 1..=dropped + most {
            let outcome = engine.run(
                clock.at(first + cycle as i64, 0.0),
                &mut ((&mut frame, &mut bare), (cycle <= dropped + SPELLED).then_some(&mut speller)),
            )?;
            let (logs, bare_logs) = (frame.take(), bare.as_mut().map(Frame::take));
            if cycle == dropped {
                frame.begin();
                bare.iter_mut().for_each(Frame::begin);
            }
            let word = speller.take();
            if cycle > dropped {
                if cycle <= dropped + SPELLED {
                    sequence.add(&word);
                }
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
            words: sequence.statistics(),
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
