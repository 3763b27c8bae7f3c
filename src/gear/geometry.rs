//! Geometry of spur and helical gears: working pressure angle, base pitch, path of contact, and the stiffnesses that follow.
//!
//! Angles in rad, lengths in m. Module and pressure angle of a rack are those of the normal section; radii, paths and working angles lie in
//! the transverse plane. Internal meshes: the wheel is the ring, its tooth number counted positive and
//! its profile shift positive away from the centre.

use std::f64::consts::PI;

use thiserror::Error;

/// Standard reference rack of a gear set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasicRack {
    /// Normal module m, m, > 0.
    pub module: f64,
    /// Normal pressure angle α, rad, `(0, π/4)`.
    pub pressure_angle: f64,
    /// Helix angle β on the reference circle, rad, `[0, π/3]`, whatever the hand; 0 for spur gears.
    pub helix_angle: f64,
    /// Addendum in modules, usually 1.
    pub addendum: f64,
    /// Dedendum in modules, usually 1.25; only the ISO stiffness reads it.
    pub dedendum: f64,
}

impl BasicRack {
    /// Transverse module `m/cos β`, m.
    #[must_use]
    pub fn transverse_module(&self) -> f64 {
        self.module / libm::cos(self.helix_angle)
    }

    /// Transverse pressure angle α_t, rad: `tan α_t = tan α/cos β`.
    #[must_use]
    pub fn transverse_angle(&self) -> f64 {
        // Of spur gears the rack's own, to the last bit.
        if self.helix_angle == 0.0 {
            return self.pressure_angle;
        }
        libm::atan(libm::tan(self.pressure_angle) / libm::cos(self.helix_angle))
    }

    /// Base helix angle β_b, rad: `sin β_b = sin β cos α`.
    #[must_use]
    pub fn base_helix(&self) -> f64 {
        libm::asin(libm::sin(self.helix_angle) * libm::cos(self.pressure_angle))
    }

    /// Overlap ratio `ε_β = b sin β/(π m)` of a common face width b, m.
    #[must_use]
    pub fn overlap(&self, face_width: f64) -> f64 {
        face_width * libm::sin(self.helix_angle) / (PI * self.module)
    }
}

/// Teeth of one gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    /// Tooth number Z, ≥ 3.
    pub teeth: u32,
    /// Profile shift x, modules.
    pub shift: f64,
}

impl Gear {
    /// Pitch radius `m Z/(2 cos β)`, m.
    #[must_use]
    pub fn pitch_radius(&self, rack: &BasicRack) -> f64 {
        0.5 * rack.transverse_module() * f64::from(self.teeth)
    }

    /// Base radius `r cos α_t`, m.
    #[must_use]
    pub fn base_radius(&self, rack: &BasicRack) -> f64 {
        self.pitch_radius(rack) * libm::cos(rack.transverse_angle())
    }

    /// Tip radius of an external gear, `r + m (h_a + x)`, m.
    #[must_use]
    pub fn tip_radius(&self, rack: &BasicRack) -> f64 {
        self.pitch_radius(rack) + rack.module * (rack.addendum + self.shift)
    }

    /// Tip radius of a ring, `r − m (h_a − x)`, m.
    #[must_use]
    pub fn ring_tip_radius(&self, rack: &BasicRack) -> f64 {
        self.pitch_radius(rack) - rack.module * (rack.addendum - self.shift)
    }

    /// Tooth thickness on the pitch circle, `(π m/2 + 2 x m tan α)/cos β`, m; of a ring the width of its spaces.
    #[must_use]
    pub fn tooth_thickness(&self, rack: &BasicRack) -> f64 {
        rack.transverse_module() * (0.5 * PI + 2.0 * self.shift * libm::tan(rack.pressure_angle))
    }

    /// Half the angle of a tooth (of a ring: of a space) on the working pitch circle, `s/(2 r) + inv α_t − inv α_w`, rad.
    #[must_use]
    pub fn half_tooth_angle(&self, rack: &BasicRack, working_angle: f64) -> f64 {
        let reference = 0.5 * self.tooth_thickness(rack) / self.pitch_radius(rack);
        reference + involute(rack.transverse_angle()) - involute(working_angle)
    }
}

