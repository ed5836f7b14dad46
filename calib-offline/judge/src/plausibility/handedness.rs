//! Which way rows and columns turn in each view. Seen on its printed face, columns count to the right
//! and rows down, and so they turn as u and v do; labels or pixels that are mirrored turn the other way.

use super::look::Look;
use calib_estimate::adjust::observations::ObservedCorner;
use calib_recording::dataset::ExpectedOptics;
use calib_recording::detect::turning::turns_like_image;

/// Which way the labels turn.
pub struct Hands {
    /// Per view of the observations: whether the labels turn as the optics ought to show them;
    /// `None` if the corners do not say.
    pub of_view: Vec<Option<bool>>,
    /// Per camera: whether most of its views do; `None` without any that says.
    of_camera: Vec<Option<bool>>,
}

impl Hands {
    /// Looks at all views.
    pub fn of(look: &Look<'_>) -> Self {
        let views = &look.observations.views;
        let in_mirror = |camera_idx: usize| {
            look.dataset.cameras[camera_idx].optics == Some(ExpectedOptics::Mirror)
        };
        let of_view: Vec<Option<bool>> = views
            .iter()
            .map(|view| {
                let corners: Vec<_> = view.corners.iter().map(ObservedCorner::labelled).collect();
                Some(turns_like_image(&corners)? != in_mirror(view.camera_idx))
            })
            .collect();
        let of_camera = (0..look.dataset.cameras.len())
            .map(|camera_idx| {
                let own = views.iter().zip(&of_view);
                most(
                    own.filter(|(v, _)| v.camera_idx == camera_idx)
                        .map(|(_, h)| *h),
                )
            })
            .collect();
        Self { of_view, of_camera }
    }

    /// Whether the labels of most of a camera's views turn as they ought to.
    pub fn camera(&self, camera_idx: usize) -> bool {
        self.of_camera[camera_idx].unwrap_or(true)
    }

    /// Whether those of all cameras do.
    pub fn any_camera(&self) -> bool {
        self.of_camera.iter().flatten().any(|turns| *turns)
            || self.of_camera.iter().all(Option::is_none)
    }

    /// Views whose labels turn the other way than those of most views of their camera.
    pub fn odd_views<'a>(&'a self, look: &'a Look<'_>) -> impl Iterator<Item = usize> + 'a {
        let views = look.observations.views.iter().enumerate();
        views
            .filter(|(k, view)| {
                self.of_view[*k].is_some_and(|turns| turns != self.camera(view.camera_idx))
            })
            .map(|(k, _)| k)
    }
}

/// What most say.
fn most(all: impl Iterator<Item = Option<bool>>) -> Option<bool> {
    let (mut yes, mut no) = (0usize, 0usize);
    for says in all.flatten() {
        if says {
            yes += 1;
        } else {
            no += 1;
        }
    }
    (yes + no > 0).then_some(yes >= no)
}
