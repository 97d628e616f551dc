// Stage 5, commit: increments are added to the blocks of the map. A workgroup has an addition, and with it a block.

/// What the host reads; all zero at first.
struct Outcome {
    /// Voxels that `i32` was too small for.
    lost: atomic<u32>,
    /// For each addition the rank of the largest value in the block, and that of the smallest with all bits turned
    /// round: both can only grow.
    extremes: array<atomic<u32>>,
}

const MOST: i32 = 0x7fffffff;
const LEAST: i32 = -MOST - 1;

@compute @workgroup_size(64)
fn commit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) invocation: u32) {
    let place = run.first + group.x;
    let addition = additions[place];
    let page = addition.block / run.page_blocks;
    let block = BLOCK_VOXELS * (addition.block % run.page_blocks);

    var low = MOST;
    var high = LEAST;
    var overflows = 0u;
    for (var voxel = invocation; voxel < BLOCK_VOXELS; voxel += 64u) {
        var value = addition.base;
        if (addition.kind & FROM_BASE) == 0u {
            value = load(page, block + voxel);
        }
        var increment = addition.source;
        if (addition.kind & SAME_FOR_ALL) == 0u {
            increment = increments[BLOCK_VOXELS * u32(addition.source) + voxel];
        }
        increment *= run.sign;
        var sum = value + increment;
        // Sums wrap: one that has a sign that neither of its parts has is too large, or too small, for 32 bits.
        if ((value ^ sum) & (increment ^ sum)) < 0 {
            sum = select(MOST, LEAST, value < 0);
            overflows += 1u;
        }
        sum = clamp(sum, run.low, run.high);
        store(page, block + voxel, sum);
        low = min(low, sum);
        high = max(high, sum);
    }

    atomicMax(&outcome.extremes[2u * place], rank(high));
    atomicMax(&outcome.extremes[2u * place + 1u], ~rank(low));
    if overflows > 0u {
        atomicAdd(&outcome.lost, overflows);
    }
}

/// Unsigned numbers in the order of the signed ones.
fn rank(value: i32) -> u32 {
    return bitcast<u32>(value) ^ SIGN;
}