/// Kind of a mesh of two gears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshKind {
    /// Two external gears.
    External,
    /// An external pinion inside a ring.
    Internal,
}

/// Path of contact of a tooth pair, in base pitches about the pitch point: each transverse section is in contact for `−A ≤ τ ≤ R`.
///
/// The clock τ is that of the section in the middle of the face width. Helical teeth come into contact `ε_β/2` earlier at the first end of
/// the face width, and leave contact as much later at the other end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathOfContact {
    /// Approach A (limited by the driven gear's tip), base pitches, ≥ 0.
    pub approach: f64,
    /// Recess R (limited by the driving gear's tip), base pitches, ≥ 0.
    pub recess: f64,
    /// Overlap ratio ε_β, ≥ 0; 0 for spur gears.
    pub overlap: f64,
}

impl PathOfContact {
    /// Transverse contact ratio ε = A + R.
    #[must_use]
    pub fn contact_ratio(&self) -> f64 {
        self.approach + self.recess
    }
}

/// Reason for which a pair of gears cannot mesh.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum GeometryError {
    /// The profile shifts leave no positive working pressure angle.
    #[error("no working pressure angle: its involute would be {0}")]
    PressureAngle(f64),
    /// The ring has no more teeth than its pinion.
    #[error("a ring of {ring} teeth cannot hold a pinion of {pinion}")]
    Ring {
        /// Teeth of the pinion.
        pinion: u32,
        /// Teeth of the ring.
        ring: u32,
    },
    /// The base circles do not leave a line of action at this centre distance.
    #[error("a centre distance of {distance} m: the base circles need more than {bases} m")]
    Distance {
        /// Centre distance, m.
        distance: f64,
        /// Sum of the base radii, or their difference in a ring, m.
        bases: f64,
    },
    /// A tip does not reach the pitch point, or passes the point where the line of action leaves a base circle.
    #[error("tip radius {radius} m: the {part} of {length} m is outside (0, {limit} m)")]
    Tip {
        /// Tip radius, m.
        radius: f64,
        /// `approach` or `recess`.
        part: &'static str,
        /// Length of this part on the line of action, m.
        length: f64,
        /// Longest possible, m.
        limit: f64,
    },
}

/// A mesh in working position. The pinion drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshGeometry {
    /// External or internal.
    pub kind: MeshKind,
    /// Working pressure angle α_w, rad.
    pub pressure_angle: f64,
    /// Base helix angle β_b, rad.
    pub base_helix: f64,
    /// Working centre distance, m.
    pub centre_distance: f64,
    /// Base pitch `π m cos α_t/cos β`, m.
    pub base_pitch: f64,
    /// Base radii of pinion and wheel, m.
    pub base_radii: [f64; 2],
    /// Tip radii of pinion and wheel, m.
    pub tip_radii: [f64; 2],
    /// Path of contact, without the overlap that a face width gives it.
    pub path: PathOfContact,
}

impl MeshGeometry {
    /// A pair without play: `inv α_w = inv α_t + 2 tan α (x₂ ± x₁)/(Z₂ ± Z₁)`, `a = (r_b2 ± r_b1)/cos α_w`
    /// (minus for an internal pair). Tips are not shortened.
    ///
    /// # Errors
    /// [`GeometryError`] if the two cannot mesh.
    pub fn new(rack: &BasicRack, pinion: Gear, wheel: Gear, kind: MeshKind) -> Result<Self, GeometryError> {
        let sign = sign(pinion, wheel, kind)?;
        let alpha = rack.transverse_angle();
        let shifts = wheel.shift + sign * pinion.shift;
        // Without a net shift the angle is the rack's own to the last bit.
        let pressure_angle = if shifts == 0.0 {
            alpha
        } else {
            let teeth = f64::from(wheel.teeth) + sign * f64::from(pinion.teeth);
            let inv = involute(alpha) + 2.0 * libm::tan(rack.pressure_angle) * shifts / teeth;
            inverse_involute(inv).ok_or(GeometryError::PressureAngle(inv))?
        };
        Self::at_angle(rack, pinion, wheel, kind, pressure_angle)
    }

