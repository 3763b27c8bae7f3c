//! Many scenes of every class on all cores, and a table.

use std::{
    io::Write as _,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use serde_json::Value;

use super::{
    judge::{Judged, Verdict, judge},
    scenes::{CLASSES, Class, Extreme},
};

/// What to run.
pub struct Plan {
    /// Letters of the classes; all if empty.
    pub classes: Vec<String>,
    pub count: usize,
    pub seed: u64,
    pub budget: usize,
    pub limit: Duration,
    /// Whether failing scenes are printed.
    pub tell: bool,
    /// `run.event_tolerance` of all scenes that are compared arc by arc.
    pub tolerance: f64,
}

impl Plan {
    /// From `FLANK_ORACLE_CLASS`, `_COUNT`, `_SEED`, `_INDEX` and `_TOLERANCE`.
    pub fn from_environment() -> Self {
        let number = |name: &str, default: u64| {
            std::env::var(format!("FLANK_ORACLE_{name}")).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
        };
        let classes = std::env::var("FLANK_ORACLE_CLASS").unwrap_or_default();
        Self {
            classes: classes.split(',').filter(|c| !c.is_empty()).map(str::to_owned).collect(),
            count: number("COUNT", 200) as usize,
            seed: number("SEED", 1),
            budget: 30,
            limit: Duration::from_secs(60),
            tell: true,
            tolerance: std::env::var("FLANK_ORACLE_TOLERANCE").ok().and_then(|v| v.parse().ok()).unwrap_or(0.0),
        }
    }
}

/// One line of the table.
#[derive(Default)]
pub struct Line {
    pub tried: usize,
    pub refused: usize,
    pub wrong: usize,
    pub alarmed: usize,
    pub ambiguous: usize,
    pub events: usize,
    pub worst: f64,
    pub seconds: f64,
    pub oracle_seconds: f64,
    pub slowest: f64,
}

impl Line {
    /// Scenes that are not right. Of class `X` a tenth may be refused: what its numbers foresee.
    pub fn bad(&self, letter: &str) -> usize {
        let foreseen = if letter == "X" { self.tried / 10 } else { 0 };
        self.wrong + self.alarmed + self.refused.saturating_sub(foreseen)
    }

    fn add(&mut self, j: &Judged) {
        self.count(&j.verdict, j.flank_seconds);
        self.ambiguous += usize::from(j.ambiguous.is_some());
        self.events += j.events;
        self.worst = self.worst.max(j.worst);
        self.oracle_seconds += j.oracle_seconds;
    }

    fn count(&mut self, verdict: &Verdict, seconds: f64) {
        self.tried += 1;
        self.seconds += seconds;
        self.slowest = self.slowest.max(seconds);
        match verdict {
            Verdict::Right => {}
            Verdict::Refused(_) => self.refused += 1,
            Verdict::Wrong(_) => self.wrong += 1,
            Verdict::Alarmed(_) => self.alarmed += 1,
        }
    }
}

/// Seconds of the oracle worth telling.
const SLOW: f64 = 4.0;

fn say(words: &str) {
    // A closed pipe is no failure of a scene.
    let _ = writeln!(std::io::stdout(), "{words}");
}

/// Does something with every scene of a class, on all cores.
fn each(class: &Class, plan: &Plan, work: impl Fn(usize, Value) + Sync) {
    all(plan, |index| work(index, class.scene(plan.seed, index)));
}

fn all(plan: &Plan, work: impl Fn(usize) + Sync) {
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= plan.count {
                        return;
                    }
                    work(index);
                }
            });
        }
    });
}

/// Runs a class.
fn run(class: &Class, plan: &Plan) -> Line {
    let line = Mutex::new(Line::default());
    each(class, plan, |index, scene| {
        let judged = judge(&scene, plan.budget, class.limit(plan.limit));
        if plan.tell {
            tell(class, index, &judged);
        }
        if let Ok(mut line) = line.lock() {
            line.add(&judged);
        }
    });
    line.into_inner().unwrap_or_default()
}

