//! The angle of a point, in `f32`: arithmetic that IEEE 754 defines, so that it has the same bits on every machine, and no
//! branch, so that eight go at a time. The standard library's has neither.

use std::f32::consts::{FRAC_PI_2, PI};

/// `atan(t) / t` for `t` from 0 to 1 as a polynomial in `t^2`, lowest power first: the greatest error of `t` times it is
/// as small as eight coefficients can make it, 4e-8.
pub const COEFFICIENTS: [f32; 8] = [
    0.999_999_34,
    -0.333_298_6,
    0.199_465_65,
    -0.139_086_29,
    0.096_421_95,
    -0.055_912_293,
    0.021_862_933,
    -0.004_054_560_3,
];

/// The angle of `(x, y)` from the x axis, -pi to pi, to 5e-7; 0 for the origin.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (up, right) = (y.abs(), x.abs());
    let steep = up > right;
    let (small, large) = if steep { (right, up) } else { (up, right) };
    let t = if large > 0.0 { small / large } else { 0.0 };
    let squared = t * t;
    let mut series = COEFFICIENTS[7];
    for i in (0..7).rev() {
        series = series * squared + COEFFICIENTS[i];
    }
    let angle = series * t;
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    if y < 0.0 { -angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The polynomial errs by 4e-8, its arithmetic and that of the folding by two or three roundings of numbers up to pi,
    /// half of 2.4e-7 each.
    #[test]
    fn it_is_the_angle() {
        let check = |y: f32, x: f32| {
            let exact = libm::atan2(f64::from(y), f64::from(x));
            assert!((f64::from(atan2(y, x)) - exact).abs() < 5e-7, "({x}, {y}): {} for {exact}", atan2(y, x));
        };
        for i in 0..400_000 {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 400_000.0).sin_cos();
            let scale = libm::exp2(f64::from(i % 61) - 30.0);
            check((sin * scale) as f32, (cos * scale) as f32);
        }
        for (y, x) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 1.0), (-1.0, -1.0)] {
            check(y, x);
        }
    }
}
