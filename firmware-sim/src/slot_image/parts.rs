//! Parts by name: what their flash is programmed and erased in, as the usual driver says. A driver with another unit
//! needs its own numbers: an image is for the unit that the firmware's driver states. Which part of the flash the
//! storage gets is the firmware's to say.

use crate::simulated::sim_flash::{Blank, Ecc, Rules};

/// The flash of a part, or of a family of parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// Its name in small letters.
    pub name: &'static str,
    /// How it is programmed and erased; with ECC, a blank unit must not be programmed.
    pub rules: Rules,
}

const fn part(name: &'static str, unit: u32, block: u32, has_ecc: bool) -> Part {
    Part {
        name,
        rules: Rules {
            unit,
            block,
            erased: 0xff,
            ecc: if has_ecc { Ecc::Error } else { Ecc::None },
            blank: Blank::Erased,
            log_block: None,
            needs_erase: true,
            stall_ms: 0,
        },
    }
}

const fn erased_to_zero(part: Part) -> Part {
    Part {
        rules: Rules {
            erased: 0,
            ..part.rules
        },
        ..part
    }
}

const fn without_erase(part: Part) -> Part {
    Part {
        rules: Rules {
            needs_erase: false,
            ..part.rules
        },
        ..part
    }
}

const fn unreadable_blank(part: Part) -> Part {
    Part {
        rules: Rules {
            blank: Blank::Fault,
            ..part.rules
        },
        ..part
    }
}

/// The parts that are known. Of parts with sectors of several sizes the largest, which is what is left beside a firmware.
pub const PARTS: [Part; 27] = [
    part("stm32f4", 4, 128 << 10, false),
    part("stm32f7", 16, 256 << 10, false),
    part("stm32l4", 8, 2 << 10, true),
    part("stm32l5", 8, 2 << 10, true),
    part("stm32g4", 8, 2 << 10, true),
    part("stm32wb", 8, 4 << 10, true),
    erased_to_zero(part("stm32l0", 4, 128, false)),
    erased_to_zero(part("stm32l1", 4, 256, false)),
    part("stm32h743", 32, 128 << 10, true),
    part("stm32h750", 32, 128 << 10, true),
    part("stm32h7a3", 16, 8 << 10, true),
    part("stm32h7b3", 16, 8 << 10, true),
    part("stm32h7rs", 16, 8 << 10, true),
    part("stm32h5", 16, 8 << 10, true),
    part("stm32u5", 16, 8 << 10, true),
    part("nrf52", 4, 4 << 10, false),
    part("nrf53", 4, 4 << 10, false),
    without_erase(part("nrf54l", 16, 4 << 10, true)),
    part("rp2040", 1, 4 << 10, false),
    part("rp2350", 1, 4 << 10, false),
    part("esp32s3", 4, 4 << 10, false),
    part("imxrt", 1, 4 << 10, false),
    part("samd51", 8, 8 << 10, true),
    part("same70", 16, 8 << 10, true),
    unreadable_blank(part("lpc55", 512, 512, true)),
    part("mcxn", 16, 8 << 10, true),
    part("ra6", 128, 32 << 10, false),
];

impl Part {
    /// The part of this name.
    pub fn of_name(name: &str) -> Option<&'static Self> {
        let mut parts = PARTS.iter();
        parts.find(|part| part.name.eq_ignore_ascii_case(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_storage_works_on_every_part_and_names_are_their_own() {
        for (index, part) in PARTS.iter().enumerate() {
            assert!(part.rules.shape().is_supported(), "{part:?}");
            assert_eq!(part.name, part.name.to_lowercase());
            assert!(PARTS[..index].iter().all(|other| other.name != part.name));
            assert_eq!(Part::of_name(&part.name.to_uppercase()), Some(part));
        }
        assert_eq!(Part::of_name("stm32"), None);
    }
}
