//! Why a blob cannot be written in a form, and what to do.

use super::uf2_family::Family;
use calib_rays::remedy::Remedy;

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
    /// A place in the flash of Raspberry Pi's parts, whose boot ROM leaves blocks without a family alone.
    #[error(
        "at {address:#x} is the flash of an RP2040 or RP2350, which ignores a UF2 file that names no family"
    )]
    NoFamily {
        /// As asked for.
        address: u32,
    },
    /// The boot ROM would erase and write different places.
    #[error(
        "the base address {address:#x} is not the start of a flash sector of 4096 bytes: the boot ROM would erase what it has written"
    )]
    NotASector {
        /// As asked for.
        address: u32,
        /// Where its sector starts.
        below: u32,
        /// Where the next one starts.
        above: u32,
    },
    /// The family's flash is elsewhere, or ends before.
    #[error("{length} bytes at {address:#x} are not in the flash of {family}, which is at 0x10000000 to {:#x}", .end - 1)]
    NotInFlash {
        /// As asked for.
        address: u32,
        /// Bytes to place there, whole sectors.
        length: usize,
        /// Whose flash.
        family: Family,
        /// Behind its last byte.
        end: u32,
    },
    /// Only RP2350 need an absolute block.
    #[error("only families of the RP2350 take an absolute block")]
    NeedlessAbsoluteBlock,
    /// The blob covers the place of the absolute block.
    #[error("the absolute block goes to {address:#x}, which the file writes, too")]
    OnAbsoluteBlock {
        /// Its address.
        address: u32,
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

impl Remedy for ExportError {
    fn remedy(&self) -> Option<String> {
        let text = match self {
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
            Self::NoFamily { .. } => {
                "give --family rp2040, or rp2350-arm-s or rp2350-riscv, or data or absolute for an RP2350 with a partition table"
                    .to_owned()
            }
            Self::NotASector { below, above, .. } => format!(
                "give --base-address {above:#x}, or {below:#x}; what else stands in the sectors of the blob is erased in any case"
            ),
            Self::NotInFlash { .. } => {
                "choose a --base-address there, or the --family of the part that the file is for".to_owned()
            }
            Self::NeedlessAbsoluteBlock => {
                "leave --absolute-block out, or give a --family of the RP2350, such as rp2350-arm-s"
                    .to_owned()
            }
            Self::OnAbsoluteBlock { .. } => {
                "choose another --base-address, or leave --absolute-block out: only RP2350 of stepping A2 need it".to_owned()
            }
        };
        Some(text)
    }
}
