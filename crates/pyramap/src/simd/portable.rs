//! Arrays, which the compiler turns into what vectors a processor is sure to have: SSE2, NEON.

use super::{Places, Quad, Vector};
use crate::view::Lanes;
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

#[derive(Clone, Copy)]
pub struct Sixteen([f32; 16]);

impl Sixteen {
    #[inline(always)]
    fn each(self, other: Self, operation: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|n| operation(self.0[n], other.0[n])))
    }
}

macro_rules! operators {
    ($($operator:ident $function:ident)*) => {$(
        impl $operator for Sixteen {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.each(other, |a, b| a.$function(b))
            }
        }
    )*};
}
operators! { Add add Sub sub Mul mul Div div }

impl Vector for Sixteen {
    type Mask = [bool; 16];

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self([number; 16])
    }

    #[inline(always)]
    fn join(halves: [&Lanes; 2]) -> Self {
        Self(from_fn(|n| halves[n / 8][n % 8]))
    }

    #[inline(always)]
    fn halves(self) -> [Lanes; 2] {
        from_fn(|half| from_fn(|n| self.0[8 * half + n]))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(self.0.map(f32::floor))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.each(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.each(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        from_fn(|n| self.0[n] > other.0[n])
    }

    #[inline(always)]
    fn is_number(self) -> Self::Mask {
        self.0.map(|number| !number.is_nan())
    }

    #[inline(always)]
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self {
        Self(from_fn(|n| if mask[n] { one.0[n] } else { other.0[n] }))
    }

    #[inline(always)]
    unsafe fn places(rows: Self, columns: Self, widths: [u32; 2]) -> Places {
        // SAFETY: the caller's.
        let whole = |number: f32| unsafe { number.to_int_unchecked::<i32>() } as u32;
        from_fn(|n| whole(rows.0[n]) * widths[n / 8] + whole(columns.0[n]))
    }

    #[inline(always)]
    unsafe fn quads(lists: [&[Quad]; 2], places: &Places) -> [Self; 4] {
        // SAFETY: the caller's.
        let quads: [Quad; 16] = from_fn(|n| unsafe { *lists[n / 8].get_unchecked(places[n] as usize) });
        from_fn(|k| Self(quads.map(|quad| quad.0[k])))
    }

    #[inline(always)]
    unsafe fn pairs(table: &[[f32; 2]], positions: Self) -> [Self; 3] {
        // SAFETY: the caller's.
        let places = positions.0.map(|position| unsafe { position.to_int_unchecked::<i32>() });
        let entries = places.map(|place| unsafe { *table.get_unchecked(place as usize) });
        let behind = from_fn(|n| positions.0[n] - places[n] as f32);
        [Self(entries.map(|entry| entry[0])), Self(entries.map(|entry| entry[1])), Self(behind)]
    }
}
