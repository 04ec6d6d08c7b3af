//! Tests glsl/generate.rs: the code generated from kernels, and rejected kernels.

#[allow(dead_code, reason = "each test uses its part")]
#[path = "../glsl/generate.rs"]
mod generate;

use std::{collections::BTreeSet, env, fs, path::Path};

use generate::{Demands, Interface, Types, compile, unit};

/// A kernel with these declarations; `body` uses them.
fn kernel(declarations: &str, body: &str) -> Vec<u32> {
    compile(&source(declarations, body), "snippet.comp", false).unwrap()
}

fn source(declarations: &str, body: &str) -> String {
    let extensions = [
        "EXT_scalar_block_layout",
        "EXT_shader_8bit_storage",
        "EXT_shader_16bit_storage",
        "EXT_shader_explicit_arithmetic_types",
        "EXT_shader_atomic_float",
        "KHR_shader_subgroup_basic",
        "KHR_shader_subgroup_vote",
        "KHR_shader_subgroup_ballot",
        "KHR_shader_subgroup_arithmetic",
        "EXT_shader_subgroup_extended_types_float16",
    ];
    let extensions: String = extensions.iter().map(|e| format!("#extension GL_{e} : require\n")).collect();
    format!(
        "#version 460\n{extensions}layout(local_size_x_id = 0) in;\n{declarations}\nvoid main() {{ uint i = \
         gl_GlobalInvocationID.x;\n{body}\n}}\n"
    )
}

/// Element types of the buffers, and the structs among these.
fn bindings(declarations: &str, body: &str) -> Result<(Vec<String>, Types), String> {
    let mut types = Types::new();
    let interface = Interface::reflect(&kernel(declarations, body), &mut types)?;
    Ok((interface.bindings.into_iter().map(|(name, ty, ..)| format!("{name}: {ty}")).collect(), types))
}

fn refused(declarations: &str, body: &str) -> String {
    bindings(declarations, body).err().unwrap()
}

fn demands(declarations: &str, body: &str) -> Demands {
    Demands::of(&kernel(declarations, body)).unwrap()
}

fn buffer(binding: u32, name: &str, ty: &str) -> String {
    let field = name.to_lowercase();
    format!("layout(set = 0, binding = {binding}, scalar) buffer {name} {{ {ty} {field}[]; }};\n")
}

#[test]
fn scalars_of_8_16_and_32_bits_have_their_types_alone_in_vectors_and_in_arrays() {
    let scalars = [
        ("uint8_t", "u8vec3", "u8"),
        ("int8_t", "i8vec2", "i8"),
        ("uint16_t", "u16vec3", "u16"),
        ("int16_t", "i16vec2", "i16"),
        ("float16_t", "f16vec3", "crate::gpu::f16"),
        ("uint", "uvec3", "u32"),
        ("int", "ivec2", "i32"),
        ("float", "vec3", "f32"),
    ];
    for (scalar, vector, rust) in scalars {
        let n = if vector.ends_with('3') { 3 } else { 2 };
        let all = buffer(0, "Alone", scalar)
            + &buffer(1, "Vectors", vector)
            + &format!("struct Pair {{ {scalar} one[2]; {vector} other; {scalar} last; }};\n")
            + &buffer(2, "Pairs", "Pair");
        let body = format!("alone[i] = {scalar}(1); vectors[i] = {vector}(1); pairs[i].last = {scalar}(1);");
        let Ok((list, types)) = bindings(&all, &body) else {
            // Six elements of 1 byte, or of 2: any number is valid. A struct of 6 bytes needs no padding at
            // its end either.
            panic!("{scalar}: {:?}", bindings(&all, &body).err());
        };
        assert_eq!(list, [format!("alone: {rust}"), format!("vectors: [{rust}; {n}]"), "pairs: Pair".to_owned()]);
        let code = &types["Pair"].code;
        let fields =
            [format!("pub one: [{rust}; 2],"), format!("pub other: [{rust}; {n}],"), format!("pub last: {rust},")];
        assert!(fields.iter().all(|f| code.contains(f)) && code.contains("bytemuck::Pod"), "{code}");
    }
    let wide = buffer(0, "Wide", "double");
    assert_eq!(refused(&wide, "wide[i] = 1.0lf;"), "Float { bits: 64 } is not a scalar of 8, 16 or 32 bits");
}

