//! Start of a step: order zero of the oscillators and of the deflections, from the state, the exact zeros and the step before.

use crate::{
    hybrid::{Four, Instant, Jet, JetRequest},
    kernel::{Expansion, Force, LANES, Motion, ORDER, ROUNDING, StepRows, waves},
    system::{ContactMode, FourColumns, Structure, Watch, dot, guard_id, guard_of},
    vectors::Path,
};

/// Returns `gᵀq` of four contacts and the size of the terms of each deflection, with the bits of `dot` and `Structure::deflection_size`:
/// a column of zeros adds ±0. Columns are dense, which is cheaper than lists for few degrees of freedom.
#[inline(always)]
pub fn deflection_terms<P: Path>(path: P, four: &FourColumns, x: &[f64]) -> [Four; 2] {
    let [mut sum, mut size] = [path.all(0.0); 2];
    for (direction, x) in four.directions.iter().zip(x) {
        let term = path.times(path.four(*direction), path.all(*x));
        (sum, size) = (path.plus(sum, term), path.plus(size, path.sizes(term)));
    }
    for of in four.sizes {
        size = path.plus(size, path.four(of));
    }
    [path.numbers(sum), path.numbers(size)]
}

/// Forms order zero of the oscillators at `at`, unless it is known.
#[inline(always)]
pub fn turn(s: &Structure, at: Instant, rows: &mut StepRows) {
    if rows.oscillators_at != Some(at) {
        s.oscillate(at, |i, cosine, sine| {
            [rows.oscillators[i][0][0], rows.oscillators[i][1][0]] = [cosine, sine];
        });
        rows.oscillators_at = Some(at);
    }
}

/// Known data of a contact at the start of a span.
#[derive(Clone, Copy)]
pub struct SpanStart<'a> {
    pub at: Instant,
    pub x: &'a [f64],
    /// Size of the terms whose sum is its deflection, m.
    pub size: f64,
    /// Guards of the contact that are exactly zero, by [`Watch`].
    pub zeros: [bool; 3],
    /// Stretch kept as by [`JetField::carry`](crate::hybrid::JetField::carry), m; NaN if unknown.
    pub carried: f64,
}

impl<'a> SpanStart<'a> {
    pub fn new(request: &JetRequest<'a>, j: usize, size: f64) -> Self {
        let mut zeros = [false; 3];
        if !request.pinned.is_empty() {
            zeros = [Watch::DriveFlank, Watch::BackFlank, Watch::Force]
                .map(|watch| request.pinned.contains(guard_id(j, watch)));
        }
        Self { at: request.at, x: request.x, size, zeros, carried: request.carried.get(j).copied().unwrap_or(f64::NAN) }
    }

    pub fn is_zero(&self, watch: Watch) -> bool {
        self.zeros[watch as usize]
    }
}

/// Deflection and stretch of a contact at the start of a span, m.
#[derive(Clone, Copy)]
pub struct ContactStart {
    pub deflection: f64,
    /// Stretch `δ − σ b` from its own flank; of a separated contact from the flank that it has left, if known (else NaN).
    pub stretch: f64,
    /// Bound on the error of the stretch.
    pub error: f64,
}

impl ContactStart {
    /// Returns the start of contact `j`, whose deflection by the state is `deflection`, m, with the given rate: exact on a flank and where
    /// its force is zero, else as carried, else by the state.
    #[inline(always)]
    pub fn new(motion: &Motion, given: &SpanStart<'_>, j: usize, deflection: f64, rate: impl FnOnce() -> f64) -> Self {
        let (c, part) = (&motion.structure.contacts[j], &motion.parts[j]);
        let is_open = part.state == ContactMode::Separated;
        let flank = |watch: Watch| given.is_zero(watch).then_some(watch.side() * c.gap());
        let on_flank = flank(Watch::DriveFlank).or_else(|| flank(Watch::BackFlank));
        let deflection = on_flank.unwrap_or(deflection);
        let by_state = deflection - part.flank;
        let (stretch, error) = match Some(given.carried).filter(|stretch| !stretch.is_nan()) {
            _ if given.is_zero(Watch::Force) => {
                let error = ROUNDING * given.size;
                (motion.forceless(j, given.at, by_state, error, rate), error)
            }
            _ if on_flank.is_some() => (if is_open { 0.0 } else { by_state }, 0.0),
            Some(stretch) => (stretch, ROUNDING * stretch.abs()),
            None => (if is_open { f64::NAN } else { by_state }, ROUNDING * given.size),
        };
        Self { deflection, stretch, error }
    }
}

