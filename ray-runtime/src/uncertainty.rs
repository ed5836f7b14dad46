//! How uncertain a triangulated point is: what the calibration leaves open, and the noise of the
//! two pixels.
//!
//! Both are said as a covariance of pixels, and one derivative of the point by the four pixel
//! coordinates carries them to millimeters: `J (L L^T + noise I) J^T`. The factor L comes from the
//! coarse grid of the pair, J from the control grids that the rays come from. Plain f32
//! multiplications and additions in a fixed order: every target gives the same bits.

use crate::PixelPoint;
use crate::format::{
    self, MAX_MAGNITUDE, MAX_NODES, MAX_STEP_PX, NODE_LEN, PairHeader, TRIANGLE, is_moderate,
};
use crate::match_noise::MatchNoise;
use crate::triangulate::Triangulation;
use crate::vector::Vector;

/// Covariance of a triangulated point, rig frame; matrices are symmetric.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PointCovariance {
    /// From what the calibration leaves uncertain, mm^2. The same for every measurement with the
    /// same pixels: no averaging makes it smaller.
    pub calibration_mm2: [[f32; 3]; 3],
    /// From the noise of the measured pixels, mm^2.
    pub noise_mm2: [[f32; 3]; 3],
    /// Variance of the gap with its sign, from both together, mm^2. A gap whose square is often much more
    /// says that the rig is no longer the calibrated one, or that pixels are noisier than they were taken
    /// to be.
    pub gap_mm2: f32,
}

impl PointCovariance {
    /// Both together, mm^2.
    pub fn total_mm2(&self) -> [[f32; 3]; 3] {
        let mut total = self.calibration_mm2;
        for (sum, noise) in total
            .as_flattened_mut()
            .iter_mut()
            .zip(self.noise_mm2.as_flattened())
        {
            *sum += noise;
        }
        total
    }

    /// Standard deviation along x, y and z of the rig frame, mm.
    pub fn sigma_mm(&self) -> [f32; 3] {
        let [[xx, _, _], [_, yy, _], [_, _, zz]] = self.total_mm2();
        [xx, yy, zz].map(libm::sqrtf)
    }
}

/// A triangulated point with what is known of its error.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Measurement {
    /// The point and the gap.
    pub found: Triangulation,
    /// The gap's sign: whether the second ray passes the first one on the side that the product of the
    /// two directions, first by second, points to. For two cameras side by side, the first one on the
    /// left, that is the upper side in the image.
    pub is_second_above: bool,
    /// `None` where the blob carries no uncertainty of the two cameras.
    pub covariance: Option<PointCovariance>,
}

impl Measurement {
    /// The gap with its sign, mm: positive if the second ray is above
    /// ([`is_second_above`](Self::is_second_above)). Noise gives both signs alike, a rig that has moved
    /// does not.
    pub fn signed_gap_mm(&self) -> f32 {
        let gap_mm = self.found.gap_mm();
        if self.is_second_above {
            gap_mm
        } else {
            -gap_mm
        }
    }
}

/// The uncertainty of one pair, borrowed from the blob.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pair<'a> {
    pub header: PairHeader,
    nodes: &'a [u8],
}

impl<'a> Pair<'a> {
    /// The pair at the start of `bytes` and the bytes behind its padding; `None` if there are too
    /// few bytes.
    pub fn read(bytes: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let (header, _) = PairHeader::read(bytes)?;
        let length = header.section_len();
        let nodes = bytes.get(format::PAIR_HEADER_LEN..length)?;
        Some((
            Self { header, nodes },
            bytes.get(format::aligned(length)..)?,
        ))
    }

    /// Whether all of the header is in range for this many cameras. Nodes cannot be out of range.
    pub fn is_valid(&self, camera_count: u16) -> bool {
        let header = &self.header;
        let [first, second] = header.cameras;
        let is_count = |count: &u16| (2..=MAX_NODES).contains(count);
        // NaN is in no range.
        let is_density = |x: &f32| *x > 0.0 && *x <= MAX_MAGNITUDE;
        first < second
            && second < camera_count
            && header.nodes.iter().all(is_count)
            && header.first_px.into_iter().all(is_moderate)
            && header.nodes_per_px.iter().all(is_density)
            && (0.0..=MAX_STEP_PX).contains(&header.step_px)
            && (0.0..=MAX_MAGNITUDE).contains(&header.noise_px2)
    }

    /// The factor at a pixel of the first camera, row by row, px: linear between nodes, and beyond
    /// the outer ones their value. `None` cannot happen in a blob that was opened.
    fn factor_px(&self, pixel: PixelPoint) -> Option<[f32; TRIANGLE]> {
        let header = &self.header;
        let [first_u, first_v] = header.first_px;
        let [density_u, density_v] = header.nodes_per_px;
        let (i, a) = place((pixel.u - first_u) * density_u, header.nodes[0]);
        let (j, b) = place((pixel.v - first_v) * density_v, header.nodes[1]);
        let row = usize::from(header.nodes[0]) * NODE_LEN;
        let start = j * row + i * NODE_LEN;
        let (near, far) = (self.along_u(start, a)?, self.along_u(start + row, a)?);
        let mut factor = near;
        for (value, far) in factor.iter_mut().zip(far) {
            *value = (*value + b * (far - *value)) * header.step_px;
        }
        Some(factor)
    }

