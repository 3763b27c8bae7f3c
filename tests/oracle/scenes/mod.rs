//! Random scenes, one function a class. The letters are those of the project's list of what must hold.

pub mod derivatives;
mod gearboxes;
mod laws;
mod masses;
mod measured;
mod pairs;
mod random;
mod schedules;
mod special;
mod stages;
mod transforms;

use std::time::Duration;

use random::Random;
use serde_json::Value;
pub use special::PRESSED;
pub use transforms::{Extreme, Transform};

/// A class: its letter, what it holds, and scene number n under a seed.
pub struct Class {
    pub letter: &'static str,
    pub about: &'static str,
    make: fn(&mut Random) -> Value,
}

impl Class {
    /// Time that Flank may take: five seconds where the cost is what counts.
    pub fn limit(&self, usual: Duration) -> Duration {
        if self.letter == "I" { usual.min(Duration::from_secs(5)) } else { usual }
    }

    pub fn scene(&self, seed: u64, index: usize) -> Value {
        (self.make)(&mut Random::new(seed, self.letter, index))
    }
}

const fn class(letter: &'static str, about: &'static str, make: fn(&mut Random) -> Value) -> Class {
    Class { letter, about, make }
}

/// All classes.
pub static CLASSES: [Class; 21] = [
    class("A", "rest and release", masses::rest_and_release),
    class("B", "pair from rest, errors at phase 0", pairs::from_rest),
    class("C", "pair started on a flank", pairs::on_flank),
    class("D", "soft pairs, any phases", pairs::soft_pairs),
    class("E", "power laws", pairs::powers),
    class("F", "soft torsional stages", stages::soft_stages),
    class("G", "rigid torsional stages", stages::rigid_stages),
    class("I", "cost: near-singular mass, stiff power law", special::cost),
    class("J", "mixed laws", masses::mixed),
    class("K", "kinds of stiffness", schedules::kinds),
    class("L", "two exponents in one train", special::two_exponents),
    class("N", "starts: inside, pulling, on a switch", special::starts),
    class("P", "scan of phases", special::phases),
    class("Q", "detached modes", special::detached),
    class("R", "loads in steps and ramps", measured::loads),
    class("T", "curves of measured points", measured::curves),
    class("U", "restitution by speed", masses::restitution_by_speed),
    class("V", "ill-conditioned mass matrices", masses::ill_conditioned),
    class("Z", "flanks that differ, dampers in the gap", measured::flanks),
    class("Y", "gearboxes", gearboxes::gearboxes),
    class("S", "symmetric soft stages, simultaneous events", stages::symmetric),
];

/// Class O: scene number `index` and its transform.
pub fn transform(seed: u64, index: usize) -> Transform {
    transforms::transform(&mut Random::new(seed, "O", index))
}

/// Class X: scene number `index`.
pub fn extreme(seed: u64, index: usize) -> Extreme {
    transforms::extreme(&mut Random::new(seed, "X", index))
}

/// Class H: scene number `index`.
pub fn periodic(seed: u64, index: usize) -> Value {
    special::periodic(&mut Random::new(seed, "H", index))
}
