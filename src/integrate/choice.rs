//! Choice of the integrator: forced, or made for each mode.

use std::{collections::BTreeMap, fmt, ops::ControlFlow};

use super::{Arc, DenseStep, IntegrateError, Integrator, Relay, Taylor};
#[cfg(feature = "diffsol")]
use super::{Diffsol, Method};
use crate::hybrid::{HybridSystem, Mode};

/// The requested integrator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// Chosen for each mode; see [`build`].
    #[default]
    Auto,
    /// Taylor series, to round-off.
    Taylor,
    /// Backward differences.
    Bdf,
    /// Implicit Runge–Kutta.
    Sdirk,
    /// Explicit Runge–Kutta.
    Explicit,
}

impl Choice {
    /// Returns the word used in scenes and logs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Taylor => "taylor",
            Self::Bdf => "bdf",
            Self::Sdirk => "sdirk",
            Self::Explicit => "explicit",
        }
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Builds the integrator for `system`.
///
/// `rtol` is the relative tolerance of the methods other than Taylor, which always works to round-off.
/// [`Choice::Auto`] uses [`PerMode`]. Flows with a known series get Taylor, with Radau steps where stiff power laws rest. Others get the
/// explicit method. Stiff modes get backward differences.
///
/// # Errors
/// [`IntegrateError::NoJet`] if Taylor is forced on a flow that can only be evaluated;
/// [`IntegrateError::NotBuilt`] if the method is not part of this build.
pub fn build(choice: Choice, rtol: f64, system: &dyn HybridSystem) -> Result<Box<dyn Integrator>, IntegrateError> {
    let series = system.has_series();
    let usual: Box<dyn Integrator> = match choice {
        Choice::Taylor if !series => return Err(IntegrateError::NoJet),
        Choice::Taylor => return Ok(Box::new(Taylor::default())),
        Choice::Auto if series => Box::new(Relay::default()),
        Choice::Auto => solver(Choice::Explicit, rtol)?,
        forced => return solver(forced, rtol),
    };
    Ok(match solver(Choice::Bdf, rtol) {
        Ok(stiff) => Box::new(PerMode { usual, stiff, picks: BTreeMap::new() }),
        Err(_) => usual,
    })
}

/// Returns the reason for the integrator that [`build`] builds, in a sentence.
#[must_use]
pub fn reason(choice: Choice, rtol: f64, system: &dyn HybridSystem) -> String {
    let (plain, why) = match system.has_series() {
        true => (Choice::Taylor, "the flow knows its Taylor series"),
        false => (Choice::Explicit, "the flow can only be evaluated"),
    };
    match choice {
        Choice::Taylor => "taylor: asked for".to_owned(),
        Choice::Auto if cfg!(feature = "diffsol") => {
            format!("auto: {plain}, as {why}; bdf with rtol {rtol:e} in stiff modes")
        }
        Choice::Auto => format!("auto: {plain}, as {why}; this build has no method for stiff modes"),
        forced => format!("{forced}: asked for, rtol {rtol:e}"),
    }
}

#[cfg(feature = "diffsol")]
fn solver(choice: Choice, rtol: f64) -> Result<Box<dyn Integrator>, IntegrateError> {
    let method = match choice {
        Choice::Bdf => Method::Bdf,
        Choice::Sdirk => Method::Sdirk,
        _ => Method::Explicit,
    };
    Ok(Box::new(Diffsol::new(method, rtol)))
}

#[cfg(not(feature = "diffsol"))]
fn solver(choice: Choice, _rtol: f64) -> Result<Box<dyn Integrator>, IntegrateError> {
    Err(IntegrateError::NotBuilt { method: choice.name() })
}

/// Number of steps of a method limited by the fastest decay, per forcing period, above which a mode counts as stiff.
///
/// A Taylor step of order 24 covers about two decay times, an explicit step about 3.3. Backward differences need some hundreds of steps a
/// period at ordinary tolerances for any decay. Each costs about a Taylor step of a small train, and each event 20 to 45 more.
const STIFF_STEPS: f64 = 5000.0;
/// Decay times covered by a step of such a method.
const PER_STEP: f64 = 2.0;
/// Largest ratio of oscillations to the decay in a stiff mode. Faster oscillations have to be resolved anyway, and backward differences of
/// high order are unstable on them.
const SLOWER: f64 = 0.05;

/// Two integrators and the choice between them for each mode.
///
/// A mode is stiff if its fastest strongly damped element ([`rates`](HybridSystem::rates)) would cost the usual method more than 5000 steps
/// in a forcing period. Without a period the current arc counts. Everything lightly damped must be at least twenty times slower. A mode
/// keeps its first integrator.
pub struct PerMode {
    usual: Box<dyn Integrator>,
    stiff: Box<dyn Integrator>,
    picks: BTreeMap<Mode, bool>,
}

impl PerMode {
    /// Returns whether `mode` is stiff; `arc` is the time, s, that replaces the forcing period of a system without one.
    #[must_use]
    pub fn is_stiff(system: &dyn HybridSystem, mode: &Mode, arc: f64) -> bool {
        let Some(rates) = system.rates(mode) else { return false };
        let time = system.clock().period().map_or(arc, |t| t.value());
        rates.damped * time > STIFF_STEPS * PER_STEP && rates.oscillating < SLOWER * rates.damped
    }

    /// Returns whether `mode` is stiff, as decided at its first arc.
    fn pick(&mut self, system: &dyn HybridSystem, mode: &Mode, arc: f64) -> bool {
        match self.picks.get(mode) {
            Some(stiff) => *stiff,
            None => *self.picks.entry(mode.clone()).or_insert(Self::is_stiff(system, mode, arc)),
        }
    }
}

impl Integrator for PerMode {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn restart(&mut self) {
        self.usual.restart();
        self.stiff.restart();
        self.picks.clear();
    }

    fn is_exact(&mut self, system: &dyn HybridSystem, mode: &Mode, arc: f64) -> bool {
        !self.pick(system, mode, arc) && self.usual.is_exact(system, mode, arc)
    }

    fn integrate_arc(
        &mut self,
        system: &dyn HybridSystem,
        arc: &Arc<'_>,
        end: &mut [f64],
        low: &mut [f64],
        visit: &mut dyn FnMut(&dyn DenseStep) -> ControlFlow<()>,
    ) -> Result<(), IntegrateError> {
        let time = system.clock().between(arc.at, arc.bound);
        let chosen = if self.pick(system, arc.mode, time) { &mut self.stiff } else { &mut self.usual };
        chosen.integrate_arc(system, arc, end, low, visit)
    }

    fn chosen(&self) -> Vec<(Mode, &'static str)> {
        let relieved = self.usual.chosen();
        let usual = |mode: Mode| relieved.iter().find(|r| r.0 == mode).map_or(self.usual.name(), |r| r.1);
        let name = |mode: &Mode, stiff: bool| if stiff { self.stiff.name() } else { usual(mode.clone()) };
        self.picks.iter().map(|(mode, stiff)| (mode.clone(), name(mode, *stiff))).collect()
    }
}
