// The paper's baseline, after Andert 2009: minimum ranges, one layer, bilinear within it.

fn log_odds(point: vec3<f32>, pixel: vec2<f32>, range: f32) -> Told {
    return bilinear(layer_of(frame.t_0 / apparent_distance(range)), pixel, range);
}
