use crate::{
    engine::EngineError,
    integrate::IntegrateError,
    train::{AssembleError, StartError, TrainError},
};

/// Why a comparison cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccuracyError {
    /// The engine failed.
    #[error("the reference run fails: {0}")]
    Engine(#[from] EngineError),
    /// An integrator is not to be had.
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
    /// Nothing happens that could be compared.
    #[error("no contact opens or closes in the {cycles} cycles of the run: there are no events to compare")]
    NoEvents {
        /// Cycles run.
        cycles: u64,
    },
    /// The motion amplifies errors from the first cycle on.
    #[error("the motion amplifies errors {growth:.0}-fold within its first cycle: there is no window to compare in")]
    NoWindow {
        /// Growth found.
        growth: f64,
    },
    /// A word that names no contender.
    #[error("{word}: {problem}")]
    Word {
        /// The word.
        word: String,
        /// What is wrong, and what is known.
        problem: String,
    },
}
