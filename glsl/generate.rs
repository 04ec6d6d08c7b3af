//! Compiles every `glsl/**/*.comp` to SPIR-V, reflects it and generates the typed interface of each kernel:
//! `Push`, `Spec`, `Buffers` and the structs of its blocks. A kernel whose interface changes no longer fits the
//! Rust code that records it, and that is a compile error.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use spirq::{
    ReflectConfig,
    ty::{AccessType, DescriptorType, ScalarType, StructType, Type},
    var::Variable,
};

use spirv::{instructions, op, opcode};

#[allow(dead_code, reason = "reading instructions is all that is wanted here")]
#[path = "../src/gpu/spirv.rs"]
mod spirv;

/// All that is made of the kernels, by file name: `NAME.spv` of each, `NAME.software.spv` of those with subgroup operations (see
/// `glsl/shared/subgroup.glsl`), the interface `kernels.rs`, and `needs.rs`.
///
/// # Errors
/// What is wrong with the kernels, a line for each.
pub fn files() -> Result<BTreeMap<String, Vec<u8>>, String> {
    let mut sources = Vec::new();
    collect(Path::new("glsl"), &mut sources);
    sources.sort();
    let mut types = Types::new();
    let (mut kernels, mut failed) = (Vec::new(), Vec::new());
    for path in &sources {
        match Kernel::build(path, &mut types) {
            Ok(kernel) => kernels.push(kernel),
            Err(e) => failed.push(e),
        }
    }
    if !failed.is_empty() {
        return Err(failed.join("\n"));
    }
    let bytes = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let mut files = BTreeMap::new();
    for kernel in &kernels {
        files.insert(format!("{}.spv", kernel.name), bytes(&kernel.spirv));
        files.extend(kernel.software.as_ref().map(|words| (format!("{}.software.spv", kernel.name), bytes(words))));
    }
    files.insert("kernels.rs".into(), (generate(&kernels, &types) + &constants()).into_bytes());
    files.insert("needs.rs".into(), needs(&kernels).into_bytes());
    Ok(files)
}

/// A kernel's modules and all that is generated from them.
pub struct Kernel {
    pub name: String,
    pub file: String,
    pub spirv: Vec<u32>,
    /// With subgroup operations through shared memory, if there are any.
    pub software: Option<Vec<u32>>,
    pub interface: Interface,
    pub demands: Demands,
    pub unit: &'static str,
}

impl Kernel {
    fn build(path: &Path, types: &mut Types) -> Result<Self, String> {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let file = path.to_str().unwrap().to_owned();
        let source = fs::read_to_string(path).unwrap();
        let in_kernel = |e: String| format!("{file}: {e}");
        let spirv = compile(&source, &file, false)?;
        let demands = Demands::of(&spirv).map_err(in_kernel)?;
        let unit = unit(&spirv).map_err(in_kernel)?;
        let software = match demands.subgroup_operations != 0 {
            true => Some(compile(&source, &file, true)?),
            false => None,
        };
        let interface = Interface::reflect(&spirv, types).map_err(in_kernel)?;
        Ok(Kernel { name, file, spirv, software, interface, demands, unit })
    }
}

/// SPIR-V of a GLSL kernel, or what the compiler says. `software`: its subgroups are those of `glsl/shared/subgroup.glsl`.
pub fn compile(source: &str, file: &str, software: bool) -> Result<Vec<u32>, String> {
    // Names that begin with gl_ can be neither defined nor declared.
    let rename = move |text: String| match software {
        true => text.replace("gl_Subgroup", "software_Subgroup").replace("gl_NumSubgroups", "software_NumSubgroups"),
        false => text,
    };
    let compiler = shaderc::Compiler::new().map_err(|e| e.to_string())?;
    let mut options = shaderc::CompileOptions::new().map_err(|e| e.to_string())?;
    // 1.2 keeps LocalSizeId (and so maintenance4) out of what an embedding application must enable.
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    // Drivers optimise; unoptimised SPIR-V keeps the names that reflection, RenderDoc and Nsight read.
    options.set_optimization_level(shaderc::OptimizationLevel::Zero);
    options.set_warnings_as_errors();
    if software {
        options.add_macro_definition("SOFTWARE_SUBGROUPS", None);
    }
    options.set_include_callback(move |name, kind, from, _| {
        let base = match kind {
            shaderc::IncludeType::Relative => Path::new(from).parent().unwrap().to_owned(),
            shaderc::IncludeType::Standard => PathBuf::from("glsl"),
        };
        let path = base.join(name);
        let content = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.to_string_lossy().into_owned(), content: rename(content) })
    });
    let compute = shaderc::ShaderKind::Compute;
    let spirv = compiler.compile_into_spirv(&rename(source.to_owned()), compute, file, "main", Some(&options));
    spirv.map(|s| s.as_binary().to_vec()).map_err(|e| e.to_string())
}

