//! long_runs
