//! Exact depth images: every solid is drawn into a buffer of inverse depth, where planes are linear.
//!
//! The ray of pixel `(u, v)` is `t d`, `d = R [(u - cx) / fx, (v - cy) / fy, 1]`, so `t` is the z-depth. Everything below
//! solves for `w = 1 / t` in closed form. The largest `w` of a pixel is its nearest surface, so the order of drawing does
//! not matter. On a plane `w` is linear in the pixel, and so are the four conditions that keep a face within its
//! edges: a row of a face is one interval and one linear function. Nothing needs clipping: `w > 0` is in front.

use crate::solid::Solid;
use nalgebra::{Vector2, Vector3};
use pyramap::{PinholeCamera, Pose};
use rayon::prelude::*;
use std::ops::Range;

/// Rows that one task draws.
const BAND: usize = 16;

/// Pixels that miss a face by no more than this, in pixels, belong to it: rays cannot slip through the seam of two
/// faces that meet. The depth error that it allows is of the same tiny order.
const SEAM: f64 = 1e-9;

/// A function linear in the pixel: its coefficients of `(u, v, 1)`.
type Linear = Vector3<f64>;

/// Renders z-depth in metres, row by row, `0` where no surface is hit.
pub(crate) fn render(solids: &[Solid], camera: &PinholeCamera, pose: &Pose) -> Vec<f32> {
    let view = View::new(camera, pose);
    let surfaces: Vec<Surface> = solids.iter().flat_map(|solid| view.surfaces(solid)).collect();
    let mut depth = vec![0.0; camera.width * camera.height];
    depth.par_chunks_mut(BAND * camera.width).enumerate().for_each(|(band, depth)| {
        let mut inverse_depth = vec![0.0_f64; depth.len()];
        let first_row = band * BAND;
        let last_row = first_row + depth.len() / camera.width;
        for surface in &surfaces {
            for row in first_row.max(surface.rows.start)..last_row.min(surface.rows.end) {
                let start = (row - first_row) * camera.width;
                surface.draw(&view.ray, row as f64, &mut inverse_depth[start..start + camera.width]);
            }
        }
        for (depth, w) in depth.iter_mut().zip(inverse_depth) {
            *depth = if w > 0.0 { (1.0 / w) as f32 } else { 0.0 };
        }
    });
    depth
}

struct View<'a> {
    camera: &'a PinholeCamera,
    pose: &'a Pose,
    /// World components of `d`.
    ray: [Linear; 3],
}

/// A part of a solid's surface, and the pixels outside of which it cannot appear.
struct Surface {
    columns: Range<usize>,
    rows: Range<usize>,
    shape: Shape,
}

/// Places are relative to the camera centre, along the world's axes.
enum Shape {
    /// A face of a box: its inverse depth, and what must not be negative on it.
    Face { inverse_depth: Linear, within: [Linear; 5] },
    /// `gap` is the squared length of the tangents.
    Sphere { centre: Vector3<f64>, gap: f64 },
    /// The heights of both disks.
    Cylinder { axis: Vector2<f64>, radius: f64, bottom: f64, top: f64 },
}

impl<'a> View<'a> {
    fn new(camera: &'a PinholeCamera, pose: &'a Pose) -> Self {
        let PinholeCamera { fx, fy, cx, cy, .. } = *camera;
        let ray = [0, 1, 2].map(|axis| {
            let (x, y, z) = (pose.rotation[(axis, 0)] / fx, pose.rotation[(axis, 1)] / fy, pose.rotation[(axis, 2)]);
            Linear::new(x, y, z - x * cx - y * cy)
        });
        Self { camera, pose, ray }
    }

    /// What the camera can see of a solid. Nothing, if it is inside.
    fn surfaces(&self, solid: &Solid) -> Vec<Surface> {
        let Some((columns, rows)) = self.pixel_bounds(solid) else { return Vec::new() };
        let eye = self.pose.translation;
        let shapes = match *solid {
            Solid::Cuboid { centre, half, turn } => self.faces(&(eye - centre), &half, turn),
            Solid::Sphere { centre, radius } => {
                let centre = centre - eye;
                let gap = centre.norm_squared() - radius * radius;
                if gap > 0.0 { vec![Shape::Sphere { centre, gap }] } else { vec![] }
            }
            Solid::Cylinder { base, radius, height } => {
                let base = base - eye;
                vec![Shape::Cylinder { axis: base.xy(), radius, bottom: base.z, top: base.z + height }]
            }
        };
        shapes.into_iter().map(|shape| Surface { columns: columns.clone(), rows: rows.clone(), shape }).collect()
    }

    /// Columns and rows that hold the solid's image; none if it is behind the camera or beside the image.
    fn pixel_bounds(&self, solid: &Solid) -> Option<(Range<usize>, Range<usize>)> {
        let PinholeCamera { width, height, fx, fy, cx, cy, .. } = *self.camera;
        let corners = solid.corners().map(|corner| self.pose.camera_from_world(&corner));
        if corners.iter().all(|corner| corner.z <= 0.0) {
            return None;
        }
        if corners.iter().any(|corner| corner.z < 1e-6) {
            return Some((0..width, 0..height));
        }
        let span = |pixels: [f64; 8], side: usize| {
            let first = pixels.into_iter().fold(f64::INFINITY, f64::min) - SEAM;
            let last = pixels.into_iter().fold(f64::NEG_INFINITY, f64::max) + SEAM;
            // Casts saturate: what lies beside the image gives an empty range.
            let range = first.ceil() as usize..((last.floor() + 1.0) as usize).min(side);
            (!range.is_empty()).then_some(range)
        };
        let columns = span(corners.map(|corner| fx * corner.x / corner.z + cx), width)?;
        let rows = span(corners.map(|corner| fy * corner.y / corner.z + cy), height)?;
        Some((columns, rows))
    }

