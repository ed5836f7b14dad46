// A flash of any unit and block, for the examples of `storage`: not a module of the crate.
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

struct Part<const UNIT: usize, const BLOCK: usize>;

impl<const U: usize, const B: usize> ErrorType for Part<U, B> {
    type Error = NorFlashErrorKind;
}

impl<const U: usize, const B: usize> ReadNorFlash for Part<U, B> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        Ok(())
    }

    fn capacity(&self) -> usize {
        1 << 20
    }
}

impl<const U: usize, const B: usize> NorFlash for Part<U, B> {
    const WRITE_SIZE: usize = U;
    const ERASE_SIZE: usize = B;

    fn erase(&mut self, _: u32, _: u32) -> Result<(), NorFlashErrorKind> {
        Ok(())
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), NorFlashErrorKind> {
        Ok(())
    }
}

impl<const U: usize, const B: usize> ray_device::port::Flash for Part<U, B> {}
