//! The pyramid against Eq. 10 read literally: every texel from all the full-resolution ranges of its window.

use proptest::prelude::*;
use pyramap::pyramid::{Pyramid, Selection, num_layers};
use pyramap::ranges::Ranges;

/// The texel by its definition, in one loop over the window.
fn naive(ranges: &[f32], (width, height): (usize, usize), i: usize, (a, b): (usize, usize), t: f32, min: bool) -> f32 {
    let size = 1 << i;
    let mut best: Option<f32> = None;
    for y in b * size..((b + 1) * size).min(height) {
        for x in a * size..((a + 1) * size).min(width) {
            let range = ranges[y * width + x];
            if range == 0.0 {
                continue;
            }
            let better = |old: f32| {
                let (new_distance, old_distance) = ((range - t).abs(), (old - t).abs());
                if min {
                    range < old
                } else {
                    new_distance < old_distance || (new_distance == old_distance && range < old)
                }
            };
            if best.is_none_or(better) {
                best = Some(range);
            }
        }
    }
    best.unwrap_or(0.0)
}

fn image() -> impl Strategy<Value = (usize, usize, Vec<f32>)> {
    // Few different values, so that ties and equal distances on both sides of t_i come up often.
    let range = prop_oneof![
        2 => Just(0.0f32),
        1 => Just(f32::INFINITY),
        6 => (1u32..40).prop_map(|steps| steps as f32 * 0.125),
        3 => 0.01f32..5.0,
    ];
    (1usize..40, 1usize..40)
        .prop_flat_map(move |(w, h)| (Just(w), Just(h), prop::collection::vec(range.clone(), w * h)))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, rng_seed: prop::test_runner::RngSeed::Fixed(7), ..Default::default() })]

    #[test]
    fn every_texel_is_its_window_s((width, height, values) in image(), t_0 in prop_oneof![Just(4.0), 0.1f64..8.0], first in 0usize..3) {
        let ranges = Ranges::from_values(width, height, values.clone());
        let count = num_layers(width, height);
        for (selection, min) in [(Selection::Nearest, false), (Selection::Minimum, true)] {
            let mut pyramid = Pyramid::default();
            pyramid.compute(&ranges, t_0, selection, first.min(count - 1)..count);
            prop_assert_eq!(pyramid.layers.len(), count);
            for (i, layer) in pyramid.layers.iter().enumerate().skip(first.min(count - 1)) {
                prop_assert_eq!((layer.width, layer.height), (width.div_ceil(1 << i), height.div_ceil(1 << i)));
                let t = (t_0 / f64::from(1u32 << i)) as f32;
                for (n, &texel) in layer.values.iter().enumerate() {
                    let at = (n % layer.width, n / layer.width);
                    prop_assert_eq!(texel, naive(&values, (width, height), i, at, t, min), "layer {} texel {:?}", i, at);
                }
            }
        }
    }
}

#[test]
fn layers_exist_while_a_window_fits_the_shorter_side() {
    assert_eq!(num_layers(640, 480), 9);
    assert_eq!(num_layers(1, 1000), 1);
    assert_eq!(num_layers(256, 255), 8);
    assert_eq!(num_layers(256, 256), 9);
}

#[test]
fn buffers_serve_images_of_any_size_in_turn() {
    let mut pyramid = Pyramid::default();
    for (width, height) in [(40, 30), (7, 90), (64, 64), (3, 2)] {
        let values: Vec<f32> = (0..width * height).map(|i| 1.0 + (i % 17) as f32 * 0.25).collect();
        let ranges = Ranges::from_values(width, height, values);
        pyramid.compute(&ranges, 3.0, Selection::Nearest, 0..num_layers(width, height));
        let mut fresh = Pyramid::default();
        fresh.compute(&ranges, 3.0, Selection::Nearest, 0..num_layers(width, height));
        for (kept, new) in pyramid.layers.iter().zip(&fresh.layers) {
            assert_eq!((kept.width, kept.height, &kept.values), (new.width, new.height, &new.values));
        }
    }
}