impl Motion<'_> {
    /// Returns `δ − σ b` of contact `j` where its force is exactly zero; the state gives `stretch` to within `rounding`.
    fn forceless(&self, j: usize, at: Instant, stretch: f64, rounding: f64, rate: impl FnOnce() -> f64) -> f64 {
        let Some(Force::Linear { stiffness, damping }) = self.parts[j].force() else { return stretch };
        let k = self.structure.stiffness_at(j, stiffness, at).0;
        if k <= 0.0 {
            return stretch;
        }
        let forceless = -damping * rate() / k;
        if damping == 0.0 || (forceless - stretch).abs() <= rounding { forceless } else { stretch }
    }
}

impl Expansion<'_> {
    /// Forms order zero of the state, the oscillators and the deflections.
    #[inline(always)]
    pub fn start<P: Path>(&self, path: P, out: &mut Jet) {
        let (s, dim) = (self.s, self.s.dim);
        out.low.clear();
        if !self.is_bare {
            out.state[..dim].copy_from_slice(self.request.x);
            if dim > 2 * s.n {
                for k in 1..=ORDER {
                    out.state[k * dim + 2 * s.n..(k + 1) * dim].fill(0.0);
                }
            }
        }
        let rows = &mut out.rows;
        turn(s, self.request.at, rows);
        self.begin_deflections(path, rows);
        for number in 0..rows.deflections.len() {
            self.begin_stretches(path, number, rows);
        }
        if self.keeps_low() {
            (0..s.contacts.len()).for_each(|j| self.exact_start(j, rows));
        } else if !self.request.pinned.is_empty() {
            self.request.pinned.iter().for_each(|id| self.exact_start(guard_of(id).0, rows));
        }
    }

    /// Writes stretches, gaps and sizes of the terms of four stretches, by the state or as carried from the step before.
    #[inline(always)]
    fn begin_stretches<P: Path>(&self, path: P, number: usize, rows: &mut StepRows) {
        let (carried, flanks) = (self.request.carried, &self.motion.flanks[number]);
        let known: Four = std::array::from_fn(|l| carried.get(LANES * number + l).copied().unwrap_or(f64::NAN));
        let (known, side) = (path.four(known), path.four(flanks.has_side));
        let [zero, unknown, most] = [0.0, f64::NAN, f64::INFINITY].map(|x| path.all(x));
        let size = path.sizes(known);
        // Comparisons with NaN are false.
        let by_state = path.minus(path.four(rows.deflections[number][0]), path.four(flanks.flank));
        let stretch = path.where_above(most, size, path.where_above(side, zero, known, by_state), by_state);
        // A gap that is zero by chance is not exact, and is taken from the state.
        let by_terms = path.four(rows.sizes[number]);
        let of_zero = path.where_above(side, zero, path.sizes(stretch), by_terms);
        let terms = path.where_above(size, zero, size, of_zero);
        rows.stretches[number] = path.numbers(stretch);
        rows.gaps[number] = path.numbers(path.where_above(side, zero, unknown, known));
        rows.terms[number] = path.numbers(path.where_above(most, size, terms, by_terms));
    }

    /// Writes the start of contact `j` where an exact zero or two doubles give it better than the state: the rule of [`ContactStart`] in the
    /// rows of a step.
    fn exact_start(&self, j: usize, rows: &mut StepRows) {
        let (four, lane) = (j / LANES, j % LANES);
        if self.keeps_low() {
            rows.gaps[four][lane] = f64::NAN;
        }
        rows.deflections[four][0][lane] = self.exact_deflection(j, rows.deflection(j, 0));
        self.exact_stretch(j, rows);
        rows.terms[four][lane] = self.stretch_size(j, None, rows.size(j), rows);
    }

    /// Returns the deflection of contact `j`, m: exact on a flank, and in two doubles if the state has a low part; else `by_state`.
    fn exact_deflection(&self, j: usize, by_state: f64) -> f64 {
        let (s, c) = (self.s, &self.s.contacts[j]);
        match [Watch::DriveFlank, Watch::BackFlank].iter().find(|watch| self.pinned(j, **watch)) {
            Some(watch) => watch.side() * c.gap(),
            None if self.keeps_low() => {
                s.deflection_in_two(j, self.request.at, self.request.x, self.request.low).value()
            }
            None => by_state,
        }
    }

    /// Writes the stretch of contact `j` where an exact zero or two doubles give it better than the state, and a gap of zero on a flank.
    fn exact_stretch(&self, j: usize, rows: &mut StepRows) {
        let part = &self.motion.parts[j];
        let by_flank = rows.deflection(j, 0) - part.flank;
        let stretch = &mut rows.stretches[j / LANES][j % LANES];
        if self.pinned(j, Watch::DriveFlank) || self.pinned(j, Watch::BackFlank) {
            (rows.gaps[j / LANES][j % LANES], *stretch) = (0.0, by_flank);
        }
        if self.pinned(j, Watch::Force) {
            rows.stretches[j / LANES][j % LANES] = self.forceless(j, by_flank, rows);
        } else if self.keeps_low() {
            *stretch = self.stretch_in_two(j, part.side).value();
        }
    }

    /// Writes the deflection of each contact by the state, and the size of its terms.
    #[inline(always)]
    fn begin_deflections<P: Path>(&self, path: P, rows: &mut StepRows) {
        let (s, x) = (self.s, self.request.x);
        if !self.motion.is_linear {
            for (j, c) in s.contacts.iter().enumerate() {
                let error = waves(c.spec.error_offset, &c.error, 0, rows);
                rows.deflections[j / LANES][0][j % LANES] = dot(&c.direction, x) - error;
                rows.sizes[j / LANES][j % LANES] = s.deflection_size(c, x);
            }
            return;
        }
        for (number, four) in s.columns.fours.iter().enumerate() {
            let ([sum, size], mut error) = (deflection_terms(path, four, x), path.four(four.offsets));
            for (index, by_cosine, by_sine) in &four.errors {
                let [cosine, sine] = &rows.oscillators[*index];
                error = path.plus(error, path.times(path.four(*by_cosine), path.all(cosine[0])));
                error = path.plus(error, path.times(path.four(*by_sine), path.all(sine[0])));
            }
            rows.deflections[number][0] = path.numbers(path.minus(path.four(sum), error));
            rows.sizes[number] = size;
        }
    }

    /// Returns the gap of separated contact `j` to the flank of `watch`, m, if it is known better than by the state.
    #[inline(always)]
    pub fn gap(&self, j: usize, watch: Watch, rows: &StepRows) -> Option<f64> {
        let (c, gap) = (&self.s.contacts[j], -watch.side() * rows.gap(j));
        // Of two flanks, the gap belongs to the one that agrees with the state.
        let from_state = c.gap() - watch.side() * rows.deflection(j, 0);
        let agrees = !c.has_back() || (gap - from_state).abs() < c.gap();
        (agrees && gap != 0.0 && !gap.is_nan()).then_some(gap)
    }

    /// Returns `δ − σ b` where the force of contact `j` is exactly zero: `−c δ̇/k` under a linear law. Taken from the state it would
    /// have the rounding of the displacements, and times k that can exceed all other terms: the force would pull in the closed
    /// contact and press in the mode without it, so that the modes alternate. With damping, a difference larger than this
    /// rounding comes from the rounded time of the event, and the state is right.
    fn forceless(&self, j: usize, stretch: f64, rows: &StepRows) -> f64 {
        let request = self.request;
        let rounding = ROUNDING * rows.size(j);
        self.motion.forceless(j, request.at, stretch, rounding, || self.rate(j, 0, &request.x[self.s.n..], rows))
    }
}

#[cfg(test)]
#[path = "../../../tests/unit/start.rs"]
mod tests;
