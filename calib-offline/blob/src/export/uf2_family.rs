//! The families of devices that UF2 blocks are meant for, by the names that flash tools give them.

use std::fmt;
use std::str::FromStr;

/// The number of a family of devices: their bootloaders leave blocks of others alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Family(pub u32);

/// Blocks for the RP2350 that go to the address that they name, partition table or not.
pub(super) const ABSOLUTE: Family = Family(0xe48b_ff57);
const RP2040: Family = Family(0xe48b_ff56);
const RP2350_ARM_NS: Family = Family(0xe48b_ff5b);

/// As picotool names the first six, and the list of the UF2 specification the others.
const NAMES: [(&str, Family); 20] = [
    ("rp2040", RP2040),
    ("absolute", ABSOLUTE),
    ("data", Family(0xe48b_ff58)),
    ("rp2350-arm-s", Family(0xe48b_ff59)),
    ("rp2350-riscv", Family(0xe48b_ff5a)),
    ("rp2350-arm-ns", RP2350_ARM_NS),
    ("samd21", Family(0x68ed_2b88)),
    ("samd51", Family(0x5511_4460)),
    ("saml21", Family(0x1851_780a)),
    ("nrf52", Family(0x1b57_745f)),
    ("nrf52833", Family(0x621e_937a)),
    ("nrf52840", Family(0xada5_2840)),
    ("stm32f4", Family(0x5775_5a57)),
    ("stm32f7", Family(0x53b8_0f00)),
    ("stm32h7", Family(0x6db6_6082)),
    ("stm32l4", Family(0x00ff_6919)),
    ("mimxrt10xx", Family(0x4fb2_d5bd)),
    ("lpc55", Family(0x2abc_77ec)),
    ("esp32s2", Family(0xbfdd_4eee)),
    ("esp32s3", Family(0xc47e_5767)),
];

impl Family {
    /// Whether blocks of this family are for the boot ROM of an RP2040 or an RP2350.
    pub fn is_raspberry_pi(self) -> bool {
        (RP2040.0..=RP2350_ARM_NS.0).contains(&self.0)
    }

    /// Whether the boot ROM is that of an RP2350.
    pub fn is_rp2350(self) -> bool {
        self.is_raspberry_pi() && self != RP2040
    }

    /// Its name, if it is one of those that [`Family::from_str`] knows.
    pub fn name(self) -> Option<&'static str> {
        let mut names = NAMES.iter();
        let found = names.find(|(_, family)| *family == self);
        found.map(|(name, _)| *name)
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "{:#010x}", self.0),
        }
    }
}

/// A family that is neither a name nor a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownFamily;

impl fmt::Display for UnknownFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("give a number such as 0xe48bff56, or one of")?;
        for (number, (name, _)) in NAMES.iter().enumerate() {
            write!(f, "{} {name}", if number == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl std::error::Error for UnknownFamily {}

impl FromStr for Family {
    type Err = UnknownFamily;

    /// A name, in capitals or not, or a number of 32 bits, hexadecimal behind `0x` or decimal.
    fn from_str(text: &str) -> Result<Self, UnknownFamily> {
        let mut names = NAMES.iter();
        if let Some((_, family)) = names.find(|(name, _)| name.eq_ignore_ascii_case(text)) {
            return Ok(*family);
        }
        let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
        let number = match digits {
            Some(digits) => u32::from_str_radix(digits, 16),
            None => text.parse(),
        };
        number.map(Self).map_err(|_| UnknownFamily)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_come_back() {
        for (name, family) in NAMES {
            assert_eq!(name.parse(), Ok(family));
            assert_eq!(family.to_string(), name);
            assert_eq!(format!("{:#x}", family.0).parse(), Ok(family));
        }
        assert_eq!("RP2040".parse(), Ok(Family(0xe48b_ff56)));
        assert_eq!("17".parse(), Ok(Family(17)));
        assert_eq!(Family(17).to_string(), "0x00000011");
        for bad in ["", "rp2041", "0x", "0x1e48bff56", "-1"] {
            assert_eq!(bad.parse::<Family>(), Err(UnknownFamily), "{bad}");
        }
        let message = UnknownFamily.to_string();
        assert!(message.contains("rp2040, absolute"), "{message}");
    }

    #[test]
    fn the_parts_of_raspberry_pi_are_told_apart() {
        for (name, family) in NAMES {
            let is_rp2350 = ["absolute", "data"].contains(&name) || name.starts_with("rp2350");
            assert_eq!(family.is_rp2350(), is_rp2350, "{name}");
            let is_raspberry_pi = is_rp2350 || name == "rp2040";
            assert_eq!(family.is_raspberry_pi(), is_raspberry_pi, "{name}");
        }
    }
}
