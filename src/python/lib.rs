//! The Rust side of the Python package: module `flank._flank`, which the package in `python/flank` wraps.
//!
//! Data cross as JSON text, NumPy arrays and Arrow columns. Work runs on a thread of its own, without the interpreter lock.

mod dynamics;
mod error;
mod events;
mod grids;
mod run;
mod scene;
mod work;

use pyo3::prelude::*;

/// Functions and classes behind the package `flank`.
#[pymodule]
mod _flank {
    #[pymodule_export]
    use super::{
        dynamics::{PythonSection, SectionMap, branches, exponents, orbits, sections, threshold},
        events::Events,
        grids::{basins, kinds, sweep},
        run::PythonRun,
        scene::Scene,
    };

    use std::ffi::OsString;

    use pyo3::prelude::*;

    /// Version of Flank.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// Runs a command line; returns its exit code.
    #[pyfunction]
    fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
        py.detach(|| flank::cli::main(words))
    }

    /// Returns the JSON Schema of scenes as text.
    #[pyfunction]
    fn schema() -> String {
        flank::scene::schema().to_string()
    }
}
