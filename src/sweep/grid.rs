use serde::Serialize;

use super::GridError;
use crate::output::Fault;

/// Maximum number of values of an axis, and points of a grid.
const MOST: usize = 1_000_000;
const MOST_POINTS: usize = 1_000_000_000;
/// Largest number on an axis; weighted with its count it is still a double.
const LARGEST: f64 = 1e300;
/// Smallest step of a range, relative to its larger end; values have 15 digits.
const CLOSEST: f64 = 1e-12;
/// Text form of an axis.
const FORM: &str = "POINTER=FROM:TO:COUNT, POINTER=FROM:TO:COUNT:log or POINTER=V1,V2,…";

/// Spacing of the values of a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Spacing {
    /// Equal differences.
    Linear,
    /// Equal ratios.
    Geometric,
}

/// Values of an axis, as written.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum AxisValues {
    /// Range of `count` values, the first `from`, the last `to`.
    Range {
        from: f64,
        /// Last value, other than `from`.
        to: f64,
        /// Number of values, at least 2.
        count: usize,
        /// Spacing; geometric ranges have ends of one sign.
        spacing: Spacing,
    },
    /// Listed values, at least one, in the order of upward visits.
    List { values: Vec<f64> },
}

/// Number that is varied, with the values it takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Axis {
    /// JSON pointer to the number, such as `/train/speed_rpm`.
    pub pointer: String,
    #[serde(flatten)]
    values: AxisValues,
}

impl Axis {
    /// Reads `POINTER=FROM:TO:COUNT`, the same with `:log` for equal ratios, or `POINTER=V1,V2,…`.
    ///
    /// # Errors
    /// Every fault found.
    pub fn parse(text: &str) -> Result<Self, Vec<Fault>> {
        // Numbers contain no equals sign, keys may.
        let Some((pointer, values)) = text.rsplit_once('=') else {
            return Err(vec![Fault::new(text, "no equals sign", FORM)]);
        };
        let mut faults = Vec::new();
        if !pointer.starts_with('/') {
            let found = format!("{pointer:?} as pointer");
            faults.push(Fault::new(text, found, "a JSON pointer, which starts with /, such as /train/speed_rpm"));
        }
        let values =
            if values.contains(':') { range(text, values, &mut faults) } else { list(text, values, &mut faults) };
        match values {
            Some(values) if faults.is_empty() => Ok(Self { pointer: pointer.to_owned(), values }),
            _ => Err(faults),
        }
    }

    /// Returns the number of values; one at least.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.values {
            AxisValues::Range { count, .. } => *count,
            AxisValues::List { values } => values.len(),
        }
    }

    /// Returns whether its values have equal ratios.
    #[must_use]
    pub fn is_geometric(&self) -> bool {
        matches!(self.values, AxisValues::Range { spacing: Spacing::Geometric, .. })
    }

    /// Returns whether its values were listed.
    #[must_use]
    pub fn is_list(&self) -> bool {
        matches!(self.values, AxisValues::List { .. })
    }

    /// Returns all its values.
    #[must_use]
    pub fn all(&self) -> Vec<f64> {
        (0..self.count()).map(|i| self.value(i)).collect()
    }

    /// Returns value `i` of n, from 0:
    ///
    /// ```text
    /// linear      v_i = (from (n − 1 − i) + to i) / (n − 1)
    /// geometric   v_i = ± 10^((lg |from| (n − 1 − i) + lg |to| i) / (n − 1))
    /// ```
    ///
    /// The ends are exact, the others rounded in the 15th digit (of the larger end; of the value itself, for equal ratios), so that 0.1 is
    /// the double of 0.1 in a scene. A range from the other end has the same values.
    ///
    /// # Panics
    /// If `i` is not below the number of values of a list.
    #[must_use]
    pub fn value(&self, i: usize) -> f64 {
        match &self.values {
            AxisValues::List { values } => values[i],
            AxisValues::Range { from, .. } if i == 0 => *from,
            AxisValues::Range { to, count, .. } if i + 1 == *count => *to,
            AxisValues::Range { from, to, count, spacing } => {
                let last = (count - 1) as f64;
                let mean = |a: f64, b: f64| (a * (last - i as f64) + b * i as f64) / last;
                match spacing {
                    Spacing::Linear => rounded(mean(*from, *to), from.abs().max(to.abs())),
                    Spacing::Geometric => {
                        let value =
                            from.signum() * libm::pow(10f64, mean(libm::log10(from.abs()), libm::log10(to.abs())));
                        rounded(value, value.abs())
                    }
                }
            }
        }
    }
}

/// Returns `value`, rounded in the 15th digit of `scale` > 0, the last that every double holds.
fn rounded(value: f64, scale: f64) -> f64 {
    // The sum makes the zero positive.
    let decimals = 14 - libm::log10(scale).floor() as i64;
    let text = usize::try_from(decimals).ok().map(|decimals| format!("{value:.decimals$}"));
    text.and_then(|text| text.parse().ok()).unwrap_or(value) + 0.0
}

