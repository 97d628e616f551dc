//! What the stages must know of a frame but its pixels, as the shaders want it.

use super::sensors::Described;
use nalgebra::Vector3;
use pyramap::block::{BLOCK_EDGE, BlockKey};
use pyramap::config::GridConfig;
use pyramap::cull::{Eighths, Reads, frustum_blocks};
use pyramap::pyramid::Selection;
use pyramap::sensor::{SensorModel, SensorTable, SurfaceOffset};
use pyramap::sensors::Projection;
use pyramap::update::area::Area;
use pyramap::update::min_layer::MinLayer;
use pyramap::update::pyramid::Pyramid;
use pyramap::update::{UpdateRule, free_increment};
use pyramap::view::{Points, View};
use pyramap::{BeyondMaxRange, Depth};
use pyramap_shaders::layout::{Cube, Frame, HALVED, Halved};
use pyramap_shaders::{NO_RETURN, TILE_LAYERS};
use std::ops::Range;

/// The layers of a frame, and where in the buffers they lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layers {
    /// The first layer that is made, and one more than the last.
    pub made: (usize, usize),
    /// The image halved `i` times.
    pub halved: [Halved; HALVED],
    /// See [`Frame::coarsest`].
    pub coarsest: usize,
    /// See [`Frame::parts`].
    pub parts: [u32; 4],
    /// Texels of all layers.
    pub num_texels: usize,
    /// Cells of all bounds.
    pub num_cells: usize,
    /// Numbers that are kept between the passes of the pyramid.
    pub num_parts: usize,
}

/// Cells along each side that hold a layer's coarsest bounds: as many as `classify` reads.
const COARSEST_CELLS: usize = 3;

impl Layers {
    /// For an image and the layers made of it.
    pub fn new(width: usize, height: usize, made: Range<usize>) -> Self {
        let size = |i: usize| (width.div_ceil(1 << i), height.div_ceil(1 << i));
        let area = |i: usize| size(i).0 * size(i).1;
        let coarsest = (0..HALVED).find(|&i| size(i).0.max(size(i).1) <= COARSEST_CELLS);
        let mut layers = Self {
            made: (made.start, made.end),
            halved: [Halved::default(); HALVED],
            coarsest: coarsest.expect("images are smaller"),
            parts: [0; 4],
            num_texels: made.clone().map(area).sum(),
            num_cells: 0,
            num_parts: 0,
        };
        let mut texels = 0;
        for (i, halved) in layers.halved.iter_mut().enumerate() {
            (halved.width, halved.height) = (size(i).0 as u32, size(i).1 as u32);
            if i >= made.start {
                halved.texels = texels;
                texels += area(i) as u32;
            }
        }
        for i in made.clone() {
            layers.halved[i].bounds = (layers.num_cells as u32).wrapping_sub(layers.halved[i + 1].texels);
            layers.num_cells += (i + 1..=i + layers.coarsest_bounds(i)).map(area).sum::<usize>();
        }
        for pass in layers.passes() {
            let finer = pass * TILE_LAYERS;
            layers.parts[pass - 1] = layers.num_parts as u32;
            layers.num_parts += (made.end - 1 - finer) * area(finer);
        }
        layers
    }

    /// The coarsest cells over which a layer has bounds, as a power of two of texels.
    pub fn coarsest_bounds(&self, layer: usize) -> usize {
        self.coarsest.saturating_sub(layer).max(1)
    }

    /// The pyramid's passes after the first.
    pub fn passes(&self) -> Range<usize> {
        1..(self.made.1 + 1) / TILE_LAYERS
    }
}

/// What a sensor model gives to all its frames.
pub struct Model {
    /// The sensor model's table.
    pub table: SensorTable,
    model: SensorModel,
}

impl Model {
    /// Tabulates a sensor model.
    pub fn new(model: &SensorModel) -> Self {
        Self { table: SensorTable::new(model), model: *model }
    }

    /// Fills in what all frames have in common.
    fn describe(&self, frame: &mut Frame) {
        let Self { table, model } = self;
        let [s0, s1, s2] = model.sigma().map(|s| s as f32);
        frame.sigma = [s0, s1, s2, 0.0];
        frame.inv_sigma = (1.0 / model.sigma_at(0.0)) as f32;
        (frame.offset, frame.offset_in_sigmas) = match model.surface_offset() {
            _ if model.is_constant() => (model.surface(0.0) as f32, 0.0),
            SurfaceOffset::Metres(offset) => (offset as f32, 0.0),
            SurfaceOffset::Centred => (0.0, model.zero_crossing() as f32),
        };
        frame.cutoff = table.cutoff();
        frame.intervals_per_sigma = table.intervals_per_sigma();
        frame.free = free_increment(table);
    }
}

