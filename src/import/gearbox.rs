//! Gearbox of a file: bodies that turn as one, gears on them, stages between them.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::{
    Import, ImportError, Options,
    bodies::Bodies,
    ledger::{Ledger, Origin, Source},
    model::{Component, Model, Relation},
};
use crate::{output::Fault, scene::Scene};

/// Types of components that turn with the part to which they are fixed.
pub(super) const PARTS: [&str; 4] = ["shaft", "planet_carrier", "side_plate", "gear_casing"];
/// Types that hold data, or that a torsional model does not need.
const DATA: [&str; 24] = [
    "additional_mass",
    "concept_bearing",
    "coupling",
    "cutter_wheel_tool",
    "cylindrical_gear",
    "cylindrical_gear_flank",
    "cylindrical_stage",
    "cylindrical_stage_gear_data",
    "external_load",
    "flank_geometry",
    "gear_unit",
    "lubricant",
    "material",
    "planetary_stage",
    "rack_shaped_tool",
    "ring_gear",
    "rolling_bearing_row",
    "rolling_bearing_with_catalog_geometry",
    "rolling_bearing_with_detailed_geometry",
    "shaft_section",
    "stage_gear_data",
    "switchable_coupling",
    "workspace",
    "assembly_group",
];
/// Types of relations that are evaluated, or have no effect on the scene.
const RELATIONS: [&str; 13] = [
    "assembly",
    "central_shaft",
    "flank",
    "ordered_assembly",
    "ordered_reference",
    "planet_carrier_shaft",
    "planet_pin",
    "planet_shaft",
    "reference",
    "side",
    "stage",
    "stage_gear_data",
    "contact",
];

/// Makes a scene of a gearbox.
pub(super) fn scene(mut model: Model, options: &Options) -> Result<Import, ImportError> {
    let mut ledger = Ledger::new(options);
    let case = options.load_case.clone().or_else(|| model.load_cases.first().map(|case| case.id.clone()));
    if let Some(case) = case
        && !model.apply(&case)
    {
        let known: Vec<&str> = model.load_cases.iter().map(|case| case.id.as_str()).collect();
        let listed = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        ledger.fault(
            "--load-case",
            case,
            &format!("a load case of the file: {listed}"),
            "name one of them, or leave it out",
        );
    }
    let unknown = |known: &[&str], names: BTreeSet<String>| -> Vec<String> {
        names.into_iter().filter(|name| !known.contains(&name.as_str()) && !name.starts_with("custom_")).collect()
    };
    let kinds = unknown(&[&PARTS[..], &DATA[..]].concat(), model.components.iter().map(|c| c.kind.clone()).collect());
    let relations = unknown(&RELATIONS, model.relations.iter().map(|r| r.kind.clone()).collect());
    for (what, names) in [("components", kinds), ("relations", relations)] {
        if !names.is_empty() {
            ledger.notes.push(format!("{what} of these types are not read: {}", names.join(", ")));
        }
    }
    let bodies = Bodies::new(&mut ledger, &model, options);
    let mut writer = Writer::new(&model, ledger, bodies);
    writer.write();
    let loose: Vec<Fault> = writer.stages.iter().filter_map(|stage| writer.unfixed(stage)).collect();
    let Ledger { mut scene, mut origins, mut faults, notes, .. } = writer.ledger;
    if faults.is_empty() {
        match Scene::from_json(&scene.to_string(), "import").and_then(|scene| scene.build()) {
            Ok(built) => turn_torques(&mut scene, &mut origins, &built.speeds),
            // Why nothing determines the speeds.
            Err(_) if !loose.is_empty() => faults = loose,
            Err(error) => faults = error.faults,
        }
    }
    if faults.is_empty() { Ok(Import { scene, origins, notes }) } else { Err(ImportError::Faults(faults)) }
}

/// Turns the torques of the file, which are about the axis, into torques that are positive if they drive.
fn turn_torques(scene: &mut Value, origins: &mut [Origin], speeds: &[(String, f64)]) {
    let is_of_file = |origin: &&mut Origin| origin.source == Source::File && origin.pointer.ends_with("/torque_nm");
    for origin in origins.iter_mut().filter(is_of_file) {
        let shaft = origin.pointer.trim_end_matches("/torque_nm").to_owned();
        let name = &scene.pointer(&shaft).unwrap_or(&Value::Null)["name"];
        let is_turned = speeds.iter().any(|(own, speed)| name == own && *speed < 0.0);
        if let (true, Some(torque)) = (is_turned, origin.value.as_f64()) {
            origin.value = (-torque).into();
            origin.from += ", about an axis that turns the other way";
            if let Some(place) = scene.pointer_mut(&origin.pointer) {
                *place = origin.value.clone();
            }
        }
    }
}

