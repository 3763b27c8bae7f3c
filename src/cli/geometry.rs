//! The meshes of trains with teeth, told in words.

use std::fmt::Write;

use flank::{
    gear::{MeshGeometry, phase},
    output::{Table, five_digits as number},
};
use serde_json::Value;

/// Geometry and phases of the meshes of a resolved scene; nothing for trains without teeth.
pub fn text(scene: &Value, meshes: &[(&str, MeshGeometry)]) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    if !meshes.is_empty() {
        let head = ["mesh", "working angle deg", "centre distance mm", "base radii mm", "contact ratio"];
        let rows = meshes.iter().map(|(name, g)| {
            let [one, two] = g.base_radii.map(|r| number(1e3 * r));
            let [angle, distance] = [g.pressure_angle.to_degrees(), 1e3 * g.centre_distance].map(number);
            vec![(*name).to_owned(), angle, distance, format!("{one} {two}"), number(g.path.contact_ratio())]
        });
        write!(out, "\nMesh geometry\n{}", Table::new(head).with(rows))?;
    }
    let train = &scene["train"];
    Ok(if train["kind"] == "planetary" { out + &phases(train)? } else { out })
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
