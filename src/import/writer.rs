//! Loads, bodies and teeth of a gearbox, written into the scene.

use std::collections::{BTreeMap, VecDeque};

use super::{
    gearbox::Writer,
    ledger::Source,
    quantity::{Unit, given, number},
    teeth::{Data, Pair, Teeth},
};

/// A stiffness of a bearing from which on it counts as rigid, N/m: writers put 1e20 and more.
const RIGID: f64 = 1e15;
/// Usual density, kg/m³.
const STEEL: f64 = 7850.0;
/// Positions of planets closer than this to equal spacing are equally spaced, degrees.
const SAME_ANGLE: f64 = 1e-6;
/// Usual rim of a ring, heights of its teeth.
const RIM: f64 = 2.0;
/// Usual damping ratio of bearings and couplings.
const BEARING: f64 = 0.05;

/// Mass, kg, and moment of inertia about the axis, kg m².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Inertia {
    mass: f64,
    moment: f64,
}

impl Inertia {
    /// A frustum of cones: length, outer and inner radii at its ends, m, density, kg/m³.
    fn of_cone(length: f64, outer: [f64; 2], inner: [f64; 2], density: f64) -> Self {
        let full = |[a, b]: [f64; 2]| Self {
            mass: density * std::f64::consts::PI * length * (a * a + a * b + b * b) / 3.0,
            moment: density
                * std::f64::consts::PI
                * length
                * 0.1
                * (a.powi(4) + a.powi(3) * b + a * a * b * b + a * b.powi(3) + b.powi(4)),
        };
        let (outer, inner) = (full(outer), full(inner));
        Self { mass: (outer.mass - inner.mass).max(0.0), moment: (outer.moment - inner.moment).max(0.0) }
    }

    fn add(&mut self, other: Self, offset: f64) {
        self.mass += other.mass;
        self.moment += other.moment + other.mass * offset * offset;
    }
}

/// The speed that is given: component, rev/min, origin.
pub(super) type Speed = (usize, f64, String);

