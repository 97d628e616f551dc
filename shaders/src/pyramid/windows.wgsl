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
    let edge = 1u << width;
    let source = frame.halved[PASS * TILE_LAYERS];
    let t = vec4(frame.t[(layer + 1u) / 4u][(layer + 1u) % 4u]);
    var around = around_nothing();
    for (var n = 0u; n < edge * edge; n++) {
        let x = id.x * edge + n % edge;
        let y = id.y * edge + n / edge;
        if x < source.width && y < source.height {
            around = with_range(around, scratch[parts(PASS, layer) + y * source.width + x], t);
        }
    }
    let range = nearest(around, t).x;
    if done {
        place(layer, id.xy, range);
    } else {
        scratch[parts(PASS + 1u, layer) + id.y * size.width + id.x] = range;
    }
}
