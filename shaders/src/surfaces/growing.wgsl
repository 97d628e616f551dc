// A sigma that grows with the measured range.

/// Distance at which the model places a texel's surface, as with a constant sigma, and 1 / sigma.
alias Surface = vec2<f32>;

fn surface_of(range: f32) -> Surface {
    // No return is free whatever sigma is.
    let finite = select(range, 0.0, range >= NO_RETURN);
    let sigma = frame.sigma.x + finite * (frame.sigma.y + finite * frame.sigma.z);
    let placed = range + frame.offset + frame.offset_in_sigmas * sigma;
    return vec2(select(HOLE, placed, range > 0.0), 1.0 / sigma);
}

fn distance_of(surface: Surface) -> f32 {
    return surface.x;
}

fn inv_sigma(surface: Surface) -> f32 {
    return surface.y;
}

/// How far from a surface the model tells anything.
fn reach(surface: Surface) -> f32 {
    return frame.cutoff / surface.y;
}
