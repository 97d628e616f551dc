//! The floor plan, metres. Corridors run around a block of two offices; the meeting room is east of them.
//!
//! ```text
//!  y  11  +---------------------------+------------------+ 11.5
//!         |      north corridor    <- o      <-          |
//!      9  |   +-----------------o-+   |             ^    |
//!         |   |  east office        |  |   table    path |
//!      1  |   +----o----------------+  |             |   |
//!         |    -> south corridor  ->  o       ->         |
//!     -1  +---------------------------+------------------+ -1.5
//!        -1   1                      14.5               23  x
//! ```

use super::builder::{Builder, Place};
use super::fixtures::{CEILING, Opening};
use crate::solid::Solid;
use Opening::{Door, Passage, Window};

const OUTER: f64 = 0.25;
const INNER: f64 = 0.12;

/// Everything in the office.
pub(super) fn solids() -> Vec<Solid> {
    let mut office = Builder::default();
    let world = Place::new(0.0, 0.0, 0.0);
    office.cuboid(&world, [-1.5, -2.0, -0.2], [23.5, 12.0, 0.0]);
    office.cuboid(&world, [-1.5, -2.0, CEILING], [23.5, 12.0, CEILING + 0.2]);
    south_corridor(&mut office);
    west_corridor(&mut office);
    north_corridor(&mut office);
    offices(&mut office);
    meeting_room(&mut office);
    office.solids
}

fn south_corridor(office: &mut Builder) {
    // Seen from the corridor, the outer wall runs west, the wall of the offices runs east.
    let outer = Place::new(14.5, -1.0, 180.0);
    let inner = Place::new(1.0, 1.0, 0.0);
    let closed = |at| Door { at, width: 0.95, degrees: 0.0 };
    office.wall(&outer, 15.75, OUTER, &[closed(2.2), closed(6.4), closed(10.9)]);
    office.wall(&inner, 13.4, INNER, &[Door { at: 3.1, width: 1.0, degrees: 75.0 }, closed(9.3)]);

    office.picture(&outer, [4.0, 5.0], [1.2, 1.9]);
    office.picture(&outer, [8.6, 9.1], [1.15, 1.85]);
    office.picture(&outer, [9.5, 10.0], [1.15, 1.85]);
    office.whiteboard(&outer, [12.5, 13.8]);
    office.cabinet(&outer.at(8.0, 0.0, 0.0), 0.9, 1.1);
    office.plant(&outer.at(14.9, -0.35, 0.0), 1.5);
    office.picture(&inner, [1.0, 2.2], [1.1, 1.9]);
    office.shelf(&inner.at(5.6, 0.0, 0.0), 1.4, 1.9);
    office.picture(&inner, [7.2, 8.0], [1.2, 1.8]);
    office.water_dispenser(&inner.at(8.6, 0.0, 0.0));
    office.bin(&inner.at(11.0, -0.2, 0.0));
    office.picture(&inner, [11.4, 12.6], [1.2, 1.9]);
    lamps(office, &Place::new(0.0, 0.0, 0.0), &[1.5, 5.0, 8.5, 12.0]);
}

fn west_corridor(office: &mut Builder) {
    let outer = Place::new(-1.0, -1.0, 90.0);
    let inner = Place::new(1.0, 9.0, 270.0);
    office.wall(
        &outer,
        12.25,
        OUTER,
        &[Window { at: 2.5, width: 1.5 }, Window { at: 5.2, width: 1.5 }, Window { at: 7.9, width: 1.5 }],
    );
    office.wall(&inner, 8.0, INNER, &[Door { at: 5.6, width: 0.95, degrees: 0.0 }]);

    office.radiator(&outer, 2.6, 1.3);
    office.radiator(&outer, 8.0, 1.3);
    office.cabinet(&outer.at(5.95, 0.0, 0.0), 1.2, 0.75);
    office.plant(&outer.at(0.5, -0.5, 0.0), 1.7);
    office.shelf(&inner.at(1.5, 0.0, 0.0), 1.8, 2.1);
    office.picture(&inner, [2.9, 3.7], [1.0, 2.0]);
    office.picture(&inner, [4.2, 5.0], [1.0, 2.0]);
    office.chair(&inner.at(4.5, -0.25, 0.0));
    lamps(office, &Place::new(0.0, 0.0, 90.0), &[2.5, 5.0, 7.5]);
}

fn north_corridor(office: &mut Builder) {
    let outer = Place::new(-1.0, 11.0, 0.0);
    let inner = Place::new(14.4, 9.0, 180.0);
    let closed = |at| Door { at, width: 0.95, degrees: 0.0 };
    office.wall(&outer, 15.5, OUTER, &[closed(4.2), closed(5.6), Window { at: 8.4, width: 1.8 }, closed(12.6)]);
    office.wall(&inner, 13.4, INNER, &[Door { at: 3.4, width: 1.0, degrees: 100.0 }, closed(8.9)]);

    for x in [1.6, 2.2, 2.8] {
        office.chair(&outer.at(x, -0.26, 0.0));
    }
    office.picture(&outer, [1.4, 2.6], [1.3, 2.0]);
    office.bin(&outer.at(7.0, -0.2, 0.0));
    office.picture(&outer, [7.2, 7.9], [1.2, 1.9]);
    office.cabinet(&outer.at(11.3, 0.0, 0.0), 1.0, 1.6);
    office.picture(&inner, [1.2, 2.4], [1.2, 1.9]);
    office.cabinet(&inner.at(6.0, 0.0, 0.0), 1.6, 0.9);
    office.plant(&inner.at(7.3, -0.3, 0.0), 1.4);
    office.whiteboard(&inner, [10.6, 12.4]);
    lamps(office, &Place::new(0.0, 10.0, 0.0), &[1.5, 5.0, 8.5, 12.0]);
}

