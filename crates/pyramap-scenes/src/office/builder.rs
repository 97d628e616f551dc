//! Solids given in the local frame of a wall or a piece of furniture.

use crate::solid::Solid;
use nalgebra::Vector3;

/// Collects the solids of a scene.
#[derive(Default)]
pub(super) struct Builder {
    pub(super) solids: Vec<Solid>,
}

/// A local frame on the floor, turned about the vertical. Along a wall: x runs along it with the room on the right,
/// so the wall fills y > 0 and what hangs on it or stands before it fills y < 0. Furniture has its front towards -y.
#[derive(Clone, Copy)]
pub(super) struct Place {
    origin: Vector3<f64>,
    /// Cosine and sine of the turn; exact for quarter turns.
    turn: [f64; 2],
}

impl Place {
    pub(super) fn new(x: f64, y: f64, degrees: f64) -> Self {
        let turn = match degrees {
            0.0 => [1.0, 0.0],
            90.0 => [0.0, 1.0],
            180.0 => [-1.0, 0.0],
            270.0 => [0.0, -1.0],
            _ => [degrees.to_radians().cos(), degrees.to_radians().sin()],
        };
        Self { origin: Vector3::new(x, y, 0.0), turn }
    }

    /// A frame of the same direction, its origin at a local point of this one.
    pub(super) fn at(&self, x: f64, y: f64, z: f64) -> Self {
        Self { origin: self.point([x, y, z]), turn: self.turn }
    }

    /// The same origin, turned further.
    pub(super) fn turned(&self, degrees: f64) -> Self {
        let [c, s] = Self::new(0.0, 0.0, degrees).turn;
        let [cos, sin] = self.turn;
        Self { origin: self.origin, turn: [cos * c - sin * s, sin * c + cos * s] }
    }

    fn point(&self, [x, y, z]: [f64; 3]) -> Vector3<f64> {
        let [cos, sin] = self.turn;
        self.origin + Vector3::new(cos * x - sin * y, sin * x + cos * y, z)
    }
}

impl Builder {
    /// A box between two opposite local corners, `min` below `max` on every axis.
    pub(super) fn cuboid(&mut self, place: &Place, min: [f64; 3], max: [f64; 3]) {
        let half = (Vector3::from(max) - Vector3::from(min)) / 2.0;
        let centre = place.point([min[0] + half.x, min[1] + half.y, min[2] + half.z]);
        self.solids.push(Solid::Cuboid { centre, half, turn: place.turn });
    }

    /// A ball around a local point.
    pub(super) fn sphere(&mut self, place: &Place, centre: [f64; 3], radius: f64) {
        self.solids.push(Solid::Sphere { centre: place.point(centre), radius });
    }

    /// An upright cylinder on a local point.
    pub(super) fn cylinder(&mut self, place: &Place, base: [f64; 3], radius: f64, height: f64) {
        self.solids.push(Solid::Cylinder { base: place.point(base), radius, height });
    }

    /// Four bars along the edges of the rectangle `x`, `z` in the plane of a wall, inside of it.
    pub(super) fn bars(&mut self, place: &Place, [x0, x1]: [f64; 2], y: [f64; 2], [z0, z1]: [f64; 2], width: f64) {
        self.cuboid(place, [x0, y[0], z0], [x0 + width, y[1], z1]);
        self.cuboid(place, [x1 - width, y[0], z0], [x1, y[1], z1]);
        self.cuboid(place, [x0, y[0], z0], [x1, y[1], z0 + width]);
        self.cuboid(place, [x0, y[0], z1 - width], [x1, y[1], z1]);
    }
}
