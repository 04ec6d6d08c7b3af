//! Tests device requirements and refusals, and the validity of rewritten kernels.

mod common;

use std::{
    collections::{BTreeMap, BTreeSet},
    process::Command,
};

use common::{Gpu, Turn};
use glint::{
    Error,
    gpu::{
        Access, Buffer, ConstantKind, Context, ContextOptions, Feature, GpuError, Location, Reconvergence, Unit,
        ash::{self, vk},
        spirv::{
            MAXIMALLY_RECONVERGES, Mode, SIGNED_ZERO_INF_NAN_PRESERVE, SUBGROUP_UNIFORM_CONTROL_FLOW, instructions, op,
            opcode, shared_bytes, with_modes, words,
        },
    },
    stages::{blend, kernels, radix_upsweep, status, step_done},
    verify::task::{Load, random_task},
};

/// The validator's output for a module; empty if it is valid.
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
    // Modes from 2021 or older, so that every validator knows them; the same code adds the newer mode of
    // reconvergence.
    let modes = [SIGNED_ZERO_INF_NAN_PRESERVE, SUBGROUP_UNIFORM_CONTROL_FLOW];
    for kernel in kernels::ALL {
        for module in [kernel.spirv, kernel.software_spirv] {
            let module = words(module).unwrap();
            assert_eq!(spirv_val(&module), "", "{}", kernel.name);
            assert_eq!(spirv_val(&with_modes(&module, &modes).unwrap()), "", "{}, with modes", kernel.name);
        }
    }
    // Check that the validator reports faults.
    let module = words(kernels::ALL[0].spirv).unwrap();
    let half = Mode { operands: &[], ..SIGNED_ZERO_INF_NAN_PRESERVE };
    assert_ne!(spirv_val(&with_modes(&module, &[half]).unwrap()), "");
    // A validator that knows the newest mode must accept it too.
    let said = spirv_val(&with_modes(&module, &[MAXIMALLY_RECONVERGES]).unwrap());
    assert!(said.is_empty() || said.contains("6023"), "{said}");
}

/// A name in SPIR-V's encoding: UTF-8 in words, ended by a zero byte.
fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0).collect();
    String::from_utf8(bytes).unwrap()
}

/// If two kernels, or two passes of one, must come to the same decision, the compiler must not contract a
/// product and a sum in only one of them. llvmpipe never does, so no image would show it: the test checks the
/// decoration `NoContraction` itself.
#[test]
fn what_is_decided_twice_is_decided_by_the_same_arithmetic() {
    const NO_CONTRACTION: u32 = 42;
    // Negation, sum, difference, product and quotient, dot product, and the products with vectors and
    // matrices.
    let contracts = |code: u32| matches!(code, 127 | 129 | 131 | 133 | 136 | 142..=148);
    // By kernel and function: float32 operations, and those with NoContraction.
    let mut found = BTreeMap::<(&str, String), [usize; 2]>::new();
    for kernel in kernels::ALL {
        let module = words(kernel.spirv).unwrap();
        let (mut names, mut kept, mut function) = (BTreeMap::new(), BTreeSet::new(), String::new());
        for i in instructions(&module).unwrap() {
            match opcode(i) {
                op::NAME => drop(names.insert(i[1], text(&i[2..]))),
                op::DECORATE if i[2] == NO_CONTRACTION => drop(kept.insert(i[1])),
                op::FUNCTION => function = names[&i[2]].split('(').next().unwrap().to_owned(),
                code if contracts(code) => {
                    let counts = found.entry((kernel.name, function.clone())).or_default();
                    counts[0] += 1;
                    counts[1] += usize::from(kept.contains(&i[2]));
                }
                _ => {}
            }
        }
    }
    for (function, in_kernels) in [
        // Counted tiles are the listed ones.
        ("tile_span", &["emit", "project", "screen_project"][..]),
        ("tile_rows", &["emit", "project", "screen_project"]),
        // The backward pass stops at the same splat as the forward pass.
        ("respond", &["blend", "blend_backward", "blend_backward_atomic"]),
        // Counted points are the written ones.
        ("screen_covariance", &["lift_count", "lift_pca", "lift_points", "screen_prune"]),
        ("make_footprint", &["lift_count", "lift_points", "screen_prune"]),
        ("footprint_weight", &["lift_count", "lift_points", "screen_prune"]),
        // The distance to a block's box never exceeds that to a point in it; every pass over the keys sees
        // the same keys.
        ("squared_length", &["lift_join"]),
        ("key_of", &["screen_draw"]),
    ] {
        let of = found.iter().filter(|((_, name), _)| name == function);
        let (kernels, counts): (Vec<_>, Vec<_>) = of.map(|((kernel, _), counts)| (*kernel, *counts)).unzip();
        assert_eq!(kernels, in_kernels, "{function}");
        assert!(counts.iter().all(|[all, kept]| all == kept && *all > 0), "{function}: {counts:?}");
    }
    // Only a part of these: the splat that is counted and stored, the transmittance after a splat, and
    // compensated sums.
    for (kernel, function, least) in [
        ("project", "main", 10),
        ("screen_project", "main", 3),
        ("blend", "take", 4),
        ("blend_backward", "take", 4),
        ("blend_backward_atomic", "take", 4),
        ("project_backward", "sum_over", 4),
        ("density_score", "sum_over", 4),
    ] {
        let [_, kept] = found[&(kernel, function.to_owned())];
        assert!(kept >= least, "{kernel}: {kept} operations are kept as they are");
    }
}

