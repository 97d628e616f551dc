// Stage 1, ranges (Eq. 6): Euclidean distances out of z-depths. Asked for by the first kernel of the pyramid, once for
// each pixel, and so never stored.

/// The measurements of two neighbouring pixels: 0 no reading, NO_RETURN no return.
fn ranges(pair: u32, row: u32) -> vec2<f32> {
    if pair >= frame.pairs || row >= frame.halved[0].height {
        return vec2(0.0);
    }
    let at = row * frame.pairs + pair;
    let range = depths(at) * range_per_depth[at];
    let within = select(range, vec2(frame.beyond), range > vec2(frame.max_range));
    return select(within, vec2(NO_RETURN), range >= vec2(NO_RETURN));
}
