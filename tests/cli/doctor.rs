//! Tests `glint doctor`.

use std::{fs, os::unix::fs::PermissionsExt, process::Command};

use serde_json::Value;

use super::{Work, keys, run, set};

/// The command with only these programs on the PATH, and without a display.
fn doctor(work: &Work, arguments: &str, programs: &[(&str, &str)]) -> Command {
    let folder = work.path("programs");
    fs::create_dir_all(&folder).unwrap();
    for (name, text) in programs {
        fs::write(folder.join(name), format!("#!/bin/sh\necho '{text}'\n")).unwrap();
        fs::set_permissions(folder.join(name), fs::Permissions::from_mode(0o755)).unwrap();
    }
    let mut command = work.command(&format!("doctor {arguments}"));
    command.env("PATH", folder).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command
}

/// Runs it; returns the exit code, and state and text of each line by name. Of several devices the last.
fn lines(mut command: Command) -> (Option<i32>, impl Fn(&str) -> (String, String)) {
    let output = run::run(&mut command);
    let text = String::from_utf8(output.stdout).unwrap();
    let line = move |name: &str| {
        let mut lines = text.lines().rev().map(|line| (line[..9].trim(), line[9..18].trim(), &line[18..]));
        let found = lines.find(|line| line.1 == name).unwrap_or_else(|| panic!("no {name} in {text}"));
        (found.0.to_owned(), found.2.to_owned())
    };
    (output.status.code(), line)
}

#[test]
fn a_machine_is_described_line_by_line() {
    let work = Work::small();
    let programs =
        [("colmap", "COLMAP 3.8 -- Structure-from-Motion"), ("ffmpeg", "ffmpeg version 5.1.6-0+deb12u1 Copyright")];
    let (code, line) = lines(doctor(&work, "", &programs));
    assert_eq!(code, Some(0));
    for (name, state, part) in [
        ("glint", "ok", concat!(env!("CARGO_PKG_VERSION"), ", built with cli, formats, view")),
        ("system", "ok", std::env::consts::ARCH),
        ("vulkan", "ok", "loader 1."),
        ("check", "ok", "agree with float64"),
        ("display", "warning", "no window can be opened"),
        ("colmap", "ok", "3.8"),
        ("ffmpeg", "ok", "5.1.6-0+deb12u1"),
    ] {
        let (found, text) = line(name);
        assert!(found == state && text.contains(part), "{name}: {found} {text}");
    }
    assert!(line("disk").1.contains("GB free") && line("device").1.contains("of memory"));
    // Neither program is there; a device that does not exist is an error.
    fs::remove_dir_all(work.path("programs")).unwrap();
    let mut command = doctor(&work, "", &[]);
    command.env("GLINT_DEVICE", "nonesuch");
    let (code, line) = lines(command);
    assert_eq!(code, Some(1));
    for name in ["colmap", "ffmpeg"] {
        assert!(line(name).0 == "warning" && line(name).1.contains("apt install"), "{name}");
    }
    assert!(line("check").0 == "error" && line("check").1.contains("GLINT_DEVICE"), "{}", line("check").1);
}

#[test]
fn a_machine_without_a_driver_gets_the_next_step_and_exit_code_1() {
    let work = Work::small();
    let mut command = doctor(&work, "", &[]);
    command.env_remove("GLINT_DEVICE").env("VK_DRIVER_FILES", "/nowhere").env("VK_ICD_FILENAMES", "/nowhere");
    let output = run::run(&mut command);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.starts_with("error: training would not work") && said.lines().count() == 1, "{said}");
    let (code, line) = lines(command);
    assert_eq!((code, line("check").0.as_str(), line("disk").0.is_empty()), (Some(1), "error", false));
    assert!(line("check").1.contains("apt install mesa-vulkan-drivers"), "{}", line("check").1);
}

#[test]
fn the_description_is_there_as_json() {
    let work = Work::small();
    let output = run::run(&mut doctor(&work, "--json", &[]));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(keys(&report), set("ready version features lines devices"));
    assert!(report["ready"] == true && report["features"].as_array().unwrap().contains(&"cli".into()), "{report}");
    let lines = report["lines"].as_array().unwrap();
    assert!(lines.len() >= 9 && lines.iter().all(|line| keys(line) == set("state name text")), "{report}");
    assert_eq!(report["devices"], work.json("devices --json"));
    assert!(report["devices"][0]["memory_bytes"].as_u64().unwrap() > 0, "{report}");
    let version = report["devices"][0]["vulkan"].as_str().unwrap();
    assert!(version.starts_with("1.") && version.split('.').count() == 3, "{version}");
}
