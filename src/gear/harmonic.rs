/// One harmonic `a cos(ω t + φ)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Frequency ω, rad/s, > 0.
    pub omega: f64,
    /// Amplitude a, in the units of what it belongs to.
    pub amplitude: f64,
    /// Phase φ, rad.
    pub phase: f64,
}

impl Harmonic {
    /// `a sin(ω t + φ)`, written as a cosine.
    #[must_use]
    pub fn sine(omega: f64, amplitude: f64, phase: f64) -> Self {
        Self { omega, amplitude, phase: phase - std::f64::consts::FRAC_PI_2 }
    }
}

/// One harmonic in a mesh's own clock `τ = f_m t + γ` (mesh frequency f_m, mesh phase γ in periods).
///
/// Transmission errors read it as a sine, `a sin(2π h τ + φ)`; stiffnesses as a cosine, `a cos(2π h τ + φ)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshHarmonic {
    /// Order h, > 0: 1 for the mesh frequency itself, 1/Z for a run-out of a gear of Z teeth.
    pub order: f64,
    /// Amplitude a: m for an error, relative to the mean for a stiffness.
    pub amplitude: f64,
    /// Phase φ, rad.
    pub phase: f64,
}

impl MeshHarmonic {
    /// In time, as a cosine: `a cos(2π h (f t + γ) + φ)`; `frequency` f in Hz, `mesh_phase` γ in periods.
    #[must_use]
    pub fn cosine(&self, frequency: f64, mesh_phase: f64) -> Harmonic {
        let turn = std::f64::consts::TAU * self.order;
        Harmonic { omega: turn * frequency, amplitude: self.amplitude, phase: turn * mesh_phase + self.phase }
    }

    /// In time, as a sine: `a sin(2π h (f t + γ) + φ)`; arguments as for [`cosine`](Self::cosine).
    #[must_use]
    pub fn sine(&self, frequency: f64, mesh_phase: f64) -> Harmonic {
        let Harmonic { omega, amplitude, phase } = self.cosine(frequency, mesh_phase);
        Harmonic::sine(omega, amplitude, phase)
    }
}
