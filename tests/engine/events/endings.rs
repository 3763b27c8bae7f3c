//! How runs end, and how they fail: lines 28 to 31.

use flank::{
    engine::{EngineError, Options, Outcome},
    integrate::IntegrateError,
};

use super::support::{Course, Log, attempt, ball, engine, run, state};

#[test]
fn l28_a_spent_budget_ends_the_run_right_after_the_last_event_it_allows() {
    let s = ball(0.5);
    // Impacts at 2, 3, 3.5, 3.75.
    for (budget, time) in [(1, 2.0), (2, 3.0), (3, 3.5)] {
        let mut log = Log::default();
        let options = Options { max_events: budget, ..Options::default() };
        let mut engine = engine(&s, state(&s, &[0.0], &[1.0]), options);
        assert_eq!(engine.run(s.clock().instant(10.0), &mut log), Ok(Outcome::EventBudgetSpent));
        assert_eq!(log.records.iter().filter(|r| !r.start).count() as u64, budget);
        let last = log.records.last().unwrap();
        assert!((s.clock().time(last.at).value() - time).abs() <= 16.0 * f64::EPSILON);
        assert_eq!((engine.state().at, &engine.state().x), (last.at, &last.x_plus));
        assert_eq!(engine.counters().events, budget);
    }
}

#[test]
fn l29_an_observer_may_stop_a_run_and_it_goes_on_where_it_stopped() {
    let s = ball(0.5);
    let whole = run(&s, &[0.0], &[1.0], 6.0);
    for stop in 1..8 {
        let mut log = Log { stop_after: Some(stop), ..Log::default() };
        let mut first = engine(&s, state(&s, &[0.0], &[1.0]), Options::default());
        assert_eq!(first.run(s.clock().instant(6.0), &mut log), Ok(Outcome::StoppedByObserver));
        assert_eq!(log.records.len(), stop);
        log.stop_after = None;
        assert_eq!(first.run(s.clock().instant(6.0), &mut log), Ok(Outcome::ReachedEnd));
        assert_eq!(log.records, whole.records, "{stop}");
        assert_eq!(first.state(), &whole.state);
    }
}

#[test]
fn l30_a_number_that_is_none_is_an_error_at_once() {
    for (name, c) in [
        ("state", vec![1.0, f64::NAN]),
        ("guard and state", vec![1.0, -2.0, f64::NAN]),
        ("infinite", vec![1.0, -1.0, f64::INFINITY]),
        ("last", vec![1.0, -10.0, 0.0, 0.0, f64::NAN]),
    ] {
        let course = Course::new(&c);
        let (outcome, run) = attempt(&course, course.start(), course.clock.instant(3.0));
        let Err(EngineError::Integrate { source: IntegrateError::NotFinite { t }, .. }) = outcome else {
            panic!("{name}: {outcome:?}")
        };
        assert_eq!((t, run.records.len(), run.counters.events), (0.0, 0, 0), "{name}");
    }
}

#[test]
fn l30_a_run_whose_time_stands_still_ends_with_an_error() {
    let course = Course::new(&[1.0]);
    let course = Course { stop: Some(course.clock.instant(2.0)), ..course };
    let (outcome, run) = attempt(&course, course.start(), course.clock.instant(3.0));
    assert!(matches!(outcome, Err(EngineError::Still { t: 2.0, .. })), "{outcome:?}");
    assert_eq!(run.clock.time(run.state.at).value(), 2.0);
}

#[test]
fn l31_a_run_to_where_it_stands_is_no_run() {
    let s = ball(0.5);
    let run = run(&s, &[0.7], &[0.0], 0.0);
    assert_eq!((run.records.len(), run.counters.steps, run.state.x[0]), (0, 0, 0.7));
}