/// Lanes that read memory while others write it must read by atomics; otherwise Vulkan's memory model leaves
/// the result undefined. Runs on a CPU do not show a difference.
#[test]
fn a_buffer_that_a_kernel_writes_by_atomics_is_touched_by_nothing_else() {
    const STORAGE_BUFFER: u32 = 12;
    // Written in one dispatch and read in the next; a specialisation constant selects between the two.
    let apart = BTreeSet::from([("pursuit_claim", "Claims".to_owned())]);
    let (mut atomics, mut mixed) = (BTreeSet::new(), BTreeSet::new());
    for kernel in kernels::ALL {
        let module = words(kernel.spirv).unwrap();
        let list = instructions(&module).unwrap();
        let (mut names, mut pointees, mut buffers) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        // By buffer: whether it has plain loads and stores, and whether it has atomics.
        let mut touched = BTreeMap::<String, [bool; 2]>::new();
        for i in &list {
            match opcode(i) {
                op::NAME => drop(names.insert(i[1], text(&i[2..]))),
                op::TYPE_POINTER => drop(pointees.insert(i[1], i[3])),
                op::VARIABLE if i[3] == STORAGE_BUFFER => drop(buffers.insert(i[2], i[2])),
                // Access chains into a buffer belong to the buffer.
                65 | 66 => {
                    if let Some(&buffer) = buffers.get(&i[3]) {
                        buffers.insert(i[2], buffer);
                    }
                }
                code => {
                    let pointer = match code {
                        // A load and the atomics with a result; a store and the atomic one.
                        61 | 227 | 229..=242 | 6035 => i[3],
                        62 | 228 => i[1],
                        _ => continue,
                    };
                    let Some(buffer) = buffers.get(&pointer) else { continue };
                    let variable = list.iter().find(|v| opcode(v) == op::VARIABLE && v[2] == *buffer).unwrap();
                    let name: &String = &names[&pointees[&variable[1]]];
                    touched.entry(name.clone()).or_default()[usize::from(code > 62)] = true;
                }
            }
        }
        for (name, [plain, atomic]) in touched {
            if atomic {
                atomics.insert((kernel.name, name.clone()));
                if plain {
                    mixed.insert((kernel.name, name));
                }
            }
        }
    }
    assert!(atomics.len() >= 12 && atomics.contains(&("lift_join", "Labels".to_owned())), "{atomics:?}");
    assert_eq!(mixed, apart);
}

#[test]
fn kernels_stay_within_the_shared_memory_that_vulkan_guarantees() {
    for kernel in kernels::ALL {
        // The largest workgroups in use: of radix_spine, and of the kernels with independent subgroups.
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
            // On a borrowed device: required, or declared available by the owner.
            assert!(wanted.features.contains(feature) || wanted.optional.contains(feature));
            let optional = wanted.optional.contains(feature);
            assert!(gpu.features().contains(feature) || optional, "{}: {feature:?}", kernel.name);
            if let (false, Some(extension)) = (optional, feature.extension()) {
                assert!(wanted.extensions.contains(&extension));
            }
        }
        assert_eq!(kernel.subgroups, kernel.features.contains(&Feature::SubgroupSizeControl), "{}", kernel.name);
    }
    // Only runs show the index of broadcasts: validation layers do not check its feature.
    let blend = kernels::ALL.iter().find(|k| k.name == "blend").unwrap();
    assert!(blend.features.contains(&Feature::SubgroupBroadcastDynamicId));
    assert_eq!(gpu.info().float_atomics, gpu.features().contains(&Feature::ShaderBufferFloat32AtomicAdd));
}

