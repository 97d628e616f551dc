// The orthographic camera: parallel rays. Its focal lengths are pixels a metre.

/// Whether the last column's neighbour is the first.
fn wraps() -> bool {
    return false;
}

/// Projects a point.
fn project(point: vec3<f32>) -> Projected {
    return Projected(point.xy * frame.focal + frame.principal, point.z, point.z > 0.0);
}

/// The least and greatest range of a cube. Places are rounded in proportion to how far off they are, not to their depth
/// alone.
fn ranges_of(cube: Cube, centre: vec3<f32>) -> vec2<f32> {
    let slack = DISTANCE_SLACK * (dot(abs(centre), vec3(1.0)) + cube.depth_of_voxels);
    return vec2(centre.z - cube.depth_of_voxels - slack, centre.z + cube.depth_of_voxels + slack);
}

/// Where a cube lies in the image.
fn outline_of(cube: Cube, centre: vec3<f32>, far: f32) -> Outline {
    let middle = centre.xy * frame.focal + frame.principal;
    let half = cube.across_sides.xy + PIXEL_SLACK;
    let low = middle - half;
    let high = middle + half;
    let in_sight = centre.z > -cube.depth && all(high >= vec2(0.0)) && all(low <= frame.image);
    let bounded = centre.z - cube.depth > 1e-3;
    return Outline(low, high, bounded, in_sight, bounded && all(low >= vec2(0.0)) && all(high <= frame.image));
}

