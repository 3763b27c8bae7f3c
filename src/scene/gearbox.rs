//! A gearbox.

use std::f64::consts::TAU;

use super::{
    body::read_support,
    build, curve, fault, harmonics, load,
    mesh::{self, GearPairing},
    node::Node,
    plausible,
};
use crate::{
    gear::{CurveShape, Gear, HarmonicSeries, MeshHarmonic, phase::equally_spaced},
    system::Spec,
    train::{
        Damping, Support,
        gearbox::{
            Amplitude, Coupling, Drag, GearMesh, Gearbox, GearboxFault, Hand, Layout, Order, Part, Shaft, ShaftGear,
            Torque,
        },
    },
};

/// Speed of one turn a minute, rad/s.
const RPM: f64 = TAU / 60.0;
/// Largest relative difference between the mean of a curve of the speed and the speed of its shaft.
const SPEEDS_AGREE: f64 = 0.01;

/// Gearbox during reading, with the places of its parts.
#[derive(Default)]
struct Reading<'a> {
    gearbox: Gearbox,
    shafts: Vec<Node<'a>>,
    gears: Vec<Node<'a>>,
    /// Place of each mesh, and of its contact.
    meshes: Vec<[Node<'a>; 2]>,
    couplings: Vec<Node<'a>>,
    /// Place of each stage, and the shafts of its planets.
    stages: Vec<(Node<'a>, Vec<usize>)>,
}

pub(super) fn read(node: &Node) -> Option<Spec> {
    let mut reading = Reading::default();
    for item in node.at("shafts").items() {
        reading.shaft(&item);
    }
    for item in node.at("meshes").items() {
        reading.mesh(&item);
    }
    for item in node.at("couplings").items() {
        reading.coupling(&item);
    }
    for item in node.at("stages").items() {
        reading.stage(&item);
    }
    if node.has_faults() {
        return None;
    }
    reading.build(node)
}

impl<'a> Reading<'a> {
    fn build(&self, node: &Node<'a>) -> Option<Spec> {
        let gearbox = &self.gearbox;
        let layout = match gearbox.layout() {
            Ok(layout) => layout,
            Err(faults) => {
                faults.iter().for_each(|fault| self.report(node, fault));
                return None;
            }
        };
        let faults = gearbox.faults(&layout);
        faults.iter().for_each(|fault| self.report(node, fault));
        for (part, text) in gearbox.warnings(&layout) {
            self.place(node, part).warn(text);
        }
        for (i, shaft) in gearbox.shafts.iter().enumerate() {
            node.turns(&shaft.name, layout.speed(i));
        }
        for (i, gear) in gearbox.gears.iter().enumerate().filter(|(_, gear)| gear.is_loose) {
            node.turns(&gear.name, layout.gear_speed(i));
        }
        let (mut meshes, mut toothed_meshes) = (Vec::new(), Vec::new());
        for (i, line) in layout.lines.iter().enumerate() {
            let [place, contact] = &self.meshes[i];
            let (own, teeth) = (&gearbox.meshes[i], line.gears.map(|gear| gearbox.gears[gear].teeth));
            let [pinion, wheel] = line.gears.map(|gear| &self.gears[gear]);
            let engaged = GearPairing::with(own.rack, teeth, line.geometry, [pinion, wheel]);
            let masses = line.gears.map(|gear| gearbox.rotary_mass(&layout, gear));
            let read = mesh::read(contact, masses, Some(&engaged));
            let toothed = engaged.mesh(&own.name, layout.mesh_frequency(i), vec![line.phase]);
            plausible::mesh(contact, &place.at("rack"), &read, &toothed);
            for (k, gear) in line.gears.into_iter().enumerate().filter(|(_, gear)| !gearbox.gears[*gear].is_ring) {
                let (own, node) = (&gearbox.gears[gear], &self.gears[gear]);
                plausible::inertia(node, (own.mass, own.inertia), &toothed, k, 1.0);
                plausible::drag(node, own.drag.constant, &toothed, k);
                plausible::drag(&self.shafts[own.shaft], gearbox.shafts[own.shaft].drag.constant, &toothed, k);
                plausible::runout(&node.at("runout_m"), 2.0 * own.eccentricity.0, toothed.rack.module);
            }
            toothed_meshes.push(toothed);
            meshes.push(read);
        }
        if !faults.is_empty() {
            return None;
        }
        for (place, planets) in &self.stages {
            self.overlap(place, planets, &layout);
        }
        let mut spec = build::assembled(node, gearbox.assemble(&layout, &meshes))?;
        load::of_shafts(node, &mut spec, &self.shafts, (gearbox, &layout, &meshes))?;
        plausible::train(node, &spec, &toothed_meshes);
        node.meshes(toothed_meshes);
        node.drawing(gearbox.drawing(&layout));
        Some(spec)
    }

    /// Warns of planets of one stage that overlap; `planets` are their shafts.
    fn overlap(&self, place: &Node<'a>, planets: &[usize], layout: &Layout) {
        let Some(planet) = planets.first().copied() else { return };
        let Some((carrier, _)) = self.gearbox.shafts[planet].carried else { return };
        let [axis, centre] = [carrier, planet].map(|shaft| layout.centres[shaft]);
        let positions: Vec<f64> = planets.iter().filter_map(|i| self.gearbox.shafts[*i].carried).map(|c| c.1).collect();
        let teeth = self.gearbox.gears.iter().position(|gear| gear.shaft == planet);
        let mesh = teeth.and_then(|gear| self.gearbox.meshes.iter().find(|mesh| mesh.gears.contains(&gear)));
        if let (Some(gear), Some(mesh)) = (teeth, mesh) {
            let distance = libm::hypot(centre[0] - axis[0], centre[1] - axis[1]);
            let errors = place.at("pin_errors_m");
            for error in errors.items() {
                plausible::runout(&errors, error.number(), mesh.rack.module);
            }
            plausible::planets(place, &positions, distance, self.gearbox.gears[gear].teeth.tip_radius(&mesh.rack));
        }
    }

    fn place(&self, node: &Node<'a>, part: Part) -> Node<'a> {
        match part {
            Part::Shaft(i) => self.shafts[i].clone(),
            Part::Gear(i) => self.gears[i].clone(),
            Part::Mesh(i) => self.meshes[i][0].clone(),
            Part::Coupling(i) => self.couplings[i].clone(),
            Part::Train => node.clone(),
        }
    }

    fn report(&self, node: &Node<'a>, fault: &GearboxFault) {
        let place = self.place(node, fault.part);
        // The meshes of a stage are not listed in the scene.
        let is_own = !matches!(fault.part, Part::Mesh(_)) || place.at(fault.key).written().is_some();
        let place = if fault.key.is_empty() || !is_own { place } else { place.at(fault.key) };
        // Planets share one mesh: its fault is reported for the first one only.
        let is_told = !is_own && place.has_fault(&fault.allowed);
        if is_told {
            return;
        }
        place.fault(fault.found.clone(), fault.allowed.clone(), fault.remedy.clone());
    }

    fn shaft(&mut self, node: &Node<'a>) {
        let name = node.at("name");
        unique(&name, "shaft", self.gearbox.shafts.iter().map(|shaft| shaft.name.as_str()));
        let torque = node.at("torque_nm");
        let given = if torque.is_text() { 0.0 } else { load::at_rest(&torque, &curve::TORQUES) };
        let (mean, orders) = read_orders(&node.at("orders"), true);
        // About the mean speed, which the gearbox has already.
        let (turning, motion) = read_orders(&node.at("motion"), false);
        let (turning, own) = (turning / RPM, node.at("speed_rpm").written().map_or(0.0, |speed| speed.number()));
        if turning != 0.0 && (turning - own).abs() > SPEEDS_AGREE * own.abs() {
            let shaft = "which is not the speed_rpm of the shaft: it is left out";
            node.at("motion").warn(format!("a curve with a mean of {turning:.4} rev/min, {shaft}"));
        }
        if torque.is_text() && mean != 0.0 {
            let found = format!("a torque of mean {mean:e} N m beside \"balance\"");
            node.at("orders").fault(
                found,
                "one mean torque",
                "write 0 in place of \"balance\": the mean is that of the curve",
            );
        }
        let index = self.gearbox.shafts.len();
        self.gearbox.shafts.push(Shaft {
            name: name.text().to_owned(),
            position: node.at("position_m").written().map(|at| {
                let at = at.vector(2);
                [at[0], at[1]]
            }),
            carried: None,
            offset: [0.0; 2],
            is_fixed: node.at("fixed").flag(),
            rpm: node.at("speed_rpm").written().map(|speed| speed.number()),
            mass: node.at("mass_kg").number(),
            inertia: node.at("inertia_kg_m2").number(),
            radius: node.at("radius_m").written().map(|radius| radius.number()),
            translation: node.at("translation").written().map(|support| read_support(&support)),
            axial: node.at("axial").written().map(|support| read_support(&support)),
            rotation: read_torsion(&node.at("rotation")),
            torque: if torque.is_text() { Torque::Balance } else { Torque::Given(given + mean) },
            drag: read_drag(&node.at("drag")),
            orders,
            motion,
        });
        self.shafts.push(node.clone());
        for gear in node.at("gears").items() {
            let flags = [gear.at("loose").flag(), gear.at("internal").flag()];
            let name = gear.at("name");
            unique(&name, "gear", self.gearbox.gears.iter().map(|gear| gear.name.as_str()));
            self.gear(&gear, name.text().to_owned(), index, flags);
        }
    }

    fn gear(&mut self, node: &Node<'a>, name: String, shaft: usize, [is_loose, is_ring]: [bool; 2]) -> usize {
        let number = |key: &str| node.at(key).number();
        let hand = node.at("hand").written();
        self.gearbox.gears.push(ShaftGear {
            name,
            shaft,
            is_loose,
            is_ring,
            teeth: Gear { teeth: node.at("teeth").whole() as u32, shift: number("profile_shift") },
            hand: hand.map(|hand| if hand.text() == "left" { Hand::Left } else { Hand::Right }),
            mass: number("mass_kg"),
            inertia: number("inertia_kg_m2"),
            drag: read_drag(&node.at("drag")),
            eccentricity: (0.5 * number("runout_m"), number("runout_deg").to_radians()),
            tooth_angle: node.at("tooth_angle_deg").written().map(|angle| angle.number().to_radians()),
        });
        self.gears.push(node.clone());
        self.gearbox.gears.len() - 1
    }

    fn mesh(&mut self, node: &Node<'a>) {
        let names: Vec<&str> = self.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect();
        let pair = node.at("gears");
        let Some([one, two]) = both(&pair, "gear", &names) else { return };
        let name =
            node.at("name").written().map_or_else(|| format!("{}-{}", names[one], names[two]), |n| n.text().into());
        if self.gearbox.gears[one].is_ring && self.gearbox.gears[two].is_ring {
            pair.refuse("one ring at most", "leave \"internal\" out of the pinion");
        }
        unique_name(node, &name, "mesh", self.gearbox.meshes.iter().map(|mesh| mesh.name.as_str()));
        self.gearbox.meshes.push(GearMesh {
            name,
            gears: [one, two],
            rack: mesh::read_rack(&node.at("rack")),
            angle: node.at("angle_deg").written().map(|angle| angle.number().to_radians()),
            distance: node.at("centre_distance_m").written().map(|distance| distance.number()),
            phase: node.at("phase").written().map(|phase| phase.number()),
        });
        self.meshes.push([node.clone(), node.clone()]);
    }

    fn coupling(&mut self, node: &Node<'a>) {
        let names: Vec<&str> = self.gearbox.shafts.iter().map(|shaft| shaft.name.as_str()).collect();
        let Some(shafts) = both(&node.at("shafts"), "shaft", &names) else { return };
        let name = node.at("name").written().map(|name| name.text().to_owned());
        self.gearbox.couplings.push(Coupling {
            name: name.unwrap_or_else(|| shafts.map(|i| names[i]).join("-")),
            shafts,
            rotation: node.at("rotation").written().map(|support| read_torsion(&support)),
            translation: node.at("translation").written().map(|support| read_support(&support)),
            axial: node.at("axial").written().map(|support| read_support(&support)),
        });
        self.couplings.push(node.clone());
    }

    /// Reads a planetary stage: gears on the shafts of sun and ring, and planets as shafts on the carrier.
    fn stage(&mut self, node: &Node<'a>) {
        let stage = node.at("name").text();
        let names: Vec<&str> = self.gearbox.shafts.iter().map(|shaft| shaft.name.as_str()).collect();
        let (sun_node, planet_node, ring_node) = (node.at("sun"), node.at("planet"), node.at("ring"));
        let found = [&sun_node.at("shaft"), &ring_node.at("shaft"), &node.at("carrier")]
            .map(|name| find(name, "shaft", &names));
        let [Some(sun_shaft), Some(ring_shaft), Some(carrier)] = found else { return };
        let degrees = node.at("positions_deg").numbers().into_iter().map(f64::to_radians);
        let positions =
            node.at("planets").written().map_or_else(|| degrees.collect(), |n| equally_spaced(n.whole() as usize));
        let errors = node.at("pin_errors_m").written();
        if let Some(errors) = errors.clone().filter(|errors| errors.items().len() != positions.len()) {
            errors.refuse(
                format!("{} numbers, one for each planet", positions.len()),
                "write one number for each planet",
            );
        }
        let errors = errors.map_or_else(Vec::new, |errors| errors.numbers());
        self.gearbox.coaxial.extend([[sun_shaft, carrier], [ring_shaft, carrier]]);
        let sun = self.gear(&sun_node, format!("{stage} sun"), sun_shaft, [false, false]);
        let ring = self.gear(&ring_node, format!("{stage} ring"), ring_shaft, [false, true]);
        let rack = mesh::read_rack(&node.at("rack"));
        let mut meshes = [Vec::new(), Vec::new()];
        let distance = node.at("centre_distance_m").written().map(|distance| distance.number());
        let first = self.gearbox.shafts.len();
        self.stages.push((node.clone(), (first..first + positions.len()).collect()));
        for (i, position) in positions.into_iter().enumerate() {
            let name = format!("{stage} planet {}", i + 1);
            unique_name(node, &name, "shaft", self.gearbox.shafts.iter().map(|shaft| shaft.name.as_str()));
            self.gearbox.shafts.push(Shaft {
                name: name.clone(),
                position: None,
                carried: Some((carrier, position)),
                offset: [0.0, errors.get(i).copied().unwrap_or(0.0)],
                is_fixed: false,
                rpm: None,
                mass: 0.0,
                inertia: 0.0,
                radius: None,
                translation: planet_node.at("translation").written().map(|support| read_support(&support)),
                axial: planet_node.at("axial").written().map(|support| read_support(&support)),
                rotation: Support::FREE,
                torque: Torque::Given(0.0),
                drag: read_drag(&planet_node.at("drag")),
                orders: Vec::new(),
                motion: Vec::new(),
            });
            self.shafts.push(planet_node.clone());
            let shaft = self.gearbox.shafts.len() - 1;
            let planet = self.gear(&planet_node, name.clone(), shaft, [false, false]);
            // The friction is that of the planet on its pin.
            self.gearbox.gears[planet].drag = Drag::default();
            let mesh = |stem: &str, gears, angle| {
                let name = format!("{stage} {stem}-planet {}", i + 1);
                GearMesh { name, gears, rack, angle, distance, phase: None }
            };
            meshes[0].push(mesh("sun", [sun, planet], Some(position)));
            meshes[1].push(mesh("ring", [planet, ring], Some(position + std::f64::consts::PI)));
        }
        for (own, key) in meshes.into_iter().zip(["sun_mesh", "ring_mesh"]) {
            for mesh in own {
                self.gearbox.meshes.push(mesh);
                self.meshes.push([node.clone(), node.at(key)]);
            }
        }
    }
}

/// Refuses a name that is empty or taken.
fn unique<'n>(node: &Node, what: &str, taken: impl Iterator<Item = &'n str>) {
    unique_name(node, node.text(), what, taken);
}

fn unique_name<'n>(node: &Node, name: &str, what: &str, mut taken: impl Iterator<Item = &'n str>) {
    if name.is_empty() || taken.any(|other| other == name) {
        let found = format!("a second {what} called \"{name}\"");
        node.fault(found, "a name of its own", format!("write a different name for each {what}"));
    }
}

