// What cameras with a pinhole have in common.

/// Whether the last column's neighbour is the first.
fn wraps() -> bool {
    return false;
}

/// The least and greatest range of a cube.
fn ranges_of(cube: Cube, centre: vec3<f32>) -> vec2<f32> {
    return distances(cube, centre);
}

/// How far inside the frustum's sides a point lies, left, right, top, bottom.
fn sides_of_frustum(centre: vec3<f32>) -> vec4<f32> {
    return vec4(
        dot(frame.sides[0].xyz, centre),
        dot(frame.sides[1].xyz, centre),
        dot(frame.sides[2].xyz, centre),
        dot(frame.sides[3].xyz, centre),
    );
}

/// How far from a centre's column and row the cube around it may project, in focal lengths: each axis of the cube adds
/// its own part, and z is at least that of the cube's nearest corner.
fn spread(cube: Cube, centre: vec3<f32>) -> vec2<f32> {
    let axes_x = vec3(frame.axes[0].x, frame.axes[1].x, frame.axes[2].x);
    let axes_y = vec3(frame.axes[0].y, frame.axes[1].y, frame.axes[2].y);
    let axes_z = vec3(frame.axes[0].z, frame.axes[1].z, frame.axes[2].z);
    let z = centre.z;
    let reach = vec2(
        dot(abs(axes_x * z - centre.x * axes_z), vec3(1.0)),
        dot(abs(axes_y * z - centre.y * axes_z), vec3(1.0)),
    );
    return cube.projected / ((z - cube.depth) * z) * reach;
}

