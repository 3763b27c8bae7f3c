//! Sections, orbits, exponents, branches, thresholds.

use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::prelude::*;
use serde_json::{Value, json};

use flank::{
    Error, Simulation,
    branch::{Branch, Continuation, Family},
    engine::State,
    ensemble::Ensemble,
    hybrid::ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated},
    orbit::{Image, Lyapunov, Search, Section, SectionMap as Map, components},
    simulation::Parameter,
    study::rattle::{LoadThreshold, Loss},
};

use crate::{
    error::{alarm, raised, refused},
    scene::Scene,
    work::{WorkResult, pooled},
};

/// Returns the result of work without a partial one: the exception that cancelled it comes first.
fn whole<T, E: Into<Error>>(done: WorkResult<Result<T, E>>) -> PyResult<T> {
    match done.cancelled {
        Some(cancelled) => Err(cancelled),
        None => done.result.map_err(raised),
    }
}

/// Returns an array of rows of one length.
fn matrix<'py>(py: Python<'py>, rows: Vec<f64>, width: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let height = rows.len() / width.max(1);
    rows.into_pyarray(py).reshape([height, width])
}

/// State at the start of a cycle.
#[pyclass(frozen, name = "Section", module = "flank._flank")]
#[derive(Clone)]
pub struct PythonSection(Section);

#[pymethods]
impl PythonSection {
    /// The state: coordinates, velocities, latched speeds, `[dim]`.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.x.to_pyarray(py)
    }

    /// State of each contact.
    #[getter]
    fn contacts(&self) -> Vec<&'static str> {
        self.0.contacts.iter().map(|contact| contact.name()).collect()
    }

    fn __repr__(&self) -> String {
        format!("Section(x={:?}, contacts={:?})", self.0.x, self.contacts())
    }
}

/// Map of states over whole cycles.
#[pyclass(frozen, module = "flank._flank")]
pub struct SectionMap {
    simulation: Arc<Simulation>,
}

/// Image of a section: its end, the states after each cycle, the derivatives by state and by numbers, the word, further facts as JSON text.
type ImageParts<'py> = (
    PythonSection,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Vec<String>,
    String,
);

#[pymethods]
impl SectionMap {
    #[new]
    fn new(scene: &Scene) -> PyResult<Self> {
        let simulation = Simulation::clone(&*scene.simulation()?).in_common_cycles().map_err(raised)?;
        Map::new(&simulation).and_then(|map| map.repeats()).map_err(raised)?;
        Ok(Self { simulation: Arc::new(simulation) })
    }

    /// True if the run of the scene starts within a period.
    #[getter]
    fn starts_within_a_period(&self) -> bool {
        self.simulation.instants()[0].phase.value() != 0.0
    }

    /// Periods of the forcing clock in a cycle.
    #[getter]
    fn periods_per_cycle(&self) -> u64 {
        self.simulation.periods_per_cycle()
    }

    /// Length of a cycle, s.
    #[getter]
    fn cycle(&self) -> PyResult<f64> {
        self.simulation.period().map_err(raised)
    }

    /// Names of the components of a state.
    #[getter]
    fn components(&self) -> Vec<String> {
        components(&self.simulation)
    }

    /// Returns the section at which the scene starts.
    fn start(&self) -> PyResult<PythonSection> {
        Map::new(&self.simulation).and_then(|map| map.start()).map(PythonSection).map_err(raised)
    }

    /// Returns the section at coordinates and velocities, `[2n]`, or at a whole state, `[dim]`. Contacts are in the states `contacts`; by
    /// default they are open or closed by their deflections.
    #[pyo3(signature = (x, contacts=None))]
    fn section(&self, x: PyReadonlyArray1<'_, f64>, contacts: Option<Vec<String>>) -> PyResult<PythonSection> {
        let x: Vec<f64> = x.as_array().to_vec();
        let (n, dim) = (self.simulation.structure.freedoms(), components(&self.simulation).len());
        if x.len() != 2 * n && x.len() != dim {
            let allowed = format!("coordinates and velocities, {} numbers, or a whole state, {dim}", 2 * n);
            return Err(refused("x", format!("{} numbers", x.len()), &allowed));
        }
        let map = Map::new(&self.simulation).map_err(raised)?;
        let start = self.simulation.instants()[0];
        let at = self.simulation.clock().at(start.cycle + i64::from(start.phase.value() > 0.0), 0.0);
        let started = self.simulation.structure.start(at, &x[..n], &x[n..2 * n]).map_err(raised)?;
        let mut section = map.section(&State { at, x: started.x, jump: started.jump });
        section.x[..x.len()].copy_from_slice(&x);
        if let Some(names) = contacts {
            let all = [Separated, Drive, Back, DriveDetached, BackDetached];
            let mode = |name: &String| all.into_iter().find(|mode| mode.name() == name);
            let modes = names.iter().map(mode).collect::<Option<Vec<_>>>();
            section.contacts = modes.filter(|modes| modes.len() == section.contacts.len()).ok_or_else(|| {
                refused("contacts", format!("{names:?}"), "the state of each contact, as those of a section")
            })?;
        }
        Ok(PythonSection(section))
    }

