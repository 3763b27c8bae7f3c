use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::family;
use crate::{
    linalg::{Modes, natural_modes},
    output::Table,
    plot::{Axis, Figure, Panel, Series, Style},
    scene::Scene,
    study::StudyError,
    system::bonded_stiffness,
    train::{
        Drawing,
        planetary::{Family, families},
    },
};

/// Maximum number of modes drawn.
const DRAWN: usize = 12;
/// Frequencies below this share of the highest one are rounding of a body that moves freely.
const RIGID: f64 = 1e-6;

/// Colour of bodies at rest.
const REST: usize = 7;
/// Millimetres per metre.
const MM: f64 = 1e3;

/// Natural mode.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeRow {
    /// Name: in a symmetric stage its family and its index there, from 1: `R1`, `T2`, `P1`; else its index: `f1`.
    pub name: String,
    /// Number of modes of this frequency.
    pub multiplicity: usize,
    /// Frequency, Hz.
    pub hertz: f64,
    /// Shares of the kinetic energy by part, largest first: `planets radial`, `sun rotation`, …
    pub shares: Vec<(String, f64)>,
}

/// Returns the natural modes with every contact closed, and drawings of those up to `highest`, Hz, if the gears are known. Modes of
/// symmetric stages are named by family.
pub fn modes(scene: &Scene, highest: f64) -> Result<(Option<Figure>, Vec<ModeRow>), StudyError> {
    let spec = &scene.built().spec;
    let mut all: Vec<(ModeRow, Vec<f64>)> = sorted(scene)?
        .into_iter()
        .flat_map(|(letter, multiplicity, modes)| {
            let mode = |(i, hertz): (usize, f64)| {
                let column = i * multiplicity;
                let row = ModeRow {
                    name: format!("{letter}{}", i + 1),
                    multiplicity,
                    hertz,
                    shares: by_part(&spec.freedoms, &modes.energy_shares(&spec.mass, column)),
                };
                (row, modes.shapes.column(column).iter().copied().collect())
            };
            let groups = modes.hertz();
            let groups = groups.chunks(multiplicity).map(|group| group.iter().sum::<f64>() / group.len() as f64);
            groups.collect::<Vec<_>>().into_iter().enumerate().map(mode).collect::<Vec<_>>()
        })
        .collect();
    all.sort_by(|a, b| a.0.hertz.total_cmp(&b.0.hertz));
    let rigid = RIGID * all.last().map_or(0.0, |(row, _)| row.hertz);
    let drawn = |drawing: &Drawing| {
        let shown = all.iter().filter(|(row, _)| rigid < row.hertz && row.hertz <= highest).take(DRAWN);
        let panels: Vec<Panel> = shown.map(|(row, shape)| panel(drawing, row, shape)).collect();
        (!panels.is_empty()).then(|| Figure {
            id: "modes".to_owned(),
            title: "Natural modes with every mesh closed".to_owned(),
            caption: "Thin: at rest. Thick: displaced, drawn large; the spokes show how bodies turn.".to_owned(),
            columns: 3,
            panels,
        })
    };
    let figure = scene.built().drawing.as_ref().and_then(drawn);
    Ok((figure, all.into_iter().map(|(row, _)| row).collect()))
}

/// Returns the modes of a scene by family: its letter, the multiplicity of its frequencies, and the modes.
fn sorted(scene: &Scene) -> Result<Vec<(&'static str, usize, Modes)>, StudyError> {
    let spec = &scene.built().spec;
    let stiffness: DMatrix<f64> = bonded_stiffness(spec, None);
    if let Ok(sorted) = families(spec, &stiffness) {
        let letter = |family| match family {
            Family::Rotational => "R",
            Family::Translational => "T",
            Family::Planet => "P",
        };
        return Ok(sorted.into_iter().map(|one| (letter(one.family), one.multiplicity, one.modes)).collect());
    }
    let symmetric = 0.5 * (&stiffness + stiffness.transpose());
    let missing = |error| StudyError::missing(scene.name(), format!("it has no natural modes: {error}"));
    Ok(vec![("f", 1, natural_modes(&symmetric, &spec.mass).map_err(missing)?)])
}

