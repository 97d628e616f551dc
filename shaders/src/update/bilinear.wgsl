/// Bilinear interpolation of log-odds in one layer (Eq. 15, 16) over the texels that have a reading. Texel centres lie at
/// half-integer pixels; texels beyond the border are those at the border, or, where the image wraps, those at the other end.
fn bilinear(layer: u32, pixel: vec2<f32>, range: f32) -> Told {
    let size = frame.halved[layer];
    let last = vec2(f32(size.width - 1u), f32(size.height - 1u));
    let x = pixel * halved_times(layer) - 0.5;
    let low = floor(x);
    let high_weight = x - low;
    let low_weight = 1.0 - high_weight;
    let left = select(low.x, last.x, wraps() && low.x < 0.0);
    let right = select(low.x + 1.0, 0.0, wraps() && low.x >= last.x);
    let columns = vec2(texel(left, last.x), texel(right, last.x));
    let upper = size.texels + texel(low.y, last.y) * size.width;
    let lower = size.texels + texel(low.y + 1.0, last.y) * size.width;

    var sum = vec2(0.0);
    sum += weighted(range, surfaces[upper + columns.x], low_weight.y * low_weight.x);
    sum += weighted(range, surfaces[upper + columns.y], low_weight.y * high_weight.x);
    sum += weighted(range, surfaces[lower + columns.x], high_weight.y * low_weight.x);
    sum += weighted(range, surfaces[lower + columns.y], high_weight.y * high_weight.x);
    let told = sum.y > 0.0;
    return Told(sum.x / select(1.0, sum.y, told), told);
}

/// A texel's log-odd times its weight, and its weight, which is 0 for a hole.
fn weighted(range: f32, surface: Surface, weight: f32) -> vec2<f32> {
    let valid = select(0.0, weight, distance_of(surface) > HOLE);
    return vec2(valid * surface_log_odds(range, surface), valid);
}
