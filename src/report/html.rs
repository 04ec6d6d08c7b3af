//! Escaping and tables for the HTML pages.

/// Returns a table that scrolls by itself if the window is narrower.
pub(super) fn scrolling(class: &str, content: &str) -> String {
    format!("<div class=\"scroll\"><table class=\"{class}\">{content}</table></div>\n")
}

/// Escapes text for HTML content and attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c => out.push(c),
        }
    }
    out
}