/// SPIR-V capabilities, each with the subgroup operations (bits of VkSubgroupFeatureFlagBits) and the feature that it needs of a
/// device. A kernel that declares another one is not built: it would need something that nobody asks a device for.
const CAPABILITIES: [(u32, u32, Option<&str>); 13] = [
    (1, 0, None),                                    // Shader
    (61, 0x01, None),                                // GroupNonUniform
    (62, 0x02, None),                                // GroupNonUniformVote
    (63, 0x04, None),                                // GroupNonUniformArithmetic
    (64, 0x08, None),                                // GroupNonUniformBallot
    (65, 0x10, None),                                // GroupNonUniformShuffle
    (66, 0x20, None),                                // GroupNonUniformShuffleRelative
    (9, 0, Some("ShaderFloat16")),                   // Float16
    (22, 0, Some("ShaderInt16")),                    // Int16
    (39, 0, Some("ShaderInt8")),                     // Int8
    (4433, 0, Some("StorageBuffer16BitAccess")),     // StorageBuffer16BitAccess
    (4448, 0, Some("StorageBuffer8BitAccess")),      // StorageBuffer8BitAccess
    (6033, 0, Some("ShaderBufferFloat32AtomicAdd")), // AtomicFloat32AddEXT
];

/// What a module needs of a device, beyond Vulkan 1.2.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Demands {
    /// Bits of VkSubgroupFeatureFlagBits.
    pub subgroup_operations: u32,
    /// The threads of a workgroup meet at barriers.
    pub barriers: bool,
    /// Variants of `gpu::Feature`.
    pub features: BTreeSet<&'static str>,
}

impl Demands {
    pub fn of(module: &[u32]) -> Result<Self, String> {
        // Scopes.
        const WORKGROUP: u32 = 2;
        const SUBGROUP: u32 = 3;
        let mut demands = Demands::default();
        let (mut constants, mut widths) = (BTreeMap::new(), BTreeMap::new());
        for i in instructions(module)? {
            match opcode(i) {
                op::CAPABILITY => {
                    let known = CAPABILITIES.iter().find(|(capability, ..)| *capability == i[1]);
                    let (_, operations, feature) = known.ok_or_else(|| {
                        format!(
                            "SPIR-V capability {} is not known: say in glsl/generate.rs what it needs of a device",
                            i[1]
                        )
                    })?;
                    demands.subgroup_operations |= operations;
                    demands.features.extend(feature);
                }
                op::TYPE_INT | op::TYPE_FLOAT => drop(widths.insert(i[1], i[2])),
                op::TYPE_VECTOR => drop(widths.get(&i[2]).copied().map(|width| widths.insert(i[1], width))),
                op::CONSTANT => drop(constants.insert(i[2], i[3])),
                op::CONTROL_BARRIER => match constants.get(&i[1]) {
                    Some(&WORKGROUP) => demands.barriers = true,
                    // Declares no capability of its own.
                    Some(&SUBGROUP) => demands.subgroup_operations |= 1,
                    other => return Err(format!("a barrier of scope {other:?}, expected workgroup or subgroup")),
                },
                code @ op::GROUP_NON_UNIFORM_FIRST..=op::GROUP_NON_UNIFORM_LAST => {
                    if code == op::GROUP_NON_UNIFORM_BROADCAST && !constants.contains_key(&i[5]) {
                        demands.features.insert("SubgroupBroadcastDynamicId");
                    }
                    if widths.get(&i[1]).is_some_and(|&width| width != 32) {
                        demands.features.insert("ShaderSubgroupExtendedTypes");
                    }
                }
                _ => {}
            }
        }
        if demands.subgroup_operations != 0 {
            demands.features.extend(["SubgroupSizeControl", "ComputeFullSubgroups"]);
        }
        Ok(demands)
    }
}

