//! Speeds, centres and teeth of a gearbox, from its tooth numbers and its geometry.

use std::f64::consts::TAU;

use num_traits::{Signed, Zero};

use super::{
    Gearbox, GearboxFault, Hand, Part,
    kinematics::{Condition, Speed, SpeedFault, speeds},
    phases,
};
use crate::gear::{MeshGeometry, MeshKind};

/// Largest difference of a centre distance from that without play, in modules: allowances of teeth and centres are smaller.
const PLAY: f64 = 0.1;
/// Rounding of directions in a scene, rad.
const SAME_DIRECTION: f64 = 1e-6;

/// A mesh in place.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedMesh {
    /// Numbers of pinion and wheel.
    pub gears: [usize; 2],
    /// Geometry of the teeth in their working position, with the path of the driving gear.
    pub geometry: MeshGeometry,
    /// Direction from the pinion's centre to the pitch point, rad.
    pub pitch: f64,
    /// Sense in which the pinion pushes the wheel on the drive flank: 1 counter-clockwise, −1 clockwise.
    pub sense: f64,
    /// Sense of rotation of the pinion in the frame of the mesh; equal to `sense` if the pinion drives.
    pub turning: f64,
    /// Hand of the pinion, 1 right, −1 left.
    pub hand: f64,
    /// Mesh frequency over the speed in turns.
    pub(super) orders: Speed,
    /// Mesh phase γ, periods.
    pub phase: f64,
}

/// The kinematics of a gearbox.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Given speed, rad/s, ≥ 0.
    pub(super) omega: f64,
    /// Speeds of the shafts relative to the given one.
    pub(super) shafts: Vec<Speed>,
    /// Speeds of the gears relative to the given one.
    pub(super) gears: Vec<Speed>,
    /// Centres of the shafts, m, at time 0.
    pub centres: Vec<[f64; 2]>,
    /// Meshes.
    pub lines: Vec<PlacedMesh>,
}

/// The given speed, rad/s, and the speeds of shafts and gears relative to it.
type Turning = (f64, Vec<Speed>, Vec<Speed>);
/// Centres of the shafts, and the meshes between them.
type ShaftCentres = (Vec<[f64; 2]>, Vec<PlacedMesh>);

impl Layout {
    /// Mean speed of shaft `i`, rad/s, counter-clockwise positive.
    #[must_use]
    pub fn speed(&self, i: usize) -> f64 {
        self.rate(self.shafts[i])
    }

    /// Mesh frequency of mesh `i`, Hz.
    #[must_use]
    pub fn mesh_frequency(&self, i: usize) -> f64 {
        self.rate(self.lines[i].orders) / TAU
    }

    /// Mean speed of a gear, rad/s.
    #[must_use]
    pub fn gear_speed(&self, gear: usize) -> f64 {
        self.rate(self.gears[gear])
    }

    /// Base radius of a gear, m, if it is in mesh.
    pub(super) fn base_radius(&self, gear: usize) -> Option<f64> {
        let of = |line: &PlacedMesh| Some(line.geometry.base_radii[line.gears.iter().position(|g| *g == gear)?]);
        self.lines.iter().find_map(of)
    }

    /// Speed in rad/s. The ratio of two speeds is exact to rounding.
    pub(super) fn rate(&self, speed: Speed) -> f64 {
        self.omega * ratio(speed)
    }
}

impl Gearbox {
    /// Shaft that carries the axis of one of two gears in mesh around the other.
    pub(super) fn frame_of(&self, gears: [usize; 2]) -> Option<usize> {
        gears.iter().find_map(|gear| self.shafts[self.gears[*gear].shaft].carried).map(|(carrier, _)| carrier)
    }

