//! Bodies of a gearbox: components that turn as one, with the couplings and bearings between them.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    Options,
    gearbox::PARTS,
    ledger::Ledger,
    model::{Component, Model, Relation},
    quantity::{Unit, number},
};

/// Torsional stiffness from which on a coupling counts as rigid, N m/rad.
const RIGID_TORSION: f64 = 1e12;
/// Compliant coupling between two bodies.
pub(super) struct Joint<'m> {
    pub component: &'m Component,
    pub ends: [usize; 2],
}

/// Components that turn as one.
pub(super) struct Bodies<'m> {
    model: &'m Model,
    /// Root of each component; repeated, it leads to the first component of its body.
    root: Vec<usize>,
    pub place: BTreeMap<&'m str, usize>,
    pub joints: Vec<Joint<'m>>,
    /// Bearings, with the two components of each.
    pub bearings: Vec<(&'m Component, [usize; 2])>,
    pub pins: BTreeSet<usize>,
    fixed: BTreeSet<usize>,
}

impl<'m> Bodies<'m> {
    pub fn new(ledger: &mut Ledger<'_>, model: &'m Model, options: &Options) -> Self {
        let mut place = BTreeMap::new();
        for (i, component) in model.components.iter().enumerate() {
            if place.insert(component.id.as_str(), i).is_some() {
                ledger.fault(
                    &component.place(),
                    format!("a second component with the id {}", component.id),
                    "an id of its own for each component",
                    "mend the file",
                );
            }
        }
        let root = (0..model.components.len()).collect();
        let mut bodies = Self {
            model,
            root,
            place,
            joints: Vec::new(),
            bearings: Vec::new(),
            pins: BTreeSet::new(),
            fixed: BTreeSet::new(),
        };
        for relation in &model.relations {
            for (role, id) in &relation.refs {
                if !bodies.place.contains_key(id.as_str()) {
                    ledger.fault(
                        &format!("a relation of the type {}", relation.kind),
                        format!("{role}: the component {id}"),
                        "a component of the file",
                        "mend the file",
                    );
                }
            }
        }
        let mut carriers: BTreeMap<&str, usize> = BTreeMap::new();
        for relation in &model.relations {
            let is = |kind: &str| relation.kind == kind;
            if is("assembly")
                && let (Some(a), Some(b)) = (bodies.at(relation, "assembly"), bodies.at(relation, "part"))
            {
                let [own, part] = [a, b].map(|i| model.components[i].kind.as_str());
                if own == "planet_carrier" && PARTS.contains(&part) {
                    bodies.join(a, b);
                } else if own == "planetary_stage" && part == "planet_carrier" {
                    bodies.carry(&mut carriers, relation.of("assembly"), b);
                }
            }
            let shaft = bodies.at(relation, "shaft");
            if (is("planet_carrier_shaft") || is("planet_pin"))
                && let Some(shaft) = shaft
            {
                bodies.carry(&mut carriers, relation.of("planetary_stage"), shaft);
                if is("planet_pin") {
                    bodies.pins.insert(shaft);
                }
            }
            if is("side")
                && let (Some(by), Some(a), Some(b)) = (
                    bodies.at(relation, "assembly"),
                    bodies.at(relation, "inner_part"),
                    bodies.at(relation, "outer_part"),
                )
            {
                bodies.side(ledger, &model.components[by], [a, b]);
            }
        }
        for name in &options.fix {
            let found: Vec<usize> = (0..model.components.len())
                .filter(|i| {
                    let component = &model.components[*i];
                    PARTS.contains(&component.kind.as_str()) && (component.name == *name || component.id == *name)
                })
                .collect();
            match found.as_slice() {
                [one] => drop(bodies.fixed.insert(*one)),
                _ => {
                    let shafts =
                        model.components.iter().filter(|c| c.kind == "shaft").map(Component::place).collect::<Vec<_>>();
                    ledger.fault(
                        "--fix",
                        name.clone(),
                        &format!("the name or the number of one shaft: {}", shafts.join(", ")),
                        "name one of them",
                    );
                }
            }
        }
        bodies
    }

    pub fn at(&self, relation: &Relation, role: &str) -> Option<usize> {
        self.place.get(relation.of(role)?).copied()
    }

    /// Returns the first component of the body of `i`.
    pub fn of(&self, i: usize) -> usize {
        let mut i = i;
        while self.root[i] != i {
            i = self.root[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [self.of(a), self.of(b)];
        self.root[a.max(b)] = a.min(b);
    }

    /// Returns the components of the body of `i`.
    pub fn parts(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        let root = self.of(i);
        (0..self.root.len()).filter(move |part| self.of(*part) == root)
    }

    pub fn stands(&self, i: usize) -> bool {
        self.parts(i).any(|part| self.model.components[part].kind == "gear_casing" || self.fixed.contains(&part))
    }

    /// Joins the shafts that carry the planets of a stage into one body.
    fn carry(&mut self, carriers: &mut BTreeMap<&'m str, usize>, stage: Option<&'m str>, shaft: usize) {
        let Some(stage) = stage else { return };
        match carriers.get(stage) {
            Some(other) => self.join(*other, shaft),
            None => drop(carriers.insert(stage, shaft)),
        }
    }

    /// Adds a coupling or a bearing between two parts.
    fn side(&mut self, ledger: &mut Ledger<'_>, by: &'m Component, [a, b]: [usize; 2]) {
        if by.kind.contains("bearing") {
            self.bearings.push((by, [a, b]));
            return;
        }
        let is_open = by.kind == "switchable_coupling" && by.flag("is_engaged") != Some(true)
            || by.flag("is_engaged") == Some(false);
        if is_open {
            return;
        }
        match number(ledger, by, "rotational_stiffness", Unit::Torsion) {
            Some(torsion) if torsion > 0.0 && torsion < RIGID_TORSION => {
                self.joints.push(Joint { component: by, ends: [a, b] })
            }
            Some(torsion) if torsion <= 0.0 => {}
            _ => self.join(a, b),
        }
    }
}
