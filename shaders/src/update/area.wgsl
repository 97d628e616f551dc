// Our rule: the mean log-odd over points spread evenly inside the voxel, each read from the pixel it falls on; over many
// where a few do not settle it.

fn log_odds(point: vec3<f32>, pixel: vec2<f32>, range: f32) -> Told {
    var sum = 0.0;
    var count = 0.0;
    var least = ABSENT;
    var most = -ABSENT;
    for (var n = 0u; n < 8u; n++) {
        let answer = told_at(point + frame.samples[n].xyz, range);
        if answer.told {
            sum += answer.log_odds;
            count += 1.0;
            least = min(least, answer.log_odds);
            most = max(most, answer.log_odds);
        }
    }
    if count == 0.0 || most - least > TOLERANCE {
        // Added up in the order of the CPU, where these are lanes.
        var all_sum = 0.0;
        for (var lane = 0u; lane < 8u; lane++) {
            var lane_sum = 0.0;
            for (var n = 0u; n < MORE; n++) {
                let answer = told_at(point + frame.more_samples[n][lane].xyz, range);
                if answer.told {
                    lane_sum += answer.log_odds;
                    count += 1.0;
                }
            }
            all_sum += lane_sum;
        }
        sum += all_sum;
    }
    return Told(sum / max(count, 1.0), count > 0.0);
}

/// What the pixel says that a point falls on. Points of a voxel in sight may lie outside the image, and are read at its
/// border, or behind the camera.
fn told_at(sample: vec3<f32>, range: f32) -> Told {
    let size = frame.halved[0];
    let at = project(sample);
    let row = texel(at.pixel.y, f32(size.height - 1u));
    let surface = surfaces[row * size.width + texel(at.pixel.x, f32(size.width - 1u))];
    return Told(surface_log_odds(range, surface), distance_of(surface) > HOLE && at.in_front);
}
