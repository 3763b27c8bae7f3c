//! Simplified model of a scene, and the map from motions of the scene to those of the model.

use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

use super::simplify::{self, LinearLaw};
use crate::{
    hybrid::ContactView,
    scene::Scene,
    simulation::Simulation,
    study::{StudyError, figures::family, steady::Seed},
    train::Quantity,
};

/// One way of making a train simpler.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Another value at a JSON pointer; at [`FREEDOMS`], other freedoms.
    Set(&'static str, Value),
    /// Only excitation (errors and harmonic loads) below this frequency, rad/s.
    ExcitationBelow(f64),
    /// Only stiffness harmonics below this frequency, rad/s.
    StiffnessBelow(f64),
    /// Ramps of the stiffness become steps in their middle; the mean stays.
    Stepped,
    /// Stiffness at its mean.
    MeanStiffness,
    /// Linear laws in place of power laws.
    Linear(Vec<LinearLaw>),
    /// No damping in the contacts.
    Undamped,
    /// These freedoms of the in-phase reduction `u_s, u_r, u_c, xi, eta, u` dropped, as a stage drops them: a planet's
    /// centre follows the carrier, `ξ = 0`, `η = u_c`.
    Carried(Vec<String>),
    /// These freedoms held at rest.
    Hold(Vec<String>),
    /// Each contact on its own, see [`simplify::alone`].
    Alone,
}

/// JSON pointer to the degrees of freedom of a scene's train.
pub const FREEDOMS: &str = "/train/freedoms";

impl Step {
    /// Returns the step as a value at a JSON pointer of the scene; none if a scene cannot express it.
    pub fn value(&self) -> Option<(&'static str, Value)> {
        if let Self::Set(pointer, value) = self { Some((pointer, value.clone())) } else { None }
    }
}

/// A model of a scene: a simulation, and its degrees of freedom as functions of those of the scene.
#[derive(Debug)]
#[non_exhaustive]
pub struct Model {
    /// Simulation of the simplified train.
    pub simulation: Simulation,
    /// R in `q = R q_scene`, `[n × n_scene]`.
    restriction: DMatrix<f64>,
}

impl Model {
    /// Builds the scene with `steps`, in their order except that steps which a scene can express come first.
    ///
    /// It starts from the start of the scene, in its own degrees of freedom.
    pub fn new(scene: &Scene, steps: &[Step]) -> Result<Self, StudyError> {
        let whole = scene.built();
        let mut values: Vec<(&str, Value)> = steps.iter().filter_map(Step::value).collect();
        if values.iter().any(|(pointer, _)| *pointer == FREEDOMS) {
            // A start written for other freedoms; it is set below.
            values.push(("/initial", json!("rest")));
        }
        let mut built = if values.is_empty() { whole.clone() } else { scene.with_all(values)?.built().clone() };
        let mut restriction = by_name(&whole.spec.freedoms, &built.spec.freedoms);
        let spec = &mut built.spec;
        for step in steps {
            match step {
                Step::Set(..) => {}
                Step::ExcitationBelow(omega) => simplify::excitation_below(spec, *omega),
                Step::StiffnessBelow(omega) => simplify::stiffness_below(spec, *omega),
                Step::Stepped => simplify::stepped(spec),
                Step::MeanStiffness => simplify::mean_stiffness(spec),
                Step::Linear(laws) => simplify::linear(spec, laws),
                Step::Undamped => *spec = spec.scaled(Quantity::Damping, 0.0),
                Step::Carried(names) => restriction = simplify::drop(spec, names, true) * restriction,
                Step::Hold(names) => restriction = simplify::drop(spec, names, false) * restriction,
                Step::Alone => restriction = simplify::alone(spec) * restriction,
            }
        }
        let restricted = |q: &[f64]| (&restriction * DVector::from_column_slice(q)).as_slice().to_vec();
        (built.q0, built.v0) = (restricted(&whole.q0), restricted(&whole.v0));
        Ok(Self { simulation: Simulation::from_built(scene.name(), built)?, restriction })
    }

    /// Returns the state of a motion of the scene's own model, `whole`, as a start of this model: displacements and velocities in its
    /// degrees of freedom, latched speeds and modes from the contacts of the same name, or of the same family.
    pub fn seed(&self, whole: &Self, seed: &Seed) -> Seed {
        let (ours, theirs) = (&self.simulation.structure, &whole.simulation.structure);
        let n = theirs.freedoms();
        let part = |x: &[f64]| (&self.restriction * DVector::from_column_slice(x)).as_slice().to_vec();
        let mut x = [part(&seed.x[..n]), part(&seed.x[n..2 * n])].concat();
        let source = |j: usize| {
            let name = ours.contact_name(j);
            let same = (0..theirs.contact_count()).find(|&i| theirs.contact_name(i) == name);
            let alike = || (0..theirs.contact_count()).find(|&i| family(theirs.contact_name(i)) == family(name));
            // OK to index: every contact of a model is one of the scene.
            same.or_else(alike).unwrap_or(j)
        };
        let latched: Vec<(usize, f64)> = theirs.latched().collect();
        for (j, side) in ours.latched() {
            let first = ours.contacts()[j].spec.law.power().map_or(0.0, |law| law.initial_speed);
            let known = latched.iter().position(|of| *of == (source(j), side));
            x.push(known.map_or(first, |i| seed.x[2 * n + i]));
        }
        let contacts = (0..ours.contact_count()).map(|j| seed.contacts[source(j)]).collect();
        Seed { x, contacts }
    }
}

/// Picks the freedoms `to` out of `from`; a freedom of all planets is that of the first.
fn by_name(from: &[String], to: &[String]) -> DMatrix<f64> {
    let source = |name: &String| {
        from.iter().position(|f| f == name).or_else(|| from.iter().position(|f| *f == format!("{name}_1")))
    };
    DMatrix::from_fn(to.len(), from.len(), |i, j| f64::from(u8::from(source(&to[i]) == Some(j))))
}
