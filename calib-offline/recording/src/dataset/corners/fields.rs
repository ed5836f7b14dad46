//! Fields of a line of a CSV file, and how much of them a message shows.

/// A field without the blanks around it, and without the quotes that some programs put around
/// every text.
pub(in crate::dataset) fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'))
        .map_or(field, str::trim)
}

/// The first characters of something that may be long or unprintable.
pub(in crate::dataset) fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    if text.chars().nth(60).is_some() {
        short.push_str("...");
    }
    short
}