    /// Speeds, centres, hands and phases.
    ///
    /// # Errors
    /// Returns all faults: trains that are undetermined, over-determined or contradictory, centre distances that do not close, hands that
    /// do not match, teeth that do not fit.
    pub fn layout(&self) -> Result<Layout, Vec<GearboxFault>> {
        let mut faults = Vec::new();
        let speeds = self.solve_speeds().map_err(|found| faults.extend(found));
        let lines = self.place().map_err(|found| faults.extend(found));
        let hands = self.hands().map_err(|found| faults.extend(found));
        let (Ok((omega, shafts, gears)), Ok((centres, mut lines)), Ok(hands)) = (speeds, lines, hands) else {
            return Err(faults);
        };
        for (line, mesh) in lines.iter_mut().zip(&self.meshes) {
            let [pinion, wheel] = line.gears;
            let carrier = self.frame_of(line.gears).map_or_else(Speed::zero, |carrier| shafts[carrier]);
            let turning = gears[pinion] - carrier;
            line.turning = if turning.is_negative() { -1.0 } else { 1.0 };
            // A driving wheel pushes the pinion forward, so the pinion pushes it back.
            line.sense = if mesh.gears[0] == wheel { -line.turning } else { line.turning };
            line.orders = turning.abs() * Speed::from(i128::from(self.gears[pinion].teeth.teeth));
            line.hand = match hands[pinion] {
                Hand::Right => 1.0,
                Hand::Left => -1.0,
            };
        }
        phases::set(self, &mut lines)?;
        Ok(Layout { omega, shafts, gears, centres, lines })
    }

    /// The given speed, rad/s, and the speeds of shafts and gears relative to it.
    fn solve_speeds(&self) -> Result<Turning, Vec<GearboxFault>> {
        let given: Vec<usize> = (0..self.shafts.len()).filter(|i| self.shafts[*i].rpm.is_some()).collect();
        let [driver] = given[..] else {
            let names = given.iter().map(|i| self.shafts[*i].name.as_str()).collect::<Vec<_>>().join(", ");
            let (part, found) = match given.get(1) {
                Some(second) => (Part::Shaft(*second), format!("the speed of {} shafts: {names}", given.len())),
                None => (Part::Train, "no shaft with a speed".to_owned()),
            };
            let remedy = "write speed_rpm on one shaft only: the other speeds follow from the teeth";
            return Err(vec![GearboxFault::new(part, "speed_rpm", found, "the speed of one shaft", remedy)]);
        };
        // Bodies are the shafts, then the gears.
        let body = |gear: usize| self.shafts.len() + gear;
        let mut parts = Vec::new();
        let mut conditions = Vec::new();
        let mut add = |part, name: String, terms: Vec<(usize, i128)>, value| {
            parts.push(part);
            conditions.push(Condition { name, terms, value });
        };
        for (i, shaft) in self.shafts.iter().enumerate() {
            if i == driver {
                add(Part::Shaft(i), format!("the speed of {}", shaft.name), vec![(i, 1)], 1);
            }
            if shaft.is_fixed {
                add(Part::Shaft(i), format!("{}, which is fixed", shaft.name), vec![(i, 1)], 0);
            }
        }
        for (i, gear) in self.gears.iter().enumerate().filter(|(_, gear)| !gear.is_loose) {
            add(Part::Gear(i), format!("gear {}", gear.name), vec![(body(i), 1), (gear.shaft, -1)], 0);
        }
        for (i, mesh) in self.meshes.iter().enumerate() {
            let [one, two] = mesh.gears;
            let sign = if mesh.kind(&self.gears) == MeshKind::External { 1 } else { -1 };
            let teeth = [one, two].map(|gear| i128::from(self.gears[gear].teeth.teeth));
            let mut terms = vec![(body(one), teeth[0]), (body(two), sign * teeth[1])];
            if let Some(carrier) = self.frame_of(mesh.gears) {
                terms.push((carrier, -teeth[0] - sign * teeth[1]));
            }
            add(Part::Mesh(i), format!("mesh {}", mesh.name), terms, 0);
        }
        for (i, coupling) in self.couplings.iter().enumerate().filter(|(_, c)| c.rotation.is_some()) {
            let [one, two] = coupling.shafts;
            add(Part::Coupling(i), format!("coupling {}", coupling.name), vec![(one, 1), (two, -1)], 0);
        }
        let bodies = self.shafts.len() + self.gears.len();
        let of_body = |i: usize| match i.checked_sub(self.shafts.len()) {
            Some(gear) => (Part::Gear(gear), self.gears[gear].name.as_str()),
            None => (Part::Shaft(i), self.shafts[i].name.as_str()),
        };
        let fault = |part, found: String, allowed: &str, remedy: &str| {
            vec![GearboxFault::new(part, "", found, allowed, remedy)]
        };
        let solved = match speeds(bodies, &conditions) {
            Ok(solved) => solved,
            Err(SpeedFault::Free(free)) => {
                // A gear fixed to a free shaft adds no condition.
                let own = |i: &&usize| i.checked_sub(self.shafts.len()).is_none_or(|gear| self.gears[gear].is_loose);
                let names: Vec<&str> = free.iter().filter(own).map(|i| of_body(*i).1).collect();
                let found = format!("nothing that determines the speed of {}", names.join(", "));
                return Err(fault(
                    of_body(free[0]).0,
                    found,
                    "bodies that meshes, couplings or \"fixed\" tie to the given speed",
                    "add a mesh or a coupling to each, fix a member of a planetary stage, or remove the body",
                ));
            }
            Err(SpeedFault::Contradiction(used)) => {
                let names: Vec<&str> = used.iter().map(|i| conditions[*i].name.as_str()).collect();
                let place = used.iter().rev().map(|i| parts[*i]).find(|part| matches!(part, Part::Mesh(_)));
                return Err(fault(
                    place.unwrap_or(Part::Train),
                    format!("a train that cannot turn: these contradict each other: {}", names.join(", ")),
                    "meshes, couplings and fixed shafts that one speed satisfies",
                    "remove one of them, make a gear loose, or change tooth numbers",
                ));
            }
            Err(SpeedFault::Range) => {
                let (allowed, remedy) = ("speed ratios whose fractions have up to 38 digits", "use fewer stages");
                return Err(fault(Part::Train, "a speed ratio of too many digits".to_owned(), allowed, remedy));
            }
        };
        let still = |i: &usize| solved[*i].is_zero() && !self.shafts[*i].is_fixed;
        let locked: Vec<usize> = (0..self.shafts.len()).filter(still).collect();
        if !locked.is_empty() {
            let names: Vec<&str> = locked.iter().map(|i| self.shafts[*i].name.as_str()).collect();
            return Err(fault(
                Part::Shaft(locked[0]),
                format!("shafts that cannot turn: {}", names.join(", ")),
                "shafts that turn, or are fixed",
                "open the loop of meshes that locks them, or write \"fixed\": true",
            ));
        }
        let (shafts, gears) = solved.split_at(self.shafts.len());
        // A negative speed reverses everything.
        let rpm = self.shafts[driver].rpm.unwrap_or(0.0);
        let turned = |speeds: &[Speed]| speeds.iter().map(|v| if rpm < 0.0 { -*v } else { *v }).collect();
        Ok((rpm.abs() * TAU / 60.0, turned(shafts), turned(gears)))
    }

