//! The solid primitives that scenes are made of.

use nalgebra::Vector3;

/// A solid body in the world, metres. Its inside is occupied, all else is free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// A box whose third axis is the world's z; the other two may be turned about z.
    Cuboid {
        /// The middle.
        centre: Vector3<f64>,
        /// Half the edge lengths, along the box's own axes.
        half: Vector3<f64>,
        /// Cosine and sine of the angle by which the box is turned about z.
        turn: [f64; 2],
    },
    /// A ball.
    Sphere {
        /// The middle.
        centre: Vector3<f64>,
        /// Its radius.
        radius: f64,
    },
    /// A cylinder whose axis is parallel to the world's z.
    Cylinder {
        /// The middle of the disk with the smallest z.
        base: Vector3<f64>,
        /// Its radius.
        radius: f64,
        /// Its length along z.
        height: f64,
    },
}

impl Solid {
    /// The axis-aligned box between two opposite corners.
    pub fn cuboid(min: [f64; 3], max: [f64; 3]) -> Self {
        let (min, max) = (Vector3::from(min), Vector3::from(max));
        Self::Cuboid { centre: (min + max) / 2.0, half: (max - min) / 2.0, turn: [1.0, 0.0] }
    }

    /// A ball.
    pub fn sphere(centre: [f64; 3], radius: f64) -> Self {
        Self::Sphere { centre: centre.into(), radius }
    }

    /// Signed distance from `point` to the surface, metres: positive outside, negative inside, exact everywhere.
    pub fn signed_distance(&self, point: &Vector3<f64>) -> f64 {
        match *self {
            Self::Cuboid { centre, half, turn: [cos, sin] } => {
                let p = point - centre;
                let local = Vector3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
                let excess = local.abs() - half;
                outside_or_inside(excess.x, excess.y, excess.z)
            }
            Self::Sphere { centre, radius } => (point - centre).norm() - radius,
            Self::Cylinder { base, radius, height } => {
                let p = point - base;
                let middle = height / 2.0;
                outside_or_inside(p.xy().norm() - radius, (p.z - middle).abs() - middle, f64::NEG_INFINITY)
            }
        }
    }

    /// Corners of a box around the solid.
    pub(crate) fn corners(&self) -> [Vector3<f64>; 8] {
        let (centre, half, [cos, sin]) = match *self {
            Self::Cuboid { centre, half, turn } => (centre, half, turn),
            Self::Sphere { centre, radius } => (centre, Vector3::repeat(radius), [1.0, 0.0]),
            Self::Cylinder { base, radius, height } => {
                let half = Vector3::new(radius, radius, height / 2.0);
                (base + Vector3::new(0.0, 0.0, half.z), half, [1.0, 0.0])
            }
        };
        std::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 1 { half[axis] } else { -half[axis] };
            let (x, y) = (side(0), side(1));
            centre + Vector3::new(cos * x - sin * y, sin * x + cos * y, side(2))
        })
    }
}

/// Distance to a product of intervals, from how far the point lies beyond each of them (negative: within).
fn outside_or_inside(a: f64, b: f64, c: f64) -> f64 {
    let outside = Vector3::new(a.max(0.0), b.max(0.0), c.max(0.0)).norm();
    if outside > 0.0 { outside } else { a.max(b).max(c) }
}