/// A planetary stage.
pub(super) struct Stage {
    pub component: usize,
    /// Planet shafts, with the gear on each.
    pub planets: Vec<[usize; 2]>,
    /// Indices of the sun gear and the ring gear, and of the components of the sun mesh and the ring mesh.
    pub sun: usize,
    pub ring: usize,
    pub meshes: [usize; 2],
    pub carrier: usize,
}

/// Writer of the scene.
pub(super) struct Writer<'m, 'o> {
    pub model: &'m Model,
    pub ledger: Ledger<'o>,
    pub bodies: Bodies<'m>,
    /// Shaft of each gear.
    pub shaft_of: BTreeMap<usize, usize>,
    /// Stages with their two gears, without those of planets.
    pub meshes: Vec<(usize, [usize; 2])>,
    pub stages: Vec<Stage>,
    /// Bodies of the scene, by their first component, with their names.
    pub shafts: Vec<(usize, String)>,
}

impl<'m, 'o> Writer<'m, 'o> {
    fn new(model: &'m Model, ledger: Ledger<'o>, bodies: Bodies<'m>) -> Self {
        let mut writer = Self {
            model,
            ledger,
            bodies,
            shaft_of: BTreeMap::new(),
            meshes: Vec::new(),
            stages: Vec::new(),
            shafts: Vec::new(),
        };
        writer.collect();
        writer
    }

