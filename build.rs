//! Compiles every `glsl/**/*.comp` to SPIR-V, reflects it and generates the typed interface of each kernel:
//! `Push`, `Spec`, `Buffers` and the structs of its blocks. A kernel whose interface changes no longer fits the
//! Rust code that records it, and that is a compile error.

use std::{
    collections::BTreeMap,
    env,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use spirq::{
    ReflectConfig,
    ty::{AccessType, DescriptorType, ScalarType, StructType, Type},
    var::Variable,
};

fn main() {
    let out = PathBuf::from(env::var("OUT_DIR").unwrap());
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=glsl");

    let mut sources = Vec::new();
    collect(Path::new("glsl"), &mut sources);
    sources.sort();

    let compiler = shaderc::Compiler::new().expect("shaderc");
    let mut options = shaderc::CompileOptions::new().expect("shaderc options");
    // 1.2 keeps LocalSizeId (and so maintenance4) out of what an embedding application must enable.
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    // Drivers optimise; unoptimised SPIR-V keeps the names that reflection, RenderDoc and Nsight read.
    options.set_optimization_level(shaderc::OptimizationLevel::Zero);
    options.set_warnings_as_errors();
    options.set_include_callback(|name, kind, from, _| {
        let base = match kind {
            shaderc::IncludeType::Relative => Path::new(from).parent().unwrap().to_owned(),
            shaderc::IncludeType::Standard => PathBuf::from("glsl"),
        };
        let path = base.join(name);
        let content = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.to_string_lossy().into_owned(), content })
    });

    let mut types = BTreeMap::new();
    let mut kernels = String::new();
    let mut failed = false;
    for path in &sources {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let source = fs::read_to_string(path).unwrap();
        let file = path.to_str().unwrap();
        let spirv =
            match compiler.compile_into_spirv(&source, shaderc::ShaderKind::Compute, file, "main", Some(&options)) {
                Ok(spirv) => spirv,
                Err(e) => {
                    // Cargo shows lines that begin with cargo:warning even when the output is folded away.
                    for line in e.to_string().lines() {
                        println!("cargo:warning={line}");
                    }
                    failed = true;
                    continue;
                }
            };
        fs::write(out.join(format!("{name}.spv")), spirv.as_binary_u8()).unwrap();
        kernels += &Interface::reflect(&name, spirv.as_binary(), &mut types).generate(&name, file);
    }
    assert!(!failed, "GLSL did not compile, see the warnings above");

    let types: String = types.values().map(|t: &(String, StructType)| t.0.as_str()).collect();
    let code = format!(
        "/// Structs that kernels share with the host, in scalar block layout.\npub mod types {{\n{types}}}\n{kernels}"
    );
    fs::write(out.join("kernels.rs"), code + &constants()).unwrap();
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
    let plain = value.starts_with(|c: char| c.is_ascii_digit())
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

type Types = BTreeMap<String, (String, StructType)>;

struct Interface {
    /// Per binding: field name, element type in Rust, access.
    bindings: Vec<(String, String, AccessType)>,
    /// Name and type of each push constant member, in order.
    push: Vec<(String, String)>,
    /// Id, name and type of each specialisation constant.
    spec: Vec<(u32, String, &'static str)>,
}

impl Interface {
    fn reflect(kernel: &str, words: &[u32], types: &mut Types) -> Self {
        let entry = ReflectConfig::new()
            .spv(without_expressions(words))
            .ref_all_rscs(true)
            .reflect()
            .unwrap_or_else(|e| panic!("{kernel}: reflection failed: {e}"))
            .pop()
            .unwrap_or_else(|| panic!("{kernel}: no entry point"));
        let mut bindings = BTreeMap::new();
        let mut push = Vec::new();
        let mut spec = BTreeMap::from([(0, ("workgroup_size".to_owned(), "u32"))]);
        for var in entry.vars {
            match var {
                Variable::Descriptor { desc_bind, desc_ty: DescriptorType::StorageBuffer(access), ty, .. } => {
                    assert!(desc_bind.set() == 0, "{kernel}: every buffer is in set 0");
                    let (name, element) = block_element(kernel, &ty, types);
                    let old = bindings.insert(desc_bind.bind(), (name, element, access));
                    assert!(old.is_none(), "{kernel}: binding {} is used twice", desc_bind.bind());
                }
                Variable::PushConstant { ty: Type::Struct(block), .. } => push = members(kernel, &block, types),
                Variable::SpecConstant { name, spec_id, ty } if spec_id != 0 => {
                    let name =
                        name.unwrap_or_else(|| panic!("{kernel}: specialisation constant {spec_id} has no name"));
                    let ty = match ty {
                        Type::Scalar(ScalarType::Boolean) => "bool",
                        Type::Scalar(ScalarType::Float { .. }) => "f32",
                        _ => "u32",
                    };
                    spec.insert(spec_id, (name.to_lowercase(), ty));
                }
                Variable::Input { .. } | Variable::SpecConstant { .. } => {}
                other => panic!("{kernel}: {other:?} is not a storage buffer, push or specialisation constant"),
            }
        }
        assert!(bindings.keys().copied().eq(0..bindings.len() as u32), "{kernel}: bindings must be 0, 1, 2, …");
        Interface {
            bindings: bindings.into_values().collect(),
            push,
            spec: spec.into_iter().map(|(id, (name, ty))| (id, name, ty)).collect(),
        }
    }

