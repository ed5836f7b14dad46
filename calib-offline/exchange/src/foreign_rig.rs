//! A rig of cameras of another tool, from one or several files.

use crate::content::content;
use crate::foreign::{Content, ForeignCamera, Format};
use crate::read::{ImportError, Problem, ReadOptions};
use calib_rays::geometry::RigidTransform;
use std::path::{Path, PathBuf};

/// Cameras of another tool in one frame.
#[derive(Debug)]
pub struct ForeignRig {
    /// The format of its files.
    pub format: Format,
    /// The files.
    pub files: Vec<PathBuf>,
    /// The cameras.
    pub cameras: Vec<ForeignCamera>,
    /// What else must be known of it, in words.
    pub notes: Vec<String>,
}

/// The format that files of one camera each share, and files of one calibration.
type Group<'a> = (Option<Format>, Vec<(&'a Path, Content)>);

/// How cameras are called, and which are wanted.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Naming {
    /// Names instead of the files', in their order.
    pub names: Option<Vec<String>>,
    /// The only camera wanted.
    pub only: Option<String>,
    /// Whether cameras of which nobody says where they stand will do: each is by itself then.
    pub may_stand_anywhere: bool,
}

impl ForeignRig {
    /// Reads the files of one rig.
    ///
    /// # Errors
    /// [`ImportError`]; nothing is guessed.
    pub fn read(
        files: &[PathBuf],
        options: &ReadOptions,
        naming: &Naming,
    ) -> Result<Self, ImportError> {
        let contents = files.iter().map(|file| {
            let bytes = std::fs::read(file)
                .map_err(|error| Problem::Read(error.to_string()).in_file(file))?;
            Ok((file.as_path(), content(file, &bytes, options)?))
        });
        let contents = contents.collect::<Result<Vec<_>, ImportError>>()?;
        Self::of(contents, naming)
    }

    /// Reads files of several calibrations: a file that holds several cameras is one by itself, the others of one format
    /// are one together. A unit that some of them need is that of these alone: the others' is meters.
    ///
    /// # Errors
    /// [`ImportError`].
    pub fn read_several(
        files: &[PathBuf],
        options: &ReadOptions,
        naming: &Naming,
    ) -> Result<Vec<Self>, ImportError> {
        let read = |file: &PathBuf, options: &ReadOptions| {
            let bytes = std::fs::read(file)
                .map_err(|error| Problem::Read(error.to_string()).in_file(file))?;
            content(file, &bytes, options)
        };
        let mut contents = files
            .iter()
            .map(|file| read(file, options))
            .collect::<Result<Vec<_>, ImportError>>()?;
        if !contents.iter().all(Content::is_in_meters) {
            let in_meters = ReadOptions {
                unit: None,
                ..*options
            };
            for (file, held) in files.iter().zip(&mut contents) {
                if held.is_in_meters() {
                    *held = read(file, &in_meters)?;
                }
            }
        }
        let mut groups: Vec<Group<'_>> = Vec::new();
        for (file, held) in files.iter().zip(contents) {
            let joins = match &held {
                Content::Cameras(held) if held.cameras.len() > 1 => None,
                Content::Cameras(held) => Some(held.format),
                Content::Extrinsics(_) => Some(Format::OpenCv),
            };
            let known = groups
                .iter_mut()
                .find(|(format, _)| joins.is_some() && *format == joins);
            match known {
                Some((_, contents)) => contents.push((file, held)),
                None => groups.push((joins, vec![(file, held)])),
            }
        }
        groups
            .into_iter()
            .map(|(_, contents)| Self::of(contents, naming))
            .collect()
    }

    /// From contents, each with its file.
    pub(crate) fn of(
        contents: Vec<(&Path, Content)>,
        naming: &Naming,
    ) -> Result<Self, ImportError> {
        let mut extrinsics = None;
        let mut found: Option<(Format, PathBuf)> = None;
        let mut rig = Self {
            format: Format::OpenCv,
            files: Vec::new(),
            cameras: Vec::new(),
            notes: Vec::new(),
        };
        for (file, content) in contents {
            rig.files.push(file.to_owned());
            match content {
                Content::Extrinsics(second_from_first) => {
                    if extrinsics.replace((file, second_from_first)).is_some() {
                        return Err(Problem::Apart {
                            other: "the other files".to_owned(),
                            why: "two of them say where the cameras stand",
                        }
                        .in_file(file));
                    }
                }
                Content::Cameras(held) => {
                    if let Some((format, other)) = &found
                        && *format != held.format
                    {
                        return Err(Problem::Apart {
                            other: other.display().to_string(),
                            why: "it has another format",
                        }
                        .in_file(file));
                    }
                    found = Some((held.format, file.to_owned()));
                    rig.format = held.format;
                    rig.cameras.extend(held.cameras);
                    rig.notes.extend(held.notes);
                }
            }
        }
        let file = rig.files.first().cloned().unwrap_or_default();
        if rig.cameras.is_empty() {
            let key = "camera_matrix".to_owned();
            return Err(Problem::Missing { key }.in_file(&file));
        }
        if let Some((file, second_from_first)) = extrinsics {
            let [first, second] = &mut rig.cameras[..] else {
                return Err(Problem::Apart {
                    other: format!("{} cameras", rig.cameras.len()),
                    why: "R and T are those of two",
                }
                .in_file(file));
            };
            first.rig_from_camera = Some(RigidTransform::identity());
            second.rig_from_camera = Some(second_from_first.inverse());
        }
        rig.named(naming).map_err(|problem| problem.in_file(&file))
    }

    fn named(mut self, naming: &Naming) -> Result<Self, Problem> {
        if let Some(names) = &naming.names {
            if names.len() != self.cameras.len() {
                return Err(Problem::Names {
                    given: names.len(),
                    found: self.cameras.len(),
                });
            }
            for (camera, name) in self.cameras.iter_mut().zip(names) {
                camera.name.clone_from(name);
            }
        }
        for (k, camera) in self.cameras.iter().enumerate() {
            if self.cameras[..k].iter().any(|c| c.name == camera.name) {
                return Err(Problem::SameName {
                    name: camera.name.clone(),
                });
            }
        }
        if let Some(only) = &naming.only {
            self.cameras.retain(|camera| camera.name == *only);
            if self.cameras.is_empty() {
                return Err(Problem::Missing { key: only.clone() });
            }
        }
        if let [camera] = &mut self.cameras[..] {
            camera
                .rig_from_camera
                .get_or_insert_with(RigidTransform::identity);
        }
        if !(naming.may_stand_anywhere || self.has_places()) {
            return Err(Problem::NoExtrinsics);
        }
        Ok(self)
    }

    /// Whether the files say where all cameras stand.
    pub fn has_places(&self) -> bool {
        let mut cameras = self.cameras.iter();
        cameras.all(|camera| camera.rig_from_camera.is_some())
    }
}