    pub fn component(&self, i: usize) -> &'m Component {
        &self.model.components[i]
    }

    pub fn relations(&self, kind: &str) -> impl Iterator<Item = &'m Relation> + use<'m> {
        let kind = kind.to_owned();
        self.model.relations.iter().filter(move |relation| relation.kind == kind)
    }

    /// Returns the parts of type `kind` that are assembled into `whole`.
    pub fn parts_of(&self, whole: usize, kind: &str) -> Vec<usize> {
        let of_kind = |relation: &&Relation| self.bodies.at(relation, "assembly") == Some(whole);
        let parts = self.relations("assembly").chain(self.relations("ordered_assembly")).filter(of_kind);
        let parts = parts.filter_map(|r| self.bodies.at(r, "part")).filter(|part| self.component(*part).kind == kind);
        parts.collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Finds gears, meshes and planetary stages.
    fn collect(&mut self) {
        let is_gear =
            |writer: &Self, i: usize| ["cylindrical_gear", "ring_gear"].contains(&writer.component(i).kind.as_str());
        for relation in self.relations("assembly") {
            if let (Some(shaft), Some(gear)) = (self.bodies.at(relation, "assembly"), self.bodies.at(relation, "part"))
                && is_gear(self, gear)
                && PARTS.contains(&self.component(shaft).kind.as_str())
            {
                self.shaft_of.insert(gear, shaft);
            }
        }
        let mut planets: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for relation in self.relations("planet_shaft") {
            if let (Some(stage), Some(shaft)) =
                (self.bodies.at(relation, "planetary_stage"), self.bodies.at(relation, "shaft"))
            {
                planets.entry(stage).or_default().push(shaft);
            }
        }
        let mut all = Vec::new();
        for relation in self.relations("stage") {
            let found = ["stage", "gear_1", "gear_2"].map(|role| self.bodies.at(relation, role));
            let [Some(stage), Some(one), Some(two)] = found else { continue };
            if !is_gear(self, one) || !is_gear(self, two) {
                let found = format!("gears of the types {} and {}", self.component(one).kind, self.component(two).kind);
                let place = self.component(stage).place();
                self.ledger.fault(
                    &place,
                    found,
                    "cylindrical gears and rings",
                    "leave the stage out: Flank has no other gears",
                );
                continue;
            }
            for gear in [one, two] {
                if !self.shaft_of.contains_key(&gear) {
                    let place = self.component(gear).place();
                    self.ledger.fault(
                        &place,
                        "a gear on no shaft",
                        "an assembly relation of a shaft and the gear",
                        "add the relation to the file",
                    );
                }
            }
            all.push((stage, [one, two]));
        }
        if all.is_empty() {
            self.ledger.fault(
                "the file",
                "no stage of two cylindrical gears",
                "relations of the type stage",
                "import a file with a gearbox",
            );
        }
        for (stage, shafts) in planets {
            self.planetary(stage, &shafts, &mut all);
        }
        self.meshes = all;
    }

    /// Adds a planetary stage, and removes its meshes from `all`.
    fn planetary(&mut self, component: usize, shafts: &[usize], all: &mut Vec<(usize, [usize; 2])>) {
        let place = self.component(component).place();
        let on_planet =
            |writer: &Self, gear: usize| writer.shaft_of.get(&gear).is_some_and(|shaft| shafts.contains(shaft));
        let own: Vec<_> =
            all.iter().copied().filter(|(_, gears)| gears.iter().any(|gear| on_planet(self, *gear))).collect();
        all.retain(|mesh| !own.contains(mesh));
        let mut planets = Vec::new();
        for shaft in shafts {
            let gears: Vec<usize> =
                self.shaft_of.iter().filter(|(_, own)| *own == shaft).map(|(gear, _)| *gear).collect();
            match gears.as_slice() {
                [gear] => planets.push([*shaft, *gear]),
                _ => {
                    let found = format!("{} gears on {}", gears.len(), self.component(*shaft).place());
                    self.ledger.fault(
                        &place,
                        found,
                        "one gear on each planet shaft",
                        "leave stepped planets out: Flank has none",
                    );
                }
            }
        }
        let partner = |is_ring: bool| -> Vec<(usize, usize)> {
            let others = own.iter().filter_map(|(stage, gears)| {
                let other = gears.iter().find(|gear| !on_planet(self, **gear))?;
                ((self.component(*other).kind == "ring_gear") == is_ring).then_some((*stage, *other))
            });
            others.collect()
        };
        let (suns, rings) = (partner(false), partner(true));
        let single = |found: &[(usize, usize)]| -> Option<(usize, usize)> {
            let gears: BTreeSet<usize> = found.iter().map(|(_, gear)| *gear).collect();
            (gears.len() == 1).then(|| found[0])
        };
        let carriers =
            self.relations("planet_carrier_shaft").filter(|r| self.bodies.at(r, "planetary_stage") == Some(component));
        let carriers: Vec<usize> = carriers.filter_map(|r| self.bodies.at(r, "shaft")).collect();
        let carrier = carriers.first().copied().or_else(|| self.parts_of(component, "planet_carrier").first().copied());
        match (single(&suns), single(&rings), carrier) {
            (Some(sun), Some(ring), Some(carrier)) if !planets.is_empty() => {
                let meshes = [sun.0, ring.0];
                self.stages.push(Stage { component, planets, sun: sun.1, ring: ring.1, meshes, carrier });
            }
            (sun, ring, carrier) => {
                let part = |found: bool, name: &str| if found { String::new() } else { format!("no single {name}; ") };
                let found =
                    part(sun.is_some(), "sun") + &part(ring.is_some(), "ring") + &part(carrier.is_some(), "carrier");
                let found = found.trim_end_matches("; ").to_owned();
                let found = if found.is_empty() { "no planets".to_owned() } else { found };
                self.ledger.fault(
                    &place,
                    found,
                    "a stage of one sun, one ring, planets and a carrier",
                    "complete the stage in the file, or leave it out",
                );
            }
        }
    }

    /// Returns the fault of a stage of which, by the file, no member stands still.
    fn unfixed(&self, stage: &Stage) -> Option<Fault> {
        let members = [self.shaft_of.get(&stage.sun), Some(&stage.carrier), self.shaft_of.get(&stage.ring)];
        let members: Vec<usize> = members.into_iter().flatten().map(|i| self.bodies.of(*i)).collect();
        let names: Vec<String> = members
            .iter()
            .filter_map(|body| self.shafts.iter().find(|(own, _)| own == body).map(|(_, name)| format!("\"{name}\"")))
            .collect();
        let stands = members.iter().any(|body| self.bodies.stands(*body));
        let place = self.component(stage.component).place();
        (!stands).then(|| {
            Fault::new(&place, "no member that stands still", format!("one of {}", names.join(", ")))
                .remedy(format!("add --fix {}, or another one", names.last().map_or("NAME", String::as_str)))
        })
    }

    fn write(&mut self) {
        self.ledger.plain("/flank", 1);
        let unit = self.model.components.iter().find(|component| component.kind == "gear_unit");
        let name = unit.map(|unit| unit.name.clone()).filter(|name| !name.is_empty());
        self.ledger.plain("/name", name.unwrap_or_else(|| "gearbox".to_owned()));
        self.ledger.plain("/train/kind", "gearbox");
        self.ledger.plain("/train/mesh/law/kind", "kelvin-voigt");
        self.ledger.usual("/train/mesh/law/damping_ratio", 0.05, "damping ratio of the meshes");
        let (speed, torques) = (self.speed(), self.torques());
        self.order(speed.as_ref().map(|speed| speed.0), &torques);
        self.write_loads(speed, &torques);
        for i in 0..self.shafts.len() {
            self.write_shaft(i);
        }
        self.write_joints();
        let mut known = BTreeMap::new();
        for m in 0..self.meshes.len() {
            self.write_pair(m, &mut known);
        }
        for s in 0..self.stages.len() {
            self.write_stage(s);
        }
        self.ask_inertias();
        self.ledger.plain("/initial", "quasi-static");
        self.ledger.usual("/run/cycles", 200, "cycles of a run");
        self.ledger.usual("/run/transient_cycles", 100, "cycles before the measures");
        self.ledger.finish();
    }
}
