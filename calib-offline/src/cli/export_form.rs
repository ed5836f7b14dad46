//! The forms of `export`, and what it takes to write each.

use calib_exchange::mesh::MeshFormat;
use clap::ValueEnum;

/// The form to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FormatArg {
    /// Intel HEX
    Hex,
    /// UF2, for bootloaders that show up as a drive
    Uf2,
    /// The bytes of the blob
    Bin,
    /// C source
    C,
    /// What a production line writes into a device's flash, so that it starts with the blob
    SlotImage,
    /// `OpenCV`'s `FileStorage`.
    #[value(name = "opencv", help = "OpenCV's FileStorage, a folder")]
    OpenCv,
    /// Kalibr's `camchain.yaml`.
    #[value(help = "Kalibr's camchain.yaml, a folder")]
    Kalibr,
    /// ROS' `camera_info`.
    #[value(help = "ROS' camera_info, a folder")]
    Ros,
    /// mrcal's pinholes.
    #[value(help = "mrcal's .cameramodel, LENSMODEL_OPENCV, a folder")]
    Mrcal,
    /// mrcal's splined model.
    #[value(help = "mrcal's .cameramodel, splined stereographic, a folder")]
    MrcalSplined,
    /// Maps for `cv::remap`.
    #[value(help = "Maps that undistort each camera, for OpenCV's remap, a folder")]
    Remap,
    /// Maps of a rectified pair.
    #[value(help = "Maps and matrices of a rectified stereo pair, a folder")]
    Rectify,
    /// Undistorted images
    Undistort,
    /// The rays themselves.
    #[value(help = "The ray of every pixel as NumPy arrays, a folder")]
    Npy,
    /// TI's LDC.
    #[value(help = "The offsets of TI's LDC, a folder")]
    MeshTi,
    /// NXP's DW100.
    #[value(help = "The vertices of NXP's DW100, a folder")]
    MeshDw100,
    /// NVIDIA's VPI.
    #[value(help = "The warp map of NVIDIA's VPI, a folder")]
    MeshVpi,
    /// Luxonis' `StereoDepth`.
    #[value(help = "The mesh of Luxonis' StereoDepth, a folder")]
    MeshLuxonis,
    /// An array.
    #[value(help = "A mesh as a NumPy array, a folder")]
    Mesh,
    /// Points as PLY
    Ply,
}

impl FormatArg {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Hex => "hex",
            Self::Uf2 => "uf2",
            Self::Bin => "bin",
            Self::C => "c",
            Self::SlotImage => "slot-image",
            Self::OpenCv => "opencv",
            Self::Kalibr => "kalibr",
            Self::Ros => "ros",
            Self::Mrcal => "mrcal",
            Self::MrcalSplined => "mrcal-splined",
            Self::Remap => "remap",
            Self::Rectify => "rectify",
            Self::Undistort => "undistort",
            Self::Npy => "npy",
            Self::MeshTi => "mesh-ti",
            Self::MeshDw100 => "mesh-dw100",
            Self::MeshVpi => "mesh-vpi",
            Self::MeshLuxonis => "mesh-luxonis",
            Self::Mesh => "mesh",
            Self::Ply => "ply",
        }
    }

    /// What it takes to write it.
    pub(super) const fn kind(self) -> Kind {
        match self {
            Self::Hex => Kind::File(b":02000004"),
            Self::Uf2 => Kind::File(b"UF2\n"),
            Self::Bin => Kind::File(&ray_runtime::format::MAGIC),
            Self::C => Kind::File(b"/* A ray blob"),
            Self::SlotImage => Kind::Slot,
            Self::OpenCv => Kind::Folder(FolderForm::OpenCv),
            Self::Kalibr => Kind::Folder(FolderForm::Kalibr),
            Self::Ros => Kind::Folder(FolderForm::Ros),
            Self::Mrcal => Kind::Folder(FolderForm::Mrcal),
            Self::MrcalSplined => Kind::Folder(FolderForm::MrcalSplined),
            Self::Remap => Kind::Folder(FolderForm::Remap),
            Self::Rectify => Kind::Folder(FolderForm::Rectify),
            Self::Undistort => Kind::Folder(FolderForm::Undistort),
            Self::Npy => Kind::Folder(FolderForm::Npy),
            Self::MeshTi => Kind::Mesh(MeshFormat::Ti),
            Self::MeshDw100 => Kind::Mesh(MeshFormat::Dw100),
            Self::MeshVpi => Kind::Mesh(MeshFormat::Vpi),
            Self::MeshLuxonis => Kind::Mesh(MeshFormat::Luxonis),
            Self::Mesh => Kind::Mesh(MeshFormat::Plain),
            Self::Ply => Kind::Points,
        }
    }
}

/// One file or several.
pub(super) enum Kind {
    /// How every file of the form begins.
    File(&'static [u8]),
    Slot,
    Folder(FolderForm),
    Mesh(MeshFormat),
    Points,
}

/// A form for other tools.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FolderForm {
    OpenCv,
    Kalibr,
    Ros,
    Mrcal,
    MrcalSplined,
    Remap,
    Rectify,
    Undistort,
    Npy,
}
