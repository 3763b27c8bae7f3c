//! Rigid contacts that touch with gap and rate zero: which of them carry force, and how much.
//!
//! At every order of the series the accelerations of the gaps and the multipliers are complementary. A contact with
//! both zero is left to the next order: the first derivative that is not zero decides.

use super::{
    linear::{complementary, least},
    model::Model,
    wide::{Wide, near, wide},
};

/// A share of its terms below which a number is a zero left over by rounding in 32 digits.
pub const NOTHING: f64 = 1e-23;
/// A share below which doubles cannot tell its sign.
pub const DOUBTFUL: f64 = 1e-13;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    Closed,
    Undecided,
    Open,
}

#[derive(Clone, Copy, Debug)]
pub struct HeldContact {
    pub contact: usize,
    pub side: f64,
    pub fate: Fate,
    /// Zeros at the start: of the gap of an open one; two more than those of the force of a closed one.
    pub zeros: usize,
}

#[derive(Default)]
pub struct Rest {
    pub contacts: Vec<HeldContact>,
    /// Why it could not be decided.
    pub doubt: Option<String>,
}

impl Rest {
    /// Contacts that stay at rest.
    pub fn hold(contacts: impl Iterator<Item = (usize, f64)>) -> Self {
        Self::with(contacts, Fate::Closed)
    }

    /// Contacts to decide upon.
    pub fn decide(contacts: impl Iterator<Item = (usize, f64)>) -> Self {
        Self::with(contacts, Fate::Undecided)
    }

    fn with(contacts: impl Iterator<Item = (usize, f64)>, fate: Fate) -> Self {
        let contacts = contacts.map(|(contact, side)| HeldContact { contact, side, fate, zeros: 2 }).collect();
        Self { contacts, doubt: None }
    }

    pub fn is_decided(&self) -> bool {
        self.contacts.iter().all(|h| h.fate != Fate::Undecided)
    }

    /// Forces `σλ` at order k, from the accelerations along each contact that there would be without them.
    pub fn solve(&mut self, m: &Model, k: usize, needs: &[(Wide, f64)]) -> Vec<Wide> {
        let here: Vec<usize> = (0..self.contacts.len()).filter(|i| self.contacts[*i].fate != Fate::Open).collect();
        let held = |i: usize| self.contacts[i];
        let a: Vec<Vec<Wide>> = here
            .iter()
            .map(|i| {
                let (x, sign) = (held(*i), |j: usize| wide(held(*i).side * held(j).side));
                here.iter().map(|j| sign(*j) * m.mobility[x.contact][held(*j).contact]).collect()
            })
            .collect();
        let b: Vec<Wide> = here.iter().map(|i| -(wide(held(*i).side) * needs[*i].0)).collect();
        let mut forces = vec![wide(0.0); self.contacts.len()];
        let closed: Vec<bool> = here.iter().map(|i| held(*i).fate == Fate::Closed).collect();
        if closed.iter().all(|c| *c) {
            let x = least(&a, &b.iter().map(|b| -*b).collect::<Vec<_>>());
            here.iter().zip(x).for_each(|(i, x)| forces[*i] = x);
            return forces;
        }
        let scale = here.iter().map(|i| needs[*i].1).fold(0.0, f64::max);
        let Some(found) = complementary(&a, &b, &closed, NOTHING * scale) else {
            self.doubt = Some(format!("no set of contacts at rest fits at order {k}"));
            return forces;
        };
        for (n, i) in here.iter().enumerate() {
            forces[*i] = found.x[n];
            let held = &mut self.contacts[*i];
            if held.fate != Fate::Undecided {
                continue;
            }
            let force = near(found.x[n]) * near(a[n][n]);
            let away = near(found.w[n]);
            if away > NOTHING * scale {
                held.fate = Fate::Open;
                held.zeros = k + 2;
            } else if force > NOTHING * scale {
                held.fate = Fate::Closed;
                held.zeros = k + 2;
            }
            let clear = away.max(force);
            if clear > NOTHING * scale && clear < DOUBTFUL * scale {
                self.doubt = Some(format!("contact {} presses or pulls by a share {:e}", held.contact, clear / scale));
            }
        }
        forces
    }
}
