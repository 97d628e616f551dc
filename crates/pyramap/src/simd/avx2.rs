//! Vectors of eight lanes.

use super::pair::Pair;
use super::{Places, Quad, Real, Simd};
use crate::view::Lanes;
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

// SAFETY, of every instruction here: these types are used only in kernels compiled for AVX2 or more, which are entered only
// where the processor has it. No instruction is within a closure: closures are compiled by themselves, without AVX2.

pub struct Avx2;

#[derive(Clone, Copy)]
pub struct Eight(pub __m256);

/// All bits of a lane are set, or none.
#[derive(Clone, Copy)]
pub struct Mask(__m256);

macro_rules! operators {
    ($type:ident: $($operator:ident $function:ident $instruction:ident)*) => {$(
        impl $operator for $type {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}
operators! { Eight: Add add _mm256_add_ps Sub sub _mm256_sub_ps Mul mul _mm256_mul_ps Div div _mm256_div_ps }
operators! { Mask: BitAnd bitand _mm256_and_ps BitOr bitor _mm256_or_ps }

impl Real for Eight {
    type Mask = Mask;

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(number) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(unsafe { _mm256_floor_ps(self.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Mask {
        Mask(unsafe { _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Mask {
        Mask(unsafe { _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(mask: Mask, one: Self, other: Self) -> Self {
        Self(unsafe { _mm256_blendv_ps(other.0, one.0, mask.0) })
    }
}

impl Simd for Avx2 {
    type Eight = Eight;
    type Sixteen = Pair<Eight>;

    #[inline(always)]
    fn load(lanes: &Lanes) -> Eight {
        Eight(unsafe { _mm256_loadu_ps(lanes.as_ptr()) })
    }

    #[inline(always)]
    fn store(eight: Eight) -> Lanes {
        let mut lanes = [0.0; 8];
        unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), eight.0) };
        lanes
    }

    #[inline(always)]
    fn least(eight: Eight) -> f32 {
        unsafe {
            let four = _mm_min_ps(_mm256_castps256_ps128(eight.0), _mm256_extractf128_ps::<1>(eight.0));
            let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn most(eight: Eight) -> f32 {
        unsafe {
            let four = _mm_max_ps(_mm256_castps256_ps128(eight.0), _mm256_extractf128_ps::<1>(eight.0));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn bits(mask: Mask) -> u32 {
        (unsafe { _mm256_movemask_ps(mask.0) }) as u32
    }

    #[inline(always)]
    unsafe fn store_whole(eight: Eight) -> [i32; 8] {
        let mut lanes = [0; 8];
        unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), _mm256_cvttps_epi32(eight.0)) };
        lanes
    }

    #[inline(always)]
    fn join([near, next]: [Eight; 2]) -> Self::Sixteen {
        Pair(near, next)
    }

    #[inline(always)]
    fn split(sixteen: Self::Sixteen) -> [Eight; 2] {
        [sixteen.0, sixteen.1]
    }

    #[inline(always)]
    unsafe fn places(rows: Self::Sixteen, columns: Self::Sixteen, widths: [u32; 2]) -> Places {
        let mut places = [0; 16];
        for (half, (rows, columns)) in [(rows.0, columns.0), (rows.1, columns.1)].into_iter().enumerate() {
            unsafe {
                let before = _mm256_mullo_epi32(_mm256_cvttps_epi32(rows.0), _mm256_set1_epi32(widths[half] as i32));
                let place = _mm256_add_epi32(before, _mm256_cvttps_epi32(columns.0));
                _mm256_storeu_si256(places.as_mut_ptr().add(8 * half).cast(), place);
            }
        }
        places
    }

    #[inline(always)]
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self::Sixteen; 4] {
        unsafe {
            let [a, b, c, d] = eight_quads(lists[0], places, 0);
            let [e, f, g, h] = eight_quads(lists[1], places, 8);
            [Pair(a, e), Pair(b, f), Pair(c, g), Pair(d, h)]
        }
    }

    #[inline(always)]
    unsafe fn pairs(table: &[[f32; 2]], positions: Self::Sixteen) -> [Self::Sixteen; 3] {
        unsafe {
            let [a, b, c] = eight_pairs(table, positions.0.0);
            let [d, e, f] = eight_pairs(table, positions.1.0);
            [Pair(a, d), Pair(b, e), Pair(c, f)]
        }
    }
}

/// # Safety
/// That of [`Simd::pairs`].
#[inline(always)]
unsafe fn eight_pairs(table: &[[f32; 2]], positions: __m256) -> [Eight; 3] {
    unsafe {
        let places = _mm256_cvttps_epi32(positions);
        let behind = _mm256_sub_ps(positions, _mm256_cvtepi32_ps(places));
        // Pairs as single numbers of twice the width.
        let pairs = table.as_ptr().cast::<f64>();
        let low = _mm256_castpd_ps(_mm256_i32gather_pd::<8>(pairs, _mm256_castsi256_si128(places)));
        let high = _mm256_castpd_ps(_mm256_i32gather_pd::<8>(pairs, _mm256_extracti128_si256::<1>(places)));
        // Each half has two pairs of the low four and two of the high ones: the middle two are exchanged.
        let [low, high] = [_mm256_permute2f128_ps::<0x20>(low, high), _mm256_permute2f128_ps::<0x31>(low, high)];
        let first = _mm256_shuffle_ps::<0b10_00_10_00>(low, high);
        let second = _mm256_shuffle_ps::<0b11_01_11_01>(low, high);
        [Eight(first), Eight(second), Eight(behind)]
    }
}

/// The quads at eight places, from the `first` one on.
///
/// # Safety
/// That of [`Simd::quads`].
#[inline(always)]
unsafe fn eight_quads(list: &[Quad], places: &Places, first: usize) -> [Eight; 4] {
    unsafe {
        let rows = [
            two_quads(list, places, first),
            two_quads(list, places, first + 1),
            two_quads(list, places, first + 2),
            two_quads(list, places, first + 3),
        ];
        // Row k holds the quads k and 4 + k: all first numbers, all second ones, and so on, in the quads' order.
        let [a, b] = [_mm256_unpacklo_ps(rows[0], rows[1]), _mm256_unpacklo_ps(rows[2], rows[3])];
        let [c, d] = [_mm256_unpackhi_ps(rows[0], rows[1]), _mm256_unpackhi_ps(rows[2], rows[3])];
        [
            Eight(_mm256_shuffle_ps::<0b01_00_01_00>(a, b)),
            Eight(_mm256_shuffle_ps::<0b11_10_11_10>(a, b)),
            Eight(_mm256_shuffle_ps::<0b01_00_01_00>(c, d)),
            Eight(_mm256_shuffle_ps::<0b11_10_11_10>(c, d)),
        ]
    }
}

/// The quads at a place and at the fourth behind it.
///
/// # Safety
/// That of [`Simd::quads`].
#[inline(always)]
pub unsafe fn two_quads(list: &[Quad], places: &Places, at: usize) -> __m256 {
    unsafe {
        let low = _mm_load_ps(list.as_ptr().add(places[at] as usize).cast());
        let high = _mm_load_ps(list.as_ptr().add(places[at + 4] as usize).cast());
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
    }
}
