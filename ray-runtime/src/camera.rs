//! What a blob says of one camera.

use crate::format::{CameraMeta, Encoding, Form, Record};

/// A camera of a blob.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Camera<'a> {
    /// Unique in the blob.
    pub name: &'a str,
    /// Columns of the sensor, px.
    pub sensor_width: u32,
    /// Rows of the sensor, px.
    pub sensor_height: u32,
    /// The part of the sensor that the control grid covers.
    pub region: Region,
    /// How the table is stored, and whether all rays start in one point.
    pub encoding: Encoding,
    /// Cells of the control grid along u and v.
    pub cells: [u32; 2],
    /// Cells of the mask along u and v.
    pub mask_cells: [u32; 2],
    /// Where the camera is.
    pub rig_from_camera: RigFromCamera,
}

/// A rectangle of sensor pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Region {
    /// First column, px.
    pub u: u32,
    /// First row, px.
    pub v: u32,
    /// Columns, px.
    pub width: u32,
    /// Rows, px.
    pub height: u32,
}

/// `point_in_rig = rotation * point_in_camera + translation_mm`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RigFromCamera {
    /// Row by row; orthonormal to f32 round-off.
    pub rotation: [[f32; 3]; 3],
    /// The camera's reference point in the rig frame, mm.
    pub translation_mm: [f32; 3],
}

impl<'a> Camera<'a> {
    pub(crate) fn new(meta: &CameraMeta<'a>, record: Record<'_>) -> Self {
        let [r11, r12, r13, r21, r22, r23, r31, r32, r33] = record.rotation();
        Self {
            name: meta.name,
            sensor_width: meta.sensor_width,
            sensor_height: meta.sensor_height,
            region: Region {
                u: meta.region_u,
                v: meta.region_v,
                width: meta.region_width,
                height: meta.region_height,
            },
            encoding: Encoding::from_number(record.encoding()).unwrap_or(Encoding {
                form: Form::Spline,
                is_central: true,
            }),
            cells: record.cells(),
            mask_cells: record.mask_cells(),
            rig_from_camera: RigFromCamera {
                rotation: [[r11, r12, r13], [r21, r22, r23], [r31, r32, r33]],
                translation_mm: record.translation_mm(),
            },
        }
    }
}
