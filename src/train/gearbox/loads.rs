//! Masses, torques and frictions of a gearbox, and their faults.

use super::{Drag, GearMesh, Gearbox, GearboxFault, Layout, Order, Part, Shaft, Torque, layout::ratio};

/// Mass of a rigid support, kg: far above all others, with products that a double holds.
pub(super) const FRAME: f64 = 1e30;
/// Largest relative imbalance of torques: rounding of the numbers in a scene.
const BALANCED: f64 = 1e-6;

pub(super) fn sign(x: f64) -> f64 {
    if x < 0.0 { -1.0 } else { 1.0 }
}

impl Gearbox {
    /// Faults of masses, supports, torques and orders.
    #[must_use]
    pub fn faults(&self, layout: &Layout) -> Vec<GearboxFault> {
        let mut faults = Vec::new();
        for (i, shaft) in self.shafts.iter().enumerate() {
            let mut fault = |key, found: &str, allowed: &str, remedy: &str| {
                faults.push(GearboxFault::new(
                    Part::Shaft(i),
                    key,
                    format!("{}: {found}", shaft.name),
                    allowed,
                    remedy,
                ));
            };
            if self.turns(i) && self.inertia(i) <= 0.0 {
                let remedy = "write inertia_kg_m2 on the shaft or a gear fixed on it";
                fault("inertia_kg_m2", "no inertia", "a shaft with inertia > 0", remedy);
            }
            let moves = [("translation", shaft.translation), ("axial", shaft.axial)];
            for (key, support) in moves {
                let Some(support) = support else { continue };
                if self.mass(i) <= 0.0 {
                    fault(
                        "mass_kg",
                        "no mass",
                        "a mass > 0 of a shaft that moves",
                        "write mass_kg on the shaft or a gear on it",
                    );
                }
                let joined = |c: &&super::Coupling| {
                    c.shafts.contains(&i) && if key == "axial" { c.axial.is_some() } else { c.translation.is_some() }
                };
                if support.stiffness <= 0.0 && !self.couplings.iter().any(|c| joined(&c)) {
                    let remedy =
                        "write its stiffness, couple it to a shaft that is held, or leave the key out to hold it fast";
                    fault(key, "a shaft that nothing holds", "a stiffness > 0 of its bearings", remedy);
                }
            }
            if shaft.translation.is_some() && shaft.carried.is_none() {
                let is_here = |mesh: &&GearMesh| mesh.gears.iter().any(|gear| self.gears[*gear].shaft == i);
                let mut frames = self.meshes.iter().filter(is_here).map(|mesh| self.frame_of(mesh.gears));
                let first = frames.next();
                if frames.any(|frame| Some(frame) != first) {
                    let found = "a shaft that moves sideways and meshes with planets and with other gears";
                    let allowed = "meshes in one frame: equations with a turning and a fixed frame are not of constant coefficients";
                    fault("translation", found, allowed, "leave translation out");
                }
            }
            if !shaft.motion.is_empty()
                && (shaft.is_fixed || shaft.torque != Torque::Given(0.0) || !shaft.orders.is_empty())
            {
                let found = "a given motion beside torques or \"fixed\"";
                fault(
                    "motion",
                    found,
                    "either motion or torques: a given motion takes any torque",
                    "remove one of them",
                );
            }
            let standing = layout.speed(i) == 0.0;
            if standing && !(shaft.motion.is_empty() && shaft.orders.is_empty()) {
                fault(
                    "orders",
                    "orders of a shaft that stands still",
                    "orders of a shaft that turns",
                    "give a speed, or remove them",
                );
            }
        }
        faults.extend(self.gears.iter().enumerate().filter(|(_, gear)| gear.is_loose && gear.inertia <= 0.0).map(
            |(i, gear)| {
                let found = format!("{}: a loose gear without inertia", gear.name);
                GearboxFault::new(
                    Part::Gear(i),
                    "inertia_kg_m2",
                    found,
                    "an inertia > 0",
                    "write inertia_kg_m2 on the gear",
                )
            },
        ));
        for (i, gear) in self.gears.iter().enumerate().filter(|(_, gear)| gear.is_loose) {
            if self.shafts.iter().any(|shaft| shaft.name == gear.name) {
                let found = format!("a loose gear and a shaft called \"{}\"", gear.name);
                let remedy = "rename one of them: both name a rotation";
                faults.push(GearboxFault::new(Part::Gear(i), "name", found, "a name of its own", remedy));
            }
        }
        faults.extend(self.unbalanced(layout));
        faults
    }

