/// The angle of `(x, y)` from the x axis, -pi to pi; 0 for the origin.
fn angle_of(y: f32, x: f32) -> f32 {
    let up = abs(y);
    let right = abs(x);
    let steep = up > right;
    let t = select(up, right, steep) / max(select(right, up, steep), NEAREST);
    let flat = atan_series(t * t) * t;
    let upper = select(flat, HALF_PI - flat, steep);
    let turned = select(upper, PI - upper, x < 0.0);
    return select(turned, -turned, y < 0.0);
}

