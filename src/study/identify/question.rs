//! Parameters and targets of an identification, with their text forms.

use std::{fmt, str::FromStr};

use super::IdentifyError;
use crate::{scene::Fault, train::planetary::Family};

/// Number of a scene to be found, or several with one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// JSON pointers to its places, at least one; the first gives its start.
    pub pointers: Vec<String>,
    /// Lower bound. If positive, the number has a logarithmic scale.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}:{}", self.name(), short(self.low), short(self.high))
    }
}

impl Parameter {
    /// Returns its pointers, joined by commas.
    #[must_use]
    pub fn name(&self) -> String {
        self.pointers.join(",")
    }

    /// Returns whether the number has a logarithmic scale.
    #[must_use]
    pub fn is_logarithmic(&self) -> bool {
        self.low > 0.0
    }
}

impl FromStr for Parameter {
    type Err = IdentifyError;

    /// Reads `POINTER=LOW:HIGH` or, for numbers with one value, `POINTER,POINTER=LOW:HIGH`.
    fn from_str(text: &str) -> Result<Self, IdentifyError> {
        let fault =
            |found: &str, remedy: &str| IdentifyError::from(Fault::new(text, found, "POINTER=LOW:HIGH").remedy(remedy));
        let example = "write for example /train/sun_mesh/stiffness=1e8:1e9";
        let (pointers, bounds) = text.rsplit_once('=').ok_or_else(|| fault("no =", example))?;
        let (low, high) = bounds.split_once(':').ok_or_else(|| fault("bounds without a colon", example))?;
        let number = |word: &str| finite(word, "a bound", fault);
        let (low, high) = (number(low)?, number(high)?);
        if low >= high {
            return Err(fault("a lower bound that is not below the upper one", "write the lower bound first"));
        }
        let pointers: Vec<String> = pointers.split(',').map(|pointer| pointer.trim().to_owned()).collect();
        if let Some(wrong) = pointers.iter().find(|pointer| !pointer.starts_with('/')) {
            return Err(fault(&format!("\"{wrong}\" as a pointer"), "start a pointer with /, as in /train/speed_rpm"));
        }
        Ok(Self { pointers, low, high })
    }
}

/// Quantity of a train that a measurement gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A natural frequency of a family, Hz: its different frequencies counted from 1, a free motion (0 Hz) included.
    Family(Family, usize),
    /// A natural frequency of any train, Hz: counted from 1, repeated ones as often as they occur.
    Mode(usize),
    /// Natural frequency nearest to the wanted value, Hz.
    Nearest,
    /// Static force of a contact, by name, N.
    Force(String),
}

impl Quantity {
    /// Returns its unit.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        if matches!(self, Self::Force(_)) { "N" } else { "Hz" }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Family(family, number) => write!(f, "{family}:{number}"),
            Self::Mode(number) => write!(f, "mode:{number}"),
            Self::Nearest => write!(f, "frequency"),
            Self::Force(contact) => write!(f, "force:{contact}"),
        }
    }
}

/// Wanted value of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The quantity.
    pub quantity: Quantity,
    /// Its wanted value, in its unit.
    pub wanted: f64,
    /// Standard deviation of the wanted value, in the same unit, > 0.
    pub sigma: f64,
}

/// Default standard deviation of a target, relative to its value.
const SIGMA: f64 = 0.01;

impl Target {
    /// Returns a target with a standard deviation of 1 % of its value.
    #[must_use]
    pub fn new(quantity: Quantity, wanted: f64) -> Self {
        Self { quantity, wanted, sigma: SIGMA * wanted.abs() }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}:{}", self.quantity, short(self.wanted), short(self.sigma))
    }
}

impl FromStr for Target {
    type Err = IdentifyError;

    /// Reads `QUANTITY=VALUE`, `QUANTITY=VALUE:SIGMA` or `QUANTITY=VALUE±SIGMA` (`+-` for `±`), the quantity one of
    /// `rotational:N`, `translational:N`, `planet:N`, `mode:N`, `frequency`, `force:CONTACT`.
    fn from_str(text: &str) -> Result<Self, IdentifyError> {
        let allowed = "QUANTITY=VALUE or QUANTITY=VALUE:SIGMA";
        let fault = |found: &str, remedy: &str| IdentifyError::from(Fault::new(text, found, allowed).remedy(remedy));
        let example = "write for example rotational:2=919 or \"force:sun-planet 1=774\"";
        let (quantity, value) = text.rsplit_once('=').ok_or_else(|| fault("no =", example))?;
        let (value, sigma) = ["±", "+-", ":"]
            .iter()
            .find_map(|mark| value.split_once(mark))
            .map_or((value, None), |(value, sigma)| (value, Some(sigma)));
        let number = |word: &str| finite(word, "a number", fault);
        let quantity = read_quantity(quantity.trim()).map_err(|found| fault(&found, example))?;
        let target = Self::new(quantity, number(value)?);
        let sigma = sigma.map_or(Ok(target.sigma), number)?;
        if sigma <= 0.0 {
            return Err(fault("no standard deviation > 0", "write one behind the value, as in mode:1=0:0.1"));
        }
        Ok(Self { sigma, ..target })
    }
}

fn read_quantity(text: &str) -> Result<Quantity, String> {
    let (kind, which) = text.split_once(':').unwrap_or((text, ""));
    let number = || match which.parse::<usize>() {
        Ok(number) if number > 0 => Ok(number),
        _ => Err(format!("\"{which}\" as the number of a mode, counted from 1")),
    };
    if let Some(family) = Family::ALL.into_iter().find(|family| family.name() == kind) {
        return Ok(Quantity::Family(family, number()?));
    }
    match kind {
        "mode" => Ok(Quantity::Mode(number()?)),
        "frequency" if which.is_empty() => Ok(Quantity::Nearest),
        "force" if !which.is_empty() => Ok(Quantity::Force(which.to_owned())),
        _ => Err(format!("\"{text}\" as a quantity")),
    }
}

/// Returns a number in its shortest exact form.
fn short(number: f64) -> String {
    if number == 0.0 || (1e-3..1e6).contains(&number.abs()) { number.to_string() } else { format!("{number:e}") }
}

fn finite(word: &str, what: &str, fault: impl Fn(&str, &str) -> IdentifyError) -> Result<f64, IdentifyError> {
    let number = word.trim().parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| fault(&format!("\"{word}\" as {what}"), "write a number"))
}
