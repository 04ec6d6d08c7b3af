//! Parses image sizes in arguments of benches.

/// Parses `WxH` in pixels.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    numbers.filter(|n| !n.contains(&0)).ok_or_else(|| format!("`{text}`, expected WxH in pixels"))
}
