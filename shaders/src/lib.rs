//! The WGSL of pyramap's GPU backend, in a crate of its own so that it is packaged with it.
//!
//! A kernel's source is put together here: the numbers of the method, which come from the crate `pyramap`; the structs of
//! [`layout`]; the buffers that the kernel works on; and the files beside this one, named like the stages of the CPU.
//!
//! Shaders need not know NaN and infinity. Where the CPU has them, they have [`NO_RETURN`] and [`HOLE`].

pub mod layout;

use Access::{Read, Write};
use pyramap::block::{BLOCK_EDGE, BLOCK_VOXELS};
use pyramap::cull::{DISTANCE_SLACK, MAX_LAYERS, PIXEL_SLACK, Reads};
use pyramap::log_odds::STEPS;
use pyramap::sensors::{
    ATAN_COEFFICIENTS, BOUND_SLACK, DistortedPinhole, Orthographic, Pinhole, Projection, Spherical,
};
use pyramap::update::UpdateRule;
use pyramap::update::area::{self, Area};
use pyramap::update::min_layer::MinLayer;
use pyramap::update::pyramid::Pyramid;
use std::f32::consts::{FRAC_PI_2, PI};

/// The range of a pixel without return, metres: more than any camera reaches, and small enough to reckon with.
pub const NO_RETURN: f32 = 1e30;
/// The surface of a texel without a reading.
pub const HOLE: f32 = -NO_RETURN;
/// A bound or a range that is not there: beyond all others.
const ABSENT: f32 = 1e38;
/// What stands for zero, and less, where the sign says something else.
const NEAREST: f32 = 1e-30;
/// A kernel of the pyramid halves layers so many times: windows of 8 x 8.
pub const TILE_LAYERS: usize = 3;
/// Workgroups of the kernels that go over layers: invocations along a row, and rows.
pub const LAYER_GROUP: [u32; 2] = [8, 4];
/// Workgroups of `cull`: blocks along each axis.
pub const CULL_GROUP: u32 = 4;
/// Workgroups of `arguments`: pages.
pub const ARGUMENTS_GROUP: usize = 64;
/// In place of a count of changed voxels: all have changed by the same, which may be nothing.
pub const UNIFORM: u32 = u32::MAX;

/// Words before the lists of blocks in [`Slot::Results`].
pub const RESULT_COUNTS: usize = 2;
/// The bit of a number's sign.
const SIGN: u32 = 1 << 31;
/// Words before those of each addition in [`Slot::Outcome`].
pub const OUTCOME_COUNTS: usize = 1;
/// Pages of the map that a kernel sees at a time; with three other buffers, fewer than the eight that all devices allow.
pub const POOL_PAGES: usize = 4;

/// A buffer that kernels work on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// [`layout::Frame`].
    Frame,
    /// Raw depth, row by row, an even number of pixels to each: two in a word, or one.
    Depth,
    /// Euclidean distance per metre of depth, likewise, as numbers.
    RangePerDepth,
    /// Parts of windows.
    Scratch,
    /// All layers: where each texel puts its surface, and `1 / sigma` if that is not the same for all.
    Surfaces,
    /// Bounds over cells of all layers.
    Bounds,
    /// The sensor table: value and rise for each interval.
    Table,
    /// The rows of a spherical sensor, likewise for elevations.
    Rows,
    /// What the host reads: [`RESULT_COUNTS`] counts, of free and of mixed blocks; then the free blocks; the mixed ones;
    /// and two words for each of these, the number of its voxels that change or [`UNIFORM`], and an increment.
    Results,
    /// Of indirect dispatches, one for each page of increments.
    Arguments,
    /// [`layout::Page`].
    Page,
    /// One page of increments.
    Increments,
    /// [`layout::Run`].
    Run,
    /// [`layout::Addition`], those of a whole commit.
    Additions,
    /// What the host reads of a commit: [`OUTCOME_COUNTS`] counts, of voxels that `i32` was too small for; then two words
    /// for each addition, the rank ([`of_rank`]) of the largest value in the block, and that of the smallest with all bits
    /// turned round.
    Outcome,
    /// Some pages of the map follow each other; this is the `n`-th of them.
    Pool(u32),
}

/// A kernel, ready to be compiled.
#[derive(Clone, Debug)]
pub struct Kernel {
    /// The name of its entry point.
    pub entry: &'static str,
    /// Its source.
    pub source: String,
    /// What its bindings 0, 1, ... of group 0 are.
    pub slots: Vec<Slot>,
}

