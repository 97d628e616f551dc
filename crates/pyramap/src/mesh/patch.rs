//! One block's part of the surface: which of its edges carry a vertex, which of its cells draw, and the vertices.

use super::colours::OnEdge;
use super::ones;
use super::sides::{BlockSlab, SLAB, Sides, Surface};
use crate::block::{BLOCK_EDGE, Block, BlockKey, voxel_offset};

/// How near to a voxel's centre a vertex may come, in voxels. Were it to reach the centre, vertices of several edges
/// would coincide there and triangles collapse; at this distance they differ in `f32` up to 2^14 voxels from the
/// origin. Moving a vertex that far is nothing against the accuracy of a map.
const MARGIN: f64 = 1.0 / 256.0;

/// A set of edges of the grid that start in one block, and their order: by axis, then by first voxel.
pub(super) struct EdgeSet {
    /// For each axis and `x` the first voxels.
    slabs: [[BlockSlab; BLOCK_EDGE]; 3],
    /// The edges before each slab.
    before: [[u16; BLOCK_EDGE]; 3],
}

impl EdgeSet {
    fn new(slabs: [[BlockSlab; BLOCK_EDGE]; 3]) -> Self {
        let mut total = 0;
        let before = slabs.map(|axis| {
            axis.map(|slab| {
                let before = total;
                total += slab.count_ones() as u16;
                before
            })
        });
        Self { slabs, before }
    }

    /// The edges in their order, by axis and first voxel.
    fn each(&self) -> impl Iterator<Item = (usize, [usize; 3])> {
        let slabs = self
            .slabs
            .iter()
            .enumerate()
            .flat_map(|(axis, slabs)| slabs.iter().enumerate().map(move |(x, &slab)| (axis, x, slab)));
        slabs.flat_map(|(axis, x, slab)| ones(slab).map(move |bit| (axis, [x, bit / BLOCK_EDGE, bit % BLOCK_EDGE])))
    }

    /// The position in the set of the edge that runs along an axis from the voxel at an offset.
    #[inline]
    pub fn position(&self, axis: u8, offset: usize) -> u32 {
        let (x, bit) = (offset / SLAB, offset % SLAB);
        let slab = self.slabs[usize::from(axis)][x];
        u32::from(self.before[usize::from(axis)][x]) + (slab & ((1 << bit) - 1)).count_ones()
    }
}

/// A cell that draws.
pub(super) struct Cell {
    /// The first corner, as a voxel of its block.
    voxel: [u8; 3],
    /// The corners inside the surface; see [`super::cases`].
    pub case: u8,
}

impl Cell {
    /// The block that holds a corner, numbered `4 dx + 2 dy + dz` by its offset from the cell's, and where in it.
    #[inline]
    pub fn corner(&self, corner: u8) -> (usize, usize) {
        let at = |axis: usize| usize::from(self.voxel[axis] + (corner >> (2 - axis) & 1));
        let [x, y, z] = [at(0), at(1), at(2)];
        let edge = BLOCK_EDGE;
        (x / edge * 4 + y / edge * 2 + z / edge, voxel_offset(x % edge, y % edge, z % edge))
    }
}

/// Samples along an axis: the block, one before it for the cells that share its edges, two behind it for the cells
/// and gradients of its last edges.
const SPAN: usize = BLOCK_EDGE + 3;
const STRIDE: [usize; 3] = [SPAN * SPAN, SPAN, 1];

/// One bit for each sample of a slab: bit `11 y + z`.
type Slab = u128;

/// The samples of a block and around it. Sample `(x, y, z)` is voxel `(x - 1, y - 1, z - 1)` of the block.
pub(super) struct Neighbourhood<'a> {
    surface: &'a Surface,
    samples: [i32; SPAN * SPAN * SPAN],
    known: [Slab; SPAN],
    inside: [Slab; SPAN],
}

