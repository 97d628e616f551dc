//! Vectors of sixteen lanes; those of eight are AVX2's.

use super::avx2::{Avx2, Eight, Mask, two_quads};
use super::{Places, Quad, Real, Simd};
use crate::view::Lanes;
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

// SAFETY, of every instruction here: these types are used only in kernels compiled for AVX-512, which are entered only where
// the processor has it. No instruction is within a closure: closures are compiled by themselves, without AVX-512.

pub struct Avx512;

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

impl Real for Sixteen {
    type Mask = __mmask16;

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(number) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_ps(self.0) })
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
    fn at_least(self, other: Self) -> Self::Mask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_ps(mask, other.0, one.0) })
    }
}

impl Simd for Avx512 {
    type Eight = Eight;
    type Sixteen = Sixteen;

    #[inline(always)]
    fn load(lanes: &Lanes) -> Eight {
        Avx2::load(lanes)
    }

    #[inline(always)]
    fn store(eight: Eight) -> Lanes {
        Avx2::store(eight)
    }

    #[inline(always)]
    fn least(eight: Eight) -> f32 {
        Avx2::least(eight)
    }

    #[inline(always)]
    fn most(eight: Eight) -> f32 {
        Avx2::most(eight)
    }

    #[inline(always)]
    fn bits(mask: Mask) -> u32 {
        Avx2::bits(mask)
    }

    #[inline(always)]
    unsafe fn store_whole(eight: Eight) -> [i32; 8] {
        unsafe { Avx2::store_whole(eight) }
    }

    #[inline(always)]
    fn join([near, next]: [Eight; 2]) -> Sixteen {
        Sixteen(unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(near.0), next.0) })
    }

    #[inline(always)]
    fn split(sixteen: Sixteen) -> [Eight; 2] {
        unsafe { [Eight(_mm512_castps512_ps256(sixteen.0)), Eight(_mm512_extractf32x8_ps::<1>(sixteen.0))] }
    }

    #[inline(always)]
    unsafe fn places(rows: Sixteen, columns: Sixteen, widths: [u32; 2]) -> Places {
        let mut places = [0; 16];
        unsafe {
            let [near, next] = [_mm256_set1_epi32(widths[0] as i32), _mm256_set1_epi32(widths[1] as i32)];
            let widths = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(near), next);
            let before = _mm512_mullo_epi32(_mm512_cvttps_epi32(rows.0), widths);
            let place = _mm512_add_epi32(before, _mm512_cvttps_epi32(columns.0));
            _mm512_storeu_si512(places.as_mut_ptr().cast(), place);
        }
        places
    }

    #[inline(always)]
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Sixteen; 4] {
        unsafe {
            let rows = [
                four_quads(lists, places, 0),
                four_quads(lists, places, 1),
                four_quads(lists, places, 2),
                four_quads(lists, places, 3),
            ];
            // Row k holds the quads k, 4 + k, 8 + k and 12 + k: all first numbers, and so on, in the quads' order.
            let [a, b] = [_mm512_unpacklo_ps(rows[0], rows[1]), _mm512_unpacklo_ps(rows[2], rows[3])];
            let [c, d] = [_mm512_unpackhi_ps(rows[0], rows[1]), _mm512_unpackhi_ps(rows[2], rows[3])];
            [
                Sixteen(_mm512_shuffle_ps::<0b01_00_01_00>(a, b)),
                Sixteen(_mm512_shuffle_ps::<0b11_10_11_10>(a, b)),
                Sixteen(_mm512_shuffle_ps::<0b01_00_01_00>(c, d)),
                Sixteen(_mm512_shuffle_ps::<0b11_10_11_10>(c, d)),
            ]
        }
    }

    #[inline(always)]
    unsafe fn pairs(table: &[[f32; 2]], positions: Sixteen) -> [Sixteen; 3] {
        unsafe {
            let places = _mm512_cvttps_epi32(positions.0);
            let behind = _mm512_sub_ps(positions.0, _mm512_cvtepi32_ps(places));
            // Pairs as single numbers of twice the width.
            let pairs = table.as_ptr().cast::<f64>();
            let low = _mm512_castpd_ps(_mm512_i32gather_pd::<8>(_mm512_castsi512_si256(places), pairs));
            let high = _mm512_castpd_ps(_mm512_i32gather_pd::<8>(_mm512_extracti64x4_epi64::<1>(places), pairs));
            let evens = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            let odds = _mm512_add_epi32(evens, _mm512_set1_epi32(1));
            let first = _mm512_permutex2var_ps(low, evens, high);
            let second = _mm512_permutex2var_ps(low, odds, high);
            [Sixteen(first), Sixteen(second), Sixteen(behind)]
        }
    }
}

/// Every fourth quad from the `k`-th place on.
///
/// # Safety
/// That of [`Simd::quads`].
#[inline(always)]
unsafe fn four_quads(lists: [&[Quad]; 2], places: &Places, k: usize) -> __m512 {
    unsafe {
        let [near, next] = [two_quads(lists[0], places, k), two_quads(lists[1], places, k + 8)];
        _mm512_insertf32x8::<1>(_mm512_castps256_ps512(near), next)
    }
}
