//! The instructions that vector code uses: chosen at run time, once for a train.
//!
//! The code is written once, over plain arrays, and compiled for each set of instructions. A set has its own rounding: one that
//! multiplies and adds in one instruction rounds once where another one rounds twice. So a run names its set, and what is compiled for one
//! set gives the same bits on every machine that has it.

use std::fmt;

/// A set of instructions that this processor has.
#[derive(Clone, Copy)]
pub struct Instructions(Set);

#[derive(Clone, Copy)]
enum Set {
    Baseline(Baseline),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
}

/// What every processor of its architecture has.
#[derive(Clone, Copy)]
pub(crate) struct Baseline;

/// Its name.
const BASELINE: &str = if cfg!(target_arch = "x86_64") {
    "sse2"
} else if cfg!(target_arch = "aarch64") {
    "neon"
} else {
    "portable"
};

/// Proof that the processor has a set, and the way into code compiled for it.
pub(crate) trait Path: Copy {
    /// Whether `a b + c` is one instruction, rounded once.
    const IS_FUSED: bool;

    /// Does `work`, compiled for the set as far as it is inlined.
    fn run<W: Work>(self, work: W) -> W::Output;
}

impl Path for Baseline {
    const IS_FUSED: bool = cfg!(target_arch = "aarch64");

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        work.on::<Self>()
    }
}

#[cfg(target_arch = "x86_64")]
impl Path for pulp::x86::V3 {
    const IS_FUSED: bool = true;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        self.vectorize(OnAvx2(work))
    }
}

/// A closure would be a function of its own, compiled for the baseline.
#[cfg(target_arch = "x86_64")]
struct OnAvx2<W>(W);

#[cfg(target_arch = "x86_64")]
impl<W: Work> pulp::NullaryFnOnce for OnAvx2<W> {
    type Output = W::Output;

    #[inline(always)]
    fn call(self) -> W::Output {
        self.0.on::<pulp::x86::V3>()
    }
}

/// Work that is compiled once for each set.
pub(crate) trait Work {
    /// What comes of it.
    type Output;

    /// Does it, compiled for `P`.
    fn on<P: Path>(self) -> Self::Output;
}

impl Instructions {
    /// The names of all sets: `avx2`, AVX2 and FMA, which x86-64 processors have had since 2013; what all x86-64 processors (`sse2`), all
    /// ARM processors of 64 bits (`neon`) and all others have.
    pub const NAMES: [&str; 4] = ["avx2", "sse2", "neon", "portable"];

    /// The best that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::named("avx2").unwrap_or(Self(Set::Baseline(Baseline)))
    }

    /// The set of this name; `None` where the processor does not have it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            BASELINE => Some(Self(Set::Baseline(Baseline))),
            #[cfg(target_arch = "x86_64")]
            "avx2" => pulp::x86::V3::try_new().map(|set| Self(Set::Avx2(set))),
            _ => None,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Baseline(_) => BASELINE,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(_) => "avx2",
        }
    }

    /// Does `work` by these instructions.
    #[inline(always)]
    pub(crate) fn run<W: Work>(self, work: W) -> W::Output {
        match self.0 {
            Set::Baseline(set) => set.run(work),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(set) => set.run(work),
        }
    }
}

impl fmt::Debug for Instructions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl PartialEq for Instructions {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

/// `a b + c`, in one instruction where there is one.
#[inline(always)]
pub(crate) fn fused<P: Path>(a: f64, b: f64, c: f64) -> f64 {
    if P::IS_FUSED { a.mul_add(b, c) } else { a * b + c }
}