/// What takes one item of a kernel's work, a variant of `gpu::Unit`: it calls the function of glsl/shared/common.glsl that numbers
/// these, and neither of the other two.
pub fn unit(module: &[u32]) -> Result<&'static str, String> {
    const UNITS: [(&str, &str); 3] =
        [("thread_index(", "Thread"), ("subgroup_index(", "Subgroup"), ("group_index(", "Workgroup")];
    let (mut numbers, mut function, mut called) = (BTreeMap::new(), 0, BTreeSet::<&str>::new());
    for i in instructions(module)? {
        match opcode(i) {
            op::NAME => {
                let bytes: Vec<u8> = i[2..].iter().flat_map(|word| word.to_le_bytes()).collect();
                let name = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
                numbers.extend(UNITS.iter().find(|unit| unit.0.as_bytes() == name).map(|unit| (i[1], unit.1)));
            }
            op::FUNCTION => function = i[2],
            // They call one another.
            op::FUNCTION_CALL if !numbers.contains_key(&function) => called.extend(numbers.get(&i[3]).copied()),
            _ => {}
        }
    }
    match called.iter().copied().collect::<Vec<_>>()[..] {
        [unit] => Ok(unit),
        _ => Err(format!(
            "{called:?} take its items, expected one: call either thread_index(), subgroup_index() or group_index()"
        )),
    }
}

/// What all kernels together need of a device that any of them would run on.
fn needs(kernels: &[Kernel]) -> String {
    let operations = kernels.iter().fold(0, |all, k| all | k.demands.subgroup_operations);
    let most = |of: fn(&Interface) -> usize| kernels.iter().map(|k| of(&k.interface)).max().unwrap_or(0);
    format!(
        "/// Bits of VkSubgroupFeatureFlagBits.\npub const SUBGROUP_OPERATIONS: u32 = {operations};\n\
         /// Storage buffers of the kernel that binds most.\npub const STORAGE_BUFFERS: u32 = {};\n\
         /// Bytes of push constants of the kernel that has most.\npub const PUSH_BYTES: u32 = {};\n",
        most(|i| i.bindings.len()),
        most(Interface::push_bytes),
    )
}

/// Every module of kernels.rs but the constants.
fn generate(kernels: &[Kernel], types: &Types) -> String {
    let structs: String = types.values().map(|t| t.code.as_str()).collect();
    let all: String = kernels.iter().map(|k| format!("    KernelInfo::of::<{}::Kernel>(),\n", k.name)).collect();
    let names: Vec<_> = kernels.iter().map(|k| &k.name).collect();
    format!(
        "/// Structs that kernels share with the host, in scalar block layout.\npub mod types {{\n{structs}}}\n\
         use crate::gpu::KernelInfo;\n/// Every kernel, by name.\npub const ALL: [KernelInfo; {}] = [\n{all}];\n\
         /// The names of all stages.\npub const NAMES: &[&str] = &{names:?};\n",
        kernels.len(),
    ) + &kernels.iter().map(Kernel::generate).collect::<String>()
}

/// Every `const uint|float NAME = number;` of glsl/shared/, a module for each file, so that the host writes none of them again.
fn constants() -> String {
    let mut files: Vec<_> = fs::read_dir("glsl/shared").unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let mut code = String::from("/// Plain constants of `glsl/shared/`, by file.\npub mod constants {\n");
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let list: Vec<_> = text.lines().filter_map(constant).collect();
        if !list.is_empty() {
            let module = path.file_stem().unwrap().to_str().unwrap();
            writeln!(code, "pub mod {module} {{\n{}\n}}", list.join("\n")).unwrap();
        }
    }
    code + "}\n"
}

