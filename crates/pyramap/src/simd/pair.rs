//! Two vectors as one of twice as many lanes.

use super::Real;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

#[derive(Clone, Copy)]
pub struct Pair<T>(pub T, pub T);

macro_rules! operators {
    ($($operator:ident $function:ident)*) => {$(
        impl<T: $operator<Output = T>> $operator for Pair<T> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0.$function(other.0), self.1.$function(other.1))
            }
        }
    )*};
}
operators! { Add add Sub sub Mul mul Div div BitAnd bitand BitOr bitor }

impl<R: Real> Real for Pair<R> {
    type Mask = Pair<R::Mask>;

    #[inline(always)]
    fn splat(number: f32) -> Self {
        Self(R::splat(number), R::splat(number))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Self(self.0.floor(), self.1.floor())
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        Pair(self.0.greater(other.0), self.1.greater(other.1))
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Self::Mask {
        Pair(self.0.at_least(other.0), self.1.at_least(other.1))
    }

    #[inline(always)]
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self {
        Self(R::select(mask.0, one.0, other.0), R::select(mask.1, one.1, other.1))
    }
}
