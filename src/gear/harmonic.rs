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