/// How depth is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Two unsigned numbers of 16 bits in a word.
    U16,
    /// Floats.
    F32,
}

/// Whether sigma is the same at every range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sigma {
    /// It is.
    Constant,
    /// It grows.
    Growing,
}

/// How a sensor projects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// [`Pinhole`].
    Pinhole,
    /// [`DistortedPinhole`].
    DistortedPinhole,
    /// [`Spherical`].
    Spherical,
    /// [`Orthographic`].
    Orthographic,
}

/// Ranges, and all of the pyramid that can be told from 8 x 8 pixels, for the layers `first..count`.
pub fn tiles(format: Format, sigma: Sigma, first: usize, count: usize) -> Kernel {
    let depths = match format {
        Format::U16 => include_str!("ranges/u16.wgsl"),
        Format::F32 => include_str!("ranges/f32.wgsl"),
    };
    let files = [
        sigma.file(),
        depths,
        include_str!("ranges.wgsl"),
        include_str!("surfaces.wgsl"),
        include_str!("pyramid.wgsl"),
        include_str!("pyramid/tiles.wgsl"),
    ];
    let buffers =
        [Read(Slot::Frame), Read(Slot::Depth), Read(Slot::RangePerDepth), Write(Slot::Scratch), Write(Slot::Surfaces)];
    kernel("tiles", &[("FIRST", first as u32), ("COUNT", count as u32)], &buffers, &files)
}

/// The pyramid's pass number `pass`, 1 or more: three more layers of the parts that the one before left.
pub fn windows(sigma: Sigma, pass: usize) -> Kernel {
    let files = [
        sigma.file(),
        include_str!("surfaces.wgsl"),
        include_str!("pyramid.wgsl"),
        include_str!("pyramid/windows.wgsl"),
    ];
    let buffers = [Read(Slot::Frame), Write(Slot::Scratch), Write(Slot::Surfaces)];
    kernel("windows", &[("PASS", pass as u32)], &buffers, &files)
}

/// Bounds over cells of two, four and eight times `2^finer` texels; for `finer` 0 of the texels themselves.
pub fn bounds(sigma: Sigma, finer: usize) -> Kernel {
    let (from, buffers) = match finer {
        0 => (include_str!("surfaces/texels.wgsl"), vec![Read(Slot::Frame), Read(Slot::Surfaces), Write(Slot::Bounds)]),
        _ => (include_str!("surfaces/cells.wgsl"), vec![Read(Slot::Frame), Write(Slot::Bounds)]),
    };
    let files = [sigma.file(), include_str!("surfaces/union.wgsl"), from, include_str!("surfaces/bounds.wgsl")];
    kernel("bounds_of_cells", &[("FINER", finer as u32)], &buffers, &files)
}

/// Lists of free and mixed blocks.
pub fn cull(rule: UpdateRule, sensor: SensorKind) -> Option<Kernel> {
    let (rule_constants, projection) = (rule_constants(rule)?, sensor.files());
    let files = [
        rule_constants.as_str(),
        projection.as_str(),
        include_str!("surfaces/union.wgsl"),
        include_str!("positions.wgsl"),
        include_str!("classify.wgsl"),
        include_str!("cull.wgsl"),
    ];
    let mut buffers = vec![Read(Slot::Frame), Read(Slot::Bounds), Write(Slot::Results)];
    buffers.extend(sensor.buffer());
    Some(kernel("cull", &[], &buffers, &files))
}

/// From the number of mixed blocks to workgroups of `update`.
pub fn arguments() -> Kernel {
    let buffers = [Read(Slot::Frame), Write(Slot::Results), Write(Slot::Arguments)];
    kernel("arguments_of_pages", &[], &buffers, &[include_str!("arguments.wgsl")])
}

