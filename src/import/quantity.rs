//! Attributes in SI units.

use super::{ledger::Ledger, model::Component};

/// Kind of a quantity, with the unit of the scene for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    /// Length, m.
    Length,
    /// Angle, degrees.
    Angle,
    /// Speed, rev/min.
    Speed,
    /// Torque, N m.
    Torque,
    /// Stiffness, N/m.
    Stiffness,
    /// Torsional stiffness, N m/rad.
    Torsion,
    /// Density, kg/m³.
    Density,
    /// Mass, kg.
    Mass,
    /// Stiffness per face width, N/m².
    PerWidth,
    /// Number without a unit.
    One,
}

impl Unit {
    /// Returns the factor from a written unit to that of the scene; without one, the unit of the format holds.
    fn factor(self, written: &str) -> Option<f64> {
        let written: String = written.chars().filter(|c| !c.is_whitespace()).collect();
        let written = written.replace(['µ', 'μ'], "mu").replace(['·', '^'], "");
        let table: &[(&str, f64)] = match self {
            Self::Length => &[("mm", 1e-3), ("m", 1.0), ("mum", 1e-6), ("mumm", 1e-6)],
            Self::Angle => &[("deg", 1.0), ("degree", 1.0), ("°", 1.0), ("rad", 180.0 / std::f64::consts::PI)],
            Self::Speed => &[("1/min", 1.0), ("rpm", 1.0), ("1/s", 60.0), ("rad/s", 30.0 / std::f64::consts::PI)],
            Self::Torque => &[("Nm", 1.0), ("Nmm", 1e-3), ("kNm", 1e3)],
            Self::Stiffness => &[("N/m", 1.0), ("N/mm", 1e3), ("N/mum", 1e6), ("kN/mm", 1e6)],
            Self::Torsion => &[("Nmm/rad", 1e-3), ("Nm/rad", 1.0), ("kNm/rad", 1e3)],
            Self::Density => &[("kg/dm3", 1e3), ("g/cm3", 1e3), ("kg/m3", 1.0), ("kg/mm3", 1e9)],
            Self::Mass => &[("kg", 1.0), ("g", 1e-3)],
            Self::PerWidth => &[("N/(mmmum)", 1e9), ("N/mm/mum", 1e9), ("N/(mm*mum)", 1e9)],
            Self::One => &[("none", 1.0)],
        };
        if written.is_empty() || self == Self::One {
            return Some(table[0].1);
        }
        table.iter().find(|(name, _)| *name == written).map(|(_, factor)| *factor)
    }
}

/// Returns an attribute as a number in the unit of the scene. A value that is not a number is a fault.
pub(super) fn number(ledger: &mut Ledger<'_>, component: &Component, name: &str, unit: Unit) -> Option<f64> {
    let attribute = component.attributes.get(name)?;
    let place = format!("{}: {name}", component.place());
    let Some(value) = attribute.value.number() else {
        ledger.fault(&place, attribute.value.text(), "a number", "mend the file");
        return None;
    };
    let Some(factor) = unit.factor(&attribute.unit) else {
        ledger.fault(
            &place,
            format!("the unit \"{}\"", attribute.unit),
            &format!("a unit of a {unit:?}").to_lowercase(),
            "mend the file",
        );
        return None;
    };
    // A division keeps decimal digits: 36 mm are 0.036 m.
    Some(if factor < 1.0 { value / factor.recip() } else { value * factor })
}

/// Returns an attribute as [`number`] does, with its origin in words.
pub(super) fn given(ledger: &mut Ledger<'_>, component: &Component, name: &str, unit: Unit) -> Option<(f64, String)> {
    let value = number(ledger, component, name, unit)?;
    let attribute = &component.attributes[name];
    Some((
        value,
        format!("{}: {name} {} {}", component.place(), attribute.value.text(), attribute.unit).trim_end().to_owned(),
    ))
}
