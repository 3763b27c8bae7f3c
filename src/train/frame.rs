//! From the carrier's frame to the fixed one.

/// Turns in-plane coordinates from the carrier's frame to the fixed frame: `(x + i y) e^{iθ}` with θ the carrier's
/// angle, rad. The angle rather than the time, so that long runs can count whole turns exactly.
#[must_use]
pub fn to_fixed([x, y]: [f64; 2], carrier_angle: f64) -> [f64; 2] {
    let (sin, cos) = libm::sincos(carrier_angle);
    [x * cos - y * sin, x * sin + y * cos]
}
