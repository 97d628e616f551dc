//! What crosses between host and shaders: each struct is written here once, and its WGSL is made from it.

use pyramap::block::BLOCK_EDGE;
use pyramap::update::area::MORE;

/// A type that shaders know under a name of theirs.
trait Wgsl {
    fn name() -> String;
}

/// A type that arrays in a uniform buffer may hold: its size is a multiple of 16 bytes.
trait Element: Wgsl {}

macro_rules! named {
    ($($rust:ty => $wgsl:literal),*) => { $(impl Wgsl for $rust { fn name() -> String { $wgsl.into() } })* };
}

named! { u32 => "u32", i32 => "i32", f32 => "f32", [f32; 2] => "vec2<f32>", [f32; 4] => "vec4<f32>", [u32; 4] => "vec4<u32>" }

impl Element for [f32; 4] {}
impl Element for [u32; 4] {}
impl<T: Element, const N: usize> Element for [T; N] {}

impl<T: Element, const N: usize> Wgsl for [T; N] {
    fn name() -> String {
        format!("array<{}, {N}>", T::name())
    }
}

/// Declares structs for Rust and for WGSL. Padding is written out, and a test compares both layouts.
macro_rules! shared {
    ($($(#[$doc:meta])* struct $name:ident { $($(#[$field_doc:meta])* $field:ident: $type:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
            #[repr(C)]
            pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }

            impl Wgsl for $name {
                fn name() -> String {
                    stringify!($name).into()
                }
            }

            impl Element for $name {}
        )*

        /// The WGSL of all of them.
        pub(crate) fn structs() -> String {
            let mut source = String::new();
            $(
                source += concat!("struct ", stringify!($name), " {\n");
                $(source += &format!("    {}: {},\n", stringify!($field), <$type as Wgsl>::name());)*
                source += "}\n\n";
            )*
            source
        }

        /// Name, size, and names and offsets of the fields of each of them.
        #[cfg(test)]
        pub(crate) fn layouts() -> Vec<(&'static str, usize, Vec<(&'static str, usize)>)> {
            vec![$((
                stringify!($name),
                size_of::<$name>(),
                vec![$((stringify!($field), std::mem::offset_of!($name, $field))),*],
            )),*]
        }
    };
}

/// A layer is made of the image halved so many times at most; one more and its last bounds are over two texels.
pub const HALVED: usize = 16;
/// Cubes of 2 x 2 x 2 voxels in a block, and lanes of a workgroup.
pub const PAIRS: usize = (BLOCK_EDGE / 2).pow(3);

/// The block is new: it starts from one value. A bit of [`Addition::kind`].
pub const FROM_BASE: u32 = 1;
/// All voxels get one increment. A bit of [`Addition::kind`].
pub const SAME_FOR_ALL: u32 = 2;