/// Returns the index of the part with the name at this place.
fn find(node: &Node, what: &str, names: &[&str]) -> Option<usize> {
    let found = names.iter().position(|name| *name == node.text());
    if found.is_none() {
        let near = fault::nearest(node.text(), names.iter().copied());
        let remedy =
            near.map_or_else(|| format!("name one of the {what}s"), |near| format!("did you mean \"{near}\"?"));
        node.refuse(format!("the name of a {what}: {}", names.join(", ")), remedy);
    }
    found
}

/// Returns the indices of two different parts.
fn both(node: &Node, what: &str, names: &[&str]) -> Option<[usize; 2]> {
    let found: Vec<Option<usize>> = node.items().iter().map(|item| find(item, what, names)).collect();
    let [Some(one), Some(two)] = found[..] else { return None };
    if one == two {
        node.fault(
            format!("the {what} \"{}\" twice", names[one]),
            format!("two different {what}s"),
            format!("name another {what}"),
        );
        return None;
    }
    Some([one, two])
}

fn read_torsion(node: &Node) -> Support {
    plausible::support(node);
    let viscous = node.at("damping_nm_s_per_rad").written().map_or(0.0, |damping| damping.number());
    let ratio = node.at("damping_ratio").written().map(|ratio| Damping::Ratio(ratio.number()));
    let stiffness = node.at("stiffness_nm_per_rad").written().map_or(0.0, |stiffness| stiffness.number());
    Support { stiffness, damping: ratio.unwrap_or(Damping::Viscous(viscous)) }
}

