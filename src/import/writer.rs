//! Inertias, bearings and gears of shafts, written into the scene.

use std::collections::BTreeMap;

use super::{
    gearbox::Writer,
    ledger::Source,
    pair::Pair,
    quantity::{Unit, number},
    teeth::{Data, Teeth},
};

/// Stiffness from which on a bearing counts as rigid, N/m: other programs write 1e20 and more.
const RIGID: f64 = 1e15;
/// Usual density, kg/m³.
const STEEL: f64 = 7850.0;
/// Longest chain of components whose positions are relative to each other.
const DEEPEST: usize = 8;
/// Usual thickness of the rim of a ring, in tooth heights.
const RIM: f64 = 2.0;
/// Usual damping ratio of bearings and couplings.
pub(super) const BEARING: f64 = 0.05;

/// Mass, kg, and moment of inertia about the axis, kg m².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Inertia {
    mass: f64,
    moment: f64,
}

impl Inertia {
    /// Returns the inertia of a hollow frustum: length, outer and inner radii at its ends, m, density, kg/m³.
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

impl<'m> Writer<'m, '_> {
    /// Returns the density of a component's material, kg/m³, and whether the file gives it.
    fn density(&mut self, i: usize) -> (f64, bool) {
        let material = self.relations("reference").filter(|r| self.bodies.at(r, "origin") == Some(i));
        let materials: Vec<usize> = material.filter_map(|r| self.bodies.at(r, "referenced")).collect();
        let found = materials
            .into_iter()
            .find_map(|m| number(&mut self.ledger, &self.model.components[m], "density", Unit::Density));
        found.filter(|d| *d > 0.0).map_or((STEEL, false), |d| (d, true))
    }

    /// Returns mass and inertia of a component that is a hollow cylinder or cone.
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

    /// Returns the centre of a component in the plane of the gears, m: the sum of its support vector and those of its reference components;
    /// `None` if one of these is rotated.
    pub fn centre(&self, i: usize) -> Option<[f64; 2]> {
        let (mut sum, mut at) = ([0.0; 2], i);
        for _ in 0..DEEPEST {
            let vector = |name: &str| self.component(at).attributes.get(name)?.value.numbers();
            let [_, v, w] = vector("support_vector")?[..] else { return None };
            sum = [sum[0] + v / 1e3, sum[1] + w / 1e3];
            let attribute = self.component(at).attributes.get("reference_component_for_position");
            let from = attribute.and_then(|attribute| self.bodies.place.get(attribute.value.text().as_str()).copied());
            match from.filter(|from| *from != at && self.component(*from).attributes.contains_key("support_vector")) {
                None => return Some(sum),
                Some(from) => at = from,
            }
            let axis = |name: &str, axis: [f64; 3]| {
                let own = self.component(at).attributes.get(name).and_then(|vector| vector.value.numbers());
                own.is_none_or(|own| own.len() == 3 && own.iter().zip(axis).all(|(a, b)| (a - b).abs() < 1e-9))
            };
            if !axis("u_axis_vector", [1.0, 0.0, 0.0]) || !axis("w_axis_vector", [0.0, 0.0, 1.0]) {
                return None;
            }
        }
        None
    }

    /// Writes the inertia of a shaft, from its sections, and its bearings.
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

    /// Writes the springs of the bearings between these parts and others, if they are compliant.
    pub fn write_bearings(&mut self, pointer: &str, parts: &[usize], has_mass: bool) {
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
            // Zero stands for an unknown stiffness.
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

    /// Requests the inertia of bodies for which the file gives none.
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

    pub fn read_teeth(&mut self, gear: usize, pointer: &str) -> Option<Teeth> {
        let data = self.data(gear);
        Teeth::read(&mut self.ledger, &data, pointer)
    }

    /// Returns the outer radius of the shaft under a gear, m; 0 if it is unknown.
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

    /// Writes mass and inertia of a gear: by the mass in the file, else those of a disc from the shaft to half the height of the teeth.
    pub fn write_gear(&mut self, gear: usize, teeth: &Teeth, (shift, helix): (f64, f64), pointer: &str) {
        let component = self.component(gear);
        let [tip, root] = teeth.radii(&mut self.ledger, shift, helix);
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
            // Teeth cut into the shaft are part of its inertia.
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

    /// Writes a mesh of two gears on shafts. `known` are pointers and profile shifts of gears that earlier meshes have written.
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
                self.write_gear(
                    gear,
                    &teeth[k].1.clone().unwrap_or_else(|| first.clone()),
                    (shifts[k], rack.helix_angle),
                    &teeth[k].0,
                );
                known.insert(gear, (teeth[k].0.clone(), shifts[k]));
            }
        }
    }

    pub fn index_of_gear(&self, gear: usize) -> usize {
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

    /// Writes centre distance and direction of a mesh.
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
}
