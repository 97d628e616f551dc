// Stage 2, pyramid (Eq. 10, 11): of each window, the range nearest to its layer's distance t_i.
//
// The nearest is the largest of those up to t_i, or the smallest of those beyond. Both are found in any order and in
// parts: the nearest of a window is the nearest of the nearest of its parts. For t = 0 it is the minimum.

/// The range just below and the one just above each of four distances: 0 and ABSENT where there is none.
struct Around {
    below: vec4<f32>,
    above: vec4<f32>,
}

fn around_nothing() -> Around {
    return Around(vec4(0.0), vec4(ABSENT));
}

/// With another range, which may be 0, for none.
fn with_range(around: Around, range: f32, t: vec4<f32>) -> Around {
    let nearer = vec4(range) <= t;
    let below = max(around.below, select(vec4(0.0), vec4(range), nearer));
    let above = min(around.above, select(vec4(range), vec4(ABSENT), nearer));
    return Around(below, above);
}

/// With four others.
fn with_ranges(around: Around, ranges: vec4<f32>, t: vec4<f32>) -> Around {
    let upper = with_range(with_range(around, ranges.x, t), ranges.y, t);
    return with_range(with_range(upper, ranges.z, t), ranges.w, t);
}

/// The nearest to each distance, the smaller of two that are equally near; 0 where there is none.
fn nearest(around: Around, t: vec4<f32>) -> vec4<f32> {
    let take_above = (around.below <= vec4(0.0)) | (around.above - t < t - around.below);
    let range = select(around.below, around.above, take_above);
    return select(range, vec4(0.0), range >= vec4(ABSENT));
}

/// Where the parts of a layer's windows, as wide as those of the `n`-th multiple of TILE_LAYERS, are kept.
fn parts(n: u32, layer: u32) -> u32 {
    let size = frame.halved[TILE_LAYERS * n];
    return frame.parts[n - 1u] + (layer - TILE_LAYERS * n - 1u) * size.width * size.height;
}