    /// Returns whether the rotation of a shaft is a degree of freedom.
    pub(super) fn turns(&self, i: usize) -> bool {
        let shaft = &self.shafts[i];
        shaft.motion.is_empty() && !(shaft.is_fixed && shaft.rotation.stiffness == 0.0)
    }

    /// Speed of a body relative to the partner of its friction, rad/s.
    pub(super) fn slip(&self, layout: &Layout, part: Part) -> f64 {
        let (own, other) = match part {
            Part::Gear(i) if self.gears[i].is_loose => (layout.gears[i], Some(self.gears[i].shaft)),
            Part::Gear(i) => (layout.gears[i], None),
            Part::Shaft(i) => (layout.shafts[i], self.shafts[i].carried.map(|(carrier, _)| carrier)),
            _ => return 0.0,
        };
        layout.rate(other.map_or(own, |shaft| own - layout.shafts[shaft]))
    }

    /// All frictions.
    pub(super) fn drags(&self) -> impl Iterator<Item = (Part, Drag)> {
        let shafts = self.shafts.iter().enumerate().map(|(i, shaft)| (Part::Shaft(i), shaft.drag));
        let gears = self.gears.iter().enumerate().map(|(i, gear)| (Part::Gear(i), gear.drag));
        shafts.chain(gears).filter(|(_, drag)| *drag != Drag::default())
    }

    /// Power of given torques minus that of friction, over the given speed, N m, and the sum of the sizes of all parts.
    fn power(&self, layout: &Layout) -> (f64, f64) {
        // At rest the ratios of speeds still determine the balance of torques.
        let scale = if layout.omega > 0.0 { layout.omega } else { 1.0 };
        let speed = |i: usize| ratio(layout.shafts[i]).abs();
        let given = self.shafts.iter().enumerate().map(|(i, shaft)| match shaft.torque {
            Torque::Given(torque) => torque * speed(i),
            Torque::Balance => 0.0,
        });
        let lost = self.drags().map(|(part, drag)| {
            let slip = self.slip(layout, part).abs();
            -(drag.constant + drag.viscous * slip) * slip / scale
        });
        let parts: Vec<f64> = given.chain(lost).collect();
        (parts.iter().sum(), parts.iter().map(|x| x.abs()).sum())
    }

    fn unbalanced(&self, layout: &Layout) -> Option<GearboxFault> {
        let balance: Vec<usize> =
            (0..self.shafts.len()).filter(|i| self.shafts[*i].torque == Torque::Balance).collect();
        let allowed = "torques that keep the mean speed";
        match balance[..] {
            [] => {
                let (power, size) = self.power(layout);
                let held = self.shafts.iter().any(|shaft| !shaft.motion.is_empty() || shaft.rotation.stiffness > 0.0);
                let found = format!(
                    "torques that do not balance: {power:.6} N m, counted on the shaft of the given speed, are left over"
                );
                let remedy = "write \"torque_nm\": \"balance\" on the shaft that takes off the rest";
                (!held && power.abs() > BALANCED * size)
                    .then(|| GearboxFault::new(Part::Train, "shafts", found, allowed, remedy))
            }
            [one] if ratio(layout.shafts[one]) == 0.0 => Some(GearboxFault::new(
                Part::Shaft(one),
                "torque_nm",
                "\"balance\" on a shaft that stands still",
                allowed,
                "write it on a shaft that turns",
            )),
            [_] => None,
            [_, second, ..] => Some(GearboxFault::new(
                Part::Shaft(second),
                "torque_nm",
                format!("\"balance\" on {} shafts", balance.len()),
                "one shaft that takes off the rest",
                "give the torques of all shafts but one",
            )),
        }
    }

    /// Mean external torque on shaft `i`, N m, counter-clockwise positive.
    #[must_use]
    pub fn torque(&self, layout: &Layout, i: usize) -> f64 {
        self.along(layout, i) * sign(ratio(layout.shafts[i]))
    }

    /// Mean external torque on shaft `i`, N m, positive if it drives.
    fn along(&self, layout: &Layout, i: usize) -> f64 {
        match self.shafts[i].torque {
            Torque::Given(torque) => torque,
            Torque::Balance => -self.power(layout).0 / ratio(layout.shafts[i]).abs(),
        }
    }

