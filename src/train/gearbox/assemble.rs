//! A gearbox in the common form.

use nalgebra::{DMatrix, DVector};

use super::{
    Gearbox, Layout, Part,
    kinematics::Speed,
    layout::is_rounding,
    loads::{FRAME, sign},
    phases,
};
use crate::{
    gear::{Harmonic, MeshKind},
    system::{LoadHarmonic, Spec},
    train::{
        Mesh, Support, TrainError,
        assembly::{Assembly, LineOfAction, Wheel},
        drawing::{Drawing, GearDrawing, point, rows},
        imposed::impose,
    },
};

/// Number of degrees of freedom of a shaft: x, y, u, w.
const OF_SHAFT: usize = 4;
const ROTATION: usize = 2;
const AXIAL: usize = 3;

impl Gearbox {
    /// Radius on which the rotation of each shaft is counted, m: as given, that of its planets' centres, the base radius of its first
    /// fixed gear, that of a shaft coupled to it, or the base radius of its first loose gear.
    #[must_use]
    pub fn radii(&self, layout: &Layout) -> Vec<f64> {
        let distance = |one: usize, two: usize| {
            let [a, b] = [layout.centres[one], layout.centres[two]];
            libm::hypot(a[0] - b[0], a[1] - b[1])
        };
        let of_gears = |i: usize, loose: bool| {
            let mut own =
                (0..self.gears.len()).filter(|g| self.gears[*g].shaft == i && self.gears[*g].is_loose == loose);
            own.find_map(|gear| layout.base_radius(gear))
        };
        let of_pins = |i: usize| {
            let carried = |shaft: &super::Shaft| shaft.carried.is_some_and(|(carrier, _)| carrier == i);
            self.shafts.iter().position(carried).map(|pin| distance(i, pin))
        };
        let own = |i: usize| self.shafts[i].radius.or_else(|| of_pins(i)).or_else(|| of_gears(i, false));
        let mut radii: Vec<Option<f64>> = (0..self.shafts.len()).map(own).collect();
        for _ in &self.shafts {
            for coupling in &self.couplings {
                let [one, two] = coupling.shafts;
                radii[one] = radii[one].or(radii[two]);
                radii[two] = radii[two].or(radii[one]);
            }
        }
        radii.into_iter().enumerate().map(|(i, r)| r.or_else(|| of_gears(i, true)).unwrap_or(1.0)).collect()
    }

    /// All degrees of freedom: shafts one by one, then the rotations of loose gears.
    fn freedoms(&self) -> Vec<String> {
        let of_shaft = |shaft: &super::Shaft| {
            let plane = if shaft.carried.is_some() { ["xi", "eta"] } else { ["x", "y"] };
            [plane[0], plane[1], "u", "w"].map(|stem| format!("{stem}_{}", shaft.name))
        };
        let loose = self.gears.iter().filter(|gear| gear.is_loose).map(|gear| format!("u_{}", gear.name));
        self.shafts.iter().flat_map(of_shaft).chain(loose).collect()
    }

    /// Returns the index of the rotation of a gear, and metres on its base circle per unit of that degree of freedom.
    fn rotation(&self, gear: usize, base_radius: f64, radii: &[f64]) -> (usize, f64) {
        let shaft = self.gears[gear].shaft;
        if self.gears[gear].is_loose {
            let before = self.gears[..gear].iter().filter(|gear| gear.is_loose).count();
            return (OF_SHAFT * self.shafts.len() + before, 1.0);
        }
        let lever = if base_radius == radii[shaft] { 1.0 } else { base_radius / radii[shaft] };
        (OF_SHAFT * shaft + ROTATION, lever)
    }

    /// Returns the gearbox in the common form, with the given meshes in order; their phases are those of the layout.
    ///
    /// Degrees of freedom are x, y, u and w of each shaft, as far as it has them (ξ, η if carried), then u of each loose gear. A shaft with
    /// a given motion has no u. The radius of `u = r θ` is that of [`radii`](Self::radii), for a loose gear its base radius.
    ///
    /// # Errors
    /// [`TrainError`] for values outside their ranges or a standing train with varying meshes.
    pub fn assemble(&self, layout: &Layout, meshes: &[Mesh]) -> Result<Spec, TrainError> {
        let (all, radii) = (self.freedoms(), self.radii(layout));
        let n = all.len();
        let mut assembly = Assembly::new(n);
        self.bodies(&mut assembly, layout, &radii);
        for (i, mesh) in meshes.iter().enumerate() {
            self.mesh(&mut assembly, layout, &radii, i, mesh)?;
        }
        let (kept, motions, p) = self.projection(layout, &radii, &all);
        let frequency = (0..layout.lines.len()).map(|i| layout.mesh_frequency(i)).find(|f| *f > 0.0);
        let spec = assembly.reduced(kept, &p, 1.0, frequency.unwrap_or(0.0));
        Ok(Spec { shared: self.shared(layout), ..impose(spec, &motions) })
    }