#[test]
fn padding_of_any_kind_is_refused() {
    let inside = "struct S { uint8_t a; float b; };\n".to_owned() + &buffer(0, "Things", "S");
    assert!(refused(&inside, "things[i].b = 1.0;").starts_with("b lies at 4, expected 1"));
    let behind = "struct S { float a; uint8_t b; };\n".to_owned() + &buffer(0, "Things", "S");
    assert_eq!(refused(&behind, "things[i].a = 1.0;"), "struct S of 5 bytes ends in padding to 4");
    // Valid with explicit padding.
    let filled = "struct S { float a; uint8_t b; uint8_t c; uint16_t d; };\n".to_owned() + &buffer(0, "Things", "S");
    assert_eq!(bindings(&filled, "things[i].a = 1.0;").unwrap().0, ["things: S"]);
    let std430 = "struct S { float a; vec3 b; };\nlayout(set = 0, binding = 0, std430) buffer Things { S things[]; };";
    assert!(refused(std430, "things[i].a = 1.0;").starts_with("b lies at 16, expected 4"));
    let array = "layout(set = 0, binding = 0, std430) buffer Things { vec3 things[]; };";
    assert_eq!(refused(array, "things[i] = vec3(1.0);"), "Things has padding between elements of [f32; 3]");
    let push = "layout(push_constant, scalar) uniform Push { float rate; uint8_t mode; } push;\n".to_owned();
    let said = refused(&(push + &buffer(0, "Things", "float")), "things[i] = push.rate;");
    assert_eq!(said, "push constants of 5 bytes, expected a multiple of 4");
}

#[test]
fn bindings_are_counted_from_0_without_gaps_and_each_once() {
    let two = |a, b| buffer(a, "First", "float") + &buffer(b, "Second", "float");
    let body = "first[i] = second[i];";
    assert_eq!(bindings(&two(1, 0), body).unwrap().0, ["second: f32", "first: f32"]);
    assert_eq!(refused(&two(0, 0), body), "binding 0 is used twice");
    assert_eq!(refused(&two(0, 2), body), "bindings are [0, 2], expected 0, 1, 2, …");
    let elsewhere = "layout(set = 1, binding = 0, scalar) buffer First { float first[]; };";
    assert_eq!(refused(elsewhere, "first[i] = 1.0;"), "a buffer is in set 1, expected 0");
    let uniform = "layout(set = 0, binding = 0, scalar) uniform First { float first; };\n".to_owned();
    let said = refused(&(uniform + &buffer(1, "Second", "float")), "second[i] = first;");
    assert!(said.ends_with("is not a storage buffer, push or specialisation constant"), "{said}");
}

#[test]
fn access_is_as_declared_and_what_is_not_declared_does_not_compile() {
    let all = "layout(set = 0, binding = 0, scalar) readonly buffer Read { float read[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Written { float written[]; };
layout(set = 0, binding = 2, scalar) buffer Both { float both[]; };";
    let module = kernel(all, "written[i] = read[i]; both[i] += 1.0;");
    let access: Vec<String> = Interface::reflect(&module, &mut Types::new())
        .unwrap()
        .bindings
        .into_iter()
        .map(|(name, _, access, _)| format!("{name} {access:?}"))
        .collect();
    assert_eq!(access, ["read ReadOnly", "written WriteOnly", "both ReadWrite"]);
    for body in ["read[i] = 1.0;", "both[i] = written[i];"] {
        assert!(compile(&source(all, body), "snippet.comp", false).is_err(), "{body}");
    }
}

