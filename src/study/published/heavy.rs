//! Figures 5 to 8: 500 N m, linear meshes; and the natural frequencies.

use super::{Comparison, Verdict, at, has, holds, list, numbers, statement, summit};
use crate::{
    study::figures::{Forces, Harmonics, ModeRow, Strongest},
    train::planetary::Family,
};

/// A published number that the paper's own data contradict.
fn contradicting(row: Comparison) -> Comparison {
    Comparison { verdict: Verdict::Contradiction, ..row }
}

/// Figures 5 and 6.
#[must_use]
pub fn forces(found: &[Forces]) -> Vec<Comparison> {
    let [sun, ring] = found else { return Vec::new() };
    let amplitude = |f: &Forces| 0.5 * (f.largest - f.smallest);
    let highest =
        |f: &Forces| 1 + f.harmonics.iter().enumerate().fold(0, |m, (i, h)| if *h > f.harmonics[m] { i } else { m });
    let harmonics = |place, f: &Forces, published: &str, first: usize| {
        let found = format!("{} N; highest: {}", list(f.harmonics[..4].iter().copied(), 1), highest(f));
        statement(place, &format!("{} force: harmonics", f.family), published, found, holds(highest(f) == first))
            .fitted()
    };
    vec![
        contradicting(numbers(
            "5b",
            "mesh frequency at 500 rev/min",
            (212.0, sun.mesh_frequency),
            "Hz",
            "n/60 Z_s Z_r/(Z_s + Z_r); 212 Hz belong to 506.6 rev/min",
        )),
        numbers(
            "5a",
            "sun-planet force: mean",
            (774.0, sun.mean),
            "N",
            "T_out = 500 N m shared with the springs of sun and carrier; without them 968 N",
        )
        .fitted(),
        contradicting(numbers(
            "6a",
            "ring-planet force: mean",
            (750.0, ring.mean),
            "N",
            "in periodic motion the two means differ by the drag on a planet alone: 24 N would be needed",
        )),
        numbers("5a", "sun-planet force: amplitude", (168.0, amplitude(sun)), "N", "").fitted(),
        numbers("6a", "ring-planet force: amplitude", (118.0, amplitude(ring)), "N", "").fitted(),
        harmonics("5b", sun, "1 to 4, third highest", 3),
        harmonics("6b", ring, "1 to 3, first highest", 1),
        numbers(
            "7",
            "f_m at 2500 rev/min meets the carrier mode",
            (1046.0, 5.0 * sun.mesh_frequency),
            "Hz",
            "kinematics",
        ),
        statement(
            "5, 6",
            "contact",
            "never lost",
            format!("smallest force {:.0} N (sun), {:.0} N (ring)", sun.smallest, ring.smallest),
            holds(sun.smallest > 0.0 && ring.smallest > 0.0),
        ),
    ]
}

/// Figure 7.
#[must_use]
pub fn waterfall(found: &[Strongest]) -> Vec<Comparison> {
    let Some(sun) = found.first() else { return Vec::new() };
    let there = (sun.order - 1.0).abs() < 0.1 && (sun.rpm - 3000.0).abs() <= 150.0;
    let words = format!("{:.0} N at {:.0} f_m, {:.0} rev/min", sun.amplitude, sun.order, sun.rpm);
    let row = statement("7", "strongest line of the sun-planet force", "at f_m, 3000 rev/min", words, holds(there));
    vec![row.noting(
        "third error harmonic near a tooth mode; the law pulls there, see the range of the force against speed",
    )]
}

