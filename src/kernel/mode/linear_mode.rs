//! Numbers of a linear mode from which its propagator is formed.

use std::hash::{DefaultHasher, Hasher};

use smallvec::SmallVec;

use super::{
    fold::Fold,
    motion::{ContactInMode, ModeGuard},
};
use crate::{
    hybrid::Wide,
    kernel::Motion,
    system::{Contact, Elasticity, Force, LoadWave, Oscillator, Sparse, Spring, Watch, Wave},
    vectors::Instructions,
};

/// All numbers from which a propagator is formed: code that forms one sees nothing else, so that equal modes have equal propagators, but
/// for the signs of zeros. Places of flanks, restitution and, under constant stiffnesses, the size of the load are not among them.
#[derive(Debug, PartialEq)]
pub struct LinearMode {
    /// Number of degrees of freedom.
    pub n: usize,
    pub instructions: Instructions,
    /// L and Ω of the mode, 1/s.
    pub rate: f64,
    pub frequency: f64,
    /// Frequency of the clock, rad/s.
    pub clock: f64,
    /// True if some stiffness is a series.
    pub is_varying: bool,
    /// `√M_ii`.
    pub weights: Vec<f64>,
    /// Accelerations by the constant load over the largest of them.
    pub load: Vec<Wide>,
    /// Accelerations by the constant load, if some stiffness is a series: the load is then no input of its own.
    pub whole_load: Vec<f64>,
    pub load_waves: Vec<LoadWave>,
    pub oscillators: Vec<Oscillator>,
    /// Rows of `M⁻¹K` and `M⁻¹C` without contacts.
    pub rows: Vec<Vec<(u32, f64, f64)>>,
    pub contacts: Vec<LinearContact>,
    pub guards: Vec<LinearGuard>,
    pub fold: Fold,
}

/// Guard of a linear mode; the flank that it watches is not a part of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearGuard {
    pub contact: usize,
    /// Number among the guards of its contact.
    pub number: usize,
    /// True if it watches a force.
    pub is_force: bool,
}

/// Contact of a linear mode; fields as those of [`Contact`].
#[derive(Debug, PartialEq)]
pub struct LinearContact {
    pub direction: Sparse,
    pub push: Sparse,
    pub error: Vec<Wave>,
    pub error_rate: Vec<Wave>,
    pub error_sizes: [f64; 3],
    pub across: f64,
    pub push_norm: f64,
    pub stiffest: f64,
    /// Stiffness and damping of its law, carried or only watched.
    pub law: Option<(Elasticity, f64)>,
    /// True if the force of its law is carried.
    pub is_carried: bool,
    /// Stiffness that follows the forcing, if the law acts.
    pub spring: Option<Spring>,
}

impl LinearContact {
    /// Returns the damping of its law; zero without one.
    pub fn damping(&self) -> f64 {
        self.law.map_or(0.0, |(_, damping)| damping)
    }

    /// Returns stiffness and damping of its law, if the stiffness is constant.
    pub fn constant(&self) -> Option<[f64; 2]> {
        match self.law {
            Some((Elasticity::Constant(k), damping)) => Some([k, damping]),
            _ => None,
        }
    }
}

/// Returns the largest acceleration by a constant load: with the direction alone in the columns, all its sizes share them.
pub fn load_size(load: &[f64]) -> f64 {
    load.iter().fold(0.0, |m: f64, f| m.max(f.abs()))
}

impl LinearMode {
    /// Returns a hash of the numbers that usually differ from mode to mode.
    pub fn hash(&self) -> u64 {
        let waves = self.load_waves.iter().flat_map(|wave| wave.cosine.iter().chain(&wave.sine));
        let of_contact = |c: &LinearContact| {
            let [k, damping] = c.constant().unwrap_or_default();
            let errors = c.error.iter().flat_map(|wave| [wave.cosine, wave.sine]);
            errors.chain([k, damping, c.across, f64::from(u8::from(c.is_carried))]).collect::<SmallVec<[f64; 16]>>()
        };
        let mut hasher = DefaultHasher::new();
        let mut add = |number: f64| hasher.write_u64(number.to_bits());
        [self.rate, self.frequency].into_iter().for_each(&mut add);
        self.oscillators.iter().for_each(|oscillator| add(oscillator.omega));
        self.load.iter().map(|load| load.hi).chain(self.whole_load.iter().copied()).for_each(&mut add);
        waves.copied().for_each(&mut add);
        self.contacts.iter().flat_map(of_contact).for_each(add);
        hasher.finish()
    }

    pub fn new(motion: &Motion, fold: Fold) -> Self {
        let s = motion.structure;
        let size = load_size(&s.load);
        let direction = |f: &f64| if size > 0.0 { Wide::quotient((*f).into(), size) } else { Wide::default() };
        let contact = |(part, c): (&ContactInMode, &Contact)| LinearContact {
            direction: c.direction.clone(),
            push: c.push.clone(),
            error: c.error.clone(),
            error_rate: c.error_rate.clone(),
            error_sizes: c.error_sizes,
            across: c.across,
            push_norm: c.push_norm,
            stiffest: c.stiffest,
            law: match part.force() {
                Some(Force::Linear { stiffness, damping }) => Some((stiffness, damping)),
                _ => None,
            },
            is_carried: part.acting.is_some_and(|acting| acting.is_carried),
            spring: part.acting.and(matches!(c.spring, Spring::Waves(..)).then(|| c.spring.clone())),
        };
        let of_contact = |guards: &[ModeGuard]| {
            let guard = |(number, g): (usize, &ModeGuard)| LinearGuard {
                contact: g.contact,
                number,
                is_force: g.watch == Watch::Force,
            };
            guards.iter().enumerate().map(guard).collect::<SmallVec<[_; 3]>>()
        };
        Self {
            n: s.n,
            instructions: s.instructions,
            rate: motion.growth.rate(),
            frequency: motion.growth.frequency(),
            clock: s.clock.omega(),
            is_varying: motion.is_varying,
            weights: s.weights.clone(),
            load: s.load.iter().map(direction).collect(),
            whole_load: if motion.is_varying { s.load.clone() } else { Vec::new() },
            load_waves: s.load_waves.clone(),
            oscillators: s.oscillators.clone(),
            rows: s.rows.clone(),
            contacts: motion.parts.iter().zip(&s.contacts).map(contact).collect(),
            guards: motion.guards.chunk_by(|a, b| a.contact == b.contact).flat_map(of_contact).collect(),
            fold,
        }
    }
}
