//! Compiles every kernel for AMD's GPUs, without a card, and prints registers, waves and memory on several
//! families.
//!
//!     radv --list > 32.json            the pipelines that `glint verify` makes on this device
//!     radv [--against FOLDER] [--write FOLDER] 32.json 64.json
//!
//! The lists are made on lavapipe with software subgroups of 32 and of 64 lanes. Mesa's RADV compiles each
//! pipeline on its null device (RADV_FORCE_FAMILY), once per family. It fails if a kernel is refused, spills
//! registers, uses scratch memory, or has fewer waves than the folder's file for this version of Mesa.
//! tools/devices runs it with each installed Mesa.

use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    io::{self, Read, Write},
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
};

use clap::Parser;
use glint::{
    gpu::{
        Context, ContextOptions, Feature, FeatureChain, KernelInfo,
        ash::{self, khr, vk},
        spirv::{self, MAXIMALLY_RECONVERGES, SIGNED_ZERO_INF_NAN_PRESERVE, SUBGROUP_UNIFORM_CONTROL_FLOW},
    },
    stages::ALL,
    verify,
};
use serde::{Deserialize, Serialize};

/// GPUs to compile for, by Mesa's names; before version 24 it had another name for RDNA 3, and no later
/// families.
const FAMILIES: [&str; 5] = ["navi21", "navi31", "gfx1150", "gfx1200", "vega20"];
const OLD_FAMILIES: [&str; 3] = ["navi21", "gfx1100", "vega20"];

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