    /// Between the node that starts at byte `start` and the next one, in steps.
    fn along_u(&self, start: usize, share: f32) -> Option<[f32; TRIANGLE]> {
        let [near, far] = [start, start + NODE_LEN].map(|at| self.node(at));
        let (mut value, far) = (near?, far?);
        for (value, far) in value.iter_mut().zip(far) {
            *value += share * (far - *value);
        }
        Some(value)
    }

    /// The node that starts at a byte, in steps: exact in f32.
    fn node(&self, start: usize) -> Option<[f32; TRIANGLE]> {
        let (node, _) = self.nodes.get(start..)?.split_first_chunk::<NODE_LEN>()?;
        let [scale, numbers @ ..] = *node;
        Some(numbers.map(|number| f32::from(i16::from(number.cast_signed()) * i16::from(scale))))
    }

    /// The covariance of a point: `by_pixels` says how it moves with the u and v of the pair's
    /// first camera and of its second one, mm/px. `gap_by_pixels` says it of the gap, in units whose
    /// square is `gap_scale`. Pixels are as noisy as the calibration's corners unless `noise` says other.
    pub fn covariance(
        &self,
        pixel: PixelPoint,
        by_pixels: &[Vector; 4],
        gap_by_pixels: [f32; 4],
        gap_scale: f32,
        noise: Option<MatchNoise>,
    ) -> Option<PointCovariance> {
        let [l11, l21, l22, l31, l32, l33, l41, l42, l43, l44] = self.factor_px(pixel)?;
        let [a, b, c, d] = *by_pixels;
        let columns = [
            a * l11 + b * l21 + c * l31 + d * l41,
            b * l22 + c * l32 + d * l42,
            c * l33 + d * l43,
            d * l44,
        ];
        let [e, f, g, h] = gap_by_pixels;
        let gap_columns = [
            e * l11 + f * l21 + g * l31 + h * l41,
            f * l22 + g * l32 + h * l42,
            g * l33 + h * l43,
            h * l44,
        ];
        let squares = |[a, b, c, d]: [f32; 4]| a * a + b * b + c * c + d * d;
        let noise_px2 = noise.map_or(self.header.noise_px2, MatchNoise::px2);
        Some(PointCovariance {
            calibration_mm2: sum_of_squares(&columns, 1.0),
            noise_mm2: sum_of_squares(by_pixels, noise_px2),
            gap_mm2: (squares(gap_columns) + squares(gap_by_pixels) * noise_px2) * gap_scale,
        })
    }
}

/// `sum of a a^T` times a factor: never negative along any direction, up to round-off.
fn sum_of_squares(columns: &[Vector; 4], factor: f32) -> [[f32; 3]; 3] {
    let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
    for a in columns {
        xx += a.x * a.x;
        xy += a.x * a.y;
        xz += a.x * a.z;
        yy += a.y * a.y;
        yz += a.y * a.z;
        zz += a.z * a.z;
    }
    let [xx, xy, xz, yy, yz, zz] = [xx, xy, xz, yy, yz, zz].map(|sum| sum * factor);
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
}

