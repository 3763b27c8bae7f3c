//! From a scene file to an engine at its start.

use std::path::Path;

use flank::{
    engine::{Engine, Options, State},
    hybrid::Instant,
    integrate::build,
    scene::{Built, Scene},
    train::{Start, Structure},
};

use super::CliError;

/// Reads a scene, or the reference scene.
pub fn read(path: Option<&Path>) -> Result<Scene, CliError> {
    Ok(path.map_or_else(Scene::reference, Scene::from_file)?)
}

/// A scene and all that is built from it.
pub struct Session {
    pub scene: Scene,
    pub built: Built,
    pub structure: Structure,
    pub start: Start,
    /// Where the run starts, where its measures start, where it ends.
    pub instants: [Instant; 3],
}

impl Session {
    pub fn open(path: Option<&Path>) -> Result<Self, CliError> {
        let scene = read(path)?;
        let built = scene.build()?;
        let structure = Structure::new(built.spec.clone())?;
        let instants = built.run.instants(structure.clock());
        let start = structure.start(instants[0], &built.q0, &built.v0)?;
        Ok(Self { scene, built, structure, start, instants })
    }

    /// An engine at the start, and why it has the integrator it has. It ends after `most` events.
    pub fn engine(&self, most: u64) -> Result<(Engine<'_>, String), CliError> {
        let run = &self.built.run;
        let (integrator, why) = build(run.method, run.tolerance, &self.structure).map_err(CliError::Integrator)?;
        let options =
            Options { max_events: most, chatter_speed: run.chatter_speed.unwrap_or(0.0), ..Options::default() };
        let state = State { at: self.instants[0], x: self.start.x.clone(), jump: self.start.jump };
        Ok((Engine::new(&self.structure, integrator, options, state), why))
    }

    /// A unit, or nothing in a dimensionless train.
    pub fn unit(&self, name: &'static str) -> &'static str {
        if self.built.dimensionless { "" } else { name }
    }

    /// The states of all contacts in words, such as `drive, separated`.
    pub fn mode_in_words(&self, mode: flank::hybrid::Mode) -> String {
        let names = (0..self.structure.contacts().len()).map(|j| flank::train::contact_mode(mode, j).name());
        names.collect::<Vec<_>>().join(", ")
    }
}
