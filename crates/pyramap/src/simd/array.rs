//! Arrays, which the compiler turns into what vectors a processor is sure to have: SSE2, NEON.

use super::pair::Pair;
use super::{Places, Quad, Real, Simd};
use crate::view::Lanes;
use std::array::from_fn;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

pub struct Portable;

#[derive(Clone, Copy)]
pub struct Eight<T = f32>([T; 8]);

macro_rules! operators {
    ($($operator:ident $function:ident)*) => {$(
        impl<T: Copy + $operator<Output = T>> $operator for Eight<T> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.each(other, |a, b| a.$function(b))
            }
        }
    )*};
}
operators! { Add add Sub sub Mul mul Div div BitAnd bitand BitOr bitor }

impl<T: Copy> Eight<T> {
    #[inline(always)]
    fn each<U>(self, other: Self, operation: impl Fn(T, T) -> U) -> Eight<U> {
        Eight(from_fn(|n| operation(self.0[n], other.0[n])))
    }
}

impl Real for Eight {
    type Mask = Eight<bool>;

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self([number; 8])
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(self.0.map(f32::floor))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.each(other, Real::max)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.each(other, Real::min)
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        self.each(other, |a, b| a > b)
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Self::Mask {
        self.each(other, |a, b| a >= b)
    }

    #[inline(always)]
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self {
        Self(from_fn(|n| if mask.0[n] { one.0[n] } else { other.0[n] }))
    }
}

impl Eight {
    /// # Safety
    /// The numbers, cut off, fit in `i32`.
    #[inline(always)]
    unsafe fn whole(self) -> [i32; 8] {
        self.0.map(|number| unsafe { number.to_int_unchecked() })
    }
}

impl Simd for Portable {
    type Eight = Eight;
    type Sixteen = Pair<Eight>;

    #[inline(always)]
    fn load(lanes: &Lanes) -> Eight {
        Eight(*lanes)
    }

    #[inline(always)]
    fn store(eight: Eight) -> Lanes {
        eight.0
    }

    #[inline(always)]
    fn least(eight: Eight) -> f32 {
        eight.0.into_iter().fold(f32::INFINITY, Real::min)
    }

    #[inline(always)]
    fn most(eight: Eight) -> f32 {
        eight.0.into_iter().fold(f32::NEG_INFINITY, Real::max)
    }

    #[inline(always)]
    fn bits(mask: Eight<bool>) -> u32 {
        (0..8).fold(0, |bits, n| bits | u32::from(mask.0[n]) << n)
    }

    #[inline(always)]
    unsafe fn store_whole(eight: Eight) -> [i32; 8] {
        unsafe { eight.whole() }
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
        let whole = |numbers: Self::Sixteen| unsafe { [numbers.0.whole(), numbers.1.whole()] };
        let (rows, columns) = (whole(rows), whole(columns));
        from_fn(|n| rows[n / 8][n % 8] as u32 * widths[n / 8] + columns[n / 8][n % 8] as u32)
    }

    #[inline(always)]
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self::Sixteen; 4] {
        let quads: [Quad; 16] = from_fn(|n| unsafe { *lists[n / 8].get_unchecked(places[n] as usize) });
        let lanes = |first: usize, k: usize| Eight(from_fn(|n| quads[first + n].0[k]));
        from_fn(|k| Pair(lanes(0, k), lanes(8, k)))
    }

    #[inline(always)]
    unsafe fn pairs(table: &[[f32; 2]], positions: Self::Sixteen) -> [Self::Sixteen; 3] {
        let pairs = |positions: Eight| {
            let places = unsafe { positions.whole() };
            let entries = places.map(|place| unsafe { *table.get_unchecked(place as usize) });
            [
                entries.map(|entry| entry[0]),
                entries.map(|entry| entry[1]),
                from_fn(|n| positions.0[n] - places[n] as f32),
            ]
        };
        let (near, next) = (pairs(positions.0), pairs(positions.1));
        from_fn(|k| Pair(Eight(near[k]), Eight(next[k])))
    }
}
