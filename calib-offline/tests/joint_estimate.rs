//! The joint estimate against simulated rigs whose true rays are known.

use calib_offline::adjust::Observations;
use calib_offline::geometry::{PixelPoint, RigidTransform, so3};
use calib_offline::init::rig::start_rig;
use calib_offline::joint::{Estimate, estimate};
use calib_offline::simulate::{MatchSet, OpticsKind, Scene, SceneSettings};
use nalgebra::{Matrix3, Vector3};

fn run(scene: &Scene) -> Estimate {
    let sensors = scene
        .cameras
        .iter()
        .map(calib_offline::simulate::CameraOptics::sensor)
        .collect();
    let observations = Observations::new(scene.settings.board, sensors, &scene.observe_corners());
    let t = std::time::Instant::now();
    let start = start_rig(&observations).unwrap();
    for (f, m) in start.fields.iter().zip(&start.median_px) {
        println!("start {:?} median {m:.3} px", f.base);
    }
    println!("start took {:?}", t.elapsed());
    estimate(&observations, &start).unwrap()
}

/// Best rigid placement of `from` on `to`.
fn align(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> RigidTransform {
    let n = from.len() as f64;
    let (a, b) = (
        from.iter().sum::<Vector3<f64>>() / n,
        to.iter().sum::<Vector3<f64>>() / n,
    );
    let h: Matrix3<f64> = from
        .iter()
        .zip(to)
        .map(|(p, q)| (q - b) * (p - a).transpose())
        .sum();
    let rotation = so3::nearest_rotation(&h).unwrap();
    RigidTransform::new(rotation, b - rotation * a)
}

fn rms(differences: impl Iterator<Item = Vector3<f64>>) -> f64 {
    let (sum, count) = differences.fold((0.0, 0.0), |(s, n), d| (s + d.norm_squared(), n + 1.0));
    f64::sqrt(sum / count)
}

fn ratio(scene: &Scene, estimate: &Estimate, set: MatchSet, noisy: bool) -> (f64, f64, f64, usize) {
    let names = ["left".to_string(), "right".to_string()];
    let rig = estimate.rig(&names);
    let (mut measured, mut truth, mut oracle) = (vec![], vec![], vec![]);
    let matches = scene.matches(set, 3000);
    for m in &matches {
        let pixels: &[PixelPoint] = if noisy { &m.pixels } else { &m.true_pixels };
        if let Ok(point) = rig.triangulate(&[(0, pixels[0]), (1, pixels[1])]) {
            measured.push(point.point_mm);
            truth.push(m.point_in_datum);
            oracle.push(m.oracle_in_datum);
        }
    }
    let aligned = align(&measured, &truth);
    let error = rms(measured
        .iter()
        .zip(&truth)
        .map(|(p, q)| aligned.point(p) - q));
    let direct = rms(measured.iter().zip(&truth).map(|(p, q)| p - q));
    let limit = rms(oracle.iter().zip(&truth).map(|(p, q)| p - q));
    (error, direct, limit, matches.len() - measured.len())
}

#[test]
fn explore() {
    for optics in [
        OpticsKind::Brown,
        OpticsKind::Paper,
        OpticsKind::Bumps,
        OpticsKind::Window,
        OpticsKind::Port,
        OpticsKind::Fisheye,
    ] {
        let scene = Scene::new(SceneSettings::standard_noisy(optics, 1)).unwrap();
        let t = std::time::Instant::now();
        let e = run(&scene);
        println!(
            "{optics:?}: {:?} sigma {:.4} nu {} rho {:.3} costs {:?} stop {}",
            t.elapsed(),
            e.noise.variance_px2.sqrt(),
            e.noise.freedom,
            e.neighbor_correlation,
            e.costs,
            e.stop
        );
        for set in [MatchSet::Points, MatchSet::Holdout] {
            let (error, direct, limit, outside) = ratio(&scene, &e, set, true);
            println!(
                "   error {error:.5} direct {direct:.5} oracle {limit:.5} ratio {:.4} / {:.4} outside {outside}",
                error / limit,
                direct / limit
            );
        }
    }
}

#[test]
fn noise_free() {
    for optics in std::env::var("OPTICS")
        .unwrap_or("Brown,Paper,Bumps,Window,Port,Fisheye".into())
        .split(',')
        .map(|name| <OpticsKind as clap::ValueEnum>::from_str(name, true).unwrap())
    {
        let scene = Scene::new(SceneSettings::standard(optics, 1)).unwrap();
        let e = run(&scene);
        println!(
            "{optics:?}: sigma {:.3e} nu {} rho {:.3} costs {:?} stop {}",
            e.noise.variance_px2.sqrt(),
            e.noise.freedom,
            e.neighbor_correlation,
            e.costs,
            e.stop
        );
        for f in &e.smoothness {
            println!("{f:?}");
        }
        for set in [MatchSet::Points, MatchSet::Holdout] {
            let (error, direct, limit, outside) = ratio(&scene, &e, set, false);
            println!(
                "   error {error:.3e} direct {direct:.3e} oracle {limit:.5} outside {outside}"
            );
        }
    }
}
