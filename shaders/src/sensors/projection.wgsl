// What all sensors have in common: see the CPU's module `sensors::projection`.

/// A projected point.
struct Projected {
    /// Column and row, counted from the image's border.
    pixel: vec2<f32>,
    /// What the sensor measures of a surface there, metres.
    range: f32,
    /// Whether the sensor could see the point if its image were large enough.
    in_front: bool,
}

/// Where a cube lies in the image. Bounds may be wide, and are never too tight.
struct Outline {
    /// First column and row of the projection. Only to be used where `bounded`.
    low: vec2<f32>,
    /// Last column and row.
    high: vec2<f32>,
    /// Whether all of the cube is in front of the sensor, so that it has an outline.
    bounded: bool,
    /// Whether some of the cube may be in the image.
    in_sight: bool,
    /// Whether all of it is.
    inside: bool,
}

fn out_of_sight() -> Outline {
    return Outline(vec2(0.0), vec2(0.0), false, false, false);
}

/// The nearest and farthest distance of the voxels in the cube around a centre, with slack for rounding.
fn distances(cube: Cube, centre: vec3<f32>) -> vec2<f32> {
    let away = abs(vec3(
        dot(frame.axes[0].xyz, centre),
        dot(frame.axes[1].xyz, centre),
        dot(frame.axes[2].xyz, centre),
    ));
    let far = length(away + cube.voxels);
    return vec2(length(max(away - cube.voxels, vec3(0.0))) - DISTANCE_SLACK * far, far + DISTANCE_SLACK * far);
}

/// The distance that says how large a voxel looks: its range, or, without perspective, always one metre.
fn apparent_distance(range: f32) -> f32 {
    return select(1.0, range, PERSPECTIVE);
}