#[derive(Parser)]
#[command(name = "radv", about = "Registers, waves and memory of every kernel on AMD's GPUs, without a card")]
struct Args {
    /// Fail if a kernel has fewer waves than radv-VERSION.json of this folder says
    #[arg(long)]
    against: Option<PathBuf>,
    /// Write radv-VERSION.json into this folder
    #[arg(long)]
    write: Option<PathBuf>,
    /// Print the pipelines of `glint verify` on this device
    #[arg(long)]
    list: bool,
    /// Lists of pipelines, made with subgroups of 32 and of 64 lanes
    lists: Vec<PathBuf>,
    /// For itself: read pipelines from stdin, compile them with subgroups of this many lanes
    #[arg(long, hide = true)]
    compile: Option<u32>,
    /// Given by cargo bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// A kernel and its specialisation constants.
#[derive(Serialize, Deserialize)]
struct Variant {
    kernel: String,
    constants: Vec<(u32, u32)>,
}

/// The driver's statistics for a compiled variant, or its refusal.
#[derive(Serialize, Deserialize)]
struct Compiled {
    kernel: String,
    /// Subgroup size.
    lanes: u32,
    statistics: std::result::Result<BTreeMap<String, u64>, String>,
}

/// Range over all variants of a kernel on one family with one subgroup size: minimum and maximum.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq)]
struct Extent {
    /// Vector registers per lane.
    vgprs: [u64; 2],
    /// Subgroups that a SIMD unit can hold at once. From RDNA on, RADV counts one of 64 lanes as two.
    waves: [u64; 2],
    /// Bytes of shared memory per workgroup.
    lds: [u64; 2],
    /// Bytes of code.
    code: [u64; 2],
}

#[derive(Serialize, Deserialize, Default)]
struct Results {
    driver: String,
    /// By kernel, then by "family, lanes".
    kernels: BTreeMap<String, BTreeMap<String, Extent>>,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<bool> {
    if args.list {
        return list().map(|()| true);
    }
    if let Some(lanes) = args.compile {
        return compile(lanes).map(|()| true);
    }
    let driver = child("navi21", 64, "[]")?.trim().to_owned();
    let version = driver.trim_start_matches("Mesa ").split(|c: char| !c.is_ascii_digit() && c != '.').next();
    let version = version.filter(|v| !v.is_empty()).ok_or_else(|| format!("a driver called {driver:?}"))?;
    let is_old = version.split('.').next().and_then(|major| major.parse().ok()).is_some_and(|major: u32| major < 24);
    let families = if is_old { &OLD_FAMILIES[..] } else { &FAMILIES };
    let (mut results, mut faults) = (Results { driver: driver.clone(), ..Default::default() }, Vec::new());
    for (list, lanes) in args.lists.iter().zip([32, 64]) {
        let variants = fs::read_to_string(list)?;
        // GPUs before RDNA only have subgroups of 64 lanes.
        for family in families.iter().filter(|family| lanes == 64 || !family.starts_with("vega")) {
            for line in child(family, lanes, &variants)?.lines().skip(1) {
                add(&mut results, &mut faults, family, serde_json::from_str(line)?);
            }
        }
    }
    print(&results, families);
    let name = format!("radv-{version}.json");
    if let Some(path) = args.against.as_ref().map(|folder| folder.join(&name)) {
        match fs::read_to_string(&path) {
            Ok(text) => compare(&results, &serde_json::from_str(&text)?, &mut faults),
            Err(e) => println!("nothing to compare with: {}: {e}", path.display()),
        }
    }
    if let Some(folder) = &args.write {
        fs::write(folder.join(&name), text_of(&results)?)?;
    }
    faults.iter().for_each(|fault| println!("FAILED: {fault}"));
    println!("{driver}: {} kernels on {}: {} faults", results.kernels.len(), families.join(", "), faults.len());
    Ok(faults.is_empty())
}

/// Runs this program again on RADV's null device; prints the driver's name and a line per pipeline.
fn child(family: &str, lanes: u32, variants: &str) -> Result<String> {
    let folder = Path::new("/usr/share/vulkan/icd.d");
    let names = fs::read_dir(folder)?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let manifest = names.filter(|name| name.starts_with("radeon")).min();
    let manifest = manifest.ok_or_else(|| format!("{}: no radeon*.json", folder.display()))?;
    let mut child = Command::new(env::current_exe()?)
        .args(["--compile", &lanes.to_string()])
        .env("VK_ICD_FILENAMES", folder.join(manifest))
        .env("RADV_FORCE_FAMILY", family)
        .env("MESA_SHADER_CACHE_DISABLE", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    // The child reads everything before it writes.
    child.stdin.take().expect("it is piped").write_all(variants.as_bytes())?;
    let output = child.wait_with_output()?;
    match output.status.success() {
        true => Ok(String::from_utf8(output.stdout)?),
        false => Err(format!("RADV on {family} with {lanes} lanes: {}", output.status).into()),
    }
}

fn list() -> Result<()> {
    let context = Context::new(&ContextOptions::from_env())?;
    verify::run(&context, &verify::Options { quick: true, perturb: 0.0 })?;
    let variants = context.pipelines().into_iter().map(|made| {
        let known = ALL.iter().find(|k| k.name == made.kernel).expect("a kernel of glint's");
        // Drop the constant that only software subgroups have.
        let constants = made.constants.into_iter().filter(|(id, _)| known.constants.iter().any(|c| c.id == *id));
        Variant { kernel: made.kernel.into(), constants: constants.collect() }
    });
    let variants: Vec<Variant> = variants.collect();
    Ok(serde_json::to_writer(io::stdout(), &variants)?)
}

fn compile(lanes: u32) -> Result<()> {
    let mut text = String::new();
    io::stdin().read_to_string(&mut text)?;
    let variants: Vec<Variant> = serde_json::from_str(&text)?;
    let compiler = Compiler::open(lanes)?;
    println!("{}", compiler.driver);
    for Variant { kernel, constants } in variants {
        let known = ALL.iter().find(|k| k.name == kernel).ok_or("an unknown kernel")?;
        if !known.features.iter().all(|feature| compiler.features.contains(feature)) {
            continue; // glint refuses the kernel there
        }
        let statistics = compiler.compile(known, &constants).map_err(|e| e.to_string());
        let (wave, statistics) = statistics.map_or_else(|e| (lanes, Err(e)), |(wave, s)| (wave, Ok(s)));
        let compiled = Compiled { kernel, lanes: wave, statistics };
        println!("{}", serde_json::to_string(&compiled)?);
    }
    // Destroying the null device crashes; the process ends instead.
    Ok(())
}

/// A device of RADV that runs nothing, opened like glint's.
struct Compiler {
    _entry: ash::Entry,
    device: ash::Device,
    executables: khr::pipeline_executable_properties::Device,
    features: BTreeSet<Feature>,
    driver: String,
    lanes: u32,
}

impl Compiler {
    fn open(lanes: u32) -> Result<Self> {
        // SAFETY: plain queries and creations from structures that live for their calls.
        unsafe {
            let entry = ash::Entry::load()?;
            let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let instance = entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&app), None)?;
            let (physical, features) = Context::choose(&entry, &instance, &ContextOptions::default())?;
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            instance.get_physical_device_properties2(
                physical,
                &mut vk::PhysicalDeviceProperties2::default().push_next(&mut driver),
            );
            let mut extensions = vec![khr::push_descriptor::NAME, khr::pipeline_executable_properties::NAME];
            extensions.extend(features.iter().filter_map(|f| f.extension()));
            extensions.sort_unstable();
            extensions.dedup();
            let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let mut statistics =
                vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
            let mut chain = FeatureChain::new(features.iter().copied());
            let mut linked = chain.link();
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&names)
                .push_next(&mut linked)
                .push_next(&mut statistics);
            let device = instance.create_device(physical, &info, None)?;
            let executables = khr::pipeline_executable_properties::Device::new(&instance, &device);
            let driver = driver.driver_info_as_c_str()?.to_string_lossy().into_owned();
            Ok(Compiler { _entry: entry, device, executables, features, driver, lanes })
        }
    }

