// Where blocks lie in the camera's frame.

/// The centre of a block, relative to the camera. Of a sum in higher precision the upper parts are exact in any order,
/// and the rounded lower parts are added last: it is what the host gets in f64, rounded once.
fn centre_of(block: vec3<u32>) -> vec3<f32> {
    let n = vec3<f32>(block);
    let upper = frame.origin[0] + n.x * frame.steps[0] + n.y * frame.steps[1] + n.z * frame.steps[2];
    let lower = frame.origin[1] + n.x * frame.steps[3] + n.y * frame.steps[4] + n.z * frame.steps[5];
    return (upper + lower).xyz;
}
