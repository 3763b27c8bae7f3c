//! Derivatives of a scene's train by one of its numbers.

use nalgebra::DVector;
use serde_json::Value;

use super::{Parameter, Simulation, SimulationError};
use crate::{
    gear::{
        Harmonic, Stiffness,
        contact::{Law, Release, Restitution},
    },
    scene::Scene,
    system::{ContactSpec, Spec, Structure, Variation},
};

/// Steps in units of their length, with the weights of a derivative. The short stencils are tried first: they are exact for linear
/// dependence and of fourth order. One-sided stencils are for numbers at the end of their range.
const STENCILS: [&[(f64, f64)]; 4] = [
    &[(-1.0, -0.5), (1.0, 0.5)],
    &[
        (-4.0, 1.0 / 280.0),
        (-3.0, -4.0 / 105.0),
        (-2.0, 0.2),
        (-1.0, -0.8),
        (1.0, 0.8),
        (2.0, -0.2),
        (3.0, 4.0 / 105.0),
        (4.0, -1.0 / 280.0),
    ],
    &[(0.0, -1.0), (1.0, 1.0)],
    &[(0.0, -49.0 / 20.0), (1.0, 6.0), (2.0, -7.5), (3.0, 20.0 / 3.0), (4.0, -3.75), (5.0, 1.2), (6.0, -1.0 / 6.0)],
];
/// Stencils of the same derivatives by other points, for their error.
const CHECKS: [&[(f64, f64)]; 4] = [
    &[(-2.0, -0.25), (2.0, 0.25)],
    &[(-3.0, -1.0 / 60.0), (-2.0, 0.15), (-1.0, -0.75), (1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0)],
    &[(0.0, -0.5), (2.0, 0.5)],
    &[(0.0, -137.0 / 60.0), (1.0, 5.0), (2.0, -5.0), (3.0, 10.0 / 3.0), (4.0, -1.25), (5.0, 0.2)],
];
/// Lengths of steps that are tried, relative to the number.
const STEPS: [f64; 6] = [0.02, 0.005, 1.25e-3, 3e-4, 8e-5, 2e-5];
/// Lengths of steps for a number that is zero, in its units: no parts of a turn or of a period, after which a train looks the same.
const STEPS_AT_ZERO: [f64; 6] = [0.37, 7.3e-3, 1.1e-4, 1.3e-6, 1.7e-8, 1.9e-10];
/// Largest relative error of a derivative.
const EXACT: f64 = 1e-11;
/// Roundings of a number of the train, in units of its last place.
const ROUNDED: f64 = 32.0 * f64::EPSILON;

/// Train with another value of the number.
struct Neighbour {
    structure: Structure,
    /// Data equal in all trains of one shape: kinds and counts.
    shape: Vec<u64>,
    /// Numbers on which the motion depends linearly.
    numbers: Numbers,
    /// Other numbers: frequency, masses, directions, switching times.
    bent: Numbers,
    /// Frequencies, and the period of the run, in units of the clock's.
    ratios: Vec<(f64, f64)>,
}

/// Numbers of a train, each with the scale of its rounding: the largest number in its computation. A cosine of a right angle is zero within
/// the rounding of one.
#[derive(Default)]
struct Numbers {
    values: Vec<f64>,
    sizes: Vec<f64>,
}

impl Numbers {
    /// Adds numbers that are computed together from some as large as `size`.
    fn sized(&mut self, group: impl IntoIterator<Item = f64>, size: f64) {
        self.values.extend(group);
        self.sizes.resize(self.values.len(), size.abs());
    }

    /// Adds numbers that are computed together.
    fn extend<'n>(&mut self, group: impl IntoIterator<Item = &'n f64> + Clone) {
        let size = group.clone().into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        self.sized(group.into_iter().copied(), size);
    }

    /// Adds numbers that are computed separately.
    fn push(&mut self, numbers: impl IntoIterator<Item = f64>) {
        numbers.into_iter().for_each(|number| self.sized([number], number));
    }
}