    /// The module with glint's additions for such a device.
    fn module(&self, kernel: &KernelInfo) -> Result<Vec<u32>> {
        let reconvergence = match self.features.contains(&Feature::ShaderMaximalReconvergence) {
            true => MAXIMALLY_RECONVERGES,
            false => SUBGROUP_UNIFORM_CONTROL_FLOW,
        };
        let mut modes = vec![SIGNED_ZERO_INF_NAN_PRESERVE];
        modes.extend(kernel.subgroups.then_some(reconvergence));
        Ok(spirv::with_modes(&spirv::words(kernel.spirv)?, &modes)?)
    }

    /// Subgroup size, and the driver's statistics.
    fn compile(&self, kernel: &KernelInfo, constants: &[(u32, u32)]) -> Result<(u32, BTreeMap<String, u64>)> {
        let code = self.module(kernel)?;
        let bindings: Vec<_> = (0..kernel.bindings.len() as u32)
            .map(|binding| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let push =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(kernel.push_bytes)];
        let entries: Vec<_> = (0..)
            .step_by(4)
            .zip(constants)
            .map(|(offset, &(constant_id, _))| vk::SpecializationMapEntry { constant_id, offset, size: 4 })
            .collect();
        let words: Vec<u8> = constants.iter().flat_map(|(_, word)| word.to_ne_bytes()).collect();
        // SAFETY: every structure lives for its call. Objects live until the process ends.
        unsafe {
            let set = vk::DescriptorSetLayoutCreateInfo::default()
                .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
                .bindings(&bindings);
            let sets = [self.device.create_descriptor_set_layout(&set, None)?];
            let ranges = if kernel.push_bytes > 0 { &push[..] } else { &[] };
            let layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(ranges);
            let layout = self.device.create_pipeline_layout(&layout, None)?;
            let module = self.device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&code), None)?;
            let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&words);
            let mut size =
                vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default().required_subgroup_size(self.lanes);
            let mut stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            if kernel.subgroups {
                stage = stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS).push_next(&mut size);
            }
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage)
                .layout(layout);
            let made = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            let pipeline = made.map_err(|(_, e)| e)?[0];
            self.statistics(pipeline)
        }
    }

    /// # Safety
    /// `pipeline` was created with captured statistics.
    unsafe fn statistics(&self, pipeline: vk::Pipeline) -> Result<(u32, BTreeMap<String, u64>)> {
        // SAFETY: by the contract above.
        let (executables, list) = unsafe {
            let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
            let executable = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            (
                self.executables.get_pipeline_executable_properties(&info)?,
                self.executables.get_pipeline_executable_statistics(&executable)?,
            )
        };
        let lanes = executables.first().ok_or("no executable")?.subgroup_size;
        let value = |s: &vk::PipelineExecutableStatisticKHR| {
            // SAFETY: all of RADV's are 64-bit integers.
            Ok((s.name_as_c_str()?.to_string_lossy().into_owned(), unsafe { s.value.u64 }))
        };
        Ok((lanes, list.iter().map(value).collect::<Result<_>>()?))
    }
}

