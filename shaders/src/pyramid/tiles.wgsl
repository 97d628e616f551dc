// The first kernel: every pixel is read once. An invocation has a tile of 8 x 8 pixels, which is a texel of layer 3 and
// holds those of the finer layers; for coarser layers it keeps the nearest range in it, a part of their windows.

@compute @workgroup_size(LAYER_GROUP_X, LAYER_GROUP_Y)
fn tiles(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= tile_size()) {
        return;
    }
    // Four layers at a time, as frame.t has them; these are 0, 1 and 2.
    var fine = around_nothing();
    var layers_3 = around_nothing();
    var layers_7 = around_nothing();
    var layers_11 = around_nothing();
    for (var quarter = 0u; quarter < 4u; quarter++) {
        let texel_2 = 2u * id.xy + corner(quarter);
        for (var part = 0u; part < 4u; part++) {
            let texel_1 = 2u * texel_2 + corner(part);
            let ranges = vec4(ranges(texel_1.x, 2u * texel_1.y), ranges(texel_1.x, 2u * texel_1.y + 1u));
            if FIRST == 0u {
                for (var n = 0u; n < 4u; n++) {
                    place(0u, 2u * texel_1 + corner(n), ranges[n]);
                }
            }
            if FIRST <= 2u {
                fine = with_ranges(fine, ranges, frame.t[0]);
                if FIRST <= 1u && COUNT > 1u {
                    place(1u, texel_1, nearest(fine, frame.t[0]).z);
                }
                fine.below.z = 0.0;
                fine.above.z = ABSENT;
            }
            if COUNT > 3u {
                layers_3 = with_ranges(layers_3, ranges, frame.t[1]);
            }
            if COUNT > 7u {
                layers_7 = with_ranges(layers_7, ranges, frame.t[2]);
            }
            if COUNT > 11u {
                layers_11 = with_ranges(layers_11, ranges, frame.t[3]);
            }
        }
        if FIRST <= 2u && COUNT > 2u {
            place(2u, texel_2, nearest(fine, frame.t[0]).w);
            fine.below.w = 0.0;
            fine.above.w = ABSENT;
        }
    }
    if COUNT > 3u {
        keep(3u, id.xy, nearest(layers_3, frame.t[1]));
    }
    if COUNT > 7u {
        keep(7u, id.xy, nearest(layers_7, frame.t[2]));
    }
    if COUNT > 11u {
        keep(11u, id.xy, nearest(layers_11, frame.t[3]));
    }
}

fn tile_size() -> vec2<u32> {
    let size = frame.halved[TILE_LAYERS];
    return vec2(size.width, size.height);
}

/// The results of a tile for four layers.
fn keep(first: u32, tile: vec2<u32>, ranges: vec4<f32>) {
    for (var n = 0u; n < 4u; n++) {
        let layer = first + n;
        if layer < FIRST || layer >= COUNT {
            continue;
        }
        if layer == TILE_LAYERS {
            place(layer, tile, ranges[n]);
        } else {
            scratch[parts(1u, layer) + tile.y * tile_size().x + tile.x] = ranges[n];
        }
    }
}
