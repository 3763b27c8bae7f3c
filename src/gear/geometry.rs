//! Spur gear geometry: working pressure angle, base pitch, path of contact, and the stiffnesses that follow.
//!
//! Angles in rad, lengths in m. Internal meshes: the wheel is the ring, its tooth number counted positive and
//! its profile shift positive away from the centre.

use std::f64::consts::PI;

use thiserror::Error;

/// Standard reference rack of a gear set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasicRack {
    /// Module m, m, > 0.
    pub module: f64,
    /// Pressure angle α, rad, `(0, π/4)`.
    pub pressure_angle: f64,
    /// Addendum in modules, usually 1.
    pub addendum: f64,
    /// Dedendum in modules, usually 1.25; only the ISO stiffness reads it.
    pub dedendum: f64,
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
    /// Pitch radius `m Z/2`, m.
    #[must_use]
    pub fn pitch_radius(&self, rack: &BasicRack) -> f64 {
        0.5 * rack.module * f64::from(self.teeth)
    }

    /// Base radius `m Z cos α/2`, m.
    #[must_use]
    pub fn base_radius(&self, rack: &BasicRack) -> f64 {
        self.pitch_radius(rack) * libm::cos(rack.pressure_angle)
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

    /// Tooth thickness on the pitch circle, `π m/2 + 2 x m tan α`, m.
    #[must_use]
    pub fn tooth_thickness(&self, rack: &BasicRack) -> f64 {
        rack.module * (0.5 * PI + 2.0 * self.shift * libm::tan(rack.pressure_angle))
    }
}

/// How two gears mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshKind {
    /// Two external gears.
    External,
    /// An external pinion inside a ring.
    Internal,
}

/// Where a tooth pair is in contact, in base pitches about the pitch point: `−A ≤ τ ≤ R`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathOfContact {
    /// Approach A (limited by the driven gear's tip), base pitches, ≥ 0.
    pub approach: f64,
    /// Recess R (limited by the driving gear's tip), base pitches, ≥ 0.
    pub recess: f64,
}

impl PathOfContact {
    /// Contact ratio ε = A + R.
    #[must_use]
    pub fn contact_ratio(&self) -> f64 {
        self.approach + self.recess
    }
}

/// Why a pair of gears cannot mesh.
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
    /// A tip does not reach the pitch point, or passes the point where the line of action leaves a base circle.
    #[error("tip radius {radius} m: the {part} of {length} m is outside (0, {limit} m)")]
    Tip {
        /// Tip radius, m.
        radius: f64,
        /// `approach` or `recess`.
        part: &'static str,
        /// Its length on the line of action, m.
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
    /// Working centre distance, m.
    pub centre_distance: f64,
    /// Base pitch `π m cos α`, m.
    pub base_pitch: f64,
    /// Base radii of pinion and wheel, m.
    pub base_radii: [f64; 2],
    /// Tip radii of pinion and wheel, m.
    pub tip_radii: [f64; 2],
    /// Path of contact.
    pub path: PathOfContact,
}

impl MeshGeometry {
    /// A pair without play: `inv α_w = inv α + 2 tan α (x₂ ± x₁)/(Z₂ ± Z₁)`, `a = (r_b2 ± r_b1)/cos α_w`
    /// (minus for an internal pair). Tips are not shortened.
    ///
    /// # Errors
    /// [`GeometryError`] if the two cannot mesh.
    pub fn new(rack: &BasicRack, pinion: Gear, wheel: Gear, kind: MeshKind) -> Result<Self, GeometryError> {
        let sign = match kind {
            MeshKind::External => 1.0,
            MeshKind::Internal if wheel.teeth > pinion.teeth => -1.0,
            MeshKind::Internal => return Err(GeometryError::Ring { pinion: pinion.teeth, ring: wheel.teeth }),
        };
        let alpha = rack.pressure_angle;
        let shifts = wheel.shift + sign * pinion.shift;
        // Without a net shift the angle is the rack's own to the last bit.
        let pressure_angle = if shifts == 0.0 {
            alpha
        } else {
            let teeth = f64::from(wheel.teeth) + sign * f64::from(pinion.teeth);
            let inv = involute(alpha) + 2.0 * libm::tan(alpha) * shifts / teeth;
            inverse_involute(inv).ok_or(GeometryError::PressureAngle(inv))?
        };
        let base_radii = [pinion.base_radius(rack), wheel.base_radius(rack)];
        let base_pitch = PI * rack.module * libm::cos(alpha);
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
        };
        let centre_distance = (base_radii[1] + sign * base_radii[0]) / libm::cos(pressure_angle);
        Ok(Self { kind, pressure_angle, centre_distance, base_pitch, base_radii, tip_radii, path })
    }

    /// Radii of curvature of the two flanks at the pitch point, `r_b tan α_w`, m.
    #[must_use]
    pub fn curvature_radii(&self) -> [f64; 2] {
        self.base_radii.map(|r| r * libm::tan(self.pressure_angle))
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

/// Mean mesh stiffness per ISO 6336-1 method B for steel solid-disc gears, `c_γ b`, N/m.
///
/// `c′ = 0.8 C_B/q′` with the series for q′ in tooth numbers and shifts (`1/Z₂ = 0` for a ring) and
/// `C_B = [1 + 0.5 (1.2 − h_f)] [1 − 0.02 (20 − α°)]`; `c_γ = c′ (0.75 ε + 0.25)`. For `ε ≥ 1.2`, fitted around
/// α = 20°. `face_width` b, m.
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
    let inverse1 = f64::from(pinion.teeth).recip();
    let inverse2 = match kind {
        MeshKind::External => f64::from(wheel.teeth).recip(),
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
    let single = 0.8 * rack_factor / q; // N/(mm µm) = 1e9 N/m²
    1.0e9 * single * (0.75 * contact_ratio + 0.25) * face_width
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
