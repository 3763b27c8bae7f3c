use crate::{
    engine::EngineError,
    integrate::IntegrateError,
    simulation::SimulationError,
    system::{AssembleError, StartError},
    train::TrainError,
};

/// Errors of a comparison.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccuracyError {
    /// The engine failed.
    #[error("the reference run fails: {0}")]
    Engine(#[from] EngineError),
    /// A run that cannot be compared.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// An integrator is not available.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// A start, or a disturbed one, is refused.
    #[error("a start is refused: {0}")]
    Start(#[from] StartError),
    /// A changed train cannot be assembled.
    #[error("the changed train is refused: {0}")]
    Assemble(#[from] AssembleError),
    /// A changed train has no equilibrium to start from.
    #[error("the changed train has no equilibrium to start from: {0}")]
    Equilibrium(#[from] TrainError),
    /// The run has no events that could be compared.
    #[error("no contact opens or closes in the {cycles} cycles of the run: there are no events to compare")]
    NoEvents {
        /// Cycles run.
        cycles: u64,
    },
    /// The motion amplifies errors from the first cycle on.
    #[error(
        "within the first cycle errors grow {growth}, and there is no window to compare in: take a shorter cycle \
         (run.period_s), a start nearer to the steady motion, or allow more growth"
    )]
    NoWindow {
        /// Growth found, in words: a factor, or the note that neighbouring runs have other events.
        growth: String,
    },
    /// The engine's own run, cut into other steps, has other events.
    #[error(
        "the reference cannot be trusted: with its steps cut elsewhere the same run has other events in its first {cycles} cycles; \
         compare over fewer cycles, or allow less growth"
    )]
    Unsure {
        /// Cycles of the window.
        cycles: u64,
    },
    /// A word that names no contender.
    #[error("{word:?}: {problem}")]
    Word {
        /// The word.
        word: String,
        /// Description of the fault, with the known words or allowed values.
        problem: String,
    },
}