impl<'a> Neighbourhood<'a> {
    /// Reads the 27 blocks at offsets of -1, 0, 1.
    pub fn gather(surface: &'a Surface, block_at: impl Fn([i32; 3]) -> (Block<'a>, &'a Sides)) -> Self {
        let blocks: [_; 27] =
            std::array::from_fn(|n| block_at([n / 9, n / 3 % 3, n % 3].map(|offset| offset as i32 - 1)));
        // Which of the three blocks along an axis, and which of its voxels.
        let place = |sample: usize| {
            let voxel = sample + (BLOCK_EDGE - 1);
            (voxel / BLOCK_EDGE, voxel % BLOCK_EDGE)
        };
        let mut this = Self { surface, samples: [0; _], known: [0; SPAN], inside: [0; SPAN] };
        for (n, row) in this.samples.chunks_exact_mut(SPAN).enumerate() {
            let (x, y) = (n / SPAN, n % SPAN);
            let ((block_x, voxel_x), (block_y, voxel_y)) = (place(x), place(y));
            let [before, own, behind] = [0, 1, 2].map(|block_z| &blocks[(block_x * 3 + block_y) * 3 + block_z]);

            let offset = voxel_offset(voxel_x, voxel_y, 0);
            row[0] = before.0.value(offset + BLOCK_EDGE - 1);
            match own.0 {
                Block::Uniform(evidence) => row[1..=BLOCK_EDGE].fill(evidence),
                Block::Narrow(values) => {
                    let narrow = &values[offset..offset + BLOCK_EDGE];
                    row[1..=BLOCK_EDGE].iter_mut().zip(narrow).for_each(|(out, &value)| *out = i32::from(value));
                }
                Block::Dense(values) => row[1..=BLOCK_EDGE].copy_from_slice(&values[offset..offset + BLOCK_EDGE]),
            }
            row[BLOCK_EDGE + 1] = behind.0.value(offset);
            row[BLOCK_EDGE + 2] = behind.0.value(offset + 1);

            let bits = |slabs: fn(&Sides) -> &[BlockSlab; BLOCK_EDGE]| {
                let row = |sides: &Sides| slabs(sides)[voxel_x] >> (BLOCK_EDGE * voxel_y) & 0xFF;
                let bits =
                    row(before.1) >> (BLOCK_EDGE - 1) | row(own.1) << 1 | (row(behind.1) & 3) << (BLOCK_EDGE + 1);
                Slab::from(bits) << (y * SPAN)
            };
            let inside = bits(|sides| &sides.inside);
            this.inside[x] |= inside;
            this.known[x] |= inside | bits(|sides| &sides.outside);
        }
        this
    }

    /// The cells, by their first corner, whose corners are all known. The shifts run past the end of rows and slabs:
    /// where `y` or `z` exceeds 8 the bits mean nothing, and none of the block's edges is near enough to ask for them.
    pub fn valid_cells(&self) -> [Slab; BLOCK_EDGE + 1] {
        std::array::from_fn(|x| {
            let edges = self.known[x] & self.known[x + 1];
            let faces = edges & edges >> STRIDE[2];
            faces & faces >> STRIDE[1]
        })
    }

    /// The block's edges that cross the surface and belong to a valid cell.
    pub fn owned_edges(&self, valid: &[Slab; BLOCK_EDGE + 1]) -> EdgeSet {
        let mut slabs = [[0; BLOCK_EDGE]; 3];
        for x in 1..=BLOCK_EDGE {
            let inside = self.inside[x];
            let crossed = [inside ^ self.inside[x + 1], inside ^ inside >> STRIDE[1], inside ^ inside >> STRIDE[2]];
            // Edges of a valid cell: the cells that start with the edge, one before it across, or both.
            let (along_x, across_x) = (valid[x], valid[x] | valid[x - 1]);
            let around = [
                with_next(with_next(along_x, STRIDE[1]), STRIDE[2]),
                with_next(across_x, STRIDE[2]),
                with_next(across_x, STRIDE[1]),
            ];
            for axis in 0..3 {
                slabs[axis][x - 1] = own_bits(crossed[axis] & around[axis]);
            }
        }
        EdgeSet::new(slabs)
    }

