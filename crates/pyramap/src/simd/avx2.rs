//! Two vectors of eight.

use super::{Places, Quad, Vector};
use crate::view::Lanes;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

// SAFETY, of every call of an instruction here: there is a value of this type only in a kernel that was compiled for AVX2,
// which is entered only where the processor has it.

#[derive(Clone, Copy)]
pub struct Sixteen([__m256; 2]);

/// An instruction on both halves of each of some vectors. No closure: those are compiled for themselves, without AVX2.
macro_rules! both {
    ($instruction:path, $($vector:expr),*) => {
        unsafe { [$instruction($($vector[0]),*), $instruction($($vector[1]),*)] }
    };
}

macro_rules! operators {
    ($($operator:ident $function:ident $instruction:ident)*) => {$(
        impl $operator for Sixteen {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(both!($instruction, self.0, other.0))
            }
        }
    )*};
}
operators! { Add add _mm256_add_ps Sub sub _mm256_sub_ps Mul mul _mm256_mul_ps Div div _mm256_div_ps }

impl Vector for Sixteen {
    type Mask = [__m256; 2];

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self([unsafe { _mm256_set1_ps(number) }; 2])
    }

    #[inline(always)]
    fn join(halves: [&Lanes; 2]) -> Self {
        Self(unsafe { [_mm256_loadu_ps(halves[0].as_ptr()), _mm256_loadu_ps(halves[1].as_ptr())] })
    }

    #[inline(always)]
    fn halves(self) -> [Lanes; 2] {
        let mut halves = [[0.0; 8]; 2];
        for half in 0..2 {
            unsafe { _mm256_storeu_ps(halves[half].as_mut_ptr(), self.0[half]) };
        }
        halves
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(both!(_mm256_floor_ps, self.0))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(both!(_mm256_max_ps, self.0, other.0))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(both!(_mm256_min_ps, self.0, other.0))
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        both!(_mm256_cmp_ps::<_CMP_GT_OQ>, self.0, other.0)
    }

    #[inline(always)]
    fn is_number(self) -> Self::Mask {
        both!(_mm256_cmp_ps::<_CMP_ORD_Q>, self.0, self.0)
    }

    #[inline(always)]
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self {
        Self(both!(_mm256_blendv_ps, other.0, one.0, mask))
    }

    #[inline(always)]
    unsafe fn places(rows: Self, columns: Self, widths: [u32; 2]) -> Places {
        let mut places = [0; 16];
        for half in 0..2 {
            unsafe {
                let before = _mm256_mullo_epi32(_mm256_cvttps_epi32(rows.0[half]), _mm256_set1_epi32(widths[half] as i32));
                let place = _mm256_add_epi32(before, _mm256_cvttps_epi32(columns.0[half]));
                _mm256_storeu_si256(places.as_mut_ptr().add(8 * half).cast(), place);
            }
        }
        places
    }

    #[inline(always)]
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self; 4] {
        unsafe {
            let [a, b, c, d] = eight_quads(lists[0], places, 0);
            let [e, f, g, h] = eight_quads(lists[1], places, 8);
            [Self([a, e]), Self([b, f]), Self([c, g]), Self([d, h])]
        }
    }

    #[inline(always)]
    unsafe fn pairs(table: &[[f32; 2]], positions: Self) -> [Self; 3] {
        unsafe {
            let [a, b, c] = eight_pairs(table, positions.0[0]);
            let [d, e, f] = eight_pairs(table, positions.0[1]);
            [Self([a, d]), Self([b, e]), Self([c, f])]
        }
    }
}

/// # Safety
/// That of [`Vector::pairs`].
#[inline(always)]
unsafe fn eight_pairs(table: &[[f32; 2]], positions: __m256) -> [__m256; 3] {
    unsafe {
        let places = _mm256_cvttps_epi32(positions);
        let behind = _mm256_sub_ps(positions, _mm256_cvtepi32_ps(places));
        let numbers = table.as_ptr().cast::<f32>();
        [_mm256_i32gather_ps::<8>(numbers, places), _mm256_i32gather_ps::<8>(numbers.add(1), places), behind]
    }
}

/// The quads at eight places, from the `first` one on.
///
/// # Safety
/// That of [`Vector::quads`].
#[inline(always)]
unsafe fn eight_quads(list: &[Quad], places: &Places, first: usize) -> [__m256; 4] {
    unsafe {
        transposed([
            two_quads(list, places, first),
            two_quads(list, places, first + 1),
            two_quads(list, places, first + 2),
            two_quads(list, places, first + 3),
        ])
    }
}

/// The quads at a place and at the fourth behind it.
///
/// # Safety
/// That of [`Vector::quads`].
#[inline(always)]
unsafe fn two_quads(list: &[Quad], places: &Places, at: usize) -> __m256 {
    unsafe {
        let low = _mm_load_ps(list.as_ptr().add(places[at] as usize).cast());
        let high = _mm_load_ps(list.as_ptr().add(places[at + 4] as usize).cast());
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
    }
}

/// Row `k` holds the quads `k` and `4 + k`: all first numbers, all second ones, and so on, in the quads' order.
#[inline(always)]
fn transposed(rows: [__m256; 4]) -> [__m256; 4] {
    unsafe {
        let [a, b] = [_mm256_unpacklo_ps(rows[0], rows[1]), _mm256_unpacklo_ps(rows[2], rows[3])];
        let [c, d] = [_mm256_unpackhi_ps(rows[0], rows[1]), _mm256_unpackhi_ps(rows[2], rows[3])];
        [
            _mm256_shuffle_ps::<0b01_00_01_00>(a, b),
            _mm256_shuffle_ps::<0b11_10_11_10>(a, b),
            _mm256_shuffle_ps::<0b01_00_01_00>(c, d),
            _mm256_shuffle_ps::<0b11_10_11_10>(c, d),
        ]
    }
}
