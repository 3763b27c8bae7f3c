//! Stiffness schedules in time.

use super::{curve, harmonics, node::Node};
use crate::gear::{PathOfContact, Piece, Stiffness, Waveform};

pub(super) fn read(node: &Node) -> Stiffness {
    if node.is_number() {
        return Stiffness::Constant(node.number());
    }
    let number = |key: &str| node.at(key).number();
    let (period, origin) = (node.at_unit("period", "s").number(), node.at_unit("origin", "s").number());
    let from_pairs = |waveform| {
        // The interval with the highest count then starts at phase zero.
        let path = PathOfContact { recess: number("contact_ratio"), ..PathOfContact::default() };
        Stiffness::from_contact_ratio(number("mean"), path, waveform, number("modulation"), period, number("phase"))
    };
    match node.at("kind").text() {
        "harmonic" => harmonic(node),
        "curve" => measured(node).unwrap_or(Stiffness::Constant(1.0)),
        "rectangular" => Stiffness::rectangular(number("high"), number("low"), period, number("duty"), origin),
        "trapezoidal" => trapezoidal(node, period, origin),
        "switched" => {
            let (times, levels) = (node.at_unit("times", "s"), node.at("levels").numbers());
            let values: Vec<[f64; 2]> = times.items().iter().map(Node::wide).map(|time| [time.hi, time.lo]).collect();
            if values.windows(2).any(|pair| pair[0] >= pair[1]) {
                times.refuse("times that rise strictly", "sort the times and write each once");
            }
            Stiffness::switched(values, [levels[0], levels[1]])
        }
        "tooth-pairs" => from_pairs(Waveform::Rectangular),
        "tooth-pairs-trapezoidal" => from_pairs(Waveform::Trapezoidal { ramp: number("ramp") }),
        "fourier" => from_pairs(Waveform::Fourier { harmonics: node.at("orders").whole() as u32 }),
        _ => Stiffness::Constant(number("value")),
    }
}

/// Reads a measured stiffness, as lines or as a series.
fn measured(node: &Node) -> Option<Stiffness> {
    let (period, origin) = (node.at_unit("period", "s").number(), node.at_unit("origin", "s").number());
    let curve = curve::stiffness(node, curve::read(node, &curve::STIFFNESSES)?)?;
    if node.at("as").text() == "lines" {
        return Some(Stiffness::Periodic { period, origin, pieces: curve.pieces(period) });
    }
    let (mean, harmonics) = curve::relative_series(node, &curve);
    Some(Stiffness::Harmonic { mean, harmonics: curve::timed(node, &harmonics) })
}

fn harmonic(node: &Node) -> Stiffness {
    let (mean, harmonics) = (node.at("mean").number(), harmonics::read(&node.at("harmonics"), "amplitude"));
    if harmonics.is_empty() {
        return Stiffness::Constant(mean);
    }
    if harmonics.iter().map(|h| h.amplitude.abs()).sum::<f64>() >= 1.0 {
        node.at("harmonics").warn("the amplitudes sum to 1 or more: the stiffness may become negative");
    }
    Stiffness::Harmonic { mean, harmonics }
}

/// Returns a wave that starts in the middle of the rise, with the origin of the rectangular wave.
fn trapezoidal(node: &Node, period: f64, origin: f64) -> Stiffness {
    let number = |key: &str| node.at(key).number();
    let (high, low, duty, ramp) = (number("high"), number("low"), number("duty"), number("ramp"));
    if ramp >= duty.min(1.0 - duty) {
        node.at("ramp").refuse(
            format!("a width below {}, so that ramps do not overlap", duty.min(1.0 - duty)),
            "write a narrower ramp",
        );
    }
    let (middle, half, slope) = (0.5 * (high + low), 0.5 * ramp, (high - low) / (ramp * period));
    let pieces = vec![
        Piece { start: 0.0, value: middle, slope },
        Piece { start: half, value: high, slope: 0.0 },
        Piece { start: duty - half, value: high, slope: -slope },
        Piece { start: duty + half, value: low, slope: 0.0 },
        Piece { start: 1.0 - half, value: low, slope },
    ];
    Stiffness::Periodic { period, origin, pieces }
}
