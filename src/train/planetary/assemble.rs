//! Assembly of a stage into the common form.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{DMatrix, DVector};

use super::{Freedoms, Planetary};
use crate::gear::MeshKind;
use crate::system::Spec;
use crate::train::assembly::{Assembly, LineOfAction, Wheel};
use crate::train::drawing::{Drawing, GearDrawing, point, rows};
use crate::train::error::{TrainError, check};

impl Planetary {
    /// Returns the stage in the common form. Contacts come sun meshes first, then ring meshes: `sun-planet 1` …, `ring-planet 1` …; in the
    /// in-phase reduction `sun-planet` and `ring-planet`.
    ///
    /// With `q_all = P q` the matrices are `Pᵀ M P` and so on, the directions `Pᵀ g`.
    ///
    /// # Errors
    /// [`TrainError`] for values outside their ranges, unknown degrees of freedom, unlike planets in the in-phase reduction, or a standing
    /// stage with varying meshes.
    pub fn assemble(&self, freedoms: &Freedoms) -> Result<Spec, TrainError> {
        self.check()?;
        let in_phase = *freedoms == Freedoms::InPhase;
        if in_phase {
            self.check_in_phase()?;
        }
        let (names, p) = self.projection(freedoms)?;
        let frequency = self.mesh_frequency();
        let mut assembly = self.bodies();
        self.meshes(&mut assembly, in_phase, frequency)?;
        // The share of one planet: the whole divided by N, with one whole contact.
        let share = if in_phase { (self.planets.len() as f64).recip() } else { 1.0 };
        let count = self.planets.len();
        let shared =
            if in_phase || count < 2 { vec![] } else { vec![(0..count).collect(), (count..2 * count).collect()] };
        Ok(Spec { shared, ..assembly.reduced(names, &p, share, frequency) })
    }

    /// Returns the drawing of the stage, in the frame of its carrier.
    ///
    /// # Errors
    /// [`TrainError`] for unknown degrees of freedom.
    pub fn drawing(&self, freedoms: &Freedoms) -> Result<Drawing, TrainError> {
        let (names, p) = self.projection(freedoms)?;
        let (carrier, n) = (self.carrier_row(), self.freedoms().len());
        let [sun_cos, ring_cos] = [self.sun_pressure_angle, self.ring_pressure_angle].map(libm::cos);
        let pitch = self.sun.radius / sun_cos;
        let turning = self.rpm * TAU / 60.0 - self.carrier_speed();
        // A tooth is as thick as a space on the pitch circle: its flank is a quarter of a pitch from its middle.
        let teeth = |count: u32| (f64::from(count), FRAC_PI_2 / f64::from(count));
        let gear = |name: String, centre, radius: f64, count: u32, angle: f64, motion| GearDrawing {
            name,
            centre,
            radius,
            teeth: count,
            is_ring: false,
            angle,
            speed: turning * f64::from(self.teeth.sun) / f64::from(count),
            motion,
        };
        let first = &self.planets[0];
        let (z, h) = teeth(self.teeth.sun);
        let angle = first.position - h + TAU * first.sun_mesh.phase / z;
        let sun = rows(n, 0, 0.0, (2, self.sun.radius.recip()));
        let mut gears = vec![gear("sun".to_owned(), [0.0; 2], pitch, self.teeth.sun, angle, sun)];
        let mut points = [Vec::new(), Vec::new()];
        for (i, planet) in self.planets.iter().enumerate() {
            let (z, h) = teeth(self.teeth.planet);
            let centre = point([0.0; 2], self.carrier.radius, planet.position);
            let angle = planet.position + PI - h - TAU * planet.sun_mesh.phase / z;
            let motion = rows(n, 3 + 3 * i, planet.position, (5 + 3 * i, planet.body.radius.recip()));
            let radius = planet.body.radius / sun_cos;
            let own = gear(format!("planet {}", i + 1), centre, radius, self.teeth.planet, angle, motion);
            gears.push(GearDrawing { speed: -own.speed, ..own });
            points[0].push(point([0.0; 2], pitch, planet.position));
            points[1].push(point(centre, planet.body.radius / ring_cos, planet.position));
        }
        let (z, h) = teeth(self.teeth.ring);
        let angle = first.position + h - TAU * first.ring_mesh.phase / z;
        let ring = rows(n, carrier + 3, 0.0, (carrier + 5, self.ring.radius.recip()));
        let own = gear("ring".to_owned(), [0.0; 2], self.ring.radius / ring_cos, self.teeth.ring, angle, ring);
        gears.push(GearDrawing { is_ring: true, speed: -own.speed, ..own });
        let moves = rows(n, carrier, 0.0, (carrier + 2, self.carrier.radius.recip()));
        let own = gear("carrier".to_owned(), [0.0; 2], self.carrier.radius, 0, 0.0, moves);
        gears.push(GearDrawing { speed: 0.0, ..own });
        gears.iter_mut().for_each(|gear| gear.reduce(&p, names.len()));
        if *freedoms == Freedoms::InPhase {
            points.iter_mut().for_each(|points| points.truncate(1));
        }
        Ok(Drawing { gears, points: points.concat() })
    }

