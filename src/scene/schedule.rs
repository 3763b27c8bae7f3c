//! Stiffness schedules in time.

use super::{
    harmonics,
    node::Node,
    shape::{Object, Shape, Units, at_least, between, list_of, number, positive, within},
};
use crate::gear::{PathOfContact, Piece, Stiffness, Waveform};

/// A stiffness: a number, or a schedule by name.
pub(super) fn shape(units: Units) -> Shape {
    let period = || units.key("period", "s");
    let constant = Object::new("The same at all times.").needed("value", positive(), "Stiffness.");
    let harmonic = Object::new("mean (1 + sum of amplitude cos(frequency t + phase)).")
        .needed("mean", positive(), "Mean stiffness.")
        .needed("harmonics", harmonics::shape(units, "amplitude"), "Harmonics, relative to the mean.");
    let rectangular = Object::new("high while frac((t - origin)/period) < duty, else low.")
        .needed("high", at_least(0.0), "Stiffness at the start of the period.")
        .needed("low", at_least(0.0), "Stiffness in the rest of the period.")
        .needed("duty", between(0.0, 1.0), "Fraction of the period at high.")
        .needed(period(), positive(), "Period.")
        .with_default(units.key("origin", "s"), 0.0, number(), "Time at which a period starts.");
    let trapezoidal = Object::new("As rectangular, each change a straight ramp centred on it.")
        .needed("high", at_least(0.0), "Stiffness at the start of the period.")
        .needed("low", at_least(0.0), "Stiffness in the rest of the period.")
        .needed("duty", between(0.0, 1.0), "Fraction of the period from ramp centre to ramp centre.")
        .needed("ramp", between(0.0, 1.0), "Width of a ramp, fraction of the period.")
        .needed(period(), positive(), "Period.")
        .with_default(units.key("origin", "s"), 0.0, number(), "Time of the centre of a rising ramp.");
    let time = Shape::Either(vec![number(), Shape::Decimal]);
    let switched = Object::new("Two levels that alternate at listed times.")
        .needed("levels", list_of(2, 2, at_least(0.0)), "The two stiffnesses, the first one at the start.")
        .needed(
            units.key("times", "s"),
            list_of(1, 1_000_000, time),
            "Switching times, rising; in quotation marks with any number of digits.",
        );
    Shape::Either(vec![
        positive(),
        Shape::Variant {
            tag: "kind",
            cases: [
                ("constant", constant),
                ("harmonic", harmonic),
                ("rectangular", rectangular),
                ("trapezoidal", trapezoidal),
                ("switched", switched),
            ]
            .into_iter()
            .chain(tooth_pairs(|about| pairs(units, about)))
            .collect(),
        },
    ])
}

/// The schedules that follow the number of tooth pairs; `pairs` has what they share.
pub(super) fn tooth_pairs(pairs: impl Fn(&'static str) -> Object) -> [(&'static str, Object); 3] {
    let ramps = pairs("Number of tooth pairs in contact, each entry and exit a ramp.");
    let fourier = pairs("Fourier series of the number of tooth pairs in contact, cut off.");
    [
        ("tooth-pairs", pairs("Number of tooth pairs in contact, rectangular.")),
        (
            "tooth-pairs-trapezoidal",
            ramps.needed("ramp", between(0.0, 0.5), "Half width of a ramp, fraction of the period."),
        ),
        ("fourier", fourier.needed("orders", Shape::Whole { min: 1, max: 1000 }, "Harmonics kept.")),
    ]
}

fn pairs(units: Units, about: &'static str) -> Object {
    Object::new(about)
        .needed("mean", positive(), "Mean stiffness.")
        .needed("contact_ratio", within(1.0, 8.0), "Contact ratio, the mean number of pairs.")
        .with_default("modulation", 1.0, within(0.0, 1.0), "Share that follows the number of pairs: 0 constant, 1 all.")
        .needed(units.key("period", "s"), positive(), "Mesh period.")
        .with_default("phase", 0.0, number(), "Mesh phase, periods: a pair enters when t/period + phase is whole.")
}

/// The schedule written here.
pub(super) fn read(node: &Node) -> Stiffness {
    if node.is_number() {
        return Stiffness::Constant(node.number());
    }
    let number = |key: &str| node.at(key).number();
    let (period, origin) = (node.at_unit("period", "s").number(), node.at_unit("origin", "s").number());
    let from_pairs = |waveform| {
        // The highest count then starts at phase zero.
        let path = PathOfContact { approach: 0.0, recess: number("contact_ratio") };
        Stiffness::from_contact_ratio(number("mean"), path, waveform, number("modulation"), period, number("phase"))
    };
    match node.at("kind").text() {
        "harmonic" => harmonic(node),
        "rectangular" => Stiffness::rectangular(number("high"), number("low"), period, number("duty"), origin),
        "trapezoidal" => trapezoidal(node, period, origin),
        "switched" => {
            let (times, levels) = (node.at_unit("times", "s"), node.at("levels").numbers());
            let values: Vec<[f64; 2]> = times.items().iter().map(Node::wide).map(|time| [time.hi, time.lo]).collect();
            if values.windows(2).any(|pair| pair[0] >= pair[1]) {
                times.refuse("times that rise strictly", "sort the times and write each once");
            }
            Stiffness::Switched { times: values, levels: [levels[0], levels[1]] }
        }
        "tooth-pairs" => from_pairs(Waveform::Rectangular),
        "tooth-pairs-trapezoidal" => from_pairs(Waveform::Trapezoidal { ramp: number("ramp") }),
        "fourier" => from_pairs(Waveform::Fourier { harmonics: node.at("orders").whole() as u32 }),
        _ => Stiffness::Constant(number("value")),
    }
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

/// Starts in the middle of the rise, so that the origin is the same as that of the rectangular wave.
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
