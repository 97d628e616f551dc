// The pinhole camera without distortion.

/// Whether the last column's neighbour is the first.
fn wraps() -> bool {
    return false;
}

/// Projects a point (Eq. 13).
fn project(point: vec3<f32>) -> Projected {
    let inverse = 1.0 / point.z;
    let range = sqrt(point.x * point.x + point.y * point.y + point.z * point.z);
    return Projected(point.xy * inverse * frame.focal + frame.principal, range, point.z > 0.0);
}

/// The least and greatest range of a cube.
fn ranges_of(cube: Cube, centre: vec3<f32>) -> vec2<f32> {
    return distances(cube, centre);
}

/// Where a cube lies in the image; `far` is the greatest of its ranges.
fn outline_of(cube: Cube, centre: vec3<f32>, far: f32) -> Outline {
    // How far inside the frustum's sides it lies, left, right, top, bottom.
    let sides = vec4(
        dot(frame.sides[0].xyz, centre),
        dot(frame.sides[1].xyz, centre),
        dot(frame.sides[2].xyz, centre),
        dot(frame.sides[3].xyz, centre),
    );
    let across = cube.across_sides + PIXEL_SLACK * far;
    let z = centre.z;
    if z <= -cube.depth || any(sides + across < vec4(0.0)) {
        return out_of_sight();
    }
    // A cube that reaches behind the camera has no rectangle in the image.
    let bounded = z - cube.depth > 1e-3;

    // The rectangle that its voxels project into: each axis of the cube adds its own part, and z is at least that of
    // the cube's nearest corner.
    let axes_x = vec3(frame.axes[0].x, frame.axes[1].x, frame.axes[2].x);
    let axes_y = vec3(frame.axes[0].y, frame.axes[1].y, frame.axes[2].y);
    let axes_z = vec3(frame.axes[0].z, frame.axes[1].z, frame.axes[2].z);
    let reach = vec2(
        dot(abs(axes_x * z - centre.x * axes_z), vec3(1.0)),
        dot(abs(axes_y * z - centre.y * axes_z), vec3(1.0)),
    );
    let half = cube.projected / ((z - cube.depth) * z) * reach * frame.focal + PIXEL_SLACK;
    let middle = centre.xy / z * frame.focal + frame.principal;
    return Outline(middle - half, middle + half, bounded, true, bounded && all(sides - across >= vec4(0.0)));
}

