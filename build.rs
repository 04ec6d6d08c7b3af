//! Copies the kernels' SPIR-V and the generated interface to the build folder, for the crate to include. They
//! come from the repository, `glsl/spirv`; with the feature `shaderc` they are recompiled from
//! `glsl/**/*.comp`, see `glsl/generate.rs`.

use std::{env, fs, path::Path};

#[cfg(feature = "shaderc")]
#[allow(dead_code, reason = "tests look at its parts")]
#[path = "glsl/generate.rs"]
mod generate;

fn main() {
    let out = env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    for (name, bytes) in files() {
        let path = Path::new(&out).join(name);
        // Unchanged files keep their time, so that nothing is rebuilt.
        if fs::read(&path).ok().as_ref() != Some(&bytes) {
            fs::write(&path, bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        }
    }
}

#[cfg(feature = "shaderc")]
fn files() -> impl IntoIterator<Item = (String, Vec<u8>)> {
    for path in ["build.rs", "src/gpu/spirv.rs", "glsl"] {
        println!("cargo:rerun-if-changed={path}");
    }
    generate::files().unwrap_or_else(|errors| {
        // Cargo shows lines that start with cargo:warning even if the output is folded.
        errors.lines().for_each(|line| println!("cargo:warning={line}"));
        panic!("kernels did not compile, see the warnings above")
    })
}

#[cfg(not(feature = "shaderc"))]
fn files() -> impl IntoIterator<Item = (String, Vec<u8>)> {
    let folder = Path::new("glsl/spirv");
    for path in ["build.rs", "glsl/spirv"] {
        println!("cargo:rerun-if-changed={path}");
    }
    let list = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    list.map(|entry| {
        let path = entry.expect("a listed file").path();
        let bytes = fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        (path.file_name().unwrap_or_default().to_string_lossy().into_owned(), bytes)
    })
    .collect::<Vec<_>>()
}