    /// Returns the drawing of the gearbox.
    #[must_use]
    pub fn drawing(&self, layout: &Layout) -> Drawing {
        let (all, radii) = (self.freedoms(), self.radii(layout));
        let (kept, _, p) = self.projection(layout, &radii, &all);
        let mut drawing = Drawing::default();
        for (i, line) in layout.lines.iter().enumerate() {
            let geometry = &line.geometry;
            let carrier = self.frame_of(line.gears).map_or_else(Speed::default, |carrier| layout.shafts[carrier]);
            for (k, gear) in line.gears.into_iter().enumerate() {
                let (own, base) = (&self.gears[gear], geometry.base_radii[k]);
                let shaft = own.shaft;
                let radius = base / libm::cos(geometry.pressure_angle);
                if k == 0 {
                    drawing.points.push(point(layout.centres[shaft], radius, line.pitch));
                }
                if drawing.gears.iter().any(|other| other.name == own.name) {
                    continue;
                }
                let (place, _) = self.rotation(gear, base, &radii);
                let turn = (place, if own.is_loose { base } else { radii[shaft] }.recip());
                let turned = self.shafts[shaft].carried.map_or(0.0, |(_, psi)| psi);
                let mut drawn = GearDrawing {
                    name: own.name.clone(),
                    centre: layout.centres[shaft],
                    radius,
                    teeth: own.teeth.teeth,
                    is_ring: k == 1 && geometry.kind == MeshKind::Internal,
                    angle: phases::tooth_angle(self, i, line, k),
                    speed: layout.rate(layout.gears[gear] - carrier),
                    motion: rows(all.len(), OF_SHAFT * shaft, turned, turn),
                };
                drawn.reduce(&p, kept.len());
                drawing.gears.push(drawn);
            }
        }
        drawing
    }

    /// Meshes of a central gear with the planets of one carrier.
    fn shared(&self, layout: &Layout) -> Vec<Vec<usize>> {
        let carrier = |gear: usize| self.shafts[self.gears[gear].shaft].carried.map(|(carrier, _)| carrier);
        let mut groups: Vec<([usize; 2], Vec<usize>)> = Vec::new();
        for (j, line) in layout.lines.iter().enumerate() {
            let key = match line.gears.map(carrier) {
                [None, Some(carrier)] => [line.gears[0], carrier],
                [Some(carrier), None] => [line.gears[1], carrier],
                _ => continue,
            };
            match groups.iter_mut().find(|(other, _)| *other == key) {
                Some((_, group)) => group.push(j),
                None => groups.push((key, vec![j])),
            }
        }
        groups.into_iter().map(|(_, group)| group).filter(|group| group.len() > 1).collect()
    }

