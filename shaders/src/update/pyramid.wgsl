// The paper's rule: bilinear in two neighbouring layers, linear between them (Eq. 12 to 17).

fn log_odds(point: vec3<f32>, pixel: vec2<f32>, range: f32) -> Told {
    let last = frame.count - 1u;
    let distance = apparent_distance(range);
    let layer = layer_of(frame.t_0 / distance);
    let here = bilinear(layer, pixel, range);
    let next = bilinear(min(layer + 1u, last), pixel, range);
    // Eq. 17, with t_(i+1) = t_i / 2: (z - t_i) / (t_(i+1) - t_i) = 2 (1 - z / t_i).
    let towards_next = 2.0 - 2.0 * (distance / halved_times(layer) / frame.t_0);
    let has_next = next.told && distance <= frame.t_0 && layer < last;
    let blended = here.log_odds + towards_next * (next.log_odds - here.log_odds);
    let both = select(next.log_odds, blended, here.told);
    return Told(select(here.log_odds, both, has_next), here.told || has_next);
}