    /// Hands of all gears: opposite for partners, equal in a ring mesh. The first undetermined hand is right.
    fn hands(&self) -> Result<Vec<Hand>, Vec<GearboxFault>> {
        let mut hands: Vec<Option<Hand>> = self.gears.iter().map(|gear| gear.hand).collect();
        let partner = |mesh: &super::GearMesh, hand: Hand| {
            if mesh.kind(&self.gears) == MeshKind::Internal { hand } else { hand.other() }
        };
        loop {
            let mut is_done = true;
            for mesh in &self.meshes {
                let [one, two] = mesh.gears;
                for (known, other) in [(one, two), (two, one)] {
                    if let (Some(hand), None) = (hands[known], hands[other]) {
                        hands[other] = Some(partner(mesh, hand));
                        is_done = false;
                    }
                }
            }
            if is_done {
                match hands.iter_mut().find(|hand| hand.is_none()) {
                    Some(open) => *open = Some(Hand::Right),
                    None => break,
                }
            }
        }
        let hands: Vec<Hand> = hands.into_iter().flatten().collect();
        let wrong = |(_, mesh): &(usize, &super::GearMesh)| {
            let [one, two] = mesh.gears;
            mesh.rack.helix_angle > 0.0 && hands[two] != partner(mesh, hands[one])
        };
        let faults: Vec<GearboxFault> = self
            .meshes
            .iter()
            .enumerate()
            .filter(wrong)
            .map(|(i, mesh)| {
                let [one, two] = mesh.gears.map(|gear| self.gears[gear].name.as_str());
                let found = format!("hands of {one} and {two} that do not match");
                let allowed = "opposite hands of two external gears, the same hand of a pinion and its ring";
                GearboxFault::new(Part::Mesh(i), "gears", found, allowed, "write another hand, or none")
            })
            .collect();
        if faults.is_empty() { Ok(hands) } else { Err(faults) }
    }