/// Returns the natural frequencies as a table.
pub(in crate::study) fn listing(rows: &[ModeRow]) -> Table {
    let cells = |row: &ModeRow| {
        let shares = row.shares.iter().filter(|(_, share)| *share >= 0.05);
        let shares =
            shares.map(|(part, share)| format!("{part} {:.0} %", 100.0 * share)).collect::<Vec<_>>().join(", ");
        vec![row.name.clone(), format!("{:.2}", row.hertz), row.multiplicity.to_string(), shares]
    };
    let families = if rows.iter().any(|row| !row.name.starts_with('f')) {
        "R: rotational, T: translational (in pairs), P: planet modes. "
    } else {
        ""
    };
    let note = format!("{families}Shares of the kinetic energy from 5 % on.");
    let head = ["Mode", "Hz", "Times", "Kinetic energy"];
    Table::new(head).with(rows.iter().map(cells)).titled("Natural frequencies", note)
}

/// Returns energy shares, those of the freedoms of a stage in words and summed over equal planets, largest first.
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
            ["u"] => "planet rotation",
            ["u", number] if number.parse::<u32>().is_ok() && freedoms.iter().any(|name| name == "u_s") => {
                "planet rotation"
            }
            _ => name,
        };
        match parts.iter_mut().find(|(known, _)| known == part) {
            Some((_, sum)) => *sum += share,
            None => parts.push((part.to_owned(), *share)),
        }
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    parts
}

/// Draws the train displaced in a mode.
fn panel(drawing: &Drawing, row: &ModeRow, shape: &[f64]) -> Panel {
    // Equal gears share a colour, unless all are equal.
    let mut names: Vec<&str> = drawing.gears.iter().map(|gear| family(&gear.name)).collect();
    names.dedup();
    let is_one = names.len() == 1;
    let value = |row: &[f64]| row.iter().zip(shape).map(|(r, q)| r * q).sum::<f64>();
    let moved: Vec<[f64; 3]> = drawing.gears.iter().map(|gear| [0, 1, 2].map(|i| value(&gear.motion[i]))).collect();
    let radii = || drawing.gears.iter().map(|gear| gear.radius);
    let bodies = || drawing.gears.iter().zip(&moved);
    let largest = bodies().map(|(gear, [x, y, turn])| libm::hypot(*x, *y).max(gear.radius * turn.abs()));
    // The largest displacement is drawn as a quarter of the smallest gear's radius.
    let scale = 0.25 * radii().fold(f64::INFINITY, f64::min) / largest.fold(f64::MIN_POSITIVE, f64::max);
    let mut series = Vec::new();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (i, (gear, [x, y, turn])) in bodies().enumerate() {
        let of_name = names.iter().position(|known| *known == family(&gear.name));
        let colour = of_name.filter(|_| !is_one).unwrap_or(i);
        series.push(circle(gear.centre, gear.radius, REST, Style::Hairline));
        let at = [gear.centre[0] + scale * x, gear.centre[1] + scale * y];
        series.push(circle(at, gear.radius, colour, Style::Line));
        let (sin, cos) = libm::sincos(scale * turn);
        let spoke = |centre: f64, along: f64| vec![MM * centre, MM * (centre + gear.radius * along)];
        series.push(Series::line("", colour, spoke(at[0], cos), spoke(at[1], sin)));
        for i in 0..2 {
            let ends = [gear.centre[i].min(at[i]) - 1.05 * gear.radius, gear.centre[i].max(at[i]) + 1.05 * gear.radius];
            low[i] = low[i].min(MM * ends[0]);
            high[i] = high[i].max(MM * ends[1]);
        }
    }
    let twice = match row.multiplicity {
        1 => String::new(),
        n => format!(" ({n} times)"),
    };
    let (part, share) = row.shares.first().cloned().unwrap_or_default();
    Panel {
        title: format!("{}: {:.1} Hz{twice}, {part} {:.0} %", row.name, row.hertz, 100.0 * share),
        x: Axis::new("x", "mm").between(low[0], high[0]),
        y: Axis::new("y", "mm").between(low[1], high[1]),
        equal_scales: true,
        series,
        ..Panel::default()
    }
}

fn circle(centre: [f64; 2], radius: f64, colour: usize, style: Style) -> Series {
    let angles = (0..=72).map(|i| TAU * f64::from(i) / 72.0);
    let point = |a: f64| (MM * (centre[0] + radius * libm::cos(a)), MM * (centre[1] + radius * libm::sin(a)));
    let (x, y) = angles.map(point).unzip();
    Series::line("", colour, x, y).styled(style)
}
