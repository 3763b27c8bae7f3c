//! Steady motion of a model, in the numbers by which models are compared.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::model::Model;
use crate::{
    analysis::{ContactReport, Contacts, Grid, Sample, Trajectory},
    engine::Engine,
    hybrid::ContactView,
    study::{
        StudyError,
        figures::{Context, family, firsts},
        steady::{Rule, Seed, go_on, settled},
    },
};

/// A mean and its standard error; that of a periodic motion is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Estimate {
    /// Mean.
    pub value: f64,
    /// Standard error: `s/√B` over B stretches of the motion.
    pub error: f64,
}

impl Estimate {
    /// Returns the standard deviation of the stretches behind it.
    pub(super) fn scatter(self) -> f64 {
        self.error * (STRETCHES as f64).sqrt()
    }

    fn of(values: &[f64]) -> Self {
        let count = values.len() as f64;
        let value = values.iter().sum::<f64>() / count;
        let spread = values.iter().map(|v| (v - value).powi(2)).sum::<f64>();
        let error = if values.len() > 1 { (spread / (count - 1.0) / count).sqrt() } else { 0.0 };
        Self { value, error }
    }
}

/// Measures of the contacts of one family.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mesh {
    /// The family, such as `ring-planet`.
    pub family: String,
    /// Time without force, forcing periods: mean of its contacts.
    pub apart: Estimate,
    /// Separations per forcing cycle and contact.
    pub separations: f64,
    /// Mean duration of a separation, s, if there are any.
    pub separation_s: Option<f64>,
    /// Largest force of any of its contacts, N; none for rigid contacts, whose impacts have none. Of an irregular motion the mean over its
    /// stretches.
    pub peak: Option<Estimate>,
    /// Mean force, N.
    pub mean_force: Estimate,
}

/// Work per forcing cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CycleWork {
    /// Dense steps.
    pub steps: f64,
    /// Events.
    pub events: f64,
}

/// Steady motion of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Number of degrees of freedom.
    pub freedoms: usize,
    /// Kind of the motion and the cycles to its decision.
    pub settled: crate::orbit::Motion,
    /// True if the run started from the motion of the full model.
    pub followed: bool,
    /// Cycles measured.
    pub cycles: u64,
    /// Contacts, by family.
    pub meshes: Vec<Mesh>,
    /// Work per cycle.
    pub work: CycleWork,
    /// Final state, at the start of a cycle.
    #[serde(skip)]
    pub end: Seed,
}

impl Motion {
    /// Returns `period 1` in forcing cycles, `irregular` or `settling`.
    #[must_use]
    pub fn kind(&self) -> String {
        match self.settled.period {
            Some(period) => format!("period {period}"),
            None if self.settling() => "settling".to_owned(),
            None => "irregular".to_owned(),
        }
    }

    /// Returns the measures of a family.
    #[must_use]
    pub fn mesh(&self, family: &str) -> Option<&Mesh> {
        self.meshes.iter().find(|mesh| mesh.family == family)
    }

    /// Returns whether it is irregular: it has no period, and its measures scatter from stretch to stretch. Without a period but with
    /// steady measures it is a transient longer than the run.
    #[must_use]
    pub fn irregular(&self) -> bool {
        let relative = |peak: Estimate| peak.scatter() > SCATTER * peak.value;
        let scatters = |mesh: &Mesh| mesh.apart.scatter() > SCATTER || mesh.peak.is_some_and(relative);
        self.settled.period.is_none() && self.meshes.iter().any(scatters)
    }

    /// Returns whether it is a transient longer than the run.
    #[must_use]
    pub fn settling(&self) -> bool {
        self.settled.period.is_none() && !self.irregular()
    }

    /// Returns the largest time without force of any family, forcing periods.
    #[must_use]
    pub fn apart(&self) -> Estimate {
        largest(self.meshes.iter().map(|mesh| mesh.apart)).unwrap_or_default()
    }

    /// Returns the largest force of any family, N.
    #[must_use]
    pub fn peak(&self) -> Option<Estimate> {
        largest(self.meshes.iter().filter_map(|mesh| mesh.peak))
    }
}

fn largest(values: impl Iterator<Item = Estimate>) -> Option<Estimate> {
    values.reduce(|a, b| if b.value > a.value { b } else { a })
}

/// Number of stretches of an irregular motion: the scatter of their means is that of the measure.
const STRETCHES: u64 = 10;
/// Scatter between stretches above which a motion is irregular: forcing periods of time apart, and relative in peak force.
const SCATTER: f64 = 1e-3;

