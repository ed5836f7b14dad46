//! What is predicted of corners whose pixels' noise is not independent: blurred, compressed, interpolated from a color mosaic.

use super::sharp::across;
use super::*;
use image::codecs::jpeg::JpegEncoder;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// How an image comes about from its brightness, row by row of a width.
type Taken = fn(&[f64], usize, &mut dyn FnMut() -> f64) -> Vec<u8>;

fn rounded(values: impl Iterator<Item = f64>) -> Vec<u8> {
    values.map(|v| v.round().clamp(0.0, 255.0) as u8).collect()
}

fn white(light: &[f64], _: usize, noise: &mut dyn FnMut() -> f64) -> Vec<u8> {
    rounded(light.iter().map(|v| v + 2.0 * noise()))
}

/// Noise blurred by 0.8 px, with a standard deviation of 2.
fn smoothed(light: &[f64], width: usize, noise: &mut dyn FnMut() -> f64) -> Vec<u8> {
    let mut blurred: Vec<f64> = light.iter().map(|_| noise()).collect();
    photo::blur(&mut blurred, width, 0.8);
    let rms = (blurred.iter().map(|n| n * n).sum::<f64>() / blurred.len() as f64).sqrt();
    rounded(light.iter().zip(&blurred).map(|(v, n)| v + n * 2.0 / rms))
}

/// Noise of 2, compressed at quality 80.
fn compressed(light: &[f64], width: usize, noise: &mut dyn FnMut() -> f64) -> Vec<u8> {
    let values = white(light, width, noise);
    let mut bytes = Vec::new();
    let (w, h) = (width as u32, (light.len() / width) as u32);
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 80);
    encoder
        .encode(&values, w, h, image::ExtendedColorType::L8)
        .unwrap();
    image::load_from_memory(&bytes)
        .unwrap()
        .into_luma8()
        .into_raw()
}

/// A gray scene through an RGGB mosaic with noise of 2, its colors interpolated bilinearly.
fn demosaiced(light: &[f64], width: usize, noise: &mut dyn FnMut() -> f64) -> Vec<u8> {
    let raw: Vec<f64> = light.iter().map(|v| v + 2.0 * noise()).collect();
    let height = light.len() / width;
    let at = |u: usize, v: usize, du: i64, dv: i64| {
        let u = (u as i64 + du).clamp(0, width as i64 - 1) as usize;
        let v = (v as i64 + dv).clamp(0, height as i64 - 1) as usize;
        raw[v * width + u]
    };
    let mean = |u, v, of: &[(i64, i64)]| {
        of.iter().map(|&(du, dv)| at(u, v, du, dv)).sum::<f64>() / of.len() as f64
    };
    let (row, column) = ([(-1, 0), (1, 0)], [(0, -1), (0, 1)]);
    let cross = [row, column].concat();
    let diagonal = [(-1, -1), (1, -1), (-1, 1), (1, 1)];
    rounded((0..light.len()).map(|k| {
        let (u, v) = (k % width, k / width);
        let here = raw[k];
        let [red, green, blue] = match (u % 2, v % 2) {
            (0, 0) => [here, mean(u, v, &cross), mean(u, v, &diagonal)],
            (1, 0) => [mean(u, v, &row), here, mean(u, v, &column)],
            (0, 1) => [mean(u, v, &column), here, mean(u, v, &row)],
            _ => [mean(u, v, &diagonal), mean(u, v, &cross), here],
        };
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }))
}

/// RMS error per axis, px, and over what the grids and what their fits alone predict.
fn errors(taken: Taken, blur_px: f64) -> [f64; 3] {
    let boards = across(blur_px);
    let each: Vec<Vec<[f64; 3]>> = (0..boards.len())
        .into_par_iter()
        .map(|k| {
            let exact = &boards[k];
            let mut rng = ChaCha8Rng::seed_from_u64(500 + k as u64);
            let mut noise = || StandardNormal.sample(&mut rng);
            let width = exact.sensor.width as usize;
            let values = taken(&exact.brightness(), width, &mut noise);
            let values = values.into_iter().map(f32::from).collect();
            let image = GrayImage::from_values(exact.sensor, values, 255.0).unwrap();
            let raw = ChessTopologicalDetector.detect(&image, &exact.board);
            let grid = FittedGrid::from_raw(&image, &raw[0], &exact.board, 20.0).unwrap();
            let errors = grid.corners.values().flat_map(|corner| {
                let error = exact.error_px(corner.pixel);
                error.map(|e| [e, grid.sigma_px(corner, 0.0), corner.sigma_px])
            });
            errors.collect()
        })
        .collect();
    let all = each.concat();
    let rms = |of: &dyn Fn(&[f64; 3]) -> f64| {
        (all.iter().map(|e| of(e).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
    };
    [rms(&|e| e[0]), rms(&|e| e[0] / e[1]), rms(&|e| e[0] / e[2])]
}

#[test]
fn correlated_noise_is_predicted_to_a_fifth() {
    let kinds: [(&str, Taken); 4] = [
        ("white", white),
        ("smoothed", smoothed),
        ("compressed", compressed),
        ("demosaiced", demosaiced),
    ];
    for blur_px in [0.4, 0.8] {
        for (name, taken) in kinds {
            let [rms_px, of_grid, of_fit] = errors(taken, blur_px);
            println!(
                "{name}, blur {blur_px} px: {rms_px:.4} px RMS per axis, {of_grid:.2} of sigma, {of_fit:.2} of the fits'"
            );
            assert!(
                (0.8..1.25).contains(&of_grid),
                "{name} {blur_px}: {of_grid}"
            );
        }
    }
}
