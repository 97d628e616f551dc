//! Vector instructions: the kernels' numbers, and which of a processor's instructions a kernel is compiled for.
//!
//! A kernel is written once, over eight and sixteen numbers of a [`Simd`], and compiled for each set of instructions that a
//! processor may have; [`Instructions::run`] enters it. All sets do the same IEEE 754 operations in the same order, none
//! fused, so that which one runs changes no bit.
//!
//! What was learned, on a processor with AVX-512:
//!
//! - Left to itself the compiler takes loops over eight lanes apart into pairs as often as not. Plain loops over long rows,
//!   as in the stages before the cull, it does well, once it may use wide instructions.
//! - To gather costs about a cycle a number, however wide the vector. So what is read together lies together: four texels
//!   are one load ([`Quad`]), and so are the two numbers of an entry of the sensor's table.
//! - A closure in a kernel is compiled by itself first, for any processor. Plain arithmetic still gets into the kernel from
//!   there; operations of [`Simd`] and [`Real`] often stay calls, one each. They belong into functions marked
//!   `#[inline(always)]`.

mod array;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod pair;

use crate::view::Lanes;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// Numbers that are computed with alike: one, or the lanes of a vector.
pub trait Real: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// A truth value for each number.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// One number in all lanes.
    fn splat(number: f32) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// The next lower whole number.
    fn floor(self) -> Self;
    /// `if self > other { self } else { other }`: the other where one is NaN.
    fn max(self, other: Self) -> Self;
    /// `if self < other { self } else { other }`: the other where one is NaN.
    fn min(self, other: Self) -> Self;
    /// Whether they are greater; not where one is NaN.
    fn greater(self, other: Self) -> Self::Mask;
    /// Whether they are as great or greater; not where one is NaN.
    fn at_least(self, other: Self) -> Self::Mask;
    /// The numbers of one where a mask says so, else of the other.
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self;

    /// Without the sign.
    #[inline(always)]
    fn abs(self) -> Self {
        self.max(Self::splat(0.0) - self)
    }

    /// Whether they are not NaN.
    #[inline(always)]
    fn is_number(self) -> Self::Mask {
        self.at_least(self)
    }
}

/// What is asked of a 2 x 2 square of texels: left and right of the upper row, then of the lower one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Quad(pub [f32; 4]);

/// A place in a list for each of sixteen numbers.
pub type Places = [u32; 16];

/// A set of instructions: eight voxels at a time, or as many in each of two layers.
pub trait Simd {
    /// A number for each voxel.
    type Eight: Real;
    /// A number for each voxel in each layer.
    type Sixteen: Real;

    /// Reads lanes.
    fn load(lanes: &Lanes) -> Self::Eight;
    /// Writes lanes.
    fn store(eight: Self::Eight) -> Lanes;
    /// The least of the lanes, none of which is NaN.
    fn least(eight: Self::Eight) -> f32;
    /// The greatest of the lanes, none of which is NaN.
    fn most(eight: Self::Eight) -> f32;
    /// A bit for each lane, the first one's the lowest.
    fn bits(mask: <Self::Eight as Real>::Mask) -> u32;
    /// Writes numbers, cut off.
    ///
    /// # Safety
    /// They are not NaN, and fit in `i32` then.
    unsafe fn store_whole(eight: Self::Eight) -> [i32; 8];
    /// Both layers' numbers.
    fn join(layers: [Self::Eight; 2]) -> Self::Sixteen;
    /// What [`Simd::join`] joins.
    fn split(sixteen: Self::Sixteen) -> [Self::Eight; 2];

    /// Where texels of two images of these widths lie, row by row; rows and columns are whole numbers.
    ///
    /// # Safety
    /// They are at least 0, and fit in `i32` with the result.
    unsafe fn places(rows: Self::Sixteen, columns: Self::Sixteen, widths: [u32; 2]) -> Places;
    /// Reads quads out of two lists, one for each layer: all first numbers, all second ones, and so on.
    ///
    /// # Safety
    /// The places are within the lists.
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self::Sixteen; 4];
    /// Reads a table of pairs at positions between its entries: the first and second numbers of the entries before, and
    /// how far behind those the positions lie.
    ///
    /// # Safety
    /// The positions, cut off, are within the table.
    unsafe fn pairs(table: &[[f32; 2]], positions: Self::Sixteen) -> [Self::Sixteen; 3];
}

