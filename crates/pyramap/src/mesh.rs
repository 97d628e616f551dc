//! Iso-surface of the occupied space: marching cubes over sparse blocks.
//!
//! W. E. Lorensen, H. E. Cline, "Marching cubes: a high resolution 3D surface construction algorithm", SIGGRAPH 1987.
//! The corners of a cell are the centres of eight voxels; a cell with an unknown corner draws nothing, so the surface
//! ends where knowledge does. Inside is what is occupied: log-odds *above* the level; a voxel at the level is outside.
//! What a cell draws follows from its corners by a rule that agrees with the neighbour's on each face: where all
//! voxels are known the mesh is a closed, oriented 2-manifold.
//!
//! Each crossed edge of the grid has one vertex, owned by the block of the edge's first voxel. So there are two passes
//! over the blocks, both parallel: first each block makes the vertices that it owns and lists its cells; then, with
//! all vertices numbered, each writes the triangles of its cells, asking its neighbours for theirs.
//!
//! Time is linear: one read of every block, one more of the neighbourhood of each block that meets the surface, and a
//! constant for each vertex and triangle. Memory beyond the mesh: a copy of the vertices, 0.2 kB for each block, 0.4 kB
//! more for each that meets the surface, and 4 bytes for each of its cells that does.

mod cases;
mod colours;
mod patch;
mod pieces;
mod sides;

use crate::block::{Block, BlockKey, Blocks};
use crate::colour::{Colours, Rgba};
use crate::error::{Error, Result};
use crate::log_odds::{STEPS, from_fixed};
use cases::Cases;
use hashbrown::HashMap;
use patch::{Cell, EdgeSet, Neighbourhood};
use rayon::prelude::*;
use sides::{Sides, Surface};
use std::sync::LazyLock;

/// Which surface to extract.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshOptions {
    /// Log-odds on the surface, prior included; `0` is a probability of one half.
    pub level: f64,
    /// Voxels whose evidence (log-odds without the prior) is nearer to zero than this count as unknown, as those
    /// without any always do.
    pub min_evidence: f64,
    /// Pieces of the surface with fewer faces than this are left out; faces that share an edge are of one piece.
    pub min_faces: usize,
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self { level: 0.0, min_evidence: 0.0, min_faces: 0 }
    }
}

/// A triangle mesh in world coordinates, metres. Every vertex is used by a face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the vertices.
    pub vertices: Vec<[f32; 3]>,
    /// Triangles, as indices of vertices, counter-clockwise as seen from free space.
    pub faces: Vec<[u32; 3]>,
    /// Unit normals of the vertices, towards free space.
    pub normals: Vec<[f32; 3]>,
    /// Colours of the vertices, of a map that keeps any: four zeros where none was seen.
    pub colours: Option<Vec<Rgba>>,
}

/// Extracts the surface between occupied and free space.
///
/// The mesh depends on the map alone: the same voxels in the same blocks give the same vertices and faces in the same
/// order, on any number of threads.
///
/// # Errors
/// [`Error::Parameter`] if an option is not a number, `min_evidence` is negative, or either lies beyond what evidence
/// can be; [`Error::Unsupported`] if there are more vertices than a `u32` can number.
pub fn extract(blocks: &(impl Blocks + ?Sized), options: &MeshOptions) -> Result<Mesh> {
    let surface = surface_sought(blocks, options)?;
    blocks.fetch()?;
    let grid = Grid::read(blocks, &surface);

    let trace = |(n, entries)| grid.trace(entries, (n * CHUNK) as u32, &surface);
    let chunks: Vec<Chunk> = grid.entries.par_chunks(CHUNK).enumerate().map(trace).collect();

    let first_vertices = running_sums(chunks.iter().map(|chunk| chunk.vertices.len()))?;
    let mut patches = vec![None; grid.entries.len()];
    for (chunk, first) in chunks.iter().zip(first_vertices) {
        for patch in &chunk.patches {
            patches[patch.entry as usize] = Some((first + patch.first_vertex, &patch.edges));
        }
    }
    let mesh = Mesh {
        vertices: gather(&chunks, |chunk| chunk.vertices.len(), |chunk, out| out.copy_from_slice(&chunk.vertices)),
        faces: gather(&chunks, |chunk| chunk.num_faces, |chunk, out| chunk.write_faces(&patches, out)),
        normals: gather(&chunks, |chunk| chunk.normals.len(), |chunk, out| out.copy_from_slice(&chunk.normals)),
        colours: grid
            .colours
            .map(|_| gather(&chunks, |chunk| chunk.colours.len(), |chunk, out| out.copy_from_slice(&chunk.colours))),
    };
    Ok(pieces::without_small_pieces(mesh, options.min_faces))
}

