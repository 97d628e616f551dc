//! Radial-tangential lens distortion (Brown's model, with the coefficients in OpenCV's order), and where it can be undone.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Distortion coefficients: for a point at `(x, y)` in the plane z = 1, with `r^2 = x^2 + y^2`, a lens makes
/// `x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)`, and the same for y with p1 and p2 exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distortion {
    /// Radial.
    pub k1: f64,
    /// Radial.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// Radial.
    pub k3: f64,
}

/// What a point becomes, and its rate of change: `[[dX/dx, dX/dy], [dY/dx, dY/dy]]`.
pub type Moved = ([f64; 2], [[f64; 2]; 2]);

impl Distortion {
    /// The coefficients in OpenCV's order: k1, k2, p1, p2, k3.
    pub fn from_coefficients([k1, k2, p1, p2, k3]: [f64; 5]) -> Self {
        Self { k1, k2, p1, p2, k3 }
    }

    /// The coefficients in OpenCV's order.
    pub fn coefficients(&self) -> [f64; 5] {
        let Self { k1, k2, p1, p2, k3 } = *self;
        [k1, k2, p1, p2, k3]
    }

    /// Distorts a point in the plane z = 1.
    pub(crate) fn apply(&self, [x, y]: [f64; 2]) -> Moved {
        let Self { k1, k2, p1, p2, k3 } = *self;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // d radial / d r^2, twice: times x it is d radial / dx.
        let rise = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let moved = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ];
        let mixed = x * y * rise + 2.0 * (p1 * x + p2 * y);
        let rate = [
            [radial + x * x * rise + 2.0 * p1 * y + 6.0 * p2 * x, mixed],
            [mixed, radial + y * y * rise + 6.0 * p1 * y + 2.0 * p2 * x],
        ];
        (moved, rate)
    }

    /// Up to which radius in the plane z = 1 the image does not fold back: along no direction does it shrink to less than
    /// a tenth there. At most 10, which is 84 degrees from the axis.
    pub(crate) fn radius(&self) -> f64 {
        const FARTHEST: f64 = 10.0;
        const STEPS: u32 = 2000;
        let stretches = |radius: f64| {
            (0..48).all(|n| {
                let (sin, cos) = (TAU * f64::from(n) / 48.0).sin_cos();
                let (_, [[a, b], [_, d]]) = self.apply([radius * cos, radius * sin]);
                // The smaller eigenvalue of a symmetric matrix.
                0.5 * (a + d) - (0.25 * (a - d) * (a - d) + b * b).sqrt() > 0.1
            })
        };
        let at = |step: u32| FARTHEST * f64::from(step) / f64::from(STEPS);
        (1..=STEPS).find(|&step| !stretches(at(step))).map_or(FARTHEST, |step| at(step - 1))
    }

    /// The greatest rates of change up to a radius, a twentieth more than at places that lie close together.
    fn stretch(&self, radius: f64) -> [[f64; 2]; 2] {
        let mut most = [[0.0f64; 2]; 2];
        for (step, n) in (0..=200).flat_map(|step| (0..96).map(move |n| (step, n))) {
            let (sin, cos) = (TAU * f64::from(n) / 96.0).sin_cos();
            let place = radius * f64::from(step) / 200.0;
            let (_, rate) = self.apply([place * cos, place * sin]);
            most = [0, 1].map(|i| [0, 1].map(|j| most[i][j].max(rate[i][j].abs())));
        }
        most.map(|row| row.map(|rate| 1.05 * rate + 1e-3))
    }

    /// The point within a radius that is distorted to this one, if there is one: Newton's method, from the middle, where the
    /// distortion is none.
    pub(crate) fn undo(&self, distorted: [f64; 2], radius: f64) -> Option<[f64; 2]> {
        let mut point = [0.0; 2];
        let tolerance = 1e-13 * (1.0 + distorted[0].hypot(distorted[1]));
        for _ in 0..50 {
            let ([x, y], [[a, b], [c, d]]) = self.apply(point);
            let (dx, dy) = (distorted[0] - x, distorted[1] - y);
            let determinant = a * d - b * c;
            let step = [(d * dx - b * dy) / determinant, (a * dy - c * dx) / determinant];
            // Where it stretches least a whole step may lead too far, out of where it can be undone.
            let next = [point[0] + step[0], point[1] + step[1]];
            let length = next[0].hypot(next[1]);
            let scale = if length > 1.05 * radius { 1.05 * radius / length } else { 1.0 };
            point = next.map(|c| c * scale);
            if dx.hypot(dy) < tolerance {
                return (point[0].hypot(point[1]) <= radius).then_some(point);
            }
        }
        None
    }
}

