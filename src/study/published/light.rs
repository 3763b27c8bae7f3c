//! Figures 9 to 11: light load, Hertz contacts with hysteresis.

use super::{Comparison, Verdict, has, holds, linearity, list, numbers, statement};
use crate::study::{
    figures::{Curve, Cycle, ThresholdRow, Way},
    steady::ContactSteady,
    threshold::Threshold,
};

const RING: &str = "ring-planet";

fn cold(curves: &[Curve]) -> Option<&Curve> {
    curves.iter().find(|curve| curve.way == Way::Cold)
}

/// Figure 9: without load, and at the threshold.
#[must_use]
pub fn cycles(found: &[Cycle]) -> Vec<Comparison> {
    let row = |place, cycle: &Cycle, peaks: usize, harmonic: usize| {
        let first =
            1 + cycle.harmonics.iter().enumerate().fold(0, |m, (i, h)| if *h > cycle.harmonics[m] { i } else { m });
        let load = cycle.load;
        vec![
            statement(
                place,
                &format!("ring-planet force at {load} N m: peaks a period"),
                &peaks.to_string(),
                cycle.peaks.to_string(),
                holds(cycle.peaks == peaks),
            ),
            statement(
                place,
                &format!("ring-planet force at {load} N m: strongest harmonic"),
                &harmonic.to_string(),
                format!("{first} ({} N)", list(cycle.harmonics.iter().take(3).copied(), 1)),
                holds(first == harmonic),
            ),
        ]
    };
    let mut rows = Vec::new();
    if let Some(free) = found.first() {
        rows.extend(row("9a", free, 2, 2).into_iter().map(Comparison::fitted));
        let words = format!("both apart {:.3} T, ring alone {:.3} T", free.together, free.apart - free.together);
        rows.push(
            statement(
                "9a",
                "both meshes of a planet apart at once (its speed is constant then)",
                "yes",
                words,
                holds(free.together > 0.5 * free.apart),
            )
            .noting("above 200 rev/min the planet stays on the sun"),
        );
    }
    if let Some(loaded) = found.get(1) {
        rows.extend(row("9b", loaded, 1, 1));
        let words = format!("smallest force {:.2} N", loaded.smallest);
        rows.push(statement(
            "9b",
            "ring-planet force touches zero",
            "once a period",
            words,
            holds(loaded.smallest == 0.0),
        ));
    }
    rows
}

/// Figure 10; `threshold` at 500 rev/min.
#[must_use]
pub fn apart_by_load(curves: &[Curve], threshold: &Threshold) -> Vec<Comparison> {
    let Some(cold) = cold(curves).filter(|cold| has(&cold.values, &[0.0, 10.0, 20.0, 40.0])) else { return Vec::new() };
    let apart = cold.measure(RING, |c| c.report.no_force_fraction);
    let amplitude = cold.measure(RING, |c| c.force_amplitude);
    let at = |values: &[f64], load: f64| super::at(&cold.values, values, load);
    let mut rows = vec![by_branch(curves, "10", "time apart at 500 rev/min, no load", (0.24, 0.0)).fitted()];
    if let Threshold::Located { below, above, clearance_below, clearance_above } = threshold {
        let last = |way: Way| {
            let curve = curves.iter().find(|curve| curve.way == way)?;
            let flight = curve.measure(RING, |c| c.report.apart_fraction);
            flight.iter().rposition(|apart| *apart > 0.0).map(|i| curve.values[i])
        };
        let shown = |way| last(way).map_or("none".to_owned(), |load| format!("{load} N m"));
        let note = format!(
            "cold starts; between {below:.3} and {above:.3} N m the smallest deflection jumps from {:.2} to {:+.2} µm: the \
             motion that separates ends, it does not shrink to nothing; last load with separations on the grid: followed up \
             {}, followed down {}",
            1e6 * clearance_below,
            1e6 * clearance_above,
            shown(Way::Up),
            shown(Way::Down)
        );
        let row = numbers("10", "load at which separations end", (21.0, 0.5 * (below + above)), "N m", &note);
        rows.push(row.fitted());
    }
    let (slow, fast) = (at(&apart, 0.0) - at(&apart, 10.0), at(&apart, 10.0) - at(&apart, 20.0));
    rows.push(statement(
        "10",
        "time apart against load",
        "falls slowly, then rapidly",
        format!("by {slow:.3} T up to 10 N m, by {fast:.3} T from there to 20"),
        holds(fast > slow && slow > 0.0),
    ));
    let [low, middle, high, top] = [0.0, 10.0, 20.0, 40.0].map(|load| at(&amplitude, load));
    // Quadratic: grows, and faster in the second half; then less steeply than at its steepest.
    let quadratic = middle > low && high - middle > middle - low;
    let linear = top > high && 0.5 * (top - high) < high - middle;
    let verdict = match (quadratic, linear) {
        (true, true) => Verdict::Agrees,
        (false, false) => Verdict::Deviates,
        _ => Verdict::Partly,
    };
    let found = format!("{low:.1}, {middle:.1}, {high:.1}, {top:.1} N at 0, 10, 20, 40 N m");
    rows.push(statement(
        "10",
        "force amplitude against load",
        "grows quadratically, then linearly and less",
        found,
        verdict,
    ));
    rows.push(one_motion(curves, "10", "one motion for each load", "N m"));
    rows
}