/// Increments of mixed blocks. There is none for the rules `ideal` and `rays`.
pub fn update(rule: UpdateRule, sigma: Sigma, sensor: SensorKind) -> Option<Kernel> {
    let bilinear = include_str!("update/bilinear.wgsl");
    let rule_files = match rule {
        UpdateRule::Pyramid => [bilinear, include_str!("update/pyramid.wgsl")],
        UpdateRule::MinLayer => [bilinear, include_str!("update/min_layer.wgsl")],
        UpdateRule::Area => ["", include_str!("update/area.wgsl")],
        UpdateRule::Ideal | UpdateRule::Rays => return None,
    };
    let (rule_constants, projection) = (rule_constants(rule)?, sensor.files());
    let files = [
        rule_constants.as_str(),
        projection.as_str(),
        sigma.file(),
        include_str!("surfaces/union.wgsl"),
        include_str!("positions.wgsl"),
        include_str!("classify.wgsl"),
        include_str!("update.wgsl"),
        rule_files[0],
        rule_files[1],
    ];
    let mut buffers = vec![
        Read(Slot::Frame),
        Read(Slot::Page),
        Read(Slot::Surfaces),
        Read(Slot::Bounds),
        Read(Slot::Table),
        Write(Slot::Results),
        Write(Slot::Increments),
    ];
    buffers.extend(sensor.buffer());
    Some(kernel("update", &[], &buffers, &files))
}

/// The number of a rank: ranks are unsigned, in the order of the signed numbers.
pub const fn of_rank(rank: u32) -> i32 {
    (rank ^ SIGN) as i32
}

/// Adds to the blocks of [`POOL_PAGES`] pages of the map.
pub fn commit() -> Kernel {
    let pages = 0..POOL_PAGES as u32;
    let buffers: Vec<_> = [Read(Slot::Run), Read(Slot::Additions), Read(Slot::Increments), Write(Slot::Outcome)]
        .into_iter()
        .chain(pages.clone().map(|n| Write(Slot::Pool(n))))
        .collect();
    // WGSL has no arrays of buffers.
    let load: String = pages.clone().map(|n| format!("        case {n}u: {{ return pool_{n}[at]; }}\n")).collect();
    let store: String = pages.map(|n| format!("        case {n}u: {{ pool_{n}[at] = value; }}\n")).collect();
    let access = format!(
        "fn load(page: u32, at: u32) -> i32 {{\n    switch page {{\n{load}        default: {{ return 0; }}\n    }}\n}}\n\n\
         fn store(page: u32, at: u32, value: i32) {{\n    switch page {{\n{store}        default: {{}}\n    }}\n}}\n\n"
    );
    kernel("commit", &[], &buffers, &[access.as_str(), include_str!("commit.wgsl")])
}

impl Sigma {
    fn file(self) -> &'static str {
        match self {
            Sigma::Constant => include_str!("surfaces/constant.wgsl"),
            Sigma::Growing => include_str!("surfaces/growing.wgsl"),
        }
    }
}

impl SensorKind {
    /// What the kernels ask of a sensor.
    fn files(self) -> String {
        let frustum = include_str!("sensors/frustum.wgsl");
        let (perspective, common, sensor) = match self {
            SensorKind::Pinhole => (Pinhole::PERSPECTIVE, frustum.into(), include_str!("sensors/pinhole.wgsl")),
            SensorKind::DistortedPinhole => {
                (DistortedPinhole::PERSPECTIVE, frustum.into(), include_str!("sensors/distorted.wgsl"))
            }
            SensorKind::Spherical => (Spherical::PERSPECTIVE, angle(), include_str!("sensors/spherical.wgsl")),
            SensorKind::Orthographic => {
                (Orthographic::PERSPECTIVE, String::new(), include_str!("sensors/orthographic.wgsl"))
            }
        };
        format!("const PERSPECTIVE: bool = {perspective};\n")
            + include_str!("sensors/projection.wgsl")
            + &common
            + sensor
    }

    /// What it is read from, beside the frame.
    fn buffer(self) -> Option<Access> {
        (self == SensorKind::Spherical).then_some(Read(Slot::Rows))
    }
}

/// The angle of a point, with the CPU's polynomial.
fn angle() -> String {
    let coefficients = ATAN_COEFFICIENTS.map(|c| format!("{c:?}"));
    let mut series = coefficients.iter().rev();
    let highest = series.next().expect("there are eight").clone();
    let series = series.fold(highest, |series, coefficient| format!("({series} * squared + {coefficient})"));
    let function = format!("fn atan_series(squared: f32) -> f32 {{\n    return {series};\n}}\n\n");
    function + include_str!("sensors/angle.wgsl")
}

/// What `classify` must know of a rule: how far beyond a point's texel it reads, and whether it blends two layers.
fn rule_constants(rule: UpdateRule) -> Option<String> {
    let (reach, blended) = match rule {
        UpdateRule::Pyramid => (Pyramid::REACH, 1),
        UpdateRule::MinLayer => (MinLayer::REACH, 0),
        UpdateRule::Area => (Area::<Pinhole>::REACH, 0),
        UpdateRule::Ideal | UpdateRule::Rays => return None,
    };
    Some(format!("const REACH: f32 = {reach:?};\nconst BLENDED: u32 = {blended}u;\n"))
}

