/// The bounds of a single texel.
fn finer_bounds(layer: u32, at: u32) -> vec2<f32> {
    let surface = surfaces[frame.halved[layer].texels + at];
    let distance = distance_of(surface);
    let valid = vec2(max(distance - reach(surface), NEAREST), distance + reach(surface));
    return select(vec2(-ABSENT), valid, distance > HOLE);
}

