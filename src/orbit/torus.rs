//! Kind of a motion whose forcing has no cycle, or too long a one.

use super::{
    ApproachEnd, Motion, MotionKind, SectionMap, WatchTime,
    kind::{BANDS, DETERMINED, Figures, MotionCycles, PARTED, REGULAR, UNRESOLVED},
    mover::Mover,
    unknowns::ACCELERATES,
};
use crate::{
    engine::{Engine, Observer},
    simulation::SimulationError,
    task::Task,
};

/// Further doublings beside those of a motion whose sections are compared: a period of the clock is short against the cycle of the forcing.
const MORE: u32 = 3;

/// Decides the kind of a motion whose forcing has no cycle, or too long a one, as `why` states. It uses the largest exponent and weighted
/// averages over periods of the clock. Neighbours that approach each other follow the forcing: the motion is a torus. `None` if the run is
/// interrupted.
///
/// # Errors
/// [`SimulationError`] if the run fails.
pub fn decide_on_torus<'s>(
    map: &SectionMap<'s>,
    engine: &mut Engine<'s>,
    why: &str,
    watching: WatchTime,
    observer: &mut dyn Observer,
    task: Task<'_>,
) -> Result<Option<Motion>, SimulationError> {
    let (simulation, drift) = (map.simulation(), map.drift());
    let period = simulation.period()?;
    let mut motion = Motion { distance: 0.0, ..Motion::of(&ApproachEnd::default()) };
    let ends = |motion: Motion, kind, reason: String| Ok(Some(Motion { kind, reason: Some(reason), ..motion }));
    if drift.accelerates(simulation) {
        return ends(motion, MotionKind::Transient, ACCELERATES.to_owned());
    }
    let mut mover = Mover::new(*map, &drift, engine, observer);
    let mut watched = MotionCycles::new(&mut mover, watching.is_settled);
    let doublings = watching.doublings + MORE;
    for doubled in 0..=doublings {
        while (watched.rows.len() as u64) < watching.cycles << doubled {
            if !watched.cycle(&mut mover)? || task.is_cancelled() {
                return Ok(None);
            }
            // The averages are of observables; sections are not compared.
            watched.points.clear();
            motion.cycles += 1;
        }
        if watched.is_unresolved() {
            return ends(motion, MotionKind::Undecided, UNRESOLVED.to_owned());
        }
        let figures = watched.figures(period);
        let Figures { exponent, band, .. } = figures;
        motion.exponent = Some([exponent, band]).filter(|e| e.iter().all(|e| e.is_finite()));
        let closes = exponent + BANDS * band < 0.0;
        // A slow decay of a speed that moves no contact may outlast any run: averages show that all other coordinates have settled.
        let has_settled = exponent * period * watched.rows.len() as f64 <= -PARTED || figures.digits >= REGULAR;
        if closes && has_settled || figures.is_regular(period) {
            return ends(motion, MotionKind::QuasiPeriodic, why.to_owned());
        }
        // Neighbours on a torus part in proportion to time, never so far: the averages of intermittent chaos need not scatter.
        let parts = doubled == doublings && figures.parts() && figures.whole > DETERMINED;
        if parts || figures.is_chaotic(period, doubled == doublings) {
            return ends(motion, MotionKind::Chaotic, why.to_owned());
        }
        if closes && doubled == doublings {
            let reason =
                format!("neighbours still come together after {} cycles, and averages have not settled", motion.cycles);
            return ends(motion, MotionKind::Transient, reason);
        }
    }
    let reason = watched.figures(period).reason(motion.cycles, Some(why.to_owned()));
    ends(motion, MotionKind::Undecided, reason)
}
