//! Errors of the library as exceptions of the package.

use pyo3::{exceptions::PyKeyboardInterrupt, import_exception, prelude::*};

use flank::{
    Error,
    output::{Fault, OutputError},
    simulation::SimulationError,
    sweep::SweepError,
};

mod exceptions {
    use super::import_exception;

    import_exception!(flank._errors, Error);
    import_exception!(flank._errors, SceneError);
    import_exception!(flank._errors, Alarm);
    import_exception!(flank._errors, Interrupted);
}

/// Returns the exception of an error.
pub fn raised(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let text = error.to_string();
    let faults = match &error {
        Error::Scene(error) => &error.faults,
        Error::Grid(error) => &error.0,
        Error::Arguments(faults) => faults,
        Error::Simulation(
            SimulationError::Verify(_) | SimulationError::Energy { .. } | SimulationError::Overflow(_),
        ) => return exceptions::Alarm::new_err(text),
        Error::Output(OutputError::Occupied(_))
        | Error::Sweep(SweepError::Unfinished(_) | SweepError::Mismatch { .. } | SweepError::Damaged { .. }) => {
            return exceptions::Error::new_err(
                text + "\n  remedy: name another folder, or replace what is there by replace=True",
            );
        }
        _ => return exceptions::Error::new_err(text),
    };
    let row = |fault: &Fault| (fault.pointer.clone(), fault.found.clone(), fault.allowed.clone(), fault.remedy.clone());
    exceptions::SceneError::new_err((text, faults.iter().map(row).collect::<Vec<_>>()))
}

/// Returns the exception for an argument that cannot be used.
pub fn refused(place: &str, found: impl Into<String>, allowed: &str) -> PyErr {
    raised(Error::Arguments(vec![Fault::new(place, found, allowed)]))
}

/// Returns the exception of cancelled work: for Ctrl-C one of the package, else `cause` itself.
pub fn cancelled(py: Python<'_>, cause: PyErr) -> PyErr {
    if cause.is_instance_of::<PyKeyboardInterrupt>(py) {
        exceptions::Interrupted::new_err("interrupted")
    } else {
        cause
    }
}

/// Returns the alarm of numbers that contradict each other.
pub fn alarm(text: String) -> PyErr {
    exceptions::Alarm::new_err(text)
}