    /// The faces of a box that look at the camera, at most one an axis. `eye` is relative to the box's centre.
    fn faces(&self, eye: &Vector3<f64>, half: &Vector3<f64>, [cos, sin]: [f64; 2]) -> Vec<Shape> {
        let eye = [cos * eye.x + sin * eye.y, cos * eye.y - sin * eye.x, eye.z];
        let [x, y, z] = self.ray;
        let ray = [x * cos + y * sin, y * cos - x * sin, z];
        let mut faces = Vec::with_capacity(3);
        for k in 0..3 {
            // Along axis k, from the eye to the face on its side. Otherwise the eye is between both faces' planes.
            let to_face = half[k].copysign(eye[k]) - eye[k];
            if eye[k].abs() > half[k] {
                let inverse_depth = ray[k] / to_face;
                // |eye + ray / w| <= half along the other two axes, times w > 0.
                let edge = |i: usize, side: f64| inverse_depth * (half[i] - side * eye[i]) - ray[i] * side;
                let [i, j] = [(k + 1) % 3, (k + 2) % 3];
                let within = [inverse_depth, edge(i, 1.0), edge(i, -1.0), edge(j, 1.0), edge(j, -1.0)];
                faces.push(Shape::Face { inverse_depth, within });
            }
        }
        faces
    }
}

impl Surface {
    /// Draws row `v`; `inverse_depth` is the whole row of the image.
    fn draw(&self, ray: &[Linear; 3], v: f64, inverse_depth: &mut [f64]) {
        if let Shape::Face { inverse_depth: w, within } = &self.shape {
            let columns = self.columns_within(within, v);
            let first = value(w, columns.start as f64, v);
            for (i, nearest) in inverse_depth[columns].iter_mut().enumerate() {
                let w = first + w.x * f64::from(i as i32);
                *nearest = if w > *nearest { w } else { *nearest };
            }
            return;
        }
        for u in self.columns.clone() {
            let ray = Vector3::from(ray.map(|component| value(&component, u as f64, v)));
            let w = match &self.shape {
                Shape::Face { .. } => unreachable!("drawn above"),
                Shape::Sphere { centre, gap } => nearer_hit(ray.dot(centre), ray.norm_squared(), *gap),
                Shape::Cylinder { axis, radius, bottom, top } => cylinder_hit(&ray, axis, *radius, *bottom, *top),
            };
            inverse_depth[u] = inverse_depth[u].max(w.unwrap_or(0.0));
        }
    }

    /// The columns in which none of the functions is negative in row `v`.
    fn columns_within(&self, functions: &[Linear], v: f64) -> Range<usize> {
        let (mut first, mut last) = (self.columns.start as f64, self.columns.end as f64 - 1.0);
        for function in functions {
            let (slope, offset) = (function.x, function.y * v + function.z);
            if slope > 0.0 {
                first = first.max(-offset / slope - SEAM);
            } else if slope < 0.0 {
                last = last.min(-offset / slope + SEAM);
            } else if offset < 0.0 {
                return 0..0;
            }
        }
        if first > last { 0..0 } else { first.ceil() as usize..last.floor() as usize + 1 }
    }
}

fn value(function: &Linear, u: f64, v: f64) -> f64 {
    function.x * u + function.y * v + function.z
}

/// `w` of the nearer hit with a sphere, or with a circle in the plane, of centre `c` and radius `r`. Of
/// `|d - c w|^2 = r^2 w^2` it is the larger root; `ray_centre = d . c`, `ray_squared = d . d`, `gap = c . c - r^2 > 0`.
fn nearer_hit(ray_centre: f64, ray_squared: f64, gap: f64) -> Option<f64> {
    let discriminant = ray_centre * ray_centre - ray_squared * gap;
    (discriminant >= 0.0 && ray_centre > 0.0).then(|| (ray_centre + discriminant.sqrt()) / gap)
}

/// `w` where a ray enters a cylinder: through the side, or through the disk that looks at the camera.
fn cylinder_hit(ray: &Vector3<f64>, axis: &Vector2<f64>, radius: f64, bottom: f64, top: f64) -> Option<f64> {
    let across = ray.xy();
    let gap = axis.norm_squared() - radius * radius;
    if gap > 0.0
        && let Some(w) = nearer_hit(across.dot(axis), across.norm_squared(), gap)
        && (bottom * w..=top * w).contains(&ray.z)
    {
        return Some(w);
    }
    let disk = if bottom > 0.0 { bottom } else { top };
    let w = ray.z / disk;
    let faces_camera = bottom > 0.0 || top < 0.0;
    (faces_camera && w > 0.0 && (across - axis * w).norm() <= radius * w).then_some(w)
}
