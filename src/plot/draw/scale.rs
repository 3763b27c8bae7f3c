//! Scale of an axis: places of values, and ticks.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use crate::plot::Axis;

/// Largest value that is drawn: the span of two larger ones could overflow.
const HUGE: f64 = 1e300;

/// Range of values along an axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scale {
    pub low: f64,
    pub high: f64,
    pub logarithmic: bool,
    ticks: Vec<f64>,
    /// Distance of ticks; none on a logarithmic axis with ticks at powers of ten.
    step: Option<f64>,
    /// True if whole numbers are places: ticks there, without labels.
    places: bool,
    /// Power of ten that tick labels omit, a multiple of three; the axis label shows it.
    pub exponent: i32,
}

impl Scale {
    /// Returns the given range of the axis, or one with all values that can be drawn and `margin` of its length at each end.
    pub fn fit(axis: &Axis, values: impl Iterator<Item = f64>, margin: f64) -> Self {
        let logarithmic = axis.logarithmic;
        let drawn = |value: &f64| drawable(*value, logarithmic);
        let [low, high] = match axis.range {
            Some([low, high]) if low < high && drawn(&low) && drawn(&high) => [low, high],
            _ => {
                let found = values
                    .filter(drawn)
                    .fold(None, |ends: Option<[f64; 2]>, v| Some(ends.map_or([v, v], |[a, b]| [a.min(v), b.max(v)])));
                match (found, logarithmic) {
                    (Some([low, high]), false) => widened(low, high, margin),
                    (Some([low, high]), true) => decades_around(low, high, margin),
                    (None, false) => [0.0, 1.0],
                    (None, true) => [1.0, 10.0],
                }
            }
        };
        Self { low, high, logarithmic, ticks: Vec::new(), step: None, places: axis.places, exponent: 0 }
    }

    /// Returns the same scale about its middle, `factor` times as long. Linear only.
    pub fn stretched(mut self, factor: f64) -> Self {
        let middle = f64::midpoint(self.low, self.high);
        let half = (self.high - self.low) / 2.0 * factor;
        (self.low, self.high) = (middle - half, middle + half);
        self
    }

    /// Returns the same scale with about `count` ticks.
    pub fn ticked(mut self, count: usize) -> Self {
        let count = count.max(2);
        if self.logarithmic {
            self.ticks = decades(self.low, self.high, count);
            if self.ticks.len() >= 2 {
                return self;
            }
        }
        let step = if self.places { 1.0 } else { round_step((self.high - self.low) / count as f64) };
        let (first, last) = ((self.low / step - 1e-9).ceil(), (self.high / step + 1e-9).floor());
        // A step of 1, 2 or 5 of a power of ten makes at most a few ticks more than requested.
        self.ticks = (0..=(last - first).clamp(0.0, 100.0) as usize).map(|i| (first + i as f64) * step).collect();
        let largest = self.low.abs().max(self.high.abs());
        if !self.places && !(1e-3..1e5).contains(&largest) {
            self.exponent = (libm::log10(largest) / 3.0).floor() as i32 * 3;
        }
        self.step = Some(step);
        self
    }

    /// Returns ticks and their labels.
    pub fn labels(&self) -> Vec<(f64, String)> {
        self.ticks.iter().map(|tick| (*tick, self.label(*tick))).collect()
    }

    fn label(&self, value: f64) -> String {
        if self.places {
            return String::new();
        }
        let Some(step) = self.step else { return power_of_ten(value) };
        let decimals = (f64::from(self.exponent) - libm::log10(step).floor()).clamp(0.0, 15.0) as usize;
        let text = format!("{:.decimals$}", value / 10f64.powi(self.exponent));
        // Rounded to zero from below.
        if text.trim_start_matches(['-', '0', '.']).is_empty() { text.replace('-', "") } else { minus(&text) }
    }

    /// Returns the place of a value: 0 at the low end, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            libm::log10(value / self.low) / libm::log10(self.high / self.low)
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (start, end): (i32, i32)) -> i32 {
        start + (self.place(*value) * f64::from(end - start)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // Light lines, between the ticks, are not drawn.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, value: &f64) -> String {
        self.label(*value)
    }
}

/// Returns whether a value has a place on an axis.
pub(super) fn drawable(value: f64, logarithmic: bool) -> bool {
    value.abs() <= HUGE && !(logarithmic && value < f64::MIN_POSITIVE)
}

/// Returns the label of an axis with its unit, and the power of ten that the tick labels omit.
pub(super) fn axis_label(axis: &Axis, exponent: i32) -> String {
    let power = if exponent == 0 { String::new() } else { format!("10{}", superscript(exponent)) };
    let unit = [power.as_str(), axis.unit.as_str()].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>();
    if unit.is_empty() { axis.label.clone() } else { format!("{} [{}]", axis.label, unit.join(" ")).trim().to_owned() }
}

/// Returns the ends moved outwards by `margin` of the length, except from zero; a point becomes an interval.
fn widened(low: f64, high: f64, margin: f64) -> [f64; 2] {
    let largest = low.abs().max(high.abs());
    if high - low <= 1e-12 * largest {
        let half = 0.1 * largest;
        return if largest > 1e-290 { [low - half, high + half] } else { [0.0, 1.0] };
    }
    let extra = margin * (high - low);
    [if low == 0.0 { low } else { low - extra }, if high == 0.0 { high } else { high + extra }]
}

/// Returns the same for a logarithmic axis; a point becomes a decade.
fn decades_around(low: f64, high: f64, margin: f64) -> [f64; 2] {
    let [from, to] = [low, high].map(libm::log10);
    let extra = if to - from < 1e-9 { 0.5 } else { margin * (to - from) };
    // Within the finite numbers.
    [from - extra, to + extra].map(|exponent| libm::pow(10f64, exponent.clamp(-307.6, 308.0)))
}

/// Returns the nearest of 1, 2, 5 times a power of ten.
fn round_step(step: f64) -> f64 {
    let power = libm::pow(10f64, libm::log10(step).floor());
    let digits = [1.0, 2.0, 5.0].into_iter().find(|d| step < 1.5 * d * power).unwrap_or(10.0);
    digits * power
}

/// Returns the powers of ten in a range, every n-th if there are too many, with 2 and 5 times them if there are few.
fn decades(low: f64, high: f64, count: usize) -> Vec<f64> {
    let (first, last) = (libm::log10(low).floor() as i32, libm::log10(high).ceil() as i32);
    let decades = (last - first) as usize;
    let digits: &[f64] = if 3 * decades <= count + 2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let every = decades.div_ceil(count).max(1);
    let inside = |v: &f64| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(v);
    (first..=last)
        .filter(|e| e.rem_euclid(every as i32) == 0)
        .flat_map(|e| digits.iter().map(move |d| d * 10f64.powi(e)))
        .filter(inside)
        .collect()
}

fn power_of_ten(value: f64) -> String {
    let exponent = (libm::log10(value) + 1e-9).floor();
    let digit = (value / libm::pow(10f64, exponent)).round();
    if (-3.0..=4.0).contains(&exponent) {
        return format!("{:.*}", (-exponent).max(0.0) as usize, value);
    }
    let power = format!("10{}", superscript(exponent as i32));
    if digit == 1.0 { power } else { format!("{digit}·{power}") }
}

fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    number.to_string().chars().map(|c| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize])).collect()
}

/// Returns a text with a minus sign in place of a hyphen.
fn minus(text: &str) -> String {
    text.replace('-', "−")
}