/// Work to be done in vector instructions.
pub trait Kernel {
    /// What comes of it.
    type Output;
    /// Does it. To be marked `#[inline(always)]`, as all that it calls: it is compiled with the instructions of its caller.
    fn run<S: Simd>(self) -> Self::Output;
}

/// A set of instructions that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instructions(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    /// What every processor of this kind has.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// The widest.
    #[inline]
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            let avx512 = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq");
            if avx512 && is_x86_feature_detected!("avx512vl") && is_x86_feature_detected!("avx512bw") {
                return Self(Set::Avx512);
            }
            if is_x86_feature_detected!("avx2") {
                return Self(Set::Avx2);
            }
        }
        Self(Set::Portable)
    }

    /// All, from the plainest to the widest.
    pub fn all() -> Vec<Self> {
        let sets = [
            Set::Portable,
            #[cfg(target_arch = "x86_64")]
            Set::Avx2,
            #[cfg(target_arch = "x86_64")]
            Set::Avx512,
        ];
        let widest = sets.iter().position(|&set| Self(set) == Self::widest()).expect("one of them");
        sets[..=widest].iter().map(|&set| Self(set)).collect()
    }

    /// Does some work with these instructions.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Portable => kernel.run::<array::Portable>(),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => {
                #[target_feature(enable = "avx2")]
                fn run<K: Kernel>(kernel: K) -> K::Output {
                    kernel.run::<avx2::Avx2>()
                }
                // SAFETY: there is a value only where the processor has these.
                unsafe { run(kernel) }
            }
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => {
                #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
                fn run<K: Kernel>(kernel: K) -> K::Output {
                    kernel.run::<avx512::Avx512>()
                }
                // SAFETY: there is a value only where the processor has these.
                unsafe { run(kernel) }
            }
        }
    }
}

impl Real for f32 {
    type Mask = bool;

