//! A blob in the forms that flash tools and compilers take: Intel HEX, UF2, raw bytes, a C array.
//!
//! The blob's bytes stay what they are; only what stands around them differs. Where an address is
//! part of a form, it is a multiple of 8, because the runtime reads a blob in place.

mod c_array;
mod hex;
mod uf2;

pub use uf2::BLOCK_LEN as UF2_BLOCK_LEN;

/// The form to write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Form {
    /// Intel HEX with extended linear addresses.
    Hex {
        /// Where the blob goes in the device's memory.
        base_address: u32,
    },
    /// UF2, for bootloaders that show up as a drive.
    Uf2 {
        /// Where the blob goes in the device's memory.
        base_address: u32,
        /// The number of the family of devices that may take it.
        family: Option<u32>,
    },
    /// The bytes of the blob.
    Binary,
    /// C source that defines an array and its length.
    C {
        /// The array's name.
        name: String,
    },
}

/// Why a blob cannot be written so.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The address is not aligned.
    #[error("the base address {address:#x} is not a multiple of {multiple}")]
    Misaligned {
        /// As asked for.
        address: u32,
        /// What it must be a multiple of.
        multiple: u32,
    },
    /// The end of the blob has no 32-bit address.
    #[error("{length} bytes at {address:#x} reach beyond the last address of 32 bits")]
    TooHigh {
        /// As asked for.
        address: u32,
        /// Bytes to place there.
        length: usize,
    },
    /// The name is none that C takes.
    #[error("\"{name}\" is no name of a C array")]
    BadName {
        /// As asked for.
        name: String,
    },
    /// The form says where the blob goes, and nobody said where.
    #[error("the form {form} needs a base address")]
    NoAddress {
        /// The form asked for.
        form: &'static str,
    },
    /// An option that the form has no place for.
    #[error("the form {form} has no place for {option}")]
    NeedlessOption {
        /// The form asked for.
        form: &'static str,
        /// The option.
        option: &'static str,
    },
}

impl ExportError {
    /// What to do about it.
    pub fn remedy(&self) -> String {
        match self {
            Self::Misaligned { multiple, .. } => format!(
                "choose a multiple of {multiple}: the start of a flash sector is one, and the runtime reads the blob in place"
            ),
            Self::TooHigh { .. } => "choose a lower --base-address".to_owned(),
            Self::BadName { .. } => {
                "give --name letters, digits and underscores, no digit in front and no keyword of C"
                    .to_owned()
            }
            Self::NoAddress { .. } => {
                "give --base-address, the place in the device's memory, such as 0x10100000"
                    .to_owned()
            }
            Self::NeedlessOption { option, .. } => format!("leave {option} out"),
        }
    }
}

/// The file of a blob in a form.
///
/// # Errors
/// [`ExportError::Misaligned`], [`ExportError::TooHigh`], [`ExportError::BadName`].
pub fn file(blob: &[u8], form: &Form) -> Result<Vec<u8>, ExportError> {
    match form {
        Form::Hex { base_address } => {
            check_address(*base_address, ALIGNMENT, blob.len())?;
            Ok(hex::file(blob, *base_address))
        }
        Form::Uf2 {
            base_address,
            family,
        } => {
            let length = blob.len().next_multiple_of(uf2::PAYLOAD_LEN);
            check_address(*base_address, uf2::PAYLOAD_LEN as u32, length)?;
            Ok(uf2::file(blob, *base_address, *family))
        }
        Form::Binary => Ok(blob.to_vec()),
        Form::C { name } if c_array::is_name(name) => Ok(c_array::file(blob, name)),
        Form::C { name } => Err(ExportError::BadName { name: name.clone() }),
    }
}

const ALIGNMENT: u32 = ray_runtime::format::ALIGNMENT as u32;

fn check_address(address: u32, multiple: u32, length: usize) -> Result<(), ExportError> {
    if !address.is_multiple_of(multiple) {
        return Err(ExportError::Misaligned { address, multiple });
    }
    if u64::from(address) + length as u64 > 1 << 32 {
        return Err(ExportError::TooHigh { address, length });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