/// A share of the mesh period at one value, on all branches: the cold start is judged, but no better than "partly" where the
/// branches lie apart.
fn by_branch(curves: &[Curve], place: &'static str, quantity: &str, (published, x): (f64, f64)) -> Comparison {
    let on = |curve: &Curve| super::at(&curve.values, &curve.measure(RING, |c| c.report.no_force_fraction), x);
    let values: Vec<f64> = curves.iter().map(on).collect();
    let cold = curves.iter().position(|curve| curve.way == Way::Cold).map_or(0.0, |i| values[i]);
    let row = numbers(place, quantity, (published, cold), "T", "");
    let spread = values.iter().fold(0.0, |m: f64, v| m.max((v - cold).abs()));
    if spread <= 0.05 * published {
        return row;
    }
    let verdict = if row.verdict == Verdict::Agrees { Verdict::Partly } else { row.verdict };
    let found =
        format!("{cold:.3} T from a cold start; {} T followed up and down", list(values[1..].iter().copied(), 3));
    Comparison { verdict, found, ..row }
}

/// How far the three ways lie apart.
fn one_motion(curves: &[Curve], place: &'static str, quantity: &str, unit: &str) -> Comparison {
    let widest = |pick: &dyn Fn(&ContactSteady) -> f64| {
        let measured: Vec<Vec<f64>> = curves.iter().map(|curve| curve.measure(RING, pick)).collect();
        let mut most = (0.0, 0.0, 0.0);
        for (i, x) in curves[0].values.iter().enumerate() {
            let at: Vec<f64> = measured.iter().filter_map(|values| values.get(i).copied()).collect();
            let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let gap = high - at.iter().copied().fold(f64::INFINITY, f64::min);
            if gap > most.0 {
                most = (gap, high, *x);
            }
        }
        most
    };
    let (force, high, load) = widest(&|c| c.force_amplitude);
    let (apart, _, place_of) = widest(&|c| c.report.no_force_fraction);
    let found = format!(
        "amplitudes differ by up to {:.0} % (at {load} {unit}), times apart by up to {apart:.3} T (at {place_of} {unit})",
        100.0 * force / high.max(f64::MIN_POSITIVE)
    );
    statement(place, quantity, "implied", found, holds(force <= 0.01 * high && apart <= 0.002)).noting(
        "the law keeps the speed of the last impact for as long as a mesh stays in contact, so that motions depend on their \
         history",
    )
}

/// Figure 11.
#[must_use]
pub fn apart_by_speed(curves: &[Curve]) -> Vec<Comparison> {
    let Some(cold) = cold(curves).filter(|cold| has(&cold.values, &[50.0, 500.0, 2000.0])) else { return Vec::new() };
    let apart = cold.measure(RING, |c| c.report.no_force_fraction);
    let amplitude = cold.measure(RING, |c| c.force_amplitude);
    let rising = apart.windows(2).filter(|pair| pair[1] > pair[0]).count();
    let steps = apart.len() - 1;
    let steadily = match rising {
        0 => Verdict::Agrees,
        n if 10 * n <= steps => Verdict::Partly,
        _ => Verdict::Deviates,
    };
    let r2 = linearity(&cold.values, &amplitude);
    vec![
        by_branch(curves, "11", "time apart at 50 rev/min, no load", (0.34, 50.0)).fitted(),
        by_branch(curves, "11", "time apart at 2000 rev/min, no load", (0.11, 2000.0)).fitted(),
        statement(
            "11",
            "time apart against speed",
            "falls steadily",
            format!("from {:.3} to {:.3} T, but rises over {rising} of {steps} steps", apart[0], apart[steps]),
            steadily,
        )
        .noting("resonances in between"),
        statement("11", "force amplitude against speed", "linear", format!("r2 = {r2:.2}"), linear(r2)),
        one_motion(curves, "11", "one motion for each speed", "rev/min"),
    ]
}

/// A straight line, by its coefficient of determination.
fn linear(r2: f64) -> Verdict {
    match r2 {
        r if r > 0.9 => Verdict::Agrees,
        r if r > 0.8 => Verdict::Partly,
        _ => Verdict::Deviates,
    }
}

/// Figure 11: threshold against speed.
#[must_use]
pub fn threshold(rows: &[ThresholdRow]) -> Vec<Comparison> {
    let (speeds, loads): (Vec<f64>, Vec<f64>) = rows.iter().filter_map(|row| Some((row.rpm, row.load()?))).unzip();
    if speeds.len() < 10 {
        return Vec::new();
    }
    let own = linearity(&speeds, &loads);
    let row = statement("11", "threshold load against speed", "linear", format!("r2 = {own:.2}"), linear(own));
    vec![
        row.noting(
            "with the drag torque added, which is linear in speed by definition, the sum looks more like a line",
        ),
    ]
}
