//! A stage into the common form.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{DMatrix, DVector};

use super::{Freedoms, Planetary};
use crate::system::{ContactSpec, Spec};
use crate::train::Mesh;
use crate::train::error::{TrainError, check};

/// The matrices in all freedoms.
struct Whole {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    load: DVector<f64>,
}

impl Planetary {
    /// The stage in the common form. Contacts come sun meshes first, then ring meshes: `sun-planet 1` …,
    /// `ring-planet 1` …; in the in-phase reduction `sun-planet` and `ring-planet`.
    ///
    /// With `q_all = P q` the matrices are `Pᵀ M P` and so on, the directions `Pᵀ g`.
    ///
    /// # Errors
    /// [`TrainError`] for values outside their ranges, unknown freedoms, planets that are not alike in the in-phase
    /// reduction, a standing stage with varying meshes, or, if strict, any warning.
    pub fn assemble(&self, freedoms: &Freedoms) -> Result<Spec, TrainError> {
        self.check()?;
        let in_phase = *freedoms == Freedoms::InPhase;
        if in_phase {
            self.check_in_phase()?;
        }
        let (names, p) = self.projection(freedoms)?;
        let whole = self.whole();
        // One planet's share of everything: the whole divided by N, its one contact kept whole.
        let share = if in_phase { (self.planets.len() as f64).recip() } else { 1.0 };
        let reduce = |matrix: &DMatrix<f64>| share * p.tr_mul(matrix) * &p;
        let symmetric = |matrix: DMatrix<f64>| 0.5 * (&matrix + matrix.transpose());
        let frequency = self.mesh_frequency();
        Ok(Spec {
            mass: symmetric(reduce(&whole.mass)),
            damping: reduce(&whole.damping),
            stiffness: symmetric(reduce(&whole.stiffness)),
            load: (share * p.tr_mul(&whole.load)).iter().copied().collect(),
            load_harmonics: Vec::new(),
            contacts: self.contacts(&p, in_phase, frequency)?,
            omega: (frequency > 0.0).then_some(TAU * frequency),
            freedoms: names,
        })
    }

    /// Index of the carrier's first freedom among all.
    fn carrier_row(&self) -> usize {
        3 + 3 * self.planets.len()
    }

    fn whole(&self) -> Whole {
        let carrier = self.carrier_row();
        let n = carrier + 6;
        let mut mass = DMatrix::zeros(n, n);
        let mut damping = DMatrix::zeros(n, n);
        let mut stiffness = DMatrix::zeros(n, n);
        let central = [(0, &self.sun), (carrier, &self.carrier), (carrier + 3, &self.ring)];
        let planets = self.planets.iter().enumerate().map(|(i, planet)| (3 + 3 * i, &planet.body));
        for (row, body) in central.into_iter().chain(planets) {
            let inertias = [body.mass, body.mass, body.rotary_mass];
            inertias.iter().enumerate().for_each(|(k, m)| mass[(row + k, row + k)] = *m);
            stiffness[(row + 2, row + 2)] += body.rotation.stiffness;
            damping[(row + 2, row + 2)] += body.rotation.coefficient(body.rotary_mass);
        }
        for (row, body) in central {
            for k in row..row + 2 {
                stiffness[(k, k)] += body.translation.stiffness;
                damping[(k, k)] += body.translation.coefficient(body.mass);
            }
        }
        for (i, planet) in self.planets.iter().enumerate() {
            let bearing = planet.body.translation;
            let c = bearing.coefficient(planet.body.mass);
            for direction in self.bearing_directions(i) {
                let outer = &direction * direction.transpose();
                stiffness += bearing.stiffness * &outer;
                damping += c * outer;
            }
        }
        if self.gyroscopic {
            self.turn(&mut damping, &mut stiffness);
        }
        let mut load = DVector::zeros(n);
        load[2] = self.input_torque() / self.sun.radius;
        load[carrier + 2] = -self.load.total_output(self.rpm) / self.carrier.radius;
        (0..self.planets.len()).for_each(|i| load[5 + 3 * i] = self.load.planet_drag);
        Whole { mass, damping, stiffness, load }
    }

    /// Radial and tangential stretch of a planet's bearing in all freedoms.
    fn bearing_directions(&self, i: usize) -> [DVector<f64>; 2] {
        let carrier = self.carrier_row();
        let (sin, cos) = libm::sincos(self.planets[i].position);
        let mut radial = DVector::zeros(carrier + 6);
        let mut tangential = radial.clone();
        radial[3 + 3 * i] = 1.0;
        radial[carrier] = -cos;
        radial[carrier + 1] = -sin;
        tangential[4 + 3 * i] = 1.0;
        tangential[carrier] = sin;
        tangential[carrier + 1] = -cos;
        tangential[carrier + 2] = -1.0;
        [radial, tangential]
    }

