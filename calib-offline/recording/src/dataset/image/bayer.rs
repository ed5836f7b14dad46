//! A color sensor's raw mosaic saved as a gray image: the four places of its 2 x 2 pattern (Bayer 1976) have gains
//! of their own, which look like a texture of single pixels.

use super::GrayImage;
use super::pixels::Pixels;

/// From this difference of the gains on, relative to their mean, an image is a mosaic: noise and texture leave less
/// than a tenth of it in the median over an image.
const LEAST_DIFFERENCE: f64 = 0.02;
/// Share of the blocks that is looked at, the brightest: a board's paper is white where its surroundings have a color.
const BRIGHTEST: usize = 4;
/// Most blocks looked at.
const BLOCKS: usize = 40_000;

/// The image with the gains of its mosaic made equal; `None` if it is no mosaic. Colors of the scene stay as they
/// are seen through the filters: on a gray board nothing is left of the pattern.
pub fn balanced(image: &GrayImage) -> Option<GrayImage> {
    let gains = gains(image)?;
    let width = image.sensor.width as usize;
    let place = |k: usize| (k / width % 2) * 2 + k % width % 2;
    let least = gains.iter().copied().fold(f32::INFINITY, f32::min);
    let values = image.values().enumerate();
    let values = values.map(|(k, value)| value / gains[place(k)]);
    Some(GrayImage {
        pixels: Pixels::fine(values, image.white_level / least),
        ..*image
    })
}

/// Median over the bright 2 x 2 blocks of each place's value over the block's mean: rows first.
fn gains(image: &GrayImage) -> Option<[f32; 4]> {
    let (width, height) = (image.sensor.width as usize, image.sensor.height as usize);
    let (across, down) = (width / 2, height / 2);
    let step = (across * down).div_ceil(BLOCKS).max(1);
    let block = |block: usize| {
        let first = block / across * 2 * width + block % across * 2;
        [first, first + 1, first + width, first + width + 1].map(|k| image.value(k))
    };
    let is_clear = |four: &[f32; 4]| four.iter().all(|value| *value < image.white_level);
    let mut blocks: Vec<[f32; 4]> = (0..across * down)
        .step_by(step)
        .map(block)
        .filter(is_clear)
        .collect();
    let mean = |four: &[f32; 4]| four.iter().sum::<f32>() / 4.0;
    blocks.sort_unstable_by(|a, b| mean(b).total_cmp(&mean(a)));
    blocks.truncate(blocks.len().div_ceil(BRIGHTEST));
    blocks.retain(|four| mean(four) > 0.0);
    let middle = blocks.len() / 2;
    if blocks.is_empty() {
        return None;
    }
    let gains = std::array::from_fn(|place| {
        let mut shares: Vec<f32> = blocks.iter().map(|four| four[place] / mean(four)).collect();
        *shares.select_nth_unstable_by(middle, f32::total_cmp).1
    });
    let differs = |gain: &f32| f64::from((gain - 1.0).abs()) > LEAST_DIFFERENCE;
    let is_mosaic = gains.iter().any(differs) && gains.iter().all(|gain| *gain > 0.0);
    is_mosaic.then_some(gains)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::SensorSize;

    fn scene(gains: [f32; 4]) -> GrayImage {
        let sensor = SensorSize::new(64, 48);
        let values = (0..64 * 48).map(|k| {
            let (u, v) = (k % 64, k / 64);
            let square = if (u / 9 + v / 9) % 2 == 0 {
                40.0
            } else {
                180.0
            };
            square * gains[(v % 2) * 2 + u % 2]
        });
        GrayImage::from_values(sensor, values.collect(), 255.0).unwrap()
    }

    #[test]
    fn gains_of_a_mosaic_are_made_equal_and_a_gray_image_is_none() {
        let found = balanced(&scene([0.55, 1.0, 1.0, 0.7])).unwrap();
        let flat = balanced(&scene([1.0; 4]));
        assert!(flat.is_none());
        // Up to a common factor the scene comes back.
        let factor = found.value(0) / 40.0;
        let plain = scene([1.0; 4]);
        let worst = found.values().zip(plain.values());
        let worst = worst
            .map(|(a, b)| (a / factor - b).abs())
            .fold(0.0, f32::max);
        // To a 65535th of the brightest.
        assert!(worst < 5e-3, "{worst}");
    }

    #[test]
    fn an_image_too_small_or_black_is_none() {
        let one = GrayImage::from_values(SensorSize::new(1, 1), vec![7.0], 255.0).unwrap();
        assert!(balanced(&one).is_none());
        let black = GrayImage::from_values(SensorSize::new(4, 4), vec![0.0; 16], 255.0).unwrap();
        assert!(balanced(&black).is_none());
    }
}
