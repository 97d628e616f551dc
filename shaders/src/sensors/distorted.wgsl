// The pinhole camera with a lens that distorts.

/// The pixel of a point in the plane z = 1.
fn pixel_of(flat: vec2<f32>) -> vec2<f32> {
    let lens = frame.distortion;
    let xx = flat.x * flat.x;
    let xy = flat.x * flat.y;
    let yy = flat.y * flat.y;
    let r2 = xx + yy;
    let radial = 1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
    let distorted = vec2(
        flat.x * radial + 2.0 * lens.p1 * xy + lens.p2 * (r2 + 2.0 * xx),
        flat.y * radial + lens.p1 * (r2 + 2.0 * yy) + 2.0 * lens.p2 * xy,
    );
    return distorted * frame.focal + frame.principal;
}

/// Projects a point (Eq. 13), and distorts it. Beyond the lens's radius nothing is in sight.
fn project(point: vec3<f32>) -> Projected {
    let flat = point.xy * (1.0 / point.z);
    let range = sqrt(point.x * point.x + point.y * point.y + point.z * point.z);
    let radius = frame.distortion.radius;
    let within = flat.x * flat.x + flat.y * flat.y <= radius * radius;
    return Projected(pixel_of(flat), range, point.z > 0.0 && within);
}

/// Where a cube lies in the image; `far` is the greatest of its ranges.
///
/// The disc up to the radius is convex, so that between two points in it the distortion moves no further apart than the
/// most that it stretches. A centre outside is taken to the disc's border: whatever is in the disc is no farther from
/// there, though its x or y alone may be.
fn outline_of(cube: Cube, centre: vec3<f32>, far: f32) -> Outline {
    let across = cube.across_sides + PIXEL_SLACK * far;
    if centre.z <= -cube.depth || any(sides_of_frustum(centre) + across < vec4(0.0)) {
        return out_of_sight();
    }
    if centre.z - cube.depth <= 1e-3 {
        return Outline(vec2(0.0), vec2(0.0), false, true, false);
    }
    let lens = frame.distortion;
    let flat = centre.xy / centre.z;
    let apart = spread(cube, centre);
    let distance = length(flat);
    let farthest = length(apart);
    let outside = distance > lens.radius;
    let inwards = select(1.0, lens.radius / max(distance, NEAREST), outside);
    let reach = select(apart, vec2(farthest), outside);
    let middle = pixel_of(flat * inwards);
    let half = vec2(dot(lens.stretch.xy, reach), dot(lens.stretch.zw, reach)) * frame.focal + PIXEL_SLACK;
    let low = middle - half;
    let high = middle + half;
    let within = all(low >= vec2(0.0)) && all(high <= frame.image);
    return Outline(low, high, true, true, within && distance + farthest < 0.999 * lens.radius);
}