fn constant(line: &str) -> Option<String> {
    let (declaration, comment) = line.split_once(';')?;
    let (left, value) = declaration.strip_prefix("const ")?.split_once(" = ")?;
    let (ty, name) = left.split_once(' ')?;
    let value = value.trim_end_matches('u');
    let ty = match ty {
        "uint" => "u32",
        "float" => "f32",
        _ => return None,
    };
    let plain = value.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit())
        && value.chars().all(|c| c.is_ascii_hexdigit() || ".ex-+".contains(c));
    let doc = comment.trim().trim_start_matches('/').trim();
    plain.then(|| format!("#[doc = {doc:?}] pub const {name}: {ty} = {value};"))
}

fn collect(dir: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, into);
        } else if path.extension().is_some_and(|e| e == "comp") {
            into.push(path);
        }
    }
}

/// Structs by name.
pub type Types = BTreeMap<String, Struct>;

/// A struct that kernels share with the host.
#[derive(Debug, PartialEq, Eq)]
pub struct Struct {
    pub code: String,
    layout: Layout,
}

/// Bytes of a type, what they are a multiple of, and which of its words are floats: bit k for word k.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    size: usize,
    align: usize,
    floats: u32,
}

impl Layout {
    /// That of `count` of them in a row.
    fn times(self, count: usize) -> Self {
        let floats = (0..count).fold(0, |bits, i| bits | self.floats << (i * self.size / 4));
        Layout { size: self.size * count, floats, ..self }
    }
}

/// A member of a block or struct.
#[derive(Debug)]
pub struct Field {
    pub name: String,
    pub ty: String,
    layout: Layout,
}

/// What the host must give to a kernel.
#[derive(Debug)]
pub struct Interface {
    /// Per binding: field name, element type in Rust, access, and which words of an element are floats.
    pub bindings: Vec<(String, String, AccessType, u32)>,
    /// Members of the push constants, in order.
    pub push: Vec<Field>,
    /// Id, name and type of each specialisation constant.
    pub spec: Vec<(u32, String, &'static str)>,
}

impl Interface {
    pub fn reflect(words: &[u32], types: &mut Types) -> Result<Self, String> {
        let module = without_expressions(words)?;
        let entries = ReflectConfig::new().spv(module).ref_all_rscs(true).reflect();
        let entry = entries.map_err(|e| format!("reflection failed: {e}"))?.pop().ok_or("no entry point")?;
        let mut bindings = BTreeMap::new();
        let mut push = Vec::new();
        let mut spec = BTreeMap::from([(0, ("workgroup_size".to_owned(), "u32"))]);
        for var in entry.vars {
            match var {
                Variable::Descriptor { desc_bind, desc_ty: DescriptorType::StorageBuffer(access), ty, .. } => {
                    if desc_bind.set() != 0 {
                        return Err(format!("a buffer is in set {}, expected 0", desc_bind.set()));
                    }
                    let (name, element, floats) = block_element(&ty, types)?;
                    if bindings.insert(desc_bind.bind(), (name, element, access, floats)).is_some() {
                        return Err(format!("binding {} is used twice", desc_bind.bind()));
                    }
                }
                Variable::PushConstant { ty: Type::Struct(block), .. } => push = members(&block, types)?,
                Variable::SpecConstant { name, spec_id, ty } if spec_id != 0 => {
                    let name = name.ok_or_else(|| format!("specialisation constant {spec_id} has no name"))?;
                    let ty = match &ty {
                        Type::Scalar(ScalarType::Boolean) => "bool",
                        Type::Scalar(s) => match scalar(s)? {
                            (ty @ ("f32" | "u32" | "i32"), _) => ty,
                            (ty, _) => return Err(format!("specialisation constant {name} is {ty}, expected 32 bits")),
                        },
                        other => return Err(format!("specialisation constant {name} is {other:?}")),
                    };
                    spec.insert(spec_id, (name.to_lowercase(), ty));
                }
                Variable::Input { .. } | Variable::SpecConstant { .. } => {}
                other => return Err(format!("{other:?} is not a storage buffer, push or specialisation constant")),
            }
        }
        if !bindings.keys().copied().eq(0..bindings.len() as u32) {
            let list: Vec<u32> = bindings.into_keys().collect();
            return Err(format!("bindings are {list:?}, expected 0, 1, 2, …"));
        }
        let interface = Interface {
            bindings: bindings.into_values().collect(),
            push,
            spec: spec.into_iter().map(|(id, (name, ty))| (id, name, ty)).collect(),
        };
        // vkCmdPushConstants takes words.
        match interface.push_bytes() {
            bytes if bytes.is_multiple_of(4) => Ok(interface),
            bytes => Err(format!("push constants of {bytes} bytes, expected a multiple of 4")),
        }
    }