    fn bodies(&self, assembly: &mut Assembly, layout: &Layout, radii: &[f64]) {
        let n = assembly.load.len();
        let one = |entries: &[(usize, f64)]| {
            let mut direction = DVector::zeros(n);
            entries.iter().for_each(|(row, value)| direction[*row] += value);
            direction
        };
        for (i, shaft) in self.shafts.iter().enumerate() {
            let (row, r) = (OF_SHAFT * i, radii[i]);
            let (mass, inertia) = (self.mass(i), self.inertia(i));
            [0, 1, AXIAL].iter().for_each(|k| assembly.mass[(row + k, row + k)] += mass);
            assembly.mass[(row + ROTATION, row + ROTATION)] += inertia / (r * r);
            let translation = shaft.translation.unwrap_or(Support::FREE);
            let axial = shaft.axial.unwrap_or(Support::FREE);
            match shaft.carried {
                None => {
                    let centre = [("x", one(&[(row, 1.0)])), ("y", one(&[(row + 1, 1.0)]))];
                    assembly.bearing(&shaft.name, &centre, translation, mass);
                    assembly.bearing(&shaft.name, &[("axial", one(&[(row + AXIAL, 1.0)]))], axial, mass);
                }
                Some((carrier, psi)) => {
                    let [radial, tangential] =
                        self.bearing(layout, radii, i, (carrier, psi)).map(|entries| one(&entries));
                    let centre = [("radial", radial), ("tangential", tangential)];
                    assembly.bearing(&shaft.name, &centre, translation, mass);
                    let along = one(&[(row + AXIAL, 1.0), (OF_SHAFT * carrier + AXIAL, -1.0)]);
                    assembly.bearing(&shaft.name, &[("axial", along)], axial, mass);
                }
            }
            assembly.join(&one(&[(row + ROTATION, 1.0 / r)]), shaft.rotation, inertia);
            assembly.load[row + ROTATION] += self.torque(layout, i) / r;
            for order in &shaft.orders {
                let harmonic = order.harmonic(order.order * layout.speed(i).abs());
                let vector = one(&[(row + ROTATION, sign(layout.speed(i)) * harmonic.amplitude / r)]);
                let (omega, phase) = (harmonic.omega, harmonic.phase);
                assembly.load_harmonics.push(LoadHarmonic { vector: vector.iter().copied().collect(), omega, phase });
            }
        }
        for coupling in &self.couplings {
            let [a, b] = coupling.shafts;
            let across =
                |k: usize, scale: [f64; 2]| one(&[(OF_SHAFT * a + k, scale[0]), (OF_SHAFT * b + k, -scale[1])]);
            // An end that is no degree of freedom is rigid.
            let reduced = |k: usize, own: &dyn Fn(usize) -> f64| {
                let [x, y] = coupling.shafts.map(|i| if self.moves(i, k) { own(i) } else { FRAME });
                x * y / (x + y)
            };
            if let Some(support) = coupling.rotation {
                let inertia = reduced(ROTATION, &|i| self.inertia(i));
                assembly.join(&across(ROTATION, coupling.shafts.map(|i| 1.0 / radii[i])), support, inertia);
            }
            for (k, support) in [(0, coupling.translation), (1, coupling.translation), (AXIAL, coupling.axial)] {
                if let Some(support) = support {
                    assembly.join(&across(k, [1.0; 2]), support, reduced(k, &|i| self.mass(i)));
                }
            }
        }
        for (i, gear) in self.gears.iter().enumerate().filter(|(_, gear)| gear.is_loose) {
            let base = layout.base_radius(i).unwrap_or(1.0);
            let (row, _) = self.rotation(i, base, radii);
            assembly.mass[(row, row)] += gear.inertia / (base * base);
        }
        for (part, drag) in self.drags() {
            // Rows of the body and of the partner of the friction, and their radii.
            let shaft = |i: usize| (OF_SHAFT * i + ROTATION, radii[i]);
            let (own, other) = match part {
                Part::Gear(i) if self.gears[i].is_loose => {
                    let base = layout.base_radius(i).unwrap_or(1.0);
                    ((self.rotation(i, base, radii).0, base), Some(shaft(self.gears[i].shaft)))
                }
                Part::Gear(i) => (shaft(self.gears[i].shaft), None),
                Part::Shaft(i) => (shaft(i), self.shafts[i].carried.map(|(carrier, _)| shaft(carrier))),
                _ => continue,
            };
            let slip = self.slip(layout, part);
            let mut relative = one(&[(own.0, 1.0 / own.1)]);
            if let Some((row, radius)) = other {
                relative[row] -= 1.0 / radius;
            }
            let mean = if slip == 0.0 { 0.0 } else { sign(slip) * drag.constant } + drag.viscous * slip;
            assembly.load -= mean * &relative;
            assembly.join(&relative, Support::viscous(0.0, drag.viscous), 1.0);
        }
    }

    /// Radial and tangential stretch of the bearing of carried shaft `i`.
    fn bearing(
        &self,
        layout: &Layout,
        radii: &[f64],
        i: usize,
        (carrier, psi): (usize, f64),
    ) -> [Vec<(usize, f64)>; 2] {
        let (sin, cos) = libm::sincos(psi);
        let [centre, pin] = [layout.centres[carrier], layout.centres[i]];
        let lever = libm::hypot(pin[0] - centre[0], pin[1] - centre[1]) / radii[carrier];
        let lever = if is_rounding(lever - 1.0) { 1.0 } else { lever };
        let (own, of) = (OF_SHAFT * i, OF_SHAFT * carrier);
        [
            vec![(own, 1.0), (of, -cos), (of + 1, -sin)],
            vec![(own + 1, 1.0), (of, sin), (of + 1, -cos), (of + ROTATION, -lever)],
        ]
    }