    /// A pair at a working centre distance a, m: `cos α_w = (r_b2 ± r_b1)/a`.
    ///
    /// # Errors
    /// [`GeometryError`] if the two cannot mesh there.
    pub fn at_distance(
        rack: &BasicRack,
        pinion: Gear,
        wheel: Gear,
        kind: MeshKind,
        distance: f64,
    ) -> Result<Self, GeometryError> {
        let bases = wheel.base_radius(rack) + sign(pinion, wheel, kind)? * pinion.base_radius(rack);
        if !(bases > 0.0 && bases < distance) {
            return Err(GeometryError::Distance { distance, bases });
        }
        Self::at_angle(rack, pinion, wheel, kind, libm::acos(bases / distance))
    }

    fn at_angle(
        rack: &BasicRack,
        pinion: Gear,
        wheel: Gear,
        kind: MeshKind,
        pressure_angle: f64,
    ) -> Result<Self, GeometryError> {
        let sign = sign(pinion, wheel, kind)?;
        let base_radii = [pinion.base_radius(rack), wheel.base_radius(rack)];
        let base_pitch = PI * rack.transverse_module() * libm::cos(rack.transverse_angle());
        let tip_radii = [
            pinion.tip_radius(rack),
            match kind {
                MeshKind::External => wheel.tip_radius(rack),
                MeshKind::Internal => wheel.ring_tip_radius(rack),
            },
        ];
        let tangents = base_radii.map(|r| r * libm::tan(pressure_angle));
        let reach = |gear: usize| (tip_radii[gear].powi(2) - base_radii[gear].powi(2)).max(0.0).sqrt();
        // Beyond the base-circle tangent point of the mating gear there is no involute to touch.
        let recess_limit = if kind == MeshKind::External { tangents[1] } else { f64::INFINITY };
        let part = |gear: usize, part, length: f64, limit: f64| {
            if length > 0.0 && length < limit {
                Ok(length / base_pitch)
            } else {
                Err(GeometryError::Tip { radius: tip_radii[gear], part, length, limit })
            }
        };
        let path = PathOfContact {
            approach: part(1, "approach", sign * (reach(1) - tangents[1]), tangents[0])?,
            recess: part(0, "recess", reach(0) - tangents[0], recess_limit)?,
            overlap: 0.0,
        };
        let centre_distance = (base_radii[1] + sign * base_radii[0]) / libm::cos(pressure_angle);
        let base_helix = rack.base_helix();
        Ok(Self { kind, pressure_angle, base_helix, centre_distance, base_pitch, base_radii, tip_radii, path })
    }

    /// Returns the same mesh with the wheel driving: approach and recess are exchanged.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        std::mem::swap(&mut self.path.approach, &mut self.path.recess);
        self
    }

    /// Radii of curvature of the two flanks at the pitch point, normal to the teeth, `r_b tan α_w/cos β_b`, m.
    #[must_use]
    pub fn curvature_radii(&self) -> [f64; 2] {
        self.base_radii.map(|r| r * libm::tan(self.pressure_angle) / libm::cos(self.base_helix))
    }
}

/// Sign of the pinion's radii in a mesh: −1 in a ring.
fn sign(pinion: Gear, wheel: Gear, kind: MeshKind) -> Result<f64, GeometryError> {
    match kind {
        MeshKind::External => Ok(1.0),
        MeshKind::Internal if wheel.teeth > pinion.teeth => Ok(-1.0),
        MeshKind::Internal => Err(GeometryError::Ring { pinion: pinion.teeth, ring: wheel.teeth }),
    }
}

/// `inv α = tan α − α`.
#[must_use]
pub fn involute(angle: f64) -> f64 {
    libm::tan(angle) - angle
}

/// The angle in `(0, π/2)` with the given involute (> 0), by Newton's method.
#[must_use]
pub fn inverse_involute(value: f64) -> Option<f64> {
    if value.is_nan() || value <= 0.0 || value.is_infinite() {
        return None;
    }
    // In t = tan α the function t − atan t is convex with slope t²/(1 + t²): from above, Newton falls to the root.
    let mut tangent = libm::cbrt(3.0 * value) + value + 1.0;
    for _ in 0..100 {
        let next = tangent - (tangent - libm::atan(tangent) - value) * (1.0 + tangent.powi(-2));
        if next.is_nan() || next >= tangent || next <= 0.0 {
            break;
        }
        tangent = next;
    }
    Some(libm::atan(tangent))
}

