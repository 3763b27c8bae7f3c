//! Instruction sets of vector code, chosen at run time, once for a train.
//!
//! The code is written once, over plain arrays, and compiled for each set of instructions. A set has its own rounding: a fused multiply-add
//! rounds once, where two instructions round twice. So a run names its set, and code compiled for one set gives the same bits on every
//! machine that has it.

use std::{fmt, sync::OnceLock};

/// A set of instructions that this processor has.
#[derive(Clone, Copy)]
pub struct Instructions(Set);

#[derive(Clone, Copy)]
enum Set {
    Baseline(Baseline),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
}

/// Set of instructions that every processor of its architecture has.
#[derive(Clone, Copy)]
pub(crate) struct Baseline;

/// Name of the baseline set.
const BASELINE: &str = if cfg!(target_arch = "x86_64") {
    "sse2"
} else if cfg!(target_arch = "aarch64") {
    "neon"
} else {
    "portable"
};

/// Proof that the processor has a set, and the entry into code compiled for it.
pub(crate) trait Path: Copy {
    /// True if `a b + c` is one instruction, rounded once.
    const IS_FUSED: bool;

    /// Four numbers side by side: a register, if the set has one that wide.
    type Four: Copy;

    /// Does `work`, compiled for the set as far as it is inlined.
    fn run<W: Work>(self, work: W) -> W::Output;

    /// Returns four numbers as one vector.
    fn four(self, x: [f64; 4]) -> Self::Four;

    /// Returns one number in all four places.
    fn all(self, x: f64) -> Self::Four;

    /// Returns the numbers of a vector.
    fn numbers(self, x: Self::Four) -> [f64; 4];

