//! One run.

use std::{ops::ControlFlow, path::PathBuf, sync::Arc};

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::{prelude::*, types::PyBool};

use crate::{
    error::{cancelled, raised, refused},
    events::{Collector, Events},
    work::detached,
};
use flank::{
    Error, Simulation,
    analysis::{EventRow, Grid},
};

/// Settings of one run, keyword arguments of the package.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RunSettings {
    log: bool,
    out: Option<PathBuf>,
    replace: bool,
    trajectory: bool,
    verify: bool,
    max_events: Option<u64>,
    observer: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
}

/// Record of a run, and the exception of a failed or interrupted one.
pub type RunAndFailure = (PythonRun, Option<PyErr>);

/// Record of a run.
#[pyclass(frozen, name = "Run", module = "flank._flank")]
pub struct PythonRun {
    simulation: Arc<Simulation>,
    summary: String,
    events: Py<Events>,
    end: flank::hybrid::Instant,
}

/// Runs a simulation. An exception of the observer is raised after the end of the run.
pub fn run(py: Python<'_>, simulation: &Arc<Simulation>, settings: RunSettings) -> PyResult<RunAndFailure> {
    let RunSettings { log, out, replace, trajectory, verify, max_events, observer, progress } = settings;
    let (mut collected, mut raised_by_observer) = (Collector::default(), None);
    let owned = simulation.clone();
    let done = detached(py, progress, |task| {
        let mut rows = |row: EventRow| {
            if log {
                collected.take(&row);
            }
            let Some(observer) = &observer else { return ControlFlow::Continue(()) };
            let text = serde_json::to_string(&row).unwrap_or_default();
            match Python::attach(|py| {
                observer.call1(py, (text,)).map(|answer| answer.bind(py).is(PyBool::new(py, false)))
            }) {
                Ok(true) => ControlFlow::Break(()),
                Ok(false) => ControlFlow::Continue(()),
                Err(error) => {
                    raised_by_observer = Some(error);
                    ControlFlow::Break(())
                }
            }
        };
        let mut job = owned.job();
        job.task = task;
        job.log = log;
        job.replace = replace;
        job.trajectory |= trajectory;
        job.verify |= verify;
        job.max_events = job.max_events.min(max_events.unwrap_or(u64::MAX));
        if log || observer.is_some() {
            job.rows = Some(&mut rows);
        }
        job.attempt(out.as_deref())
    });
    if let Some(error) = raised_by_observer {
        return Err(cancelled(py, error));
    }
    let record = done.result.map_err(raised)?;
    let events = Events::new(collected, simulation.dimensionless);
    let events = Py::new(py, events.map_err(|error| raised(Error::file("events", std::io::Error::other(error))))?)?;
    let summary = serde_json::to_string(&record.summary).unwrap_or_default();
    let failure = done.cancelled.or_else(|| record.failure.map(raised));
    Ok((PythonRun { simulation: simulation.clone(), summary, events, end: record.end.at }, failure))
}

#[pymethods]
impl PythonRun {
    /// Summary as JSON text.
    fn summary(&self) -> &str {
        &self.summary
    }

    /// Times of its start and of its end, s.
    #[getter]
    fn span(&self) -> (f64, f64) {
        let (clock, start) = (self.simulation.clock(), self.simulation.instants()[0]);
        (clock.time(start).value(), clock.time(self.end).value())
    }

    #[getter]
    fn events(&self, py: Python<'_>) -> Py<Events> {
        self.events.clone_ref(py)
    }

    /// Returns the names and the values of samples up to the end of the run: at times, s, or at phases of each cycle.
    #[pyo3(signature = (times=None, per_cycle=None))]
    fn samples<'py>(
        &self,
        py: Python<'py>,
        times: Option<Vec<f64>>,
        per_cycle: Option<u32>,
    ) -> PyResult<(Vec<String>, Bound<'py, PyArray2<f64>>)> {
        let (clock, (from, to)) = (self.simulation.clock(), self.span());
        let grid = match (times, per_cycle) {
            (Some(times), _) => {
                let is_inside = |t: &f64| (from..=to).contains(t);
                if let Some(t) = times.iter().find(|t| !is_inside(t)) {
                    return Err(refused("t", format!("{t} s"), &format!("times of the run, from {from} to {to} s")));
                }
                if !times.is_sorted() {
                    return Err(refused("t", "times in another order", "times in rising order"));
                }
                Grid::Times(times)
            }
            (None, Some(per_cycle)) if clock.period().is_some() => Grid::Phases { per_cycle },
            _ => {
                let allowed = "a scene whose forcing has a period; give times instead";
                return Err(refused("samples_per_cycle", "a scene without cycles", allowed));
            }
        };
        let last = match &grid {
            // Beyond the last time by the rounding of the run's times, so that an event there is passed.
            Grid::Times(times) => {
                let rounding = 2.0 * f64::EPSILON * from.abs().max(to.abs());
                times.last().map_or(self.end, |t| clock.instant(t + rounding))
            }
            _ => self.end,
        };
        let end = if clock.between(last, self.end) > 0.0 { last } else { self.end };
        let simulation = self.simulation.clone();
        let done = detached(py, None, |task| simulation.sample(grid, end, task));
        if let Some(error) = done.cancelled {
            return Err(error);
        }
        let table = done.result.map_err(raised)?;
        let width = table.names.len();
        let height = table.values.len() / width;
        let values = table.values.into_pyarray(py).reshape([height, width])?;
        Ok((table.names, values))
    }
}
