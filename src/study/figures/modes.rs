use std::f64::consts::TAU;

use super::{kind, number};
use crate::{
    output::Table,
    plot::{Axis, Figure, Panel, Series, Style},
    scene::Scene,
    study::StudyError,
    system::{Spec, bonded_stiffness},
    train::planetary::{Family, families},
};

/// A natural mode.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeRow {
    /// Its family and its number there, from 1: `R1`, `T2`, `P1`.
    pub name: String,
    /// How often the frequency is repeated.
    pub multiplicity: usize,
    /// Frequency, Hz.
    pub hertz: f64,
    /// Shares of the kinetic energy by part, largest first: `planets radial`, `sun rotation`, …
    pub shares: Vec<(String, f64)>,
}

/// Natural modes of a planetary stage with every mesh closed, and drawings of those up to `highest`, Hz. The modes of other
/// trains do not fall into the families of a stage.
pub fn modes(scene: &Scene, highest: f64) -> Result<(Figure, Vec<ModeRow>), StudyError> {
    let missing = |missing: String| StudyError::missing(scene.name(), missing);
    if kind(scene) != "planetary" {
        return Err(missing("it is no planetary stage, whose modes fall into families and can be drawn".to_owned()));
    }
    let spec = &scene.built().spec;
    let sorted = families(spec, &bonded_stiffness(spec, None)).map_err(|error| missing(error.to_string()))?;
    let mut drawn: Vec<(ModeRow, Vec<f64>)> = Vec::new();
    for family in &sorted {
        let letter = match family.family {
            Family::Rotational => 'R',
            Family::Translational => 'T',
            Family::Planet => 'P',
        };
        for (i, hertz) in family.hertz().into_iter().enumerate() {
            let column = i * family.multiplicity;
            let shares = family.modes.energy_shares(&spec.mass, column);
            let row = ModeRow {
                name: format!("{letter}{}", i + 1),
                multiplicity: family.multiplicity,
                hertz,
                shares: by_part(&spec.freedoms, &shares),
            };
            drawn.push((row, family.modes.shapes.column(column).iter().copied().collect()));
        }
    }
    drawn.sort_by(|a, b| a.0.hertz.total_cmp(&b.0.hertz));
    let stage = Layout::new(scene, spec)?;
    let panels: Vec<Panel> =
        drawn.iter().filter(|(row, _)| row.hertz <= highest).map(|(row, shape)| stage.panel(row, shape)).collect();
    let figure = Figure {
        id: "modes".to_owned(),
        title: "Natural modes with every mesh closed".to_owned(),
        caption: "Thin: at rest. Thick: displaced, drawn large; the spokes show how bodies turn. R: rotational, T: \
                  translational (in pairs, one of each shown), P: planet modes."
            .to_owned(),
        columns: 3,
        panels,
    };
    Ok((figure, drawn.into_iter().map(|(row, _)| row).collect()))
}

/// The natural frequencies as a table.
pub(in crate::study) fn listing(rows: &[ModeRow]) -> Table {
    let cells = |row: &ModeRow| {
        let shares = row.shares.iter().filter(|(_, share)| *share >= 0.05);
        let shares =
            shares.map(|(part, share)| format!("{part} {:.0} %", 100.0 * share)).collect::<Vec<_>>().join(", ");
        vec![row.name.clone(), format!("{:.2}", row.hertz), row.multiplicity.to_string(), shares]
    };
    let note = "R rotational, T translational, P planet modes; shares of the kinetic energy from 5 % on.";
    let head = ["Mode", "Hz", "Times", "Kinetic energy"];
    Table::new(head).with(rows.iter().map(cells)).titled("Natural frequencies", note)
}

/// Energy shares summed over alike planets, largest first.
fn by_part(freedoms: &[String], shares: &[f64]) -> Vec<(String, f64)> {
    let mut parts: Vec<(String, f64)> = Vec::new();
    for (name, share) in freedoms.iter().zip(shares) {
        let part = match name.split('_').collect::<Vec<_>>()[..] {
            ["u", "s"] => "sun rotation",
            ["u", "r"] => "ring rotation",
            ["u", "c"] => "carrier rotation",
            ["x" | "y", "s"] => "sun translation",
            ["x" | "y", "r"] => "ring translation",
            ["x" | "y", "c"] => "carrier translation",
            ["xi", ..] => "planets radial",
            ["eta", ..] => "planets tangential",
            _ => "planet rotation",
        };
        match parts.iter_mut().find(|(known, _)| known == part) {
            Some((_, sum)) => *sum += share,
            None => parts.push((part.to_owned(), *share)),
        }
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    parts
}

/// Where the bodies of a stage are drawn.
struct Layout<'s> {
    spec: &'s Spec,
    /// Angles of the planets, rad.
    planets: Vec<f64>,
    sun: f64,
    planet: f64,
    ring: f64,
    centre: f64,
    unit: &'static str,
}