/// The node before a position and the share of the way to the next one, 0 to 1. A position that is
/// not a number counts as the first node.
fn place(position: f32, nodes: u16) -> (usize, f32) {
    // Saturating: below zero is zero.
    let node = (position as u32).min(u32::from(nodes.saturating_sub(2)));
    let share = position - node as f32;
    let share = if share > 0.0 { share } else { 0.0 };
    (node as usize, if share < 1.0 { share } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_stay_between_the_outer_nodes() {
        assert_eq!(place(2.25, 8), (2, 0.25));
        assert_eq!(place(0.0, 8), (0, 0.0));
        assert_eq!(place(7.0, 8), (6, 1.0));
        assert_eq!(place(-3.0, 8), (0, 0.0));
        assert_eq!(place(1e30, 8), (6, 1.0));
        assert_eq!(place(f32::NAN, 8), (0, 0.0));
        assert_eq!(place(0.5, 2), (0, 0.5));
    }

    /// 2 x 2 nodes, the last of which is twice the others, over pixels 10 to 20.
    fn pair(nodes: &[u8]) -> Pair<'_> {
        Pair {
            header: PairHeader {
                cameras: [0, 1],
                nodes: [2, 2],
                first_px: [10.0, 10.0],
                nodes_per_px: [0.1, 0.1],
                step_px: 0.01,
                noise_px2: 0.25,
            },
            nodes,
        }
    }

    #[test]
    fn numbers_of_a_node_are_signed_and_scaled_and_blend_linearly() {
        // Rows: 3; -1 2; 0 0 1; 0 0 0 127. Times 10 steps of 0.01 px.
        let node = [10, 3, 0xff, 2, 0, 0, 1, 0, 0, 0, 127];
        let mut nodes = [node, node, node, node].concat_nodes();
        nodes[3 * NODE_LEN] = 20;
        let pair = pair(&nodes);
        let at = |u, v| pair.factor_px(PixelPoint::new(u, v)).unwrap();
        let first = at(10.0, 10.0);
        for (value, expected) in first
            .into_iter()
            .zip([0.3, -0.1, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 12.7])
        {
            assert!((value - expected).abs() < 1e-6, "{first:?}");
        }
        assert_eq!(at(0.0, 1e9)[0], first[0]);
        // A quarter of the second node's excess in the middle; all of it at its place and beyond.
        assert!((at(15.0, 15.0)[0] - 0.375).abs() < 1e-6);
        assert!((at(20.0, 20.0)[0] - 0.6).abs() < 1e-6);
        assert_eq!(at(99.0, 99.0), at(20.0, 20.0));
    }

    trait Concat {
        fn concat_nodes(self) -> [u8; 4 * NODE_LEN];
    }

    impl Concat for [[u8; NODE_LEN]; 4] {
        fn concat_nodes(self) -> [u8; 4 * NODE_LEN] {
            core::array::from_fn(|k| self[k / NODE_LEN][k % NODE_LEN])
        }
    }

    #[test]
    fn pixels_that_go_together_move_a_point_together() {
        // Both cameras' u are off by the same 0.3 px: the columns of J cancel where the point
        // depends on their difference, and noise knows nothing of that.
        let node = [10, 3, 0, 0, 3, 0, 0, 0, 0, 0, 0];
        let nodes = [node; 4].concat_nodes();
        let by_u = Vector::new(2.0, 0.0, 0.0);
        let zero = Vector::ZERO;
        let by_pixels = [by_u, zero, -by_u, zero];
        let pixel = PixelPoint::new(12.0, 18.0);
        let by_gap = [1.0, 2.0, -1.0, 2.0];
        let found = pair(&nodes).covariance(pixel, &by_pixels, by_gap, 0.5, None);
        let found = found.unwrap();
        // Noise: 10 of 0.25 px^2; of the calibration nothing but the first row's difference.
        assert_eq!(found.gap_mm2, 0.5 * 10.0 * 0.25);
        assert_eq!(found.calibration_mm2, [[0.0; 3]; 3]);
        // 2 coordinates of 0.25 px^2, 2 mm/px each.
        assert_eq!(found.noise_mm2[0][0], 2.0);
        assert_eq!(found.sigma_mm(), [libm::sqrtf(2.0), 0.0, 0.0]);
        // Matches of twice the noise: four times its part, and the calibration's as before.
        let noise = MatchNoise::from_px(1.0);
        let noisy = pair(&nodes).covariance(pixel, &by_pixels, by_gap, 0.5, noise);
        let noisy = noisy.unwrap();
        assert_eq!(noisy.noise_mm2[0][0], found.noise_mm2[0][0] * 4.0);
        assert_eq!(noisy.gap_mm2, found.gap_mm2 * 4.0);
        assert_eq!(noisy.calibration_mm2, found.calibration_mm2);
        let same = [by_u, zero, by_u, zero];
        let found = pair(&nodes).covariance(pixel, &same, [1.0, 0.0, 1.0, 0.0], 1.0, None);
        let found = found.unwrap();
        assert!((found.calibration_mm2[0][0] - 1.44).abs() < 1e-5);
        // Twice 0.3 px together, and twice 0.25 px^2.
        assert!((found.gap_mm2 - 0.86).abs() < 1e-5);
    }

    #[test]
    fn what_is_out_of_range_is_not_valid() {
        let nodes = [0; 4 * NODE_LEN];
        let good = pair(&nodes);
        assert!(good.is_valid(2));
        assert!(!good.is_valid(1));
        let spoils: [fn(&mut PairHeader); 11] = [
            |h| h.cameras = [1, 0],
            |h| h.cameras = [1, 1],
            |h| h.nodes[0] = 1,
            |h| h.nodes[1] = 65,
            |h| h.first_px[0] = f32::NAN,
            |h| h.nodes_per_px[1] = 0.0,
            |h| h.nodes_per_px[0] = f32::INFINITY,
            |h| h.step_px = -0.1,
            |h| h.step_px = 1.5,
            |h| h.noise_px2 = f32::NAN,
            |h| h.noise_px2 = -1.0,
        ];
        for (k, spoil) in spoils.into_iter().enumerate() {
            let mut bad = good;
            spoil(&mut bad.header);
            assert!(!bad.is_valid(2), "number {k}");
        }
    }
}