/// Settles the motion of `model`, from `seed` or from the start of the scene, and measures it. With `moving`, the second moments of its
/// velocities are collected too.
pub(super) fn measure(
    context: &Context<'_>,
    model: &Model,
    seed: Option<&Seed>,
    mut moving: Option<&mut Moments>,
) -> Result<Motion, StudyError> {
    let simulation = &model.simulation;
    let (mut engine, found, followed) =
        settled(simulation, seed, &Rule { decides: false, ..context.rule }, context.task)?;
    let (stretches, cycles) = match found.period {
        Some(period) => (1, context.rule.measured_cycles.max(1).next_multiple_of(period)),
        None => (STRETCHES, context.rule.irregular_cycles.max(1).div_ceil(STRETCHES)),
    };
    let before = engine.counters();
    let mut reports = Vec::new();
    for _ in 0..stretches {
        reports.push(stretch(context, model, &mut engine, cycles, moving.as_deref_mut())?);
    }
    let after = engine.counters();
    let all = (stretches * cycles) as f64;
    let meshes = meshes(model, &reports);
    let structure = &simulation.structure;
    let motion = Motion {
        freedoms: structure.freedoms(),
        settled: found,
        followed,
        cycles: stretches * cycles,
        meshes,
        work: CycleWork {
            steps: (after.steps - before.steps) as f64 / all,
            events: (after.events - before.events) as f64 / all,
        },
        end: Seed::of(structure, engine.state()),
    };
    let finite = |mesh: &&Mesh| !(mesh.peak.map_or(0.0, |peak| peak.value) + mesh.mean_force.value).is_finite();
    match motion.meshes.iter().find(finite) {
        Some(mesh) => Err(StudyError::Overflow(format!("the force of {}", mesh.family))),
        None => Ok(motion),
    }
}

fn stretch(
    context: &Context<'_>,
    model: &Model,
    engine: &mut Engine<'_>,
    cycles: u64,
    mut moments: Option<&mut Moments>,
) -> Result<Vec<ContactReport>, StudyError> {
    let (structure, clock) = (&model.simulation.structure, model.simulation.clock());
    let n = structure.freedoms();
    let from = engine.state().at;
    let mut contacts = Contacts::new(structure, Some(from)).keep(0);
    let grid = Grid::Phases { per_cycle: if moments.is_some() { per_cycle(n) } else { 1 } };
    let mut samples = Trajectory::new(structure, grid, from, |sample: &Sample<'_>| {
        if let Some(moments) = &mut moments {
            moments.add(&sample.x[n..2 * n]);
        }
        context.task.flow()
    });
    go_on(engine, clock, cycles, &mut (&mut contacts, &mut samples), context.task)?;
    Ok((0..structure.contact_count()).map(|j| contacts.report(j)).collect())
}

/// Returns the samples per cycle for second moments: fewer for many degrees of freedom.
fn per_cycle(freedoms: usize) -> u32 {
    if freedoms <= 32 { 256 } else { 32 }
}

fn meshes(model: &Model, stretches: &[Vec<ContactReport>]) -> Vec<Mesh> {
    let structure = &model.simulation.structure;
    let period = structure.clock().period().map_or(f64::NAN, |period| period.value());
    let of = |j: usize| family(structure.contact_name(j));
    let mesh = |(_, family): (usize, String)| {
        let contacts: Vec<usize> = (0..structure.contact_count()).filter(|&j| of(j) == family).collect();
        let count = contacts.len() as f64;
        // Divisor > 0: a family has a contact.
        let mean = |of: &dyn Fn(&ContactReport) -> f64| {
            let each = stretches.iter().map(|reports| contacts.iter().map(|&j| of(&reports[j])).sum::<f64>() / count);
            Estimate::of(&each.collect::<Vec<_>>())
        };
        let peak =
            |reports: &Vec<ContactReport>| contacts.iter().map(|&j| reports[j].force_abs_max).fold(0.0, f64::max);
        let peaks: Vec<f64> = stretches.iter().map(peak).collect();
        let all = || stretches.iter().flat_map(|reports| contacts.iter().map(|&j| &reports[j]));
        let closed = all().map(|r| r.durations.count).sum::<u64>();
        let length: f64 = all().map(|r| r.durations.mean.unwrap_or(0.0) * r.durations.count as f64).sum();
        Mesh {
            family,
            apart: mean(&|r| r.no_force_fraction),
            separations: mean(&|r| r.separations as f64 * period / r.time).value,
            separation_s: (closed > 0).then(|| length / closed as f64),
            peak: contacts.iter().all(|&j| !structure.is_rigid(j)).then(|| Estimate::of(&peaks)),
            mean_force: mean(&|r| r.force_mean),
        }
    };
    firsts((0..structure.contact_count()).map(of)).into_iter().map(mesh).collect()
}

/// Second moments of the velocities of a motion.
pub(super) struct Moments {
    count: f64,
    sum: DVector<f64>,
    products: DMatrix<f64>,
}

impl Moments {
    pub fn new(freedoms: usize) -> Self {
        Self { count: 0.0, sum: DVector::zeros(freedoms), products: DMatrix::zeros(freedoms, freedoms) }
    }

    fn add(&mut self, v: &[f64]) {
        let v = DVector::from_column_slice(v);
        self.count += 1.0;
        self.products.ger(1.0, &v, &v, 1.0);
        self.sum += v;
    }

    /// Returns `⟨ṽ ṽᵀ⟩` with `ṽ = v − ⟨v⟩`, `[n × n]`.
    pub fn covariance(&self) -> DMatrix<f64> {
        let mean = &self.sum / self.count;
        &self.products / self.count - &mean * mean.transpose()
    }
}