    /// Returns the gearbox without the torques of shafts with schedules, given by number and whether the schedule repeats. The balancing
    /// torque takes up the mean of a repeating torque.
    pub(crate) fn without(&self, layout: &Layout, torques: &[(usize, bool)]) -> Self {
        let mut gearbox = self.clone();
        let drop = |gearbox: &mut Self, repeating: bool| {
            for (i, _) in torques.iter().filter(|(_, repeats)| *repeats == repeating) {
                gearbox.shafts[*i].torque = Torque::Given(0.0);
            }
        };
        drop(&mut gearbox, false);
        if let Some(rest) = gearbox.shafts.iter().position(|shaft| shaft.torque == Torque::Balance) {
            gearbox.shafts[rest].torque = Torque::Given(gearbox.along(layout, rest));
        }
        drop(&mut gearbox, true);
        gearbox
    }

    /// Returns the gearbox under a torque of 1 N m on one of those shafts alone; the balancing torque follows one that does not repeat.
    pub(crate) fn with_unit(&self, (i, repeats): (usize, bool)) -> Self {
        let mut gearbox = self.clone();
        gearbox.gears.iter_mut().for_each(|gear| gear.drag = Drag::default());
        for (k, shaft) in gearbox.shafts.iter_mut().enumerate() {
            shaft.drag = Drag::default();
            if k == i || repeats || shaft.torque != Torque::Balance {
                shaft.torque = Torque::Given(if k == i { 1.0 } else { 0.0 });
            }
        }
        gearbox
    }

    /// Rotary mass of a gear and everything that rotates with it, on its base circle, kg; with a given motion that of the frame.
    #[must_use]
    pub fn rotary_mass(&self, layout: &Layout, gear: usize) -> f64 {
        let (own, base) = (&self.gears[gear], layout.base_radius(gear).unwrap_or(1.0));
        let inertia = if own.is_loose { own.inertia } else { self.inertia(own.shaft) };
        if own.is_loose || self.turns(own.shaft) { inertia / (base * base) } else { FRAME }
    }

    /// Moment of inertia of a shaft with its fixed gears, kg m².
    pub(super) fn inertia(&self, i: usize) -> f64 {
        let fixed = self.gears.iter().filter(|gear| gear.shaft == i && !gear.is_loose);
        self.shafts[i].inertia + fixed.map(|gear| gear.inertia).sum::<f64>()
    }

    /// Mass of a shaft with its gears, kg.
    pub(super) fn mass(&self, i: usize) -> f64 {
        self.shafts[i].mass + self.gears.iter().filter(|gear| gear.shaft == i).map(|gear| gear.mass).sum::<f64>()
    }

    /// Fluctuation of the speeds over their means, by given motions and torques, of the train as one rigid body.
    fn fluctuation(&self, layout: &Layout) -> f64 {
        let shafts = (0..self.shafts.len()).map(|i| self.inertia(i) * ratio(layout.shafts[i]).powi(2));
        let loose = self.gears.iter().zip(&layout.gears).filter(|(gear, _)| gear.is_loose);
        let inertia = shafts.chain(loose.map(|(gear, speed)| gear.inertia * ratio(*speed).powi(2))).sum::<f64>();
        let of_shaft = |(i, shaft): (usize, &Shaft)| {
            let (speed, share) = (layout.speed(i).abs(), ratio(layout.shafts[i]).abs());
            let harmonic = |order: &Order| order.harmonic(order.order * speed);
            let motion = shaft.motion.iter().map(harmonic).map(|h| h.amplitude.abs() * h.omega / speed);
            let torque = shaft.orders.iter().map(harmonic);
            let torque = torque.map(|h| h.amplitude.abs() * share / (inertia * h.omega * layout.omega));
            motion.chain(torque).sum::<f64>()
        };
        self.shafts.iter().enumerate().map(of_shaft).sum()
    }

    /// Frictions of loose gears that may change their sign, which a run does not model.
    #[must_use]
    pub fn warnings(&self, layout: &Layout) -> Vec<(Part, String)> {
        let share = self.fluctuation(layout);
        let of = |(part, drag): (Part, Drag)| {
            let Part::Gear(i) = part else { return None };
            let gear = &self.gears[i];
            let slip = self.slip(layout, part).abs();
            // A gear off its flank does not follow the shaft: both may fluctuate against each other.
            let most = share * (layout.rate(layout.gears[i]).abs() + layout.speed(gear.shaft).abs());
            (gear.is_loose && drag.constant > 0.0 && most >= slip).then(|| {
                let text = format!(
                    "{} turns at {slip:.4} rad/s on its shaft, and this speed fluctuates by up to {most:.4} rad/s: the constant drag \
                     could change its sign, which this model leaves out",
                    gear.name
                );
                (part, text)
            })
        };
        self.drags().filter_map(of).collect()
    }
}
