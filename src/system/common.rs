//! Common cycle of all forcing, if it is several periods of the clock: orders below one, and frequencies whose ratios are no whole numbers.

use super::{ContactSpec, Spec, Structure};
use crate::{
    gear::{Harmonic, Stiffness},
    hybrid::Wide,
};

/// Largest denominator of an order, if the train names its base frequency.
const OF_ORDERS: u64 = 10_000;
/// Largest numerator and denominator of a ratio, if only frequencies are given.
const OF_FREQUENCIES: u64 = 1000;
/// Largest number of periods of the clock in a common cycle.
pub(super) const MOST: u64 = 100_000;
/// Rounding of a ratio of two numbers, each wrong by two units in the last place.
const ROUNDED: f64 = 4.0 * f64::EPSILON;
/// Largest relative difference of a cycle from a whole number of periods of a stiffness: both are written with rounding.
const WHOLE: f64 = 1e-12;
/// Exclusive upper bound of the orders of oscillators.
const HIGHEST: u64 = 1_000_000;

/// A ratio of whole numbers in lowest terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Ratio {
    p: u64,
    q: u64,
}

impl Ratio {
    /// Returns the first convergent of the continued fraction of `x` > 0 that equals `x` to rounding, with `q` up to `most`.
    fn of(x: f64, most: u64) -> Option<Self> {
        let (mut rest, [mut p, mut before_p], [mut q, mut before_q]) = (x, [1.0, 0.0], [0.0, 1.0]);
        loop {
            let term = rest.floor();
            [p, before_p] = [term * p + before_p, p];
            [q, before_q] = [term * q + before_q, q];
            if !(q <= most as f64 && p < 2f64.powi(53)) {
                return None;
            }
            if p > 0.0 && (q * x - p).abs() <= ROUNDED * p {
                return Some(Self { p: p as u64, q: q as u64 });
            }
            rest = (rest - term).recip();
        }
    }

    /// Returns the fraction of a period of an oscillator of this order that remains after `cycles` periods of the clock.
    fn left_after(self, cycles: u64) -> f64 {
        (u128::from(self.p) * u128::from(cycles) % u128::from(self.q)) as f64 / self.q as f64
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

impl Structure {
    /// Returns whether all oscillators are multiples of the clock, to rounding.
    pub(crate) fn has_whole_orders(&self) -> bool {
        self.clock.period().is_none() || self.oscillators.iter().all(|o| o.order.is_some())
    }

    /// Returns the number of periods of the clock after which all forcing repeats: 1 if every period is the same, or without a clock.
    ///
    /// # Errors
    /// A text that names the forcing without a common cycle.
    pub fn common_cycle(&self) -> Result<u64, String> {
        let Some(period) = self.clock.period().map(Wide::value) else { return Ok(1) };
        let spec = self.spec();
        let of_frequency = |omega: f64| {
            let ratio = match spec.omega {
                Some(base) => Ratio::of(omega / base, OF_ORDERS),
                None => Ratio::of(omega / self.clock.omega(), OF_FREQUENCIES).filter(|ratio| ratio.p <= OF_FREQUENCIES),
            };
            (ratio.map(|ratio| ratio.q), format!("its forcing at {omega} rad/s"))
        };
        let oscillators = self.oscillators.iter().map(|o| match o.order {
            Some(_) => (Some(1), String::new()),
            None => of_frequency(o.omega),
        });
        let of_contacts =
            spec.contacts.iter().flat_map(|c| c.schedules().map(|k| (k, format!("the stiffness of {}", c.name))));
        let of_loads = spec.load_schedules.iter().enumerate().map(|(i, l)| (&l.factor, format!("load {}", i + 1)));
        let stiffnesses = of_contacts.chain(of_loads).filter_map(|(schedule, name)| match schedule {
            Stiffness::Periodic { period: own, .. } => {
                let count = period / own;
                let is_whole = (count - count.round()).abs() <= WHOLE * count && count.round() >= 1.0;
                let periods = Ratio::of(own / period, OF_ORDERS).map(|ratio| ratio.p);
                let what = format!("{name}, of period {own} s,");
                Some((if is_whole { Some(1) } else { periods }, what))
            }
            _ => None,
        });
        let mut common = 1u64;
        for (periods, what) in oscillators.chain(stiffnesses) {
            let Some(periods) = periods else {
                return Err(format!(
                    "{what} does not repeat with its cycle of {period} s or a multiple of it, as no ratio of whole numbers up to {} is \
                     near enough; change a frequency or an order, or take what needs no cycle: flank run, flank lyapunov",
                    if spec.omega.is_some() { OF_ORDERS } else { OF_FREQUENCIES }
                ));
            };
            common = common / gcd(common, periods) * periods;
            let highest = self.oscillators.iter().map(|o| o.omega / self.clock.omega()).fold(1.0, f64::max);
            if common > MOST || common as f64 * highest >= HIGHEST as f64 && common > 1 {
                return Err(format!(
                    "all of its forcing has a common cycle of {common} periods of {period} s or more; {MOST} can be treated, and orders \
                     of that cycle below {HIGHEST}: change an order, or take what needs no cycle: flank run, flank lyapunov"
                ));
            }
        }
        Ok(common)
    }
}

impl Spec {
    /// Returns the same train in a clock of `periods` periods of `omega`, the common cycle, that starts with its period number `first`.
    #[must_use]
    pub(crate) fn over_cycles(mut self, omega: f64, periods: u64, first: u64) -> Self {
        let base = omega / periods as f64;
        let clocked = |omega_of: &mut f64, phase: &mut f64| {
            let ratio = Ratio::of(*omega_of / omega, OF_ORDERS).filter(|ratio| periods.is_multiple_of(ratio.q));
            let Some(ratio) = ratio else { return };
            *omega_of = (ratio.p * (periods / ratio.q)) as f64 * base;
            *phase += std::f64::consts::TAU * ratio.left_after(first);
        };
        let all =
            |harmonics: &mut Vec<Harmonic>| harmonics.iter_mut().for_each(|h| clocked(&mut h.omega, &mut h.phase));
        self.load_harmonics.iter_mut().for_each(|load| clocked(&mut load.omega, &mut load.phase));
        let period = Wide::quotient(Wide::TAU, omega);
        self.contacts.iter_mut().flat_map(ContactSpec::errors_mut).for_each(all);
        let schedules = self.contacts.iter_mut().flat_map(ContactSpec::schedules_mut);
        for schedule in schedules.chain(self.load_schedules.iter_mut().map(|l| &mut l.factor)) {
            match schedule {
                Stiffness::Harmonic { harmonics, .. } => all(harmonics),
                Stiffness::Periodic { period: own, origin, .. } => {
                    let left = Ratio::of(period.value() / *own, OF_ORDERS).map_or(0.0, |ratio| ratio.left_after(first));
                    *origin -= left * *own;
                }
                Stiffness::Listed { times, .. } => {
                    for time in times {
                        let moved = Wide { hi: time[0], lo: time[1] } - period * first as f64;
                        *time = [moved.hi, moved.lo];
                    }
                }
                Stiffness::Constant(_) => {}
            }
        }
        self.omega = Some(base);
        self
    }
}

#[cfg(test)]
#[path = "../../tests/unit/common.rs"]
mod tests;
