//! Vector instructions: the kernels' vectors, and which of a processor's instructions a kernel is compiled for.
//!
//! A kernel is written once, over a [`Vector`] of sixteen numbers, and compiled for each set of instructions that a
//! processor may have; [`Instructions::run`] enters it. All sets do the same IEEE 754 operations in the same order, none
//! fused, so that which one runs changes no bit.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

use crate::view::Lanes;
use std::ops::{Add, Div, Mul, Sub};

/// What is asked of a 2 x 2 square of texels: left and right of the upper row, then of the lower one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Quad(pub [f32; 4]);

/// A place in a list for each number of a [`Vector`].
pub type Places = [u32; 16];

/// Sixteen numbers: eight voxels, in each of two layers. Arithmetic and comparisons go number by number.
pub trait Vector: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// A truth value for each number.
    type Mask: Copy;

    /// One number, sixteen times.
    fn splat(number: f32) -> Self;
    /// Eight numbers, and eight more.
    fn join(halves: [&Lanes; 2]) -> Self;
    /// What [`Vector::join`] joins.
    fn halves(self) -> [Lanes; 2];
    /// The next lower whole number.
    fn floor(self) -> Self;
    /// `if self > other { self } else { other }`: the other where one is NaN.
    fn max(self, other: Self) -> Self;
    /// `if self < other { self } else { other }`: the other where one is NaN.
    fn min(self, other: Self) -> Self;
    /// Whether they are greater.
    fn greater(self, other: Self) -> Self::Mask;
    /// Whether they are not NaN.
    fn is_number(self) -> Self::Mask;
    /// The numbers of one where a mask says so, else of the other.
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self;

    /// Where texels of two images of these widths lie, row by row; rows and columns are whole numbers.
    ///
    /// # Safety
    /// They are at least 0, and fit in `i32` with the result.
    unsafe fn places(rows: Self, columns: Self, widths: [u32; 2]) -> Places;
    /// Reads quads out of two lists, one for each half: all first numbers, all second ones, and so on.
    ///
    /// # Safety
    /// The places are within the lists.
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self; 4];
    /// Reads a table of pairs at positions between its entries: the first and second numbers of the entries before, and
    /// how far behind those the positions lie.
    ///
    /// # Safety
    /// The positions, cut off, are within the table.
    unsafe fn pairs(table: &[[f32; 2]], positions: Self) -> [Self; 3];
}

/// Work to be done in vector instructions.
pub trait Kernel {
    /// What comes of it.
    type Output;
    /// Does it. To be marked `#[inline(always)]`, as all that it calls: it is compiled with the instructions of its caller.
    fn run<V: Vector>(self) -> Self::Output;
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
        let mut all = vec![Self(Set::Portable)];
        #[cfg(target_arch = "x86_64")]
        {
            let widest = Self::widest();
            all.extend([Set::Avx2, Set::Avx512].map(Self).into_iter().take(match widest.0 {
                Set::Portable => 0,
                Set::Avx2 => 1,
                Set::Avx512 => 2,
            }));
        }
        all
    }

    /// Does some work with these instructions.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Portable => kernel.run::<portable::Sixteen>(),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => {
                #[target_feature(enable = "avx2")]
                fn run<K: Kernel>(kernel: K) -> K::Output {
                    kernel.run::<avx2::Sixteen>()
                }
                // SAFETY: there is a value only where the processor has these.
                unsafe { run(kernel) }
            }
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => {
                #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw")]
                fn run<K: Kernel>(kernel: K) -> K::Output {
                    kernel.run::<avx512::Sixteen>()
                }
                // SAFETY: there is a value only where the processor has these.
                unsafe { run(kernel) }
            }
        }
    }
}