#[test]
fn structs_of_one_name_are_one_struct() {
    let first = |fields| format!("struct S {{ {fields} }};\n") + &buffer(0, "Things", "S");
    let mut types = Types::new();
    let mut add = |fields| Interface::reflect(&kernel(&first(fields), "things[i].a = things[i + 1].a;"), &mut types);
    assert!(add("float a; uint b;").is_ok() && add("float a; uint b;").is_ok());
    // Another type at the same offset, another name, an extra member.
    for other in ["float a; float b;", "float a; uint c;", "float a; uint b; uint c;"] {
        assert_eq!(add(other).unwrap_err(), "struct S differs from another kernel's");
    }
}

#[test]
fn specialisation_and_push_constants_are_named_and_typed() {
    let all = "layout(constant_id = 3) const float RATE = 0.5;
layout(constant_id = 1) const bool FAST = false;
layout(constant_id = 2) const int SHIFT = -1;
layout(push_constant, scalar) uniform Push { uint first; vec3 eye; uint8_t modes[4]; } push;\n"
        .to_owned()
        + &buffer(0, "Things", "float");
    let body = "things[i] = FAST ? RATE * push.eye.x : float(push.first + SHIFT);";
    let interface = Interface::reflect(&kernel(&all, body), &mut Types::new()).unwrap();
    let spec: Vec<String> = interface.spec.iter().map(|(id, name, ty)| format!("{id} {name}: {ty}")).collect();
    assert_eq!(spec, ["0 workgroup_size: u32", "1 fast: bool", "2 shift: i32", "3 rate: f32"]);
    let push: Vec<String> = interface.push.iter().map(|f| format!("{}: {}", f.name, f.ty)).collect();
    assert_eq!(
        (push.as_slice(), interface.push_bytes()),
        (&["first: u32", "eye: [f32; 3]", "modes: [u8; 4]"].map(String::from)[..], 20)
    );
}

#[test]
fn what_takes_an_item_is_found_by_the_function_that_numbers_it() {
    let functions = "uint group_index() { return gl_WorkGroupID.x; }\n\
        uint thread_index() { return group_index() * gl_WorkGroupSize.x + gl_LocalInvocationIndex; }\n\
        uint subgroup_index() { return group_index() * gl_NumSubgroups + gl_SubgroupID; }\n\
        uint deeper() { return subgroup_index(); }\n";
    let declarations = buffer(0, "Things", "uint") + functions;
    let of = |body: &str| unit(&kernel(&declarations, body));
    assert_eq!(of("things[i] = thread_index();"), Ok("Thread"));
    assert_eq!(of("things[i] = deeper();"), Ok("Subgroup"));
    assert_eq!(of("things[i] = group_index() + group_index();"), Ok("Workgroup"));
    assert!(of("things[i] = 1;").unwrap_err().starts_with("{} take its items"));
    assert!(of("things[i] = group_index() + deeper();").unwrap_err().starts_with("{\"Subgroup\", \"Workgroup\"}"));
}