/// Figure 8.
#[must_use]
pub fn harmonics(speeds: &[f64], found: &[Harmonics]) -> Vec<Comparison> {
    let [sun, ring] = found else { return Vec::new() };
    if !has(speeds, &[500.0, 1050.0, 1600.0, 2000.0]) {
        return Vec::new();
    }
    let (f_sun, f_ring) = (|rpm| at(speeds, &sun.first, rpm), |rpm| at(speeds, &ring.first, rpm));
    let pair = |rpm: f64| format!("{:.0} and {:.0} N at {rpm} rev/min", f_sun(rpm), f_ring(rpm));
    let above = |rpm: f64| speeds.iter().zip(sun.first.iter().zip(&ring.first)).filter(move |(n, _)| **n <= rpm);
    let sun_leads = above(1050.0).filter(|(_, (s, r))| s > r).count();
    let smallest = sun.smallest.iter().zip(&ring.smallest).map(|(s, r)| s.min(*r));
    let invalid = speeds.iter().zip(smallest).find(|(_, force)| *force < 0.0).map(|(rpm, _)| *rpm);
    let (peak_sun, peak_ring) = (summit(speeds, &sun.first).0, summit(speeds, &ring.first).0);
    vec![
        statement(
            "8",
            "first harmonics at 1050 rev/min",
            "equal",
            pair(1050.0),
            holds((f_sun(1050.0) / f_ring(1050.0) - 1.0).abs() < 0.15),
        ),
        statement(
            "8",
            "500 to 1050 rev/min: ring-planet force",
            "grows",
            format!("{:.0} to {:.0} N", f_ring(500.0), f_ring(1050.0)),
            holds(f_ring(1050.0) > f_ring(500.0)),
        ),
        statement(
            "8",
            "500 to 1050 rev/min: larger force",
            "sun-planet",
            format!("sun-planet at {sun_leads} of {} speeds", above(1050.0).count()),
            holds(2 * sun_leads > above(1050.0).count()),
        ),
        statement(
            "8",
            "1050 to 2000 rev/min: sun-planet force",
            "grows strongly",
            format!("{:.0} to {:.0} N", f_sun(1050.0), f_sun(2000.0)),
            holds(f_sun(2000.0) > 2.0 * f_sun(1050.0)),
        ),
        statement(
            "8",
            "1050 to 2000 rev/min: ring-planet force",
            "falls",
            format!(
                "{:.0}, {:.0}, {:.0} N at 1050, 1600, 2000 rev/min",
                f_ring(1050.0),
                f_ring(1600.0),
                f_ring(2000.0)
            ),
            match (f_ring(1600.0) < f_ring(1050.0), f_ring(2000.0) < f_ring(1600.0)) {
                (true, true) => Verdict::Agrees,
                (true, false) => Verdict::Partly,
                _ => Verdict::Deviates,
            },
        ),
        statement(
            "8",
            "strongest first harmonics",
            "2000 to 3000 rev/min",
            format!("{peak_sun:.0} rev/min (sun), {peak_ring:.0} rev/min (ring)"),
            holds(peak_sun >= 2000.0 && peak_ring >= 2000.0),
        ),
        statement(
            "8",
            "bilateral law (teeth in contact)",
            "500 to 3000 rev/min",
            invalid.map_or("valid throughout".to_owned(), |rpm| format!("pulls from {rpm:.0} rev/min on")),
            holds(invalid.is_none()),
        )
        .noting("with the transmission errors that fit 500 rev/min kept at all speeds"),
    ]
}

/// The natural frequencies named in the paper. Several readings of "412 Hz, sun rotational, two repeated" are possible; the
/// structured one is a pair of translational modes.
#[must_use]
pub fn modes(found: &[ModeRow]) -> Vec<Comparison> {
    let named = [
        (412.0, Family::Translational, 1, "sun, two repeated", "only a sun on a very soft support comes this low"),
        (919.0, Family::Rotational, 2, "planets", ""),
        (
            889.0,
            Family::Translational,
            2,
            "planets radial, three repeated",
            "a symmetric set of three has pairs and single modes: this pair and the single 869 Hz",
        ),
        (1046.0, Family::Rotational, 3, "carrier rotation", ""),
        (1791.0, Family::Translational, 3, "ring transverse", ""),
    ];
    let rows = named.iter().filter_map(|(hertz, family, number, words, note)| {
        let mode = found.iter().find(|mode| mode.family == *family && mode.number == *number)?;
        let (part, share) = mode.shares.first()?;
        let quantity = format!("natural frequency {} ({words})", mode.name());
        let note = format!("{part} {:.0} %{}{note}", 100.0 * share, if note.is_empty() { "" } else { "; " });
        // The stiffnesses were identified from these.
        Some(numbers("text", &quantity, (*hertz, mode.hertz), "Hz", &note).fitted())
    });
    rows.collect()
}
