//! Figures 9 to 11: light load, Hertz contacts with hysteresis.

use super::{Comparison, Verdict, cover, holds, linearity, list, numbers, statement};
use crate::study::{
    figures::{Curve, Cycle, ThresholdRow, Way},
    threshold::Threshold,
};

const FITTED: &str = "part of the fit that gave the preset";
const RING: &str = "ring-planet";

fn cold(curves: &[Curve]) -> Option<&Curve> {
    curves.iter().find(|curve| curve.way == Way::Cold)
}

/// Figure 9: without load, and at the threshold.
#[must_use]
pub fn cycles(found: &[Cycle]) -> Vec<Comparison> {
    let row = |place, cycle: &Cycle, peaks: usize, harmonic: usize, note: &str| {
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
            )
            .noting(note),
            statement(
                place,
                &format!("ring-planet force at {load} N m: strongest harmonic"),
                &harmonic.to_string(),
                format!("{first} ({} N)", list(cycle.harmonics.iter().take(3).copied(), 1)),
                holds(first == harmonic),
            )
            .noting(note),
        ]
    };
    let mut rows = Vec::new();
    if let Some(free) = found.first() {
        rows.extend(row("9a", free, 2, 2, FITTED));
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
        rows.extend(row("9b", loaded, 1, 1, ""));
    }
    rows
}

/// Figure 10; `threshold` at 500 rev/min.
#[must_use]
pub fn apart_by_load(curves: &[Curve], threshold: &Threshold) -> Vec<Comparison> {
    let Some(cold) = cold(curves).filter(|cold| cover(&cold.values, 0.0, 40.0)) else { return Vec::new() };
    let apart = cold.measure(RING, |c| c.report.apart_fraction);
    let amplitude = cold.measure(RING, |c| c.force_amplitude);
    let at = |values: &[f64], load: f64| super::at(&cold.values, values, load);
    let mut rows = vec![numbers("10", "time apart at 500 rev/min, no load", (0.24, at(&apart, 0.0)), "T", FITTED)];
    if let Threshold::Located { below, above, clearance_below, clearance_above } = threshold {
        let note = format!(
            "{FITTED}; between {below:.3} and {above:.3} N m the smallest deflection jumps from {:.2} to {:+.2} µm: the \
             motion that separates ends, it does not shrink to nothing",
            1e6 * clearance_below,
            1e6 * clearance_above
        );
        rows.push(numbers("10", "load at which separations end", (21.0, 0.5 * (below + above)), "N m", &note));
    }
    let (slow, fast) = (at(&apart, 0.0) - at(&apart, 10.0), at(&apart, 10.0) - at(&apart, 20.0));
    rows.push(statement(
        "10",
        "time apart against load",
        "falls slowly, then rapidly",
        format!("by {slow:.3} T up to 10 N m, by {fast:.3} T from there to 20"),
        holds(fast > slow && slow > 0.0),
    ));
    let (low, middle, high) = (at(&amplitude, 0.0), at(&amplitude, 20.0), at(&amplitude, 40.0));
    rows.push(
        statement(
            "10",
            "force amplitude against load",
            "grows quadratically, then linearly and less",
            format!("{low:.1}, {middle:.1}, {high:.1} N at 0, 20, 40 N m"),
            Verdict::Deviates,
        )
        .noting("nearly flat up to the threshold"),
    );
    let differ = branch_gap(curves, "N m");
    rows.push(
        statement("10", "one motion for each load", "implied", differ.0, if differ.1 { Verdict::Deviates } else { Verdict::Agrees })
            .noting("the law keeps the speed of the last impact for as long as a mesh stays in contact, so that motions depend on their history"),
    );
    rows
}

/// How far the three ways lie apart in the amplitude.
fn branch_gap(curves: &[Curve], unit: &str) -> (String, bool) {
    let amplitudes: Vec<Vec<f64>> = curves.iter().map(|curve| curve.measure(RING, |c| c.force_amplitude)).collect();
    let (mut most, mut place) = (0.0, 0.0);
    for (i, x) in curves[0].values.iter().enumerate() {
        let of = |pick: fn(f64, f64) -> f64, start: f64| {
            amplitudes.iter().filter_map(|a| a.get(i)).fold(start, |m, v| pick(m, *v))
        };
        let (low, high) = (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY));
        if high - low > most * high {
            (most, place) = ((high - low) / high, *x);
        }
    }
    (format!("amplitudes differ by up to {:.1} % (at {place} {unit})", 100.0 * most), most > 0.01)
}

/// Figure 11, from speeds that contain 50, 500 and 2000 rev/min.
#[must_use]
pub fn apart_by_speed(curves: &[Curve]) -> Vec<Comparison> {
    let Some(cold) = cold(curves).filter(|cold| cover(&cold.values, 50.0, 2000.0)) else { return Vec::new() };
    let apart = cold.measure(RING, |c| c.report.no_force_fraction);
    let amplitude = cold.measure(RING, |c| c.force_amplitude);
    let at = |rpm: f64| super::at(&cold.values, &apart, rpm);
    let rising = apart.windows(2).filter(|pair| pair[1] > pair[0]).count();
    let r2 = linearity(&cold.values, &amplitude);
    vec![
        numbers("11", "time apart at 50 rev/min, no load", (0.34, at(50.0)), "T", FITTED),
        numbers("11", "time apart at 2000 rev/min, no load", (0.11, at(2000.0)), "T", FITTED),
        statement(
            "11",
            "time apart against speed",
            "falls steadily",
            format!(
                "{:.3} to {:.3} T, but rises over {rising} of {} steps",
                at(50.0),
                at(2000.0),
                apart.len().saturating_sub(1)
            ),
            if rising == 0 { Verdict::Agrees } else { Verdict::Partly },
        )
        .noting("resonances in between"),
        statement(
            "11",
            "force amplitude against speed",
            "linear",
            format!("r2 = {r2:.2}"),
            if r2 > 0.9 { Verdict::Agrees } else { Verdict::Partly },
        ),
        statement(
            "11",
            "one motion for each speed",
            "implied",
            branch_gap(curves, "rev/min").0,
            if branch_gap(curves, "rev/min").1 { Verdict::Deviates } else { Verdict::Agrees },
        ),
    ]
}

/// Figure 11: threshold against speed.
#[must_use]
pub fn threshold(rows: &[ThresholdRow]) -> Vec<Comparison> {
    let speeds: Vec<f64> = rows.iter().map(|row| row.rpm).collect();
    let loads: Vec<f64> = rows.iter().map(ThresholdRow::load).collect();
    let total: Vec<f64> = rows.iter().map(|row| row.load() + row.drag).collect();
    let (own, with_drag) = (linearity(&speeds, &loads), linearity(&speeds, &total));
    let verdict = if own > 0.9 {
        Verdict::Agrees
    } else if with_drag > 0.7 {
        Verdict::Partly
    } else {
        Verdict::Deviates
    };
    let found = format!("r2 = {own:.2}; with the drag torque added r2 = {with_drag:.2}");
    vec![statement("11", "threshold load against speed", "linear", found, verdict)]
}