    fn mesh(
        &self,
        assembly: &mut Assembly,
        layout: &Layout,
        radii: &[f64],
        i: usize,
        mesh: &Mesh,
    ) -> Result<(), TrainError> {
        let line = &layout.lines[i];
        let geometry = &line.geometry;
        let action = LineOfAction {
            kind: geometry.kind,
            pitch: line.pitch,
            pressure_angle: geometry.pressure_angle,
            sense: line.sense,
            base_helix: line.hand * geometry.base_helix,
        };
        let wheel = |k: usize| {
            let gear = line.gears[k];
            let shaft = self.gears[gear].shaft;
            Wheel {
                centre: OF_SHAFT * shaft,
                turned: self.shafts[shaft].carried.map_or(0.0, |(_, psi)| psi),
                rotation: self.rotation(gear, geometry.base_radii[k], radii),
                axial: Some(OF_SHAFT * shaft + AXIAL),
            }
        };
        let n = assembly.load.len();
        let frequency = layout.mesh_frequency(i);
        let own = Mesh { phase: line.phase, ..mesh.clone() };
        let direction = action.direction(wheel(0), wheel(1), n);
        let contact = assembly.mesh(self.meshes[i].name.clone(), &direction, &own, frequency)?;
        let [nx, ny] = action.normal(0.0);
        let normal = libm::cos(geometry.base_helix);
        let carrier = self.frame_of(line.gears).map_or_else(Speed::default, |carrier| layout.shafts[carrier]);
        for (k, side) in [(0, 1.0), (1, -1.0)] {
            let gear = line.gears[k];
            let shaft = &self.shafts[self.gears[gear].shaft];
            let [ox, oy] = action.normal(shaft.carried.map_or(0.0, |(_, psi)| psi));
            contact.shift(-side * normal * (ox * shaft.offset[0] + oy * shaft.offset[1]));
            let (size, angle) = self.gears[gear].eccentricity;
            if size == 0.0 {
                continue;
            }
            // The centre of the teeth moves by size (cos, sin) of the angle: δ gains side n·x, and e loses it.
            let turning = layout.rate(layout.gears[gear] - carrier);
            let towards = libm::atan2(ny, nx);
            let phase = sign(turning) * (angle - towards);
            let wave = Harmonic { omega: turning.abs(), amplitude: -side * normal * size, phase };
            contact.errors_mut().for_each(|error| error.push(wave));
        }
        Ok(())
    }

    /// Returns whether degree of freedom `k` of shaft `i` is kept.
    fn moves(&self, i: usize, k: usize) -> bool {
        match k {
            ROTATION => self.turns(i),
            AXIAL => self.shafts[i].axial.is_some(),
            _ => self.shafts[i].translation.is_some(),
        }
    }

    /// Returns the kept degrees of freedom, the given motions with their indices after them, and P of `q_all = P q`.
    fn projection(
        &self,
        layout: &Layout,
        radii: &[f64],
        all: &[String],
    ) -> (Vec<String>, Vec<Vec<Harmonic>>, DMatrix<f64>) {
        let shafts = OF_SHAFT * self.shafts.len();
        let mut kept: Vec<usize> = (0..shafts).filter(|row| self.moves(row / OF_SHAFT, row % OF_SHAFT)).collect();
        kept.extend(shafts..all.len());
        let names = kept.iter().map(|row| all[*row].clone()).collect();
        let mut motions = Vec::new();
        for (i, shaft) in self.shafts.iter().enumerate().filter(|(_, shaft)| !shaft.motion.is_empty()) {
            let (speed, r) = (layout.speed(i), radii[i]);
            let harmonics = shaft.motion.iter().map(|order| {
                let harmonic = order.harmonic(order.order * speed.abs());
                Harmonic { amplitude: sign(speed) * r * harmonic.amplitude, ..harmonic }
            });
            motions.push(harmonics.collect());
            kept.push(OF_SHAFT * i + ROTATION);
        }
        let mut p = DMatrix::zeros(all.len(), kept.len());
        kept.iter().enumerate().for_each(|(column, row)| p[(*row, column)] = 1.0);
        // A carried centre without a support follows its carrier.
        for (i, shaft) in self.shafts.iter().enumerate() {
            let Some(carried) = shaft.carried else { continue };
            let mut follow = |row: usize, from: &[(usize, f64)]| {
                for (source, factor) in from {
                    if let Some(column) = kept.iter().position(|row| row == source) {
                        p[(row, column)] = -factor;
                    }
                }
            };
            for (k, stretch) in self.bearing(layout, radii, i, carried).iter().enumerate() {
                if shaft.translation.is_none() {
                    follow(OF_SHAFT * i + k, &stretch[1..]);
                }
            }
            if shaft.axial.is_none() {
                follow(OF_SHAFT * i + AXIAL, &[(OF_SHAFT * carried.0 + AXIAL, -1.0)]);
            }
        }
        (names, motions, p)
    }
}
