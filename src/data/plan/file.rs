//! Plans as JSON, one list a line.

use std::io::Read;
use std::path::Path;

use serde::Serialize;

use super::{Part, Plan};
use crate::data::write_text;
use crate::{Error, Result};

/// Beginning of every plan; the number is the version of the format.
const HEAD: &str = "{\"glint_plan\": 1,\n";

/// Whether a file is a plan.
///
/// # Errors
/// If it cannot be read.
pub fn is_plan(path: &Path) -> Result<bool> {
    let mut head = Vec::new();
    let file = std::fs::File::open(path).map_err(|source| Error::io(path, source))?;
    file.take(256).read_to_end(&mut head).map_err(|source| Error::io(path, source))?;
    let text = String::from_utf8_lossy(&head);
    Ok(text.trim_start().trim_start_matches('{').trim_start().starts_with("\"glint_plan\""))
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// If the file is not a plan, or not a valid one.
    pub fn read(path: &Path) -> Result<Plan> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::io(path, source))?;
        if !is_plan(path)? {
            return Err(Error::input(path, "is not a plan; expected a file of glint partition"));
        }
        let plan: Plan = serde_json::from_str(&text).map_err(|error| Error::input(path, format!("{error}")))?;
        plan.check().map_err(|what| Error::input(path, what))?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), String> {
        if self.parts.is_empty() {
            return Err("has no parts".into());
        }
        let seeds: usize = self.parts.iter().map(|part| part.seeds.len()).sum();
        for (i, part) in self.parts.iter().enumerate() {
            let wrong = if part.seeds.iter().flatten().any(|v| !v.is_finite()) {
                "a seed that is not finite"
            } else if !part.near.is_sorted() || part.near.last().is_some_and(|&near| near as usize >= seeds) {
                "numbers in `near` that are not in order, or of no seed"
            } else if part.photos.is_empty() && part.ring.is_empty() {
                "no photos"
            } else {
                continue;
            };
            return Err(format!("part {i} has {wrong}"));
        }
        Ok(())
    }

    /// Writes the plan, whole or not at all.
    ///
    /// # Errors
    /// Those of the file system.
    pub fn write(&self, path: &Path) -> Result<()> {
        let head = format!(
            "{HEAD}\"dataset\": {},\n\"options\": {},\n\"checksum\": {},\n",
            json(&self.dataset),
            json(&self.options),
            self.checksum
        );
        write_text(path, &(head + &self.parts_text() + "}\n"))
    }

    /// Checksum of all but the dataset's path. Parts carry it, so that parts of different plans are not merged.
    pub fn id(&self) -> u32 {
        let Plan { dataset: _, options, checksum, parts: _ } = self;
        crc32fast::hash(format!("{}{checksum}{}", json(options), self.parts_text()).as_bytes())
    }

    fn parts_text(&self) -> String {
        let parts: Vec<String> = self.parts.iter().map(part_text).collect();
        format!("\"parts\": [\n{}\n]", parts.join(",\n"))
    }
}

fn part_text(part: &Part) -> String {
    let Part { photos, ring, test, gaussians, bounds, seeds, near } = part;
    let line = |name: &str, value: String| format!("\"{name}\": {value}");
    let lines = [
        line("photos", json(photos)),
        line("ring", json(ring)),
        line("test", json(test)),
        line("gaussians", json(gaussians)),
        line("bounds", json(bounds)),
        line("seeds", json(seeds)),
        line("near", json(near)),
    ];
    format!("{{{}}}", lines.join(",\n"))
}

/// JSON of strings, numbers and lists, which always have one.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        let part = Part {
            photos: vec!["a \"b\".png".into()],
            gaussians: 7,
            bounds: [[-1.0, 0.1, 1e-9], [1.0; 3]],
            seeds: vec![[0.1, 0.2, 0.3, 0.0, 0.6, 0.8]],
            ..Part::default()
        };
        Plan { dataset: "/data/x".into(), checksum: 5, parts: vec![part.clone(), part], ..Plan::default() }
    }

    #[test]
    fn a_plan_comes_back_and_its_id_follows_all_but_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        let plan = plan();
        plan.write(&path).unwrap();
        assert!(is_plan(&path).unwrap());
        assert_eq!(Plan::read(&path).unwrap(), plan);
        assert_eq!(Plan { dataset: "/else".into(), ..plan.clone() }.id(), plan.id());
        let mut other = plan.clone();
        other.parts[1].seeds[0][0] = 0.2;
        assert_ne!(other.id(), plan.id());
        assert_ne!(Plan { checksum: 6, ..plan.clone() }.id(), plan.id());
    }

    #[test]
    fn what_is_not_a_plan_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        let error = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Plan::read(&path).unwrap_err().to_string()
        };
        assert!(error("{\"frames\": []}").contains("glint partition"));
        assert!(error("{\"glint_plan\": 1}").contains("missing field"));
        let spoilt = |change: &dyn Fn(&mut Plan)| {
            let mut plan = plan();
            change(&mut plan);
            plan.check().unwrap_err()
        };
        assert!(spoilt(&|plan| plan.parts.clear()).contains("no parts"));
        assert!(spoilt(&|plan| plan.parts[1].seeds[0][2] = f64::NAN).contains("part 1 has a seed"));
        assert!(spoilt(&|plan| plan.parts[0].near = vec![2]).contains("`near`"));
        assert!(spoilt(&|plan| plan.parts[0].photos.clear()).contains("no photos"));
    }
}
