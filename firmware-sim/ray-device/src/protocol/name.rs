//! Names in messages.

use heapless::String;

/// Longest name in a message, bytes. Longer ones are cut at a character.
pub const MAX_NAME: usize = 32;

/// A name as it travels.
pub type Name = String<MAX_NAME>;

/// `text` as it travels: cut at the last character that fits.
pub fn name(text: &str) -> Name {
    let mut name = Name::new();
    for character in text.chars() {
        if name.push(character).is_err() {
            break;
        }
    }
    name
}
