//! The forms of `export` that are one file of a blob: hex, uf2, bin and c.

use super::export_form::FormatArg;
use calib_blob::export::{ExportError, Family, Form, Uf2};
use clap::Args;

/// Where in the device's memory readers of HEX begin to differ.
const HIGH_HEX: u32 = 0x8000_0000;

/// The arguments.
#[derive(Debug, Args)]
pub struct BlobArgs {
    /// Where the blob goes in the device's memory: hex and uf2 need it
    #[arg(long, value_name = "0x...", value_parser = parse_number)]
    pub base_address: Option<u32>,
    /// The family of devices that may take it, for uf2, by name (rp2040, rp2350-arm-s, rp2350-riscv,
    /// data, absolute, samd21, nrf52840 ...) or by number
    #[arg(long, value_name = "NAME or 0x...")]
    pub family: Option<Family>,
    /// The block that RP2350 of stepping A2 want first (erratum E10), for uf2.
    #[arg(
        long,
        help = "Put the absolute block first that RP2350 of stepping A2 want (erratum E10), for uf2"
    )]
    pub absolute_block: bool,
    /// The name of the array.
    #[arg(
        long,
        value_name = "SYMBOL",
        help = "The name of the array, for c [default: rays_blob]"
    )]
    pub name: Option<String>,
}

impl BlobArgs {
    /// The first option that is given and that the form has no place for.
    pub(super) fn needless(&self, format: FormatArg, is_uf2: bool) -> Option<&'static str> {
        let is_placed = matches!(format, FormatArg::Uf2 | FormatArg::Hex);
        let options = [
            ("--base-address", self.base_address.is_some() && !is_placed),
            ("--family", self.family.is_some() && !is_uf2),
            ("--absolute-block", self.absolute_block && !is_uf2),
            ("--name", self.name.is_some() && format != FormatArg::C),
        ];
        let found = options.into_iter().find(|(_, is_needless)| *is_needless);
        found.map(|(option, _)| option)
    }

    /// The form of one file that the arguments ask for.
    ///
    /// # Errors
    /// [`ExportError::NoAddress`].
    pub(super) fn form(&self, format: FormatArg) -> Result<Form, ExportError> {
        let form = format.name();
        let base_address = || self.base_address.ok_or(ExportError::NoAddress { form });
        Ok(match format {
            FormatArg::Hex => Form::Hex {
                base_address: base_address()?,
            },
            FormatArg::Uf2 => Form::Uf2(Uf2 {
                base_address: base_address()?,
                family: self.family,
                absolute_block: self.absolute_block,
            }),
            FormatArg::C => Form::C {
                name: self.name.clone().unwrap_or_else(|| "rays_blob".to_owned()),
            },
            _ => Form::Binary,
        })
    }
}

/// What a form does not say by itself and its reader should know.
pub(super) fn notes(form: &Form, length: usize) -> Vec<String> {
    match form {
        Form::Hex { base_address } if *base_address >= HIGH_HEX => vec![
            "some readers refuse HEX from 0x80000000 on, such as Nordic's nrf-intel-hex: for these take bin and give them the address"
                .to_owned(),
        ],
        Form::Uf2(uf2) if uf2.family.is_some_and(Family::is_raspberry_pi) => {
            let filled = calib_blob::export::uf2_filled_len(length, uf2.family);
            vec![format!("{filled} bytes are written, whole sectors, with 0xff behind the blob")]
        }
        _ => Vec::new(),
    }
}

/// A number of 32 bits, hexadecimal behind `0x` or decimal.
pub(super) fn parse_number(text: &str) -> Result<u32, String> {
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let parsed = match digits {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    };
    parsed.map_err(|_| "give a number of 32 bits such as 0x10100000".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_hexadecimal_or_decimal() {
        assert_eq!(parse_number("0x10100000"), Ok(0x1010_0000));
        assert_eq!(parse_number("0XFF"), Ok(255));
        assert_eq!(parse_number("4096"), Ok(4096));
        for bad in ["", "0x", "0x100000000", "-8", "10h", "ff"] {
            assert!(parse_number(bad).is_err(), "{bad}");
        }
    }
}
