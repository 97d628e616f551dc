/// The bounds of a cell of 2^FINER texels.
fn finer_bounds(layer: u32, at: u32) -> vec2<f32> {
    return bounds[bounds_of(layer, FINER) + at];
}

