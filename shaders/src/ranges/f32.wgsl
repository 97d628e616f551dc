const INFINITY_BITS: u32 = 0x7f800000u;

/// The depths of two neighbouring pixels, metres: 0 where there is none, NO_RETURN for infinity. Readings are told apart
/// by their bits, since a shader's arithmetic need not know NaN and infinity.
fn depths(at: u32) -> vec2<f32> {
    let bits = vec2(depth[2u * at], depth[2u * at + 1u]);
    // Negative numbers and NaN have larger bits than infinity.
    let finite = bitcast<vec2<f32>>(select(vec2(0u), bits, bits < vec2(INFINITY_BITS)));
    return select(finite, vec2(NO_RETURN), bits == vec2(INFINITY_BITS));
}