fn surface_sought(blocks: &(impl Blocks + ?Sized), options: &MeshOptions) -> Result<Surface> {
    let MeshOptions { level, min_evidence, .. } = *options;
    let refuse = |name, got: f64, expected| Err(Error::Parameter { name, got: got.to_string(), expected });
    let (prior, most) = (blocks.prior_log_odds(), -from_fixed(i32::MIN));
    if !(-most..=most).contains(&(level - prior)) {
        return refuse("level", level, format!("a log-odd within {most} of the prior's, {prior}"));
    }
    if !(0.0..=most).contains(&min_evidence) {
        return refuse("min_evidence", min_evidence, format!("a log-odd from 0 to {most}"));
    }
    let steps = f64::from(STEPS);
    Ok(Surface {
        level: (level - prior) * steps,
        min_evidence: ((min_evidence * steps).ceil() as u32).max(1),
        voxel_size: blocks.voxel_size(),
    })
}

/// How many blocks a thread takes at a time: enough to make its buffers worth while, few enough to share the work.
const CHUNK: usize = 128;

/// A block that knows something.
struct Entry<'a> {
    key: BlockKey,
    block: Block<'a>,
    sides: Sides,
}

/// All blocks that know something, sorted by key.
struct Grid<'a> {
    entries: Vec<Entry<'a>>,
    index: HashMap<BlockKey, u32>,
    colours: Option<&'a Colours>,
}

impl<'a> Grid<'a> {
    fn read(blocks: &'a (impl Blocks + ?Sized), surface: &Surface) -> Self {
        let mut keys = blocks.keys();
        keys.par_sort_unstable();
        let entries: Vec<_> = keys
            .into_par_iter()
            .filter_map(|key| {
                let block = blocks.block(key)?;
                let sides = Sides::of(&block, surface);
                sides.any_known().then_some(Entry { key, block, sides })
            })
            .collect();
        let index = entries.iter().zip(0..).map(|(entry, n)| (entry.key, n)).collect();
        Self { entries, index, colours: blocks.colours() }
    }

    fn neighbour(&self, key: BlockKey, offset: [i32; 3]) -> Option<u32> {
        self.index.get(&std::array::from_fn(|axis| key[axis] + offset[axis])).copied()
    }

    /// The first pass over some of the entries.
    fn trace(&self, entries: &[Entry], first_entry: u32, surface: &Surface) -> Chunk {
        let mut chunk = Chunk::default();
        for (entry, n) in entries.iter().zip(first_entry..) {
            let behind =
                std::array::from_fn(|d| self.neighbour(entry.key, [d >> 2, d >> 1 & 1, d & 1].map(|i| i as i32)));
            let entry_at = |n: Option<u32>| n.map(|n| &self.entries[n as usize]);
            if !Sides::may_cross(&behind.map(|n| entry_at(n).map_or(&Sides::UNKNOWN, |entry| &entry.sides))) {
                continue;
            }
            let around = Neighbourhood::gather(surface, |offset| {
                entry_at(self.neighbour(entry.key, offset))
                    .map_or((Block::Uniform(0), &Sides::UNKNOWN), |entry| (entry.block, &entry.sides))
            });
            chunk.add(n, entry.key, behind, &around, self.colours);
        }
        chunk
    }
}

/// The part of the surface that one block owns.
struct Patch {
    entry: u32,
    /// The entries at the offsets `(dx, dy, dz)` of 0 or 1, numbered `4 dx + 2 dy + dz`.
    behind: [Option<u32>; 8],
    /// The edges that have its vertices, which are numbered in the order of the set.
    edges: EdgeSet,
    first_vertex: u32,
    num_cells: usize,
}

