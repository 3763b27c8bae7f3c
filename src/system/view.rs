//! A structure in terms of its contacts.

use super::{
    assemble::{Structure, dot, zeros},
    contact_mode::{contact_mode, guard_id, guard_of, set_contact},
};
use crate::hybrid::{ContactMode, ContactView, GuardId, Instant, Mode, Transition, Watch};

impl Structure {
    /// Sets contact `j` to `state` in `mode`.
    pub fn set_contact(&self, mode: &mut Mode, j: usize, state: ContactMode) {
        let Some(back) = self.contacts[j].back else { return set_contact(mode, j, state) };
        let [drive, turned] = [(1.0, state), (-1.0, state.turned())]
            .map(|(side, own)| if state.side() == side { own } else { ContactMode::Separated });
        set_contact(mode, j, drive);
        set_contact(mode, back, turned);
    }

    /// Returns the guard of contact `j` for `watch`, on the flank of `side`.
    #[must_use]
    pub fn guard_of_contact(&self, j: usize, side: f64, watch: Watch) -> GuardId {
        match self.contacts[j].back.filter(|_| side < 0.0) {
            Some(back) => guard_id(back, if watch == Watch::Force { watch } else { Watch::DriveFlank }),
            None => guard_id(j, watch),
        }
    }

    /// Iterates over the contacts with latched approach speeds, in order of the state, with the flank side: 0 if one speed serves both.
    pub fn latched(&self) -> impl Iterator<Item = (usize, f64)> {
        let flanks = (0..self.flanks()).filter(|flank| self.contacts[*flank].latch.is_some());
        flanks.map(|flank| match self.contact_of(flank) {
            (j, _) if self.contacts[j].back.is_none() => (j, 0.0),
            of => of,
        })
    }

    /// Returns the index in the state of the approach speed that contact `j` latches on the flank of `side`.
    #[must_use]
    pub fn latch_on(&self, j: usize, side: f64) -> Option<usize> {
        self.contacts[self.contacts[j].back.filter(|_| side < 0.0).unwrap_or(j)].latch
    }
}

impl ContactView for Structure {
    fn contact_count(&self) -> usize {
        self.spec.contacts.len()
    }

    fn contact_name(&self, j: usize) -> &str {
        &self.contacts[j].spec.name
    }

    fn contact_mode(&self, j: usize, mode: &Mode) -> ContactMode {
        use ContactMode::{Back, BackDetached, DriveDetached};
        let (flank, sense) = self.flank_in(mode, j);
        match contact_mode(mode, flank) {
            own if sense > 0.0 => own,
            DriveDetached => BackDetached,
            _ => Back,
        }
    }

    fn watch(&self, id: GuardId) -> (usize, Watch) {
        let (flank, watch) = guard_of(id);
        match self.contact_of(flank) {
            (j, sense) if sense < 0.0 && watch == Watch::DriveFlank => (j, Watch::BackFlank),
            (j, _) => (j, watch),
        }
    }

    fn is_rigid(&self, j: usize) -> bool {
        self.contacts[j].spec.law.is_rigid()
    }

    fn half_backlash(&self, j: usize) -> f64 {
        self.contacts[j].gap()
    }

    fn free_restitution(&self, j: usize, speed: f64) -> Option<f64> {
        let c = &self.contacts[j];
        c.spec.law.free_restitution(speed, c.spec.stiffness.mean(), c.effective_mass())
    }

    fn deflection(&self, j: usize, side: f64, at: Instant, x: &[f64]) -> (f64, f64) {
        match self.contacts[j].back {
            Some(back) if side < 0.0 => {
                let (d, rate) = self.deflection(back, at, x);
                (-d, -rate)
            }
            _ => self.deflection(j, at, x),
        }
    }

    fn transmission(&self, j: usize, x: &[f64]) -> f64 {
        dot(&self.contacts[j].direction, x)
    }

    fn force(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        let (flank, sense) = self.flank_in(mode, j);
        sense * self.carried_by(flank, mode, at, x)
    }

    fn stored(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        self.stored_in(self.acting(mode, self.flank_in(mode, j).0), at, x)
    }

    fn dissipation(&self, j: usize, mode: &Mode, at: Instant, x: &[f64]) -> f64 {
        self.contact_powers(self.acting(mode, self.flank_in(mode, j).0), at, x).0
    }

    fn impulses(&self, transition: &Transition<'_>, out: &mut [f64]) {
        let mut of_flanks = zeros(self.flanks());
        self.impulses_of(transition, &mut of_flanks);
        out.fill(0.0);
        for (flank, impulse) in of_flanks.iter().enumerate() {
            let (j, sense) = self.contact_of(flank);
            out[j] += sense * impulse;
        }
    }
}
