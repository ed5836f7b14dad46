//! A blob in the forms that flash tools and compilers take: Intel HEX, UF2, raw bytes, a C array.
//!
//! The blob's bytes stay what they are; only what stands around them differs. Where an address is
//! part of a form, it is a multiple of 8, because the runtime reads a blob in place.

mod address;
mod c_array;
mod error;
mod hex;
mod uf2;
mod uf2_family;

pub use error::ExportError;
pub use uf2::{BLOCK_LEN as UF2_BLOCK_LEN, Uf2, filled_len as uf2_filled_len};
pub use uf2_family::{Family, UnknownFamily};

use address::{ALIGNMENT, check_address};

/// The form to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Form {
    /// Intel HEX with extended linear addresses.
    Hex {
        /// Where the blob goes in the device's memory.
        base_address: u32,
    },
    /// UF2, for bootloaders that show up as a drive.
    Uf2(Uf2),
    /// The bytes of the blob.
    Binary,
    /// C source that defines an array and its length.
    C {
        /// The array's name.
        name: String,
    },
}

/// The file of a blob in a form.
///
/// # Errors
/// [`ExportError::Misaligned`], [`ExportError::TooHigh`], [`ExportError::BadName`].
pub fn file(blob: &[u8], form: &Form) -> Result<Vec<u8>, ExportError> {
    match form {
        Form::Hex { base_address } => {
            check_address(*base_address, ALIGNMENT, blob.len())?;
            Ok(hex::file(&[(*base_address, blob)]))
        }
        Form::Uf2(uf2) => uf2::file(blob, uf2),
        Form::Binary => Ok(blob.to_vec()),
        Form::C { name } if c_array::is_name(name) => Ok(c_array::file(blob, name)),
        Form::C { name } => Err(ExportError::BadName { name: name.clone() }),
    }
}

/// Intel HEX of pieces of memory, each with its address, in ascending order.
///
/// # Errors
/// [`ExportError::TooHigh`].
pub fn hex_of_pieces(pieces: &[(u32, &[u8])]) -> Result<Vec<u8>, ExportError> {
    for (address, bytes) in pieces {
        check_address(*address, 1, bytes.len())?;
    }
    Ok(hex::file(pieces))
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod uf2_tests;
