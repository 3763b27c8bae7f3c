use serde::Serialize;

/// How a run of a fixed-step method compares with the engine's, worst last. The first that holds, from the worst on, is the
/// cell's:
///
/// | outcome | rule |
/// |---|---|
/// | blow-up | a number that is not finite, or a coordinate or velocity beyond [`BLOWN`](Self::BLOWN) times the largest of the engine's motion |
/// | energy growth | the motion does not settle, and the mean of its energy at the sections of the second half exceeds the largest of the engine's by 5 % |
/// | missed | fewer passages of flanks than the truth has in its window |
/// | spurious | more passages |
/// | displaced | as many, but some of them not within 2 % of a cycle of those of the truth, or in another order |
/// | attractor | the sequence is right, and the motion in the long run is another: see [`Rule`](super::Rule) |
/// | right | the rest |
///
/// All energies are those of the sections, the starts of cycles: kinetic energy, supports and contact springs, sharp flanks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Right sequence, right motion in the long run.
    Right,
    /// Right sequence, other period or other attractor.
    Attractor,
    /// As many events, out of place.
    Displaced,
    /// Events that are none.
    Spurious,
    /// Events not seen.
    Missed,
    /// The method makes energy.
    Growth,
    /// The motion leaves every bound.
    BlowUp,
}

impl Outcome {
    /// A motion this many times as large as the engine's has blown up.
    pub const BLOWN: f64 = 1e3;

    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Right => "right sequence and motion",
            Self::Attractor => "period or attractor changed",
            Self::Displaced => "wrong sequence: events out of place",
            Self::Spurious => "wrong sequence: spurious events",
            Self::Missed => "wrong sequence: missed events",
            Self::Growth => "energy growth",
            Self::BlowUp => "blow-up",
        }
    }

    /// Whether the events of the window are all there, in their places, and no others.
    #[must_use]
    pub fn has_right_sequence(self) -> bool {
        matches!(self, Self::Right | Self::Attractor)
    }
}
