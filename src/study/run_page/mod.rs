//! Page of a run: the motion that it reaches.

mod animation;
mod figures;

use std::ops::ControlFlow;

use super::{
    StudyError,
    figures::Units,
    record::{Recording, record, record_until},
    steady::{Rule, Seed, settled, until},
};
use crate::{
    analysis::{Contacts, EventLog, EventRow, Grid, cycles_later},
    engine::State,
    hybrid::{ContactMode, Instant},
    orbit::{Motion, MotionKind},
    plot::{Item, Report, Section},
    scene::Duration,
    simulation::{EndKind, Simulation, Summary},
    system::Flanks,
    task::Task,
};

/// Names of the figures that a page may have.
pub const FIGURES: [&str; 5] = ["states", "deflection", "impacts", "phase-portrait", "spectrum"];

/// Samples per cycle, and least number per period of the scene's clock.
const PER_CYCLE: u32 = 300;
const PER_PERIOD: u32 = 64;
/// Cycles of a motion without a period.
const IRREGULAR: u64 = 200;
/// Periods of the scene's clock in the longest cycle of all forcing that is shown as a cycle.
const LONGEST_CYCLE: u64 = 100;
/// Samples of a run without forcing.
const SAMPLES: f64 = 4000.0;
/// Longest continuation of the motion, in cycles of the run.
const LONGER: u64 = 5;
/// Least number of cycles for a decision on the kind of a motion without an orbit.
const WATCHED: u64 = 2000;
/// The same number if a cycle has several periods of the scene's clock.
const WATCHED_CYCLES: u64 = 200;
/// Cycles drawn over time.
const SHOWN: u64 = 4;

/// Impact of the recorded motion.
struct Impact {
    contact: usize,
    side: f64,
    /// Phase in a forcing cycle, `[0, 1)`, or time without forcing, s.
    at: f64,
    /// Approach speed, m/s.
    speed: f64,
}

/// Recorded motion of a run.
struct MotionRecord {
    simulation: Simulation,
    recording: Recording,
    impacts: Vec<Impact>,
    /// Cycles recorded; none without forcing.
    cycles: Option<u64>,
    motion: Option<Motion>,
    units: Units,
}

/// Returns the page of a run that ended in `end`: the motion that it reaches, beside the measures.
///
/// With forcing, the motion continues from `end` until its kind is decided, as in a sweep. It is then recorded over whole periods, or over
/// 200 cycles without a period. Without forcing, the run itself is repeated for the record.
///
/// # Errors
/// [`StudyError`] if the motion cannot be followed.
pub fn page(simulation: &Simulation, summary: &Summary, end: &State, task: Task<'_>) -> Result<Report, StudyError> {
    // A run to a given time is shown as it is.
    let counts_cycles = matches!(simulation.settings.duration, Duration::Cycles(_));
    let shown = if summary.outcome.kind == EndKind::ReachedEnd && counts_cycles && simulation.period().is_ok() {
        settled_motion(simulation, end, task)?
    } else {
        whole_run(simulation, end)?
    };
    let figures = shown.figures().map(Item::Figure);
    let figures: Vec<Item> = shown.animation().into_iter().map(Item::Animation).chain(figures).collect();
    let mut tables: Vec<Item> =
        vec![summary.separation_table(simulation).into(), summary.force_table(simulation).into()];
    tables.extend((!summary.bearings.is_empty()).then(|| summary.bearing_table(simulation).into()));
    tables.push(summary.energy_table(simulation).into());
    let warnings = summary.warnings.iter().map(|warning| format!("Warning: {warning}"));
    Ok(Report {
        title: simulation.title().to_owned(),
        summary: shown.words().into_iter().chain(warnings).collect(),
        sections: vec![Section::new("The motion", "", figures), Section::new("Measures", "", tables)],
        provenance: vec![
            format!("flank {}", summary.flank),
            format!("scene {}; SHA-256 {}", summary.scene.name, summary.scene.sha256.clone().unwrap_or_default()),
            summary.integrator.why.clone(),
        ],
        files: Some("figures".to_owned()),
    })
}

fn settled_motion(simulation: &Simulation, end: &State, task: Task<'_>) -> Result<MotionRecord, StudyError> {
    let clock = *simulation.clock();
    // A page takes a few times as long as its run: the continuation is limited accordingly.
    let most = LONGER * (end.at.cycle - simulation.instants()[0].cycle).max(1).unsigned_abs();
    let mut engine = simulation.engine(end.clone())?;
    if end.at.phase.value() != 0.0 {
        until(&mut engine, cycles_later(&clock, end.at, 1), &mut (), task)?;
    }
    let end = engine.state().clone();
    drop(engine);
    let seed = Seed::of(&simulation.structure, &end);
    let mut simulation = simulation.clone();
    // From there on, a cycle is one of all forcing, unless that is very long.
    simulation.settings.start_cycle = u64::try_from(end.at.cycle).unwrap_or_default();
    if simulation.structure.common_cycle().is_ok_and(|periods| periods <= LONGEST_CYCLE) {
        simulation = simulation.in_common_cycles()?;
    }
    let periods = simulation.periods_per_cycle();
    let mut rule = Rule::default();
    rule.approach.most_cycles = rule.approach.most_cycles.min(most);
    // Fewer cycles do not decide: the motion is then reported as undecided.
    rule.decides = most >= WATCHED.max(WATCHED_CYCLES * periods);
    rule.watched_cycles = Some(most);
    let (mut engine, motion, _) = settled(&simulation, Some(&seed), &rule, task)?;
    let irregular = (IRREGULAR.min(most) / periods).max(SHOWN);
    let cycles = motion.period.map_or(irregular, |period| SHOWN.next_multiple_of(period));
    let start = engine.state().clone();
    // Exact: a cycle has few periods.
    let per_cycle = PER_CYCLE.max(PER_PERIOD * periods as u32);
    let recording = record(&simulation, &mut engine, cycles, per_cycle)?;
    let impacts = impacts(&simulation, start, engine.state().at)?;
    let units = Units::of(&simulation);
    drop(engine);
    Ok(MotionRecord { simulation, recording, impacts, cycles: Some(cycles), motion: Some(motion), units })
}

