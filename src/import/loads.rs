//! Speed, torques and couplings of a gearbox, and the order of its shafts.

use std::collections::VecDeque;

use super::{
    gearbox::Writer,
    ledger::Source,
    quantity::{Unit, given},
    writer::BEARING,
};

/// Given speed: component, rev/min, origin.
pub(super) type Speed = (usize, f64, String);

impl Writer<'_, '_> {
    /// Returns the speed of the one shaft whose speed is used; other speeds become a remark.
    pub fn speed(&mut self) -> Option<Speed> {
        let mut found: Vec<Speed> = Vec::new();
        for i in 0..self.model.components.len() {
            let component = self.component(i);
            if let Some((speed, from)) = given(&mut self.ledger, component, "rotational_speed", Unit::Speed) {
                found.push((i, self.sense(i) * speed, from));
            }
        }
        let defines = |speed: &&Speed| self.model.components[speed.0].flag("defines_speed") == Some(true);
        let chosen = found.iter().find(defines).or_else(|| found.iter().find(|speed| speed.1 != 0.0)).cloned();
        if let Some(chosen) = &chosen {
            let body = self.bodies.of(chosen.0);
            let others: Vec<String> =
                found.iter().filter(|speed| self.bodies.of(speed.0) != body).map(|speed| speed.2.clone()).collect();
            if !others.is_empty() {
                self.ledger.notes.push(format!(
                    "speeds follow from the one of {}; not used: {}",
                    chosen.2,
                    others.join("; ")
                ));
            }
        }
        chosen
    }

    /// Returns the sense of a shaft's axis relative to that of the gearbox, 1 or -1. Axes across it are a fault.
    fn sense(&mut self, i: usize) -> f64 {
        let component = self.component(i);
        let axis = component.attributes.get("u_axis_vector").and_then(|axis| axis.value.numbers());
        match axis.as_deref() {
            Some([u, v, w]) if libm::hypot(*v, *w) > 1e-6 * u.abs() => {
                let place = format!("{}: u_axis_vector", component.place());
                self.ledger.fault(
                    &place,
                    format!("{u} {v} {w}"),
                    "a shaft along u",
                    "leave it out: Flank has parallel shafts",
                );
                1.0
            }
            Some([u, ..]) if *u < 0.0 => -1.0,
            _ => 1.0,
        }
    }

    /// Returns the torques about the axis by shaft: component, N m (none if the file leaves it open), origin.
    pub fn torques(&mut self) -> Vec<(usize, Option<f64>, String)> {
        let mut all = Vec::new();
        for i in 0..self.model.components.len() {
            if self.component(i).kind != "shaft" {
                continue;
            }
            for load in self.parts_of(i, "external_load") {
                let load = self.component(load);
                let sense = self.sense(i);
                let torque = given(&mut self.ledger, load, "torque_around_u_axis", Unit::Torque);
                let torque = torque.map(|(torque, from)| (sense * torque, from));
                let defines = load.flag("defines_torque");
                all.push((i, torque.filter(|_| defines != Some(false)), load.place(), defines == Some(true)));
            }
        }
        let strict = all.iter().any(|load| load.3);
        all.into_iter()
            .map(|(shaft, torque, place, defines)| match torque.filter(|_| defines || !strict) {
                Some((torque, from)) => (shaft, Some(torque), from),
                None => (shaft, None, place),
            })
            .collect()
    }

    /// Lists the bodies of the scene, from the driven one on.
    pub fn order(&mut self, input: Option<usize>, torques: &[(usize, Option<f64>, String)]) {
        let mut ends: Vec<[usize; 2]> =
            self.meshes.iter().map(|(_, gears)| gears.map(|gear| self.body_of_gear(gear))).collect();
        for stage in &self.stages {
            let members = [self.body_of_gear(stage.sun), self.bodies.of(stage.carrier), self.body_of_gear(stage.ring)];
            ends.extend([[members[0], members[1]], [members[1], members[2]]]);
        }
        ends.extend(self.bodies.joints.iter().map(|joint| joint.ends.map(|i| self.bodies.of(i))));
        let start = input.or_else(|| torques.iter().find(|t| t.1.is_some()).map(|t| t.0)).map(|i| self.bodies.of(i));
        let mut order: Vec<usize> = Vec::new();
        let mut waiting: VecDeque<usize> = start.into_iter().chain(ends.iter().flatten().copied()).collect();
        let reached = waiting.len();
        for _ in 0..reached {
            let Some(first) = waiting.pop_front() else { break };
            let mut front = VecDeque::from([first]);
            while let Some(body) = front.pop_front() {
                if order.contains(&body) {
                    continue;
                }
                order.push(body);
                let next =
                    ends.iter().filter(|pair| pair.contains(&body)).map(|[a, b]| if *a == body { *b } else { *a });
                front.extend(next.collect::<Vec<_>>());
            }
        }
        for body in order {
            let name = self.name(body);
            let is_taken = self.shafts.iter().any(|(_, other)| *other == name);
            let name = if is_taken { format!("{name} [{}]", self.component(body).id) } else { name };
            self.shafts.push((body, name));
        }
    }