/// A camera's lens: its distortion, and what of it the image shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    distortion: Distortion,
    radius: f64,
    bounds: [[f64; 2]; 2],
    stretch: [[f64; 2]; 2],
}

impl Lens {
    /// The lens of an image whose border lies at these points of the distorted plane z = 1.
    pub(crate) fn new(distortion: Distortion, border: impl Iterator<Item = [f64; 2]>) -> Self {
        let fold = distortion.radius();
        let (mut low, mut high, mut radius) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 0.0f64);
        for point in border {
            // Where the border lies beyond the fold, all up to the fold may be seen.
            let undone = distortion.undo(point, fold);
            let (a, b) = undone.map_or(([-fold; 2], [fold; 2]), |undone| (undone, undone));
            radius = radius.max(undone.map_or(fold, |[x, y]| x.hypot(y)));
            (low, high) = ([0, 1].map(|k| low[k].min(a[k])), [0, 1].map(|k| high[k].max(b[k])));
        }
        // Points of the border between those that were asked are nearer to them than this.
        let slack = 1e-3 * radius;
        let radius = (radius + slack).min(fold);
        Self {
            distortion,
            radius,
            bounds: [low.map(|c| c - slack), high.map(|c| c + slack)],
            stretch: distortion.stretch(radius),
        }
    }

    /// The coefficients.
    pub fn distortion(&self) -> Distortion {
        self.distortion
    }

    /// Up to which radius in the plane z = 1 points can be in the image.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Lowest and highest x and y in the plane z = 1 of what the image shows.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        self.bounds
    }

    /// The most that the distorted x and y change with x and y, up to the radius, `[[dX/dx, dX/dy], [dY/dx, dY/dy]]`.
    pub fn stretch(&self) -> [[f64; 2]; 2] {
        self.stretch
    }

    /// The point in the plane z = 1 that is seen at a distorted one.
    pub(crate) fn undo(&self, distorted: [f64; 2]) -> Option<[f64; 2]> {
        self.distortion.undo(distorted, self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Barrel, pincushion, one that folds back within the image, and tangential parts.
    const LENSES: [[f64; 5]; 4] = [
        [-0.28, 0.07, 0.0, 0.0, 0.0],
        [0.15, 0.02, 0.001, -0.002, 0.01],
        [-0.4, 0.0, 0.0, 0.0, 0.0],
        [-0.1, 0.05, 0.004, 0.006, -0.02],
    ];

    #[test]
    fn what_is_distorted_can_be_undone() {
        for coefficients in LENSES {
            let lens = Distortion::from_coefficients(coefficients);
            let radius = lens.radius();
            assert!(radius > 0.5, "{coefficients:?}: {radius}");
            for n in 0..500 {
                let (sin, cos) = (f64::from(n) * 0.7).sin_cos();
                let r = radius * 0.999 * f64::from(n) / 500.0;
                let point = [r * cos, r * sin];
                let moved = lens.apply(point).0;
                let [x, y] = lens.undo(moved, radius).unwrap_or_else(|| panic!("{coefficients:?}, {point:?}"));
                // What the search is content with, over a stretch of a tenth at least.
                assert!((x - point[0]).hypot(y - point[1]) < 1e-12 * (1.0 + moved[0].hypot(moved[1])));
            }
        }
    }

    #[test]
    fn rates_are_differences() {
        for coefficients in LENSES {
            let lens = Distortion::from_coefficients(coefficients);
            let (x, y, h) = (0.31, -0.22, 1e-6);
            let (_, rate) = lens.apply([x, y]);
            let [low_x, high_x] = [-h, h].map(|h| lens.apply([x + h, y]).0);
            let [low_y, high_y] = [-h, h].map(|h| lens.apply([x, y + h]).0);
            for k in 0..2 {
                assert!((rate[k][0] - (high_x[k] - low_x[k]) / (2.0 * h)).abs() < 1e-8);
                assert!((rate[k][1] - (high_y[k] - low_y[k]) / (2.0 * h)).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_nothing() {
        // r - 0.4 r^3 rises at a rate of a tenth until 1 - 1.2 r^2 = 0.1.
        let lens = Distortion::from_coefficients([-0.4, 0.0, 0.0, 0.0, 0.0]);
        let radius = lens.radius();
        assert!((radius - 0.75f64.sqrt()).abs() < 0.006, "{radius}");
        let reached = radius - 0.4 * radius.powi(3);
        assert!(lens.undo([1.01 * reached, 0.0], radius).is_none());
        assert!(lens.undo([5.0, 3.0], radius).is_none());
        assert!(lens.undo([0.99 * reached, 0.0], radius).is_some());
        assert_eq!(Distortion::default().radius(), 10.0);
    }
}
