//! Exact conversion of a [`Wide`] to decimal digits and back: its value is a whole number times a power of two.

use super::Wide;

/// An unsigned whole number, limbs of 32 bits, least first.
type Big = Vec<u32>;

const LIMB: u64 = 1 << 32;
/// Digits produced at once.
const GROUP: u32 = 1_000_000_000;

/// `|v| = mantissa · 2^exponent`.
fn parts(v: f64) -> (u64, i32) {
    let bits = v.to_bits();
    let exponent = (bits >> 52 & 0x7ff) as i32;
    let fraction = bits & ((1 << 52) - 1);
    if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) }
}

/// `mantissa · 2^shift`.
fn shifted(mantissa: u64, shift: u32) -> Big {
    let mut out = vec![0; (shift / 32) as usize];
    let wide = u128::from(mantissa) << (shift % 32);
    out.extend((0..3).map(|i| (wide >> (32 * i)) as u32));
    out
}

/// `a ± b`, where the result is not negative.
fn combine(mut a: Big, b: &Big, subtract: bool) -> Big {
    a.resize(a.len().max(b.len()) + 1, 0);
    let mut carry: i64 = 0;
    for (i, limb) in a.iter_mut().enumerate() {
        let term = i64::from(b.get(i).copied().unwrap_or(0));
        let sum = i64::from(*limb) + carry + if subtract { -term } else { term };
        *limb = sum.rem_euclid(LIMB as i64) as u32;
        carry = sum.div_euclid(LIMB as i64);
    }
    a
}

/// Divides by `GROUP` in place; returns the remainder.
fn divide(a: &mut Big) -> u32 {
    let mut rest: u64 = 0;
    for limb in a.iter_mut().rev() {
        let value = rest * LIMB + u64::from(*limb);
        *limb = (value / u64::from(GROUP)) as u32;
        rest = value % u64::from(GROUP);
    }
    rest as u32
}

/// Multiplies by `GROUP` in place; `a` has room.
fn multiply(a: &mut Big) {
    let mut carry: u64 = 0;
    for limb in a.iter_mut() {
        let value = u64::from(*limb) * u64::from(GROUP) + carry;
        *limb = value as u32;
        carry = value >> 32;
    }
}

/// Splits at bit `bits`: the whole part is returned, the fraction stays.
fn split(a: &mut Big, bits: u32) -> Big {
    let (limb, bit) = ((bits / 32) as usize, bits % 32);
    let at = |i: usize| u64::from(a.get(i).copied().unwrap_or(0));
    let high = (limb..a.len().max(limb + 1)).map(|i| ((at(i) | at(i + 1) << 32) >> bit) as u32).collect();
    for (i, l) in a.iter_mut().enumerate().skip(limb) {
        *l = if i == limb { *l & ((1 << bit) - 1) } else { 0 };
    }
    high
}

impl Wide {
    /// Returns the number in decimal, rounded to `significant` digits (at least 1) from its exact value, without trailing zeros.
    ///
    /// Positional for magnitudes from 10⁻⁷ to 10²¹, with an exponent otherwise.
    #[must_use]
    pub fn decimal(self, significant: usize) -> String {
        let w = Self::sum(self.hi, self.lo);
        if !w.hi.is_finite() {
            return w.hi.to_string();
        }
        if w.hi == 0.0 {
            return "0".to_owned();
        }
        let (digits, point) = digits(w, significant.max(1));
        let sign = if w.hi < 0.0 { "-" } else { "" };
        let body = match point {
            -6..=0 => format!("0.{}{digits}", "0".repeat(point.unsigned_abs() as usize)),
            1..=21 if digits.len() > point as usize => {
                let (whole, fraction) = digits.split_at(point as usize);
                format!("{whole}.{fraction}")
            }
            1..=21 => format!("{digits}{}", "0".repeat(point as usize - digits.len())),
            _ if digits.len() == 1 => format!("{digits}e{}", point - 1),
            _ => format!("{}.{}e{}", &digits[..1], &digits[1..], point - 1),
        };
        format!("{sign}{body}")
    }
}

