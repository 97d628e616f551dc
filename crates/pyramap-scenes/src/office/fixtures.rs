//! Walls with openings, and what is fixed to them. Each `place` is the frame of a wall (see [`Place`]).

use super::builder::{Builder, Place};

/// Height of the rooms, metres.
pub(super) const CEILING: f64 = 2.7;
/// Height of door openings, metres.
const DOOR: f64 = 2.1;
const CASING_WIDTH: f64 = 0.08;
const LEAF_THICKNESS: f64 = 0.04;

/// A hole through a wall, by its left end along the wall and its width.
pub(super) enum Opening {
    /// From the floor, with a leaf that is hinged on the left and open by some degrees, away from the room.
    Door { at: f64, width: f64, degrees: f64 },
    /// From the floor, without a leaf.
    Passage { at: f64, width: f64 },
    /// Above a sill, closed by a pane.
    Window { at: f64, width: f64 },
}

impl Opening {
    /// First and last x, lower and upper edge.
    fn extent(&self) -> ([f64; 2], [f64; 2]) {
        match *self {
            Self::Door { at, width, .. } | Self::Passage { at, width } => ([at, at + width], [0.0, DOOR]),
            Self::Window { at, width } => ([at, at + width], [0.9, 2.3]),
        }
    }
}

impl Builder {
    /// A wall with openings, given from left to right, and its baseboard.
    pub(super) fn wall(&mut self, place: &Place, length: f64, thickness: f64, openings: &[Opening]) {
        let mut x = 0.0;
        for opening in openings {
            let ([start, end], [sill, lintel]) = opening.extent();
            self.wall_piece(place, x, start, thickness);
            self.cuboid(place, [start, 0.0, lintel], [end, thickness, CEILING]);
            if sill > 0.0 {
                self.cuboid(place, [start, 0.0, 0.0], [end, thickness, sill]);
                self.baseboard(place, start, end);
            }
            match *opening {
                Opening::Door { at, width, degrees } => self.door(&place.at(at, 0.0, 0.0), width, thickness, degrees),
                Opening::Passage { at, width } => self.casing(&place.at(at, 0.0, 0.0), width),
                Opening::Window { at, width } => {
                    self.window(&place.at(at, 0.0, sill), width, lintel - sill, thickness);
                }
            }
            x = end;
        }
        self.wall_piece(place, x, length, thickness);
    }

    fn wall_piece(&mut self, place: &Place, start: f64, end: f64, thickness: f64) {
        self.cuboid(place, [start, 0.0, 0.0], [end, thickness, CEILING]);
        self.baseboard(place, start, end);
    }

    fn baseboard(&mut self, place: &Place, start: f64, end: f64) {
        self.cuboid(place, [start, -0.015, 0.0], [end, 0.0, 0.08]);
    }

    /// The frame around a door opening: it stands 3 cm out of the wall.
    fn casing(&mut self, place: &Place, width: f64) {
        let (left, right, top) = (-CASING_WIDTH, width + CASING_WIDTH, DOOR + CASING_WIDTH);
        self.cuboid(place, [left, -0.03, 0.0], [0.0, 0.0, top]);
        self.cuboid(place, [width, -0.03, 0.0], [right, 0.0, top]);
        self.cuboid(place, [left, -0.03, DOOR], [right, 0.0, top]);
    }

    /// Casing, and a leaf that is 5 cm behind the face of the wall when closed.
    fn door(&mut self, place: &Place, width: f64, thickness: f64, degrees: f64) {
        self.casing(place, width);
        let hinge =
            if degrees == 0.0 { place.at(0.0, 0.05, 0.0) } else { place.at(0.0, thickness, 0.0).turned(degrees) };
        self.cuboid(&hinge, [0.0, 0.0, 0.01], [width, LEAF_THICKNESS, DOOR]);
        self.cuboid(&hinge, [width - 0.18, -0.05, 1.02], [width - 0.06, -0.03, 1.04]);
        self.cuboid(&hinge, [width - 0.08, -0.05, 1.02], [width - 0.06, 0.0, 1.04]);
    }

    /// A pane in a frame with a mullion, at the outer side of the reveal, and a board on the sill.
    fn window(&mut self, place: &Place, width: f64, height: f64, thickness: f64) {
        self.cuboid(place, [0.0, thickness - 0.04, 0.0], [width, thickness, height]);
        let frame = [thickness - 0.08, thickness - 0.04];
        self.bars(place, [0.0, width], frame, [0.0, height], 0.06);
        self.cuboid(place, [width / 2.0 - 0.04, frame[0], 0.0], [width / 2.0 + 0.04, frame[1], height]);
        self.cuboid(place, [-0.05, -0.06, -0.03], [width + 0.05, frame[0], 0.0]);
    }

    /// A framed picture, 3 cm thick; `x` and `z` are its extents.
    pub(super) fn picture(&mut self, place: &Place, x: [f64; 2], z: [f64; 2]) {
        self.cuboid(place, [x[0], -0.012, z[0]], [x[1], 0.0, z[1]]);
        self.bars(place, x, [-0.03, 0.0], z, 0.05);
    }

    /// A board of 2 cm thickness with a tray for pens.
    pub(super) fn whiteboard(&mut self, place: &Place, x: [f64; 2]) {
        self.cuboid(place, [x[0], -0.02, 0.9], [x[1], 0.0, 2.0]);
        self.cuboid(place, [x[0] + 0.1, -0.1, 0.88], [x[1] - 0.1, 0.0, 0.9]);
    }

    /// A heater below a window.
    pub(super) fn radiator(&mut self, place: &Place, x: f64, width: f64) {
        for rib in 0..(width / 0.1) as usize {
            let x = x + 0.1 * rib as f64;
            self.cuboid(place, [x, -0.12, 0.15], [x + 0.07, -0.04, 0.7]);
        }
        self.cuboid(place, [x, -0.09, 0.2], [x + width, -0.05, 0.6]);
    }
}
