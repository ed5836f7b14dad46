//! The images of a simulated dataset.

use super::error::SimulateError;
use super::render::Rendered;
use super::scene::Scene;
use super::settings::{ImageDepth, ImageFiles, OutputSettings};
use super::tables::{marker_table, match_table};
use super::target;
use super::writer::Writer;
use calib_rays::in_order;
use std::path::Path;

/// The board at every pose in every camera; returns how many images.
pub(super) fn write_board_images(
    scene: &Scene,
    output: &OutputSettings,
    writer: &mut Writer,
) -> Result<usize, SimulateError> {
    for name in &scene.names {
        writer.subfolder(name)?;
    }
    let views: Vec<(usize, usize)> = (0..scene.cameras.len())
        .flat_map(|camera_idx| (0..scene.true_poses.len()).map(move |pose| (camera_idx, pose)))
        .collect();
    let folder = &writer.folder;
    let sizes = in_order::try_map(&views, |&(camera_idx, pose)| {
        let image = scene.render_board(camera_idx, pose, &output.render);
        let name = format!("{}/{pose:04}.png", scene.names[camera_idx]);
        write_png(&image, output, &folder.join(name))
    })?;
    writer.byte_count += sizes.iter().sum::<u64>();
    Ok(views.len())
}

/// The ring target at several distances: images, the true centers and their pixels.
pub(super) fn write_target(
    scene: &Scene,
    output: &OutputSettings,
    writer: &mut Writer,
) -> Result<(), SimulateError> {
    writer.subfolder("target")?;
    for name in &scene.names {
        writer.subfolder(&format!("target/{name}"))?;
    }
    let poses = target::target_poses(scene);
    let views: Vec<(usize, usize)> = (0..scene.cameras.len())
        .flat_map(|camera_idx| (0..poses.len()).map(move |pose| (camera_idx, pose)))
        .collect();
    let folder = &writer.folder;
    let sizes = in_order::try_map(&views, |&(camera_idx, pose)| {
        // Streams beyond those of the board's poses.
        let stream = scene.true_poses.len() + pose;
        let image = scene.render_target(camera_idx, &poses[pose], &output.render, stream);
        let name = format!("target/{}/{pose:04}.png", scene.names[camera_idx]);
        write_png(&image, output, &folder.join(name))
    })?;
    writer.byte_count += sizes.iter().sum::<u64>();
    let markers = target::seen_markers(scene, &poses);
    writer.text(
        "target/matches.csv",
        &match_table(
            &scene.names,
            markers
                .iter()
                .map(|marker| (marker.id, &marker.true_pixels[..])),
        ),
    )?;
    writer.text("target/truth.csv", &marker_table(scene, &markers))
}

/// Writes a PNG and returns its size.
fn write_png(image: &Rendered, output: &OutputSettings, path: &Path) -> Result<u64, SimulateError> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    use image::{ExtendedColorType, ImageEncoder};
    let mut bytes = Vec::new();
    let compression = match output.image_files {
        ImageFiles::Small => CompressionType::Best,
        ImageFiles::Quick => CompressionType::Fast,
    };
    let encoder = PngEncoder::new_with_quality(&mut bytes, compression, FilterType::Adaptive);
    let (width, height) = (image.sensor.width, image.sensor.height);
    let result = match output.image_depth {
        ImageDepth::Eight => {
            encoder.write_image(&image.to_u8(), width, height, ExtendedColorType::L8)
        }
        ImageDepth::Sixteen => {
            // The encoder takes native byte order.
            let samples: Vec<u8> = image
                .to_u16()
                .iter()
                .flat_map(|sample| sample.to_ne_bytes())
                .collect();
            encoder.write_image(&samples, width, height, ExtendedColorType::L16)
        }
    };
    result.map_err(|source| SimulateError::Image {
        path: path.to_path_buf(),
        source,
    })?;
    std::fs::write(path, &bytes).map_err(|source| SimulateError::Io {
        path: path.to_path_buf(),
        source,
    })?;
    Ok(bytes.len() as u64)
}