    /// Returns the section after some cycles.
    fn follow(&self, py: Python<'_>, section: &PythonSection, cycles: u64) -> PyResult<PythonSection> {
        let done =
            pooled(py, Some(1), None, |task| Map::new(&self.simulation)?.with_task(task).follow(&section.0, cycles))?;
        Ok(PythonSection(whole(done)?))
    }

    /// Returns the image of a section after some cycles, with its derivatives by the state and by numbers of the scene.
    fn image<'py>(
        &self,
        py: Python<'py>,
        section: &PythonSection,
        cycles: u64,
        pointers: Vec<String>,
    ) -> PyResult<ImageParts<'py>> {
        let done = pooled(py, Some(1), None, |task| {
            let variations = pointers.iter().map(|pointer| self.simulation.variation(pointer));
            let variations = variations.collect::<Result<Vec<_>, _>>()?;
            Map::new(&self.simulation)?.with_task(task).image_by(&section.0, cycles, &variations)
        })?;
        let Image { end, between, jacobian, by_number, word, zeros, volume, corner, has_event_at_section, .. } =
            whole(done)?;
        let facts = json!({
            "zeros": zeros, "volume": if volume.is_nan() { Value::Null } else { json!(volume) }, "corner": corner,
            "has_event_at_section": has_event_at_section,
        });
        let rows: Vec<f64> = between.iter().flat_map(|section| section.x.clone()).collect();
        let row_major = |of: &flank::nalgebra::DMatrix<f64>| of.transpose().as_slice().to_vec();
        let dim = end.x.len();
        Ok((
            PythonSection(end),
            matrix(py, rows, dim)?,
            matrix(py, row_major(&jacobian), dim)?,
            row_major(&by_number).into_pyarray(py).reshape([dim, pointers.len()])?,
            word,
            facts.to_string(),
        ))
    }
}

/// States of members, and their failures: member and reason.
type Sections<'py> = (Bound<'py, PyArray3<f64>>, Vec<(usize, String)>);

/// Runs many motions. Returns the states at the start and after each `every` cycles, `[members][sections][dim]`, and the failures: member
/// and reason. States after a failure are NaN.
#[pyfunction]
#[pyo3(signature = (scene, x0, length, threads, progress))]
pub fn sections<'py>(
    py: Python<'py>,
    scene: &Scene,
    x0: PyReadonlyArray2<'py, f64>,
    length: (u64, u64),
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Sections<'py>> {
    let (simulation, (cycles, every)) = (scene.simulation()?, length);
    simulation.period().map_err(raised)?;
    let n = simulation.structure.freedoms();
    let starts = x0.as_array().to_owned();
    if starts.ncols() != 2 * n {
        let allowed = format!("coordinates and velocities, {} numbers for each member", 2 * n);
        return Err(refused("x0", format!("{} numbers for each member", starts.ncols()), &allowed));
    }
    let (members, count, dim) = (starts.nrows(), (cycles / every + 1) as usize, components(&simulation).len());
    let mut states = Vec::new();
    if members
        .checked_mul(count)
        .and_then(|c| c.checked_mul(dim))
        .is_none_or(|all| states.try_reserve_exact(all).is_err())
    {
        let found = format!("{members} members with {count} sections of {dim} numbers");
        return Err(refused("cycles", found, "states that fit into the memory: fewer cycles, or a larger every"));
    }
    for (i, row) in starts.rows().into_iter().enumerate() {
        let x = row.to_vec();
        let started = simulation.start_at(&x[..n], &x[n..]);
        started.map_err(|error| {
            refused(&format!("x0[{i}]"), error.to_string(), "a state from which the train can start")
        })?;
    }
    let done = pooled(py, threads, progress, |task| {
        let mut failures = Vec::new();
        let clock = simulation.clock();
        Ensemble::new(&simulation, members).run(
            |i| {
                let row = starts.row(i).to_vec();
                simulation.start_at(&row[..n], &row[n..])
            },
            |_, engine| {
                let first = engine.state().at.cycle;
                let mut rows = engine.state().x.clone();
                let mut failure = None;
                for k in 1..count as i64 {
                    if task.is_cancelled() {
                        break;
                    }
                    match engine.run(clock.at(first + k * every as i64, 0.0), &mut ()) {
                        Ok(flank::engine::Outcome::ReachedEnd) => rows.extend_from_slice(&engine.state().x),
                        Ok(_) => failure = Some("the limit on events is reached".to_owned()),
                        Err(error) => failure = Some(error.to_string()),
                    }
                    if failure.is_some() {
                        break;
                    }
                }
                rows.resize(count * dim, f64::NAN);
                task.advance();
                Ok((rows, failure))
            },
            |i, member| {
                let (rows, failure) = member?;
                states.extend(rows);
                failures.extend(failure.map(|failure| (i, failure)));
                Ok(())
            },
        )?;
        Ok::<_, Error>((states, failures))
    })?;
    let (states, failures) = whole(done)?;
    Ok((states.into_pyarray(py).reshape([members, count, dim])?, failures))
}

