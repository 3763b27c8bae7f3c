use crate::{
    engine::EngineError,
    integrate::IntegrateError,
    output::OutputError,
    scene::SceneError,
    system::{AssembleError, StartError},
    verify::Difference,
};

/// Error of a simulation that cannot be made or run, or whose numbers must not be used.
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
    /// A simulation lacks data for a measure.
    #[error("{name}: {missing}")]
    Missing {
        /// Name of the simulation.
        name: String,
        /// Missing data, and the remedy.
        missing: String,
    },
    /// The energy ledger does not balance.
    #[error("the energy ledger of the run is open by {closure:e} of its throughput, where {rounding:e} is allowed")]
    Energy {
        /// Residual over throughput.
        closure: f64,
        /// Largest allowed value: that of rounding, at most half a percent of the largest column.
        rounding: f64,
    },
    /// A measure of the run is not a number.
    #[error("{0} is beyond the range of double precision")]
    Overflow(String),
    /// The output folder cannot be written into.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file cannot be written completely.
    #[error("{0}: {1}")]
    File(&'static str, std::io::Error),
}

impl SimulationError {
    /// Returns the error of a measure that the simulation `name` lacks data for.
    pub(crate) fn missing(name: &str, missing: impl Into<String>) -> Self {
        Self::Missing { name: name.to_owned(), missing: missing.into() }
    }
}
