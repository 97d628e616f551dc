// Stage 3, cull: which blocks of the box around the frustum are free throughout, and which must be asked voxel by voxel.
// The others are hidden or out of sight. An invocation has a block.

@compute @workgroup_size(CULL_GROUP, CULL_GROUP, CULL_GROUP)
fn cull(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= frame.blocks.xyz) {
        return;
    }
    let kind = classify(frame.block, centre_of(id));
    let block = (id.x * frame.blocks.y + id.y) * frame.blocks.z + id.z;
    // A block for which there is no room is counted all the same: the host makes room, and has the frame done again.
    if kind == FREE {
        let n = atomicAdd(&results.free, 1u);
        if n < frame.free_room {
            results.words[n] = block;
        }
    } else if kind == MIXED {
        let n = atomicAdd(&results.mixed, 1u);
        if n < frame.mixed_room {
            results.words[frame.free_room + n] = block;
        }
    }
}
