//! Reference solution of the engine, with an estimate of its own error.

use serde::Serialize;

use super::{
    AccuracyError, Problem,
    problem::{Passages, time_apart},
    score::pairs,
};
use crate::{
    analysis::Contacts,
    baseline::{Crossing, Penalty, Ramp},
    engine::State,
    hybrid::ContactView,
    integrate::Choice,
};

/// Window of cycles in which errors can be compared, before the motion itself amplifies them.
///
/// The variational growth is measured on neighbouring runs: their starts differ by a billionth of the motion's size, each in
/// another direction, and the shift of their events, in periods, over that billionth is the growth. The window ends with
/// the last cycle before it passes the limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Window {
    /// Whole cycles from the start.
    pub cycles: u64,
    /// Largest growth in the window: shift of an event, periods, over the relative error of the start.
    pub growth: f64,
    /// True if the run was longer, and the window was cut where growth passed the limit.
    pub cut: bool,
}

/// Reference solution, computed by the engine.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Truth {
    /// Window in which it can be compared.
    pub window: Window,
    /// Passages of flanks in the window, in order.
    pub passages: Vec<Crossing>,
    /// Error of the event times, periods, measured: the difference to the same run with its steps cut elsewhere or the
    /// uncertainty that each event states, the larger; and a unit in the last place of the motion's size times the growth,
    /// nearer than which no computation in doubles can be.
    pub error: f64,
    /// Difference of event times, periods, from a run with an integrator that has nothing in common with the first
    /// (explicit Runge–Kutta, relative tolerance 1e-12); absent where this build has none or it fails.
    pub independent: Option<f64>,
    /// Coordinates and velocities at the start of every cycle of the window and at its end.
    pub sections: Vec<Vec<f64>>,
    /// Sizes of coordinates and velocities, m, m/s: errors of the state are relative to these.
    pub sizes: [f64; 2],
    /// Time between the flanks of each contact over the window, s.
    pub apart: Vec<f64>,
    /// Largest force of each contact, N; 0 for rigid ones.
    pub peak: Vec<f64>,
    /// Mechanical energy at each section, J.
    pub energy: Vec<f64>,
    /// For each contact, true if it is closed at the start.
    pub closed: Vec<bool>,
    /// For each contact, true if it is rigid.
    pub rigid: Vec<bool>,
}

/// Disturbance of neighbouring starts, relative.
const NEAR: f64 = 1e-9;
/// Neighbouring runs.
const NEIGHBOURS: u32 = 3;
/// Tolerance of the independent run.
const INDEPENDENT: f64 = 1e-12;
/// Pieces a cycle in which the control run is cut: a number with no simple relation to stiffness steps.
const PIECES: u64 = 7;

/// One run of the engine, section by section: its passages and the states at the sections.
fn pass<'p>(
    problem: &'p Problem<'p>,
    start: State,
    cycles: u64,
    pieces: u64,
    other: Option<(Choice, f64)>,
) -> Result<(Passages<'p>, Vec<Vec<f64>>), AccuracyError> {
    let dim = 2 * problem.structure().freedoms();
    let mut passages = Passages::new(problem);
    passages.measure(&start.x);
    let mut sections = vec![start.x[..dim].to_vec()];
    let mut engine = problem.engine(start, other)?;
    for k in 1..=cycles {
        for i in 1..pieces {
            let at = problem.section(k - 1);
            engine.run(problem.clock().advance(at, problem.period * i as f64 / pieces as f64), &mut passages)?;
        }
        engine.run(problem.section(k), &mut passages)?;
        passages.measure(&engine.state().x);
        sections.push(engine.state().x[..dim].to_vec());
    }
    Ok((passages, sections))
}

impl Truth {
    /// Solves `problem`, finds the window in which growth stays below `limit`, and measures the solution's own error.
    ///
    /// # Errors
    /// [`AccuracyError`]; [`AccuracyError::NoEvents`] without an event in the window.
    pub fn find(problem: &Problem<'_>, limit: f64) -> Result<Self, AccuracyError> {
        let truth = Self::quick(problem, limit)?;
        if truth.passages.is_empty() {
            return Err(AccuracyError::NoEvents { cycles: truth.window.cycles });
        }
        if truth.error.is_infinite() {
            return Err(AccuracyError::Unsure { cycles: truth.window.cycles });
        }
        let independent =
            pass(problem, problem.start.clone(), truth.window.cycles, 1, Some((Choice::Explicit, INDEPENDENT)))
                .ok()
                .and_then(|(other, _)| shift(problem, &truth.passages, &other.found, truth.window.cycles));
        Ok(Self { independent, ..truth })
    }