const DRIFT: &str = "drift over 10000 periods, in shares of 1e-11 of one";
const TRANSFORMS: &str = "scenes and their transforms";
/// Periods of class H.
const PERIODS: usize = 10_000;

/// Class H.
fn drifting(plan: &Plan) -> Line {
    let line = Mutex::new(Line::default());
    all(plan, |index| {
        let scene = super::scenes::periodic(plan.seed, index);
        let (verdict, worst, seconds) = super::drift::judge(&scene, PERIODS, plan.limit);
        if plan.tell && verdict != Verdict::Right {
            say(&format!("H {index} {verdict:?}\n    {scene}"));
        }
        if let Ok(mut line) = line.lock() {
            line.count(&verdict, seconds);
            line.worst = line.worst.max(worst / 1e-11);
        }
    });
    line.into_inner().unwrap_or_default()
}

/// Class O.
fn transformed(plan: &Plan) -> Line {
    let line = Mutex::new(Line::default());
    all(plan, |index| {
        let transform = super::scenes::transform(plan.seed, index);
        let (verdict, seconds) = super::transforms::judge(&transform, plan.budget, plan.limit);
        if plan.tell && verdict != Verdict::Right {
            say(&format!("O {index} {verdict:?}\n    {}\n    {}", transform.base, transform.other));
        }
        if let Ok(mut line) = line.lock() {
            line.count(&verdict, seconds);
        }
    });
    line.into_inner().unwrap_or_default()
}

const EXTREMES: &str = "extreme units and times";

/// Class X.
fn extremes(plan: &Plan) -> Line {
    let line = Mutex::new(Line::default());
    all(plan, |index| {
        let extreme = super::scenes::extreme(plan.seed, index);
        let (verdict, seconds) = super::transforms::judge_extreme(&extreme, plan.budget, plan.limit);
        if plan.tell && verdict != Verdict::Right {
            let scenes = match &extreme {
                Extreme::Transform(transform) => format!("{}\n    {}", transform.base, transform.other),
                Extreme::Flight { scene, .. } => scene.to_string(),
            };
            say(&format!("X {index} {verdict:?}\n    {scenes}"));
        }
        if let Ok(mut line) = line.lock() {
            line.count(&verdict, seconds);
        }
    });
    line.into_inner().unwrap_or_default()
}

/// Arcs of a class: how many, how many beyond their uncertainty, how many to another event, and the median of error over it.
pub struct Arcs {
    pub letter: &'static str,
    pub count: usize,
    pub beyond: usize,
    pub other: usize,
    pub median: f64,
}

/// Compares arc by arc.
pub fn arcs(plan: &Plan) -> Vec<Arcs> {
    let mut table = Vec::new();
    say("class   arcs  beyond  other  median  worst  of error over stated uncertainty");
    for class in chosen(plan) {
        let all = Mutex::new(Vec::new());
        each(class, plan, |index, mut scene| {
            if plan.tolerance > 0.0 {
                scene["run"]["event_tolerance"] = plan.tolerance.into();
            }
            let found = super::arcs::arcs(&scene, plan.budget);
            if let Some(bad) = found.iter().find(|a| !a.is_held()).filter(|_| plan.tell) {
                let words = format!("off by {:.2e}, stated {:.2e}", bad.error, bad.stated);
                say(&format!("{} {index} {}\n    {scene}", class.letter, bad.other.as_ref().unwrap_or(&words)));
            }
            if let Ok(mut all) = all.lock() {
                all.extend(found);
            }
        });
        let all = all.into_inner().unwrap_or_default();
        let mut ratios: Vec<f64> =
            all.iter().filter(|a| a.other.is_none() && a.stated > 0.0).map(|a| a.error / a.stated).collect();
        ratios.sort_by(f64::total_cmp);
        let other = all.iter().filter(|a| a.other.is_some()).count();
        let beyond = all.iter().filter(|a| a.other.is_none() && !a.is_held()).count();
        let median = ratios.get(ratios.len() / 2).copied().unwrap_or(0.0);
        let worst = ratios.last().copied().unwrap_or(0.0);
        say(&format!("{:5} {:6} {beyond:7} {other:6} {median:8.1e} {worst:8.1e}", class.letter, all.len()));
        table.push(Arcs { letter: class.letter, count: all.len(), beyond, other, median });
    }
    table
}