    fn generate(&self, name: &str, file: &str) -> String {
        let Interface { bindings, push, spec } = self;
        let mut s = String::new();
        let fields = |list: &[(String, String)]| {
            list.iter().fold(String::new(), |s, (n, t)| s + &format!("    pub {n}: {t},\n"))
        };
        writeln!(s, "/// `{file}`\npub mod {name} {{").unwrap();
        writeln!(s, "#[allow(unused_imports)] use super::types::*;").unwrap();
        writeln!(s, "#[repr(C)] #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]").unwrap();
        writeln!(s, "pub struct Push {{\n{}}}", fields(push)).unwrap();
        let spec_fields: Vec<_> = spec.iter().map(|(_, n, t)| (n.clone(), (*t).to_owned())).collect();
        writeln!(s, "#[derive(Clone, Copy, Debug)]\npub struct Spec {{\n{}}}", fields(&spec_fields)).unwrap();
        writeln!(s, "#[derive(Clone, Copy)]\npub struct Buffers<'a> {{").unwrap();
        for (n, t, a) in bindings {
            writeln!(s, "    /// {a:?}\n    pub {n}: &'a crate::gpu::Buffer<{t}>,").unwrap();
        }
        writeln!(s, "}}\npub struct Kernel;\npub type Stage = crate::gpu::Pipeline<Kernel>;").unwrap();
        writeln!(s, "impl crate::gpu::Kernel for Kernel {{").unwrap();
        writeln!(s, "    const NAME: &'static str = {name:?};").unwrap();
        writeln!(s, "    const SPIRV: &'static [u8] = include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\"));")
            .unwrap();
        let access: Vec<_> = bindings
            .iter()
            .map(|(_, _, a)| match a {
                AccessType::ReadOnly => "crate::gpu::Access::Read",
                AccessType::WriteOnly => "crate::gpu::Access::Write",
                AccessType::ReadWrite => "crate::gpu::Access::ReadWrite",
            })
            .collect();
        writeln!(s, "    const ACCESS: &'static [crate::gpu::Access] = &[{}];", access.join(", ")).unwrap();
        writeln!(s, "    type Push = Push; type Spec = Spec; type Buffers<'a> = Buffers<'a>;").unwrap();
        let words: Vec<_> = spec
            .iter()
            .map(|(id, n, t)| match *t {
                "f32" => format!("({id}, spec.{n}.to_bits())"),
                _ => format!("({id}, spec.{n} as u32)"),
            })
            .collect();
        writeln!(s, "    fn spec_words(spec: &Spec) -> Vec<(u32, u32)> {{ vec![{}] }}", words.join(", ")).unwrap();
        let raw: Vec<_> = bindings.iter().map(|(n, ..)| format!("b.{n}.raw()")).collect();
        writeln!(s, "    fn raw_buffers<'a>(b: &Self::Buffers<'a>) -> Vec<&'a std::sync::Arc<crate::gpu::RawBuffer>> {{ vec![{}] }}", raw.join(", "))
            .unwrap();
        writeln!(s, "}}\n}}").unwrap();
        s
    }
}

/// Expressions of specialisation constants (`!A`, `gl_WorkGroupSize.x / 8`) are more than spirq 1.3 can evaluate, and the
/// interface does not depend on them: for the reflection (only) they become the constants `false` or 1.
fn without_expressions(words: &[u32]) -> Vec<u32> {
    const HEADER: usize = 5;
    const TYPE_BOOL: u32 = 20;
    const TYPE_INT: u32 = 21;
    const TYPE_FLOAT: u32 = 22;
    const CONSTANT_FALSE: u32 = 42;
    const CONSTANT: u32 = 43;
    const SPEC_CONSTANT_OP: u32 = 52;
    let mut out = words[..HEADER].to_vec();
    let mut scalar_types = BTreeMap::new();
    let mut at = HEADER;
    while at < words.len() {
        let (length, opcode) = ((words[at] >> 16) as usize, words[at] & 0xFFFF);
        let instruction = &words[at..at + length];
        if [TYPE_BOOL, TYPE_INT, TYPE_FLOAT].contains(&opcode) {
            scalar_types.insert(instruction[1], opcode);
        }
        match scalar_types.get(instruction.get(1).unwrap_or(&0)) {
            Some(&TYPE_BOOL) if opcode == SPEC_CONSTANT_OP => {
                out.extend([3 << 16 | CONSTANT_FALSE, instruction[1], instruction[2]]);
            }
            Some(_) if opcode == SPEC_CONSTANT_OP => {
                out.extend([4 << 16 | CONSTANT, instruction[1], instruction[2], 1]);
            }
            _ => out.extend_from_slice(instruction),
        }
        at += length;
    }
    out
}

/// Field name and element type of a storage block: the array's element, or the block itself if it has no array.
fn block_element(kernel: &str, ty: &Type, types: &mut Types) -> (String, String) {
    let Type::Struct(block) = ty else { panic!("{kernel}: a buffer is not a block") };
    let block_name = block.name.clone().unwrap_or_else(|| panic!("{kernel}: a block has no name"));
    let field = snake(&block_name);
    match block.members.as_slice() {
        [member] if matches!(&member.ty, Type::Array(a) if a.nelement.is_none()) => {
            let Type::Array(array) = &member.ty else { unreachable!() };
            let (element, size) = rust_type(kernel, &array.element_ty, types);
            assert_eq!(array.stride, Some(size), "{kernel}: {block_name} has padding between elements");
            (field, element)
        }
        _ => (field, rust_type(kernel, ty, types).0),
    }
}

/// Rust type and its size in bytes; a struct is generated on first sight and must be the same at every later one.
fn rust_type(kernel: &str, ty: &Type, types: &mut Types) -> (String, usize) {
    match ty {
        Type::Scalar(s) => (scalar(kernel, s).to_owned(), 4),
        Type::Vector(v) => (format!("[{}; {}]", scalar(kernel, &v.scalar_ty), v.nscalar), 4 * v.nscalar as usize),
        Type::Array(a) => {
            let (element, size) = rust_type(kernel, &a.element_ty, types);
            let n = a.nelement.unwrap_or_else(|| panic!("{kernel}: unsized array inside a struct")) as usize;
            assert_eq!(a.stride, Some(size), "{kernel}: an array has padding between elements");
            (format!("[{element}; {n}]"), size * n)
        }
        Type::Struct(st) => {
            let name = st.name.clone().unwrap_or_else(|| panic!("{kernel}: a struct has no name"));
            let list = members(kernel, st, types);
            let size = list.iter().map(|(_, t)| size_of_rust(t, types)).sum();
            if let Some((_, known)) = types.get(&name) {
                let same = known.members.len() == st.members.len()
                    && known.members.iter().zip(&st.members).all(|(a, b)| a.name == b.name && a.offset == b.offset);
                assert!(same, "{kernel}: struct {name} differs from another kernel's");
            } else {
                let fields = list.iter().fold(String::new(), |s, (n, t)| s + &format!("    pub {n}: {t},\n"));
                let code = format!(
                    "#[repr(C)] #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]\n\
                     pub struct {name} {{\n{fields}}}\n"
                );
                types.insert(name.clone(), (code, st.clone()));
            }
            (name, size)
        }
        other => panic!("{kernel}: {other:?} has no counterpart on the host"),
    }
}

fn members(kernel: &str, st: &StructType, types: &mut Types) -> Vec<(String, String)> {
    let mut at = 0;
    st.members
        .iter()
        .map(|m| {
            let name = m.name.clone().unwrap_or_else(|| panic!("{kernel}: a member has no name"));
            let (ty, size) = rust_type(kernel, &m.ty, types);
            assert_eq!(m.offset, Some(at), "{kernel}: {name} is padded; declare the block with layout(scalar)");
            at += size;
            (name, ty)
        })
        .collect()
}

fn size_of_rust(ty: &str, types: &Types) -> usize {
    if let Some(inner) = ty.strip_prefix('[').and_then(|t| t.strip_suffix(']')) {
        let (element, n) = inner.rsplit_once("; ").unwrap();
        return size_of_rust(element, types) * n.parse::<usize>().unwrap();
    }
    match types.get(ty) {
        Some((_, st)) => st.members.iter().map(|m| m.ty.nbyte().unwrap()).sum(),
        None => 4,
    }
}

fn scalar(kernel: &str, ty: &ScalarType) -> &'static str {
    match ty {
        ScalarType::Float { bits: 32 } => "f32",
        ScalarType::Integer { bits: 32, is_signed: false } => "u32",
        ScalarType::Integer { bits: 32, is_signed: true } => "i32",
        other => panic!("{kernel}: {other:?} is not a 32-bit scalar"),
    }
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
