//! Work without the interpreter lock, which Ctrl-C ends.

use std::{
    panic::resume_unwind,
    sync::{
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::Duration,
};

use pyo3::prelude::*;

use crate::error::{cancelled, raised};
use flank::{Progress, Task};

/// Time between two looks for signals.
const PAUSE: Duration = Duration::from_millis(50);

/// Result of work, and the exception that cancelled it: that of Ctrl-C, or one of the callback of its progress.
pub struct WorkResult<T> {
    pub result: T,
    pub cancelled: Option<PyErr>,
}

/// Does work on a thread of its own. The calling thread looks for signals meanwhile, and passes the share that is done, or the number of
/// finished units, to `progress`.
pub fn detached<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(Task<'_>) -> T + Send,
) -> WorkResult<T> {
    let (is_cancelled, units, share) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
    let report = |progress| match progress {
        Progress::Unit => {
            units.fetch_add(1, Ordering::Relaxed);
        }
        Progress::Share(done) => share.store(done.to_bits(), Ordering::Relaxed),
    };
    let look = |progress: Option<&Py<PyAny>>| {
        Python::attach(|py| {
            let done = (units.load(Ordering::Relaxed), f64::from_bits(share.load(Ordering::Relaxed)));
            let shown = || progress.map_or(Ok(()), |progress| progress.call1(py, done).map(drop));
            py.check_signals().and_then(|()| shown()).map_err(|cause| cancelled(py, cause))
        })
    };
    py.detach(|| {
        thread::scope(|scope| {
            let (ends, end) = mpsc::channel::<()>();
            let (is_cancelled, report) = (&is_cancelled, &report);
            let worker = scope.spawn(move || {
                let _ends = ends;
                work(Task::new(is_cancelled, report))
            });
            let mut stopped = None;
            while end.recv_timeout(PAUSE) == Err(RecvTimeoutError::Timeout) {
                if stopped.is_none()
                    && let Err(error) = look(progress.as_ref())
                {
                    is_cancelled.store(true, Ordering::Relaxed);
                    stopped = Some(error);
                }
            }
            let result = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            let last = if stopped.is_none() { progress.map(|progress| look(Some(&progress))) } else { None };
            WorkResult { result, cancelled: stopped.or(last.and_then(Result::err)) }
        })
    })
}

/// Does work on a pool of `threads` threads, or of as many as there are cores.
pub fn pooled<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(Task<'_>) -> T + Send,
) -> PyResult<WorkResult<T>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|error| raised(flank::Error::file("threads", std::io::Error::other(error))))?;
    Ok(detached(py, progress, |task| pool.install(|| work(task))))
}
