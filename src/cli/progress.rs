//! Progress on a terminal, and Ctrl-C.

use std::{
    io::IsTerminal,
    ops::ControlFlow,
    sync::atomic::{AtomicBool, Ordering},
};

use flank::{
    engine::Observer,
    event::EventRecord,
    hybrid::{Clock, Instant, Mode},
    integrate::DenseStep,
};
use indicatif::{ProgressBar, ProgressStyle};

/// Ctrl-C was pressed.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Positions of the bar.
const LENGTH: f64 = 10_000.0;
/// Steps between two looks at the clock of the bar.
const EVERY: u32 = 64;

/// Makes Ctrl-C end the run; a second one ends the program at once.
pub fn catch_interrupt() {
    // A handler that is there already (as in a host program) is left in place: the run then ends as it says.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
}

/// The flag that Ctrl-C sets.
pub fn interrupt() -> &'static AtomicBool {
    &INTERRUPTED
}

/// Whether Ctrl-C has been pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// A bar on standard error if that is a terminal and `quiet` is false; else nothing is shown.
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

/// A bar that counts things as they come.
pub fn counting(things: &str, quiet: bool) -> ProgressBar {
    bar(0, &format!("{{bar:40}} {{pos}} of {{len}} {things}  {{per_sec}}  {{eta}} left"), quiet)
}

/// Shows how far a run has come, and breaks it off on Ctrl-C.
pub struct Progress {
    clock: Clock,
    from: Instant,
    span: f64,
    /// Cycles of the whole run, if it has cycles.
    cycles: Option<f64>,
    bar: ProgressBar,
    steps: u32,
}

impl Progress {
    /// A bar on standard error if that is a terminal and `quiet` is false; else nothing is shown.
    pub fn new(clock: Clock, [from, _, to]: [Instant; 3], period: Option<f64>, quiet: bool) -> Self {
        let bar = bar(LENGTH as u64, "{bar:40} {percent:>3} %  {msg}  {eta} left", quiet);
        let span = clock.between(from, to);
        Self { clock, from, span, cycles: period.map(|period| span / period), bar, steps: 0 }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn show(&self, at: Instant) {
        let done = self.clock.between(self.from, at) / self.span;
        self.bar.set_position((done * LENGTH) as u64);
        let seconds = self.bar.elapsed().as_secs_f64();
        if let Some(cycles) = self.cycles.filter(|_| seconds > 0.0) {
            self.bar.set_message(format!("{:.0} cycles/s", done * cycles / seconds));
        }
    }
}

/// Goes on until Ctrl-C.
pub fn unless_interrupted() -> ControlFlow<()> {
    if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

impl Observer for Progress {
    fn step(&mut self, _: Mode, step: &dyn DenseStep, _: f64) -> ControlFlow<()> {
        self.steps = (self.steps + 1) % EVERY;
        if self.steps == 0 && !self.bar.is_hidden() {
            self.show(step.start());
        }
        unless_interrupted()
    }

    fn event(&mut self, _: &EventRecord) -> ControlFlow<()> {
        unless_interrupted()
    }
}