shared! {
    /// How far the cubes of one size reach around their centres; see [`pyramap::cull::Eighths`].
    struct Cube {
        /// Half its extent across the sides of a pinhole camera's frustum; in columns and rows of an orthographic one.
        across_sides: [f32; 4],
        /// Half the edge of the cube that holds the voxel centres, metres.
        voxels: f32,
        /// Half the edge of the cube that holds all that is projected, metres.
        projected: f32,
        /// Half the depth of that cube, metres.
        depth: f32,
        /// Half the depth of the cube that holds the voxel centres, metres.
        depth_of_voxels: f32,
    }

    /// A lens that distorts; see [`pyramap::sensors::Lens`].
    struct Distortion {
        /// The most that columns change with x and with y, and rows.
        stretch: [f32; 4],
        /// Radial.
        k1: f32,
        /// Radial.
        k2: f32,
        /// Tangential.
        p1: f32,
        /// Tangential.
        p2: f32,
        /// Radial.
        k3: f32,
        /// How far from the axis anything is in sight, at one metre.
        radius: f32,
        /// Nothing.
        _unused: [f32; 2],
    }

    /// A spherical sensor; see [`pyramap::sensors::Spherical`].
    struct Sphere {
        /// The power of two of columns in which azimuths are counted.
        step: f32,
        /// Such steps in a radian; negative if columns go clockwise.
        steps_per_radian: f32,
        /// From azimuth 0 to the middle of the image, in steps.
        middle: f32,
        /// Steps in a full turn.
        turn: f32,
        /// How far beside its column a pixel's ray may be, in columns.
        unaligned: f32,
        /// The elevation at which the table of rows starts.
        first_elevation: f32,
        /// Its intervals.
        intervals_per_radian: f32,
        /// Whether the last column's neighbour is the first.
        wraps: u32,
    }

    /// The image halved some times.
    struct Halved {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// As a layer: where its texels begin, after those of the finer ones.
        texels: u32,
        /// As a layer: where bounds over its cells begin, less where the texels of as small a layer begin.
        bounds: u32,
    }

    /// All that the stages know of a frame but its pixels.
    struct Frame {
        /// Centre of the first block of the box around the frustum, camera frame, metres: upper and lower part.
        origin: [[f32; 4]; 2],
        /// From block to block along the world's axes: three upper parts, then three lower ones.
        steps: [[f32; 4]; 6],
        /// The world's axes in the camera's frame.
        axes: [[f32; 4]; 3],
        /// The sides of a pinhole camera's frustum; see [`pyramap::sensors::Pinhole::sides`].
        sides: [[f32; 4]; 4],
        /// Centres of a block's eighths, relative to its own.
        quarter_offsets: [[f32; 4]; 8],
        /// Centres of their eighths, relative to theirs.
        pair_offsets: [[f32; 4]; 8],
        /// Centres of the eighths of these, which are voxels.
        voxel_offsets: [[f32; 4]; 8],
        /// The points that the rule `area` reads, relative to a voxel's centre.
        samples: [[f32; 4]; 8],
        /// Those that it reads where these do not settle the voxel.
        more_samples: [[[f32; 4]; 8]; MORE],
        /// `t_i` of layer `i` at place `i + 1`; all 0 where layers keep the smallest range.
        t: [[f32; 4]; 4],
        /// The image halved `i` times at place `i`.
        halved: [Halved; HALVED],
        /// The cube of voxels that is a block.
        block: Cube,
        /// The cube of 2 x 2 x 2 voxels.
        pair: Cube,
        /// The lens, if it distorts.
        distortion: Distortion,
        /// The sensor, if it is spherical.
        sphere: Sphere,
        /// Blocks of the box along each axis.
        blocks: [u32; 4],
        /// Where the parts of windows of each pass of the pyramid begin.
        parts: [u32; 4],
        /// Polynomial of the range that gives sigma, metres.
        sigma: [f32; 4],
        /// Focal lengths of a pinhole camera; pixels a metre of an orthographic one.
        focal: [f32; 2],
        /// Its principal point, counted from the image's border.
        principal: [f32; 2],
        /// Columns and rows of the image.
        image: [f32; 2],
        /// Farthest distance that is mapped, metres.
        max_range: f32,
        /// The distance at which a voxel is one pixel wide, metres (Eq. 11).
        t_0: f32,
        /// What is measured beyond `max_range`.
        beyond: f32,
        /// Steps of raw depth in a metre.
        depth_scale: f32,
        /// From a range to its surface, metres.
        offset: f32,
        /// And in sigmas, where sigma grows.
        offset_in_sigmas: f32,
        /// `1 / sigma`, where it is the same at every range.
        inv_sigma: f32,
        /// Sigmas from the surface beyond which everything is free or hidden.
        cutoff: f32,
        /// Intervals of the sensor table in a sigma.
        intervals_per_sigma: f32,
        /// The increment of a voxel in free space.
        free: i32,
        /// Pairs of pixels in a row.
        pairs: u32,
        /// The first layer that is made.
        first: u32,
        /// One more than the last layer.
        count: u32,
        /// How often the image is halved to be three texels wide and high at most.
        coarsest: u32,
        /// Whether free and hidden blocks are told apart at all.
        cull: u32,
        /// How many free blocks there is room for.
        free_room: u32,
        /// How many mixed blocks there is room for.
        mixed_room: u32,
        /// How many of them share a page of increments.
        page_blocks: u32,
    }

    /// One addition to a block of the map.
    struct Addition {
        /// The block, counted from the first page that the kernel sees.
        block: u32,
        /// [`FROM_BASE`] and [`SAME_FOR_ALL`], or neither.
        kind: u32,
        /// What all voxels start from.
        base: i32,
        /// What is added to all voxels; or the place of the increments in their page.
        source: i32,
    }

    /// Additions that follow each other and go to the same pages.
    struct Run {
        /// The first.
        first: u32,
        /// Blocks in a page of the map.
        page_blocks: u32,
        /// Smallest value of a voxel.
        low: i32,
        /// Largest value of a voxel.
        high: i32,
        /// What increments are multiplied by.
        sign: i32,
    }

    /// A page of increments.
    struct Page {
        /// The place, among the mixed blocks, of the first whose increments it holds.
        first: u32,
    }
}
