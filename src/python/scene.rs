//! Scene, ready to run.

use std::{
    path::PathBuf,
    sync::{Arc, OnceLock},
};

use pyo3::prelude::*;
use serde_json::Value;

use crate::{
    error::{raised, refused},
    run::{RunAndFailure, RunSettings, run},
};
use flank::{Simulation, scene};

/// Scene that has been read, checked and resolved.
#[pyclass(frozen, module = "flank._flank")]
pub struct Scene {
    scene: scene::Scene,
    file: Option<PathBuf>,
    simulation: OnceLock<Arc<Simulation>>,
}

impl Scene {
    fn of(scene: scene::Scene, file: Option<PathBuf>) -> Self {
        Self { scene, file, simulation: OnceLock::new() }
    }

    /// Returns the library's scene.
    pub fn scene(&self) -> &scene::Scene {
        &self.scene
    }

    /// Returns its simulation, which is made once.
    pub fn simulation(&self) -> PyResult<Arc<Simulation>> {
        if let Some(simulation) = self.simulation.get() {
            return Ok(simulation.clone());
        }
        let simulation = match &self.file {
            Some(file) => Simulation::from_scene(&self.scene).map(|made| made.read_from(file)),
            None => Simulation::from_scene(&self.scene),
        };
        let simulation = Arc::new(simulation.map_err(raised)?);
        Ok(self.simulation.get_or_init(|| simulation).clone())
    }
}

#[pymethods]
impl Scene {
    /// Reads a scene file.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        Ok(Self::of(scene::Scene::from_file(&path).map_err(raised)?, Some(path)))
    }

    /// Reads a scene from JSON text.
    #[staticmethod]
    fn from_json(text: &str, name: &str) -> PyResult<Self> {
        Ok(Self::of(scene::Scene::from_json(text, name).map_err(raised)?, None))
    }

    /// Returns the reference scene.
    #[staticmethod]
    fn reference() -> PyResult<Self> {
        Ok(Self::of(scene::Scene::reference().map_err(raised)?, None))
    }

    #[getter]
    fn name(&self) -> &str {
        self.scene.name()
    }

    #[getter]
    fn hash(&self) -> String {
        self.scene.hash()
    }

    /// Names of the freedoms.
    #[getter]
    fn freedoms(&self) -> Vec<String> {
        self.scene.built().spec.freedoms.clone()
    }

    /// Names of the contacts.
    #[getter]
    fn contacts(&self) -> Vec<String> {
        self.scene.built().spec.contacts.iter().map(|contact| contact.name.clone()).collect()
    }

    #[getter]
    fn dimensionless(&self) -> bool {
        self.scene.built().dimensionless
    }

    /// Names of the components of a state.
    fn components(&self) -> PyResult<Vec<String>> {
        Ok(flank::orbit::components(&*self.simulation()?))
    }

    /// The scene as it was given, as JSON text.
    fn given(&self) -> String {
        self.scene.given().to_string()
    }

    /// The scene with every default, as JSON text.
    fn resolved(&self) -> String {
        self.scene.resolved().to_string()
    }

    /// Warnings about the train and its start.
    fn warnings(&self) -> PyResult<Vec<String>> {
        Ok(self.simulation()?.warnings_in_words())
    }

    /// Contents of the scene, as JSON text.
    fn report(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&self.simulation()?.report()).unwrap_or_default())
    }

    /// Returns the JSON pointer of a key.
    fn pointer(&self, key: &str) -> PyResult<String> {
        self.scene.pointer(key).map_err(raised)
    }

    /// Returns the scene with other values, JSON text each, at JSON pointers.
    fn with_all(&self, values: Vec<(String, String)>) -> PyResult<Self> {
        let mut changed = Vec::new();
        for (pointer, text) in &values {
            let value: Value = serde_json::from_str(text).map_err(|error| {
                refused(pointer, format!("{text} ({error})"), "a value of JSON, numbers within doubles")
            })?;
            changed.push((pointer.as_str(), value));
        }
        Ok(Self::of(self.scene.with_all(changed).map_err(raised)?, self.file.clone()))
    }

    /// Runs the scene.
    fn run(&self, py: Python<'_>, settings: RunSettings) -> PyResult<RunAndFailure> {
        run(py, &self.simulation()?, settings)
    }
}
