/// A flank that cannot be penetrated.
///
/// Newton's law: the gap opens after an impact with the restitution times its closing speed. Contacts that strike at one instant are solved
/// together with their mass coupling (see `train::impact`), each with the restitution at its own approach speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// Coefficient of restitution.
    pub restitution: Restitution,
}

impl Rigid {
    /// A flank with a restitution that does not depend on the speed, `[0, 1]`.
    #[must_use]
    pub const fn constant(restitution: f64) -> Self {
        Self { restitution: Restitution::Constant(restitution) }
    }
}

/// Maximum number of points of a table.
pub const MOST_POINTS: usize = 8;

/// Coefficient of restitution e as a function of the approach speed v. Towards v = 0 it is constant, and below 1 unless it is constant
/// everywhere. A shrinking sequence of impacts is then geometric in the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Restitution {
    /// The same at all speeds, `[0, 1]`.
    Constant(f64),
    /// `e = e₁ (max(v, v_s)/v₁)^−p`.
    Power {
        /// Restitution e₁ at the speed v₁, `(0, 1)`.
        at_speed: f64,
        /// Speed v₁, m/s, > 0.
        speed: f64,
        /// Exponent p, ≥ 0; 1/4 for yielding spheres (Johnson, Contact Mechanics, 1985, section 11.5).
        exponent: f64,
        /// Speed v_s, m/s, > 0, below which it is constant; there it is below 1.
        smallest_speed: f64,
    },
    /// Straight lines between points, constant beyond its ends.
    Table {
        /// Speed, m/s, rising from 0 or more, and restitution, `(0, 1]`, below 1 at the first point; `count` points are used.
        points: [[f64; 2]; MOST_POINTS],
        /// Number of points, from 1.
        count: usize,
    },
}

impl Restitution {
    /// The restitution of an approach at `speed` v, m/s; that at 0 for v < 0.
    #[must_use]
    pub fn at(&self, speed: f64) -> f64 {
        match self {
            Self::Constant(e) => *e,
            Self::Power { at_speed, speed: v1, exponent, smallest_speed } => {
                at_speed * libm::pow(speed.max(*smallest_speed) / v1, -exponent)
            }
            Self::Table { points, count } => {
                let points = &points[..*count];
                let next = points.partition_point(|[v, _]| *v <= speed);
                match (next.checked_sub(1).map(|last| points[last]), points.get(next)) {
                    (Some([v0, e0]), Some([v1, e1])) => e0 + (e1 - e0) * ((speed - v0) / (v1 - v0)),
                    (Some([_, e]), None) | (None, Some(&[_, e])) => e,
                    (None, None) => 0.0,
                }
            }
        }
    }

    /// `d(e v)/dv`: the change of the speed of the rebound with that of the approach at `speed` v, m/s.
    #[must_use]
    pub fn rebound_slope(&self, speed: f64) -> f64 {
        let e = self.at(speed);
        match self {
            Self::Constant(_) => e,
            Self::Power { smallest_speed, .. } if speed < *smallest_speed => e,
            Self::Power { exponent, .. } => e * (1.0 - exponent),
            Self::Table { points, count } => {
                let lines = points[..*count].windows(2);
                let slope = |line: &[[f64; 2]]| (line[1][1] - line[0][1]) / (line[1][0] - line[0][0]);
                let here = lines.into_iter().find(|line| (line[0][0]..line[1][0]).contains(&speed));
                e + speed * here.map_or(0.0, slope)
            }
        }
    }

    /// Speed below which the restitution is constant, m/s; infinite if it is so everywhere.
    #[must_use]
    pub fn steady_speed(&self) -> f64 {
        match self {
            Self::Constant(_) => f64::INFINITY,
            Self::Power { exponent, .. } if *exponent == 0.0 => f64::INFINITY,
            Self::Power { smallest_speed, .. } => *smallest_speed,
            Self::Table { count: 1, .. } => f64::INFINITY,
            Self::Table { points, .. } => points[0][0],
        }
    }

    /// Returns whether no impact rebounds, at any speed.
    #[must_use]
    pub fn is_dead(&self) -> bool {
        *self == Self::Constant(0.0)
    }

    /// Returns the first number out of its range, with its name and the range.
    #[must_use]
    pub fn fault(&self) -> Option<(&'static str, f64, &'static str)> {
        let is_positive = |x: f64| x > 0.0 && x.is_finite();
        let checks = match *self {
            Self::Constant(e) => vec![("restitution", e, (0.0..=1.0).contains(&e), "from 0 to 1")],
            Self::Power { at_speed, speed, exponent, smallest_speed } => {
                let largest = self.at(0.0);
                vec![
                    ("restitution", at_speed, at_speed > 0.0 && at_speed < 1.0, "between 0 and 1, excluded"),
                    ("speed", speed, is_positive(speed), "> 0"),
                    ("exponent", exponent, exponent >= 0.0 && exponent.is_finite(), ">= 0"),
                    ("smallest speed", smallest_speed, is_positive(smallest_speed), "> 0"),
                    ("restitution at the smallest speed", largest, largest < 1.0, "< 1: a larger smallest speed"),
                ]
            }
            Self::Table { points, count } => {
                let points = &points[..count.min(MOST_POINTS)];
                let mut checks = vec![("points", count as f64, (1..=MOST_POINTS).contains(&count), "from 1 to 8")];
                for (i, [v, e]) in points.iter().enumerate() {
                    let rises = *v >= 0.0 && v.is_finite() && (i == 0 || points[i - 1][0] < *v);
                    let most = if i == 0 { *e < 1.0 } else { *e <= 1.0 };
                    checks.push(("speed", *v, rises, "speeds that rise, from 0"));
                    checks.push(("restitution", *e, *e > 0.0 && most, "above 0, up to 1; below 1 at the first speed"));
                }
                checks
            }
        };
        checks.into_iter().find_map(|(name, value, ok, wanted)| (!ok).then_some((name, value, wanted)))
    }
}
