//! Which forms of `export` are folders for other tools.

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