/// Two rooms that are seen through their open doors.
fn offices(office: &mut Builder) {
    let divider = Place::new(7.0, 1.0, 90.0);
    office.cuboid(&divider, [0.0, 0.0, 0.0], [8.0, INNER, CEILING]);
    // Walls as seen from within: the back of the corridors' walls.
    let west_north = Place::new(1.0, 9.0 - INNER, 0.0);
    let east_south = Place::new(14.4, 1.0 + INNER, 180.0);
    office.desk(&west_north.at(1.8, 0.0, 0.0));
    office.desk(&Place::new(7.0 - INNER, 4.0, 270.0));
    office.table(&Place::new(4.1, 4.6, 20.0), 1.2, 1.2);
    office.chair(&Place::new(4.0, 3.6, 170.0));
    office.chair(&Place::new(4.4, 5.6, 10.0));
    office.shelf(&west_north.at(4.0, 0.0, 0.0), 1.6, 2.1);
    office.desk(&east_south.at(2.0, 0.0, 0.0));
    office.desk(&Place::new(7.0, 5.0, 90.0));
    office.table(&Place::new(10.6, 5.6, 0.0), 1.4, 0.9);
    office.chair(&Place::new(10.4, 6.3, 5.0));
    office.cabinet(&east_south.at(4.6, 0.0, 0.0), 1.6, 1.3);
    office.plant(&Place::new(9.4, 3.0, 0.0), 1.8);
}

fn meeting_room(office: &mut Builder) {
    let west = Place::new(14.5, -1.5, 90.0);
    let south = Place::new(23.0, -1.5, 180.0);
    let east = Place::new(23.0, 11.5, 270.0);
    let north = Place::new(14.5, 11.5, 0.0);
    let entrance = |at| Passage { at, width: 1.3 };
    let window = |at| Window { at, width: 2.0 };
    office.wall(&west, 13.0, 0.15, &[entrance(0.85), entrance(10.85)]);
    office.wall(&south, 8.75, OUTER, &[window(3.2)]);
    office.wall(&east, 13.25, OUTER, &[window(0.9), window(3.9), window(6.9), window(9.9)]);
    office.wall(&north, 8.5, OUTER, &[Door { at: 5.6, width: 0.95, degrees: 0.0 }]);
    // The leaves of both entrances stand open against the west wall.
    for hinge in [west.at(2.2, -0.06, 0.0), west.at(9.6, -0.06, 0.0)] {
        office.cuboid(&hinge, [0.0, 0.0, 0.01], [1.25, 0.04, 2.1]);
    }

    office.conference_table(&Place::new(17.5, 5.0, 90.0), 6.4, 2.2);
    office.whiteboard(&west, [4.4, 8.0]);
    office.picture(&south, [0.8, 2.2], [1.1, 2.0]);
    office.cabinet(&south.at(6.9, 0.0, 0.0), 1.8, 0.85);
    for x in [1.1, 4.1, 7.1, 10.1] {
        office.radiator(&east, x, 1.6);
    }
    office.table(&east.at(6.4, -0.35, 0.0), 1.4, 0.6);
    office.plant(&east.at(0.45, -0.45, 0.0), 1.9);
    office.plant(&east.at(12.5, -0.5, 0.0), 1.6);
    office.sofa(&north.at(2.2, 0.0, 0.0), 2.2);
    office.picture(&north, [1.5, 2.9], [1.2, 2.0]);
    office.shelf(&north.at(4.6, 0.0, 0.0), 1.2, 2.0);
    office.bin(&north.at(7.2, -0.3, 0.0));
    for y in [2.4, 7.6] {
        office.cylinder(&Place::new(19.6, y, 0.0), [0.0; 3], 0.2, CEILING);
    }
    // A projector that hangs above the table.
    let above_table = Place::new(17.5, 4.0, 90.0);
    office.cylinder(&above_table, [0.0, 0.0, 2.3], 0.03, CEILING - 2.3);
    office.cuboid(&above_table, [-0.18, -0.2, 2.18], [0.18, 0.2, 2.3]);
    for y in [1.0, 4.8, 8.8] {
        lamps(office, &Place::new(14.5, y, 0.0), &[1.8, 4.2, 6.6]);
    }
}

/// Lamps along a line of the ceiling.
fn lamps(office: &mut Builder, line: &Place, positions: &[f64]) {
    for &x in positions {
        office.ceiling_lamp(&line.at(x, 0.0, 0.0), 1.2);
    }
}
