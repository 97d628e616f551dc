//! An application that has a GPU device of its own lets pyramap map on it, and compares with a map made on the CPU.
//!
//! `cargo run --release -p pyramap-wgpu --example own_device [ADAPTER]` takes the first adapter whose name contains
//! ADAPTER (in any case), or the first one at all. The camera is simulated.

use nalgebra::Vector3;
use pyramap::{Depth, DepthImage, GridConfig, OccupancyGrid, State};
use pyramap_scenes::{kinect_noise, office_loop};
use pyramap_wgpu::GpuBackend;
use std::error::Error;

const FRAMES: usize = 8;
/// Every so many frames of the loop, so that the camera gets around.
const STRIDE: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    // The application's own device, with whatever it needs of it.
    let wanted = std::env::args().nth(1).unwrap_or_default().to_lowercase();
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.to_lowercase().contains(&wanted));
    let adapter = adapter.ok_or("there is no such graphics adapter")?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;

    // The map takes a share of it; handles are cheap to clone.
    let config = GridConfig::new(0.05)?;
    let backend = GpuBackend::with_device(device.clone(), queue.clone(), &adapter.get_info().name, &config)?;
    let mut on_gpu = OccupancyGrid::with_backend(config.clone(), Box::new(backend))?;
    let mut on_cpu = OccupancyGrid::new(config)?;

    let (office, camera) = (office_loop(), *office_loop().camera());
    for (number, pose) in office.poses().iter().step_by(STRIDE).take(FRAMES).enumerate() {
        let depth = kinect_noise(&office.render(&camera, pose), &camera, number as u64)?;
        let image = DepthImage::new(Depth::F32(&depth), camera.width, camera.height)?;
        // The device works on the frame while the next one is made; the CPU is done at once.
        on_gpu.submit(&image, &camera, pose)?;
        on_cpu.integrate(&image, &camera, pose)?;
    }
    on_gpu.synchronize()?;

    for grid in [&on_gpu, &on_cpu] {
        let on = grid.adapter().unwrap_or("CPU");
        println!(
            "{on}: {} frames, {} blocks, {} voxels seen",
            grid.num_frames(),
            grid.num_blocks(),
            grid.num_observed()?
        );
    }
    // Along the first image's optical axis.
    let first = &office.poses()[0];
    let at = |z: f64| (first.rotation * Vector3::new(0.0, 0.0, z) + first.translation).into();
    let points: Vec<[f64; 3]> = (1..100).map(|step| at(0.05 * f64::from(step))).collect();
    let [gpu, cpu] = [on_gpu.state(&points)?, on_cpu.state(&points)?];
    match points.iter().zip(&gpu).find(|(_, state)| **state == State::Occupied) {
        Some((point, _)) => println!("the camera first looked at something at {point:.2?}"),
        None => println!("the camera first looked into the open"),
    }
    let differ = gpu.iter().zip(&cpu).filter(|(gpu, cpu)| gpu != cpu).count();
    println!("of {} points on the way there, GPU and CPU disagree on {differ}", points.len());

    // What else the application does with its device goes on.
    device.poll(wgpu::PollType::wait_indefinitely())?;
    Ok(())
}
