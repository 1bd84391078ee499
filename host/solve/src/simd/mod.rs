//! Four `f64` side by side: the vectors of the elimination's kernels and of the base model's fast kernel.
//!
//! A [`Simd`] is a token that proves at run time what the machine has; [`vectorised`] picks the best one and runs a [`Work`] compiled
//! for it. On x86-64 with AVX2 and FMA a vector is one register (through `pulp`, so that no `unsafe` is needed here); elsewhere it is a
//! plain array that the compiler does what it can with. Results differ between the two by rounding only: one fuses multiply-adds.
//!
//! Everything that runs inside a work must be `#[inline(always)]`: only what is inlined is compiled for the chosen instruction set. Closures are not
//! always, those of `array::map` and of adapters least: loops over vectors are written out.

mod plain;
mod wide;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use plain::Plain;
pub use wide::Wide;

/// Values in a vector.
pub const LANES: usize = 4;

/// Storage of a vector in memory, aligned so that loading it never touches two cache lines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(32))]
pub struct Quad(pub [f64; LANES]);

/// The operations on vectors of four, by a token of the instruction set.
pub trait Simd: Copy + Send + Sync {
    /// The vector in registers.
    type Vector: Copy;
    /// The same value in all lanes.
    fn splat(self, value: f64) -> Self::Vector;
    /// From memory.
    fn load(self, values: &[f64; LANES]) -> Self::Vector;
    /// To memory.
    fn store(self, vector: Self::Vector) -> [f64; LANES];
    /// From memory in single precision.
    fn load_single(self, values: &[f32; LANES]) -> Self::Vector;
    /// To memory in single precision.
    fn store_single(self, vector: Self::Vector) -> [f32; LANES];
    /// a + b.
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a − b.
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a b.
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a / b.
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// a b + c.
    fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// c − a b.
    fn mul_sub_from(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// √a.
    fn sqrt(self, a: Self::Vector) -> Self::Vector;
    /// The nearest integers.
    fn round(self, a: Self::Vector) -> Self::Vector;
    /// The transpose of a 4×4 block.
    fn transpose(self, rows: [Self::Vector; LANES]) -> [Self::Vector; LANES];

    /// Runs `work`, compiled for the same instruction set, as a function of its own where the machine gains by that: for a loop that is used in many
    /// places, so that its instructions stay at hand.
    fn apart<W: Work>(self, work: W) -> W::Output;
}

/// A piece of work that is compiled for every instruction set.
pub trait Work {
    /// What the work returns.
    type Output;
    /// Does the work. Implementations mark this `#[inline(always)]`.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Runs `work` with the best instruction set that this machine has.
pub fn vectorised<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = pulp::x86::V3::try_new() {
        return v3.vectorize(x86::With(work, v3));
    }
    work.run(Plain)
}

/// Runs `f` compiled for the best instruction set that this machine has: for code that the compiler finds the vectors in itself. Only what is inlined
/// into it gains.
#[inline(always)]
pub fn compiled_for_this_machine<R>(f: impl FnOnce() -> R) -> R {
    struct Plainly<F>(F);
    impl<R, F: FnOnce() -> R> Work for Plainly<F> {
        type Output = R;
        #[inline(always)]
        fn run<S: Simd>(self, _simd: S) -> R {
            (self.0)()
        }
    }
    vectorised(Plainly(f))
}

/// The columns of four rows, as long as `to`: column j of all of them becomes `to[j]`.
#[inline(always)]
pub fn columns<S: Simd>(simd: S, rows: [&[f64]; LANES], to: &mut [Quad]) {
    debug_assert!(rows.iter().all(|row| row.len() == to.len()), "{:?} columns of {}", rows.map(<[f64]>::len), to.len());
    let whole = to.len() - to.len() % LANES;
    let [(a, _), (b, _), (c, _), (d, _)] = [
        rows[0].as_chunks::<LANES>(),
        rows[1].as_chunks::<LANES>(),
        rows[2].as_chunks::<LANES>(),
        rows[3].as_chunks::<LANES>(),
    ];
    for ((((to, a), b), c), d) in to.as_chunks_mut::<LANES>().0.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        let [p, q, r, s] = simd.transpose([simd.load(a), simd.load(b), simd.load(c), simd.load(d)]);
        (to[0].0, to[1].0) = (simd.store(p), simd.store(q));
        (to[2].0, to[3].0) = (simd.store(r), simd.store(s));
    }
    for (j, to) in to.iter_mut().enumerate().skip(whole) {
        to.0 = [rows[0][j], rows[1][j], rows[2][j], rows[3][j]];
    }
}

/// Asks for memory that will soon be read or written, so that nothing waits for it then. Memory that is gone through backwards, or written only,
/// no machine sees coming by itself.
#[inline(always)]
pub fn fetch<T>(memory: &[T]) {
    #[cfg(target_arch = "x86_64")]
    if let Some(sse) = pulp::core_arch::x86::Sse::try_new() {
        const LINE_BYTES: usize = 64;
        let Some(in_line) = LINE_BYTES.checked_div(size_of::<T>()) else { return };
        for line in memory.chunks(in_line.max(1)) {
            sse._mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(line.as_ptr().cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = memory;
}
