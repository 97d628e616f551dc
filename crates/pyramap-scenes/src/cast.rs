//! Exact ranges, for sensors of every kind: each pixel's ray is cut with every solid.

use crate::solid::Solid;
use nalgebra::{Vector2, Vector3};
use pyramap::{Pose, Sensor};
use rayon::prelude::*;

/// Distance in metres along the ray of each pixel, row by row, `0` where no surface is hit.
pub(crate) fn cast(solids: &[Solid], sensor: &Sensor, pose: &Pose) -> Vec<f32> {
    let width = sensor.width();
    let mut ranges = vec![0.0; width * sensor.height()];
    ranges.par_chunks_mut(width).enumerate().for_each(|(row, ranges)| {
        for (column, range) in ranges.iter_mut().enumerate() {
            let ray = sensor.ray(column, row);
            let (start, along) = (pose.rotation * ray.start + pose.translation, pose.rotation * ray.direction);
            let nearest = solids.iter().filter_map(|solid| entry(solid, &start, &along)).min_by(f64::total_cmp);
            *range = nearest.unwrap_or(0.0) as f32;
        }
    });
    ranges
}

/// Where a ray from outside of a solid enters it.
fn entry(solid: &Solid, start: &Vector3<f64>, along: &Vector3<f64>) -> Option<f64> {
    let stretch = match *solid {
        Solid::Cuboid { centre, half, turn: [cos, sin] } => {
            let local = |v: Vector3<f64>| Vector3::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x, v.z);
            let (start, along) = (local(start - centre), local(*along));
            (0..3).fold(EVERYWHERE, |stretch, k| both(stretch, between(start[k], along[k], -half[k], half[k])))
        }
        Solid::Sphere { centre, radius } => {
            let offset = start - centre;
            within(along.norm_squared(), offset.dot(along), offset.norm_squared() - radius * radius)
        }
        Solid::Cylinder { base, radius, height } => {
            let (offset, across): (_, Vector2<f64>) = (start - base, along.xy());
            let aside = offset.xy();
            let round = within(across.norm_squared(), aside.dot(&across), aside.norm_squared() - radius * radius);
            both(round, between(offset.z, along.z, 0.0, height))
        }
    };
    (stretch.0 <= stretch.1 && stretch.0 > 0.0).then_some(stretch.0)
}

/// From where to where along a ray something holds; nowhere if the first exceeds the second.
type Stretch = (f64, f64);

const EVERYWHERE: Stretch = (f64::NEG_INFINITY, f64::INFINITY);
const NOWHERE: Stretch = (f64::INFINITY, f64::NEG_INFINITY);

fn both(a: Stretch, b: Stretch) -> Stretch {
    (a.0.max(b.0), a.1.min(b.1))
}

/// Where `low <= start + t along <= high`.
fn between(start: f64, along: f64, low: f64, high: f64) -> Stretch {
    if along == 0.0 {
        return if (low..=high).contains(&start) { EVERYWHERE } else { NOWHERE };
    }
    let (a, b) = ((low - start) / along, (high - start) / along);
    (a.min(b), a.max(b))
}

/// Where `a t^2 + 2 b t + c <= 0`, for `a` not negative.
fn within(a: f64, b: f64, c: f64) -> Stretch {
    if a == 0.0 {
        return if c <= 0.0 { EVERYWHERE } else { NOWHERE };
    }
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return NOWHERE;
    }
    let root = discriminant.sqrt();
    ((-b - root) / a, (-b + root) / a)
}
