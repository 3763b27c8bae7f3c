use crate::{
    engine::EngineError,
    integrate::IntegrateError,
    output::OutputError,
    scene::SceneError,
    system::{AssembleError, StartError},
    verify::Difference,
};

/// Why a simulation cannot be made or run, or why its numbers must not be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The train cannot be assembled.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// The run cannot start.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The integrator is not available.
    #[error(transparent)]
    Integrator(#[from] IntegrateError),
    /// The run failed.
    #[error("the run failed {0}")]
    Run(#[from] EngineError),
    /// The run does not agree with its check.
    #[error("the run is wrong or not certain: {0}")]
    Verify(#[from] Difference),
    /// A simulation lacks what was asked of it.
    #[error("{name}: {missing}")]
    Missing {
        /// Name of the simulation.
        name: String,
        /// What is missing, and the remedy.
        missing: String,
    },
    /// The energy ledger does not balance.
    #[error("the energy ledger of the run is open by {closure:e} of its throughput, where {rounding:e} is allowed")]
    Energy {
        /// Residual over throughput.
        closure: f64,
        /// The largest that is allowed: what rounding explains, and no more than half a percent of the largest column.
        rounding: f64,
    },
    /// A measure of the run is not a number.
    #[error("{0} is beyond the range of double precision")]
    Overflow(String),
    /// The output folder cannot be written into.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file cannot be written to its end.
    #[error("{0}: {1}")]
    File(&'static str, std::io::Error),
}

impl SimulationError {
    /// The error of a measure that needs more than the simulation called `name` has.
    pub(crate) fn missing(name: &str, missing: impl Into<String>) -> Self {
        Self::Missing { name: name.to_owned(), missing: missing.into() }
    }
}