/// Returns a number of an axis; adds a fault if it is none.
fn finite(argument: &str, word: &str, faults: &mut Vec<Fault>) -> Option<f64> {
    let value = word.trim().parse::<f64>().ok().filter(|value| value.abs() <= LARGEST);
    if value.is_none() {
        faults.push(Fault::new(argument, format!("{word:?}"), format!("a number from -{LARGEST:e} to {LARGEST:e}")));
    }
    value
}

fn list(argument: &str, text: &str, faults: &mut Vec<Fault>) -> Option<AxisValues> {
    let values: Vec<Option<f64>> = text.split(',').map(|word| finite(argument, word, faults)).collect();
    Some(AxisValues::List { values: values.into_iter().collect::<Option<_>>()? })
}

fn range(argument: &str, text: &str, faults: &mut Vec<Fault>) -> Option<AxisValues> {
    let words: Vec<&str> = text.split(':').collect();
    let (from, to, count, spacing) = match words[..] {
        [from, to, count] => (from, to, count, Spacing::Linear),
        [from, to, count, "log"] => (from, to, count, Spacing::Geometric),
        _ => {
            faults.push(Fault::new(argument, format!("{text:?}"), FORM));
            return None;
        }
    };
    let (from, to) = (finite(argument, from, faults), finite(argument, to, faults));
    let count: Option<usize> = count.trim().parse().ok().filter(|count| (2..=MOST).contains(count)).or_else(|| {
        let allowed = format!("a whole number of values from 2 to {MOST}");
        faults.push(Fault::new(argument, format!("{count:?} as count"), allowed));
        None
    });
    let (from, to) = (from?, to?);
    if let Some(count) = count.filter(|n| (from - to).abs() < CLOSEST * *n as f64 * from.abs().max(to.abs())) {
        let allowed = format!("values that differ by {CLOSEST:e} of the larger one at least");
        faults.push(Fault::new(argument, format!("{count} values from {from} to {to}"), allowed));
    }
    if spacing == Spacing::Geometric && (from == 0.0 || to == 0.0 || (from < 0.0) != (to < 0.0)) {
        faults.push(Fault::new(
            argument,
            format!("{from} to {to} in equal ratios"),
            "ends of one sign, none of them 0",
        ));
    }
    Some(AxisValues::Range { from, to, count: count?, spacing })
}

/// One or two axes; the last one varies fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    axes: Vec<Axis>,
}

impl Grid {
    /// Reads the axes, each as [`Axis::parse`] does.
    ///
    /// # Errors
    /// [`GridError`] with every fault of every axis, or unless there are one or two of them, of different places, with no more
    /// than 10⁹ points together.
    pub fn parse(texts: &[impl AsRef<str>]) -> Result<Self, GridError> {
        Self::parse_up_to(texts, MOST_POINTS)
    }

    /// Reads the axes, with at most `most` points.
    ///
    /// # Errors
    /// Errors of [`parse`](Self::parse).
    pub fn parse_up_to(texts: &[impl AsRef<str>], most: usize) -> Result<Self, GridError> {
        let (mut axes, mut faults) = (Vec::<Axis>::new(), Vec::new());
        for text in texts {
            match Axis::parse(text.as_ref()) {
                Ok(axis) => axes.push(axis),
                Err(found) => faults.extend(found),
            }
        }
        if !faults.is_empty() {
            return Err(GridError(faults));
        }
        if axes.is_empty() || axes.len() > 2 {
            faults.push(Fault::new("the axes", format!("{} of them", axes.len()), "one or two"));
        }
        for (i, axis) in axes.iter().enumerate() {
            if axes[..i].iter().any(|other| other.pointer == axis.pointer) {
                faults.push(Fault::new(&axis.pointer, "a number varied by two axes", "one axis for each number"));
            }
        }
        let points = axes.iter().fold(1usize, |points, axis| points.saturating_mul(axis.count()));
        if !(1..=most).contains(&points) {
            faults.push(Fault::new("the axes", format!("{points} points"), format!("1 to {most} points")));
        }
        if faults.is_empty() { Ok(Self { axes }) } else { Err(GridError(faults)) }
    }

    /// Returns the axes.
    #[must_use]
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Returns the number of points; one at least.
    #[must_use]
    pub fn points(&self) -> usize {
        self.axes.iter().map(Axis::count).product()
    }

    /// Returns the place of `values` in words: a pointer and a value for each axis.
    #[must_use]
    pub fn place(&self, values: &[f64]) -> String {
        let at = self.axes.iter().zip(values).map(|(axis, value)| format!("{} = {value}", axis.pointer));
        at.collect::<Vec<_>>().join(", ")
    }

    /// Returns the points along the last axis.
    pub(super) fn line(&self) -> usize {
        self.axes.last().map_or(1, Axis::count)
    }

    /// Returns the index on every axis of point `i`, in the order of the axes.
    #[must_use]
    pub fn indices(&self, mut i: usize) -> Vec<usize> {
        let mut indices: Vec<usize> = Vec::with_capacity(self.axes.len());
        for axis in self.axes.iter().rev() {
            indices.push(i % axis.count());
            i /= axis.count();
        }
        indices.reverse();
        indices
    }

    /// Returns the value on every axis of point `i`.
    #[must_use]
    pub fn values(&self, i: usize) -> Vec<f64> {
        self.axes.iter().zip(self.indices(i)).map(|(axis, at)| axis.value(at)).collect()
    }
}
