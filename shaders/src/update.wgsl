// Stage 4, update: the log-odd that the frame gives to each voxel of the mixed blocks (Alg. 1). A workgroup has a block:
// first each invocation classifies one of its cubes of 2 x 2 x 2 voxels, then all share the voxels of the mixed ones.

const MOST: i32 = 0x7fffffff;

var<workgroup> mixed_cubes: array<u32, PAIRS>;
var<workgroup> num_mixed: atomic<u32>;
var<workgroup> lowest: atomic<i32>;
var<workgroup> highest: atomic<i32>;
var<workgroup> num_changed: atomic<u32>;

/// The log-odd of a voxel, if some texel told it.
struct Told {
    log_odds: f32,
    told: bool,
}

@compute @workgroup_size(PAIRS)
fn update(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let n = page.first + group.x;
    let block = results.words[frame.free_room + n];
    let centre = centre_of(vec3(
        block / (frame.blocks.y * frame.blocks.z),
        block / frame.blocks.z % frame.blocks.y,
        block % frame.blocks.z,
    ));
    if invocation == 0u {
        atomicStore(&lowest, MOST);
        atomicStore(&highest, -MOST);
    }
    let kind = classify(frame.pair, centre_of_pair(centre, invocation));
    if kind == MIXED {
        mixed_cubes[atomicAdd(&num_mixed, 1u)] = invocation;
    }
    workgroupBarrier();
    let shared_voxels = 8u * atomicLoad(&num_mixed);

    var low = MOST;
    var high = -MOST;
    var changed = 0u;
    if kind != MIXED {
        let increment = select(0, frame.free, kind == FREE);
        for (var voxel = 0u; voxel < 8u; voxel++) {
            increments[BLOCK_VOXELS * group.x + voxel_offset(invocation, voxel)] = increment;
        }
        low = increment;
        high = increment;
        changed = select(0u, 8u, increment != 0);
    }
    for (var share = invocation; share < shared_voxels; share += PAIRS) {
        let pair = mixed_cubes[share / 8u];
        let increment = increment_of(centre_of_pair(centre, pair) + frame.voxel_offsets[share % 8u].xyz);
        increments[BLOCK_VOXELS * group.x + voxel_offset(pair, share % 8u)] = increment;
        low = min(low, increment);
        high = max(high, increment);
        changed += select(0u, 1u, increment != 0);
    }

    atomicMin(&lowest, low);
    atomicMax(&highest, high);
    atomicAdd(&num_changed, changed);
    workgroupBarrier();
    if invocation == 0u {
        let value = atomicLoad(&lowest);
        let at = frame.free_room + frame.mixed_room + 2u * n;
        results.words[at] = select(atomicLoad(&num_changed), UNIFORM, value == atomicLoad(&highest));
        results.words[at + 1u] = bitcast<u32>(value);
    }
}

/// The middle of a block's cube of 2 x 2 x 2 voxels, by the same two steps as on the CPU.
fn centre_of_pair(centre: vec3<f32>, pair: u32) -> vec3<f32> {
    return centre + frame.quarter_offsets[pair / 8u].xyz + frame.pair_offsets[pair % 8u].xyz;
}

/// Where an eighth of a cube lies: 0 or 1 along each axis, along z neighbours follow each other.
fn sides_of(eighth: u32) -> vec3<u32> {
    return vec3(eighth >> 2u, (eighth >> 1u) & 1u, eighth & 1u);
}

/// Where a voxel lies in its block.
fn voxel_offset(pair: u32, voxel: u32) -> u32 {
    let at = 4u * sides_of(pair / 8u) + 2u * sides_of(pair % 8u) + sides_of(voxel);
    return (at.x * BLOCK_EDGE + at.y) * BLOCK_EDGE + at.z;
}

/// The increment of the voxel around a point: projects it (Eq. 13), asks the rule, and rounds, ties to even.
fn increment_of(point: vec3<f32>) -> i32 {
    let projected = project(point);
    let outside = any(projected.pixel < vec2(0.0)) || any(projected.pixel >= frame.image);
    if !projected.in_front || projected.range > frame.max_range || outside {
        return 0;
    }
    let answer = log_odds(point, projected.pixel, projected.range);
    return select(0, i32(round(answer.log_odds * STEPS)), answer.told);
}

/// The log-odd at `s` sigmas behind the surface; beyond the cut-off exactly that of free space, or 0.
fn model_at(s: f32) -> f32 {
    let position = (clamp(s, -frame.cutoff, frame.cutoff) + frame.cutoff) * frame.intervals_per_sigma;
    let interval = u32(position);
    let entry = table[interval];
    return entry.x + (position - f32(interval)) * entry.y;
}

/// What a surface says of a distance.
fn surface_log_odds(range: f32, surface: Surface) -> f32 {
    return model_at((range - distance_of(surface)) * inv_sigma(surface));
}