impl Wide {
    /// Returns the number that `text` writes in decimal: digits with or without sign, point and exponent, any number of them.
    ///
    /// `hi` is the double nearest to the number, `lo` the double nearest to the remainder. `None` for any other text, beyond the range of a
    /// double, and for exponents beyond ±9999.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        // The remainder is a difference of two decimals; the standard library rounds either to the nearest double.
        let numeric = text.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
        let hi = text.parse::<f64>().ok().filter(|hi| numeric && hi.is_finite())?;
        let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
        // The standard library cuts longer exponents.
        let exponent = exponent.parse::<i64>().ok().filter(|exponent| exponent.abs() < 10_000)?;
        if hi == 0.0 {
            return Some(Self::default());
        }
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let mut given = [whole.trim_start_matches(['+', '-']), fraction].concat().into_bytes();
        let given_decimals = fraction.len() as i64 - exponent;
        let near_decimals = i64::from((-parts(hi).1).max(0));
        let mut near = format!("{:.*}", near_decimals as usize, hi.abs()).replace('.', "").into_bytes();
        let decimals = near_decimals.max(given_decimals);
        for (digits, own) in [(&mut given, given_decimals), (&mut near, near_decimals)] {
            digits.resize(digits.len() + (decimals - own) as usize, b'0');
        }
        let length = given.len().max(near.len());
        for digits in [&mut given, &mut near] {
            digits.splice(0..0, std::iter::repeat_n(b'0', length - digits.len()));
        }
        let (larger, smaller) = if given < near { (&near, &given) } else { (&given, &near) };
        let (mut left, mut borrow) = (vec![b'0'; length], 0);
        for (i, digit) in left.iter_mut().enumerate().rev() {
            let taken = smaller[i] + borrow;
            borrow = u8::from(larger[i] < taken);
            *digit += larger[i] + 10 * borrow - taken;
        }
        let sign = if (given < near) == (hi > 0.0) { "-" } else { "" };
        // `near` has a digit before its decimals.
        left.insert(length - decimals as usize, b'.');
        let lo = format!("{sign}{}", String::from_utf8_lossy(&left)).parse().ok()?;
        Some(Self { hi, lo })
    }
}

/// Returns the first `n` digits, rounded half up from the exact value, and the place of the point before them.
fn digits(w: Wide, n: usize) -> (String, i32) {
    let ((m, e), (ml, el)) = (parts(w.hi), parts(w.lo));
    let low = if ml == 0 { e } else { e.min(el) };
    let mut value = shifted(m, (e - low) as u32);
    if ml != 0 {
        value = combine(value, &shifted(ml, (el - low) as u32), (w.lo < 0.0) != (w.hi < 0.0));
    }
    let bits = low.min(0).unsigned_abs();
    if low > 0 {
        // A whole number with trailing binary zeros.
        let zeros = (low / 32) as usize;
        let mut high = Big::with_capacity(value.len() + zeros + 1);
        high.resize(zeros, 0);
        let shift = low % 32;
        let mut carry = 0;
        for limb in value.iter().chain(&[0]) {
            let wide = u64::from(*limb) << shift | carry;
            high.push(wide as u32);
            carry = wide >> 32;
        }
        value = high;
    }
    let mut whole = split(&mut value, bits);
    let mut groups = Vec::new();
    while whole.iter().any(|l| *l != 0) {
        groups.push(divide(&mut whole));
    }
    let mut out: String = groups.iter().rev().map(|g| format!("{g:09}")).collect();
    out.drain(..out.len() - out.trim_start_matches('0').len());
    let mut point = out.len() as i32;
    // Room for one group above the fraction.
    value.resize((bits / 32) as usize + 3, 0);
    while out.len() <= n && value.iter().any(|l| *l != 0) {
        multiply(&mut value);
        let group = split(&mut value, bits);
        let text = format!("{:09}", group[0]);
        if out.is_empty() {
            let kept = text.trim_start_matches('0');
            point -= (text.len() - kept.len()) as i32;
            out.push_str(kept);
        } else {
            out.push_str(&text);
        }
    }
    round(&mut out, n, &mut point);
    out.truncate(out.trim_end_matches('0').len());
    (out, point)
}

/// Keeps `n` digits; a carry out of the first one moves the point.
fn round(digits: &mut String, n: usize, point: &mut i32) {
    if digits.len() <= n {
        return;
    }
    let up = digits.as_bytes()[n] >= b'5';
    digits.truncate(n);
    if up {
        let kept = digits.trim_end_matches('9').len();
        digits.truncate(kept);
        match digits.pop().and_then(|c| c.to_digit(10)) {
            Some(d) => digits.push_str(&(d + 1).to_string()),
            None => {
                digits.push('1');
                *point += 1;
            }
        }
    }
}
