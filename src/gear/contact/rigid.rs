/// A flank that cannot be penetrated.
///
/// Newton's law: the gap opens after an impact with `restitution` times the speed it closed with.
/// Contacts that strike at one instant are solved together with their mass coupling (see
/// `train::impact`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// Coefficient of restitution e, `[0, 1]`.
    pub restitution: f64,
}
