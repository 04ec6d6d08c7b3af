//! What is asked of a device, what is refused, and that what kernels are made into is valid.

mod common;

use std::process::Command;

use common::Gpu;
use glint::{
    gpu::{
        Buffer, Context, ContextOptions, Feature, GpuError, Location, Reconvergence,
        spirv::{
            MAXIMALLY_RECONVERGES, Mode, SIGNED_ZERO_INF_NAN_PRESERVE, SUBGROUP_UNIFORM_CONTROL_FLOW, shared_bytes,
            with_modes, words,
        },
    },
    stages::{blend, kernels, radix_upsweep, step_done},
};

/// What the validator says of a module; nothing where it is valid.
fn spirv_val(module: &[u32]) -> String {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytemuck::cast_slice::<u32, u8>(module)).unwrap();
    let arguments = ["--target-env", "vulkan1.2", "--scalar-block-layout"];
    let said = Command::new("spirv-val").args(arguments).arg(file.path()).output().expect("spirv-val, see tools/setup");
    assert_eq!(said.status.success(), said.stderr.is_empty() && said.stdout.is_empty());
    String::from_utf8_lossy(&[said.stdout, said.stderr].concat()).into_owned()
}

#[test]
fn every_kernel_is_valid_as_it_is_and_with_all_that_is_added_to_it() {
    // Of 2021 and older, so that every validator knows it; the other mode of reconvergence is added by the same lines.
    let modes = [SIGNED_ZERO_INF_NAN_PRESERVE, SUBGROUP_UNIFORM_CONTROL_FLOW];
    for kernel in kernels::ALL {
        let mut modules = vec![kernel.spirv];
        #[cfg(feature = "software-subgroups")]
        modules.push(kernel.software_spirv);
        for module in modules.drain(..) {
            let module = words(module).unwrap();
            assert_eq!(spirv_val(&module), "", "{}", kernel.name);
            assert_eq!(spirv_val(&with_modes(&module, &modes).unwrap()), "", "{}, with modes", kernel.name);
        }
    }
    // It would say something.
    let module = words(kernels::ALL[0].spirv).unwrap();
    let half = Mode { operands: &[], ..SIGNED_ZERO_INF_NAN_PRESERVE };
    assert_ne!(spirv_val(&with_modes(&module, &[half]).unwrap()), "");
    // Where the validator knows the newest mode, it holds it valid too.
    let said = spirv_val(&with_modes(&module, &[MAXIMALLY_RECONVERGES]).unwrap());
    assert!(said.is_empty() || said.contains("6023"), "{said}");
}

#[test]
fn kernels_stay_within_the_shared_memory_that_vulkan_guarantees() {
    for kernel in kernels::ALL {
        // The largest workgroups that are asked for, of radix_spine and of the kernels of independent subgroups.
        let workgroup = if kernel.barriers { 1024 } else { 64 };
        let bytes = shared_bytes(&words(kernel.spirv).unwrap(), &[(0, workgroup)]).unwrap();
        assert!(bytes <= 16384, "{}: {bytes}", kernel.name);
    }
}

#[test]
fn every_feature_that_a_kernel_needs_is_asked_for() {
    let gpu = Gpu::new();
    let wanted = Context::requirements();
    for kernel in kernels::ALL {
        for feature in kernel.features {
            // Of a borrowed device: asked for, or the owner may say that it is there.
            assert!(wanted.features.contains(feature) || wanted.optional.contains(feature));
            let optional = wanted.optional.contains(feature);
            assert!(gpu.features().contains(feature) || optional, "{}: {feature:?}", kernel.name);
            if let (false, Some(extension)) = (optional, feature.extension()) {
                assert!(wanted.extensions.contains(&extension));
            }
        }
        assert_eq!(kernel.subgroups, kernel.features.contains(&Feature::SubgroupSizeControl), "{}", kernel.name);
    }
    // Lanes are handed round by a number that only runs show: the validation layers do not ask for its feature.
    let blend = kernels::ALL.iter().find(|k| k.name == "blend").unwrap();
    assert!(blend.features.contains(&Feature::SubgroupBroadcastDynamicId));
    assert_eq!(gpu.info().float_atomics, gpu.features().contains(&Feature::ShaderBufferFloat32AtomicAdd));
}