impl Simulation {
    /// Returns the derivative of the train by the number at `pointer` of its scene, a JSON pointer. It is a difference of the assembled
    /// train, of an order and a step with a relative error below 1e-10, and exact for linear dependence.
    ///
    /// # Errors
    /// [`SimulationError::Missing`] if there is no such number, or it is a whole number. Also if the train does not depend on it or changes
    /// its shape there, and if frequencies lose their common cycle. [`SimulationError::Scene`] if no train has a neighbouring value.
    pub fn variation(&self, pointer: &str) -> Result<Variation, SimulationError> {
        self.variation_by(&Parameter::new(self.resolved(), &[pointer]).map_err(|reason| self.missing(reason))?)
    }

    /// Returns the variation for numbers that move together, by the value of the first.
    ///
    /// # Errors
    /// Errors of [`variation`](Self::variation).
    pub fn variation_by(&self, parameter: &Parameter) -> Result<Variation, SimulationError> {
        let pointer = parameter.pointer();
        let Some(value) = self.resolved().pointer(pointer).and_then(Value::as_f64) else {
            return Err(self.missing(format!("there is no number at {pointer:?}")));
        };
        let scene = Scene::from_value(self.resolved().clone(), &self.name)?;
        self.variation_at(&scene, parameter, value)
    }

    /// Returns the variation at `value`, from trains that `scene` builds around it: this simulation's scene, except for the parameter.
    ///
    /// # Errors
    /// Errors of [`variation`](Self::variation).
    pub fn variation_at(&self, scene: &Scene, parameter: &Parameter, value: f64) -> Result<Variation, SimulationError> {
        let pointer = parameter.pointer();
        let at = |value: f64| -> Result<Neighbour, SimulationError> {
            let built = parameter.build(scene, value)?;
            let period = built.run.period;
            let structure = self.clocked(built.spec)?;
            let omega = structure.clock().omega();
            let spec = structure.spec();
            let mut ratios: Vec<(f64, f64)> = frequencies(spec).into_iter().map(|w| (w, w / omega)).collect();
            ratios.extend(period.map(|period| std::f64::consts::TAU / period).map(|w| (w, w / omega)));
            let (mut shape, mut numbers, mut bent) = (Vec::new(), Numbers::default(), Numbers::default());
            if omega > 0.0 {
                bent.push([omega, omega.recip()]);
            }
            if let Some(inverse) = spec.mass.clone().try_inverse() {
                bent.extend(&inverse);
                // Effective masses of the contacts: factors in impacts and in contacts at rest.
                let direction = |c: &ContactSpec| DVector::from_column_slice(&c.direction);
                bent.push(spec.contacts.iter().map(direction).map(|g| g.dot(&(&inverse * &g)).recip()));
            }
            flatten(spec, &mut shape, &mut numbers, &mut bent);
            shape.push(ratios.len() as u64);
            Ok(Neighbour { shape, numbers, bent, ratios, structure })
        };
        let here = at(value)?;
        let (mut fault, mut depends, mut reshapes) = (None, true, false);
        for step in if value == 0.0 { STEPS_AT_ZERO } else { STEPS.map(|step| step * value.abs()) } {
            // Both sides first, then one, up or down.
            for (form, sign) in [(0, 1.0), (1, 1.0), (2, 1.0), (2, -1.0), (3, 1.0), (3, -1.0)] {
                let neighbours = |stencil: &[(f64, f64)]| -> Result<Vec<(f64, Neighbour)>, SimulationError> {
                    let length = sign * step;
                    stencil.iter().map(|(steps, weight)| Ok((weight / length, at(value + steps * length)?))).collect()
                };
                let (found, check) = match (neighbours(STENCILS[form]), neighbours(CHECKS[form])) {
                    (Ok(found), Ok(check)) => (found, check),
                    (Err(SimulationError::Scene(error)), _)
                        if error.faults.iter().any(|f| f.pointer.starts_with("/run/period")) =>
                    {
                        return Err(self.parts(pointer, &here));
                    }
                    (Err(SimulationError::Scene(error)), _)
                        if error.faults.iter().any(|f| f.allowed.starts_with("a whole number")) =>
                    {
                        return Err(
                            self.missing(format!("{pointer} is a whole number: the motion has no derivative with it"))
                        );
                    }
                    (Err(error), _) | (_, Err(error)) => {
                        fault.get_or_insert(error);
                        continue;
                    }
                };
                if found.iter().chain(&check).any(|(_, other)| other.shape != here.shape) {
                    reshapes = true;
                    continue;
                }
                self.keeps_ratios(pointer, &here, &found[found.len() - 1].1)?;
                if STENCILS[form].len() == 2 && found.iter().any(|(_, other)| other.bent.values != here.bent.values) {
                    continue;
                }
                let (mut is_exact, mut moves) = (true, false);
                for of in [(|n| &n.numbers) as fn(&Neighbour) -> &Numbers, |n| &n.bent] {
                    let slope = |list: &[(f64, Neighbour)], i: usize| {
                        list.iter().map(|(w, n)| w * of(n).values[i]).sum::<f64>()
                    };
                    for (i, size) in of(&here).sizes.iter().enumerate() {
                        let (a, b, rounded) = (slope(&found, i), slope(&check, i), ROUNDED * size / step);
                        is_exact &= (a - b).abs() <= EXACT * a.abs() + rounded;
                        moves |= a.abs() > rounded;
                    }
                }
                depends = moves;
                if depends && is_exact {
                    return Ok(Variation::new(found.into_iter().map(|(w, n)| (w, n.structure)).collect()));
                }
            }
        }
        Err(match fault {
            _ if !depends => self.missing(format!("nothing of the train depends on {pointer}")),
            Some(fault) if !reshapes => fault,
            _ => self.missing(format!("the train changes its shape at this value of {pointer}: it has no derivative")),
        })
    }

