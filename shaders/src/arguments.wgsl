// Between cull and update: how many workgroups each page of increments needs, one for each mixed block.

@compute @workgroup_size(ARGUMENTS_GROUP)
fn arguments_of_pages(@builtin(global_invocation_id) id: vec3<u32>) {
    if 3u * id.x < arrayLength(&arguments) {
        let mixed = min(atomicLoad(&results.mixed), frame.mixed_room);
        let first = id.x * frame.page_blocks;
        arguments[3u * id.x] = clamp(mixed, first, first + frame.page_blocks) - first;
        arguments[3u * id.x + 1u] = 1u;
        arguments[3u * id.x + 2u] = 1u;
    }
}
