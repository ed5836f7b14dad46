//! Has a device triangulate, several batches under way at once.

use std::collections::VecDeque;

use ray_device::protocol::{MAX_MATCHES, Match, Measured, NoisyMatches, Reply, Request};
use ray_runtime::MatchNoise;

use super::error::unexpected;
use super::{ClientError, DeviceClient};

impl DeviceClient {
    /// Has the device triangulate `matches`; one answer each, in the same order.
    ///
    /// They travel in batches, several of which are under way at once.
    ///
    /// # Errors
    /// [`ClientError`]; [`Refusal::NoBlob`](ray_device::protocol::Refusal::NoBlob) inside it if the device has nothing to measure with. A
    /// match that the device cannot triangulate is no error here but an outcome of its own.
    pub fn measure(&mut self, matches: &[Match]) -> Result<Vec<Measured>, ClientError> {
        self.measure_batches(matches, Request::Measure)
    }

    /// [`DeviceClient::measure`] of pixels that are as noisy as `noise`, whatever the blob says of them.
    ///
    /// # Errors
    /// As for `measure`; [`Refusal::UnknownMessage`](ray_device::protocol::Refusal::UnknownMessage) inside it if the device is too old for this.
    pub fn measure_noisy(
        &mut self,
        matches: &[Match],
        noise: MatchNoise,
    ) -> Result<Vec<Measured>, ClientError> {
        self.measure_batches(matches, |matches| {
            Request::MeasureNoisy(NoisyMatches {
                noise_px: noise.px(),
                matches,
            })
        })
    }

    /// [`DeviceClient::measure`] of points alone, without their standard deviations: a quarter of the device's work.
    ///
    /// # Errors
    /// As for `measure`; [`Refusal::UnknownMessage`](ray_device::protocol::Refusal::UnknownMessage) inside it if the device is too old for this.
    pub fn measure_points(&mut self, matches: &[Match]) -> Result<Vec<Measured>, ClientError> {
        self.measure_batches(matches, Request::MeasurePoints)
    }

    fn measure_batches(
        &mut self,
        matches: &[Match],
        request: impl Fn(heapless::Vec<Match, MAX_MATCHES>) -> Request,
    ) -> Result<Vec<Measured>, ClientError> {
        let mut measured = Vec::with_capacity(matches.len());
        let batch_length = usize::from(self.greeting.max_matches).clamp(1, MAX_MATCHES);
        let window = self.window();
        let mut under_way = VecDeque::with_capacity(window);
        let mut batches = matches.chunks(batch_length);
        loop {
            while under_way.len() < window
                && let Some(batch) = batches.next()
            {
                let batch_on_wire = batch.iter().copied().collect();
                under_way.push_back((self.send(&request(batch_on_wire))?, batch));
            }
            let Some((sequence, batch)) = under_way.pop_front() else {
                break;
            };
            let answers = match self.receive(sequence)? {
                Reply::Measured(answers) => answers,
                reply => return Err(unexpected("measure", &reply)),
            };
            if !answers
                .iter()
                .map(|answer| answer.id)
                .eq(batch.iter().map(|asked| asked.id))
            {
                let found = format!(
                    "{} matches asked, {} answers with other ids",
                    batch.len(),
                    answers.len()
                );
                return Err(ClientError::BadReply {
                    asked: "measure",
                    found,
                });
            }
            measured.extend_from_slice(&answers);
        }
        Ok(measured)
    }
}