    /// Solves `problem` as [`find`](Self::find) does, without the independent run; the motion may have no events.
    pub(super) fn quick(problem: &Problem<'_>, limit: f64) -> Result<Self, AccuracyError> {
        let (passages, mut sections) = pass(problem, problem.start.clone(), problem.cycles, 1, None)?;
        let sizes = passages.sizes.map(|s| s.max(f64::MIN_POSITIVE));
        let mut found = passages.found;
        let window = window(problem, &found, sizes, limit)?;
        let end = window.cycles as f64 * problem.period;
        let count = found.iter().take_while(|p| p.t <= end).count();
        found.truncate(count);
        sections.truncate(window.cycles as usize + 1);

        // The control run: the same solution, cut into other steps.
        let (control, _) = pass(problem, problem.start.clone(), window.cycles, PIECES, None)?;
        let stated = passages.uncertainty[..count].iter().fold(0.0, |m: f64, u| m.max(*u)) / problem.period;
        let error = shift(problem, &found, &control.found, window.cycles).map_or(f64::INFINITY, |s| s.max(stated))
            + window.growth * f64::EPSILON;

        let model = Penalty::new(problem.structure(), Ramp::Sharp);
        let n = problem.structure().freedoms();
        let point = |k: usize, x: &[f64]| model.point(problem.section(k as u64), &x[..n], &x[n..]);
        let mode = &problem.start.jump.mode;
        let closed: Vec<bool> =
            (0..model.contacts()).map(|j| problem.structure().contact_mode(j, mode).side() != 0.0).collect();
        let rigid = model.rigid();
        let energy = sections.iter().enumerate().map(|(k, x)| model.energy(&point(k, x))).collect();
        let mut forces = Contacts::new(problem.structure(), None).keep(0);
        problem.engine(problem.start.clone(), None)?.run(problem.section(window.cycles), &mut forces)?;
        Ok(Self {
            window,
            apart: time_apart(&found, &closed, &rigid, end),
            peak: (0..model.contacts()).map(|j| forces.report(j).force_abs_max).collect(),
            passages: found,
            error,
            independent: None,
            sections,
            sizes,
            energy,
            closed,
            rigid,
        })
    }
}

/// Returns the largest shift of event times, periods, over the first `cycles`; none if the sequences differ.
fn shift(problem: &Problem<'_>, found: &[Crossing], other: &[Crossing], cycles: u64) -> Option<f64> {
    let (matched, missed, spurious) = pairs(found, other, problem.period, cycles as f64 * problem.period);
    let worst = matched.iter().fold(0.0, |m: f64, (a, b)| m.max((a.t - b.t).abs()));
    (missed == 0 && spurious == 0).then_some(worst / problem.period)
}

/// Numbers in `(−1, 1)` from a fixed sequence (splitmix64): directions of disturbance that favour none.
fn scattered(seed: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / 2.0f64.powi(63) - 1.0
}

fn window(problem: &Problem<'_>, found: &[Crossing], sizes: [f64; 2], limit: f64) -> Result<Window, AccuracyError> {
    let n = problem.structure().freedoms();
    let (q, v) = problem.coordinates();
    let all = problem.cycles as f64 * problem.period;
    // Growth at each event that grew more than any before it.
    let mut rises: Vec<(f64, f64)> = Vec::new();
    for neighbour in 0..NEIGHBOURS {
        let moved = |x: &[f64], size: f64, from: usize| -> Vec<f64> {
            let by = |i: usize| NEAR * size * scattered(u64::from(neighbour) * 1000 + (from + i) as u64 + 1);
            x.iter().enumerate().map(|(i, x)| x + by(i)).collect()
        };
        // A start on a flank stays there: moved off it, it would have an event more or less.
        let reach = if problem.start.jump.pinned.is_empty() { sizes[0] } else { 0.0 };
        let start = problem.structure().start(problem.start.at, &moved(q, reach, 0), &moved(v, sizes[1], n))?;
        let mut x = start.x;
        x[2 * n..].copy_from_slice(&problem.start.x[2 * n..]);
        let state = State { at: problem.start.at, x, jump: start.jump };
        let other = pass(problem, state, problem.cycles, 1, None)?.0.found;
        let (matched, missed, spurious) = pairs(found, &other, problem.period, all);
        rises.extend(matched.iter().map(|(a, b)| (a.t, (a.t - b.t).abs() / (NEAR * problem.period))));
        if missed + spurious > 0 {
            // The first event without a partner: the motions have parted.
            let alone = |e: &&Crossing| !matched.iter().any(|(a, b)| a == e || b == e);
            let parted = found.iter().chain(&other).filter(alone).map(|e| e.t).reduce(f64::min);
            rises.extend(parted.map(|t| (t, f64::INFINITY)));
        }
    }
    rises.sort_by(|a, b| a.0.total_cmp(&b.0));
    let broken = rises.iter().find(|(_, growth)| *growth > limit);
    let cycles = broken.map_or(problem.cycles, |(t, _)| (t / problem.period).floor() as u64);
    if cycles == 0 {
        let growth = match broken {
            Some((_, growth)) if growth.is_finite() => format!("{growth:.0}-fold"),
            _ => "beyond bound: neighbouring runs have other events".to_owned(),
        };
        return Err(AccuracyError::NoWindow { growth });
    }
    let end = cycles as f64 * problem.period;
    let growth = rises.iter().filter(|(t, _)| *t <= end).fold(0.0, |m: f64, (_, g)| m.max(*g));
    Ok(Window { cycles, growth, cut: broken.is_some() })
}
