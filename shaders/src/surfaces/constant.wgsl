// A sigma that is the same at every range.

/// Distance at which the model places a texel's surface, metres: HOLE without a reading, about NO_RETURN without return.
alias Surface = f32;

fn surface_of(range: f32) -> Surface {
    return select(HOLE, range + frame.offset, range > 0.0);
}

fn distance_of(surface: Surface) -> f32 {
    return surface;
}

fn inv_sigma(surface: Surface) -> f32 {
    return frame.inv_sigma;
}

/// How far from a surface the model tells anything.
fn reach(surface: Surface) -> f32 {
    return frame.cutoff / frame.inv_sigma;
}
