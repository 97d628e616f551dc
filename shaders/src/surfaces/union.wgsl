// Bounds over texels. Their second number is the distance up to which something is not hidden yet. Their first is the
// distance up to which everything is free, and negative if some texel has no reading.

/// Of no texel at all.
const NO_BOUNDS = vec2<f32>(ABSENT, -ABSENT);

/// The bounds of two sets of texels together.
fn union_of(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let near = min(abs(a.x), abs(b.x));
    return vec2(select(near, -near, a.x < 0.0 || b.x < 0.0), max(a.y, b.y));
}
