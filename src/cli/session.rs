//! From a scene file to an engine at its start.

use std::path::Path;

use flank::{
    engine::{Engine, State},
    hybrid::Instant,
    scene::Scene,
    study::Case,
};

use super::CliError;

/// Reads a scene, or the reference scene.
pub fn read(path: Option<&Path>) -> Result<Scene, CliError> {
    Ok(path.map_or_else(Scene::reference, Scene::from_file)?)
}

/// Threads to work on: `count`, or as many as there are cores.
pub fn threads(count: Option<u16>) -> Result<rayon::ThreadPool, CliError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count.map_or(0, usize::from)).build();
    pool.map_err(|error| CliError::file("threads", std::io::Error::other(error)))
}

/// A scene, ready to run, and where it starts.
pub struct Session {
    pub scene: Scene,
    pub case: Case,
    pub start: State,
    /// Where the run starts, where its measures start, where it ends.
    pub instants: [Instant; 3],
}

impl Session {
    pub fn open(path: Option<&Path>) -> Result<Self, CliError> {
        let scene = read(path)?;
        let case = Case::new(&scene)?;
        let instants = case.built.run.instants(case.clock());
        Ok(Self { scene, start: case.start()?, case, instants })
    }

    /// An engine at the start, and why it has the integrator it has. It ends after `most` events.
    pub fn engine(&self, most: u64) -> Result<(Engine<'_>, String), CliError> {
        Ok(self.case.limited(self.start.clone(), most)?)
    }

    /// What the scene calls itself, or else its file.
    pub fn title(&self) -> String {
        self.scene.resolved()["name"].as_str().unwrap_or(self.scene.name()).to_owned()
    }

    /// A unit, or nothing in a dimensionless train.
    pub fn unit(&self, name: &'static str) -> &'static str {
        if self.case.built.dimensionless { "" } else { name }
    }

    /// The states of all contacts in words, such as `drive, separated`.
    pub fn mode_in_words(&self, mode: flank::hybrid::Mode) -> String {
        let names = (0..self.case.structure.contacts().len()).map(|j| flank::train::contact_mode(mode, j).name());
        names.collect::<Vec<_>>().join(", ")
    }
}