/// Required limits follow from the kernels' interfaces.
#[test]
fn limits_are_those_of_the_kernel_that_takes_most() {
    let needed = Context::requirements();
    let least = |name: &str| needed.limits.iter().find(|limit| limit.name == name).map(|limit| limit.least);
    let bindings = kernels::ALL.iter().map(|kernel| kernel.bindings.len() as u32).max();
    for name in ["maxPerStageDescriptorStorageBuffers", "maxDescriptorSetStorageBuffers"] {
        assert_eq!(least(name), bindings, "{name}");
    }
    assert_eq!(least("maxPushConstantsSize"), kernels::ALL.iter().map(|kernel| kernel.push_bytes).max());
    // Within Vulkan's guaranteed limits; otherwise devices could be refused for them.
    assert!(least("maxPushConstantsSize") <= Some(128) && least("maxComputeSharedMemorySize") == Some(16384));
    assert_eq!(least("maxComputeWorkGroupInvocations"), Some(128));
    assert_eq!(needed.subgroup_lanes, [8, 64]);
    let subgroups = kernels::ALL.iter().any(|kernel| kernel.subgroups);
    assert!(subgroups && needed.subgroup_operations.contains(vk::SubgroupFeatureFlags::BALLOT));
    let blend = kernels::ALL.iter().find(|kernel| kernel.name == "blend").unwrap();
    let image = blend.bindings.iter().find(|binding| binding.name == c"image").unwrap();
    assert_eq!((image.access, image.element_bytes, blend.unit), (Access::Write, 16, Unit::Subgroup));
    assert_eq!(blend.push_bytes as usize, size_of::<blend::Push>());
    for kernel in kernels::ALL {
        let [first, ..] = kernel.constants else { panic!("{} has no workgroup size", kernel.name) };
        assert_eq!((first.id, first.name, first.kind), (0, c"workgroup_size", ConstantKind::U32), "{}", kernel.name);
        let names: BTreeSet<_> = kernel.bindings.iter().map(|binding| binding.name).collect();
        assert!(names.len() == kernel.bindings.len() && kernel.bindings.iter().all(|b| b.element_bytes > 0));
    }
}

#[test]
fn a_size_of_subgroups_is_had_or_refused() {
    let gpu = Gpu::new();
    let info = gpu.info().clone();
    let [least, most] = info.subgroup_sizes;
    assert!((8..=64).contains(&info.subgroup_size) && info.max_workgroup.is_multiple_of(info.subgroup_size));
    // Software subgroups can have any size.
    let offered = |lanes: u32| (least..=most).contains(&lanes) || info.reconvergence == Reconvergence::OneSubgroup;
    for lanes in [8, 16, 32, 64] {
        let options = ContextOptions { subgroup_size: Some(lanes), ..ContextOptions::from_env() };
        match gpu.again(&options) {
            Ok(context) => assert!(offered(lanes) && context.info().subgroup_size == lanes),
            Err(e) => assert!(!offered(lanes) && e.to_string().contains(&format!("subgroups of {lanes} lanes")), "{e}"),
        }
    }
    for lanes in [0, 4, 12, 128] {
        let options = ContextOptions { subgroup_size: Some(lanes), ..ContextOptions::from_env() };
        assert!(matches!(gpu.again(&options), Err(GpuError::Missing { .. })), "{lanes}");
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
            direct: false,
            unrolled: false,
            packed_splats: false,
            listed: false,
        };
        blend::Stage::new(&gpu, &spec).err().map(|e| e.to_string())
    };
    // A kernel with independent subgroups uses workgroups of one subgroup if the device requires that,
    // whatever the requested size.
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
    // 2^16 counters per subgroup.
    let spec = radix_upsweep::Spec {
        workgroup_size: 64,
        block: 1024,
        digit_bits: 16,
        compact: false,
        row_lanes: 8,
        lockstep: false,
    };
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
    // A refused allocation takes nothing, and dropped memory is available again.
    assert_eq!((gpu.memory().used, gpu.memory().most_used), (budget / 2, budget / 2));
    let other = half.clone();
    drop(half);
    assert_eq!(gpu.memory().used, budget / 2);
    drop(other);
    assert_eq!(gpu.memory().used, 0);
    assert!(Buffer::<u32>::new(&gpu, "all", 1 << 18, Location::Device).is_ok());
    assert_eq!(gpu.memory().most_used, budget);
    let _quarter = Buffer::<u32>::new(&gpu, "quarter", 1 << 16, Location::Device).unwrap();
    gpu.count_most_anew();
    assert_eq!(gpu.memory().most_used, budget / 4);
    // A refusal for the block of a small buffer takes nothing either.
    let gpu = Gpu::with(ContextOptions { memory_budget: Some(6 << 20), ..ContextOptions::from_env() });
    let _small = Buffer::<u8>::new(&gpu, "small", 1 << 16, Location::Device).unwrap();
    assert!(Buffer::<u8>::new(&gpu, "large", 5 << 20, Location::Device).is_err());
    assert_eq!(gpu.memory().most_used, 1 << 16);
    // Without a cap, the budget is the device's memory.
    assert!(Gpu::new().memory().budget > 1 << 28);
}

