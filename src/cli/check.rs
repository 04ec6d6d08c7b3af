//! Checks a device before its first use, and remembers that it passed.

use std::{
    collections::BTreeSet,
    env,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use super::{Failure, Outcome};
use crate::{
    Result,
    data::write_text,
    gpu::{Context, ContextOptions},
    stages::kernels,
    verify,
};

/// Compares the core stages with their twins, unless this device, driver and glint passed before. With
/// `unchecked`, a failure is only a warning.
pub(super) fn check(context: &Context, options: &ContextOptions, unchecked: bool) -> Outcome {
    // With twins, a pass counts for this run only.
    let file = if options.twins.is_empty() { file_by(cfg!(windows), |name| env::var_os(name)) } else { None };
    let (mut passed, line) = (file.as_deref().map(read).unwrap_or_default(), line_of(context));
    if passed.contains(&line) {
        return Ok(());
    }
    let Some(text) = wrong(context)? else {
        passed.insert(line);
        // Without the file the next run checks again, which takes less than a second.
        file.into_iter().for_each(|file| write(&file, &passed));
        return Ok(());
    };
    if unchecked {
        tracing::warn!("{text}; the results are likely wrong (--unchecked)");
        return Ok(());
    }
    Err(Failure::Device(text))
}

/// Compares the core stages with their twins. Names those that differ, if any.
pub(super) fn wrong(context: &Context) -> Result<Option<String>> {
    let broken = verify::check(context)?;
    let stages: BTreeSet<&str> = broken.iter().map(|row| row.stage).collect();
    let (info, stages) = (context.info(), stages.into_iter().collect::<Vec<_>>().join(", "));
    Ok((!broken.is_empty()).then(|| {
        format!(
            "{} ({}) computes wrongly: {stages} differ from float64 beyond their bounds",
            info.name, info.driver.version
        )
    }))
}

/// Line of the file. A check is valid as long as everything in this line is unchanged.
fn line_of(context: &Context) -> String {
    let info = context.info();
    let mut kernels = crc32fast::Hasher::new();
    for kernel in kernels::ALL {
        kernels.update(if info.software_subgroups.is_some() { kernel.software_spirv } else { kernel.spirv });
    }
    let line = format!(
        "{} | {} | {} lanes{} | glint {} {:08x}",
        info.name,
        info.driver.version,
        info.subgroup_size,
        if info.software_subgroups.is_some() { " by software" } else { "" },
        env!("CARGO_PKG_VERSION"),
        kernels.finalize()
    );
    line.replace(char::is_control, " ")
}

/// File that remembers passed checks, if the system names a cache folder.
fn file_by(windows: bool, variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let named = |name: &str| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let folder = match windows {
        true => named("LOCALAPPDATA"),
        false => named("XDG_CACHE_HOME").or_else(|| Some(named("HOME")?.join(".cache"))),
    };
    Some(folder?.join("glint").join("checked"))
}

fn read(file: &Path) -> BTreeSet<String> {
    fs::read_to_string(file).map(|text| text.lines().map(str::to_owned).collect()).unwrap_or_default()
}

fn write(file: &Path, passed: &BTreeSet<String>) {
    let lines: String = passed.iter().map(|line| format!("{line}\n")).collect();
    let written = file.parent().is_some_and(|folder| fs::create_dir_all(folder).is_ok());
    if !written || write_text(file, &lines).is_err() {
        tracing::info!("the device passed its check, but {} cannot be written to remember it", file.display());
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;

    use super::*;
    use crate::{
        gpu::{Twin, TwinCall},
        reference,
    };

    /// Runs the twin, then flips one bit of one buffer.
    fn faulty<const AT: usize>(call: &mut TwinCall) -> Result<(), String> {
        let (stage, buffer) = STAGES[AT];
        (reference::twin(stage).unwrap().run)(call)?;
        let kernel = kernels::ALL.iter().find(|kernel| kernel.name == stage).unwrap();
        let written = kernel.bindings.iter().position(|binding| binding.name == buffer).unwrap();
        call.bindings[written].elements::<u32>()[5] ^= 1 << 22;
        Ok(())
    }

    const STAGES: [(&str, &CStr); 5] = [
        ("scan_apply", c"offsets"),
        ("radix_downsweep", c"values_out"),
        ("tile_ranges", c"tile_ranges"),
        ("blend", c"image"),
        ("project_backward", c"geometry"),
    ];
    type Run = fn(&mut TwinCall) -> Result<(), String>;
    const FAULTY: [Run; 5] = [faulty::<0>, faulty::<1>, faulty::<2>, faulty::<3>, faulty::<4>];

    #[test]
    fn a_device_that_computes_wrongly_is_refused_by_the_stage_unless_it_is_to_be_used() {
        let device = Context::new(&ContextOptions::from_env()).unwrap();
        let check = |twins: &[Twin], unchecked| {
            let options = ContextOptions { twins: twins.to_vec(), ..ContextOptions::from_env() };
            check(&device.again(&options).unwrap(), &options, unchecked)
        };
        for ((stage, _), run) in STAGES.into_iter().zip(FAULTY) {
            let Err(Failure::Device(text)) = check(&[Twin { stage, run }], false) else { panic!("{stage} passes") };
            assert!(text.contains("computes wrongly") && text.contains(device.info().name.as_str()), "{text}");
        }
        assert!(check(&[Twin { stage: "blend", run: FAULTY[3] }], true).is_ok());
        // Correct twins make the device usable.
        assert!(check(&STAGES.map(|(stage, _)| reference::twin(stage).unwrap()), false).is_ok());
    }

    #[test]
    fn the_file_is_in_the_systems_cache() {
        let root = env::temp_dir();
        let with = |windows, wanted: &'static str| {
            let root = root.clone();
            file_by(windows, move |name| (name == wanted).then(|| root.clone().into()))
        };
        assert_eq!(with(false, "XDG_CACHE_HOME"), Some(root.join("glint/checked")));
        assert_eq!(with(false, "HOME"), Some(root.join(".cache/glint/checked")));
        assert_eq!(with(true, "LOCALAPPDATA"), Some(root.join("glint/checked")));
        assert_eq!(with(true, "HOME"), None);
        assert_eq!(file_by(false, |_| Some("not/absolute".into())), None);
    }
}