/// The layers that a rule reads of a view.
pub fn layers<P: Projection>(config: &GridConfig, view: &View<P>) -> Layers {
    let [width, height] = view.projection.image().map(|side| side as usize);
    Layers::new(width, height, config.update.layers(view, view.projection.num_layers()))
}

/// Describes a frame to the shaders, but for the room in its buffers. Returns the first block of the box around the
/// frustum as well, from which blocks are counted.
pub fn frame<P: Described>(
    config: &GridConfig,
    model: &Model,
    view: &View<P>,
    layers: &Layers,
    depth: &Depth,
) -> (Frame, BlockKey) {
    let (low, high) = frustum_blocks(view);
    let blocks: [u32; 3] = std::array::from_fn(|axis| (high[axis] - low[axis] + 1) as u32);
    let mut frame = Frame {
        t: [[0.0; 4]; 4],
        halved: layers.halved,
        blocks: [blocks[0], blocks[1], blocks[2], 0],
        parts: layers.parts,
        axes: [0, 1, 2].map(|k| four(view.to_camera(&Vector3::ith(k, 1.0)))),
        image: view.projection.image(),
        max_range: view.max_range,
        t_0: view.t_0 as f32,
        beyond: match config.beyond_max_range {
            BeyondMaxRange::Free => NO_RETURN,
            BeyondMaxRange::Ignore => 0.0,
        },
        depth_scale: if let Depth::U16 { scale, .. } = depth { *scale as f32 } else { 1.0 },
        pairs: layers.halved[0].width.div_ceil(2),
        first: layers.made.0 as u32,
        count: layers.made.1 as u32,
        coarsest: layers.coarsest as u32,
        cull: u32::from(config.cull),
        ..Frame::default()
    };
    if config.update.selection::<P>() == Selection::Nearest {
        for i in 0..layers.made.1 {
            frame.t[(i + 1) / 4][(i + 1) % 4] = (view.t_0 / f64::from(1u32 << i)) as f32;
        }
    }
    model.describe(&mut frame);
    view.projection.describe(&mut frame);
    place_blocks(&mut frame, view, low, blocks);
    match config.update {
        UpdateRule::MinLayer => place_cubes::<MinLayer, P>(&mut frame, view),
        UpdateRule::Area => place_cubes::<Area<P>, P>(&mut frame, view),
        _ => place_cubes::<Pyramid, P>(&mut frame, view),
    }
    let area = Area::new(view);
    frame.samples = all(&area.few);
    frame.more_samples = area.more.each_ref().map(all);
    (frame, low)
}

/// Where the box's first block lies, and the way from block to block. Each is split in two: upper parts that are
/// multiples of one power of two, so large that all sums of multiples of them fit in an `f32`, and what remains.
fn place_blocks<P: Projection>(frame: &mut Frame, view: &View<P>, low: BlockKey, blocks: [u32; 3]) {
    let to_camera = |v: Vector3<f64>| view.pose.rotation.transpose() * v;
    let origin = to_camera(view.offset_of(low, 1));
    let steps = [0, 1, 2].map(|k| to_camera(Vector3::ith(k, BLOCK_EDGE as f64 * view.voxel_size)));
    let reach = steps.iter().zip(blocks).fold(origin.abs(), |sum, (step, n)| sum + step.abs() * f64::from(n));
    // 24 bits, less one since rounding may add to the sum.
    let unit = (reach.max().log2().ceil() - 23.0).exp2();
    let split = |v: Vector3<f64>| {
        let upper = (v / unit).map(f64::round) * unit;
        [upper, v - upper].map(|v| four([v.x as f32, v.y as f32, v.z as f32]))
    };
    frame.origin = split(origin);
    for (k, step) in steps.into_iter().enumerate() {
        [frame.steps[k], frame.steps[3 + k]] = split(step);
    }
}

/// The cubes that are classified, and the voxels in them.
fn place_cubes<R: Reads, P: Described>(frame: &mut Frame, view: &View<P>) {
    let eighths = |edge| Eighths::new::<R>(view, edge);
    let cube = |eighths: &Eighths<P>| {
        let mut cube = Cube { voxels: eighths.voxels, projected: eighths.projected, ..Cube::default() };
        P::describe_cube(&eighths.size, &mut cube);
        cube
    };
    let pairs = eighths(BLOCK_EDGE / 2);
    frame.block = cube(&eighths(2 * BLOCK_EDGE));
    frame.pair = cube(&pairs);
    frame.quarter_offsets = all(&eighths(BLOCK_EDGE).offsets);
    frame.pair_offsets = all(&pairs.offsets);
    frame.voxel_offsets = all(&eighths(BLOCK_EDGE / 4).offsets);
}

fn all(points: &Points) -> [[f32; 4]; 8] {
    std::array::from_fn(|lane| four(points.lane(lane)))
}

fn four([x, y, z]: [f32; 3]) -> [f32; 4] {
    [x, y, z, 0.0]
}