/// Searches for orbits. Returns the content of `orbit.json`.
#[pyfunction]
#[pyo3(signature = (scene, period, starts, threads, progress))]
pub fn orbits(
    py: Python<'_>,
    scene: &Scene,
    period: Option<u64>,
    starts: usize,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let simulation = Simulation::clone(&*scene.simulation()?).in_common_cycles().map_err(raised)?;
    let search = Search { period, starts };
    let found = whole(pooled(py, threads, progress, |task| search.run(&simulation, task))?)?;
    Ok(found.report(&simulation).to_string())
}

/// Computes exponents. Returns the content of `lyapunov.json`, with the course of the averages.
#[pyfunction]
#[pyo3(signature = (scene, cycles, without_saltation, finite, progress))]
pub fn exponents(
    py: Python<'_>,
    scene: &Scene,
    cycles: Option<u64>,
    without_saltation: bool,
    finite: Option<u64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let simulation = scene.simulation()?;
    let method = Lyapunov { cycles, without_saltation, finite };
    let found = whole(pooled(py, Some(2), progress, |task| method.run(&simulation, task))?)?;
    if found.is_contradictory {
        return Err(alarm(found.reason.unwrap_or_default()));
    }
    let mut report = json!(found);
    report["course"] = json!(found.course);
    report["is_whole"] = json!(found.is_whole);
    Ok(report.to_string())
}

/// Columns of a branch: level, values, periods, words, stability, multipliers, states, residuals, ends, special points as JSON text.
type BranchParts<'py> = (
    u32,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u64>>,
    Vec<String>,
    Vec<bool>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    [String; 2],
    String,
);

/// Follows orbits along a number of the scene. Returns the branches, and the number of those that were left out.
#[pyfunction]
#[pyo3(signature = (scene, pointers, ends, first, threads, progress))]
pub fn branches<'py>(
    py: Python<'py>,
    scene: &Scene,
    pointers: Vec<String>,
    ends: [f64; 2],
    first: (Option<u64>, u32),
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Vec<BranchParts<'py>>, usize)> {
    let scene = scene.scene();
    let pointers: Vec<&str> = pointers.iter().map(String::as_str).collect();
    let parameter = Parameter::around(scene, &pointers, ends);
    let parameter = parameter.map_err(|fault| raised(Error::Arguments(vec![fault])))?;
    let family = Family::new(scene, parameter, ends).map_err(raised)?;
    let (period, doublings) = first;
    let method = Continuation { period, doublings };
    let followed = whole(pooled(py, threads, progress, |task| method.run(&family, None, &mut |_| Ok(()), task))?)?;
    let parts = |branch: &Branch| -> PyResult<BranchParts<'py>> {
        let points = &branch.points;
        let states: Vec<f64> = points.iter().flat_map(|point| point.section.x.clone()).collect();
        let dim = points.first().map_or(0, |point| point.section.x.len());
        let specials = branch.specials.iter().map(|special| {
            json!({
                "kind": special.kind.word(), "value": special.value, "period": special.period, "word": special.word,
                "residual": special.residual, "uncertainty": special.uncertainty, "turns": special.turns,
                "branch": special.branch, "point": special.point,
                "multiplier": [special.multiplier.re, special.multiplier.im],
            })
        });
        let numbers =
            |of: fn(&flank::branch::BranchPoint) -> f64| points.iter().map(of).collect::<Vec<_>>().into_pyarray(py);
        Ok((
            branch.level,
            numbers(|point| point.value),
            points.iter().map(|point| point.period).collect::<Vec<_>>().into_pyarray(py),
            points.iter().map(|point| point.word.clone()).collect(),
            points.iter().map(|point| point.is_stable).collect(),
            numbers(|point| point.multiplier),
            matrix(py, states, dim)?,
            numbers(|point| point.residual),
            branch.ends.clone(),
            json!({ "specials": specials.collect::<Vec<_>>(), "unlocated": branch.unlocated }).to_string(),
        ))
    };
    Ok((followed.branches.iter().map(parts).collect::<PyResult<_>>()?, followed.left_out))
}

/// Finds the load below which contact is lost. Returns the output of `flank threshold --json`.
#[pyfunction]
#[pyo3(signature = (scene, vary, by))]
pub fn threshold(py: Python<'_>, scene: &Scene, vary: Option<(String, [f64; 2])>, by: &str) -> PyResult<String> {
    let loss = match by {
        "deflection" => Loss::Deflection,
        "force" => Loss::Force,
        "back-flank" => Loss::BackFlank,
        _ => return Err(refused("by", format!("{by:?}"), "deflection, force or back-flank")),
    };
    let found = whole(pooled(py, None, None, |task| LoadThreshold::find(scene.scene(), vary, loss, task))?)?;
    Ok(json!(found).to_string())
}
