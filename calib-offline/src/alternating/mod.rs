//! The published procedure.

pub mod alternation;
pub mod k_means;
pub mod line_fit;
pub mod mixing;
pub mod network;
pub mod plane_map;
pub mod pose_step;
pub mod stage_circle;
pub mod stereo;
pub mod truncated;

use crate::adjust::Observations;
use crate::board::BoardShape;
use crate::field::RayField;
use crate::geometry::{PixelPoint, Ray, RigidTransform, SensorSize};
use crate::init::view_fit::fit_view;
use alternation::{Alternated, AlternationSettings, PixelControl, alternate, ray_of};
use nalgebra::Vector3;
use plane_map::{NetworkSettings, PlaneMap};
use rayon::prelude::*;

pub struct Experiment {
    pub maps: Vec<Vec<Option<PlaneMap>>>,
    pub poses: Vec<Vec<Option<RigidTransform>>>,
    pub alternated: Vec<Alternated>,
}

pub fn train(observations: &Observations, settings: &NetworkSettings) -> Vec<Vec<Option<PlaneMap>>> {
    let mut maps: Vec<Vec<Option<PlaneMap>>> =
        vec![vec![None; observations.poses.len()]; observations.sensors.len()];
    let trained: Vec<_> = observations
        .views
        .par_iter()
        .map(|view| PlaneMap::train(&view.corners, settings))
        .collect();
    for (view, map) in observations.views.iter().zip(trained) {
        maps[view.camera_idx][view.pose_idx] = map;
    }
    maps
}

pub fn start_poses(observations: &Observations, fields: &[RayField]) -> Vec<Vec<Option<RigidTransform>>> {
    let mut poses = vec![vec![None; observations.poses.len()]; observations.sensors.len()];
    for view in &observations.views {
        poses[view.camera_idx][view.pose_idx] = fit_view(
            &fields[view.camera_idx],
            &observations.board,
            &BoardShape::default(),
            view,
        )
        .map(|fit| fit.camera_from_board);
    }
    poses
}

pub fn control(maps: &[Option<PlaneMap>], pixel: PixelPoint) -> PixelControl {
    PixelControl {
        pixel,
        boards: maps
            .iter()
            .enumerate()
            .filter_map(|(k, map)| Some((k, map.as_ref()?.board_point(pixel)?)))
            .collect(),
    }
}

pub fn lattice(sensor: SensorSize, spacing_px: f64) -> Vec<PixelPoint> {
    let count = |extent: u32| (f64::from(extent) / spacing_px).floor() as u32;
    let (nu, nv) = (count(sensor.width), count(sensor.height));
    (0..nv)
        .flat_map(|j| {
            (0..nu).map(move |i| {
                PixelPoint::new((f64::from(i) + 0.5) * spacing_px, (f64::from(j) + 0.5) * spacing_px)
            })
        })
        .collect()
}

impl Experiment {
    pub fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        let c = control(&self.maps[camera_idx], pixel);
        let min: usize = std::env::var("MINP").map_or(3, |v| v.parse().unwrap());
        let sd: f64 = std::env::var("MINSD").map_or(0.0, |v| v.parse().unwrap());
        let r = ray_of(&c, &self.poses[camera_idx], min)?;
        let pts = alternation::control_points(&c, &self.poses[camera_idx]);
        let s: f64 = (pts.iter().map(|p| (p.2 - r.origin_mm).norm_squared()).sum::<f64>() / pts.len() as f64).sqrt();
        (s > sd).then_some(Ray { origin_mm: r.origin_mm - r.direction * 250.0, direction: r.direction })
    }
}

