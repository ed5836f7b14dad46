//! The same conversation over each kind of stream.

use core::convert::Infallible;
use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use super::*;
use crate::io_link::IoLink;

/// Refuses everything, and is over after so many answers.
struct Echo {
    answers: u32,
    most: u32,
}

impl Echo {
    const fn new(most: u32) -> Self {
        Self { answers: 0, most }
    }
}

impl Responder for Echo {
    fn respond(&mut self, _: &Request) -> Reply {
        self.answers += 1;
        Reply::Receiving {
            received: self.answers,
        }
    }

    fn note_refused(&mut self, _: Refusal) {}

    fn is_over(&self) -> bool {
        self.answers >= self.most
    }
}

/// What arrives, some bytes at a time, and what was sent.
struct Line {
    arriving: Vec<u8>,
    at_once: usize,
    sent: Vec<u8>,
    /// Whether the next wait is one: every other is over at once.
    waits: bool,
}

impl Line {
    fn take(&mut self, buffer: &mut [u8]) -> usize {
        let count = self.at_once.min(buffer.len()).min(self.arriving.len());
        for (place, byte) in buffer.iter_mut().zip(self.arriving.drain(..count)) {
            *place = byte;
        }
        count
    }
}

impl embedded_io::ErrorType for Line {
    type Error = Infallible;
}

impl embedded_io::Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        Ok(self.take(buffer))
    }
}

impl embedded_io::Write for Line {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        // No more than it likes to.
        let taken = &bytes[..bytes.len().min(self.at_once)];
        self.sent.extend_from_slice(taken);
        Ok(taken.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl Line {
    /// Pending once, and then not.
    async fn wait(&mut self) {
        core::future::poll_fn(|context| {
            self.waits = !self.waits;
            if self.waits {
                context.waker().wake_by_ref();
                return Poll::Pending;
            }
            Poll::Ready(())
        })
        .await;
    }
}

impl embedded_io_async::Read for Line {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        self.wait().await;
        Ok(self.take(buffer))
    }
}

impl embedded_io_async::Write for Line {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.wait().await;
        embedded_io::Write::write(self, bytes)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

fn run<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
    }
}

/// Requests, noise between them, and bytes that belong to no frame at the end.
fn arriving() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = FrameWriter::new();
    for sequence in 1..=9 {
        bytes.extend_from_slice(writer.seal(sequence, &Request::Status).unwrap());
        bytes.extend_from_slice(&[0, 0, 17, 4]);
        if sequence % 2 == 0 {
            bytes.push(0);
        }
    }
    bytes
}

fn line(at_once: usize) -> Line {
    Line {
        arriving: arriving(),
        at_once,
        sent: Vec::new(),
        waits: false,
    }
}

#[test]
fn a_stream_of_either_kind_gets_the_same_answers() {
    for (at_once, most) in [(1, 99), (7, 99), (64, 99), (7, 3), (1000, 3)] {
        let mut blocking = IoLink(line(at_once));
        let mut asynchronous = line(at_once);
        let (mut a, mut b) = (Session::new(), Session::new());
        let mut ends = Vec::new();
        // Each time a responder is over, another takes its place, until the stream is.
        loop {
            let Ok(found) = a.serve(&mut blocking, &mut Echo::new(most));
            let Ok(expected) = run(b.serve_async(&mut asynchronous, &mut Echo::new(most)));
            assert_eq!(found, expected);
            assert_eq!(blocking.0.sent, asynchronous.sent);
            ends.push(found);
            if found == Paused::Closed {
                break;
            }
        }
        // Nine requests, of which every second after the first comes behind noise and is lost in it.
        let frames = asynchronous.sent.iter().filter(|byte| **byte == 0).count();
        assert!(frames >= 9, "{frames}");
        assert_eq!(ends.len() > 1, most == 3, "{ends:?}");
    }
}
