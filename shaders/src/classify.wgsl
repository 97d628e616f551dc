// What cull and update ask of a cube of voxels before any voxel is asked: see the CPU's module `cull`.

/// No voxel of the cube changes.
const SKIP: u32 = 0u;
/// Every voxel of it gets the free log-odd.
const FREE: u32 = 1u;
/// Some voxels may differ.
const MIXED: u32 = 2u;

fn classify(cube: Cube, centre: vec3<f32>) -> u32 {
    // Along the cube's axes: the nearest and the farthest of its voxels.
    let away = abs(vec3(
        dot(frame.axes[0].xyz, centre),
        dot(frame.axes[1].xyz, centre),
        dot(frame.axes[2].xyz, centre),
    ));
    let exact_far = length(away + cube.voxels);
    let near = length(max(away - cube.voxels, vec3(0.0))) - DISTANCE_SLACK * exact_far;
    let far = exact_far + DISTANCE_SLACK * exact_far;

    // How far inside the frustum's sides it lies, left, right, top, bottom.
    let sides = vec4(
        dot(frame.sides[0].xyz, centre),
        dot(frame.sides[1].xyz, centre),
        dot(frame.sides[2].xyz, centre),
        dot(frame.sides[3].xyz, centre),
    );
    let across = cube.across_sides + PIXEL_SLACK * far;
    let z = centre.z;
    if z <= -cube.depth || near > frame.max_range || any(sides + across < vec4(0.0)) {
        return SKIP;
    }
    // A cube that reaches behind the camera has no rectangle in the image.
    if frame.cull == 0u || z - cube.depth <= 1e-3 {
        return MIXED;
    }
    let inside = far <= frame.max_range && all(sides - across >= vec4(0.0));

    // The rectangle that its voxels project into: each axis of the cube adds its own part, and z is at least that of
    // the cube's nearest corner.
    let axes_x = vec3(frame.axes[0].x, frame.axes[1].x, frame.axes[2].x);
    let axes_y = vec3(frame.axes[0].y, frame.axes[1].y, frame.axes[2].y);
    let axes_z = vec3(frame.axes[0].z, frame.axes[1].z, frame.axes[2].z);
    let reach = vec2(
        dot(abs(axes_x * z - centre.x * axes_z), vec3(1.0)),
        dot(abs(axes_y * z - centre.y * axes_z), vec3(1.0)),
    );
    let half = cube.projected / ((z - cube.depth) * z) * reach * frame.focal + PIXEL_SLACK;
    let middle = centre.xy / z * frame.focal + frame.principal;
    return compare(near, far, middle - half, middle + half, inside);
}

/// Compares an interval of distances with the surfaces in a rectangle of the image.
fn compare(near: f32, far: f32, low: vec2<f32>, high: vec2<f32>, inside: bool) -> u32 {
    // Farther than max_range no voxel is asked, and the layers that would serve there are not made.
    let within = min(far, frame.max_range);
    let first = layer_of(frame.t_0 / within);
    let served_last = select(frame.count - 1u, layer_of(frame.t_0 / near), near > 0.0);
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

/// Bounds over the texels of a layer that a rectangle of pixels reads: over cells so large that three of them along each
/// side are enough, which may take in neighbouring texels.
fn rectangle_bounds(layer: u32, low: vec2<f32>, high: vec2<f32>) -> vec2<f32> {
    let size = frame.halved[layer];
    let last = vec2(f32(size.width - 1u), f32(size.height - 1u));
    let scale = halved_times(layer);
    let x = vec2(texel(low.x * scale - 0.5, last.x), texel(high.x * scale - 0.5 + REACH, last.x));
    let y = vec2(texel(low.y * scale - 0.5, last.y), texel(high.y * scale - 0.5 + REACH, last.y));
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
