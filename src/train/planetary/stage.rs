//! Geometry of a stage from its gears.

use super::Teeth;
use crate::gear::phase::sun_to_ring_phase;
use crate::gear::{BasicRack, Gear, GeometryError, MeshGeometry, MeshKind};

/// The gears of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageGeometry {
    /// Common reference rack.
    pub rack: BasicRack,
    /// Sun.
    pub sun: Gear,
    /// Planets.
    pub planet: Gear,
    /// Ring.
    pub ring: Gear,
    /// Face width b, m.
    pub face_width: f64,
}

impl StageGeometry {
    /// Tooth numbers.
    #[must_use]
    pub fn teeth(&self) -> Teeth {
        Teeth { sun: self.sun.teeth, planet: self.planet.teeth, ring: self.ring.teeth }
    }

    /// Sun mesh; the sun drives.
    ///
    /// # Errors
    /// [`GeometryError`] if sun and planet cannot mesh.
    pub fn sun_mesh(&self) -> Result<MeshGeometry, GeometryError> {
        MeshGeometry::new(&self.rack, self.sun, self.planet, MeshKind::External)
    }

    /// Ring mesh; the planet drives.
    ///
    /// # Errors
    /// [`GeometryError`] if planet and ring cannot mesh.
    pub fn ring_mesh(&self) -> Result<MeshGeometry, GeometryError> {
        MeshGeometry::new(&self.rack, self.planet, self.ring, MeshKind::Internal)
    }

    /// Phase between the two meshes of a planet γ_rs, periods.
    #[must_use]
    pub fn ring_phase(&self) -> f64 {
        sun_to_ring_phase(&self.rack, self.sun, self.planet, self.ring)
    }
}