/// A buffer, and whether a kernel writes to it.
enum Access {
    Read(Slot),
    Write(Slot),
}

impl Access {
    fn slot(&self) -> Slot {
        match *self {
            Read(slot) | Write(slot) => slot,
        }
    }

    fn declaration(&self) -> String {
        let (name, content) = match self.slot() {
            Slot::Frame => return "var<uniform> frame: Frame".into(),
            Slot::Page => return "var<uniform> page: Page".into(),
            Slot::Run => return "var<uniform> run: Run".into(),
            Slot::Pool(n) => return format!("var<storage, read_write> pool_{n}: array<i32>"),
            Slot::Depth => ("depth", "array<u32>"),
            Slot::RangePerDepth => ("range_per_depth", "array<vec2<f32>>"),
            Slot::Scratch => ("scratch", "array<f32>"),
            Slot::Surfaces => ("surfaces", "array<Surface>"),
            Slot::Bounds => ("bounds", "array<vec2<f32>>"),
            Slot::Table => ("table", "array<vec2<f32>>"),
            Slot::Rows => ("rows", "array<vec2<f32>>"),
            Slot::Results => ("results", "Results"),
            Slot::Arguments => ("arguments", "array<u32>"),
            Slot::Increments => ("increments", "array<i32>"),
            Slot::Additions => ("additions", "array<Addition>"),
            Slot::Outcome => ("outcome", "Outcome"),
        };
        let access = if matches!(self, Write(_)) { "read_write" } else { "read" };
        format!("var<storage, {access}> {name}: {content}")
    }
}

/// Puts a kernel's source together.
fn kernel<File: AsRef<str>>(
    entry: &'static str,
    numbers: &[(&str, u32)],
    buffers: &[Access],
    files: &[File],
) -> Kernel {
    let mut source = constants();
    for (name, number) in numbers {
        source += &format!("const {name}: u32 = {number}u;\n");
    }
    source += &layout::structs();
    for (binding, buffer) in buffers.iter().enumerate() {
        source += &format!("@group(0) @binding({binding}) {};\n", buffer.declaration());
    }
    if buffers.iter().any(|buffer| buffer.slot() == Slot::Frame) {
        source += include_str!("common.wgsl");
    }
    files.iter().for_each(|file| source += file.as_ref());
    Kernel { entry, source, slots: buffers.iter().map(Access::slot).collect() }
}

/// The numbers that all kernels may use. Rust prints floats so that they are read back as the same.
fn constants() -> String {
    let mut source = String::new();
    for (name, number) in [
        ("NO_RETURN", NO_RETURN),
        ("HOLE", HOLE),
        ("ABSENT", ABSENT),
        ("NEAREST", NEAREST),
        ("DISTANCE_SLACK", DISTANCE_SLACK),
        ("PIXEL_SLACK", PIXEL_SLACK),
        ("STEPS", STEPS),
        ("BOUND_SLACK", BOUND_SLACK),
        ("TOLERANCE", area::TOLERANCE),
        ("PI", PI),
        ("HALF_PI", FRAC_PI_2),
    ] {
        source += &format!("const {name}: f32 = {number:?};\n");
    }
    for (name, number) in [
        ("BLOCK_EDGE", BLOCK_EDGE),
        ("BLOCK_VOXELS", BLOCK_VOXELS),
        ("MAX_LAYERS", MAX_LAYERS),
        ("TILE_LAYERS", TILE_LAYERS),
        ("UNIFORM", UNIFORM as usize),
        ("LAYER_GROUP_X", LAYER_GROUP[0] as usize),
        ("LAYER_GROUP_Y", LAYER_GROUP[1] as usize),
        ("CULL_GROUP", CULL_GROUP as usize),
        ("ARGUMENTS_GROUP", ARGUMENTS_GROUP),
        ("PAIRS", layout::PAIRS),
        ("MORE", area::MORE),
        ("SIGN", SIGN as usize),
        ("FROM_BASE", layout::FROM_BASE as usize),
        ("SAME_FOR_ALL", layout::SAME_FOR_ALL as usize),
    ] {
        source += &format!("const {name}: u32 = {number}u;\n");
    }
    source
}

#[cfg(test)]
mod tests;
