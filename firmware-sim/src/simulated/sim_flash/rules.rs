//! The rules of a simulated flash: what `--flash-rules` sets.

use std::fmt;
use std::str::FromStr;

use ray_device::port::Geometry;
use ray_device::storage::layout::{Layout, Shape, aligned};

/// What becomes of a word with an error that its ECC cannot correct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ecc {
    /// There is no ECC: the word reads as it is.
    None,
    /// The flash controller reports it, and the driver returns an error.
    Error,
    /// The load faults. The driver is a plain copy, and the port's fault handler makes an error of it; a load
    /// that is not the driver's would stop the device.
    Fault,
}

/// What reading a blank unit gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blank {
    /// The erased value.
    Erased,
    /// A fault, as on a word with an ECC error.
    Fault,
    /// Anything.
    Undefined,
}

/// The rules of a flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rules {
    /// Bytes of a program unit.
    pub unit: u32,
    /// Bytes of an erase block.
    pub block: u32,
    /// What an erased byte reads as: 0x00 or 0xff.
    pub erased: u8,
    /// Of words that a cut of power spoiled.
    pub ecc: Ecc,
    /// Of units that are blank.
    pub blank: Blank,
    /// Erase block of the regions for the logs and the factory record, where those are not in the blobs' regions.
    pub log_block: Option<u32>,
    /// Whether a unit must be erased before it is programmed once more.
    pub needs_erase: bool,
    /// How long an erase stalls the device, ms.
    pub stall_ms: u32,
}

impl Default for Rules {
    /// Units of 8 bytes, blocks of 4096, erased to 0xff, no ECC.
    fn default() -> Self {
        Self {
            unit: 8,
            block: 4096,
            erased: 0xff,
            ecc: Ecc::None,
            blank: Blank::Erased,
            log_block: None,
            needs_erase: true,
            stall_ms: 0,
        }
    }
}

/// Where the regions of a simulated flash start and how long they are, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Areas {
    /// Length of the factory's region, at the start.
    pub factory: usize,
    /// Length of each log's region, behind it; 0 where logs are in the slots.
    pub log: usize,
    /// Where the slots start.
    pub slots: usize,
    /// Length of a slot.
    pub slot: usize,
}

impl Rules {
    /// Of the flash with the blobs.
    pub fn geometry(&self) -> Geometry {
        Geometry {
            unit: self.unit,
            block: self.block,
            erased: self.erased,
            needs_erase: self.needs_erase,
        }
    }

    /// Of the flash with the logs.
    pub fn log_geometry(&self) -> Geometry {
        Geometry {
            block: self.log_block.unwrap_or(self.block),
            ..self.geometry()
        }
    }

    /// Where things lie in a slot.
    pub fn shape(&self) -> Shape {
        Shape {
            log: self.log_geometry(),
            blob: self.geometry(),
            is_log_apart: self.log_block.is_some(),
        }
    }

    /// Where the regions are in a flash of so many bytes; `None` if it is too short for these rules.
    pub fn areas(&self, length: usize) -> Option<Areas> {
        let length = u32::try_from(length).ok()?;
        if !self.shape().is_supported() || !length.is_multiple_of(self.block) {
            return None;
        }
        let Some(log_block) = self.log_block else {
            let layout = Layout::of(length, self.geometry())?;
            return Some(Areas {
                factory: layout.factory as usize,
                log: 0,
                slots: layout.factory as usize,
                slot: layout.slot as usize,
            });
        };
        let log = self.shape().log_length();
        let slots = aligned(log_block + 2 * log, self.block);
        let slot = length.checked_sub(slots)? / self.block / 2 * self.block;
        (slot > 0).then_some(Areas {
            factory: log_block as usize,
            log: log as usize,
            slots: slots as usize,
            slot: slot as usize,
        })
    }
}

/// As `--flash-rules` takes them, all that differs from the default.
impl fmt::Display for Rules {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            out,
            "unit={},block={},erased={:02x}",
            self.unit, self.block, self.erased
        )?;
        match self.ecc {
            Ecc::None => {}
            Ecc::Error => write!(out, ",ecc=error")?,
            Ecc::Fault => write!(out, ",ecc=fault")?,
        }
        match self.blank {
            Blank::Erased => {}
            Blank::Fault => write!(out, ",blank=fault")?,
            Blank::Undefined => write!(out, ",blank=undefined")?,
        }
        if let Some(block) = self.log_block {
            write!(out, ",log-block={block}")?;
        }
        if !self.needs_erase {
            write!(out, ",erase=none")?;
        }
        if self.stall_ms > 0 {
            write!(out, ",stall-ms={}", self.stall_ms)?;
        }
        Ok(())
    }
}

