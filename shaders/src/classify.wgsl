// What cull and update ask of a cube of voxels before any voxel is asked: see the CPU's module `cull`.

/// No voxel of the cube changes.
const SKIP: u32 = 0u;
/// Every voxel of it gets the free log-odd.
const FREE: u32 = 1u;
/// Some voxels may differ.
const MIXED: u32 = 2u;

fn classify(cube: Cube, centre: vec3<f32>) -> u32 {
    let ranges = ranges_of(cube, centre);
    if ranges.x > frame.max_range {
        return SKIP;
    }
    let outline = outline_of(cube, centre, ranges.y);
    if !outline.in_sight {
        return SKIP;
    }
    if frame.cull == 0u || !outline.bounded {
        return MIXED;
    }
    return compare(ranges.x, ranges.y, outline.low, outline.high, outline.inside && ranges.y <= frame.max_range);
}

/// Compares an interval of distances with the surfaces in a rectangle of the image.
fn compare(near: f32, far: f32, low: vec2<f32>, high: vec2<f32>, inside: bool) -> u32 {
    // Farther than max_range no voxel is asked, and the layers that would serve there are not made.
    let within = apparent_distance(min(far, frame.max_range));
    let nearest = apparent_distance(near);
    let first = layer_of(frame.t_0 / within);
    let served_last = select(frame.count - 1u, layer_of(frame.t_0 / nearest), nearest > 0.0);
    let last = min(served_last + BLENDED, frame.count - 1u);
    if last - first >= MAX_LAYERS {
        return MIXED;
    }
    // Beyond t_0 layer 0 serves alone, within the last layer's distance the last; elsewhere one of two blended layers
    // may stand in for the other where that has a hole.
    let fallback = BLENDED > 0u && first < last && within <= frame.t_0 && served_last < frame.count - 1u;

    var all_bounds = NO_BOUNDS;
    var gapless = true;
    var previous_has_holes = false;
    for (var layer = first; layer <= last; layer++) {
        let here = rectangle_bounds(layer, low, high);
        let has_holes = here.x < 0.0;
        let gap = select(has_holes, has_holes && previous_has_holes, fallback);
        gapless = gapless && (!gap || (fallback && layer == first));
        previous_has_holes = has_holes;
        all_bounds = union_of(all_bounds, here);
    }
    if near > all_bounds.y {
        return SKIP;
    }
    return select(MIXED, FREE, inside && gapless && far < abs(all_bounds.x));
}

/// Bounds over the texels of a layer that a rectangle of pixels reads.
fn rectangle_bounds(layer: u32, low: vec2<f32>, high: vec2<f32>) -> vec2<f32> {
    let size = frame.halved[layer];
    let last = vec2(f32(size.width - 1u), f32(size.height - 1u));
    let scale = halved_times(layer);
    let left = low.x * scale - 0.5;
    let right = high.x * scale - 0.5 + REACH;
    let columns = vec2(texel(left, last.x), texel(right, last.x));
    let rows = vec2(texel(low.y * scale - 0.5, last.y), texel(high.y * scale - 0.5 + REACH, last.y));
    let inside = texel_bounds(layer, columns, rows);
    // Across the seam it goes on from the other end.
    if wraps() && left < 0.0 {
        let before = texel(floor(left) + f32(size.width), last.x);
        return union_of(inside, texel_bounds(layer, vec2(before, size.width - 1u), rows));
    }
    if wraps() && right >= f32(size.width) {
        let after = texel(right - f32(size.width), last.x);
        return union_of(inside, texel_bounds(layer, vec2(0u, after), rows));
    }
    return inside;
}

/// Bounds over some columns and rows of texels: over cells so large that three of them along each side are enough, which
/// may take in neighbouring texels.
fn texel_bounds(layer: u32, x: vec2<u32>, y: vec2<u32>) -> vec2<f32> {
    let extent = max(x.y - x.x, y.y - y.x);
    let level = clamp(firstLeadingBit(extent | 1u), 1u, coarsest_bounds(layer));
    // The last cell is read again where there are fewer than three.
    let columns = min(vec3(x.x >> level) + vec3(0u, 1u, 2u), vec3(x.y >> level));
    let rows = min(vec3(y.x >> level) + vec3(0u, 1u, 2u), vec3(y.y >> level));
    let begins = bounds_of(layer, level) + rows * frame.halved[layer + level].width;
    let upper = row_bounds(begins.x + columns);
    return union_of(upper, union_of(row_bounds(begins.y + columns), row_bounds(begins.z + columns)));
}

fn row_bounds(at: vec3<u32>) -> vec2<f32> {
    return union_of(bounds[at.x], union_of(bounds[at.y], bounds[at.z]));
}
