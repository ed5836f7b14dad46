//! A slot: the flash that a log, a blob and a manifest lie in, in one region or in two.

use super::layout::Shape;
use crate::port::{Flash, MappedFlash};
use embedded_storage::nor_flash::ReadNorFlash;

/// The flash of a slot. Any [`MappedFlash`] is one, with its log at the start.
pub trait SlotFlash {
    /// The flash with the log.
    type Log: Flash;
    /// The flash with the blob.
    type Blob: MappedFlash;

    /// The log's region, if it has one of its own.
    fn log_apart(&self) -> Option<&Self::Log>;

    /// The region with the log.
    fn log(&mut self) -> &mut Self::Log;

    /// The region with the blob.
    fn blob(&self) -> &Self::Blob;

    /// The region with the blob, to write it.
    fn blob_to_write(&mut self) -> &mut Self::Blob;

    /// Where things lie in it.
    #[inline]
    fn shape(&self) -> Shape {
        let blob = self.blob().geometry();
        match self.log_apart() {
            None => Shape::of(blob),
            Some(log) => Shape {
                log: log.geometry(),
                blob,
                is_log_apart: true,
            },
        }
    }

    /// Longest blob, with a manifest of this length, bytes.
    fn max_blob(&self, manifest_length: u32) -> u32 {
        let region = self.blob().capacity() as u32;
        self.shape().max_blob(region, manifest_length)
    }
}

impl<R: MappedFlash> SlotFlash for R {
    type Log = R;
    type Blob = R;

    #[inline]
    fn log_apart(&self) -> Option<&R> {
        None
    }

    #[inline]
    fn log(&mut self) -> &mut R {
        self
    }

    #[inline]
    fn blob(&self) -> &R {
        self
    }

    #[inline]
    fn blob_to_write(&mut self) -> &mut R {
        self
    }
}

/// A slot whose log lies in a region of its own, such as a small sector, where the blob's are large.
#[derive(Debug)]
pub struct SplitSlot<L, B> {
    /// Flash for the log, which need not be mapped: at least [`Shape::log_length`] bytes.
    pub log: L,
    /// Flash for the blob.
    pub blob: B,
}

impl<L: Flash, B: MappedFlash> SlotFlash for SplitSlot<L, B> {
    type Log = L;
    type Blob = B;

    #[inline]
    fn log_apart(&self) -> Option<&L> {
        Some(&self.log)
    }

    #[inline]
    fn log(&mut self) -> &mut L {
        &mut self.log
    }

    #[inline]
    fn blob(&self) -> &B {
        &self.blob
    }

    #[inline]
    fn blob_to_write(&mut self) -> &mut B {
        &mut self.blob
    }
}