/// Elastic material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus E, Pa, > 0.
    pub young: f64,
    /// Poisson's ratio ν, `[0, 0.5]`.
    pub poisson: f64,
}

impl Material {
    /// Steel: 206 GPa, 0.3.
    pub const STEEL: Self = Self { young: 206.0e9, poisson: 0.3 };

    /// `h = (1 − ν²)/(π E)`, 1/Pa.
    #[must_use]
    pub fn compliance(&self) -> f64 {
        (1.0 - self.poisson * self.poisson) / (PI * self.young)
    }
}

/// Hertz stiffness of two spheres, `k = 4/(3π (h₁ + h₂)) √(r₁ r₂/(r₁ ± r₂))`, N/m^1.5 (`r₂ − r₁` for an internal pair).
///
/// Gear papers use it for flanks, with the radii of curvature at the pitch point; for the line contact of a spur
/// flank it is a convention of dimension, not a result. Radii in m, > 0, and `r₂ > r₁` for an internal pair.
#[must_use]
pub fn hertz_stiffness(radii: [f64; 2], kind: MeshKind, materials: [Material; 2]) -> f64 {
    let [r1, r2] = radii;
    let sum = match kind {
        MeshKind::External => r1 + r2,
        MeshKind::Internal => r2 - r1,
    };
    let compliance = materials[0].compliance() + materials[1].compliance();
    4.0 / (3.0 * PI * compliance) * (r1 * r2 / sum).sqrt()
}

/// Mean mesh stiffness per ISO 6336-1 method B for steel solid-disc gears, `c_γ b/cos² β_b`, N/m, along the normal of the teeth.
///
/// `c′ = 0.8 C_B cos β/q′` with the series for q′ in the shifts and the tooth numbers `Z_n = Z/(cos² β_b cos β)` of the normal section
/// (`1/Z₂ = 0` for a ring) and `C_B = [1 + 0.5 (1.2 − h_f)] [1 − 0.02 (20 − α°)]`; `c_γ = c′ (0.75 ε + 0.25)` is for a load in the
/// transverse plane. For `ε ≥ 1.2`, fitted around α = 20°. `face_width` b, m.
#[must_use]
pub fn iso_mesh_stiffness(
    rack: &BasicRack,
    pinion: Gear,
    wheel: Gear,
    kind: MeshKind,
    contact_ratio: f64,
    face_width: f64,
) -> f64 {
    // The standard's gear 1 is the smaller one, whichever drives.
    let (pinion, wheel) = if pinion.teeth <= wheel.teeth { (pinion, wheel) } else { (wheel, pinion) };
    let (x1, x2) = (pinion.shift, wheel.shift);
    let helix = libm::cos(rack.helix_angle);
    let base = libm::cos(rack.base_helix()).powi(2);
    let inverse = |gear: Gear| base * helix * f64::from(gear.teeth).recip();
    let inverse1 = inverse(pinion);
    let inverse2 = match kind {
        MeshKind::External => inverse(wheel),
        MeshKind::Internal => 0.0,
    };
    let q = 0.04723 + 0.15551 * inverse1 + 0.25791 * inverse2
        - 0.00635 * x1
        - 0.11654 * x1 * inverse1
        - 0.00193 * x2
        - 0.24188 * x2 * inverse2
        + 0.00529 * x1 * x1
        + 0.00182 * x2 * x2;
    let rack_factor = (1.0 + 0.5 * (1.2 - rack.dedendum)) * (1.0 - 0.02 * (20.0 - rack.pressure_angle.to_degrees()));
    let single = 0.8 * rack_factor * helix / q; // N/(mm µm) = 1e9 N/m²
    1.0e9 * single * (0.75 * contact_ratio + 0.25) * face_width / base
}

/// ISO 6336-1 correction of the mesh stiffness at low load, `(F/(b · 100 N/mm))^0.25`, at most 1.
///
/// `line_load` F/b, N/m, ≥ 0.
#[must_use]
pub fn low_load_factor(line_load: f64) -> f64 {
    libm::pow(line_load / 1.0e5, 0.25).min(1.0)
}

/// Radius of gyration `√(I/m)`, m; no body has one beyond its own outer radius.
#[must_use]
pub fn radius_of_gyration(mass: f64, inertia: f64) -> f64 {
    (inertia / mass).sqrt()
}
