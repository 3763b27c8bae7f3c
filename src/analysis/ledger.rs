//! Energy ledger: sources and sinks of all energy.

use std::ops::ControlFlow;

use serde::Serialize;

use super::{
    piece::{Piece, measured_parts},
    sum::Sum,
};
use crate::{
    engine::Observer,
    event::EventRecord,
    hybrid::{Clock, HybridSystem, Instant, Mode, Power, PowerBalance},
    integrate::DenseStep,
};

/// Integrated powers, in the order of their columns.
const POWERS: [Power; 5] = [Power::Load, Power::Error, Power::Parametric, Power::Damping, Power::Contacts];

/// Integrates the powers along the flow, adds the jumps at events, and compares with the energy.
///
/// ```text
/// E(t₁) − E(t₀) = load + error + parametric − damping − contact − release − impact + projection + residual
/// ```
#[derive(Clone, Debug)]
pub struct Ledger<'s, S: ?Sized> {
    system: &'s S,
    clock: Clock,
    /// Start of the measured time; the start of the run if `None`.
    from: Option<Instant>,
    piece: Piece,
    x: Vec<f64>,
    /// Largest displacement of each degree of freedom at the ends of steps, m.
    reach: Vec<f64>,
    start: Option<f64>,
    /// Number of steps of the measured time.
    steps: u64,
    end: f64,
    largest: f64,
    totals: Totals,
}

#[derive(Clone, Copy, Debug, Default)]
struct Totals {
    load: Sum,
    error: Sum,
    parametric: Sum,
    damping: Sum,
    contact: Sum,
    switches: Sum,
    release: Sum,
    impact: Sum,
    impact_error: Sum,
    projection: Sum,
    flows: Sum,
}

/// Share of the largest column that the residual must not reach, whatever the bound of rounding.
const IMBALANCE: f64 = 0.005;

/// Columns of the ledger, J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Balance {
    /// Energy where the ledger begins: at the start of the measured time.
    pub start: f64,
    /// Energy at the end.
    pub end: f64,
    /// Work of the loads.
    pub load: f64,
    /// Work of the transmission errors (moving flanks), impacts included.
    pub error: f64,
    /// Work of the varying stiffnesses, switches included.
    pub parametric: f64,
    /// Part of `parametric` done at stiffness switches.
    pub switches: f64,
    /// Energy lost in the structure's dampers.
    pub damping: f64,
    /// Energy lost in contacts while they carry force.
    pub contact: f64,
    /// Stored energy dropped where contacts separate while still deflected.
    pub release: f64,
    /// Energy lost in rigid impacts.
    pub impact: f64,
    /// Change by moving states onto guards: rounding.
    pub projection: f64,
    /// Residual of the balance, which the other columns do not explain.
    pub residual: f64,
    /// All energy that flowed in or out, by absolute value, plus the largest energy stored.
    pub throughput: f64,
}

impl Balance {
    /// Returns `|residual| / throughput`: rounding, if the ledger closes.
    #[must_use]
    pub fn closure(&self) -> f64 {
        if self.throughput > 0.0 { self.residual.abs() / self.throughput } else { self.residual.abs() }
    }

    /// Returns the largest [`closure`](Self::closure) that rounding explains after `steps` Taylor steps, `(64 + 8 n) ε`. A step rounds the
    /// state by 4 ε of its size at most, an energy by twice that, and the sums of a step's powers by some 64 ε in all. A step with
    /// truncation also omits the share `left_out` of the energy.
    #[must_use]
    pub fn rounding(steps: u64, left_out: f64) -> f64 {
        // Exact: a run has fewer than 2⁵³ steps.
        (64.0 + 8.0 * steps as f64) * f64::EPSILON + left_out * steps as f64
    }

    /// Returns the largest residual without contradiction, J: the rounding of the throughput and of `energy`
    /// ([`Structure::rounded_energy`](crate::system::Structure::rounded_energy)), at most half a percent of the largest column. The latter
    /// applies if it is above the rounding of the throughput and of `held`
    /// ([`Structure::held_energy`](crate::system::Structure::held_energy)).
    #[must_use]
    pub fn limit(&self, [energy, held]: [f64; 2], steps: u64, left_out: f64) -> f64 {
        let (rounding, largest) = (Self::rounding(steps, left_out), self.largest_column());
        let counts = largest > rounding * (self.throughput + held);
        (rounding * (self.throughput + energy)).min(if counts { IMBALANCE * largest } else { f64::INFINITY })
    }

    /// Returns the largest of the energies at start and end and of the sums of work and loss, J.
    fn largest_column(&self) -> f64 {
        let Self { start, end, load, error, parametric, damping, contact, release, impact, .. } = *self;
        [start, end, load, error, parametric, damping, contact, release, impact].iter().fold(0.0, |m, e| m.max(e.abs()))
    }
}

