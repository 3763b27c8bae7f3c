use std::{
    fmt::Display,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use rayon::prelude::*;
use serde::{Serialize, de::DeserializeOwned};

use super::{Cell, Entry, Journal, Outcome, Plan, SweepError};

/// How a sweep ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// No row is missing.
    Complete,
    /// It was broken off; what was finished is kept.
    Interrupted,
}

/// What is done at a point, and how.
pub struct Work<'a, P, W> {
    /// The work: a row, and the end of it that a neighbour may start from. The same cell and seed must give the same.
    pub point: P,
    /// Told how many rows are done, of how many, whenever one is.
    pub progress: W,
    /// Breaks the sweep off once it is true. No point begins after that; a point that then fails is not kept, so that
    /// the work may look at the flag itself and give up.
    pub interrupted: &'a AtomicBool,
    /// Threads, ≥ 1; 0 for as many as there are cores.
    pub threads: usize,
}

/// Computes every row that the journal does not hold. Chains run beside each other, the rows of a chain one after the
/// other. A point that fails is a row that says why, and the next of its chain starts fresh.
///
/// # Errors
/// [`SweepError`] if a row cannot be kept, or no threads can be had.
pub fn run<R, S, E, P, W>(plan: &Plan, journal: &mut Journal<R, S>, work: &Work<'_, P, W>) -> Result<Ending, SweepError>
where
    R: Serialize + DeserializeOwned,
    S: Serialize + DeserializeOwned,
    E: Display,
    P: Fn(&Cell, Option<&S>) -> Result<(R, S), E> + Sync,
    W: Fn(usize, usize) + Sync,
{
    let total = plan.rows();
    let journal = Mutex::new(journal);
    let hold = || -> MutexGuard<'_, &mut Journal<R, S>> { journal.lock().unwrap_or_else(PoisonError::into_inner) };
    let interrupted = || work.interrupted.load(Ordering::Relaxed);
    (work.progress)(hold().kept(), total);

    let along = |chain: usize| -> Result<(), SweepError> {
        let mut before: Option<Entry<R, S>> = None;
        for row in plan.chain(chain) {
            if let Some(entry) = hold().entry(row)? {
                before = Some(entry);
                continue;
            }
            if interrupted() {
                break;
            }
            let seed = before.as_ref().and_then(|entry| match &entry.outcome {
                Outcome::Done { end, .. } => Some(end),
                Outcome::Failed(_) => None,
            });
            let outcome = match (work.point)(&plan.cell(row), seed) {
                Ok((result, end)) => Outcome::Done { result, end },
                // Given up, not failed.
                Err(_) if interrupted() => break,
                Err(error) => Outcome::Failed(error.to_string()),
            };
            let mut journal = hold();
            before = Some(journal.keep(Entry { row, outcome })?);
            (work.progress)(journal.kept(), total);
        }
        Ok(())
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(work.threads).build()?;
    pool.install(|| (0..plan.chains()).into_par_iter().with_max_len(1).try_for_each(along))?;
    let complete = hold().kept() == total;
    Ok(if complete { Ending::Complete } else { Ending::Interrupted })
}