    /// Places the shafts and the meshes; senses, hands and phases are set later.
    fn place(&self) -> Result<ShaftCentres, Vec<GearboxFault>> {
        let mut faults = Vec::new();
        let free: Vec<Option<MeshGeometry>> = (0..self.meshes.len())
            .map(|i| {
                let mesh = &self.meshes[i];
                let [pinion, wheel] = mesh.pair(&self.gears).map(|gear| self.gears[gear].teeth);
                let found = MeshGeometry::new(&mesh.rack, pinion, wheel, mesh.kind(&self.gears));
                found.map_err(|error| faults.push(teeth_fault(i, &error.to_string()))).ok()
            })
            .collect();
        faults.extend(self.meshes.iter().enumerate().filter_map(|(i, mesh)| self.second_rack(i, mesh)));
        let free: Vec<MeshGeometry> = free.into_iter().flatten().collect();
        if !faults.is_empty() {
            return Err(faults);
        }
        let centres = self.centres(&free);
        let mut lines = Vec::new();
        for (i, mesh) in self.meshes.iter().enumerate() {
            let [from, to] = mesh.gears.map(|gear| centres[self.gears[gear].shaft]);
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let (distance, direction) = (libm::hypot(dx, dy), libm::atan2(dy, dx));
            let wanted = free[i].centre_distance;
            let name = &mesh.name;
            if (distance - wanted).abs() > PLAY * mesh.rack.module {
                faults.push(GearboxFault::new(
                    Part::Mesh(i),
                    "gears",
                    format!("{name}: shafts {distance:.6} m apart"),
                    format!("the centre distance of the teeth, {wanted:.6} m, to {PLAY} of a module"),
                    "move a shaft, or change tooth numbers, module or profile shifts",
                ));
                continue;
            }
            if let Some(angle) = mesh.angle.filter(|angle| {
                let turned = (direction - angle) / TAU;
                (turned - turned.round()).abs() * TAU > SAME_DIRECTION
            }) {
                faults.push(GearboxFault::new(
                    Part::Mesh(i),
                    "angle_deg",
                    format!("{name}: an angle of {:.6} deg", angle.to_degrees()),
                    format!("the direction of the shafts, {:.6} deg", direction.to_degrees()),
                    "leave the angle out: it follows from the places of the shafts",
                ));
                continue;
            }
            // Without play, the geometry of the teeth alone is exact to the last bit.
            let same = (distance - wanted).abs() <= 1e-12 * wanted;
            let gears = mesh.pair(&self.gears);
            let geometry = if same {
                Ok(free[i])
            } else {
                let [pinion, wheel] = gears.map(|gear| self.gears[gear].teeth);
                MeshGeometry::at_distance(&mesh.rack, pinion, wheel, free[i].kind, distance)
            };
            let geometry = match geometry {
                Ok(geometry) if gears[0] == mesh.gears[0] => geometry,
                Ok(geometry) => geometry.reversed(),
                Err(error) => {
                    faults.push(teeth_fault(i, &error.to_string()));
                    continue;
                }
            };
            // The pitch point of a ring lies beyond the pinion, seen from the centre of the ring.
            let is_from_pinion = free[i].kind == MeshKind::Internal && gears[0] == mesh.gears[0];
            let written = mesh.angle.unwrap_or(direction);
            let pitch = if is_from_pinion { turned_back(written) } else { written };
            // The mesh is then the same in the axes of every planet of a stage, to the last bit.
            let carried = mesh.gears.iter().filter_map(|gear| self.shafts[self.gears[*gear].shaft].carried);
            let pitch = carried.map(|(_, psi)| psi).find(|psi| is_rounding(psi - pitch)).unwrap_or(pitch);
            lines.push(PlacedMesh {
                gears,
                geometry,
                pitch,
                sense: 1.0,
                turning: 1.0,
                hand: 1.0,
                orders: Speed::zero(),
                phase: 0.0,
            });
        }
        if faults.is_empty() { Ok((centres, lines)) } else { Err(faults) }
    }