impl<'s, S: HybridSystem + PowerBalance + ?Sized> Ledger<'s, S> {
    /// Returns an empty ledger.
    #[must_use]
    pub fn new(system: &'s S) -> Self {
        Self {
            system,
            clock: *system.clock(),
            from: None,
            piece: Piece::new(*system.clock(), system.dim()),
            x: vec![0.0; system.dim()],
            reach: vec![0.0; system.dim()],
            start: None,
            steps: 0,
            end: 0.0,
            largest: 0.0,
            totals: Totals::default(),
        }
    }

    /// Begins at `from`, so that a transient is left out.
    #[must_use]
    pub fn since(mut self, from: Instant) -> Self {
        self.from = Some(from);
        self
    }

    /// Returns the largest size of each component of the state at the ends of steps, `[dim]`.
    #[must_use]
    pub fn reach(&self) -> &[f64] {
        &self.reach
    }

    /// Returns the number of steps of the measured time.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Returns the columns so far.
    #[must_use]
    pub fn balance(&self) -> Balance {
        let t = &self.totals;
        let start = self.start.unwrap_or(0.0);
        let mut residual = Sum::default();
        residual.add(self.end);
        residual.add(-start);
        for (sign, column) in [
            (-1.0, &t.load),
            (-1.0, &t.error),
            (-1.0, &t.impact_error),
            (-1.0, &t.parametric),
            (-1.0, &t.switches),
            (1.0, &t.damping),
            (1.0, &t.contact),
            (1.0, &t.release),
            (1.0, &t.impact),
            (-1.0, &t.projection),
        ] {
            residual.add(sign * column.value());
        }
        Balance {
            start,
            end: self.end,
            load: t.load.value(),
            error: t.error.value() + t.impact_error.value(),
            parametric: t.parametric.value() + t.switches.value(),
            switches: t.switches.value(),
            damping: t.damping.value(),
            contact: t.contact.value(),
            release: t.release.value(),
            impact: t.impact.value(),
            projection: t.projection.value(),
            residual: residual.value(),
            throughput: t.flows.value() + self.largest,
        }
    }

    fn arrive(&mut self, energy: f64) {
        self.end = energy;
        self.largest = self.largest.max(energy.abs());
    }
}

impl<S: HybridSystem + PowerBalance + ?Sized> Observer for Ledger<'_, S> {
    fn observed_from(&self) -> Instant {
        self.from.unwrap_or(Instant::FIRST)
    }

    fn step(&mut self, mode: &Mode, step: &dyn DenseStep, until: f64) -> ControlFlow<()> {
        let measured = measured_parts(&self.clock, self.from, step, until).find(|(.., is_measured)| *is_measured);
        let Some((low, ..)) = measured else { return ControlFlow::Continue(()) };
        if self.start.is_none() {
            step.state(low, &mut self.x);
            let at = self.clock.advance(step.start(), step.time(low));
            let energy = self.system.energy(mode, at, &self.x);
            self.start = Some(energy);
            self.largest = energy.abs();
        }
        self.steps += 1;
        self.piece.cut(step, low, until);
        let system = self.system;
        let work = self.piece.integrals(step, POWERS, |at, x| {
            let p = system.powers(mode, at, x);
            [p.load, p.error, p.parametric, p.damping, p.contact]
        });
        let t = &mut self.totals;
        let columns = [&mut t.load, &mut t.error, &mut t.parametric, &mut t.damping, &mut t.contact];
        for (column, w) in columns.into_iter().zip(work) {
            column.add(w);
            t.flows.add(w.abs());
        }
        step.state(until, &mut self.x);
        self.reach.iter_mut().zip(&self.x).for_each(|(reach, x)| *reach = reach.max(x.abs()));
        let at = self.clock.advance(step.start(), step.time(until));
        let energy = self.system.energy(mode, at, &self.x);
        self.arrive(energy);
        ControlFlow::Continue(())
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        // The record of a summed impact sequence has the time of its end, which is ahead of the state.
        let early = record.accumulation.map_or(0.0, |sum| sum.remaining);
        let is_before = |from| self.clock.between(from, record.at) < early;
        // An event is moved by rounding: once begun, the ledger takes all.
        if record.graze || self.start.is_none() && self.from.is_some_and(is_before) {
            return ControlFlow::Continue(());
        }
        if self.start.is_none() {
            self.start = Some(self.system.energy(&record.from, record.at, &record.x_minus));
        }
        let jump = self.system.energy_jump(&record.transition());
        let t = &mut self.totals;
        let columns = [&mut t.switches, &mut t.impact_error, &mut t.release, &mut t.impact, &mut t.projection];
        for (column, w) in
            columns.into_iter().zip([jump.parametric, jump.error, jump.release, jump.impact, jump.projection])
        {
            column.add(w);
            t.flows.add(w.abs());
        }
        self.arrive(self.system.energy(&record.to, record.at, &record.x_plus));
        ControlFlow::Continue(())
    }
}