/// Events with a bar, those beyond it, and the largest ratio, over all classes.
pub fn bars(plan: &Plan) -> [f64; 3] {
    let mut sum = [0.0_f64; 3];
    say("class  events  beyond   worst  of error over uncertainty and inherited uncertainty");
    // Class I is about cost, and has few events.
    for class in chosen(plan).filter(|class| class.letter != "I") {
        let all = Mutex::new(Vec::new());
        each(class, plan, |index, scene| {
            let ratios = super::bars::bars(&scene, plan.budget);
            let worst = ratios.iter().copied().fold(0.0, f64::max);
            if worst > 10.0 && plan.tell {
                say(&format!("{} {index} off by {worst:.1e} bars\n    {scene}", class.letter));
            }
            if let Ok(mut all) = all.lock() {
                all.extend(ratios);
            }
        });
        let all = all.into_inner().unwrap_or_default();
        let beyond = all.iter().filter(|ratio| **ratio > 1.0).count();
        let worst = all.iter().copied().fold(0.0, f64::max);
        say(&format!("{:5} {:7} {beyond:7} {worst:8.1e}", class.letter, all.len()));
        sum = [sum[0] + all.len() as f64, sum[1] + beyond as f64, sum[2].max(worst)];
    }
    say(&format!("all   {:7} {:7} {:8.1e}", sum[0], sum[1], sum[2]));
    sum
}

fn chosen(plan: &Plan) -> impl Iterator<Item = &'static Class> {
    CLASSES.iter().filter(|c| plan.classes.is_empty() || plan.classes.iter().any(|l| l == c.letter))
}

fn tell(class: &Class, index: usize, j: &Judged) {
    if j.oracle_seconds > SLOW {
        say(&format!("{} {index} takes the oracle {:.1} s\n    {}", class.letter, j.oracle_seconds, j.scene));
    }
    let (word, why) = match &j.verdict {
        Verdict::Right => match &j.ambiguous {
            Some(why) if std::env::var_os("FLANK_ORACLE_AMBIGUOUS").is_some() => ("ambiguous", why),
            _ => return,
        },
        Verdict::Refused(why) => ("refused", why),
        Verdict::Wrong(why) => ("wrong", why),
        Verdict::Alarmed(why) => ("alarmed", why),
    };
    say(&format!("{} {index} {word}: {why}\n    {}", class.letter, j.scene));
}

/// Runs the plan and prints the table. The number of wrong scenes.
pub fn nightly(plan: &Plan) -> Vec<(&'static str, Line)> {
    let mut table = Vec::new();
    for class in chosen(plan) {
        let began = Instant::now();
        let line = run(class, plan);
        if plan.tell {
            say(&format!("# class {} done in {:.0} s", class.letter, began.elapsed().as_secs_f64()));
        }
        table.push((class.letter, line));
    }
    let asked = |letter: &str| plan.classes.is_empty() || plan.classes.iter().any(|l| l == letter);
    if asked("H") {
        table.push(("H", drifting(plan)));
    }
    if asked("O") {
        table.push(("O", transformed(plan)));
    }
    if asked("X") {
        table.push(("X", extremes(plan)));
    }
    if plan.tell {
        say("class  tried refused wrong alarmed ambiguous  events  worst/allowed  seconds  slowest  oracle s  about");
        for (letter, l) in &table {
            let about = CLASSES.iter().find(|c| c.letter == *letter).map_or_else(
                || match *letter {
                    "H" => DRIFT,
                    "X" => EXTREMES,
                    _ => TRANSFORMS,
                },
                |c| c.about,
            );
            say(&format!(
                "{letter:5} {:6} {:7} {:5} {:7} {:9} {:7} {:14.2e} {:8.1} {:8.2} {:9.1}  {about}",
                l.tried,
                l.refused,
                l.wrong,
                l.alarmed,
                l.ambiguous,
                l.events,
                l.worst,
                l.seconds,
                l.slowest,
                l.oracle_seconds
            ));
        }
    }
    table
}
