//! Progress on a terminal, and Ctrl-C.

use std::{
    io::{IsTerminal, Write},
    sync::{
        Once,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};

use crate::{Progress, Task};

/// True after Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Positions of the bar.
const LENGTH: f64 = 10_000.0;

/// True while work is running that has to end soon after Ctrl-C.
static WORKING: AtomicBool = AtomicBool::new(false);
/// Number of checks of the handler for the end of that work, and the pause between two.
const LOOKS: u32 = 50;
const PAUSE: Duration = Duration::from_millis(20);
/// The exit codes after one signal, and after a second one.
const FIRST: i32 = 75;
const SECOND: i32 = 130;

/// Work that Ctrl-C ends, during the life of this value.
#[must_use = "Ctrl-C waits for work that ends at once"]
pub struct Work;

impl Drop for Work {
    fn drop(&mut self) {
        WORKING.store(false, Ordering::Relaxed);
    }
}

/// Makes Ctrl-C, SIGTERM and SIGHUP end the work that begins. A second signal ends the program at once, and so does the first if the work
/// continues for a second: a long cycle checks for no signal. Rows, events and checkpoints are in their files by then.
pub fn catch_interrupt() -> Work {
    static ONCE: Once = Once::new();
    WORKING.store(true, Ordering::Relaxed);
    ONCE.call_once(|| listen(end));
    Work
}

/// Ends the work soon.
fn end() {
    if INTERRUPTED.swap(true, Ordering::Relaxed) {
        std::process::exit(SECOND);
    }
    thread::spawn(|| {
        for _ in 0..LOOKS {
            thread::sleep(PAUSE);
            if !WORKING.load(Ordering::Relaxed) {
                return;
            }
        }
        let _ = writeln!(std::io::stderr(), "interrupted within a cycle or a point: what was finished before is kept");
        std::process::exit(FIRST);
    });
}

/// Calls `end` at every signal to end. A signal that was ignored at the start, as under nohup, stays ignored.
#[cfg(unix)]
fn listen(end: fn()) {
    use signal_hook::{
        consts::{SIGHUP, SIGINT, SIGTERM},
        iterator::Signals,
    };
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    let wanted = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    if let Ok(mut signals) = Signals::new(wanted) {
        thread::spawn(move || signals.forever().for_each(|_| end()));
    }
}

#[cfg(not(unix))]
fn listen(end: fn()) {
    // An existing handler (as in a host program) stays in place: the run then ends by that.
    let _ = ctrlc::set_handler(end);
}

/// Ends the work after some time.
pub fn limit(seconds: f64) {
    thread::spawn(move || {
        thread::sleep(Duration::from_secs_f64(seconds));
        INTERRUPTED.store(true, Ordering::Relaxed);
    });
}

/// Does work that Ctrl-C cancels, with a bar of `count` things, `kept` of which are done already.
pub fn counted<R>(count: usize, kept: usize, things: &str, quiet: bool, work: impl FnOnce(Task<'_>) -> R) -> R {
    let working = catch_interrupt();
    let template = format!("{{bar:40}} {{pos}} of {{len}} {things}  {{per_sec}}  {{eta}} left");
    let bar = bar(count as u64, &template, quiet);
    bar.set_position(kept as u64);
    bar.reset_eta();
    let done = work(cancellable(&|_| bar.inc(1)));
    drop(working);
    bar.finish_and_clear();
    done
}

/// Returns the task of work that Ctrl-C cancels and `progress` follows.
pub fn cancellable<'a>(progress: &'a (dyn Fn(Progress) + Sync)) -> Task<'a> {
    Task::new(&INTERRUPTED, progress)
}

/// Returns a bar on standard error if that is a terminal and `quiet` is false; else a hidden one.
fn bar(length: u64, template: &str, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

/// Returns a bar for the length of a run.
pub fn running(quiet: bool) -> ProgressBar {
    bar(LENGTH as u64, "{bar:40} {percent:>3} %  {msg}", quiet)
}

/// Shows that a share of a run is done; `cycles` is the number of its cycles, if it has any.
pub fn show(bar: &ProgressBar, progress: Progress, cycles: Option<f64>) {
    let Progress::Share(done) = progress else { return };
    bar.set_position((done * LENGTH) as u64);
    let seconds = bar.elapsed().as_secs_f64();
    if seconds > 0.0 && done > 0.0 {
        let rate = cycles.map_or_else(String::new, |cycles| format!("{:.0} cycles/s  ", done * cycles / seconds));
        bar.set_message(format!("{rate}{} left", lasting(seconds * (1.0 / done - 1.0))));
    }
}

/// Returns a time in a suitable unit.
pub fn lasting(seconds: f64) -> String {
    const UNITS: [(f64, &str); 5] =
        [(365.25 * 86_400.0, "years"), (86_400.0, "days"), (3600.0, "hours"), (60.0, "minutes"), (1.0, "s")];
    let (unit, name) = UNITS.into_iter().find(|(unit, _)| seconds >= 2.0 * unit).unwrap_or(UNITS[4]);
    format!("{:.0} {name}", seconds / unit)
}

/// Time after which a run is judged by its rate, and the least time that is reported, s.
const JUDGED: f64 = 2.0;
const LONG: f64 = 600.0;

/// Estimate of a run, reported once if it is unusual.
#[derive(Default)]
pub struct Estimate(AtomicBool);

impl Estimate {
    /// Returns words for a run whose share `done` took some seconds and wrote `bytes`; `None` for short runs, or after the first report.
    pub fn words(&self, done: f64, seconds: f64, bytes: impl FnOnce() -> u64) -> Option<String> {
        let total = seconds / done;
        let is_due =
            seconds >= JUDGED && done > 0.0 && !self.0.swap(seconds >= JUDGED && done > 0.0, Ordering::Relaxed);
        (is_due && total > LONG).then(|| {
            let log = bytes() as f64 / done / 1e9;
            let log = if log >= 1.0 { format!(", and its files about {log:.0} GB") } else { String::new() };
            format!("warning: at this rate the run takes about {}{log}", lasting(total))
        })
    }
}
