//! The 256 cases of marching cubes, derived from one rule for a face instead of written down.
//!
//! Corner `4 dx + 2 dy + dz` of a cell lies at `(dx, dy, dz)`; bit `c` of a case says that corner `c` is inside.
//!
//! **Contours.** Walk round a face, counter-clockwise as seen from outside the cell. Each run of outside corners is
//! cut off by one segment, from the crossing where the walk leaves the run back to where it entered it. The rule looks
//! at nothing but the face's four corners, so both cells that share a face draw the same segments, in opposite
//! directions. On an ambiguous face (inside corners diagonally opposite) it joins the inside corners: an occupied
//! sheet one voxel thick does not fall to pieces where it runs diagonally.
//! Each crossed edge belongs to two faces, which walk along it in opposite directions: it starts a segment in one and
//! ends one in the other, so the segments close to loops, which have the outside on the side of their normal.
//!
//! **Triangles.** Each loop is triangulated without a diagonal that lies in a face of the cell, for the neighbour
//! might draw the same one, and four triangles would meet there. With the vertices strictly between the ends of
//! their edges this also rules out triangles without area: three points of a cube's edges are in line only if they
//! lie in one face.

/// Edges of a cell.
pub(super) const EDGES: usize = 12;

/// Where an edge of a cell starts (a corner) and the axis along which it runs. Edge `4 axis + n`.
pub(super) const EDGE: [(u8, u8); EDGES] = {
    let mut edges = [(0, 0); EDGES];
    let (mut axis, mut n) = (0, 0);
    while axis < 3 {
        let mut corner = 0;
        while corner < 8 {
            if corner & axis_bit(axis) == 0 {
                edges[n] = (corner, axis as u8);
                n += 1;
            }
            corner += 1;
        }
        axis += 1;
    }
    edges
};

/// What to draw in a cell, for each of the 256 sets of inside corners.
pub(super) struct Cases {
    /// Bit `e` is set if edge `e` is crossed.
    pub crossed: [u16; 256],
    first_triangle: [u16; 257],
    triangles: Vec<[u8; 3]>,
}

impl Cases {
    pub fn derive() -> Self {
        let mut cases = Self { crossed: [0; 256], first_triangle: [0; 257], triangles: Vec::new() };
        for inside in 0..=u8::MAX {
            let case = usize::from(inside);
            for contour in contours(inside) {
                contour.iter().for_each(|edge| cases.crossed[case] |= 1 << edge);
                triangulate(&contour, &mut cases.triangles);
            }
            cases.first_triangle[case + 1] = cases.triangles.len() as u16;
        }
        cases
    }

    /// The triangles of a case, as edges of the cell; normals point outside.
    #[inline]
    pub fn triangles(&self, case: u8) -> &[[u8; 3]] {
        let case = usize::from(case);
        &self.triangles[usize::from(self.first_triangle[case])..usize::from(self.first_triangle[case + 1])]
    }
}

/// The bit of a corner's number that is its coordinate along an axis.
const fn axis_bit(axis: usize) -> u8 {
    4 >> axis
}

/// The edge between two neighbouring corners.
fn edge_between(a: u8, b: u8) -> u8 {
    let ends = |&(corner, axis): &(u8, u8)| corner == a & b && corner | axis_bit(usize::from(axis)) == a | b;
    EDGE.iter().position(ends).expect("the corners differ in one coordinate") as u8
}

/// The corners of each face, counter-clockwise as seen from outside the cell.
fn faces() -> impl Iterator<Item = [u8; 4]> {
    (0..3).flat_map(|axis| {
        let (u, v) = (axis_bit((axis + 1) % 3), axis_bit((axis + 2) % 3));
        let high = [0, u, u | v, v].map(|corner| corner | axis_bit(axis));
        [[0, v, u | v, u], high]
    })
}