#[test]
fn a_context_made_again_keeps_the_device_open_and_has_the_rest_for_itself() {
    let _turn = Turn::alone();
    let first = Context::new(&ContextOptions::from_env()).unwrap();
    let again = first.again(&ContextOptions { memory_budget: Some(1 << 20), ..ContextOptions::from_env() }).unwrap();
    assert!(!again.is_same(&first) && again.device().handle() == first.device().handle());
    let words = Buffer::from_slice(&first, "words", &[7u32; 100]).unwrap();
    assert!(again.memory().used == 0 && again.counters().submissions == 0 && first.counters().submissions > 0);
    drop((words, first));
    assert_eq!(Buffer::from_slice(&again, "words", &[9u32; 100]).unwrap().download().unwrap(), [9; 100]);
    assert!(Buffer::<u32>::new(&again, "too much", (1 << 18) + 1, Location::Device).is_err());
    assert!(again.validation_messages().is_empty());
}

/// Layers must detect a missing barrier or semaphore between two submissions; otherwise no test would show
/// that successive frames and steps on a queue are synchronised. Layers before 1.3.275 only check single
/// command buffers, unless configured.
#[test]
fn a_hazard_between_two_submissions_is_seen() {
    let options = ContextOptions::from_env();
    let told = std::env::var("VK_LAYER_ENABLES").is_ok_and(|list| list.contains("QUEUE_SUBMIT"));
    // SAFETY: loads the system's loader, and a query.
    let layers = unsafe { ash::Entry::load().unwrap().enumerate_instance_layer_properties() }.unwrap();
    let need_no_telling = layers.iter().any(|layer| {
        let validates = layer.layer_name_as_c_str() == Ok(c"VK_LAYER_KHRONOS_validation");
        validates && layer.spec_version >= vk::make_api_version(0, 1, 3, 275)
    });
    if !options.validation || !(told || need_no_telling) {
        return println!("needs the validation layers, told to look at submissions, as tools/test has them");
    }
    let _turn = Turn::alone();
    let context = Context::new(&options).unwrap();
    let words = Buffer::<u32>::new(&context, "words", status::WORDS, Location::Device).unwrap();
    let count = step_done::Stage::new(&context, &step_done::Spec { workgroup_size: 1 }).unwrap();
    // A kernel reads and writes a buffer that the previous submission fills.
    let pair = |after_all: bool| {
        let mut recorder = context.recorder("fill").unwrap();
        recorder.barrier();
        recorder.fill(&words, 0);
        let first = recorder.submit().unwrap();
        let mut recorder = context.recorder("count").unwrap();
        if after_all {
            recorder.barrier();
        }
        count.record(&mut recorder, &step_done::Buffers { status: &words }, &step_done::Push {}, 1);
        [first, recorder.submit().unwrap()].into_iter().for_each(|work| drop(work.wait().unwrap()));
    };
    pair(true);
    assert_eq!(context.validation_messages(), [""; 0]);
    pair(false);
    let said = context.validation_messages().concat();
    assert!(said.contains("SYNC-HAZARD-") && said.contains("-AFTER-WRITE"), "{said}");
}

#[test]
fn a_load_of_no_gaussians_is_refused() {
    let load = Load { width: 64, height: 64, gaussians: 0 };
    let gpu = Gpu::new();
    assert!(matches!(random_task(&gpu, load, 1.0, 3), Err(Error::Usage(_))));
}
