//! What is implausible about a stage's data.

use std::fmt;

use super::Planetary;
use crate::gear::phase::{assemblable, nearest_assemblable};

/// Something implausible about a stage. Angles in rad, lengths in m.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// Planets at these positions cannot be put between sun and ring: they must sit at multiples of
    /// `2π/(Z_s + Z_r)` from one another.
    NotAssemblable {
        /// Positions as given.
        positions: Vec<f64>,
        /// The nearest assemblable ones.
        nearest: Vec<f64>,
    },
    /// `Z_r = Z_s + 2 Z_p` does not hold within what profile shift can make up (2 teeth).
    Teeth {
        /// `Z_r − Z_s − 2 Z_p`.
        excess: i64,
    },
    /// A body's radius of gyration lies beyond its outer radius.
    Gyration {
        /// `sun`, `planet 1` …, `ring`, `carrier`.
        body: String,
        /// Radius of gyration.
        gyration: f64,
        /// Outer radius.
        outer: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let degrees =
            |angles: &[f64]| angles.iter().map(|a| format!("{:.4}", a.to_degrees())).collect::<Vec<_>>().join(", ");
        match self {
            Self::NotAssemblable { positions, nearest } => write!(
                f,
                "planets at {} deg cannot be assembled; the nearest positions are {} deg",
                degrees(positions),
                degrees(nearest)
            ),
            Self::Teeth { excess } => {
                write!(f, "the ring has {excess:+} teeth against sun + 2 planets; no profile shift makes that up")
            }
            Self::Gyration { body, gyration, outer } => write!(
                f,
                "{body}: radius of gyration {:.1} mm is beyond the outer radius {:.1} mm",
                1.0e3 * gyration,
                1.0e3 * outer
            ),
        }
    }
}

impl Planetary {
    /// Positions closer to an assemblable one than this pass, rad: 1e-6 of a turn, far below any tooth.
    const POSITION_TOLERANCE: f64 = 1.0e-6;

    /// Everything implausible about the stage; empty if there is nothing.
    #[must_use]
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        let (positions, teeth) = (self.positions(), self.teeth);
        if !assemblable(teeth.sun, teeth.ring, &positions, Self::POSITION_TOLERANCE) {
            let nearest = nearest_assemblable(teeth.sun, teeth.ring, &positions);
            warnings.push(Warning::NotAssemblable { positions, nearest });
        }
        let excess = i64::from(teeth.ring) - i64::from(teeth.sun) - 2 * i64::from(teeth.planet);
        if excess.abs() > 2 {
            warnings.push(Warning::Teeth { excess });
        }
        let planets = self.planets.iter().enumerate().map(|(i, planet)| (format!("planet {}", i + 1), &planet.body));
        let bodies = [("sun".to_string(), &self.sun), ("ring".into(), &self.ring), ("carrier".into(), &self.carrier)];
        for (body, data) in bodies.into_iter().chain(planets) {
            if let Some((gyration, outer)) = data.impossible_gyration() {
                warnings.push(Warning::Gyration { body, gyration, outer });
            }
        }
        warnings
    }
}
