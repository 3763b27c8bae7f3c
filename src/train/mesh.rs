//! One mesh of a train, in its own clock.

use super::error::{TrainError, check};
use crate::gear::contact::{Law, Linear};
use crate::gear::{MeshHarmonic, MeshStiffness, Stiffness};
use crate::system::{BackFlank, ContactSpec, Flanks};

/// One gear mesh. Its clock is `τ = f_m t + phase`.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Contact law.
    pub law: Law,
    /// Stiffness, N/m (N/mⁿ for a power law).
    pub stiffness: MeshStiffness,
    /// Half the total backlash, b, m, ≥ 0: the drive flank is touched at deflection +b, the back flank at −b.
    pub half_backlash: f64,
    /// Flanks of the mesh. With the drive flank alone and `half_backlash` 0, deflection is counted from contact.
    pub flanks: Flanks,
    /// Transmission error `e = Σ E sin(2π h τ + φ)`, m; positive opens the drive flank.
    pub error: Vec<MeshHarmonic>,
    /// Constant part of the error, m.
    pub error_offset: f64,
    /// Mesh phase γ, periods.
    pub phase: f64,
    /// Damper between the gears in every state, N s/m, ≥ 0.
    pub gap_damping: f64,
    /// Back flank, where it differs from the drive flank.
    pub back: Option<MeshBack>,
}

/// A back flank with different data. Its clock is that of the mesh, `phase` periods ahead.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshBack {
    /// Stiffness, N/m (N/mⁿ for a power law).
    pub stiffness: MeshStiffness,
    /// Transmission error, m; positive closes the back flank.
    pub error: Vec<MeshHarmonic>,
    /// Constant part of the error, m.
    pub error_offset: f64,
    /// Phase against the drive flank, periods.
    pub phase: f64,
}

impl Mesh {
    /// A mesh of constant or varying stiffness without backlash or error, drive flank only, phase 0.
    #[must_use]
    pub fn new(law: Law, stiffness: MeshStiffness) -> Self {
        Self {
            law,
            stiffness,
            half_backlash: 0.0,
            flanks: Flanks::Drive,
            error: Vec::new(),
            error_offset: 0.0,
            phase: 0.0,
            gap_damping: 0.0,
            back: None,
        }
    }

    /// Returns a linear mesh that never separates, with damping `c = 2 ζ √(k̄ m₁ m₂/(m₁ + m₂))`.
    ///
    /// k̄ in N/m, ζ ≥ 0, rotary masses of the two gears in kg.
    #[must_use]
    pub fn bilateral(stiffness: f64, ratio: f64, rotary_masses: [f64; 2]) -> Self {
        let law = Law::Bilateral(Linear { damping: mesh_damping(stiffness, ratio, rotary_masses) });
        Self::new(law, MeshStiffness::Constant(stiffness))
    }

    /// Returns the contact element at mesh frequency f_m, Hz (0: standing), with its direction in the degrees of freedom of the train.
    pub(super) fn contact(&self, name: String, direction: Vec<f64>, frequency: f64) -> Result<ContactSpec, TrainError> {
        check(format_args!("{name}: half backlash"), self.half_backlash, self.half_backlash >= 0.0, ">= 0")?;
        if self.law.is_bilateral() {
            let name = format_args!("{name}: half backlash of a bilateral mesh");
            check(name, self.half_backlash, self.half_backlash == 0.0, "0: it never lets go")?;
        }
        check(format_args!("{name}: phase"), self.phase, true, "finite")?;
        check(format_args!("{name}: gap damping"), self.gap_damping, self.gap_damping >= 0.0, ">= 0")?;
        let own = MeshBack {
            stiffness: self.stiffness.clone(),
            error: self.error.clone(),
            error_offset: self.error_offset,
            phase: 0.0,
        };
        let drive = self.flank(&name, &own, frequency)?;
        let back_name = format!("{name}, back flank");
        let back = self.back.as_ref().map(|back| self.flank(&back_name, back, frequency)).transpose()?;
        Ok(ContactSpec {
            name,
            direction,
            error: drive.error,
            error_offset: drive.error_offset,
            half_backlash: self.half_backlash,
            flanks: self.flanks,
            stiffness: drive.stiffness,
            law: self.law,
            gap_damping: self.gap_damping,
            back,
        })
    }

    /// Converts a flank to functions of time.
    fn flank(&self, name: &str, flank: &MeshBack, frequency: f64) -> Result<BackFlank, TrainError> {
        check(format_args!("{name}: error offset"), flank.error_offset, true, "finite")?;
        check(format_args!("{name}: phase"), flank.phase, true, "finite")?;
        for h in &flank.error {
            check(format_args!("{name}: error order"), h.order, h.order > 0.0, "> 0")?;
            check(format_args!("{name}: error amplitude"), h.amplitude, true, "finite")?;
            check(format_args!("{name}: error phase"), h.phase, true, "finite")?;
        }
        check_stiffness(name, &flank.stiffness)?;
        let mean = flank.stiffness.mean();
        check(format_args!("{name}: mean stiffness"), mean, mean > 0.0 || self.law.is_rigid(), "> 0")?;
        let standing = frequency <= 0.0;
        if standing && (flank.stiffness.varies() || flank.error.iter().any(|h| h.amplitude != 0.0)) {
            return Err(TrainError::Standing { what: name.to_owned() });
        }
        let phase = self.phase + flank.phase;
        let stiffness =
            if standing { Stiffness::Constant(mean) } else { flank.stiffness.schedule(frequency.recip(), phase) };
        let error = flank.error.iter().filter(|h| h.amplitude != 0.0).map(|h| h.sine(frequency, phase)).collect();
        Ok(BackFlank { stiffness, error, error_offset: flank.error_offset })
    }
}

/// Checks the ranges of a stiffness.
pub(super) fn check_stiffness(name: &str, stiffness: &MeshStiffness) -> Result<(), TrainError> {
    match stiffness.fault() {
        Some((what, value, wanted)) => Err(TrainError::Value { name: format!("{name}: {what}"), value, wanted }),
        None => Ok(()),
    }
}

/// Mesh damping `c = 2 ζ √(k m_eq)`, N s/m, with `m_eq = m₁ m₂/(m₁ + m₂)` of the two rotary masses, kg.
#[must_use]
pub fn mesh_damping(stiffness: f64, ratio: f64, rotary_masses: [f64; 2]) -> f64 {
    let [m1, m2] = rotary_masses;
    2.0 * ratio * (stiffness * m1 * m2 / (m1 + m2)).sqrt()
}
