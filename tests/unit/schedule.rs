//! Pieces of schedules against a list of all their starts.

use super::*;

/// The starts of a schedule from 20 repetitions before time zero, or another time, on, in rising order, with the numbers of their pieces.
fn all(schedule: &Schedule, clock: &Clock, from: Instant) -> Vec<(Instant, u32)> {
    let values = match schedule {
        Schedule::Listed { times, .. } => {
            return times.iter().enumerate().map(|(i, time)| (*time, (i as u32 + 1) & 1)).collect();
        }
        Schedule::Locked { values, .. } | Schedule::Own { values, .. } => values.len(),
    };
    let of = |k| (0..schedule.starts()).map(move |i| (schedule.start(clock, k, i), (i % values) as u32));
    let first = schedule.repetition(clock, from) - 20;
    (first..first + 80).flat_map(of).collect()
}

fn agrees(stiffness: &Stiffness, clock: &Clock, number_of_pieces: u32) {
    let schedule = Schedule::new(stiffness, clock);
    for cycle in [0, 1_000_000, 1_000_000_000] {
        agrees_from(&schedule, clock, number_of_pieces, clock.at(cycle, 0.0));
    }
}

fn agrees_from(schedule: &Schedule, clock: &Clock, number_of_pieces: u32, from: Instant) {
    let starts = all(schedule, clock, from);
    assert!(starts.is_sorted_by(|a, b| a.0 < b.0), "{schedule:?}");
    let between = (0..400).map(|i| clock.advance(from, 0.0371 * f64::from(i)));
    let near =
        starts.iter().map(|(start, _)| *start).filter(|start| (0.0..15.0).contains(&clock.between(from, *start)));
    // At a start, and where a start is not told from it.
    let edges = near.flat_map(|start| {
        let tie = clock.between(start, late(clock, start));
        [-2.0, -0.5, 0.0, 0.5].map(|times| clock.advance(start, times * tie))
    });
    for at in between.chain(edges) {
        let past = starts.iter().rposition(|(start, _)| *start <= late(clock, at));
        let elapsed = |i: Option<usize>| i.map_or(0.0, |i| clock.between(starts[i].0, at));
        assert_eq!(schedule.piece(clock, at), (past.map_or(0, |i| starts[i].1), elapsed(past)), "{at:?}");
        for number in 0..number_of_pieces {
            let is_past = |(start, piece): &(Instant, u32)| *piece == number && *start <= late(clock, at);
            let last = starts.iter().rposition(is_past);
            assert_eq!(schedule.elapsed(clock, at, number), elapsed(last), "{number} {at:?}");
            // The first piece of listed times has no start.
            let next = last.map_or(0, |i| i + 1);
            assert_eq!(
                schedule.end(clock, late(clock, at), number),
                starts.get(next).map(|(start, _)| *start),
                "{number} {at:?}"
            );
            let off = |start: Instant| clock.between(start, at).abs();
            let nearest = starts.iter().filter(|(_, piece)| *piece == number).map(|(start, _)| off(*start));
            let found = schedule.start_near(clock, at, number).map(off);
            assert_eq!(found, nearest.min_by(f64::total_cmp), "{number} {at:?}");
        }
    }
}

/// The pieces in force while time goes on are those of each instant.
#[test]
fn pieces_in_force_are_those_of_each_instant() {
    let clock = Clock::new(Some(std::f64::consts::TAU));
    let listed = Stiffness::switched(vec![[0.5, 0.0], [1.25, 0.0], [7.0, 1e-17]], [1.0, 2.0]);
    let of =
        [periodic(1.0, -0.4, &[0.1, 0.2, 0.7]), periodic(0.7, 0.3, &[0.0, 0.6]), periodic(2.0, 0.0, &[0.0]), listed];
    let schedules = of.map(|stiffness| Schedule::new(&stiffness, &clock));
    let mut instants: Vec<Instant> =
        (0..400).map(|i| clock.advance(Instant::default(), 0.0371 * f64::from(i))).collect();
    for start in schedules.iter().flat_map(|schedule| all(schedule, &clock, Instant::default())).map(|(start, _)| start)
    {
        let tie = clock.between(start, late(&clock, start));
        instants.extend([-2.0, -0.5, 0.0, 0.5].map(|times| clock.advance(start, times * tie)));
    }
    instants.retain(|at| (0.0..14.0).contains(&clock.between(Instant::default(), *at)));
    instants.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let known: Vec<Option<&Schedule>> = schedules.iter().map(Some).chain([None]).collect();
    let mut pieces = PiecesInForce::default();
    for at in instants {
        pieces.move_to(&clock, known.iter().copied(), at);
        for (j, schedule) in schedules.iter().enumerate() {
            let number = schedule.piece(&clock, at).0;
            assert_eq!(pieces.number(j), number, "{j} {at:?}");
            assert_eq!(pieces.first_end(&[j]), schedule.end(&clock, late(&clock, at), number), "{j} {at:?}");
        }
        assert_eq!(pieces.first_end(&[4]), None);
    }
}

fn periodic(period: f64, origin: f64, starts: &[f64]) -> Stiffness {
    let piece = |start: &f64| Piece { start: *start, value: 1.0 + start, slope: 0.0 };
    Stiffness::Periodic { period, origin, pieces: starts.iter().map(piece).collect() }
}

#[test]
fn pieces_are_those_of_a_list_of_all_starts() {
    let clock = Clock::new(Some(std::f64::consts::TAU));
    // In the clock's period, thrice in it, in two of its periods, in a period of its own.
    for period in [1.0, 1.0 / 3.0, 2.0, 0.7] {
        for origin in [0.0, -0.4, 0.3] {
            agrees(&periodic(period, origin, &[0.0]), &clock, 1);
            agrees(&periodic(period, origin, &[0.0, 0.6]), &clock, 2);
            agrees(&periodic(period, origin, &[0.1, 0.2, 0.7]), &clock, 3);
        }
    }
    let listed = Stiffness::switched(vec![[0.5, 0.0], [1.25, 0.0], [7.0, 1e-17]], [1.0, 2.0]);
    agrees(&listed, &clock, 2);
    agrees_from(&Schedule::new(&listed, &Clock::new(None)), &Clock::new(None), 2, Instant::default());
    let own = Schedule::new(&periodic(0.7, 0.3, &[0.1, 0.2, 0.7]), &Clock::new(None));
    agrees_from(&own, &Clock::new(None), 3, Clock::new(None).instant(1e5));
}