    /// Reports a gear of mesh `i` that has another rack in an earlier mesh.
    fn second_rack(&self, i: usize, mesh: &super::GearMesh) -> Option<GearboxFault> {
        let teeth = |mesh: &super::GearMesh| [mesh.rack.module, mesh.rack.pressure_angle, mesh.rack.helix_angle];
        let other = self.meshes[..i].iter().find_map(|other| {
            let gear = other.gears.iter().find(|gear| mesh.gears.contains(gear))?;
            (teeth(other) != teeth(mesh)).then_some((other, *gear))
        });
        other.map(|(other, gear)| {
            let found = format!("{}: another rack than {} gives to {}", mesh.name, other.name, self.gears[gear].name);
            let allowed = "one module, pressure angle and helix angle for each gear";
            GearboxFault::new(
                Part::Mesh(i),
                "rack",
                found,
                allowed,
                "write the same rack, or use two gears on the shaft",
            )
        })
    }

    /// Centres as given, else from the meshes and axes that lead to them.
    fn centres(&self, geometry: &[MeshGeometry]) -> Vec<[f64; 2]> {
        let mut centres: Vec<Option<[f64; 2]>> = self.shafts.iter().map(|shaft| shaft.position).collect();
        if centres.iter().all(Option::is_none)
            && let Some(first) = centres.first_mut()
        {
            *first = Some([0.0; 2]);
        }
        loop {
            let mut is_done = true;
            let mut set = |centres: &mut Vec<Option<[f64; 2]>>, ends: [usize; 2], step: [f64; 2]| {
                for (from, to, sign) in [(ends[0], ends[1], 1.0), (ends[1], ends[0], -1.0)] {
                    if let (Some([x, y]), None) = (centres[from], centres[to]) {
                        centres[to] = Some([x + sign * step[0], y + sign * step[1]]);
                        is_done = false;
                    }
                }
            };
            for ends in &self.coaxial {
                set(&mut centres, *ends, [0.0; 2]);
            }
            for (mesh, geometry) in self.meshes.iter().zip(geometry) {
                let (sin, cos) = libm::sincos(mesh.angle.unwrap_or(0.0));
                let distance = mesh.distance.unwrap_or(geometry.centre_distance);
                set(&mut centres, mesh.gears.map(|gear| self.gears[gear].shaft), [distance * cos, distance * sin]);
            }
            if is_done {
                // A shaft without a determined place stands apart; its place has no effect.
                match centres.iter_mut().find(|centre| centre.is_none()) {
                    Some(apart) => *apart = Some([0.0; 2]),
                    None => return centres.into_iter().flatten().collect(),
                }
            }
        }
    }
}

/// A fraction as a number.
pub(super) fn ratio(speed: Speed) -> f64 {
    *speed.numer() as f64 / *speed.denom() as f64
}

/// Returns whether a difference of angles, periods or ratios near one comes from rounding.
pub(super) fn is_rounding(difference: f64) -> bool {
    difference.abs() <= 64.0 * f64::EPSILON
}

fn turned_back(angle: f64) -> f64 {
    angle + if angle > 0.0 { -0.5 * TAU } else { 0.5 * TAU }
}

fn teeth_fault(mesh: usize, found: &str) -> GearboxFault {
    let (allowed, remedy) = ("teeth that mesh", "change tooth numbers, profile shifts, or the centre distance");
    GearboxFault::new(Part::Mesh(mesh), "gears", found, allowed, remedy)
}
