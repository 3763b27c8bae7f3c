//! Warnings about implausible data of a stage.

use std::fmt;

use super::Planetary;
use crate::gear::phase::{assemblable, nearest_assemblable};

/// Implausible data of a stage. Angles in rad, lengths in m.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// Planets at these positions cannot be assembled between sun and ring: they must sit at multiples of `2π/(Z_s + Z_r)` from one
    /// another.
    NotAssemblable {
        /// Positions as given.
        positions: Vec<f64>,
        /// The nearest assemblable ones.
        nearest: Vec<f64>,
    },
    /// `Z_r = Z_s + 2 Z_p` is violated by more than profile shift can compensate (2 teeth).
    Teeth {
        /// `Z_r − Z_s − 2 Z_p`.
        excess: i64,
    },
    /// Radii of gyration lie beyond outer radii.
    Gyration {
        /// `sun`, `planet 1` …, `ring`, `carrier`, with the radius of gyration and the outer radius, m.
        bodies: Vec<(String, f64, f64)>,
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
            Self::Gyration { bodies } => {
                let words = |(body, gyration, outer): &(String, f64, f64)| {
                    format!("{body} {:.1} beyond {:.1} mm", 1.0e3 * gyration, 1.0e3 * outer)
                };
                let words: Vec<String> = bodies.iter().map(words).collect();
                write!(f, "radius of gyration beyond the outer radius, which no body has: {}", words.join(", "))
            }
        }
    }
}

impl Planetary {
    /// Distance from an assemblable position without a warning, rad: 1e-6 of a turn, far below any tooth.
    const POSITION_TOLERANCE: f64 = 1.0e-6;

    /// Returns all warnings about the stage; empty if there are none.
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
        let impossible = |(body, data): (String, &super::Body)| {
            data.impossible_gyration().map(|(gyration, outer)| (body, gyration, outer))
        };
        let bodies: Vec<_> = bodies.into_iter().chain(planets).filter_map(impossible).collect();
        if !bodies.is_empty() {
            warnings.push(Warning::Gyration { bodies });
        }
        warnings
    }
}
