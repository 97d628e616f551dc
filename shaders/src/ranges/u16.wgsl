/// The depths of two neighbouring pixels, metres.
fn depths(at: u32) -> vec2<f32> {
    let raw = depth[at];
    return vec2(f32(raw & 0xffffu), f32(raw >> 16u)) / frame.depth_scale;
}
