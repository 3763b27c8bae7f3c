//! Flank on a scene, through the same doors as `flank run`.

use std::{
    ops::ControlFlow,
    panic::{AssertUnwindSafe, catch_unwind},
    time::{Duration, Instant},
};

use flank::{
    Simulation,
    analysis::{Contacts, EventKind as Logged, EventLog, EventRow},
    engine::{Engine, Observer},
    hybrid::Mode,
    integrate::DenseStep,
    scene::Scene,
};

use super::{
    sequence::Kind,
    wide::{Wide, wide},
};

/// Why there is no result.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// The scene is not taken.
    Refused(String),
    /// The run ends with an error.
    Alarmed(String),
    Slow,
}

pub struct Run {
    pub events: Vec<(Wide, usize, Kind)>,
    /// Rows at t = 0.
    pub zero: Vec<EventRow>,
    pub failure: Option<Failure>,
    pub seconds: f64,
}

/// Ends a run that takes too long.
struct Deadline(Instant);

impl Observer for Deadline {
    fn step(&mut self, _: &Mode, _: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        if Instant::now() > self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Runs a scene for at most so long.
pub fn run(scene: &Scene, limit: Duration) -> Run {
    let began = Instant::now();
    let mut out = Run { events: Vec::new(), zero: Vec::new(), failure: None, seconds: 0.0 };
    let result = catch_unwind(AssertUnwindSafe(|| inner(scene, began + limit, &mut out)));
    out.failure = match result {
        Ok(Ok(())) => None,
        Ok(Err(failure)) => Some(failure),
        Err(_) => Some(Failure::Alarmed("panic".into())),
    };
    out.seconds = began.elapsed().as_secs_f64();
    out
}

fn inner(scene: &Scene, deadline: Instant, out: &mut Run) -> Result<(), Failure> {
    let refused = |e: &dyn std::fmt::Display| Failure::Refused(e.to_string());
    let case = Simulation::from_scene(scene).map_err(|e| refused(&e))?;
    let start = case.start().map_err(|e| refused(&e))?;
    let [from, _, end] = case.instants();
    let mut engine: Engine<'_> = case.engine(start).map_err(|e| refused(&e))?;
    let mut rows = Vec::new();
    let mut log = EventLog::new(&case.structure, Contacts::new(&case.structure, Some(from)).keep(0), |row| {
        rows.push(row);
        ControlFlow::Continue(())
    });
    let mut watch = Deadline(deadline);
    let result = engine.run(end, &mut (&mut log, &mut watch));
    for row in rows {
        let t = decimal(&row.t);
        if t <= wide(0.0) || row.start {
            out.zero.push(row);
            continue;
        }
        out.events.extend(row.contacts.iter().filter_map(|c| Some((t, c.mesh, kind(c.kind)?))));
    }
    match result {
        Err(e) => Err(Failure::Alarmed(e.to_string())),
        Ok(flank::engine::Outcome::StoppedByObserver) => Err(Failure::Slow),
        Ok(_) => Ok(()),
    }
}

pub fn kind(kind: Logged) -> Option<Kind> {
    Some(match kind {
        Logged::DriveContact => Kind::DriveContact,
        Logged::BackContact => Kind::BackContact,
        Logged::Separation => Kind::Separation,
        Logged::Clear => Kind::Clear,
        Logged::Impact => Kind::Impact,
        Logged::Stick => Kind::Stick,
        Logged::Release => Kind::Release,
        _ => return None,
    })
}

/// A decimal number of up to 32 digits.
pub fn decimal(text: &str) -> Wide {
    let (digits, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let (mut value, mut places, mut behind) = (wide(0.0), exponent.parse::<i32>().unwrap_or(0), false);
    for c in digits.chars() {
        match c.to_digit(10) {
            Some(d) => {
                value = value * wide(10.0) + wide(f64::from(d));
                places -= i32::from(behind);
            }
            None => behind |= c == '.',
        }
    }
    let ten = super::wide::power(wide(10.0), places.unsigned_abs() as usize);
    let value = if places < 0 { value / ten } else { value * ten };
    if text.starts_with('-') { -value } else { value }
}
