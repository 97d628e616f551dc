//! What stands in the rooms. Each `place` is the middle of the piece's back edge on the floor, its front towards -y,
//! unless said otherwise.

use super::builder::{Builder, Place};
use super::fixtures::CEILING;

impl Builder {
    /// A table around `place`, with its legs at the corners.
    pub(super) fn table(&mut self, place: &Place, width: f64, depth: f64) {
        let (x, y) = (width / 2.0, depth / 2.0);
        self.cuboid(place, [-x, -y, 0.71], [x, y, 0.74]);
        self.legs(place, [x - 0.05, y - 0.05], 0.06, 0.71);
    }

    fn legs(&mut self, place: &Place, [x, y]: [f64; 2], width: f64, height: f64) {
        let half = width / 2.0;
        for (x, y) in [(-x, -y), (x, -y), (-x, y), (x, y)] {
            self.cuboid(place, [x - half, y - half, 0.0], [x + half, y + half, height]);
        }
    }

    /// A chair around `place` that looks towards -y.
    pub(super) fn chair(&mut self, place: &Place) {
        self.cuboid(place, [-0.22, -0.22, 0.42], [0.22, 0.22, 0.46]);
        self.cuboid(place, [-0.22, 0.18, 0.55], [0.22, 0.22, 0.92]);
        self.legs(place, [0.19, 0.19], 0.04, 0.42);
        for x in [-0.19, 0.19] {
            self.cuboid(place, [x - 0.02, 0.18, 0.46], [x + 0.02, 0.22, 0.55]);
        }
    }

    /// An open shelf against a wall; the boards carry books and boxes.
    pub(super) fn shelf(&mut self, place: &Place, width: f64, height: f64) {
        let (x, depth) = (width / 2.0, 0.34);
        self.cuboid(place, [-x, -0.02, 0.0], [x, 0.0, height]);
        self.cuboid(place, [-x, -depth, 0.0], [0.03 - x, 0.0, height]);
        self.cuboid(place, [x - 0.03, -depth, 0.0], [x, 0.0, height]);
        let floors = (height / 0.38) as usize;
        for floor in 0..=floors {
            let z = (height - 0.03) * floor as f64 / floors as f64;
            self.cuboid(place, [-x, -depth, z], [x, 0.0, z + 0.03]);
            if floor < floors {
                let start = 0.05 * (1 + floor * 3 % 5) as f64 - x;
                let length = (0.35 + 0.15 * (floor * 2 % 3) as f64) * width;
                self.cuboid(place, [start, -0.27, z + 0.03], [start + length, -0.02, z + 0.28]);
            }
        }
    }

    /// A closed cabinet against a wall: two doors, 1.5 cm out of the body, with handles.
    pub(super) fn cabinet(&mut self, place: &Place, width: f64, height: f64) {
        let x = width / 2.0;
        self.cuboid(place, [-x, -0.4, 0.0], [x, 0.0, height]);
        self.cuboid(place, [0.02 - x, -0.415, 0.1], [-0.005, -0.4, height - 0.02]);
        self.cuboid(place, [0.005, -0.415, 0.1], [x - 0.02, -0.4, height - 0.02]);
        for handle in [-0.06, 0.04] {
            self.cuboid(place, [handle, -0.44, height * 0.6], [handle + 0.02, -0.415, height * 0.6 + 0.12]);
        }
    }

    /// A potted plant around `place`.
    pub(super) fn plant(&mut self, place: &Place, height: f64) {
        let pot = 0.3;
        self.cylinder(place, [0.0; 3], 0.16, pot);
        self.cylinder(place, [0.0, 0.0, pot], 0.025, height - pot - 0.2);
        self.sphere(place, [0.0, 0.0, height - 0.2], 0.2);
        self.sphere(place, [0.12, 0.08, height - 0.42], 0.13);
        self.sphere(place, [-0.11, -0.06, height - 0.47], 0.12);
    }

    /// A waste-paper bin around `place`.
    pub(super) fn bin(&mut self, place: &Place) {
        self.cylinder(place, [0.0; 3], 0.14, 0.36);
    }

    /// A desk against a wall, with a screen, a keyboard, a drawer unit and a chair before it.
    pub(super) fn desk(&mut self, place: &Place) {
        self.table(&place.at(0.0, -0.4, 0.0), 1.6, 0.8);
        self.cuboid(place, [-0.28, -0.24, 0.86], [0.28, -0.2, 1.2]);
        self.cuboid(place, [-0.03, -0.22, 0.74], [0.03, -0.17, 0.9]);
        self.cuboid(place, [-0.12, -0.32, 0.74], [0.12, -0.12, 0.755]);
        self.cuboid(place, [-0.22, -0.62, 0.74], [0.22, -0.46, 0.765]);
        self.cuboid(place, [0.3, -0.7, 0.0], [0.7, -0.1, 0.6]);
        self.chair(&place.at(-0.1, -0.95, 0.0).turned(160.0));
    }

    /// A sofa against a wall.
    pub(super) fn sofa(&mut self, place: &Place, width: f64) {
        let x = width / 2.0;
        self.cuboid(place, [-x, -0.85, 0.08], [x, 0.0, 0.42]);
        self.cuboid(place, [-x, -0.22, 0.42], [x, 0.0, 0.82]);
        self.cuboid(place, [-x, -0.85, 0.42], [0.18 - x, 0.0, 0.6]);
        self.cuboid(place, [x - 0.18, -0.85, 0.42], [x, 0.0, 0.6]);
    }

    /// A water dispenser against a wall.
    pub(super) fn water_dispenser(&mut self, place: &Place) {
        self.cuboid(place, [-0.16, -0.34, 0.0], [0.16, -0.02, 1.0]);
        self.cylinder(place, [0.0, -0.18, 1.0], 0.13, 0.36);
    }

    /// A lamp on the ceiling around `place`.
    pub(super) fn ceiling_lamp(&mut self, place: &Place, length: f64) {
        self.cuboid(place, [-length / 2.0, -0.15, CEILING - 0.07], [length / 2.0, 0.15, CEILING]);
    }

    /// A conference table around `place`, its long side along x, with chairs at both sides and both ends.
    pub(super) fn conference_table(&mut self, place: &Place, width: f64, depth: f64) {
        let (x, y) = (width / 2.0, depth / 2.0);
        self.cuboid(place, [-x, -y, 0.71], [x, y, 0.75]);
        let pedestals = 3;
        for i in 0..pedestals {
            let x = width * (i as f64 / f64::from(pedestals - 1) - 0.5) * 0.8;
            self.cuboid(place, [x - 0.06, -y * 0.6, 0.0], [x + 0.06, y * 0.6, 0.71]);
        }
        let seats = (width / 0.85) as i32;
        for seat in 0..seats {
            let x = width * ((f64::from(seat) + 0.5) / f64::from(seats) - 0.5);
            // Nobody leaves a chair quite straight.
            let askew = f64::from(seat * 7 % 5 - 2) * 6.0;
            let pulled_out = 0.1 + 0.06 * f64::from(seat * 3 % 4);
            self.chair(&place.at(x, y + pulled_out, 0.0).turned(askew));
            self.chair(&place.at(x, -y - pulled_out, 0.0).turned(180.0 - askew));
        }
        self.chair(&place.at(x + 0.3, 0.0, 0.0).turned(270.0 + 10.0));
        self.chair(&place.at(-x - 0.3, 0.0, 0.0).turned(90.0 - 15.0));
    }
}