fn add(results: &mut Results, faults: &mut Vec<String>, family: &str, compiled: Compiled) {
    let Compiled { kernel, lanes, statistics } = compiled;
    let statistics = match statistics {
        Ok(statistics) => statistics,
        Err(e) => return faults.push(format!("{kernel} on {family}, {lanes} lanes: {e}")),
    };
    let number = |name: &str| statistics.get(name).copied().unwrap_or(u64::MAX);
    for name in ["Spilled SGPRs", "Spilled VGPRs", "Scratch size"] {
        if number(name) != 0 {
            faults.push(format!("{kernel} on {family}, {lanes} lanes: {name} {}", number(name)));
        }
    }
    let one = |name| [number(name); 2];
    let new =
        Extent { vgprs: one("VGPRs"), waves: one("Subgroups per SIMD"), lds: one("LDS size"), code: one("Code size") };
    let kernels = results.kernels.entry(kernel).or_default();
    let old = kernels.entry(format!("{family}, {lanes}")).or_insert(new);
    let join = |a: [u64; 2], b: [u64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    *old = Extent {
        vgprs: join(old.vgprs, new.vgprs),
        waves: join(old.waves, new.waves),
        lds: join(old.lds, new.lds),
        code: join(old.code, new.code),
    };
}

/// Prints kernels with less than 16 waves on RDNA 2 or 3: registers / waves, of all variants.
fn print(results: &Results, families: &[&str]) {
    let columns: BTreeSet<&str> = results.kernels.values().flat_map(|k| k.keys().map(String::as_str)).collect();
    let columns: Vec<_> = families.iter().flat_map(|f| columns.iter().filter(move |c| c.starts_with(*f))).collect();
    let range = |[least, most]: [u64; 2]| if least == most { most.to_string() } else { format!("{least}-{most}") };
    println!("| registers / waves; kernel | LDS |{}", columns.iter().map(|c| format!(" {c} |")).collect::<String>());
    println!("|---|---|{}", "---|".repeat(columns.len()));
    for (kernel, tables) in &results.kernels {
        let counts = |column: &str| ["navi", "gfx1100"].iter().any(|family| column.starts_with(family));
        if tables.iter().all(|(column, extent)| extent.waves[0] >= 16 || !counts(column)) {
            continue;
        }
        let cell = |column: &&&str| {
            let cell = tables.get(**column).map(|e| format!("{} / {}", range(e.vgprs), range(e.waves)));
            format!(" {} |", cell.unwrap_or_default())
        };
        let lds = tables.values().map(|e| e.lds[1]).max().unwrap_or(0);
        println!("| {kernel} | {lds} |{}", columns.iter().map(cell).collect::<String>());
    }
}

fn compare(now: &Results, before: &Results, faults: &mut Vec<String>) {
    for (kernel, tables) in &before.kernels {
        for (column, was) in tables {
            let Some(is) = now.kernels.get(kernel).and_then(|tables| tables.get(column)) else { continue };
            if is.waves[0] < was.waves[0] {
                faults.push(format!("{kernel} on {column} lanes: {} waves, {} before", is.waves[0], was.waves[0]));
            }
        }
    }
}

/// JSON with a line per kernel and column, so that diffs are readable.
fn text_of(results: &Results) -> Result<String> {
    let mut kernels = Vec::new();
    for (kernel, tables) in &results.kernels {
        let lines: Vec<_> = tables
            .iter()
            .map(|(c, e)| Ok(format!("   \"{c}\": {}", serde_json::to_string(e)?)))
            .collect::<Result<_>>()?;
        kernels.push(format!("  \"{kernel}\": {{\n{}\n  }}", lines.join(",\n")));
    }
    let driver = serde_json::to_string(&results.driver)?;
    Ok(format!("{{\n \"driver\": {driver},\n \"kernels\": {{\n{}\n }}\n}}\n", kernels.join(",\n")))
}