    /// Appends the block's cells that are valid and cross the surface.
    pub fn add_cells(&self, valid: &[Slab; BLOCK_EDGE + 1], cells: &mut Vec<Cell>) {
        for (x, valid) in valid.iter().enumerate().skip(1) {
            let (low, high) = (self.inside[x], self.inside[x + 1]);
            let (any, all) = (low | high, low & high);
            let (any, all) = (any | any >> STRIDE[2], all & all >> STRIDE[2]);
            let (any, all) = (any | any >> STRIDE[1], all & all >> STRIDE[1]);
            for bit in ones(own_bits(valid & any & !all)) {
                let (y, z) = (bit / BLOCK_EDGE, bit % BLOCK_EDGE);
                let first = (y + 1) * SPAN + z + 1;
                let face = |slab: Slab| ((slab >> first) as u8 & 3) | ((slab >> (first + SPAN)) as u8 & 3) << 2;
                cells.push(Cell { voxel: [x - 1, y, z].map(|i| i as u8), case: face(low) | face(high) << 4 });
            }
        }
    }

    /// Appends position and normal of the vertex on each edge.
    pub fn add_vertices(
        &self,
        key: BlockKey,
        edges: &EdgeSet,
        vertices: &mut Vec<[f32; 3]>,
        normals: &mut Vec<[f32; 3]>,
    ) {
        let first_voxel = key.map(|i| f64::from(i) * BLOCK_EDGE as f64);
        for OnEdge { voxel, axis, fraction } in self.vertices(edges) {
            vertices.push(std::array::from_fn(|i| {
                let along = if i == axis { fraction } else { 0.0 };
                ((first_voxel[i] + voxel[i] as f64 + 0.5 + along) * self.surface.voxel_size) as f32
            }));
            normals.push(self.normal(sample_of(voxel), axis, fraction));
        }
    }

    /// Where on their edges the vertices lie.
    pub fn vertices(&self, edges: &EdgeSet) -> impl Iterator<Item = OnEdge> {
        edges.each().map(|(axis, voxel)| OnEdge { voxel, axis, fraction: self.crossing(sample_of(voxel), axis) })
    }

    /// Where the edge from a sample meets the surface, as a fraction of its length: evidence is linear between.
    fn crossing(&self, sample: usize, axis: usize) -> f64 {
        let [start, end] = [sample, sample + STRIDE[axis]].map(|i| f64::from(self.samples[i]));
        ((self.surface.level - start) / (end - start)).clamp(MARGIN, 1.0 - MARGIN)
    }

    /// The direction in which evidence falls: its gradient at both ends of an edge, interpolated.
    fn normal(&self, sample: usize, axis: usize, fraction: f64) -> [f32; 3] {
        let end = sample + STRIDE[axis];
        let mut rise: [f64; 3] = std::array::from_fn(|i| {
            self.slope(sample, STRIDE[i]) * (1.0 - fraction) + self.slope(end, STRIDE[i]) * fraction
        });
        // Central differences look past a wall thinner than two voxels, and may then point into it, or vanish. The
        // edge itself has the right sign.
        let along = f64::from(self.samples[end]) - f64::from(self.samples[sample]);
        if rise[axis] * along <= 0.0 {
            rise[axis] = along;
        }
        let scale = -1.0 / rise.iter().map(|d| d * d).sum::<f64>().sqrt();
        rise.map(|d| (d * scale) as f32)
    }

    /// Evidence per voxel along an axis: the central difference, or a one-sided one beside an unknown voxel, or zero
    /// between two.
    fn slope(&self, sample: usize, stride: usize) -> f64 {
        let [before, here, behind] = [sample - stride, sample, sample + stride].map(|i| self.samples[i]);
        let (low, high) = (self.surface.is_known(before), self.surface.is_known(behind));
        let rise = f64::from(if high { behind } else { here }) - f64::from(if low { before } else { here });
        if low && high { rise / 2.0 } else { rise }
    }
}

/// The sample of one of the block's voxels.
fn sample_of(voxel: [usize; 3]) -> usize {
    (0..3).map(|i| (voxel[i] + 1) * STRIDE[i]).sum()
}

/// The bits of a slab, and those one stride further.
fn with_next(slab: Slab, stride: usize) -> Slab {
    slab | slab << stride
}

/// The block's own voxels of a slab of samples.
fn own_bits(slab: Slab) -> BlockSlab {
    let row = |y: usize| (slab >> ((y + 1) * SPAN + 1)) as u64 & 0xFF;
    (0..BLOCK_EDGE).fold(0, |bits, y| bits | row(y) << (y * BLOCK_EDGE))
}
