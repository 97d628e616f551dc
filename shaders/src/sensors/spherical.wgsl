// The spherical sensor, such as a spinning LiDAR: columns are azimuths, rows are beams of one elevation each.

/// Whether the last column's neighbour is the first.
fn wraps() -> bool {
    return frame.sphere.wraps != 0u;
}

/// The column of an azimuth, counted from the image's border. It is counted in whole steps of a power of two of columns,
/// all sums of which are exact.
fn column_of(azimuth: f32) -> f32 {
    let sphere = frame.sphere;
    let steps = round(azimuth * sphere.steps_per_radian) - sphere.middle;
    let beyond = select(0.0, sphere.turn, steps >= 0.5 * sphere.turn);
    let before = select(0.0, sphere.turn, steps < -0.5 * sphere.turn);
    return (steps - beyond + before) * sphere.step + 0.5 * frame.image.x;
}

/// The row of an elevation, counted from the image's border; beyond the table that at its end.
fn row_of(elevation: f32) -> f32 {
    let position = (elevation - frame.sphere.first_elevation) * frame.sphere.intervals_per_radian;
    let clamped = clamp(position, 0.0, f32(arrayLength(&rows) - 1u));
    let interval = u32(clamped);
    let entry = rows[interval];
    return entry.x + (clamped - f32(interval)) * entry.y;
}

/// Projects a point onto azimuth and elevation.
fn project(point: vec3<f32>) -> Projected {
    let flat = point.x * point.x + point.y * point.y;
    let range = sqrt(flat + point.z * point.z);
    let pixel = vec2(column_of(angle_of(point.y, point.x)), row_of(angle_of(point.z, sqrt(flat))));
    return Projected(pixel, range, range > 0.0);
}

/// The least and greatest range of a cube.
fn ranges_of(cube: Cube, centre: vec3<f32>) -> vec2<f32> {
    return distances(cube, centre);
}

/// Where a cube lies in the image.
///
/// In the plane through the z axis and a centre c, with x' forward and z up, a point p of the cube lies at x' = s + e:
/// s is its place along c's direction, and e = |(s, t)| - s <= t^2 / 2s, for t across. So the tangents of both its
/// angles to c are bounded by extents of the cube along fixed directions, over its least distance.
fn outline_of(cube: Cube, centre: vec3<f32>, far: f32) -> Outline {
    let flat = length(centre.xy);
    let distance = length(centre);
    let inverse_flat = 1.0 / max(flat, NEAREST);
    let inverse = 1.0 / max(distance, NEAREST);
    var across = 0.0;
    var along = 0.0;
    var upwards = 0.0;
    var away = 0.0;
    for (var k = 0u; k < 3u; k++) {
        let axis = frame.axes[k].xyz;
        let forward = dot(axis.xy, centre.xy) * inverse_flat;
        across += abs(axis.y * centre.x - axis.x * centre.y) * inverse_flat;
        along += abs(forward);
        upwards += abs(axis.z * flat - forward * centre.z) * inverse;
        away += abs(forward * flat + axis.z * centre.z) * inverse;
    }
    let half = cube.projected * BOUND_SLACK;
    let nearest_flat = flat - half * along;
    let nearest = distance - half * away;
    // A cube around the axis has no bound in azimuth, and one around the sensor none at all.
    if nearest_flat <= 1e-3 || nearest <= 1e-3 {
        return Outline(vec2(0.0), vec2(0.0), false, true, false);
    }
    let beside = half * across;
    let excess = beside * beside / (2.0 * nearest_flat);
    let tilt = (half * upwards + excess * abs(centre.z) * inverse) / nearest * BOUND_SLACK;
    let elevation = angle_of(centre.z, flat);
    let ends = vec2(row_of(elevation + tilt), row_of(elevation - tilt));
    let top = min(ends.x, ends.y) - PIXEL_SLACK;
    let bottom = max(ends.x, ends.y) + PIXEL_SLACK;

    let sphere = frame.sphere;
    let columns_per_radian = abs(sphere.steps_per_radian) * sphere.step;
    let turn = beside / nearest_flat * columns_per_radian * BOUND_SLACK + sphere.unaligned + PIXEL_SLACK;
    let column = column_of(angle_of(centre.y, centre.x));
    // From the middle, the short way around.
    let aside = select(abs(column - 0.5 * frame.image.x), 0.0, wraps());
    let in_sight = (wraps() || aside - turn <= 0.5 * frame.image.x) && bottom >= 0.0 && top <= frame.image.y;
    let inside = (wraps() || aside + turn <= 0.5 * frame.image.x) && top >= 0.0 && bottom <= frame.image.y;
    // What reaches all around, or is on both sides of a sector's back, may be read in any column.
    let everywhere = 2.0 * (aside + turn) >= sphere.turn * sphere.step;
    let columns = select(vec2(column - turn, column + turn), vec2(0.0, frame.image.x), everywhere);
    return Outline(vec2(columns.x, top), vec2(columns.y, bottom), true, in_sight, inside);
}