#[test]
fn what_a_kernel_asks_of_a_device_is_found_in_its_spirv() {
    let things = buffer(0, "Things", "float");
    let of = |declarations: &str, body: &str| {
        let Demands { subgroup_operations, barriers, features } = demands(declarations, body);
        (subgroup_operations, barriers, features.into_iter().collect::<Vec<_>>())
    };
    assert_eq!(of(&things, "things[i] = 1.0;"), (0, false, vec![]));
    let (size, full) = ("SubgroupSizeControl", "ComputeFullSubgroups");
    assert_eq!(of(&things, "things[i] = gl_SubgroupSize;"), (1, false, vec![full, size]));
    assert_eq!(of(&things, "things[i] = subgroupAdd(1.0);"), (5, false, vec![full, size]));
    // A lane known when the kernel is compiled, and one that is not.
    assert_eq!(of(&things, "things[i] = subgroupBroadcast(1.0, 3);"), (9, false, vec![full, size]));
    let dynamic = "things[i] = subgroupBroadcast(1.0, uint(things[0]));";
    assert_eq!(of(&things, dynamic), (9, false, vec![full, "SubgroupBroadcastDynamicId", size]));
    let half = "things[i] = float(subgroupAdd(float16_t(1.0)));";
    assert_eq!(of(&things, half).2, [full, "ShaderFloat16", "ShaderSubgroupExtendedTypes", size]);
    // Barriers of the workgroup, not of the subgroup.
    assert_eq!(of(&things, "barrier(); things[i] = 1.0;"), (0, true, vec![]));
    assert_eq!(of(&things, "subgroupBarrier(); things[i] = 1.0;"), (1, false, vec![full, size]));
    assert_eq!(of(&things, "atomicAdd(things[i], 1.0);").2, ["ShaderBufferFloat32AtomicAdd"]);
    assert_eq!(of(&buffer(0, "Bytes", "uint8_t"), "bytes[i] = bytes[i + 1];").2, ["StorageBuffer8BitAccess"]);
    assert_eq!(of(&buffer(0, "Words", "float16_t"), "words[i] = words[i + 1];").2, ["StorageBuffer16BitAccess"]);
    // A feature that no device is asked for.
    let wide = kernel(&buffer(0, "Wide", "double"), "wide[i] = 1.0lf;");
    assert!(Demands::of(&wide).unwrap_err().starts_with("SPIR-V capability 10 is not known"));
    // Every name is a feature that devices can be asked for.
    let known: BTreeSet<String> = glint::gpu::Feature::ALL.iter().map(|f| format!("{f:?}")).collect();
    for name in [size, full, "SubgroupBroadcastDynamicId", "ShaderFloat16", "StorageBuffer8BitAccess"] {
        assert!(known.contains(name));
    }
}

/// The shaders of the external example renderer, which has no compiler. `tools/kernels` writes these too.
#[test]
fn the_shaders_of_the_example_are_what_the_compiler_makes_of_their_sources() {
    for (file, kind) in [("mesh.vert", shaderc::ShaderKind::Vertex), ("mesh.frag", shaderc::ShaderKind::Fragment)] {
        let path = Path::new("tests/outside/mesh").join(file);
        let source = fs::read_to_string(&path).unwrap();
        let compiler = shaderc::Compiler::new().unwrap();
        let mut options = shaderc::CompileOptions::new().unwrap();
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
        let made = compiler.compile_into_spirv(&source, kind, file, "main", Some(&options)).unwrap();
        let kept = path.with_extension(format!("{}.spv", path.extension().unwrap().to_str().unwrap()));
        if env::var_os("GLINT_WRITE_KERNELS").is_some() {
            fs::write(&kept, made.as_binary_u8()).unwrap();
        }
        assert!(fs::read(&kept).unwrap() == made.as_binary_u8(), "{}: run tools/kernels", kept.display());
    }
}

/// `tools/kernels` runs this with GLINT_WRITE_KERNELS set, and then it writes the files.
#[test]
fn the_kernels_in_the_repository_are_what_the_compiler_makes_of_their_sources() {
    let folder = Path::new("glsl/spirv");
    let files = generate::files().unwrap();
    if env::var_os("GLINT_WRITE_KERNELS").is_some() {
        let _ = fs::remove_dir_all(folder);
        fs::create_dir_all(folder).unwrap();
        files.iter().for_each(|(name, bytes)| fs::write(folder.join(name), bytes).unwrap());
    }
    let there: BTreeSet<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    assert_eq!(there, files.keys().cloned().collect(), "run tools/kernels");
    // Each module contains the compiler's version: another release of glslang may give other bytes for the
    // same source.
    for (name, bytes) in &files {
        let kept = fs::read(folder.join(name)).unwrap();
        assert!(
            kept == *bytes,
            "glsl/spirv/{name} is not what its source gives: run tools/kernels and commit glsl/spirv"
        );
    }
}
