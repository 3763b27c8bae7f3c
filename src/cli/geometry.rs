//! The meshes of trains with teeth, told in words.

use std::fmt::Write;

use flank::{
    gear::{BasicRack, Gear, MeshGeometry, MeshKind, phase},
    scene::Scene,
};
use serde_json::Value;

use super::table::{Table, number};

/// Geometry and phases of the meshes of a scene; nothing for trains without teeth.
pub fn text(scene: &Scene) -> Result<String, std::fmt::Error> {
    let train = &scene.resolved()["train"];
    match train["kind"].as_str() {
        Some("planetary") => Ok(stage_meshes(train)? + &phases(train)?),
        Some("gear-pair") => {
            let gears = [&train["driving"], &train["driven"]].map(|g| gear(&g["teeth"], &g["profile_shift"]));
            meshes(&train["rack"], &[("mesh", gears, MeshKind::External)])
        }
        _ => Ok(String::new()),
    }
}

fn gear(teeth: &Value, shift: &Value) -> Option<Gear> {
    Some(Gear { teeth: u32::try_from(teeth.as_u64()?).ok()?, shift: shift.as_f64()? })
}

fn stage_meshes(train: &Value) -> Result<String, std::fmt::Error> {
    let rack = &train["rack"];
    let of = |name: &str| gear(&train["teeth"][name], &rack["profile_shift"][name]);
    let (sun, planet, ring) = (of("sun"), of("planet"), of("ring"));
    let pairs = [("sun mesh", [sun, planet], MeshKind::External), ("ring mesh", [planet, ring], MeshKind::Internal)];
    meshes(rack, &pairs)
}

fn angle(object: &Value, stem: &str) -> Option<f64> {
    let degrees = object[format!("{stem}_deg")].as_f64().map(f64::to_radians);
    object[format!("{stem}_rad")].as_f64().or(degrees)
}

fn meshes(rack: &Value, pairs: &[(&str, [Option<Gear>; 2], MeshKind)]) -> Result<String, std::fmt::Error> {
    let number_at = |key: &str| rack[key].as_f64();
    let read = || {
        Some(BasicRack {
            module: number_at("module_m")?,
            pressure_angle: angle(rack, "pressure_angle")?,
            addendum: number_at("addendum")?,
            dedendum: number_at("dedendum")?,
        })
    };
    let Some(rack) = read() else { return Ok(String::new()) };
    let mut table = Table::new(&["mesh", "working angle deg", "centre distance mm", "base radii mm", "contact ratio"]);
    for (name, gears, kind) in pairs {
        let [Some(pinion), Some(wheel)] = *gears else { continue };
        let Ok(g) = MeshGeometry::new(&rack, pinion, wheel, *kind) else { continue };
        let [one, two] = g.base_radii.map(|r| number(1e3 * r));
        table.row(vec![
            (*name).to_owned(),
            number(g.pressure_angle.to_degrees()),
            number(1e3 * g.centre_distance),
            format!("{one} {two}"),
            number(g.path.contact_ratio()),
        ]);
    }
    Ok(format!("\nMesh geometry\n{table}"))
}

/// Positions of the planets and mesh phases as the scene has them.
fn phases(train: &Value) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let listed = |key: &str| train[key].as_array().map(|l| l.iter().filter_map(Value::as_f64).collect::<Vec<f64>>());
    let degrees = listed("positions_deg").map(|l| l.into_iter().map(f64::to_radians).collect());
    let count = train["planets"].as_u64().and_then(|n| usize::try_from(n).ok());
    let positions = listed("positions_rad").or(degrees).or(count.map(phase::equally_spaced)).unwrap_or_default();
    let words = |values: &[f64]| values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ");
    let turned: Vec<f64> = positions.iter().map(|p| p.to_degrees()).collect();
    writeln!(out, "\nPlanets at {} deg, {} planets", words(&turned), positions.len())?;
    match train["phases"].as_str() {
        Some(how) => writeln!(out, "Mesh phases: {how}")?,
        None => writeln!(out, "Mesh phases: sun {}, ring {}", train["phases"]["sun"], train["phases"]["ring"])?,
    }
    if train["phases"] == "teeth" {
        let teeth = |name: &str| train["teeth"][name].as_u64().and_then(|z| u32::try_from(z).ok()).unwrap_or(0);
        let offset = train["ring_phase"].as_f64();
        writeln!(out, "  sun meshes  {} periods", words(&phase::sun_phases(teeth("sun"), &positions)))?;
        let ring = phase::ring_phases(teeth("ring"), &positions, offset.unwrap_or(0.0));
        let note = if offset.is_some() { "" } else { ", plus the phase between a planet's two meshes" };
        writeln!(out, "  ring meshes {} periods{note}", words(&ring))?;
    }
    Ok(out)
}