/// What is wrong with rules, and what they could be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadRules(String);

impl FromStr for Rules {
    type Err = BadRules;

    fn from_str(text: &str) -> Result<Self, BadRules> {
        let mut rules = Self::default();
        for setting in text.split(',').filter(|setting| !setting.is_empty()) {
            rules.set(setting).map_err(BadRules)?;
        }
        let units = rules.geometry();
        if !(units.unit.is_power_of_two() && units.unit <= Geometry::MAX_UNIT) {
            let unit = units.unit;
            return Err(BadRules(format!(
                "unit={unit}: the storage takes program units of 1, 2, 4 ... {} bytes",
                Geometry::MAX_UNIT
            )));
        }
        for (name, block) in [("block", Some(rules.block)), ("log-block", rules.log_block)] {
            let Some(block) = block else { continue };
            let geometry = Geometry { block, ..units };
            if !geometry.is_supported() || block > 1 << 20 {
                return Err(BadRules(format!(
                    "{name}={block}: an erase block is a power of two of at least {} bytes and a unit, and here at most 1048576",
                    Geometry::MIN_BLOCK
                )));
            }
        }
        Ok(rules)
    }
}

impl Rules {
    fn set(&mut self, setting: &str) -> Result<(), String> {
        let (name, value) = setting
            .split_once('=')
            .ok_or_else(|| format!("\"{setting}\": give NAME=VALUE, such as unit=32"))?;
        let number = || {
            value
                .parse::<u32>()
                .map_err(|_| format!("{name}={value}: give a number of bytes, or of ms"))
        };
        let one_of = |choices: &str| format!("{name}={value}: give {choices}");
        match name {
            "unit" => self.unit = number()?,
            "block" => self.block = number()?,
            "log-block" => self.log_block = Some(number()?),
            "stall-ms" => self.stall_ms = number()?,
            "erased" => {
                self.erased = match value {
                    "00" => 0x00,
                    "ff" | "FF" => 0xff,
                    _ => return Err(one_of("00 or ff")),
                }
            }
            "ecc" => {
                self.ecc = match value {
                    "none" => Ecc::None,
                    "error" => Ecc::Error,
                    "fault" => Ecc::Fault,
                    _ => return Err(one_of("none, error or fault")),
                }
            }
            "blank" => {
                self.blank = match value {
                    "erased" => Blank::Erased,
                    "fault" => Blank::Fault,
                    "undefined" => Blank::Undefined,
                    _ => return Err(one_of("erased, fault or undefined")),
                }
            }
            "erase" => {
                self.needs_erase = match value {
                    "blocks" => true,
                    "none" => false,
                    _ => return Err(one_of("blocks or none")),
                }
            }
            _ => {
                return Err(format!(
                    "\"{name}\" is no rule: there are unit, block, log-block, erased, ecc, blank, erase and stall-ms"
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_come_back_from_their_text() {
        for text in [
            "unit=8,block=4096,erased=ff",
            "unit=32,block=131072,erased=00,ecc=error",
            "unit=4,block=131072,erased=ff,log-block=16384",
            "unit=512,block=512,erased=ff,ecc=fault,blank=fault",
            "unit=4,block=64,erased=ff,blank=undefined,stall-ms=3",
            "unit=16,block=4096,erased=ff,erase=none",
        ] {
            let rules: Rules = text.parse().unwrap();
            assert_eq!(rules.to_string(), text);
        }
        assert_eq!("".parse(), Ok(Rules::default()));
        assert_eq!(
            "ecc=none,blank=erased,erase=blocks".parse(),
            Ok(Rules::default())
        );
    }

    #[test]
    fn bad_rules_say_what_they_could_be() {
        for (text, part) in [
            ("unit", "NAME=VALUE"),
            ("unit=x", "number"),
            ("unit=0", "1, 2, 4"),
            ("unit=24", "1, 2, 4"),
            ("unit=1024", "512"),
            ("block=1000", "power of two"),
            ("block=32", "at least 64"),
            ("unit=512,block=256", "power of two"),
            ("log-block=100", "log-block=100"),
            ("block=2097152", "1048576"),
            ("erased=01", "00 or ff"),
            ("ecc=yes", "none, error or fault"),
            ("blank=no", "erased, fault or undefined"),
            ("erase=1", "blocks or none"),
            ("page=4", "\"page\" is no rule"),
        ] {
            let message = text.parse::<Rules>().unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