/// What the first pass makes of a run of blocks; vertices and cells of all patches in a row.
#[derive(Default)]
struct Chunk {
    patches: Vec<Patch>,
    vertices: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// As many, or none.
    colours: Vec<Rgba>,
    cells: Vec<Cell>,
    num_faces: usize,
}

static CASES: LazyLock<Cases> = LazyLock::new(Cases::derive);

impl Chunk {
    fn add(
        &mut self,
        entry: u32,
        key: BlockKey,
        behind: [Option<u32>; 8],
        around: &Neighbourhood,
        colours: Option<&Colours>,
    ) {
        let (first_vertex, first_cell) = (self.vertices.len() as u32, self.cells.len());
        let valid = around.valid_cells();
        let edges = around.owned_edges(&valid);
        around.add_vertices(key, &edges, &mut self.vertices, &mut self.normals);
        if let Some(colours) = colours {
            self.colours.extend(around.vertices(&edges).map(|vertex| colours::at(colours, key, &vertex)));
        }
        around.add_cells(&valid, &mut self.cells);
        let cells = &self.cells[first_cell..];
        self.num_faces += cells.iter().map(|cell| CASES.triangles(cell.case).len()).sum::<usize>();
        self.patches.push(Patch { entry, behind, edges, first_vertex, num_cells: cells.len() });
    }

    /// The second pass: the triangles of all cells. `patches` holds, for each entry that has a patch, the number of
    /// its first vertex and its edges.
    fn write_faces(&self, patches: &[Option<(u32, &EdgeSet)>], faces: &mut [[u32; 3]]) {
        let cases = &*CASES;
        let mut cells = self.cells.as_slice();
        let mut faces = faces.iter_mut();
        for patch in &self.patches {
            let behind = patch.behind.map(|entry| entry.and_then(|entry| patches[entry as usize]));
            for cell in cells.split_off(..patch.num_cells).expect("each cell was counted") {
                let mut vertices = [0; cases::EDGES];
                for edge in ones(cases.crossed[usize::from(cell.case)].into()) {
                    let (corner, axis) = cases::EDGE[edge];
                    let (block, offset) = cell.corner(corner);
                    let (first, edges) = behind[block].expect("a block owns the vertices of all valid cells around it");
                    vertices[edge] = first + edges.position(axis, offset);
                }
                for (triangle, face) in cases.triangles(cell.case).iter().zip(&mut faces) {
                    *face = triangle.map(|edge| vertices[usize::from(edge)]);
                }
            }
        }
    }
}

/// The numbers of the bits that are set, from the lowest.
#[inline]
fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = bits.trailing_zeros();
        (bits != 0).then(|| {
            bits &= bits - 1;
            lowest as usize
        })
    })
}

/// For each chunk the number of its first vertex.
fn running_sums(counts: impl Iterator<Item = usize>) -> Result<Vec<u32>> {
    let (mut sums, mut total) = (Vec::new(), 0);
    for count in counts {
        sums.push(total as u32);
        total += count;
    }
    if u32::try_from(total).is_err() {
        let reason = format!("the surface has {total} vertices, a mesh can number {}", u32::MAX);
        return Err(Error::Unsupported { operation: "mesh extraction", reason });
    }
    Ok(sums)
}

/// One vector with room for `count` items of each chunk, filled in by all threads.
fn gather<T: Copy + Default + Send>(
    chunks: &[Chunk],
    count: impl Fn(&Chunk) -> usize,
    write: impl Fn(&Chunk, &mut [T]) + Sync,
) -> Vec<T> {
    let mut all = vec![T::default(); chunks.iter().map(&count).sum()];
    let mut rest = all.as_mut_slice();
    let parts: Vec<_> =
        chunks.iter().map(|chunk| (chunk, rest.split_off_mut(..count(chunk)).expect("summed above"))).collect();
    parts.into_par_iter().for_each(|(chunk, part)| write(chunk, part));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_beyond_u32_are_refused() {
        let half = 1 << 31;
        assert_eq!(running_sums([half, half - 1, 0].into_iter()).unwrap(), [0, half as u32, u32::MAX]);
        let error = running_sums([half, half].into_iter()).unwrap_err();
        assert!(error.to_string().contains("4294967296 vertices"), "{error}");
    }
}
