//! Flash behind callbacks: a `rays_flash` of `rays_device.h` as a port of `ray-device`.

use core::ffi::{c_int, c_void};
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use ray_device::port::{Clock, Flash, Geometry, MappedFlash};

type Read = unsafe extern "C" fn(*mut c_void, u32, *mut u8, usize) -> c_int;
type Program = unsafe extern "C" fn(*mut c_void, u32, *const u8, usize) -> c_int;
type OfRange = unsafe extern "C" fn(*mut c_void, u32, u32) -> c_int;
type Step = unsafe extern "C" fn(*mut c_void);

/// The flash of one slot.
///
/// Whoever makes one promises what `rays_device.h` says: that the callbacks may be called with `context`, and that `capacity`
/// bytes can be read at `mapped`, which nobody but `program` and `erase` changes.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Driver {
    context: *mut c_void,
    mapped: *const u8,
    capacity: u32,
    unit: u32,
    block: u32,
    erased: u8,
    no_erase: u8,
    read: Option<Read>,
    program: Option<Program>,
    erase: Option<OfRange>,
    is_blank: Option<OfRange>,
    step: Option<Step>,
}

impl Driver {
    /// Whether blobs can be kept in it.
    pub(crate) fn is_supported(&self) -> bool {
        self.geometry().is_supported()
            && matches!(self.erased, 0 | 0xff)
            && self.capacity.is_multiple_of(self.block)
            && !self.mapped.is_null()
            && self.mapped.addr().is_multiple_of(8)
            && isize::try_from(self.capacity).is_ok()
            && self.read.is_some()
            && self.program.is_some()
            && (self.erase.is_some() || self.no_erase != 0)
    }

    /// Its watchdog.
    pub(crate) fn steps(&self) -> Steps {
        Steps {
            context: self.context,
            step: self.step,
        }
    }
}

/// What a callback said.
fn outcome(code: Option<c_int>) -> Result<(), NorFlashErrorKind> {
    match code {
        Some(0) => Ok(()),
        _ => Err(NorFlashErrorKind::Other),
    }
}

impl ErrorType for Driver {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Driver {
    const READ_SIZE: usize = 1;

    fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let (place, length) = (bytes.as_mut_ptr(), bytes.len());
        // SAFETY: the promise of whoever made the driver; the place has that length.
        outcome(
            self.read
                .map(|read| unsafe { read(self.context, address, place, length) }),
        )
    }

    fn capacity(&self) -> usize {
        self.capacity as usize
    }
}

/// The constants are the least of what [`Flash::geometry`] says.
impl NorFlash for Driver {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = Geometry::MIN_BLOCK as usize;

    fn erase(&mut self, start: u32, end: u32) -> Result<(), NorFlashErrorKind> {
        let length = end.saturating_sub(start);
        // SAFETY: the promise of whoever made the driver.
        outcome(
            self.erase
                .map(|erase| unsafe { erase(self.context, start, length) }),
        )
    }

    fn write(&mut self, address: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let (place, length) = (bytes.as_ptr(), bytes.len());
        // SAFETY: the promise of whoever made the driver; the bytes have that length.
        outcome(
            self.program
                .map(|program| unsafe { program(self.context, address, place, length) }),
        )
    }
}

impl Flash for Driver {
    fn geometry(&self) -> Geometry {
        Geometry {
            unit: self.unit,
            block: self.block,
            erased: self.erased,
            needs_erase: self.no_erase == 0,
        }
    }

    fn is_blank(&mut self, start: u32, length: u32) -> Result<bool, NorFlashErrorKind> {
        let Some(is_blank) = self.is_blank else {
            return ray_device::port::reads_as_erased(self, start, length);
        };
        // SAFETY: the promise of whoever made the driver.
        match unsafe { is_blank(self.context, start, length) } {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(NorFlashErrorKind::Other),
        }
    }
}

impl MappedFlash for Driver {
    fn mapped(&self, start: u32, length: u32) -> Option<&[u8]> {
        if start.checked_add(length)? > self.capacity {
            return None;
        }
        // SAFETY: within the bytes that can be read there, says whoever made the driver; `self` is borrowed for as long as
        // they are, so that nothing is programmed or erased meanwhile.
        Some(unsafe {
            core::slice::from_raw_parts(self.mapped.add(start as usize), length as usize)
        })
    }
}

/// The watchdog of a driver, as the clock that the storage wants.
pub(crate) struct Steps {
    context: *mut c_void,
    step: Option<Step>,
}

impl Clock for Steps {
    fn uptime_ms(&mut self) -> u64 {
        0
    }

    fn step(&mut self) {
        if let Some(step) = self.step {
            // SAFETY: the promise of whoever made the driver.
            unsafe { step(self.context) };
        }
    }
}