    /// Returns an error for numbers that change one frequency and not the others.
    fn keeps_ratios(&self, pointer: &str, here: &Neighbour, there: &Neighbour) -> Result<(), SimulationError> {
        let is_kept = here.ratios.iter().zip(&there.ratios).all(|(a, b)| (a.1 - b.1).abs() <= 1e-12 * a.1.abs());
        if is_kept { Ok(()) } else { Err(self.parts(pointer, here)) }
    }

    /// Returns the error for such a number.
    fn parts(&self, pointer: &str, here: &Neighbour) -> SimulationError {
        let mut all: Vec<f64> = here.ratios.iter().map(|(w, _)| *w).collect();
        all.sort_by(f64::total_cmp);
        all.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * b.abs());
        let all = all.iter().map(|w| format!("{w}")).collect::<Vec<_>>().join(", ");
        let unit = if self.dimensionless { "" } else { " rad/s" };
        self.missing(format!(
            "{pointer} alone changes the frequency of one part of the forcing (of {all}{unit}; a fixed period of the run counts as one) and \
             not of the others: they have no common cycle then; vary them together"
        ))
    }
}

/// Returns all frequencies of the forcing, rad/s, and the rates at which schedules repeat.
fn frequencies(spec: &Spec) -> Vec<f64> {
    let mut all: Vec<f64> = spec.load_harmonics.iter().map(|l| l.omega).collect();
    all.extend(spec.contacts.iter().flat_map(ContactSpec::errors).flatten().map(|h| h.omega));
    let schedules = spec.contacts.iter().flat_map(ContactSpec::schedules);
    for schedule in schedules.chain(spec.load_schedules.iter().map(|l| &l.factor)) {
        match schedule {
            Stiffness::Harmonic { harmonics, .. } => all.extend(harmonics.iter().map(|h| h.omega)),
            Stiffness::Periodic { period, .. } => all.push(std::f64::consts::TAU / period),
            Stiffness::Constant(_) | Stiffness::Listed { .. } => {}
        }
    }
    all
}

fn waves(harmonics: &[Harmonic], numbers: &mut Numbers) -> u64 {
    for h in harmonics {
        numbers.sized([h.amplitude * libm::cos(h.phase), h.amplitude * libm::sin(h.phase)], h.amplitude);
    }
    harmonics.len() as u64
}