    pub fn body_of_gear(&self, gear: usize) -> usize {
        self.shaft_of.get(&gear).map_or(gear, |shaft| self.bodies.of(*shaft))
    }

    /// Returns the name of a body: that of a shaft with gears or loads, else of its first shaft.
    fn name(&self, body: usize) -> String {
        let parts: Vec<usize> = self.bodies.parts(body).collect();
        let carries = |part: &&usize| {
            self.shaft_of.values().any(|shaft| shaft == *part) || !self.parts_of(**part, "external_load").is_empty()
        };
        let is_pin = |part: &&usize| self.bodies.pins.contains(*part);
        let shaft = parts
            .iter()
            .find(carries)
            .or_else(|| parts.iter().find(|part| self.component(**part).kind == "shaft" && !is_pin(part)));
        let component = self.component(*shaft.unwrap_or(&parts[0]));
        if component.name.is_empty() { format!("{} {}", component.kind, component.id) } else { component.name.clone() }
    }

    /// Returns the index of a body in the list of shafts.
    pub fn index(&self, component: usize) -> usize {
        let body = self.bodies.of(component);
        self.shafts.iter().position(|(own, _)| *own == body).unwrap_or(0)
    }

    /// Writes the speed and the torques, and the shaft whose torque balances the others.
    pub fn write_loads(&mut self, speed: Option<Speed>, torques: &[(usize, Option<f64>, String)]) {
        for i in 0..self.shafts.len() {
            let (body, name) = self.shafts[i].clone();
            self.ledger.plain(&format!("/train/shafts/{i}/name"), name);
            if self.bodies.stands(body) {
                self.ledger.plain(&format!("/train/shafts/{i}/fixed"), true);
            }
        }
        match speed {
            Some((shaft, rpm, from)) => {
                let pointer = format!("/train/shafts/{}/speed_rpm", self.index(shaft));
                self.ledger.write(&pointer, rpm, Source::File, from);
            }
            None => self.ledger.ask(
                "/train/shafts/0/speed_rpm",
                "no rotational_speed of a shaft in the file",
                "the speed of one shaft, rev/min",
            ),
        }
        let known: Vec<usize> =
            (0..self.shafts.len()).filter(|i| torques.iter().any(|t| t.1.is_some() && self.index(t.0) == *i)).collect();
        let open = torques.iter().find(|t| t.1.is_none() && !known.contains(&self.index(t.0))).map(|t| self.index(t.0));
        let moves = |i: &usize| !self.bodies.stands(self.shafts[*i].0);
        let rest =
            open.or_else(|| (1..self.shafts.len()).rev().find(|i| moves(i) && (!known.contains(i) || known.len() > 1)));
        for i in known {
            let of_shaft: Vec<_> = torques.iter().filter(|t| self.index(t.0) == i && t.1.is_some()).collect();
            let sum: f64 = of_shaft.iter().filter_map(|t| t.1).sum();
            let from = of_shaft.iter().map(|t| t.2.as_str()).collect::<Vec<_>>().join("; ");
            if Some(i) == rest {
                self.ledger
                    .notes
                    .push(format!("{}: the torque follows from the balance; not used: {from}", self.shafts[i].1));
            } else {
                self.ledger.write(&format!("/train/shafts/{i}/torque_nm"), sum, Source::File, from);
            }
        }
        if !torques.iter().any(|t| t.1.is_some()) {
            self.ledger.ask(
                "/train/shafts/0/torque_nm",
                "no torque_around_u_axis of an external_load in the file",
                "the driving torque, N m",
            );
        }
        if let Some(rest) = rest {
            self.ledger.write(
                &format!("/train/shafts/{rest}/torque_nm"),
                "balance",
                Source::Rule,
                "what keeps the mean speed",
            );
        }
    }

    /// Writes the compliant couplings.
    pub fn write_joints(&mut self) {
        for i in 0..self.bodies.joints.len() {
            let (component, ends) = (self.bodies.joints[i].component, self.bodies.joints[i].ends);
            let pointer = format!("/train/couplings/{i}");
            let names = ends.map(|end| self.shafts[self.index(end)].1.clone());
            self.ledger.plain(
                &format!("{pointer}/name"),
                if component.name.is_empty() { component.place() } else { component.name.clone() },
            );
            self.ledger.plain(&format!("{pointer}/shafts"), names.to_vec());
            if let Some((torsion, from)) = given(&mut self.ledger, component, "rotational_stiffness", Unit::Torsion) {
                self.ledger.write(&format!("{pointer}/rotation/stiffness_nm_per_rad"), torsion, Source::File, from);
            }
            self.ledger.usual(&format!("{pointer}/rotation/damping_ratio"), BEARING, "damping ratio of couplings");
        }
    }
}
