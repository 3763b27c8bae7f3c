//! Series of a step beside its state. They belong to the step, and are reused.

use super::Instant;

/// Highest power of a step.
pub const ORDER: usize = 24;
/// Number of coefficients of a series.
pub const ROW: usize = ORDER + 1;
/// Number of degrees of freedom, or of contacts, that are stored side by side.
pub const LANES: usize = 4;

/// Coefficients of a series, the lowest order first.
pub type Series = [f64; ROW];
/// Four numbers side by side.
pub type Four = [f64; LANES];

/// Series of a contact with a law that is not linear, or whose force is read.
#[derive(Clone, Debug, Default)]
pub struct ContactRows {
    /// Rate of the deflection, m/s.
    pub rate: Series,
    /// Force of the law, N.
    pub force: Series,
    /// Penetration, m; of a stiffness that varies the stretch.
    pub penetration: Series,
    /// Power of the penetration.
    pub power: Series,
    /// Stiffness, if it varies, N/m.
    pub stiffness: Series,
    /// Penetration less that of the owner of the clock, of a contact that leaves with it, m.
    pub apart: Series,
    /// Hysteresis factor `1 + χ ṗ`.
    pub factor: Series,
}

/// Largest power of the root of a penetration that a clock needs.
const POWERS: usize = 16;

/// Series of the clock of a step.
#[derive(Clone, Debug, Default)]
pub struct ClockRows {
    /// Weight w of the clock, `dt = h w(θ) dθ`.
    pub weight: Series,
    /// Powers y, y², … of the root of the penetration of the owner.
    powers: [Series; POWERS],
    /// Powers p² to p⁵ of this penetration p.
    pub penetration: [Series; 4],
}

impl ClockRows {
    /// Returns `y^m`, or the weight for `m = 0`.
    #[must_use]
    pub fn y(&self, m: usize) -> &Series {
        if m == 0 { &self.weight } else { &self.powers[m - 1] }
    }

    /// Returns `p^m`, `m > 0`.
    #[must_use]
    pub fn p<'a>(&'a self, m: usize, p: &'a Series) -> &'a Series {
        if m == 1 { p } else { &self.penetration[m - 2] }
    }

    /// Returns `y^m`, `m > 0`, to be written.
    pub fn y_mut(&mut self, m: usize) -> &mut Series {
        &mut self.powers[m - 1]
    }
}

/// Series of a step beside its state.
#[derive(Clone, Debug, Default)]
pub struct StepRows {
    /// `cos ωt` and `sin ωt` of the oscillators.
    pub oscillators: Vec<[Series; 2]>,
    /// Instant of their order zero, if it is formed.
    pub oscillators_at: Option<Instant>,
    /// Contacts.
    pub contacts: Vec<ContactRows>,
    /// Deflections, by fours of contacts and by order, m.
    pub deflections: Vec<[Four; ROW]>,
    /// Stretches `δ − σ b` at order zero, σ b the flank, m; whole fours.
    pub stretches: Vec<Four>,
    /// Sizes of the terms of each deflection at order zero, m; whole fours.
    pub sizes: Vec<Four>,
    /// Stretches at order zero of separated contacts from the flank that they have left, m, if known better than by the state; else NaN.
    /// Negative at the drive flank, positive at the back flank. Whole fours.
    pub gaps: Vec<Four>,
    /// Sizes of the terms of each stretch at order zero, m; whole fours.
    pub terms: Vec<Four>,
    /// Clock.
    pub clock: ClockRows,
    /// Contact that owns the clock, if the clock is a root of its penetration.
    pub owner: Option<usize>,
    /// Time since contacts with power laws started, s, if known; else NaN.
    pub since: f64,
    /// Displacements, then velocities of a linear mode in whole blocks of four, order by order.
    pub orders: Vec<Four>,
    /// Orders of each oscillator of a linear mode: cosine and sine.
    pub waves: Vec<[[f64; 2]; ROW]>,
}

impl StepRows {
    /// Gives the rows the lengths for `n` degrees of freedom, `contacts` and `oscillators`.
    pub fn fit(&mut self, n: usize, contacts: usize, oscillators: usize) {
        let (fours, blocks) = (contacts.div_ceil(LANES), 2 * ROW * n.div_ceil(LANES));
        if self.contacts.len() == contacts && self.waves.len() == oscillators && self.orders.len() == blocks {
            return;
        }
        self.oscillators_at = None;
        self.oscillators.resize_with(oscillators, Default::default);
        self.contacts.resize_with(contacts, Default::default);
        self.deflections.resize(fours, [[0.0; LANES]; ROW]);
        self.stretches.resize(fours, [0.0; LANES]);
        self.sizes.resize(fours, [0.0; LANES]);
        self.gaps.resize(fours, [0.0; LANES]);
        self.terms.resize(fours, [0.0; LANES]);
        self.orders.resize(blocks, [0.0; LANES]);
        self.waves.resize(oscillators, [[0.0; 2]; ROW]);
    }

    /// Returns the deflection of contact `j` at order `k`, m.
    #[must_use]
    pub fn deflection(&self, j: usize, k: usize) -> f64 {
        self.deflections[j / LANES][k][j % LANES]
    }

    /// Returns the stretch of contact `j` at order zero, m.
    #[must_use]
    pub fn stretch(&self, j: usize) -> f64 {
        self.stretches[j / LANES][j % LANES]
    }

    /// Returns the gap of contact `j` at order zero, m.
    #[must_use]
    pub fn gap(&self, j: usize) -> f64 {
        self.gaps[j / LANES][j % LANES]
    }

    /// Returns the size of the terms of the deflection of contact `j`, m.
    #[must_use]
    pub fn size(&self, j: usize) -> f64 {
        self.sizes[j / LANES][j % LANES]
    }
}