    /// Returns `a b`, element by element.
    fn times(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// Returns `a + b`, element by element.
    fn plus(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// Returns `a − b`, element by element.
    fn minus(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// Returns `a / b`, element by element.
    fn over(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// Returns `|a|`, element by element.
    fn sizes(self, a: Self::Four) -> Self::Four;

    /// Returns the larger element of each pair; b where a is NaN.
    fn larger(self, a: Self::Four, b: Self::Four) -> Self::Four;

    /// Returns `a b + c` element by element, rounded as by [`fused`].
    fn fused(self, a: Self::Four, b: Self::Four, c: Self::Four) -> Self::Four;

    /// Returns a bit for each element, set if `a > b`; the lowest bit is the first element.
    fn above(self, a: Self::Four, b: Self::Four) -> u32;

    /// Returns the elements of x where `a > b`, and of y elsewhere.
    fn where_above(self, a: Self::Four, b: Self::Four, x: Self::Four, y: Self::Four) -> Self::Four;
}

/// Applies `f` to four pairs.
#[inline(always)]
fn zip(a: [f64; 4], b: [f64; 4], f: impl Fn(f64, f64) -> f64) -> [f64; 4] {
    std::array::from_fn(|l| f(a[l], b[l]))
}

impl Path for Baseline {
    const IS_FUSED: bool = cfg!(target_arch = "aarch64");

    type Four = [f64; 4];

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        work.on(self)
    }

    #[inline(always)]
    fn four(self, x: [f64; 4]) -> [f64; 4] {
        x
    }

    #[inline(always)]
    fn all(self, x: f64) -> [f64; 4] {
        [x; 4]
    }

    #[inline(always)]
    fn numbers(self, x: [f64; 4]) -> [f64; 4] {
        x
    }

    #[inline(always)]
    fn times(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn plus(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn minus(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn over(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn sizes(self, a: [f64; 4]) -> [f64; 4] {
        a.map(f64::abs)
    }

    #[inline(always)]
    fn larger(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn fused(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|l| fused::<Self>(a[l], b[l], c[l]))
    }

    #[inline(always)]
    fn above(self, a: [f64; 4], b: [f64; 4]) -> u32 {
        (0..4).fold(0, |bits, l| bits | u32::from(a[l] > b[l]) << l)
    }

    #[inline(always)]
    fn where_above(self, a: [f64; 4], b: [f64; 4], x: [f64; 4], y: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|l| if a[l] > b[l] { x[l] } else { y[l] })
    }
}

#[cfg(target_arch = "x86_64")]
impl Path for pulp::x86::V3 {
    const IS_FUSED: bool = true;

    type Four = pulp::f64x4;

    #[inline(always)]
    fn run<W: Work>(self, work: W) -> W::Output {
        self.vectorize(OnAvx2(self, work))
    }

    #[inline(always)]
    fn four(self, x: [f64; 4]) -> pulp::f64x4 {
        pulp::cast(x)
    }

    #[inline(always)]
    fn all(self, x: f64) -> pulp::f64x4 {
        self.splat_f64x4(x)
    }

    #[inline(always)]
    fn numbers(self, x: pulp::f64x4) -> [f64; 4] {
        pulp::cast(x)
    }

    #[inline(always)]
    fn times(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.mul_f64x4(a, b)
    }

    #[inline(always)]
    fn plus(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.add_f64x4(a, b)
    }

    #[inline(always)]
    fn minus(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        self.sub_f64x4(a, b)
    }

    #[inline(always)]
    fn over(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        pulp::cast(self.avx._mm256_div_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn sizes(self, a: pulp::f64x4) -> pulp::f64x4 {
        self.abs_f64x4(a)
    }

    #[inline(always)]
    fn larger(self, a: pulp::f64x4, b: pulp::f64x4) -> pulp::f64x4 {
        pulp::cast(self.avx._mm256_max_pd(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn fused(self, a: pulp::f64x4, b: pulp::f64x4, c: pulp::f64x4) -> pulp::f64x4 {
        self.mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn above(self, a: pulp::f64x4, b: pulp::f64x4) -> u32 {
        // The sign of a mask is the bit.
        self.avx._mm256_movemask_pd(pulp::cast(self.cmp_gt_f64x4(a, b))) as u32
    }

    #[inline(always)]
    fn where_above(self, a: pulp::f64x4, b: pulp::f64x4, x: pulp::f64x4, y: pulp::f64x4) -> pulp::f64x4 {
        self.select_f64x4(self.cmp_gt_f64x4(a, b), x, y)
    }
}

/// A closure would be a separate function, compiled for the baseline.
#[cfg(target_arch = "x86_64")]
struct OnAvx2<W>(pulp::x86::V3, W);

#[cfg(target_arch = "x86_64")]
impl<W: Work> pulp::NullaryFnOnce for OnAvx2<W> {
    type Output = W::Output;

    #[inline(always)]
    fn call(self) -> W::Output {
        self.1.on(self.0)
    }
}

/// Work that is compiled once for each set.
pub(crate) trait Work {
    /// Result of the work.
    type Output;

    /// Does the work, compiled for the set of `path`.
    fn on<P: Path>(self, path: P) -> Self::Output;
}

/// The set chosen for all trains of this process.
static CHOSEN: OnceLock<Instructions> = OnceLock::new();

impl Instructions {
    /// Names of all sets: `avx2` is AVX2 and FMA, in x86-64 processors since 2013. The others are what all x86-64 processors (`sse2`), all
    /// 64-bit ARM processors (`neon`) and all other processors have.
    pub const NAMES: [&str; 4] = ["avx2", "sse2", "neon", "portable"];

    /// Returns the best set of this processor, or the set chosen for the process.
    #[must_use]
    pub fn best() -> Self {
        CHOSEN.get().copied().or_else(|| Self::named("avx2")).unwrap_or(Self(Set::Baseline(Baseline)))
    }

    /// Makes this set the best for the rest of the process, so that all machines of a cluster give the same bits. The first call counts.
    pub fn choose(self) {
        let _ = CHOSEN.set(self);
    }

    /// Returns the set of this name; `None` if the processor does not have it.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            BASELINE => Some(Self(Set::Baseline(Baseline))),
            #[cfg(target_arch = "x86_64")]
            "avx2" => pulp::x86::V3::try_new().map(|set| Self(Set::Avx2(set))),
            _ => None,
        }
    }

    /// Returns the name of the set.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Baseline(_) => BASELINE,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(_) => "avx2",
        }
    }

    /// Does `work` with these instructions.
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

/// Returns `a b + c`, in one instruction where the set has one.
#[inline(always)]
pub(crate) fn fused<P: Path>(a: f64, b: f64, c: f64) -> f64 {
    if P::IS_FUSED { a.mul_add(b, c) } else { a * b + c }
}
