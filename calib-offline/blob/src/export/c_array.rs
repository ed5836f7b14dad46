//! C source that defines an array, aligned as the runtime asks, and its length.

use std::fmt::Write;

/// Bytes in a line.
const ROW_LEN: usize = 16;

/// What C11 keeps for itself, without those that begin with an underscore.
const KEYWORDS: [&str; 37] = [
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else",
    "enum", "extern", "float", "for", "goto", "if", "inline", "int", "long", "register",
    "restrict", "return", "short", "signed", "sizeof", "static", "struct", "switch", "typedef",
    "union", "unsigned", "void", "volatile", "while", "uint8_t", "size_t", "asm",
];

/// Whether an array may be called so. Names that begin with an underscore are the compiler's.
pub(super) fn is_name(name: &str) -> bool {
    name.starts_with(|first: char| first.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !KEYWORDS.contains(&name)
}

/// The file, for a name that C takes.
pub(super) fn file(blob: &[u8], name: &str) -> Vec<u8> {
    let length = blob.len();
    let mut text = format!(
        "/* A ray blob, for rays_open(&rig, {name}, {name}_len). Exported by calib-offline {}. */\n\
         #include <stddef.h>\n\
         #include <stdint.h>\n\n\
         extern const uint8_t {name}[{length}];\n\
         extern const size_t {name}_len;\n\n\
         const uint8_t {name}[{length}] __attribute__((aligned(8))) = {{\n",
        env!("CARGO_PKG_VERSION")
    );
    for row in blob.chunks(ROW_LEN) {
        text.push_str("   ");
        for byte in row {
            // Writing to a string cannot fail.
            let _ = write!(text, " 0x{byte:02x},");
        }
        text.push('\n');
    }
    text.push_str("};\n");
    let _ = writeln!(text, "const size_t {name}_len = {length};");
    text.into_bytes()
}
