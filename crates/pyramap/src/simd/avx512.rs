//! One vector of sixteen.

use super::{Places, Quad, Vector};
use crate::view::Lanes;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

// SAFETY, of every call of an instruction here: there is a value of this type only in a kernel that was compiled for
// AVX-512, which is entered only where the processor has it.

#[derive(Clone, Copy)]
pub struct Sixteen(__m512);

macro_rules! operators {
    ($($operator:ident $function:ident $instruction:ident)*) => {$(
        impl $operator for Sixteen {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}
operators! { Add add _mm512_add_ps Sub sub _mm512_sub_ps Mul mul _mm512_mul_ps Div div _mm512_div_ps }

#[inline(always)]
fn joined(low: __m256, high: __m256) -> __m512 {
    unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low), high) }
}

impl Vector for Sixteen {
    type Mask = __mmask16;

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(number) })
    }

    #[inline(always)]
    fn join(halves: [&Lanes; 2]) -> Self {
        Self(unsafe { joined(_mm256_loadu_ps(halves[0].as_ptr()), _mm256_loadu_ps(halves[1].as_ptr())) })
    }

    #[inline(always)]
    fn halves(self) -> [Lanes; 2] {
        let mut halves = [[0.0; 8]; 2];
        unsafe { _mm512_storeu_ps(halves.as_mut_ptr().cast(), self.0) };
        halves
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(unsafe { _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(self.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn is_number(self) -> Self::Mask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_ORD_Q>(self.0, self.0) }
    }

    #[inline(always)]
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_ps(mask, other.0, one.0) })
    }

    #[inline(always)]
    unsafe fn places(rows: Self, columns: Self, widths: [u32; 2]) -> Places {
        let mut places = [0; 16];
        unsafe {
            let [low, high] = [_mm256_set1_epi32(widths[0] as i32), _mm256_set1_epi32(widths[1] as i32)];
            let widths = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(low), high);
            let before = _mm512_mullo_epi32(_mm512_cvttps_epi32(rows.0), widths);
            let place = _mm512_add_epi32(before, _mm512_cvttps_epi32(columns.0));
            _mm512_storeu_si512(places.as_mut_ptr().cast(), place);
        }
        places
    }

    #[inline(always)]
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self; 4] {
        unsafe {
            let rows = [
                quads_apart(lists, places, 0),
                quads_apart(lists, places, 1),
                quads_apart(lists, places, 2),
                quads_apart(lists, places, 3),
            ];
            let [a, b, c, d] = transposed(rows);
            [Self(a), Self(b), Self(c), Self(d)]
        }
    }

    #[inline(always)]
    unsafe fn pairs(table: &[[f32; 2]], positions: Self) -> [Self; 3] {
        unsafe {
            let places = _mm512_cvttps_epi32(positions.0);
            let behind = _mm512_sub_ps(positions.0, _mm512_cvtepi32_ps(places));
            // SAFETY: the caller's.
            let numbers = table.as_ptr().cast::<f32>();
            let first = _mm512_i32gather_ps::<8>(places, numbers);
            let second = _mm512_i32gather_ps::<8>(places, numbers.add(1));
            [Self(first), Self(second), Self(behind)]
        }
    }
}

/// Four quads, every fourth from the `k`-th on.
///
/// # Safety
/// That of [`Vector::quads`].
#[inline(always)]
unsafe fn quads_apart([near, next]: [&[Quad]; 2], places: &Places, k: usize) -> __m512 {
    unsafe {
        let a = _mm_load_ps(near.as_ptr().add(places[k] as usize).cast());
        let b = _mm_load_ps(near.as_ptr().add(places[k + 4] as usize).cast());
        let c = _mm_load_ps(next.as_ptr().add(places[k + 8] as usize).cast());
        let d = _mm_load_ps(next.as_ptr().add(places[k + 12] as usize).cast());
        let low = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(a), b);
        let high = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(c), d);
        joined(low, high)
    }
}

/// Row `k` holds the quads `k`, `4 + k`, `8 + k` and `12 + k`: all first numbers, all second ones, and so on, in the
/// quads' order.
#[inline(always)]
fn transposed(rows: [__m512; 4]) -> [__m512; 4] {
    unsafe {
        let [a, b] = [_mm512_unpacklo_ps(rows[0], rows[1]), _mm512_unpacklo_ps(rows[2], rows[3])];
        let [c, d] = [_mm512_unpackhi_ps(rows[0], rows[1]), _mm512_unpackhi_ps(rows[2], rows[3])];
        [
            _mm512_shuffle_ps::<0b01_00_01_00>(a, b),
            _mm512_shuffle_ps::<0b11_10_11_10>(a, b),
            _mm512_shuffle_ps::<0b01_00_01_00>(c, d),
            _mm512_shuffle_ps::<0b11_10_11_10>(c, d),
        ]
    }
}