/// Adds the numbers of a stiffness, or of the factor of a load; returns its kind and their count.
fn follow(schedule: &Stiffness, numbers: &mut Numbers, bent: &mut Numbers) -> [u64; 2] {
    match schedule {
        Stiffness::Constant(k) => {
            numbers.push([*k]);
            [0, 0]
        }
        Stiffness::Harmonic { mean, harmonics } => {
            numbers.push([*mean]);
            [1, waves(harmonics, numbers)]
        }
        Stiffness::Periodic { period, origin, pieces } => {
            bent.sized([origin / period], 1.0);
            bent.push(pieces.iter().map(|p| p.start));
            let largest = pieces.iter().fold(0.0, |m: f64, p| m.max(p.value.abs()));
            numbers.sized(pieces.iter().flat_map(|p| [p.value, p.slope * period]), largest);
            [2, pieces.len() as u64]
        }
        Stiffness::Listed { times, values, slopes } => {
            bent.push(times.iter().flatten().copied());
            numbers.extend(values);
            bent.push(slopes.iter().copied());
            [3, times.len() as u64]
        }
    }
}

/// Adds the shape of a train and its numbers in a fixed order: those on which the motion depends linearly, and the others.
fn flatten(spec: &Spec, shape: &mut Vec<u64>, numbers: &mut Numbers, bent: &mut Numbers) {
    bent.extend(spec.mass.iter());
    numbers.extend(&spec.damping);
    numbers.extend(&spec.stiffness);
    numbers.extend(&spec.load);
    shape.extend([spec.freedoms.len() as u64, spec.load_harmonics.len() as u64, spec.contacts.len() as u64]);
    for l in &spec.load_harmonics {
        let parts = l.vector.iter().flat_map(|f| [f * libm::cos(l.phase), f * libm::sin(l.phase)]);
        numbers.sized(parts, l.vector.iter().fold(0.0, |m: f64, f| m.max(f.abs())));
    }
    shape.push(spec.load_schedules.len() as u64);
    for l in &spec.load_schedules {
        numbers.extend(&l.vector);
        shape.extend(follow(&l.factor, numbers, bent));
    }
    for c in &spec.contacts {
        bent.extend(&c.direction);
        numbers.push([c.error_offset, c.half_backlash]);
        numbers.push(c.back.iter().map(|back| back.error_offset));
        shape.extend(c.errors().map(|error| waves(error, numbers)));
        shape.extend(c.schedules().flat_map(|schedule| follow(schedule, numbers, bent)));
        match c.law {
            Law::Bilateral(l) | Law::KelvinVoigt(l, Release::Deflection) => numbers.push([l.damping]),
            Law::KelvinVoigt(l, Release::Force) => {
                numbers.push([l.damping]);
                // Without damping the contact opens by its deflection.
                shape.push(u64::from(l.damping > 0.0));
            }
            Law::Power(l) => {
                numbers.push([l.hysteresis, l.speed_floor]);
                shape.extend([l.exponent.value().to_bits(), u64::from(l.hysteresis > 0.0)]);
            }
            Law::Rigid(l) => match l.restitution {
                Restitution::Constant(e) => {
                    numbers.push([e]);
                    shape.push(u64::from(e > 0.0));
                }
                // Factor of the power of v, and the value if it is constant.
                law @ Restitution::Power { exponent, smallest_speed, .. } => {
                    bent.push([law.at(smallest_speed) * libm::pow(smallest_speed, exponent), law.at(0.0)]);
                    bent.push([exponent, smallest_speed]);
                    shape.push(2);
                }
                // Slopes of the lines and their values at v = 0.
                Restitution::Table { points, count } => {
                    let points = &points[..count];
                    bent.push(points.as_flattened().iter().copied());
                    let slope = |line: &[[f64; 2]]| (line[1][1] - line[0][1]) / (line[1][0] - line[0][0]);
                    bent.push(points.windows(2).flat_map(|line| [slope(line), line[0][1] - slope(line) * line[0][0]]));
                    shape.extend([3, count as u64]);
                }
            },
        }
    }
}