    /// Coriolis and centripetal terms of the turning frame, for every body's pair of in-plane freedoms.
    fn turn(&self, damping: &mut DMatrix<f64>, stiffness: &mut DMatrix<f64>) {
        let omega = self.carrier_speed();
        let carrier = self.carrier_row();
        let central = [(0, &self.sun), (carrier, &self.carrier), (carrier + 3, &self.ring)];
        let planets = self.planets.iter().enumerate().map(|(i, planet)| (3 + 3 * i, &planet.body));
        for (row, body) in central.into_iter().chain(planets) {
            damping[(row, row + 1)] -= 2.0 * body.mass * omega;
            damping[(row + 1, row)] += 2.0 * body.mass * omega;
            stiffness[(row, row)] -= body.mass * omega * omega;
            stiffness[(row + 1, row + 1)] -= body.mass * omega * omega;
        }
    }

    /// `∂δ/∂q` of planet i's sun mesh and ring mesh in all freedoms.
    fn mesh_directions(&self, i: usize) -> [DVector<f64>; 2] {
        let carrier = self.carrier_row();
        let psi = self.planets[i].position;
        let direction = |row: usize, line: f64, alpha: f64, side: f64| {
            let mut g = DVector::zeros(carrier + 6);
            g[row] = -libm::sin(line);
            g[row + 1] = libm::cos(line);
            g[row + 2] = 1.0;
            g[3 + 3 * i] = -side * libm::sin(alpha);
            g[4 + 3 * i] = -libm::cos(alpha);
            g[5 + 3 * i] = side;
            g
        };
        let (sun, ring) = (self.sun_pressure_angle, self.ring_pressure_angle);
        [direction(0, psi - sun, sun, 1.0), direction(carrier + 3, psi + ring, ring, -1.0)]
    }

    fn contacts(&self, p: &DMatrix<f64>, in_phase: bool, frequency: f64) -> Result<Vec<ContactSpec>, TrainError> {
        let planets = if in_phase { &self.planets[..1] } else { &self.planets[..] };
        let mut contacts = Vec::with_capacity(2 * planets.len());
        for (kind, stem) in ["sun-planet", "ring-planet"].into_iter().enumerate() {
            for (i, planet) in planets.iter().enumerate() {
                let mesh: &Mesh = if kind == 0 { &planet.sun_mesh } else { &planet.ring_mesh };
                let direction = p.tr_mul(&self.mesh_directions(i)[kind]).iter().copied().collect();
                let name = if in_phase { stem.to_string() } else { format!("{stem} {}", i + 1) };
                contacts.push(mesh.contact(name, direction, frequency)?);
            }
        }
        Ok(contacts)
    }

    fn check(&self) -> Result<(), TrainError> {
        check("number of planets", self.planets.len() as f64, !self.planets.is_empty(), ">= 1")?;
        check("rpm", self.rpm, self.rpm >= 0.0, ">= 0")?;
        for (name, teeth) in [("sun", self.teeth.sun), ("planet", self.teeth.planet), ("ring", self.teeth.ring)] {
            check(format_args!("{name} teeth"), f64::from(teeth), teeth > 0, ">= 1")?;
        }
        for (name, angle) in [("sun", self.sun_pressure_angle), ("ring", self.ring_pressure_angle)] {
            let name = format_args!("{name} mesh: pressure angle");
            check(name, angle, (0.0..FRAC_PI_2).contains(&angle), "in [0, pi/2)")?;
        }
        check("output torque", self.load.total_output(self.rpm), true, "finite")?;
        check("planet drag", self.load.planet_drag, true, "finite")?;
        self.sun.check("sun")?;
        self.ring.check("ring")?;
        self.carrier.check("carrier")?;
        for (i, planet) in self.planets.iter().enumerate() {
            check(format_args!("planet {}: position", i + 1), planet.position, true, "finite")?;
            planet.body.check(format_args!("planet {}", i + 1))?;
        }
        if self.strict {
            let warnings = self.warnings();
            if !warnings.is_empty() {
                return Err(TrainError::Implausible(warnings));
            }
        }
        Ok(())
    }

    /// Alike and equally spaced planets: only then is in-phase motion a motion of the whole stage.
    fn check_in_phase(&self) -> Result<(), TrainError> {
        let count = self.planets.len() as f64;
        let first = &self.planets[0];
        let differs = |(i, planet): (usize, &super::Planet)| {
            let turn = (planet.position - first.position) / TAU - i as f64 / count;
            let alike = planet.body == first.body
                && planet.sun_mesh == first.sun_mesh
                && planet.ring_mesh == first.ring_mesh
                && (turn - turn.round()).abs() < 1.0e-9;
            !alike
        };
        match self.planets.iter().enumerate().find(|&planet| differs(planet)) {
            Some((i, _)) => Err(TrainError::NotInPhase { planet: i + 1 }),
            None => Ok(()),
        }
    }
}