    pub fn push_bytes(&self) -> usize {
        self.push.iter().map(|f| f.layout.size).sum()
    }
}

impl Kernel {
    /// The kernel's entry in the list that `src/stages/kernel.rs` expands.
    fn generate(&self) -> String {
        let Kernel { name, file, interface: Interface { bindings, push, spec }, demands, unit, .. } = self;
        let software = if self.software.is_some() { format!("{name}.software") } else { name.clone() };
        let push: String = push.iter().map(|field| format!("{}: {}, ", field.name, field.ty)).collect();
        let spec: String = spec.iter().map(|(id, name, ty)| format!("{id} {name}: {ty}, ")).collect();
        let buffers =
            bindings.iter().map(|(name, ty, a, floats)| format!("        {} {name}: {ty} = {floats:#b},\n", access(a)));
        format!(
            "kernel! {{\n    /// `{file}`\n    {name}, {unit}, subgroups {}, barriers {}, features [{}],\n    spirv \"{name}.spv\" \
             \"{software}.spv\",\n    push {{ {push}}}\n    spec {{ {spec}}}\n    buffers {{\n{}    }}\n}}\n",
            demands.subgroup_operations != 0,
            demands.barriers,
            demands.features.iter().copied().collect::<Vec<_>>().join(", "),
            buffers.collect::<String>()
        )
    }
}

fn access(access: &AccessType) -> &'static str {
    match access {
        AccessType::ReadOnly => "Read",
        AccessType::WriteOnly => "Write",
        AccessType::ReadWrite => "ReadWrite",
    }
}

fn fields<'a>(list: impl Iterator<Item = (&'a String, &'a str)>) -> String {
    list.fold(String::new(), |s, (n, t)| s + &format!("    pub {n}: {t},\n"))
}

/// Expressions of specialisation constants (`!A`, `gl_WorkGroupSize.x / 8`) are more than spirq 1.3 can evaluate, and the
/// interface does not depend on them: for the reflection (only) they become the constants `false` or 1.
fn without_expressions(words: &[u32]) -> Result<Vec<u32>, String> {
    let list = instructions(words)?;
    let header = words.len() - list.iter().map(|i| i.len()).sum::<usize>();
    let mut out = words[..header].to_vec();
    let mut scalar_types = BTreeMap::new();
    for i in list {
        if [op::TYPE_BOOL, op::TYPE_INT, op::TYPE_FLOAT].contains(&opcode(i)) {
            scalar_types.insert(i[1], opcode(i));
        }
        match scalar_types.get(i.get(1).unwrap_or(&0)) {
            Some(&op::TYPE_BOOL) if opcode(i) == op::SPEC_CONSTANT_OP => {
                out.extend([3 << 16 | op::CONSTANT_FALSE, i[1], i[2]]);
            }
            Some(_) if opcode(i) == op::SPEC_CONSTANT_OP => out.extend([4 << 16 | op::CONSTANT, i[1], i[2], 1]),
            _ => out.extend_from_slice(i),
        }
    }
    Ok(out)
}

/// Field name and element type of a storage block, and which words of an element are floats: the array's element, or the block itself if
/// it has no array.
fn block_element(ty: &Type, types: &mut Types) -> Result<(String, String, u32), String> {
    let Type::Struct(block) = ty else { return Err("a buffer is not a block".into()) };
    let block_name = block.name.clone().ok_or("a block has no name")?;
    let field = snake(&block_name);
    if let [member] = block.members.as_slice()
        && let Type::Array(array) = &member.ty
        && array.nelement.is_none()
    {
        let (element, layout) = rust_type(&array.element_ty, types)?;
        if array.stride != Some(layout.size) {
            return Err(format!("{block_name} has padding between elements of {element}"));
        }
        return Ok((field, element, layout.floats));
    }
    let (element, layout) = rust_type(ty, types)?;
    Ok((field, element, layout.floats))
}

