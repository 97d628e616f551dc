// Our rule: the mean log-odd over points spread evenly inside the voxel, each read from the pixel it falls on.

fn log_odds(point: vec3<f32>, pixel: vec2<f32>, range: f32) -> Told {
    let size = frame.halved[0];
    let last = vec2(f32(size.width - 1u), f32(size.height - 1u));
    var sum = 0.0;
    var count = 0.0;
    for (var n = 0u; n < 8u; n++) {
        let sample = point + frame.samples[n].xyz;
        // Points of a voxel in sight may lie outside the image, and are read at its border, or behind the camera.
        let at = project(sample);
        let surface = surfaces[texel(at.pixel.y, last.y) * size.width + texel(at.pixel.x, last.x)];
        let valid = select(0.0, 1.0, distance_of(surface) > HOLE && at.in_front);
        sum += valid * surface_log_odds(range, surface);
        count += valid;
    }
    return Told(sum / max(count, 1.0), count > 0.0);
}
