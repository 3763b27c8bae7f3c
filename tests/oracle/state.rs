//! Where a motion stands.

use flank::hybrid::ContactMode;

use super::{
    linear::dot,
    model::{Law, Model},
    wide::{Wide, near, wide},
};

/// One contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    pub mode: ContactMode,
    /// The flank it touches or is near: +1 drive, −1 back.
    pub side: f64,
    /// Derivatives of the gap that are zero at this instant, the gap itself included.
    pub zeros: usize,
    /// The guarded force (or factor of a power law) is zero at this instant.
    pub force_zero: bool,
    /// The gap's first derivative that is not zero is known to be positive: it has bounced, or was let go.
    pub opens: bool,
}

impl Status {
    pub const APART: Self = Self { mode: ContactMode::Separated, side: 1.0, zeros: 0, force_zero: false, opens: false };

    pub fn closed(side: f64) -> ContactMode {
        if side > 0.0 { ContactMode::Drive } else { ContactMode::Back }
    }

    pub fn detached(side: f64) -> ContactMode {
        if side > 0.0 { ContactMode::DriveDetached } else { ContactMode::BackDetached }
    }
}

#[derive(Clone)]
pub struct State {
    pub t: Wide,
    pub q: Vec<Wide>,
    pub v: Vec<Wide>,
    /// Latched approach speeds, one per contact.
    pub latches: Vec<Wide>,
    pub contacts: Vec<Status>,
}

impl State {
    /// Gap to the flank on `side` (negative inside), its rate, and the sizes of the terms of both.
    pub fn gap(&self, m: &Model, j: usize, side: f64) -> (Wide, Wide, f64, f64) {
        let c = &m.contacts[j];
        let (e, rate, error) = m.error(j, self.t);
        let fastest = m.omegas.iter().map(|w| near(*w)).fold(0.0, f64::max);
        let terms = |x: &[Wide]| c.g.iter().zip(x).map(|(g, x)| near(*g * *x).abs()).sum::<f64>();
        let s = wide(side);
        (
            c.b - s * (dot(&c.g, &self.q) - e),
            -s * (dot(&c.g, &self.v) - rate),
            terms(&self.q) + error + near(c.b).abs(),
            terms(&self.v) + error * fastest,
        )
    }

    /// Moves the positions by the least kinetic amount so that the gap is zero.
    pub fn put_on_flank(&mut self, m: &Model, j: usize, side: f64) {
        let off = self.gap(m, j, side).0 * wide(side) / m.mobility[j][j];
        self.q.iter_mut().zip(&m.contacts[j].push).for_each(|(q, p)| *q = *q + *p * off);
    }

    /// A start as docs/EVENTS.md tells it: separated or inside a compliant flank by geometry; within 1e-15 of the terms'
    /// size on a flank.
    pub fn start(m: &Model, t: Wide, q: Vec<Wide>, v: Vec<Wide>) -> Self {
        let latches = m
            .contacts
            .iter()
            .map(|c| if let Law::Power { initial, .. } = c.law { initial } else { wide(0.0) })
            .collect();
        let mut s = Self { t, q, v, latches, contacts: vec![Status::APART; m.contacts.len()] };
        for (j, c) in m.contacts.iter().enumerate() {
            if matches!(c.law, Law::Bilateral(_)) {
                s.contacts[j].mode = ContactMode::Drive;
                continue;
            }
            for side in if c.both { vec![1.0, -1.0] } else { vec![1.0] } {
                let (gap, rate, size, speed) = s.gap(m, j, side);
                if near(gap).abs() <= 1e-15 * size {
                    let still = near(rate).abs() <= 1e-15 * speed;
                    s.contacts[j] = Status { side, zeros: if still { 2 } else { 1 }, ..Status::APART };
                    s.put_on_flank(m, j, side);
                } else if near(gap) < 0.0 {
                    s.contacts[j] = Status { mode: Status::closed(side), side, ..Status::APART };
                }
            }
        }
        s
    }
}