#[test]
fn a_size_of_subgroups_is_had_or_refused() {
    let info = Gpu::new().info().clone();
    let [least, most] = info.subgroup_sizes;
    assert!((8..=64).contains(&info.subgroup_size) && info.max_workgroup.is_multiple_of(info.subgroup_size));
    // Software subgroups have any size.
    let offered = |lanes: u32| (least..=most).contains(&lanes) || info.reconvergence == Reconvergence::OneSubgroup;
    for lanes in [8, 16, 32, 64] {
        let options = ContextOptions { subgroup_size: Some(lanes), ..ContextOptions::from_env() };
        match Context::new(&options) {
            Ok(context) => assert!(offered(lanes) && context.info().subgroup_size == lanes),
            Err(e) => assert!(!offered(lanes) && e.to_string().contains(&format!("subgroups of {lanes} lanes")), "{e}"),
        }
    }
    for lanes in [0, 4, 12, 128] {
        let options = ContextOptions { subgroup_size: Some(lanes), ..ContextOptions::from_env() };
        assert!(matches!(Context::new(&options), Err(GpuError::Missing { .. })), "{lanes}");
    }
}

#[test]
fn a_pipeline_beyond_the_devices_limits_is_refused_by_name() {
    let gpu = Gpu::new();
    let blend = |workgroup_size| {
        let spec = blend::Spec {
            workgroup_size,
            tile_width: 8,
            tile_height: 8,
            pixels: 64 / gpu.info().subgroup_size,
            background_image: false,
            median: false,
            occluded: false,
        };
        blend::Stage::new(&gpu, &spec).err().map(|e| e.to_string())
    };
    // A kernel of independent subgroups takes a workgroup of one where the device asks for that, whatever is wanted.
    if gpu.info().reconvergence != Reconvergence::OneSubgroup {
        let (most, lanes) = (gpu.info().max_workgroup, gpu.info().subgroup_size);
        assert_eq!(blend(most), None);
        let said = blend(most + lanes).unwrap();
        assert!(
            said.contains(&format!("{most} threads of a workgroup (blend), {} are needed", most + lanes)),
            "{said}"
        );
        assert!(blend(lanes / 2).unwrap().contains("is not of whole subgroups"));
    }
    let counter = step_done::Stage::new(&gpu, &step_done::Spec { workgroup_size: 0 });
    assert!(matches!(counter, Err(GpuError::Kernel { kernel: "step_done", .. })));
    // 2^16 counters for each subgroup.
    let spec = radix_upsweep::Spec { workgroup_size: 64, block: 1024, digit_bits: 16, compact: false };
    let upsweep = radix_upsweep::Stage::new(&gpu, &spec).err().unwrap().to_string();
    assert!(upsweep.contains("bytes of shared memory (radix_upsweep)"), "{upsweep}");
}

#[test]
fn a_buffer_beyond_what_the_device_binds_is_refused() {
    let gpu = Gpu::new();
    let limit = gpu.info().max_storage_bytes;
    let refused = Buffer::<u32>::new(&gpu, "huge", (limit / 4) as usize + 1, Location::Device).err().unwrap();
    let GpuError::BufferTooLarge { name, bytes, limit: most } = &refused else { panic!("{refused}") };
    assert_eq!((name.as_str(), *bytes, *most), ("huge", limit / 4 * 4 + 4, limit));
    assert!(refused.is_no_room());
}

#[test]
fn a_buffer_beyond_the_memory_budget_is_refused_before_the_driver_is_asked() {
    let budget = 1 << 20;
    let gpu = Gpu::with(ContextOptions { memory_budget: Some(budget), ..ContextOptions::from_env() });
    assert_eq!((gpu.memory().budget, gpu.memory().used), (budget, 0));
    let half = Buffer::<u32>::new(&gpu, "half", 1 << 17, Location::Device).unwrap();
    assert_eq!(gpu.memory().used, budget / 2);
    let more = Buffer::<u32>::new(&gpu, "too much", (1 << 17) + 1, Location::Device).err().unwrap();
    let GpuError::OverBudget { name, bytes, used, budget: left } = &more else { panic!("{more}") };
    assert_eq!((name.as_str(), *bytes, *used, *left), ("too much", (budget / 2) + 4, budget / 2, budget));
    assert!(more.is_no_room() && more.to_string().contains("buffer too much needs 524292 bytes"), "{more}");
    // What was refused takes nothing, and what is dropped is there again.
    assert_eq!(gpu.memory().used, budget / 2);
    let other = half.clone();
    drop(half);
    assert_eq!(gpu.memory().used, budget / 2);
    drop(other);
    assert_eq!(gpu.memory().used, 0);
    assert!(Buffer::<u32>::new(&gpu, "all", 1 << 18, Location::Device).is_ok());
    // Without a cap there is what the device has.
    assert!(Gpu::new().memory().budget > 1 << 28);
}
