//! Figures 12 and 13: floating sun and ring without load.

use super::{Comparison, Verdict, holds, statement};
use crate::study::figures::{History, Trajectory};

/// Figure 12. The preset was picked among some thirty dampings and drags because its regimes and ranges come in the paper's
/// order: those rows are no test of it.
#[must_use]
pub fn trajectories(found: &[Trajectory]) -> Vec<Comparison> {
    let of = |body: &str| -> Vec<&Trajectory> { found.iter().filter(|t| t.body == body).collect() };
    let (sun, ring) = (of("sun"), of("ring"));
    let mut rows = Vec::new();
    let words = |t: &Trajectory| {
        let kind = t.period.map_or("no period".to_owned(), |p| format!("period {p}"));
        format!(
            "{kind}; changes by {:.2} from period to period, {:.0} % off the harmonics",
            t.residual,
            100.0 * t.off_harmonics
        )
    };
    for t in &sun {
        let quantity = format!("sun at {} rev/min", t.rpm);
        // Regular: repeats. Disordered: most of the motion is off the harmonics. Between: nearly repeats.
        let (published, verdict) = match t.rpm {
            100.0 => ("regular", holds(t.period == Some(1))),
            300.0 => ("quasi-periodic", holds(t.period.is_none() && t.off_harmonics < 0.2)),
            1000.0 => ("does not close, beats", holds(t.period.is_none() && t.off_harmonics > 0.2)),
            2000.0 => ("disordered", holds(t.period.is_none() && t.off_harmonics > 0.5)),
            _ => continue,
        };
        rows.push(statement("12", &quantity, published, words(t), verdict).fitted());
    }
    if let Some(slow) = sun.iter().find(|t| t.rpm == 100.0) {
        let verdict = if slow.leaves == Some(96) { Verdict::Agrees } else { Verdict::Deviates };
        rows.push(
            statement(
                "12",
                "leaves of the sun's path at 100 rev/min",
                "96 (teeth of the ring)",
                slow.leaves.map_or("none".to_owned(), |n| n.to_string()),
                verdict,
            )
            .noting("three sun meshes one after the other make three a mesh period; 96 mesh periods make a turn"),
        );
    }
    let largest = sun.iter().fold((0.0, 0.0), |m, t| if t.range > m.1 { (t.rpm, t.range) } else { m });
    let words = format!("{:.1} µm at {} rev/min", 1e6 * largest.1, largest.0);
    let verdict = holds(largest.0 == 1000.0);
    rows.push(statement("12", "largest range of the sun", "at 1000 rev/min", words, verdict).fitted());
    let ranges: Vec<String> = ring.iter().map(|t| format!("{:.3}", 1e6 * t.range)).collect();
    let grows = ring.windows(2).all(|pair| pair[1].range > pair[0].range);
    let words = format!("{} µm", ranges.join(", "));
    rows.push(statement("12", "range of the ring", "grows with speed", words, holds(grows)).fitted());
    rows
}

/// Figure 13.
#[must_use]
pub fn history(found: &History) -> Vec<Comparison> {
    let stands_out = found.half > 5.0 * found.floor;
    vec![
        statement(
            "13b",
            "line at f_m/2, 2000 rev/min",
            "yes (418 Hz)",
            format!("{:.2} µm where its neighbours have {:.2} µm", 1e6 * found.half, 1e6 * found.floor),
            holds(stands_out),
        ),
        statement(
            "13a",
            "motion of the sun at 2000 rev/min",
            "disordered around f_m",
            found.period.map_or("no period".to_owned(), |p| format!("period {p}")),
            holds(found.period.is_none()),
        ),
    ]
}