    /// Returns the index of the first degree of freedom of the carrier among all.
    fn carrier_row(&self) -> usize {
        3 + 3 * self.planets.len()
    }

    /// Bodies with supports and loads, in all degrees of freedom.
    fn bodies(&self) -> Assembly {
        let carrier = self.carrier_row();
        let mut assembly = Assembly::new(carrier + 6);
        let central = [(0, &self.sun), (carrier, &self.carrier), (carrier + 3, &self.ring)];
        let planets = self.planets.iter().enumerate().map(|(i, planet)| (3 + 3 * i, &planet.body));
        for (row, body) in central.into_iter().chain(planets) {
            assembly.body(row, body);
            assembly.hold(row + 2, body.rotation, body.rotary_mass);
        }
        for ((row, body), name) in central.into_iter().zip(["sun", "carrier", "ring"]) {
            assembly.bearing_at(name, row, body);
        }
        for (i, planet) in self.planets.iter().enumerate() {
            let [radial, tangential] = self.bearing_directions(i);
            let directions = [("radial", radial), ("tangential", tangential)];
            assembly.bearing(&format!("planet {}", i + 1), &directions, planet.body.translation, planet.body.mass);
        }
        if self.gyroscopic {
            self.turn(&mut assembly.damping, &mut assembly.stiffness);
        }
        assembly.load[2] = self.input_torque() / self.sun.radius;
        assembly.load[carrier + 2] = -self.load.total_output(self.rpm) / self.carrier.radius;
        (0..self.planets.len()).for_each(|i| assembly.load[5 + 3 * i] = self.load.planet_drag);
        assembly
    }

    /// Radial and tangential stretch of the bearing of a planet in all degrees of freedom.
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

    /// Adds the Coriolis and centripetal terms of the turning frame, for the in-plane degrees of freedom of every body.
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

    /// Adds the sun meshes, then the ring meshes; of planets in phase those of the first one.
    fn meshes(&self, assembly: &mut Assembly, in_phase: bool, frequency: f64) -> Result<(), TrainError> {
        let carrier = self.carrier_row();
        let planets = if in_phase { &self.planets[..1] } else { &self.planets[..] };
        for kind in [MeshKind::External, MeshKind::Internal] {
            for (i, planet) in planets.iter().enumerate() {
                let own = Wheel::at(3 + 3 * i, planet.position);
                // The sun pushes the planet counter-clockwise about its own centre, and the planet turns clockwise.
                let (stem, mesh, [pinion, wheel], pressure_angle, sense) = match kind {
                    MeshKind::External => {
                        ("sun-planet", &planet.sun_mesh, [Wheel::at(0, 0.0), own], self.sun_pressure_angle, 1.0)
                    }
                    MeshKind::Internal => {
                        let ring = Wheel::at(carrier + 3, 0.0);
                        ("ring-planet", &planet.ring_mesh, [own, ring], self.ring_pressure_angle, -1.0)
                    }
                };
                let line =
                    LineOfAction { kind, pitch: planet.position, pressure_angle, sense, base_helix: self.base_helix };
                let name = if in_phase { stem.to_owned() } else { format!("{stem} {}", i + 1) };
                assembly.mesh(name, &line.direction(pinion, wheel, carrier + 6), mesh, frequency)?;
            }
        }
        Ok(())
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
        Ok(())
    }

    /// Checks that planets are alike and equally spaced: only then is in-phase motion a motion of the whole stage.
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