impl<'m> Writer<'m, '_> {
    /// The one shaft whose speed is given.
    pub fn speed(&mut self) -> Option<Speed> {
        let mut found: Vec<Speed> = Vec::new();
        for i in 0..self.model.components.len() {
            let component = self.component(i);
            if let Some((speed, from)) = given(&mut self.ledger, component, "rotational_speed", Unit::Speed) {
                found.push((i, speed, from));
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

    /// Torques about the axis by shaft: component, N m (none if the file leaves it open), origin.
    pub fn torques(&mut self) -> Vec<(usize, Option<f64>, String)> {
        let mut all = Vec::new();
        for i in 0..self.model.components.len() {
            if self.component(i).kind != "shaft" {
                continue;
            }
            for load in self.parts_of(i, "external_load") {
                let load = self.component(load);
                let torque = given(&mut self.ledger, load, "torque_around_u_axis", Unit::Torque);
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

    fn body_of_gear(&self, gear: usize) -> usize {
        self.shaft_of.get(&gear).map_or(gear, |shaft| self.bodies.of(*shaft))
    }

    /// Name of a body: that of a shaft with gears or loads, else of its first shaft.
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

    /// Place of a body in the list of shafts.
    pub fn index(&self, component: usize) -> usize {
        let body = self.bodies.of(component);
        self.shafts.iter().position(|(own, _)| *own == body).unwrap_or(0)
    }

    /// Speed, torques, and which shaft takes up what is left.
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

    /// Density of a component's material.
    fn density(&mut self, i: usize) -> (f64, bool) {
        let material = self.relations("reference").filter(|r| self.bodies.at(r, "origin") == Some(i));
        let materials: Vec<usize> = material.filter_map(|r| self.bodies.at(r, "referenced")).collect();
        let found = materials
            .into_iter()
            .find_map(|m| number(&mut self.ledger, &self.model.components[m], "density", Unit::Density));
        found.filter(|d| *d > 0.0).map_or((STEEL, false), |d| (d, true))
    }

    /// Mass and inertia of a hollow cylinder or cone that a component describes.
    fn solid(&mut self, i: usize, density: f64) -> Option<Inertia> {
        let component = self.component(i);
        let mut of = |name: &str| number(&mut self.ledger, component, name, Unit::Length);
        let length = of("length")?;
        let ends = |one: Option<f64>, two: Option<f64>, both: Option<f64>| {
            let one = one.or(both)?;
            Some([0.5 * one, 0.5 * two.unwrap_or(one)])
        };
        let outer = ends(of("outer_diameter_begin"), of("outer_diameter_end"), of("outer_diameter"))?;
        let inner =
            ends(of("inner_diameter_begin"), of("inner_diameter_end"), of("inner_diameter")).unwrap_or([0.0; 2]);
        let is_real = length > 0.0 && outer.iter().zip(inner).all(|(o, i)| *o > i && i >= 0.0);
        if !is_real {
            self.ledger
                .notes
                .push(format!("{}: not used: no body has these diameters and this length", component.place()));
        }
        is_real.then(|| Inertia::of_cone(length, outer, inner, density))
    }

    /// Place of a component's centre in the plane of the gears, m.
    fn centre(&self, i: usize) -> Option<[f64; 2]> {
        let vector = self.component(i).attributes.get("support_vector")?;
        match vector.value.numbers()?.as_slice() {
            [_, v, w] => Some([v / 1e3, w / 1e3]),
            _ => None,
        }
    }

    /// Inertia of a shaft from its sections, and its bearings.
    pub fn write_shaft(&mut self, i: usize) {
        let body = self.shafts[i].0;
        if self.bodies.stands(body) {
            return;
        }
        let parts: Vec<usize> = self.bodies.parts(body).collect();
        let axis = parts.iter().find(|part| !self.bodies.pins.contains(part)).and_then(|part| self.centre(*part));
        let (mut sum, mut has_density) = (Inertia::default(), true);
        for part in parts.iter().copied() {
            let (density, is_given) = self.density(part);
            let solids = if self.component(part).kind == "side_plate" {
                vec![part]
            } else {
                self.parts_of(part, "shaft_section")
            };
            let offset = match (self.bodies.pins.contains(&part), axis, self.centre(part)) {
                (true, Some([x, y]), Some([a, b])) => libm::hypot(a - x, b - y),
                _ => 0.0,
            };
            for solid in solids {
                if let Some(inertia) = self.solid(solid, density) {
                    has_density &= is_given;
                    sum.add(inertia, offset);
                }
            }
        }
        let pointer = format!("/train/shafts/{i}");
        if sum.mass > 0.0 {
            self.write_inertia(&pointer, sum, has_density, "shaft sections and plates");
        }
        self.write_bearings(&pointer, &parts, sum.mass > 0.0);
    }

    fn write_inertia(&mut self, pointer: &str, sum: Inertia, has_density: bool, what: &str) {
        for (key, value) in [("mass_kg", sum.mass), ("inertia_kg_m2", sum.moment)] {
            let pointer = format!("{pointer}/{key}");
            if has_density {
                self.ledger.write(&pointer, value, Source::Rule, format!("{what}, density of the file"));
            } else {
                self.ledger.usual(&pointer, value, &format!("density of {what}: 7850 kg/m3"));
            }
        }
    }

    /// Springs of the bearings between these parts and others, if they give way.
    fn write_bearings(&mut self, pointer: &str, parts: &[usize], has_mass: bool) {
        let own: Vec<_> = self
            .bodies
            .bearings
            .iter()
            .filter(|(_, ends)| {
                ends.iter().any(|end| parts.contains(end)) && !ends.iter().all(|end| parts.contains(end))
            })
            .map(|(bearing, _)| *bearing)
            .collect();
        for (attribute, key) in [("radial_stiffness", "translation"), ("axial_stiffness", "axial")] {
            let springs: Vec<f64> = own
                .iter()
                .filter_map(|bearing| number(&mut self.ledger, bearing, attribute, Unit::Stiffness))
                .collect();
            // Zero stands for what the writer did not know.
            if !has_mass || springs.iter().any(|k| *k >= RIGID) || springs.iter().all(|k| *k <= 0.0) {
                continue;
            }
            let names = own.iter().map(|bearing| bearing.place()).collect::<Vec<_>>().join(", ");
            let pointer = format!("{pointer}/{key}");
            self.ledger.write(
                &format!("{pointer}/stiffness_n_per_m"),
                springs.iter().filter(|k| **k > 0.0).sum::<f64>(),
                Source::Rule,
                format!("sum of {attribute} of {names}"),
            );
            self.ledger.usual(&format!("{pointer}/damping_ratio"), BEARING, "damping ratio of bearings");
        }
    }

    /// Couplings that give way.
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

    /// Asks for the inertia of bodies for which the file gives none.
    pub fn ask_inertias(&mut self) {
        for i in 0..self.shafts.len() {
            let (body, name) = self.shafts[i].clone();
            let pointer = format!("/train/shafts/{i}");
            let shaft = self.ledger.scene.pointer(&pointer).cloned().unwrap_or_default();
            let has = |part: &serde_json::Value| part["inertia_kg_m2"].as_f64().is_some_and(|inertia| inertia > 0.0);
            let gears = shaft["gears"].as_array().is_some_and(|gears| gears.iter().any(has));
            let central = self.ledger.scene["train"]["stages"].as_array().is_some_and(|stages| {
                let members = stages.iter().flat_map(|stage| [&stage["sun"], &stage["ring"]]);
                members.into_iter().any(|gear| gear["shaft"] == name && has(gear))
            });
            if !self.bodies.stands(body) && !has(&shaft) && !gears && !central {
                let pointer = format!("{pointer}/inertia_kg_m2");
                self.ledger.ask(
                    &pointer,
                    format!("{name}: no inertia"),
                    "a moment of inertia > 0: the file has no section, gear or plate of this shaft",
                );
            }
        }
    }

    fn data(&self, gear: usize) -> Data<'m> {
        let of = |kind: &str, roles: [&str; 2]| {
            let own = self.relations(kind).filter(|r| self.bodies.at(r, "gear") == Some(gear));
            own.flat_map(|r| roles.map(|role| self.bodies.at(r, role))).flatten().collect::<Vec<_>>()
        };
        let data = [of("flank", ["left", "right"]), of("stage_gear_data", ["stage_gear_data"; 2])].concat();
        let tools = self.relations("ordered_reference").chain(self.relations("reference"));
        let tools =
            tools.filter(|r| self.bodies.at(r, "origin") == Some(gear)).filter_map(|r| self.bodies.at(r, "referenced"));
        Data {
            gear: self.component(gear),
            parts: data.into_iter().map(|i| self.component(i)).collect(),
            tool: tools.map(|i| self.component(i)).find(|tool| tool.kind.ends_with("_tool")),
        }
    }

    fn read_teeth(&mut self, gear: usize, pointer: &str) -> Option<Teeth> {
        let data = self.data(gear);
        Teeth::read(&mut self.ledger, &data, pointer)
    }

    /// Outer radius of the shaft under a gear, m.
    fn bore(&mut self, gear: usize) -> f64 {
        let Some(shaft) = self.shaft_of.get(&gear).copied() else { return 0.0 };
        let component = self.component(gear);
        let Some(at) = number(&mut self.ledger, component, "u_coordinate_on_shaft", Unit::Length) else { return 0.0 };
        for section in self.parts_of(shaft, "shaft_section") {
            let section = self.component(section);
            let mut of = |name: &str| number(&mut self.ledger, section, name, Unit::Length);
            let (from, length) = (of("u_coordinate_on_shaft").unwrap_or(0.0), of("length").unwrap_or(0.0));
            if (from..=from + length).contains(&at) {
                return 0.5 * of("outer_diameter_begin").or(of("outer_diameter")).unwrap_or(0.0);
            }
        }
        0.0
    }

    /// Mass and inertia of a gear: of the file's mass if it has one, else of a disc from the shaft to half the height of the teeth.
    fn write_gear(&mut self, gear: usize, teeth: &Teeth, shift: f64, pointer: &str) {
        let component = self.component(gear);
        let [tip, root] = teeth.radii(&mut self.ledger, shift);
        let (outer, inner) = if teeth.is_ring {
            let rim = number(&mut self.ledger, component, "outer_diameter", Unit::Length)
                .map(|d| 0.5 * d)
                .filter(|r| *r > root);
            (rim.unwrap_or(root + RIM * (root - tip)), 0.5 * (tip + root))
        } else {
            let outer = 0.5 * (tip + root);
            (outer, self.bore(gear).min(outer))
        };
        let mass = number(&mut self.ledger, component, "mass_of_component", Unit::Mass).filter(|mass| *mass > 0.0);
        if let Some(mass) = mass {
            let from = format!("{}: mass_of_component", component.place());
            self.ledger.write(&format!("{pointer}/mass_kg"), mass, Source::File, from.clone());
            let moment = 0.5 * mass * (outer * outer + inner * inner);
            self.ledger.write(&format!("{pointer}/inertia_kg_m2"), moment, Source::Rule, format!("{from}, of a disc"));
            return;
        }
        if inner >= outer {
            // Teeth cut into the shaft count with it.
            return;
        }
        let (density, is_given) = self.density(gear);
        let disc = Inertia::of_cone(teeth.width, [outer; 2], [inner; 2], density);
        let what = if teeth.is_ring {
            "ring from half the height of its teeth to its rim"
        } else {
            "disc from the shaft to half the height of the teeth"
        };
        self.write_inertia(pointer, disc, is_given, what);
    }

    /// A mesh of two gears on shafts. `known` are pointers and profile shifts of gears that meshes before have written.
    pub fn write_pair(&mut self, m: usize, known: &mut BTreeMap<usize, (String, f64)>) {
        let (stage, mut gears) = self.meshes[m];
        // The gear nearer to the driven shaft drives.
        if self.index_of_gear(gears[1]) < self.index_of_gear(gears[0]) {
            gears.reverse();
        }
        let mut teeth = Vec::new();
        for gear in gears {
            let pointer = match known.get(&gear) {
                Some((pointer, _)) => pointer.clone(),
                None => {
                    let shaft = self.index_of_gear(gear);
                    let place =
                        known.values().filter(|(p, _)| p.starts_with(&format!("/train/shafts/{shaft}/"))).count();
                    let here = teeth
                        .iter()
                        .filter(|(p, _): &&(String, Option<Teeth>)| p.starts_with(&format!("/train/shafts/{shaft}/")))
                        .count();
                    let pointer = format!("/train/shafts/{shaft}/gears/{}", place + here);
                    self.ledger.plain(&format!("{pointer}/name"), self.gear_name(gear));
                    if self.component(gear).kind == "ring_gear" {
                        self.ledger.plain(&format!("{pointer}/internal"), true);
                    }
                    pointer
                }
            };
            let read = self.read_teeth(gear, &pointer);
            teeth.push((pointer, read));
        }
        let [(one, Some(first)), (two, Some(second))] = teeth.as_slice() else { return };
        let pointer = format!("/train/meshes/{m}");
        let pair = Pair {
            stage: self.component(stage),
            teeth: [first, second],
            gears: [one.clone(), two.clone()],
            rack: format!("{pointer}/rack"),
            mesh: pointer.clone(),
        };
        self.ledger.plain(&format!("{pointer}/gears"), gears.map(|gear| self.gear_name(gear)).to_vec());
        let Some(rack) = pair.rack(&mut self.ledger, true) else { return };
        let before = gears.map(|gear| known.get(&gear).map(|(_, x)| *x));
        let shifts = pair.shifts(&mut self.ledger, &rack, before);
        self.write_place(&pair, gears, &pointer);
        pair.write_mesh(&mut self.ledger, &rack, shifts);
        for (k, gear) in gears.into_iter().enumerate() {
            if before[k].is_none() {
                self.write_gear(gear, &teeth[k].1.clone().unwrap_or_else(|| first.clone()), shifts[k], &teeth[k].0);
                known.insert(gear, (teeth[k].0.clone(), shifts[k]));
            }
        }
    }

    fn index_of_gear(&self, gear: usize) -> usize {
        self.shaft_of.get(&gear).map_or(0, |shaft| self.index(*shaft))
    }

    fn gear_name(&self, gear: usize) -> String {
        let component = self.component(gear);
        let is_unique = |name: &str| {
            let taken = self.model.components.iter().filter(|other| other.name == name).count() > 1;
            !name.is_empty() && !taken && self.shafts.iter().all(|(_, shaft)| shaft != name)
        };
        if is_unique(&component.name) { component.name.clone() } else { component.place() }
    }

    /// Centre distance and direction of a mesh.
    fn write_place(&mut self, pair: &Pair<'_>, gears: [usize; 2], pointer: &str) {
        if let Some((distance, from)) = pair.distance(&mut self.ledger) {
            self.ledger.write(&format!("{pointer}/centre_distance_m"), distance, Source::File, from);
        }
        let centres = gears.map(|gear| self.centre(gear).or_else(|| self.centre(*self.shaft_of.get(&gear)?)));
        let pointer = format!("{pointer}/angle_deg");
        match centres {
            [Some([x1, y1]), Some([x2, y2])] if (x1, y1) != (x2, y2) => {
                let angle = libm::atan2(y2 - y1, x2 - x1).to_degrees();
                self.ledger.write(
                    &pointer,
                    angle,
                    Source::Rule,
                    "direction between the support_vectors, from v towards w",
                );
            }
            _ => self.ledger.usual(&pointer, 0.0, "direction from gear to gear, degrees"),
        }
    }

    /// A planetary stage.
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
        self.write_gear(sun, sun_teeth, x_sun, &keys[0]);
        self.write_gear(planets[0][1], planet_teeth, x_planet, &keys[1]);
        let ring_body = self.body_of_gear(ring);
        if !self.bodies.stands(ring_body) {
            self.write_gear(ring, ring_teeth, x_ring, &keys[2]);
        }
        let parts: Vec<usize> = self.bodies.parts(planets[0][0]).collect();
        self.write_bearings(&keys[1], &parts, true);
    }

    /// Positions of the planets, from the axis w towards −v: from their shafts, from the angles of their stages, or equally spaced.
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