impl<'s> Layout<'s> {
    fn new(scene: &Scene, spec: &'s Spec) -> Result<Self, StudyError> {
        let train = &scene.resolved()["train"];
        let listed = |key: &str, unit: f64| -> Option<Vec<f64>> {
            let list = train[key].as_array()?;
            Some(list.iter().filter_map(serde_json::Value::as_f64).map(|angle| angle * unit).collect())
        };
        let count = train["planets"].as_u64().unwrap_or(3);
        let equal = || (0..count).map(|i| TAU * i as f64 / count as f64).collect();
        let planets =
            listed("positions_rad", 1.0).or_else(|| listed("positions_deg", TAU / 360.0)).unwrap_or_else(equal);
        // Pitch circles in mm, from base circles and working pressure angles; where the scene leaves those to a rack, in
        // half teeth.
        let angle = |mesh: &str| {
            let given = |unit: &str| train[format!("{mesh}_pressure_angle_{unit}")].as_f64();
            given("rad").or_else(|| given("deg").map(f64::to_radians))
        };
        let pitch = |gear: &str, mesh: &str| Some(1e3 * train[gear]["radius_m"].as_f64()? / libm::cos(angle(mesh)?));
        let known = (|| Some([pitch("sun", "sun")?, pitch("planet", "sun")?, pitch("ring", "ring")?]))();
        let half_teeth = |gear: &str| Ok::<_, StudyError>(0.5 * number(scene, &format!("/train/teeth/{gear}"))?);
        let ([sun, planet, ring], unit) = match known {
            Some(radii) => (radii, "mm"),
            None => ([half_teeth("sun")?, half_teeth("planet")?, half_teeth("ring")?], "half teeth"),
        };
        Ok(Self { spec, planets, sun, planet, ring, centre: sun + planet, unit })
    }

    fn panel(&self, row: &ModeRow, shape: &[f64]) -> Panel {
        let of = |name: &str| self.spec.freedoms.iter().position(|f| f == name).map_or(0.0, |i| shape[i]);
        let of_planet = |stem: &str, i: usize| {
            let own = format!("{stem}_{}", i + 1);
            if self.spec.freedoms.contains(&own) { of(&own) } else { of(stem) }
        };
        // The largest displacement becomes a quarter of the planet's radius.
        let scale = 0.25 * self.planet / shape.iter().fold(f64::MIN_POSITIVE, |m: f64, v| m.max(v.abs()));
        let mut series = Vec::new();
        let mut body = |colour: usize, rest: [f64; 2], moved: [f64; 2], radius: f64, turn: f64| {
            series.push(circle(rest, radius, 7, Style::Hairline));
            let at = [rest[0] + scale * moved[0], rest[1] + scale * moved[1]];
            series.push(circle(at, radius, colour, Style::Line));
            let angle = scale * turn / radius;
            let spoke = |a: f64| [at[0] + radius * libm::cos(a), at[1] + radius * libm::sin(a)];
            let end = spoke(angle);
            series.push(Series::line("", colour, vec![at[0], end[0]], vec![at[1], end[1]]));
        };
        body(0, [0.0; 2], [of("x_s"), of("y_s")], self.sun, of("u_s"));
        body(1, [0.0; 2], [of("x_r"), of("y_r")], self.ring, of("u_r"));
        body(3, [0.0; 2], [of("x_c"), of("y_c")], self.centre, of("u_c"));
        for (i, psi) in self.planets.iter().enumerate() {
            let (sin, cos) = libm::sincos(*psi);
            let (xi, eta) = (of_planet("xi", i), of_planet("eta", i));
            let moved = [xi * cos - eta * sin, xi * sin + eta * cos];
            body(2, [self.centre * cos, self.centre * sin], moved, self.planet, of_planet("u", i));
        }
        let twice = match row.multiplicity {
            1 => String::new(),
            n => format!(" ({n} times)"),
        };
        let (part, share) = row.shares.first().cloned().unwrap_or_default();
        let reach = 1.15 * self.ring;
        Panel {
            title: format!("{}: {:.1} Hz{twice}, {part} {:.0} %", row.name, row.hertz, 100.0 * share),
            x: Axis::new("x", self.unit).between(-reach, reach),
            y: Axis::new("y", self.unit).between(-reach, reach),
            equal_scales: true,
            series,
            ..Panel::default()
        }
    }
}

fn circle(centre: [f64; 2], radius: f64, colour: usize, style: Style) -> Series {
    let angles = (0..=72).map(|i| TAU * f64::from(i) / 72.0);
    let (x, y) = angles.map(|a| (centre[0] + radius * libm::cos(a), centre[1] + radius * libm::sin(a))).unzip();
    Series::line("", colour, x, y).styled(style)
}
