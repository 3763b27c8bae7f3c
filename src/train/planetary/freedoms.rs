//! Degrees of freedom that a stage keeps, and the motion of the others.

use nalgebra::DMatrix;

use super::Planetary;
use crate::train::error::{TrainError, check};

/// Degrees of freedom that are kept. The others follow their support: sun, ring and carrier the frame, the centre of a planet its pin on
/// the carrier (`ξ = x_c cos ψ + y_c sin ψ`, `η = u_c − x_c sin ψ + y_c cos ψ`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Freedoms {
    /// `u_s, u_1 … u_N, u_c, u_r`: the carrier then carries its planets, `I_c/r_c² + N m_p`.
    Torsional,
    /// `u_s, u_r, u_c, xi, eta, u`: one planet stands for all. The central bodies count with the share (1/N) of one planet of mass, support
    /// and load. The contact force is then that of one mesh. Exact for alike, equally spaced planets whose meshes have the same error and
    /// stiffness at the same time.
    InPhase,
    /// `x_s, y_s, u_s, xi_i, eta_i, u_i …, u_c, x_r, y_r, u_r`: 7 + 3 N, the carrier's centre held.
    Full,
    /// [`Freedoms::Full`] with `x_c, y_c` before `u_c`: 9 + 3 N.
    FullCarrier,
    /// The named ones out of those of [`Freedoms::FullCarrier`], in this order.
    Named(Vec<String>),
}

impl Planetary {
    /// Returns the names of all degrees of freedom, in the order of [`Freedoms::FullCarrier`].
    #[must_use]
    pub fn freedoms(&self) -> Vec<String> {
        let planets = (1..=self.planets.len()).flat_map(|i| [format!("xi_{i}"), format!("eta_{i}"), format!("u_{i}")]);
        ["x_s", "y_s", "u_s"]
            .into_iter()
            .map(String::from)
            .chain(planets)
            .chain(["x_c", "y_c", "u_c", "x_r", "y_r", "u_r"].map(String::from))
            .collect()
    }

    /// The kept names and the matrix P of `q_all = P q_kept`.
    pub(super) fn projection(&self, freedoms: &Freedoms) -> Result<(Vec<String>, DMatrix<f64>), TrainError> {
        let all = self.freedoms();
        let kept = match freedoms {
            Freedoms::FullCarrier => all.clone(),
            Freedoms::Full => all.iter().filter(|name| !matches!(name.as_str(), "x_c" | "y_c")).cloned().collect(),
            Freedoms::Torsional => all.iter().filter(|name| name.starts_with('u')).cloned().collect(),
            Freedoms::Named(names) => {
                check("number of freedoms", names.len() as f64, !names.is_empty(), ">= 1")?;
                for (i, name) in names.iter().enumerate() {
                    if !all.contains(name) || names[..i].contains(name) {
                        return Err(TrainError::Freedom { name: name.clone(), known: all });
                    }
                }
                names.clone()
            }
            Freedoms::InPhase => {
                let names = ["u_s", "u_r", "u_c", "xi", "eta", "u"].map(String::from).to_vec();
                let p = DMatrix::from_fn(all.len(), names.len(), |row, column| {
                    // `xi_2` follows `xi`; the central bodies' rotations keep their own names.
                    let own = all[row] == names[column];
                    let planet = all[row].rsplit_once('_').is_some_and(|(stem, number)| {
                        stem == names[column] && number.chars().all(|c| c.is_ascii_digit())
                    });
                    f64::from(own || planet)
                });
                return Ok((names, p));
            }
        };
        let mut p = DMatrix::zeros(all.len(), kept.len());
        for (row, name) in all.iter().enumerate() {
            if let Some(column) = kept.iter().position(|k| k == name) {
                p[(row, column)] = 1.0;
            }
        }
        self.carry(&all, &kept, &mut p);
        Ok((kept, p))
    }

    /// Sets the rows of the dropped planet centres: they follow the carrier.
    fn carry(&self, all: &[String], kept: &[String], p: &mut DMatrix<f64>) {
        let column = |name: &str| kept.iter().position(|k| k == name);
        for (i, planet) in self.planets.iter().enumerate() {
            let (sin, cos) = libm::sincos(planet.position);
            let radial = [("x_c", cos), ("y_c", sin)];
            let tangential = [("x_c", -sin), ("y_c", cos), ("u_c", 1.0)];
            for (offset, motion) in [(0, &radial[..]), (1, &tangential[..])] {
                let row = 3 + 3 * i + offset;
                if kept.contains(&all[row]) {
                    continue;
                }
                for (name, factor) in motion {
                    if let Some(column) = column(name) {
                        p[(row, column)] = *factor;
                    }
                }
            }
        }
    }
}
