//! Suspicions: which effects of which views would go together under common numbers.

use super::effects::{COUNT, Effect};
use crate::adjust::Observations;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// What is suspected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Suspect {
    /// The board's squares are longer one way than the other.
    BoardScale,
    /// The same, and rows do not stand on columns at a right angle.
    BoardShear,
    /// The board's shape is another one in every pose.
    BoardFlexes,
    /// Pixels of one camera, or of all, count from another origin in some poses.
    Shift {
        /// Which; `None` means all.
        camera_idx: Option<usize>,
    },
    /// Another focal length in some poses.
    Focus {
        /// Which; `None` means all, by the same share.
        camera_idx: Option<usize>,
    },
    /// One camera turned in some poses.
    Turned {
        /// Which.
        camera_idx: usize,
    },
    /// One camera turned and moved in some poses.
    Moved {
        /// Which.
        camera_idx: usize,
    },
    /// The distance between two cameras changed.
    Baseline {
        /// The second of them.
        camera_idx: usize,
    },
    /// One camera saw the board after a motion, another one in every pose.
    Late {
        /// Which.
        camera_idx: usize,
    },
    /// Lines of an image exposed one after the other while the board moved.
    RollingShutter,
}

/// Poses by their indices in which things are otherwise than in the rest: than at the end, unless it
/// says so.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Since {
    /// It is not a matter of time.
    Always,
    /// All before this index.
    Before(usize),
    /// All from this index on: told as what is otherwise in them.
    From(usize),
}

impl Since {
    /// Whether a pose is one of them.
    pub fn holds(&self, pose_idx: usize) -> bool {
        match self {
            Self::Always => true,
            Self::Before(end) => pose_idx < *end,
            Self::From(start) => pose_idx >= *start,
        }
    }
}

/// A number of a suspicion: effects of views (`view * COUNT + effect`), each with its share.
pub type Number = Vec<(usize, f64)>;

/// A suspicion.
#[derive(Debug, Clone, PartialEq)]
pub struct Suspicion {
    /// What.
    pub suspect: Suspect,
    /// When.
    pub since: Since,
    /// Its numbers.
    pub numbers: Vec<Number>,
    /// Size of a unit of each number, see [`Effect::unit`].
    pub units: Vec<f64>,
    /// Number of alternatives of the same kind that were looked at: in how many places it could
    /// have been found by chance.
    pub alternatives: f64,
}

impl Suspicion {
    /// One or more numbers that are the same in all views of some cameras and poses.
    pub fn common(
        observations: &Observations,
        suspect: Suspect,
        since: Since,
        cameras: Option<usize>,
        effects: &[Effect],
    ) -> Self {
        // What was otherwise before is told as the change since then.
        let share = match since {
            Since::Always | Since::From(_) => 1.0,
            Since::Before(_) => -1.0,
        };
        let views: Vec<usize> = of_camera(observations, cameras)
            .filter(|view| since.holds(observations.views[*view].pose_idx))
            .collect();
        let number = |effect: &Effect| -> Number {
            let places = views.iter().map(|view| view * COUNT + effect.place());
            places.map(|place| (place, share)).collect()
        };
        Self {
            suspect,
            since,
            numbers: effects.iter().map(number).collect(),
            units: effects.iter().map(|effect| effect.unit()).collect(),
            alternatives: 1.0,
        }
    }

    /// The same for each camera with numbers of its own.
    pub fn each_camera(
        observations: &Observations,
        suspect: Suspect,
        since: &Since,
        effects: &[Effect],
    ) -> Self {
        let cameras = 0..observations.sensors.len();
        let mut parts =
            cameras.map(|k| Self::common(observations, suspect, since.clone(), Some(k), effects));
        let first = parts.next();
        parts.fold(
            first.unwrap_or_else(|| Self::common(observations, suspect, since.clone(), None, &[])),
            |mut all, part| {
                all.numbers.extend(part.numbers);
                all.units.extend(part.units);
                all
            },
        )
    }

    /// Numbers of their own for every pose (of one camera's views, or of all), or for every view.
    pub fn every(
        observations: &Observations,
        suspect: Suspect,
        cameras: Option<usize>,
        effects: &[Effect],
        per_view: bool,
    ) -> Self {
        let mut numbers: Vec<Number> = Vec::new();
        let views: Vec<usize> = of_camera(observations, cameras).collect();
        let groups: Vec<Vec<usize>> = if per_view {
            views.iter().map(|view| vec![*view]).collect()
        } else {
            let poses = 0..observations.poses.len();
            let in_pose = |pose: usize| -> Vec<usize> {
                let views = views.iter().copied();
                views
                    .filter(|v| observations.views[*v].pose_idx == pose)
                    .collect()
            };
            poses
                .map(in_pose)
                .filter(|group| !group.is_empty())
                .collect()
        };
        for group in &groups {
            for effect in effects {
                let places = group.iter().map(|view| view * COUNT + effect.place());
                numbers.push(places.map(|place| (place, 1.0)).collect());
            }
        }
        let units = effects.iter().map(|effect| effect.unit());
        Self {
            suspect,
            since: Since::Always,
            units: units.cycle().take(numbers.len()).collect(),
            numbers,
            alternatives: 1.0,
        }
    }

    /// The same suspicion of some poses only.
    pub fn only(mut self, observations: &Observations, since: Since) -> Self {
        let is_meant = |number: &Number| {
            let views = number.iter().map(|(place, _)| place / COUNT);
            let mut poses = views.map(|view| observations.views[view].pose_idx);
            poses.all(|pose| since.holds(pose))
        };
        let kept: Vec<bool> = self.numbers.iter().map(is_meant).collect();
        let mut keep = kept.iter();
        self.numbers.retain(|_| keep.next() == Some(&true));
        let mut keep = kept.iter();
        self.units.retain(|_| keep.next() == Some(&true));
        self.since = since;
        self
    }

    /// What numbers (in units) do to a view: the size of each effect, as [`super::effects::Effect::unit`] has it.
    pub fn sizes(&self, view_idx: usize, numbers: &[f64]) -> [f64; COUNT] {
        let mut sizes = [0.0; COUNT];
        for ((number, unit), size) in self.numbers.iter().zip(&self.units).zip(numbers) {
            for (place, share) in number.iter().filter(|(place, _)| place / COUNT == view_idx) {
                sizes[place % COUNT] += share * unit * size;
            }
        }
        sizes
    }

    /// A change of the distance between a camera and the first one, along the line between them
    /// (`direction`, in the camera's own axes).
    pub fn baseline(
        observations: &Observations,
        camera_idx: usize,
        since: Since,
        direction: &Vector3<f64>,
    ) -> Self {
        let suspect = Suspect::Baseline { camera_idx };
        let effects = [Effect::MoveX, Effect::MoveY, Effect::MoveZ];
        let three = Self::common(observations, suspect, since, Some(camera_idx), &effects);
        let weighted = three.numbers.iter().zip(direction.iter());
        let number = weighted
            .flat_map(|(number, part)| number.iter().map(move |(at, share)| (*at, share * part)))
            .collect();
        Self {
            numbers: vec![number],
            units: vec![Effect::MoveX.unit()],
            ..three
        }
    }
}

fn of_camera(
    observations: &Observations,
    camera_idx: Option<usize>,
) -> impl Iterator<Item = usize> + '_ {
    let views = observations.views.iter().enumerate();
    views
        .filter(move |(_, view)| camera_idx.is_none_or(|k| view.camera_idx == k))
        .map(|(idx, _)| idx)
}