fn whole_run(simulation: &Simulation, end: &State) -> Result<MotionRecord, StudyError> {
    let start = simulation.start()?;
    let interval = simulation.clock().between(start.at, end.at) / SAMPLES;
    let recording =
        record_until(simulation, &mut simulation.engine(start.clone())?, end.at, Grid::Interval { interval })?;
    let impacts = impacts(simulation, start, end.at)?;
    let largest = recording.deflection.iter().flatten().fold(0.0, |most: f64, d| most.max(d.abs()));
    let units = Units::of(simulation).fit(simulation.clock().between(simulation.start()?.at, end.at), largest);
    Ok(MotionRecord { simulation: simulation.clone(), recording, impacts, cycles: None, motion: None, units })
}

/// Returns the impacts of the motion from `start` on.
fn impacts(simulation: &Simulation, start: State, end: Instant) -> Result<Vec<Impact>, StudyError> {
    let structure = &simulation.structure;
    let (period, from) = (simulation.period().ok(), simulation.clock().time(start.at).value());
    let mut impacts = Vec::new();
    let take = |row: EventRow| {
        for event in &row.contacts {
            let has_back = structure.spec().contacts[event.mesh].flanks == Flanks::Both;
            let side = match event.to {
                "drive" => 1.0,
                "back" => -1.0,
                _ if event.blows.is_none() => continue,
                _ if has_back && event.deflection < 0.0 => -1.0,
                _ => 1.0,
            };
            if let Some(speed) = event.approach.filter(|speed| *speed > 0.0 && event.from == "separated") {
                let at = period.map_or(row.seconds - from, |period| (row.phase / period).rem_euclid(1.0));
                impacts.push(Impact { contact: event.mesh, side, at, speed });
            }
        }
        ControlFlow::Continue(())
    };
    let mut log = EventLog::new(structure, Contacts::new(structure, None).keep(0), take);
    simulation.engine(start)?.run(end, &mut log)?;
    Ok(impacts)
}

/// Returns the index of the tile colour of a contact's state: the same in all figures.
fn colour(mode: ContactMode) -> usize {
    match mode {
        ContactMode::Separated => 6,
        _ if !mode.is_closed() => 2,
        _ if mode.side() < 0.0 => 5,
        _ => 0,
    }
}

fn state_name(mode: ContactMode) -> &'static str {
    match mode {
        ContactMode::Separated => "separated",
        _ if !mode.is_closed() => "in a flank's zone without force",
        _ if mode.side() < 0.0 => "on the back flank",
        _ => "on the drive flank",
    }
}

impl MotionRecord {
    /// Returns the kind of the motion, sentence by sentence.
    fn words(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(motion) = &self.motion {
            let mut line = match (motion.kind, motion.period) {
                (MotionKind::Periodic, Some(1)) => "The motion is periodic, of one forcing cycle.".to_owned(),
                (MotionKind::Periodic, Some(period)) => format!("The motion is periodic, of {period} forcing cycles."),
                (MotionKind::Undecided, _) => {
                    "The kind of the motion is undecided: flank sweep decides it, or a longer run.".to_owned()
                }
                (MotionKind::Transient, _) => "The motion is not steady yet.".to_owned(),
                _ => format!("The motion is {}.", motion.kind.word()),
            };
            line += &match motion.cycles {
                0 => " The run ends on it.".to_owned(),
                cycles => format!(" It was followed for {cycles} cycles after the end of the run."),
            };
            if let Some([exponent, band]) = motion.exponent {
                line += &format!(
                    " Largest exponent {exponent:.4}, to {band:.1e}, per {}.",
                    if self.units.force.is_empty() { "unit of time" } else { "second" }
                );
            }
            lines.push(line);
            lines.extend(
                motion
                    .word
                    .iter()
                    .filter(|word| (1..=200).contains(&word.len()))
                    .map(|word| format!("Events of a period: {word}")),
            );
            lines.extend(motion.reason.iter().map(|reason| format!("Reason: {reason}.")));
        }
        let over = self.cycles.map_or_else(|| "the run".to_owned(), |cycles| format!("{cycles} cycles"));
        let count = |side: f64| self.impacts.iter().filter(|impact| impact.side == side).count();
        lines.push(match self.impacts.len() {
            0 => format!("No impacts in {over}."),
            _ => format!("Impacts in {over}: {} on drive flanks, {} on back flanks.", count(1.0), count(-1.0)),
        });
        if self.motion.is_some() {
            lines.push(
                "Another start can end on another motion: flank basins tells, over a plane of starts.".to_owned(),
            );
        }
        lines
    }
}