fn read_drag(node: &Node) -> Drag {
    Drag { constant: node.at("torque_nm").number(), viscous: node.at("torque_nm_s_per_rad").number() }
}

/// Returns the orders of a torque or a speed that is given as a curve over a turn, and its mean.
fn measured(node: &Node, is_torque: bool) -> Option<(f64, Vec<Order>)> {
    let (units, of): (&[_], fn(f64) -> Amplitude) =
        if is_torque { (&curve::TORQUES, Amplitude::Torque) } else { (&curve::SPEEDS, Amplitude::Speed) };
    let HarmonicSeries { mean, harmonics, .. } = curve::series(node, &curve::read(node, units)?, CurveShape::Spline);
    let order = |h: MeshHarmonic| Order { order: h.order, amplitude: of(h.amplitude), phase: h.phase };
    Some((mean, harmonics.into_iter().map(order).collect()))
}

/// Returns mean and orders from a list of orders, from columns, or from a curve.
fn read_orders(node: &Node, is_torque: bool) -> (f64, Vec<Order>) {
    type OrderKey = (&'static str, fn(f64) -> Amplitude);
    let kinds: [OrderKey; 4] = [
        ("torque_nm", Amplitude::Torque),
        ("angle_rad", Amplitude::Angle),
        ("speed_rpm", |rpm| Amplitude::Speed(rpm * RPM)),
        ("acceleration_rad_per_s2", Amplitude::Acceleration),
    ];
    let written = |node: &Node| kinds.iter().find_map(|(key, of)| Some((node.at(key).written()?.number(), *of)));
    if node.is_list() {
        let order = |item: &Node| {
            let (value, of) = written(item).unwrap_or((0.0, Amplitude::Torque));
            let phase = harmonics::read_phase(item, "cosine");
            Order { order: item.at("order").number(), amplitude: of(value), phase }
        };
        return (0.0, node.items().iter().map(order).collect());
    }
    if curve::is_curve(node) {
        return measured(node, is_torque).unwrap_or_default();
    }
    let Some((key, of)) = kinds.iter().find(|(key, _)| node.at(key).written().is_some()) else {
        return Default::default();
    };
    let (orders, values) = (node.at("order").numbers(), node.at(key).numbers());
    let phases = node.at("phase_rad").written().map_or_else(|| vec![0.0; orders.len()], |phases| phases.numbers());
    for (column, found) in [(*key, values.len()), ("phase_rad", phases.len())] {
        if found != orders.len() {
            let allowed = format!("{} numbers, one for each order", orders.len());
            node.at(column).refuse(allowed, "write one number for each order");
        }
    }
    let rows = orders.into_iter().zip(values).zip(phases);
    (0.0, rows.map(|((order, value), phase)| Order { order, amplitude: of(value), phase }).collect())
}
