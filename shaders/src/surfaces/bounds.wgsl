// Bounds over square cells of texels: from cells of 2^FINER texels, which are single texels at first, to the three next
// sizes. An invocation has 8 x 8 of the finer cells; the layers go side by side.

@compute @workgroup_size(LAYER_GROUP_X, LAYER_GROUP_Y)
fn bounds_of_cells(@builtin(global_invocation_id) id: vec3<u32>) {
    let layer = frame.first + id.z;
    if FINER >= coarsest_bounds(layer) {
        return;
    }
    let size = frame.halved[layer + FINER];
    if 8u * id.x >= size.width || 8u * id.y >= size.height {
        return;
    }
    var by_8 = NO_BOUNDS;
    for (var quarter = 0u; quarter < 4u; quarter++) {
        let cell_4 = 2u * id.xy + corner(quarter);
        var by_4 = NO_BOUNDS;
        for (var part = 0u; part < 4u; part++) {
            let cell_2 = 2u * cell_4 + corner(part);
            let upper = union_of(cell_bounds(layer, 2u * cell_2), cell_bounds(layer, 2u * cell_2 + corner(1u)));
            let lower = union_of(
                cell_bounds(layer, 2u * cell_2 + corner(2u)),
                cell_bounds(layer, 2u * cell_2 + corner(3u)),
            );
            let by_2 = union_of(upper, lower);
            put(layer, FINER + 1u, cell_2, by_2);
            by_4 = union_of(by_4, by_2);
        }
        put(layer, FINER + 2u, cell_4, by_4);
        by_8 = union_of(by_8, by_4);
    }
    put(layer, FINER + 3u, id.xy, by_8);
}

/// The bounds of one of the finer cells; of those beyond the layer's border none.
fn cell_bounds(layer: u32, cell: vec2<u32>) -> vec2<f32> {
    let size = frame.halved[layer + FINER];
    if cell.x >= size.width || cell.y >= size.height {
        return NO_BOUNDS;
    }
    return finer_bounds(layer, cell.y * size.width + cell.x);
}

fn put(layer: u32, level: u32, cell: vec2<u32>, value: vec2<f32>) {
    if level > coarsest_bounds(layer) {
        return;
    }
    let size = frame.halved[layer + level];
    if cell.x < size.width && cell.y < size.height {
        bounds[bounds_of(layer, level) + cell.y * size.width + cell.x] = value;
    }
}