/// The closed loops of crossed edges in which the surface meets the faces of the cell.
fn contours(inside: u8) -> Vec<Vec<u8>> {
    let is_inside = |corner: u8| inside >> corner & 1 == 1;
    let mut next = [None; EDGES];
    for face in faces() {
        for i in 0..4 {
            // An outside run starts behind corner i; `end` is the inside corner that ends it.
            if is_inside(face[i]) && !is_inside(face[(i + 1) % 4]) {
                let end = (i + 2..).find(|&n| is_inside(face[n % 4])).expect("corner i itself is inside");
                let leave = edge_between(face[(end - 1) % 4], face[end % 4]);
                next[usize::from(leave)] = Some(edge_between(face[i], face[(i + 1) % 4]));
            }
        }
    }
    let mut loops = Vec::new();
    while let Some(start) = next.iter().position(Option::is_some) {
        let mut contour = Vec::new();
        let mut edge = start;
        while let Some(following) = next[edge].take() {
            contour.push(edge as u8);
            edge = usize::from(following);
        }
        loops.push(contour);
    }
    loops
}

/// Adds the triangulation of a loop that has no diagonal in a face and, of those, the smallest sum of squared
/// diagonals (between the midpoints of the edges).
fn triangulate(contour: &[u8], triangles: &mut Vec<[u8; 3]>) {
    let (_, best) = best_triangulation(contour).expect("every loop has a triangulation without diagonals in a face");
    triangles.extend(best);
}

/// Cost and triangles of the best triangulation of a polygon; `None` if each has a forbidden diagonal. The side from
/// its last vertex to its first belongs to one triangle, whose apex is tried everywhere: loops are at most 12 long.
fn best_triangulation(polygon: &[u8]) -> Option<(u32, Vec<[u8; 3]>)> {
    let [first, .., last] = *polygon else { return Some((0, Vec::new())) };
    (1..polygon.len() - 1)
        .filter_map(|apex| {
            let (before, after) = (&polygon[..=apex], &polygon[apex..]);
            let mut cost = 0;
            let mut triangles = vec![[first, polygon[apex], last]];
            for part in [before, after] {
                // A part of two vertices is a side of the polygon; a larger one hides behind a diagonal.
                if let [a, _, .., b] = *part {
                    let (part_cost, part_triangles) = best_triangulation(part)?;
                    cost += part_cost + diagonal_cost(a, b)?;
                    triangles.extend(part_triangles);
                }
            }
            Some((cost, triangles))
        })
        .min_by_key(|&(cost, _)| cost)
}

/// The squared distance between the midpoints of two edges, in quarters of the cell's edge squared; `None` if a face
/// holds both.
fn diagonal_cost(a: u8, b: u8) -> Option<u32> {
    let midpoint = |edge: u8| {
        let (corner, axis) = EDGE[usize::from(edge)];
        [0, 1, 2].map(|i| if i == usize::from(axis) { 1 } else { 2 * i32::from(corner & axis_bit(i) != 0) })
    };
    let (p, q) = (midpoint(a), midpoint(b));
    let in_one_face = (0..3).any(|i| p[i] == q[i] && p[i] != 1);
    (!in_one_face).then(|| (0..3).map(|i| (p[i] - q[i]).pow(2) as u32).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_crossed_edge_is_in_one_contour() {
        for inside in 0..=u8::MAX {
            let crossing = |&(corner, axis): &(u8, u8)| {
                (inside >> corner ^ inside >> (corner | axis_bit(usize::from(axis)))) & 1 == 1
            };
            let expected: Vec<_> = (0..EDGES as u8).filter(|&edge| crossing(&EDGE[usize::from(edge)])).collect();
            let mut drawn = contours(inside).concat();
            drawn.sort_unstable();
            assert_eq!(drawn, expected, "case {inside:08b}");
        }
    }

    #[test]
    fn one_corner_is_cut_off_towards_the_others() {
        // Corner 0: vertices on its edges along x, y, z (numbers 0, 4, 8) in this order look along +(1, 1, 1).
        let cases = Cases::derive();
        let [[a, b, c]] = *cases.triangles(1) else { panic!("one triangle") };
        assert!([[0, 4, 8], [4, 8, 0], [8, 0, 4]].contains(&[a, b, c]));
        assert_eq!(cases.crossed[1], 1 | 1 << 4 | 1 << 8);
    }
}
