// The pinhole camera without distortion.

/// Projects a point (Eq. 13).
fn project(point: vec3<f32>) -> Projected {
    let inverse = 1.0 / point.z;
    let range = sqrt(point.x * point.x + point.y * point.y + point.z * point.z);
    return Projected(point.xy * inverse * frame.focal + frame.principal, range, point.z > 0.0);
}

/// Where a cube lies in the image; `far` is the greatest of its ranges.
fn outline_of(cube: Cube, centre: vec3<f32>, far: f32) -> Outline {
    let sides = sides_of_frustum(centre);
    let across = cube.across_sides + PIXEL_SLACK * far;
    if centre.z <= -cube.depth || any(sides + across < vec4(0.0)) {
        return out_of_sight();
    }
    // A cube that reaches behind the camera has no rectangle in the image.
    let bounded = centre.z - cube.depth > 1e-3;
    let half = spread(cube, centre) * frame.focal + PIXEL_SLACK;
    let middle = centre.xy / centre.z * frame.focal + frame.principal;
    return Outline(middle - half, middle + half, bounded, true, bounded && all(sides - across >= vec4(0.0)));
}

