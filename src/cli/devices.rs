//! `glint devices`: lists Vulkan devices, how kernels would run on each, and why glint refuses some.

use serde::Serialize;

use super::{Outcome, print, print_json, with_hint};
use crate::{
    gpu::{Context, DeviceInfo, GpuError},
    report::table::{Cell, Column, Table},
};

/// List the Vulkan devices that --device can select
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Print JSON: a list of devices with all their properties; "refused" is the reason if glint cannot use
    /// one, else null
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
pub(super) struct Listed {
    pub(super) index: usize,
    /// Reason why glint cannot use it.
    pub(super) refused: Option<String>,
    #[serde(flatten)]
    pub(super) info: DeviceInfo,
}

pub(super) fn list() -> Result<Vec<Listed>, GpuError> {
    let devices = Context::devices().map_err(with_hint)?.into_iter().enumerate();
    Ok(devices
        .map(|(index, (info, refused))| Listed { index, refused: refused.map(|e| e.to_string()), info })
        .collect())
}

impl Listed {
    /// Reason why it is not used, or is slow.
    pub(super) fn note(&self) -> Option<String> {
        match (&self.refused, &self.info.software_subgroups) {
            (Some(why), _) => Some(format!("refused: {why}")),
            (None, Some(lacks)) => Some(format!("slow: subgroups by software, since the device lacks {lacks}")),
            (None, None) => None,
        }
    }
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let devices = list()?;
        if self.json {
            return Ok(print_json(&devices)?);
        }
        let mut table = Table::new([
            Column::new("index", "", 0),
            Column::new("name", "", 0),
            Column::new("kind", "", 0),
            Column::new("subgroup", "", 0),
            Column::new("largest buffer", "MiB", 0),
            Column::new("driver", "", 0),
            Column::new("notes", "", 0),
        ]);
        for device in devices {
            let notes = device.note().unwrap_or_default();
            let Listed { index, info, .. } = device;
            table.row([
                Cell::Count(index as u64),
                info.name.into(),
                info.kind.into(),
                Cell::Count(info.subgroup_size.into()),
                Cell::Number(info.max_storage_bytes as f64 / f64::from(1 << 20)),
                info.driver.version.into(),
                notes.into(),
            ]);
        }
        Ok(print(table)?)
    }
}
