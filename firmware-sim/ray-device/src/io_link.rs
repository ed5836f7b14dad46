//! A [`Link`] over any byte stream of `embedded-io`, such as the UART or the USB port of a HAL.
//!
//! For streams of `embedded-io-async` there is no adapter: `Session::serve_async` takes them as they are.

use embedded_io::{Read, Write};

use crate::port::Link;

/// A stream of `embedded-io` as a [`Link`].
#[derive(Clone, Copy, Debug)]
pub struct IoLink<T>(pub T);

impl<T: Read + Write> Link for IoLink<T> {
    type Error = T::Error;

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, T::Error> {
        self.0.read(buffer)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), T::Error> {
        self.0.write_all(bytes)?;
        self.0.flush()
    }
}