    #[inline(always)]
    fn splat(number: f32) -> Self {
        number
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn floor(self) -> Self {
        self.floor()
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn greater(self, other: Self) -> bool {
        self > other
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> bool {
        self >= other
    }

    #[inline(always)]
    fn select(mask: bool, one: Self, other: Self) -> Self {
        if mask { one } else { other }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::array::from_fn;

    const INFINITY: f32 = f32::INFINITY;

    /// All that rounds, orders or selects in its own way somewhere.
    const ODD: [f32; 16] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -0.5,
        2.5,
        -2.5,
        1e-40,
        3.4e38,
        INFINITY,
        -INFINITY,
        f32::NAN,
        8_388_607.5,
        -1.25,
        7.0,
    ];

    /// Every operation on every pair of numbers.
    struct Operations;

    impl Kernel for Operations {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<S: Simd>(self) -> Vec<u32> {
            let mut bits = Vec::new();
            for shift in 0..16 {
                let halves: [[Lanes; 2]; 2] =
                    [0, shift].map(|shift| from_fn(|half| from_fn(|n| ODD[(8 * half + n + shift) % 16])));
                let [a, b] = [
                    S::join([S::load(&halves[0][0]), S::load(&halves[0][1])]),
                    S::join([S::load(&halves[1][0]), S::load(&halves[1][1])]),
                ];
                let sixteen = operations(a, b);
                for result in sixteen {
                    let [low, high] = S::split(result);
                    bits.extend(S::store(low).into_iter().chain(S::store(high)).map(canonical));
                }
                let [a, b] = [S::load(&halves[0][1]), S::load(&halves[1][1])];
                for result in operations(a, b) {
                    bits.extend(S::store(result).map(canonical));
                }
                bits.push(S::bits(a.greater(b) | a.at_least(S::Eight::splat(1.0)) & b.is_number()));
                let numbers = S::Eight::select(b.is_number(), b, S::Eight::splat(3.0));
                bits.extend([S::least(numbers), S::most(numbers)].map(f32::to_bits));
            }
            bits
        }
    }

    /// Which NaN comes of an operation is nobody's promise.
    fn canonical(number: f32) -> u32 {
        if number.is_nan() { f32::NAN.to_bits() } else { number.to_bits() }
    }

    #[inline(always)]
    fn operations<R: Real>(a: R, b: R) -> [R; 11] {
        [
            a + b,
            a - b,
            a * b,
            a / b,
            a.sqrt(),
            a.floor(),
            a.max(b),
            a.min(b),
            a.abs(),
            R::select(a.greater(b), a, b),
            R::select(a.at_least(b) & b.is_number(), b, a),
        ]
    }

    #[test]
    fn every_set_computes_as_single_numbers_do() {
        let mut expected = Vec::new();
        for shift in 0..16 {
            let pairs: [(f32, f32); 16] = from_fn(|n| (ODD[n], ODD[(n + shift) % 16]));
            for part in [&pairs[..], &pairs[8..]] {
                for operation in 0..11 {
                    expected.extend(part.iter().map(|&(a, b)| canonical(operations(a, b)[operation])));
                }
            }
            let eight = &pairs[8..];
            let is = |&(a, b): &(f32, f32)| a > b || (a >= 1.0 && !b.is_nan());
            expected.push(eight.iter().enumerate().map(|(n, pair)| u32::from(is(pair)) << n).sum());
            let numbers = eight.iter().map(|&(_, b)| if b.is_nan() { 3.0 } else { b });
            expected.push(numbers.clone().fold(INFINITY, f32::min).to_bits());
            expected.push(numbers.fold(-INFINITY, f32::max).to_bits());
        }
        for set in Instructions::all() {
            assert_eq!(set.run(Operations), expected, "{set:?}");
        }
    }

    /// What is read from memory: quads of two lists, and a table.
    struct Lookups<'a> {
        lists: [&'a [Quad]; 2],
        table: &'a [[f32; 2]],
        rows: [Lanes; 2],
        columns: [Lanes; 2],
    }

    impl Kernel for Lookups<'_> {
        type Output = (Places, [[Lanes; 2]; 4], [[Lanes; 2]; 3], [i32; 8]);

        #[inline(always)]
        fn run<S: Simd>(self) -> Self::Output {
            let rows = S::join([S::load(&self.rows[0]), S::load(&self.rows[1])]);
            let columns = S::join([S::load(&self.columns[0]), S::load(&self.columns[1])]);
            // SAFETY: rows, columns and positions are within lists and table.
            unsafe {
                let places = S::places(rows, columns, [5, 3]);
                let [a, b, c, d] = S::quads(self.lists, &places);
                let [e, f, g] = S::pairs(self.table, rows * columns / S::Sixteen::splat(4.0));
                let mut quads = [[[0.0; 8]; 2]; 4];
                for (out, quad) in quads.iter_mut().zip([a, b, c, d]) {
                    let [low, high] = S::split(quad);
                    *out = [S::store(low), S::store(high)];
                }
                let mut pairs = [[[0.0; 8]; 2]; 3];
                for (out, pair) in pairs.iter_mut().zip([e, f, g]) {
                    let [low, high] = S::split(pair);
                    *out = [S::store(low), S::store(high)];
                }
                (places, quads, pairs, S::store_whole(S::load(&self.columns[0])))
            }
        }
    }

    #[test]
    fn every_set_reads_the_same_places() {
        let quad = |n: usize| Quad(from_fn(|k| (10 * n + k) as f32));
        let lists: [Vec<Quad>; 2] = [(0..20).map(quad).collect(), (100..112).map(quad).collect()];
        let table: Vec<[f32; 2]> = (0..8).map(|n| [n as f32, -0.5 * n as f32]).collect();
        let rows: [Lanes; 2] = from_fn(|half| from_fn(|n| ((n + half) % 4) as f32));
        let columns: [Lanes; 2] = [from_fn(|n| (n * 3 % 5) as f32), from_fn(|n| (n % 3) as f32)];
        for set in Instructions::all() {
            let lists = [&lists[0][..], &lists[1][..]];
            let (places, quads, pairs, whole) = set.run(Lookups { lists, table: &table, rows, columns });
            for (half, n) in (0..2).flat_map(|half| (0..8).map(move |n| (half, n))) {
                let (row, column) = (rows[half][n] as usize, columns[half][n] as usize);
                let place = row * [5, 3][half] + column;
                assert_eq!(places[8 * half + n] as usize, place, "{set:?}");
                assert_eq!(from_fn(|k| quads[k][half][n]), lists[half][place].0, "{set:?}");
                let position = (row * column) as f32 / 4.0;
                let entry = table[position as usize];
                assert_eq!(from_fn(|k| pairs[k][half][n]), [entry[0], entry[1], position.fract()], "{set:?}");
            }
            assert_eq!(whole.map(|n| n as f32), columns[0], "{set:?}");
        }
    }
}
