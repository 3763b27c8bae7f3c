//! The repository: imports, documents, readers of any bytes.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

mod architecture;
mod documents;
#[cfg(feature = "import")]
mod fuzz;
mod pages;
mod readers;
#[cfg(feature = "cli")]
mod reference_page;
mod words;
