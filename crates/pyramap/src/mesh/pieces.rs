//! The pieces of a surface: faces that share an edge belong to the same.
//!
//! Where what was seen ends, single cells may draw a triangle or two that touch nothing else. They lie near the true
//! surface, but are no part of one.

use super::Mesh;
use crate::disjoint_sets::DisjointSets;
use hashbrown::HashMap;
use hashbrown::hash_map::Entry;

/// The mesh without the pieces of fewer faces than these. What is left keeps its order.
///
/// Time and memory are linear: one entry in a table for each edge of which only one face has been met.
pub(super) fn without_small_pieces(mesh: Mesh, min_faces: usize) -> Mesh {
    if min_faces <= 1 {
        return mesh;
    }
    let mut pieces = DisjointSets::new(mesh.faces.len());
    let mut open = HashMap::new();
    for (n, &[a, b, c]) in (0..).zip(&mesh.faces) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            match open.entry((from.min(to), from.max(to))) {
                Entry::Occupied(other) => pieces.join(n, other.remove()),
                Entry::Vacant(place) => _ = place.insert(n),
            }
        }
    }
    let mut sizes = vec![0; mesh.faces.len()];
    (0..mesh.faces.len()).for_each(|n| sizes[pieces.first(n as u32) as usize] += 1);
    let kept = (0..).zip(&mesh.faces).filter(|&(n, _)| sizes[pieces.first(n) as usize] >= min_faces);
    let faces: Vec<[u32; 3]> = kept.map(|(_, face)| *face).collect();

    // A vertex may be where two pieces touch: it stays as long as one of them does.
    let mut used = vec![false; mesh.vertices.len()];
    faces.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    let mut count = 0;
    let numbers: Vec<u32> = used
        .iter()
        .map(|&used| {
            let number = count;
            count += u32::from(used);
            number
        })
        .collect();
    Mesh {
        vertices: of_used(&mesh.vertices, &used),
        faces: faces.iter().map(|face| face.map(|vertex| numbers[vertex as usize])).collect(),
        normals: of_used(&mesh.normals, &used),
        colours: mesh.colours.map(|colours| of_used(&colours, &used)),
    }
}

fn of_used<T: Copy>(rows: &[T], used: &[bool]) -> Vec<T> {
    rows.iter().zip(used).filter(|&(_, &used)| used).map(|(row, _)| *row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of triangles `(n, n + 1, n + 2)` from vertex `first` on.
    fn strip(first: u32, faces: u32) -> Vec<[u32; 3]> {
        (first..first + faces).map(|n| [n, n + 1, n + 2]).collect()
    }

    fn mesh(faces: Vec<[u32; 3]>) -> Mesh {
        let count = faces.iter().flatten().max().map_or(0, |&last| last + 1);
        let rows = |scale: f32| (0..count).map(|n| [n as f32 * scale, 0.0, 0.0]).collect();
        let colours = Some((0..count).map(|n| [n as u8, 0, 0, 255]).collect());
        Mesh { vertices: rows(1.0), faces, normals: rows(-1.0), colours }
    }

    #[test]
    fn drops_pieces_below_the_size_and_their_vertices() {
        // Pieces of 3 and 4 faces; of 2 faces, with a vertex of its own and one of the second.
        let faces = [strip(0, 3), strip(5, 4), vec![[10, 11, 12], [12, 11, 13]]].concat();
        let left = without_small_pieces(mesh(faces.clone()), 3);
        assert_eq!(left.faces, [strip(0, 3), strip(5, 4)].concat());
        assert_eq!(left.vertices.len(), 11);
        assert_eq!(left.normals[10], [-10.0, 0.0, 0.0]);
        assert_eq!(left.colours.unwrap()[10], [10, 0, 0, 255]);

        let left = without_small_pieces(mesh(faces.clone()), 4);
        assert_eq!(left.faces, strip(0, 4));
        assert_eq!(left.vertices.iter().map(|row| row[0]).collect::<Vec<_>>(), [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);

        assert_eq!(without_small_pieces(mesh(faces.clone()), 1), mesh(faces.clone()));
        assert_eq!(without_small_pieces(mesh(faces), 5), Mesh { colours: Some(Vec::new()), ..Mesh::default() });
    }

    #[test]
    fn a_piece_is_found_whole_in_any_order_of_its_faces() {
        let mut faces = strip(0, 100);
        // 37 and 100 have no common factor: every face, far from its neighbours.
        let scattered: Vec<_> = (0..100).map(|n| faces[n * 37 % 100]).collect();
        faces.clone_from(&scattered);
        assert_eq!(without_small_pieces(mesh(faces), 100).faces, scattered);
    }
}
