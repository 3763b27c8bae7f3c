use std::{
    collections::BTreeSet,
    fmt::Display,
    sync::{Mutex, MutexGuard, PoisonError},
};

use rayon::prelude::*;
use serde::{Serialize, de::DeserializeOwned};

use super::{Journal, Outcome, Plan, RowWork, SweepError};
use crate::task::Task;

/// End of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// No row is missing.
    Complete,
    /// It was interrupted; finished rows are stored.
    Interrupted,
}

/// Computes every row that the journal does not hold. Chains run in parallel, the rows of a chain one after the other. A point that fails
/// gives a row with the reason, and the next of its chain starts fresh.
///
/// `point` makes a row, and the end of it from which a neighbour may start. The same cell and seed must give the same result. `task` counts
/// every row. Once it is cancelled no point begins, and a point that then fails is not stored: it may check the task and stop. The threads
/// are those of the current rayon pool, or as many as there are cores.
///
/// # Errors
/// [`SweepError`] if a row cannot be stored.
pub fn run<R, S, E, P>(plan: &Plan, journal: &mut Journal<R, S>, point: P, task: Task<'_>) -> Result<Ending, SweepError>
where
    R: Serialize + DeserializeOwned,
    S: Serialize + DeserializeOwned + Sync,
    R: Sync,
    E: Display,
    P: Fn(&RowWork, Option<&S>) -> Result<(R, S), E> + Sync,
{
    // A stored row is read again if the next one of its chain starts from it.
    let mut wanted = BTreeSet::new();
    let share = journal.records.share();
    if journal.records.count() > 0 {
        for chain in (0..plan.chains()).filter(|chain| share.holds(*chain)) {
            let mut before = None;
            for row in plan.chain(chain) {
                let has = journal.records.has(row);
                wanted.extend(before.filter(|_| !has));
                before = has.then_some(row);
            }
        }
    }
    let seeds = journal.find(&wanted)?;
    let journal = Mutex::new(journal);
    let hold = || -> MutexGuard<'_, &mut Journal<R, S>> { journal.lock().unwrap_or_else(PoisonError::into_inner) };

    let along = |chain: usize| -> Result<(), SweepError> {
        let mut before: Option<Outcome<R, S>> = None;
        let mut kept: Option<usize> = None;
        for row in plan.chain(chain) {
            if hold().records.has(row) {
                (before, kept) = (None, Some(row));
                continue;
            }
            if task.is_cancelled() {
                break;
            }
            let seed = kept.take().and_then(|row| seeds.get(&row)).or(before.as_ref());
            let seed = seed.and_then(|outcome| match outcome {
                Outcome::Done { end, .. } => Some(end),
                Outcome::Failed(_) => None,
            });
            let outcome = match point(&plan.cell(row), seed) {
                Ok((result, end)) => Outcome::Done { result, end },
                // Stopped, not failed.
                Err(_) if task.is_cancelled() => break,
                Err(error) => Outcome::Failed(error.to_string()),
            };
            before = Some(hold().keep(row, outcome)?);
            task.advance();
        }
        Ok(())
    };
    let own = 0..share.count(plan.chains());
    own.into_par_iter().with_max_len(1).map(|i| share.chain(i)).try_for_each(along)?;
    hold().records.sync()?;
    let complete = hold().records.is_complete();
    Ok(if complete { Ending::Complete } else { Ending::Interrupted })
}
