// What several stages need: where layers lie, which of them a distance belongs to, and what the host is told.

/// Counts of blocks, and lists of them.
struct Results {
    free: atomic<u32>,
    mixed: atomic<u32>,
    words: array<u32>,
}

/// The texel that holds a coordinate, which counts from the first texel's border; clamped to a layer.
fn texel(x: f32, last: f32) -> u32 {
    return u32(clamp(x, 0.0, last));
}

/// 2^-i.
fn halved_times(i: u32) -> f32 {
    return bitcast<f32>((127u - i) << 23u);
}

/// The layer `i` with `t_(i+1) < z <= t_i` for `q = t_0 / z` (Eq. 12 with the inequality turned round): the exponent of
/// `q`, as long as there is such a layer.
fn layer_of(q: f32) -> u32 {
    let exponent = i32(bitcast<u32>(q) >> 23u) - 127;
    return u32(clamp(exponent, i32(frame.first), i32(frame.count) - 1));
}

/// The coarsest cells over which a layer has bounds, as a power of two of texels.
fn coarsest_bounds(layer: u32) -> u32 {
    return u32(max(i32(frame.coarsest) - i32(layer), 1));
}

/// Where bounds over the cells of `2^level` texels of a layer begin.
fn bounds_of(layer: u32, level: u32) -> u32 {
    return frame.halved[layer].bounds + frame.halved[layer + level].texels;
}

/// Place `n` in a square of two by two.
fn corner(n: u32) -> vec2<u32> {
    return vec2(n & 1u, n >> 1u);
}
