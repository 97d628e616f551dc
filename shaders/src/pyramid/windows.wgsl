// The kernels that follow the first: from parts of windows to windows up to eight times as wide. The layers go side by
// side; those that are done are placed, the others become parts again.

@compute @workgroup_size(LAYER_GROUP_X, LAYER_GROUP_Y)
fn windows(@builtin(global_invocation_id) id: vec3<u32>) {
    let layer = max(PASS * TILE_LAYERS + 1u, frame.first) + id.z;
    let done = layer <= (PASS + 1u) * TILE_LAYERS;
    let width = min(layer, (PASS + 1u) * TILE_LAYERS) - PASS * TILE_LAYERS;
    let size = frame.halved[PASS * TILE_LAYERS + width];
    if id.x >= size.width || id.y >= size.height {
        return;
    }
    // Squares of four parts at a time, so that these are fetched together.
    let squares = 1u << (width - 1u);
    let t = vec4(frame.t[(layer + 1u) / 4u][(layer + 1u) % 4u]);
    var around = around_nothing();
    for (var n = 0u; n < squares * squares; n++) {
        let first = 2u * (id.xy * squares + vec2(n % squares, n / squares));
        around = with_ranges(around, four_parts(layer, first), t);
    }
    let range = nearest(around, t).x;
    if done {
        place(layer, id.xy, range);
    } else {
        scratch[parts(PASS + 1u, layer) + id.y * size.width + id.x] = range;
    }
}

/// Parts of a window that lie in a square; at the image's border some are the same, and 0 beyond it.
fn four_parts(layer: u32, first: vec2<u32>) -> vec4<f32> {
    let source = frame.halved[PASS * TILE_LAYERS];
    let begin = parts(PASS, layer);
    var ranges = vec4(0.0);
    if first.x < source.width && first.y < source.height {
        let last = min(first + 1u, vec2(source.width - 1u, source.height - 1u));
        ranges.x = scratch[begin + first.y * source.width + first.x];
        ranges.y = scratch[begin + first.y * source.width + last.x];
        ranges.z = scratch[begin + last.y * source.width + first.x];
        ranges.w = scratch[begin + last.y * source.width + last.x];
    }
    return ranges;
}