/// order: 0 unfused; 1 fuse before, per camera alternation; 2 fuse before, joint alternation; 3 unfused alternation then fuse
pub fn experiment(
    observations: &Observations,
    fields: &[RayField],
    network: &NetworkSettings,
    sweeps: usize,
    order: usize,
) -> Experiment {
    let maps = train(observations, network);
    let mut poses = start_poses(observations, fields);
    if std::env::var("PINHOLE").is_ok() {
        for (c, p) in poses.iter_mut().enumerate() {
            let s = crate::pinhole::Settings { loss: crate::pinhole::Loss::StudentT, ..Default::default() };
            let fit = crate::pinhole::calibrate_camera(observations, c, &s).unwrap();
            *p = fit.camera_from_board;
        }
    }
    let board = observations.board;
    let corners: Vec<Vector3<f64>> = [(0, 0), (0, board.cols - 1), (board.rows - 1, 0), (board.rows - 1, board.cols - 1)]
        .map(|(r, c)| board.corner_in_board(r, c))
        .into();
    let middle = board.center_in_board();
    if let Ok(per) = std::env::var("CIRCLES") {
        let per: usize = per.parse().unwrap();
        for p in &mut poses {
            for chunk in p.chunks_mut(per) {
                let idx: Vec<usize> = (0..chunk.len()).filter(|k| chunk[*k].is_some()).collect();
                let placed: Vec<RigidTransform> = idx.iter().map(|k| chunk[*k].unwrap()).collect();
                if let Some((c, moved)) = stage_circle::project_onto_circles(&placed, &corners) {
                    if sweeps == 0 && order == 0 { eprintln!("radial {:.4} axial {:.4}", c.radial_rms_mm, c.axial_rms_mm); }
                    for (k, m) in idx.iter().zip(moved) { chunk[*k] = Some(m); }
                }
            }
        }
    }
    if std::env::var("PINRIG").is_ok() {
        let mut s = crate::pinhole::RigSettings::default();
        s.adjustment.loss = crate::pinhole::Loss::StudentT;
        let rig = crate::pinhole::calibrate_rig(observations, &s).unwrap();
        poses = vec![rig.first_from_board.clone(); 2];
    }
    // all into the datum frame of camera 0
    let x = stereo::relative_pose(&poses[0], &poses[1], &corners).unwrap();
    for pose in poses[1].iter_mut().flatten() {
        *pose = x * *pose;
    }
    let datum = poses[0][0].unwrap().inverse();
    for pose in poses.iter_mut().flatten().flatten() {
        *pose = datum * *pose;
    }
    let controls: Vec<Vec<PixelControl>> = observations
        .sensors
        .iter()
        .enumerate()
        .map(|(c, sensor)| lattice(*sensor, 48.0).into_iter().map(|p| control(&maps[c], p)).collect())
        .collect();
    let settings = AlternationSettings { sweeps, step_mm: 0.0, mixing: std::env::var("MIX").map_or(0, |v| v.parse().unwrap()) };
    let fuse = |poses: &mut Vec<Vec<Option<RigidTransform>>>| {
        for k in 0..poses[0].len() {
            let both: Vec<RigidTransform> = poses.iter().filter_map(|p| p[k]).collect();
            let mean = stereo::mean_pose(&both, &middle, stereo::Mean::L2);
            for p in poses.iter_mut() {
                p[k] = mean;
            }
        }
    };
    if order == 1 || order == 2 {
        fuse(&mut poses);
    }
    let mut alternated = Vec::new();
    if order == 2 {
        let a = alternate(&[&controls[0], &controls[1]], &poses[0], 0, &settings);
        poses = vec![a.poses.clone(); 2];
        alternated.push(a);
    } else {
        for c in 0..2 {
            let a = alternate(&[&controls[c]], &poses[c], 0, &settings);
            poses[c] = a.poses.clone();
            alternated.push(a);
        }
        if order >= 3 {
            let x = stereo::relative_pose(&poses[0], &poses[1], &corners).unwrap();
            for pose in poses[1].iter_mut().flatten() {
                *pose = x * *pose;
            }
            if order == 4 { fuse(&mut poses); }
        }
    }
    Experiment { maps, poses, alternated }
}
