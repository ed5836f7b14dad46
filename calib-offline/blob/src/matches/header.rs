//! Which columns of `MATCHES.csv` belong to which camera.

use super::error::{HeaderProblem, shortened};

/// The cameras whose pixels the columns after `id` hold, two columns each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Columns {
    /// Indices into the rig's cameras, in column order.
    pub camera_idx: Vec<usize>,
}

impl Columns {
    /// Reads the header against the names of the rig's cameras.
    ///
    /// # Errors
    /// `HeaderProblem`: what is wrong with it.
    pub fn parse(header: &str, cameras: &[String]) -> Result<Self, HeaderProblem> {
        let mut columns = header.split(',').map(str::trim);
        if columns.next() != Some("id") {
            return Err(HeaderProblem::NoId);
        }
        let mut camera_idx: Vec<usize> = Vec::new();
        while let Some(column) = columns.next() {
            let Some(camera) = column.strip_prefix("u_") else {
                return Err(match column.strip_prefix("v_") {
                    Some(camera) => HeaderProblem::NoPair {
                        camera: shortened(camera),
                    },
                    None => HeaderProblem::UnknownColumn {
                        column: shortened(column),
                    },
                });
            };
            if columns.next().and_then(|c| c.strip_prefix("v_")) != Some(camera) {
                return Err(HeaderProblem::NoPair {
                    camera: shortened(camera),
                });
            }
            let idx = cameras
                .iter()
                .position(|name| name == camera)
                .ok_or_else(|| HeaderProblem::UnknownCamera {
                    camera: shortened(camera),
                })?;
            if camera_idx.contains(&idx) {
                return Err(HeaderProblem::CameraTwice {
                    camera: shortened(camera),
                });
            }
            camera_idx.push(idx);
        }
        if camera_idx.len() < 2 {
            return Err(HeaderProblem::TooFewCameras);
        }
        Ok(Self { camera_idx })
    }

    /// Fields of a row.
    pub fn field_count(&self) -> usize {
        1 + 2 * self.camera_idx.len()
    }

    /// The header that names all cameras of a rig.
    pub fn header_for(cameras: &[String]) -> String {
        cameras.iter().fold(String::from("id"), |header, name| {
            header + &format!(",u_{name},v_{name}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(header: &str) -> Result<Vec<usize>, HeaderProblem> {
        let cameras = ["left", "right", "top_2"].map(str::to_owned);
        Columns::parse(header, &cameras).map(|columns| columns.camera_idx)
    }

    #[test]
    fn cameras_may_stand_in_any_order_and_number() {
        assert_eq!(parse("id,u_left,v_left,u_right,v_right"), Ok(vec![0, 1]));
        assert_eq!(
            parse("id, u_top_2, v_top_2, u_left, v_left"),
            Ok(vec![2, 0])
        );
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert_eq!(parse("u_left,v_left"), Err(HeaderProblem::NoId));
        assert_eq!(parse("id,u_left,v_left"), Err(HeaderProblem::TooFewCameras));
        assert_eq!(
            parse("id,u_left,u_right,v_left,v_right"),
            Err(HeaderProblem::NoPair {
                camera: "left".to_owned()
            })
        );
        assert_eq!(
            parse("id,u_left,v_left,u_back,v_back"),
            Err(HeaderProblem::UnknownCamera {
                camera: "back".to_owned()
            })
        );
        assert_eq!(
            parse("id,u_left,v_left,u_left,v_left"),
            Err(HeaderProblem::CameraTwice {
                camera: "left".to_owned()
            })
        );
        assert_eq!(
            parse("id,x,y"),
            Err(HeaderProblem::UnknownColumn {
                column: "x".to_owned()
            })
        );
    }
}