/// Rust type and layout; a struct is generated on first sight and must be the same at every later one.
fn rust_type(ty: &Type, types: &mut Types) -> Result<(String, Layout), String> {
    match ty {
        Type::Scalar(s) => scalar(s).map(|(name, layout)| (name.to_owned(), layout)),
        Type::Vector(v) => {
            let (name, layout) = scalar(&v.scalar_ty)?;
            Ok((format!("[{name}; {}]", v.nscalar), layout.times(v.nscalar as usize)))
        }
        Type::Array(a) => {
            let (element, layout) = rust_type(&a.element_ty, types)?;
            let n = a.nelement.ok_or("an unsized array inside a struct")? as usize;
            if a.stride != Some(layout.size) {
                return Err(format!("an array has padding between elements of {element}"));
            }
            Ok((format!("[{element}; {n}]"), layout.times(n)))
        }
        Type::Struct(st) => {
            let name = st.name.clone().ok_or("a struct has no name")?;
            let list = members(st, types)?;
            let mut layout = Layout { size: 0, align: 1, floats: 0 };
            for field in list.iter().map(|f| f.layout) {
                layout.floats |= field.floats << (layout.size / 4);
                layout = Layout { size: layout.size + field.size, align: layout.align.max(field.align), ..layout };
            }
            if !layout.size.is_multiple_of(layout.align) {
                return Err(format!("struct {name} of {} bytes ends in padding to {}", layout.size, layout.align));
            }
            let code = format!(
                "#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]\n\
                 pub struct {name} {{\n{}}}\n",
                fields(list.iter().map(|f| (&f.name, f.ty.as_str())))
            );
            let new = Struct { code, layout };
            match types.get(&name) {
                Some(known) if *known != new => Err(format!("struct {name} differs from another kernel's")),
                _ => {
                    types.insert(name.clone(), new);
                    Ok((name, layout))
                }
            }
        }
        other => Err(format!("{other:?} has no counterpart on the host")),
    }
}

fn members(st: &StructType, types: &mut Types) -> Result<Vec<Field>, String> {
    let mut at = 0;
    let field = |m: &spirq::ty::StructMember| {
        let name = m.name.clone().ok_or("a member has no name")?;
        let (ty, layout) = rust_type(&m.ty, types)?;
        if m.offset != Some(at) {
            let offset = m.offset.map_or("nowhere".to_owned(), |o| o.to_string());
            return Err(format!(
                "{name} lies at {offset}, expected {at}: order or pad the members, with layout(scalar)"
            ));
        }
        at += layout.size;
        Ok(Field { name, ty, layout })
    };
    st.members.iter().map(field).collect()
}

/// Name in Rust, and layout.
fn scalar(ty: &ScalarType) -> Result<(&'static str, Layout), String> {
    let (name, size) = match ty {
        ScalarType::Float { bits: 32 } => ("f32", 4),
        ScalarType::Float { bits: 16 } => ("crate::gpu::f16", 2),
        ScalarType::Integer { bits: 32, is_signed: false } => ("u32", 4),
        ScalarType::Integer { bits: 32, is_signed: true } => ("i32", 4),
        ScalarType::Integer { bits: 16, is_signed: false } => ("u16", 2),
        ScalarType::Integer { bits: 16, is_signed: true } => ("i16", 2),
        ScalarType::Integer { bits: 8, is_signed: false } => ("u8", 1),
        ScalarType::Integer { bits: 8, is_signed: true } => ("i8", 1),
        other => return Err(format!("{other:?} is not a scalar of 8, 16 or 32 bits")),
    };
    Ok((name, Layout { size, align: size, floats: u32::from(name == "f32") }))
}

fn snake(name: &str) -> String {
    let mut s = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !s.is_empty() {
            s.push('_');
        }
        s.extend(c.to_lowercase());
    }
    s
}
