//! Every shader that can be put together is read and validated by naga, as wgpu does, and its layouts compared with
//! Rust's. No GPU is needed.

use super::*;
use crate::layout::HALVED;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, TypeInner};
use pyramap::PinholeCamera;
use std::collections::HashSet;

const SIGMAS: [Sigma; 2] = [Sigma::Constant, Sigma::Growing];
const SENSORS: [SensorKind; 4] =
    [SensorKind::Pinhole, SensorKind::DistortedPinhole, SensorKind::Spherical, SensorKind::Orthographic];
const RULES: [UpdateRule; 3] = [UpdateRule::Pyramid, UpdateRule::MinLayer, UpdateRule::Area];
const MAX_LAYERS: usize = PinholeCamera::MAX_SIDE.ilog2() as usize + 1;

fn every_kernel() -> Vec<Kernel> {
    let mut kernels = vec![arguments(), commit()];
    for sigma in SIGMAS {
        for count in 1..=MAX_LAYERS {
            for first in 0..count {
                kernels.extend([Format::U16, Format::F32].map(|format| tiles(format, sigma, first, count)));
            }
        }
        kernels.extend((1..MAX_LAYERS / TILE_LAYERS + 1).map(|pass| windows(sigma, pass)));
        kernels.extend((0..HALVED).step_by(TILE_LAYERS).map(|finer| bounds(sigma, finer)));
    }
    for (rule, sensor) in RULES.into_iter().flat_map(|rule| SENSORS.map(|sensor| (rule, sensor))) {
        kernels.push(cull(rule, sensor).expect("a rule for the GPU"));
        kernels.extend(SIGMAS.map(|sigma| update(rule, sigma, sensor).expect("a rule for the GPU")));
    }
    kernels
}

fn validated(kernel: &Kernel) -> (Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(&kernel.source)
        .unwrap_or_else(|error| panic!("{}: {}", kernel.entry, error.emit_to_string(&kernel.source)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}: {}", kernel.entry, error.emit_to_string(&kernel.source)));
    (module, info)
}

#[test]
fn every_shader_is_valid_and_uses_what_it_is_bound_to() {
    for kernel in every_kernel() {
        let (module, info) = validated(&kernel);
        assert_eq!(module.entry_points.len(), 1, "{}", kernel.entry);
        let entry = &module.entry_points[0];
        assert_eq!(entry.name, kernel.entry);
        assert!(entry.workgroup_size.iter().product::<u32>() <= 256);

        let used = |space: fn(&AddressSpace) -> bool| {
            let globals = module.global_variables.iter();
            globals
                .filter(|(handle, _)| !info.get_entry_point(0)[*handle].is_empty())
                .filter(move |(_, v)| space(&v.space))
        };
        // A binding that is not used would be missing from the pipeline's own layout.
        let bound: HashSet<_> = used(|_| true).filter_map(|(_, v)| v.binding).map(|b| (b.group, b.binding)).collect();
        assert_eq!(bound, (0..kernel.slots.len() as u32).map(|n| (0, n)).collect(), "{}", kernel.entry);
        // What every device allows.
        assert!(used(|space| matches!(space, AddressSpace::Storage { .. })).count() <= 8, "{}", kernel.entry);
    }
}

#[test]
fn structs_lie_as_in_rust() {
    let (module, _) = validated(&update(UpdateRule::Pyramid, Sigma::Constant, SensorKind::Spherical).unwrap());
    let in_wgsl = |name: &str| {
        let (_, found) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect(name);
        match &found.inner {
            TypeInner::Struct { members, span } => (members.clone(), *span),
            other => panic!("{name} is {other:?}"),
        }
    };
    let layouts = layout::layouts();
    assert_eq!(
        layouts.iter().map(|(name, ..)| *name).collect::<Vec<_>>(),
        ["Cube", "Distortion", "Sphere", "Halved", "Frame", "Addition", "Run", "Page"]
    );
    for (name, size, fields) in layouts {
        let (members, span) = in_wgsl(name);
        assert_eq!(span as usize, size, "{name}");
        let members = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize));
        assert_eq!(members.collect::<Vec<_>>(), fields, "{name}");
    }
    let (members, _) = in_wgsl("Results");
    assert_eq!(members.last().map(|m| m.offset as usize), Some(RESULT_COUNTS * size_of::<u32>()));
}

#[test]
fn numbers_are_read_back_as_they_were() {
    let (module, _) = validated(&arguments());
    let value = |name: &str| {
        let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name)).expect(name);
        match module.global_expressions[constant.init] {
            naga::Expression::Literal(naga::Literal::F32(value)) => value,
            ref other => panic!("{name} is {other:?}"),
        }
    };
    assert_eq!(value("NO_RETURN"), NO_RETURN);
    assert_eq!(value("HOLE"), HOLE);
    assert_eq!(value("NEAREST"), NEAREST);
    assert_eq!(value("STEPS"), STEPS);
    assert_eq!(value("DISTANCE_SLACK"), DISTANCE_SLACK);
}
