//! Parses image sizes in arguments of benches, and sets how long they warm up.

use std::time::Duration;

/// Work before anything is timed. An idle GPU takes a fraction of a second to reach its clocks: on an H200, frames after a pause of seconds
/// took twice as long by the clock as by the device's timestamps.
pub const WARM_UP: Duration = Duration::from_secs(1);

/// Parses `WxH` in pixels.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    numbers.filter(|n| !n.contains(&0)).ok_or_else(|| format!("`{text}`, expected WxH in pixels"))
}
