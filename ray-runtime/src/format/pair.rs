//! The uncertainty of a pair of cameras, as it stands behind the cameras' tables.

/// Bytes of a [`PairHeader`].
pub const PAIR_HEADER_LEN: usize = 32;
/// Bytes of a node: its scale, and the ten numbers of a lower triangle.
pub const NODE_LEN: usize = 11;
/// Numbers of a lower triangle of 4 rows.
pub const TRIANGLE: usize = NODE_LEN - 1;
/// Most nodes along one axis; the fewest are two.
pub const MAX_NODES: u16 = 64;
/// Largest [`PairHeader::step_px`], px: a number of a node then is worth 32640 px at most.
pub const MAX_STEP_PX: f32 = 1.0;

/// What stands in front of the nodes of a pair.
///
/// The nodes are those of a grid over a part of the first camera's sensor. Each is the lower
/// triangle L of a Cholesky factor, px: `L L^T` is the covariance of where the two cameras see one
/// point at the working distance, as far as the calibration leaves it uncertain. Its rows are the
/// first camera's u and v and the second camera's u and v.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairHeader {
    /// Indices of the cameras, the smaller one first.
    pub cameras: [u16; 2],
    /// Nodes along u and v.
    pub nodes: [u16; 2],
    /// Pixel (u, v) of the first node.
    pub first_px: [f32; 2],
    /// Nodes per pixel along u and v.
    pub nodes_per_px: [f32; 2],
    /// The unit of the nodes' numbers, px.
    pub step_px: f32,
    /// Variance of a measured pixel coordinate, px^2.
    pub noise_px2: f32,
}

impl PairHeader {
    /// The header at the start of `bytes`, and what follows it. Nothing is judged. `None` if there
    /// are too few bytes.
    pub fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (b, rest) = bytes.split_first_chunk::<PAIR_HEADER_LEN>()?;
        let number = |k: usize| -> Option<f32> {
            let (bytes, _) = b.get(4 * k..)?.split_first_chunk::<4>()?;
            Some(f32::from_le_bytes(*bytes))
        };
        let header = Self {
            cameras: [
                u16::from_le_bytes([b[0], b[1]]),
                u16::from_le_bytes([b[2], b[3]]),
            ],
            nodes: [
                u16::from_le_bytes([b[4], b[5]]),
                u16::from_le_bytes([b[6], b[7]]),
            ],
            first_px: [number(2)?, number(3)?],
            nodes_per_px: [number(4)?, number(5)?],
            step_px: number(6)?,
            noise_px2: number(7)?,
        };
        Some((header, rest))
    }

    /// The header's bytes.
    pub fn to_bytes(self) -> [u8; PAIR_HEADER_LEN] {
        let integers = self.cameras.into_iter().chain(self.nodes);
        let numbers = self.first_px.into_iter().chain(self.nodes_per_px);
        let numbers = numbers.chain([self.step_px, self.noise_px2]);
        let mut bytes = [0; PAIR_HEADER_LEN];
        let all = integers
            .flat_map(u16::to_le_bytes)
            .chain(numbers.flat_map(f32::to_le_bytes));
        for (place, byte) in bytes.iter_mut().zip(all) {
            *place = byte;
        }
        bytes
    }

    /// Bytes of the section: header and nodes, without the padding behind them.
    pub const fn section_len(&self) -> usize {
        PAIR_HEADER_LEN + self.nodes[0] as usize * self.nodes[1] as usize * NODE_LEN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_where_the_format_says() {
        let header = PairHeader {
            cameras: [1, 2],
            nodes: [8, 6],
            first_px: [-0.5, 19.5],
            nodes_per_px: [0.25, 0.125],
            step_px: 0.001,
            noise_px2: 0.0025,
        };
        let bytes = header.to_bytes();
        assert_eq!(bytes[..8], [1, 0, 2, 0, 8, 0, 6, 0]);
        for (k, number) in [-0.5, 19.5, 0.25, 0.125, 0.001, 0.0025f32]
            .into_iter()
            .enumerate()
        {
            assert_eq!(bytes[8 + 4 * k..12 + 4 * k], number.to_le_bytes());
        }
        assert_eq!(PairHeader::read(&bytes), Some((header, &[][..])));
        assert_eq!(PairHeader::read(&bytes[1..]), None);
        assert_eq!(header.section_len(), 32 + 48 * 11);
    }
}
