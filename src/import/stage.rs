//! Planetary stages, written into the scene.

use super::{
    gearbox::Writer,
    ledger::Source,
    pair::Pair,
    quantity::{Unit, number},
};

/// Difference from equal spacing below which planets are equally spaced, degrees.
const SAME_ANGLE: f64 = 1e-6;

impl Writer<'_, '_> {
    /// Writes a planetary stage.
    pub fn write_stage(&mut self, s: usize) {
        let pointer = format!("/train/stages/{s}");
        let (component, planets) = (self.stages[s].component, self.stages[s].planets.clone());
        let (sun, ring, carrier, meshes) =
            (self.stages[s].sun, self.stages[s].ring, self.stages[s].carrier, self.stages[s].meshes);
        let stage = self.component(component);
        self.ledger
            .plain(&format!("{pointer}/name"), if stage.name.is_empty() { stage.place() } else { stage.name.clone() });
        self.ledger.plain(&format!("{pointer}/carrier"), self.shafts[self.index(carrier)].1.clone());
        for (gear, key) in [(sun, "sun"), (ring, "ring")] {
            self.ledger.plain(&format!("{pointer}/{key}/shaft"), self.shafts[self.index_of_gear(gear)].1.clone());
        }
        self.write_positions(s, &pointer);
        let gears = [sun, planets[0][1], ring];
        let keys = ["sun", "planet", "ring"].map(|key| format!("{pointer}/{key}"));
        let read = [0, 1, 2].map(|k| self.read_teeth(gears[k], &keys[k]));
        let [Some(sun_teeth), Some(planet_teeth), Some(ring_teeth)] = &read else { return };
        for [_, planet] in &planets[1..] {
            let other = self.component(*planet);
            if number(&mut self.ledger, other, "number_of_teeth", Unit::One).map(f64::abs)
                != Some(f64::from(planet_teeth.number))
            {
                let place = self.component(component).place();
                self.ledger.fault(
                    &place,
                    format!("other teeth of {}", other.place()),
                    "equal planets",
                    "mend the file",
                );
            }
        }
        let pair = |k: usize, key: &str| Pair {
            stage: self.component(meshes[k]),
            teeth: if k == 0 { [sun_teeth, planet_teeth] } else { [planet_teeth, ring_teeth] },
            gears: [keys[k].clone(), keys[k + 1].clone()],
            rack: format!("{pointer}/rack"),
            mesh: format!("{pointer}/{key}"),
        };
        let (outer, inner) = (pair(0, "sun_mesh"), pair(1, "ring_mesh"));
        let (Some(rack), Some(_)) = (outer.rack(&mut self.ledger, true), inner.rack(&mut self.ledger, false)) else {
            return;
        };
        let [x_sun, x_planet] = outer.shifts(&mut self.ledger, &rack, [None; 2]);
        let [_, x_ring] = inner.shifts(&mut self.ledger, &rack, [Some(x_planet), None]);
        if let Some((distance, from)) = outer.distance(&mut self.ledger) {
            self.ledger.write(&format!("{pointer}/centre_distance_m"), distance, Source::File, from);
        }
        outer.write_mesh(&mut self.ledger, &rack, [x_sun, x_planet]);
        inner.write_mesh(&mut self.ledger, &rack, [x_planet, x_ring]);
        self.write_gear(sun, sun_teeth, (x_sun, rack.helix_angle), &keys[0]);
        self.write_gear(planets[0][1], planet_teeth, (x_planet, rack.helix_angle), &keys[1]);
        let ring_body = self.body_of_gear(ring);
        if !self.bodies.stands(ring_body) {
            self.write_gear(ring, ring_teeth, (x_ring, rack.helix_angle), &keys[2]);
        }
        let parts: Vec<usize> = self.bodies.parts(planets[0][0]).collect();
        self.write_bearings(&keys[1], &parts, true);
    }

    /// Writes the positions of the planets, from the axis w towards −v: by their shafts, by the angles of their stages, or equally spaced.
    fn write_positions(&mut self, s: usize, pointer: &str) {
        let (sun, planets) = (self.stages[s].sun, self.stages[s].planets.clone());
        let axis = self.centre(sun).or_else(|| self.centre(*self.shaft_of.get(&sun)?));
        let of_shaft = |shaft: usize| {
            let ([x, y], [v, w]) = (axis?, self.centre(shaft)?);
            (libm::hypot(v - x, w - y) > 0.0).then(|| libm::atan2(w - y, v - x).to_degrees() - 90.0)
        };
        let of_shafts: Option<Vec<f64>> = planets.iter().map(|[shaft, _]| of_shaft(*shaft)).collect();
        let mut of_stages = Vec::new();
        for [_, gear] in &planets {
            let stage = self.relations("stage").find(|r| {
                let gears = ["gear_1", "gear_2"].map(|role| self.bodies.at(r, role));
                gears.contains(&Some(*gear)) && gears.contains(&Some(sun))
            });
            let stage = stage.and_then(|r| self.bodies.at(r, "stage")).map(|i| &self.model.components[i]);
            of_stages.extend(
                stage
                    .and_then(|stage| number(&mut self.ledger, stage, "rotating_angle_around_neg_u_axis", Unit::Angle))
                    .map(|a| -a),
            );
        }
        let of_stages = Some(of_stages).filter(|angles| angles.len() == planets.len());
        let from = if of_shafts.is_some() {
            "support_vectors of the planet shafts"
        } else {
            "rotating_angle_around_neg_u_axis of the stages"
        };
        let turned = |angle: f64| {
            let angle = angle.rem_euclid(360.0);
            if 360.0 - angle < SAME_ANGLE { 0.0 } else { angle }
        };
        let angles = of_shafts.or(of_stages).map(|angles| {
            let mut angles: Vec<f64> = angles.into_iter().map(turned).collect();
            angles.sort_by(f64::total_cmp);
            angles
        });
        let count = planets.len();
        let equal = |angles: &Vec<f64>| {
            angles.iter().enumerate().all(|(i, a)| (a - 360.0 * i as f64 / count as f64).abs() < SAME_ANGLE)
        };
        match angles {
            Some(angles) if !equal(&angles) => {
                self.ledger.write(&format!("{pointer}/positions_deg"), angles, Source::Rule, from)
            }
            Some(_) => self.ledger.write(
                &format!("{pointer}/planets"),
                count,
                Source::Rule,
                format!("planet_shaft relations, equally spaced by {from}"),
            ),
            None => self.ledger.usual(&format!("{pointer}/planets"), count, "equal spacing of the planets of the file"),
        }
    }
}
