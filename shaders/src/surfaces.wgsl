// The layers as the sensor model sees them. Texels are placed where the pyramid finds them, so that the layers
// themselves are never stored.

/// Puts the range of a texel where it belongs; texels beyond the layer's border are none.
fn place(layer: u32, at: vec2<u32>, range: f32) {
    let size = frame.halved[layer];
    if at.x < size.width && at.y < size.height {
        surfaces[size.texels + at.y * size.width + at.x] = surface_of(range);
    }
}
