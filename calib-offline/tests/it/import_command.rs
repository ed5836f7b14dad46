//! `import`: other tools' files become a calibration that every command reads, and what they do not say is asked.

use crate::common::documented::assert_documented;
use crate::common::{contents, run};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("exchange/golden")
}

/// The files of the golden folder `from`, in a folder of their own.
fn folder(from: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(golden().join(from)).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    folder
}

#[test]
fn an_imported_pair_goes_through_every_command() {
    let folder = folder("opencv-stereo");
    let path = folder.path();
    let files = ["left.yml", "right.yml", "extrinsics.yml"];
    let import = [
        &["import"],
        &files[..],
        &["-o", "c.json", "--unit", "mm", "--json"],
    ]
    .concat();
    let imported = run(path, &import);
    imported.assert_code(0);
    let object = imported.json();
    for camera in object["cameras"].as_array().unwrap() {
        // A tenth of what a blob may be off.
        assert!(camera["max_px"].as_f64().unwrap() < 1e-4, "{camera}");
    }
    let with_distance = [&import[..], &["--force", "--distance-mm", "310"]].concat();
    let again = run(path, &with_distance).json();
    assert_documented("import", "calib-offline/import/1", &[object, again], &[]);

    run(path, &["inspect", "c.json"])
        .assert_code(0)
        .assert_prints(&[
            "doubtful",
            "imported",
            "from OpenCV",
            "pinhole, 5 coefficients",
            "no sigma",
        ]);
    run(path, &["pack", "c.json", "-o", "rig.rays"]).assert_code(0);
    // A corner of the board in both images, by OpenCV's own corners.
    let matches = "id,u_left,v_left,u_right,v_right\na,244.4053,94.1369,127.7668,110.4071\n";
    fs::write(path.join("m.csv"), matches).unwrap();
    for rig in ["c.json", "rig.rays"] {
        run(path, &["measure", rig, "m.csv", "-o", "p.csv"]).assert_code(0);
        let points = fs::read_to_string(path.join("p.csv")).unwrap();
        let row: Vec<&str> = points.lines().nth(1).unwrap().split(',').collect();
        assert_eq!((row[5], row[8]), ("", "ok"), "no sigma is known: {points}");
    }
    fs::write(path.join("px.csv"), "id,u,v\n1,320,240\n").unwrap();
    run(
        path,
        &[
            "rays", "c.json", "--camera", "right", "px.csv", "-o", "r.csv",
        ],
    )
    .assert_code(0);
    run(
        path,
        &["export", "c.json", "--format", "opencv", "-o", "out"],
    )
    .assert_code(0);
    let loss: Value =
        serde_json::from_slice(&fs::read(path.join("out.loss.json")).unwrap()).unwrap();
    // OpenCV's own model is found back from the rays.
    assert!(loss["max_px"].as_f64().unwrap() < 1e-4, "{loss}");
    run(path, &["compare", "c.json", "c.json"]).assert_code(0);
    let set = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/stage");
    run(path, &["verify", "c.json", set.to_str().unwrap()])
        .assert_code(2)
        .assert_says(&["imported", "calib-offline audit"]);
}

#[test]
fn every_golden_file_can_be_imported() {
    for peer in ["opencv4", "opencv5", "mrcal"] {
        let folder = folder(peer);
        for name in contents(folder.path()).keys() {
            if name.contains("projections") {
                continue;
            }
            let arguments = [
                "import",
                name,
                "-o",
                "c.json",
                "--force",
                "--distance-mm",
                "500",
                "--json",
            ];
            let imported = run(folder.path(), &arguments);
            imported.assert_code(0);
            let camera = &imported.json()["cameras"][0];
            println!("{peer}/{name}: {} px at most", camera["max_px"]);
            // The polynomials of OpenCV's fold just beyond the corners of the image, and splines of degree two have kinks: there a
            // field may be off by what is printed, and by no more than import lets pass. The others are as smooth as lenses.
            let smooth = [
                "fisheye",
                "pinhole.",
                "stereographic",
                "lonlat",
                "latlon",
                "cahvor",
            ];
            let is_smooth = smooth.iter().any(|smooth| name.contains(smooth));
            let [rms, most] = if is_smooth {
                [1e-5, 1e-4]
            } else {
                [5e-3, 0.05]
            };
            let number = |key: &str| camera[key].as_f64().unwrap();
            assert!(number("max_px") < most, "{peer}/{name}: {camera}");
            assert!(number("rms_px") < rms, "{peer}/{name}: {camera}");
        }
    }
}

#[test]
fn nothing_is_guessed_and_nothing_written() {
    let folder = folder("opencv-stereo");
    let path = folder.path();
    fs::copy(
        golden().join("mrcal/cahvore.cameramodel"),
        path.join("e.cameramodel"),
    )
    .unwrap();
    fs::copy(
        golden().join("colmap/cameras.txt"),
        path.join("cameras.txt"),
    )
    .unwrap();
    let no_size = fs::read_to_string(path.join("left.yml"))
        .unwrap()
        .replace("image_width", "w");
    fs::write(path.join("no_size.yml"), no_size).unwrap();
    fs::write(path.join("text.txt"), "hello").unwrap();
    let before = contents(path);
    for (files, says) in [
        (
            &["left.yml", "right.yml", "extrinsics.yml"][..],
            &["extrinsics.yml", "unit", "--unit mm"][..],
        ),
        (
            &["left.yml", "right.yml"],
            &["where its cameras stand", "--camera NAME"],
        ),
        (&["no_size.yml"], &["no_size.yml", "--size WIDTHxHEIGHT"]),
        (
            &["e.cameramodel"],
            &["do not meet in a point", "--distance-mm"],
        ),
        (
            &["cameras.txt"],
            &["where its cameras stand", "--camera NAME"],
        ),
        (&["text.txt"], &["text.txt", "no calibration in a format"]),
        (&["none.yml"], &["none.yml", "cannot be read"]),
        (&["left.yml", "e.cameramodel"], &["another format"]),
    ] {
        let arguments = [&["import"], files, &["-o", "c.json"]].concat();
        let refused = run(path, &arguments);
        refused
            .assert_code(2)
            .assert_says(says)
            .assert_says(&["error:", "try: "]);
        assert_eq!(contents(path), before, "something was written");
    }
    let one = ["import", "cameras.txt", "-o", "c.json", "--camera", "5"];
    run(path, &one).assert_code(0).assert_prints(&["OPENCV"]);
    // It is not replaced, nor is a file of the user's.
    run(path, &one)
        .assert_code(2)
        .assert_says(&["c.json: exists", "--force"]);
    let onto_input = ["import", "left.yml", "-o", "left.yml", "--force"];
    run(path, &onto_input)
        .assert_code(2)
        .assert_says(&["is what the command reads"]);
}

#[test]
fn corners_become_those_of_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("t.csv"), "cam,frame,id,x,y\nleft,0,7,10.5,20.5\n").unwrap();
    let map = "camera=cam,pose=frame,index=id,u=x,v=y";
    let table = ["import", "t.csv", "-o", "corners.csv", "--columns", map];
    run(path, &table)
        .assert_code(2)
        .assert_says(&["t.csv", "--pixel-origin"]);
    let said = [&table[..], &["--pixel-origin", "0.5"]].concat();
    run(path, &said)
        .assert_code(2)
        .assert_says(&["t.csv", "--board"]);
    let all = [&said[..], &["--board", "6x5", "--json"]].concat();
    let done = run(path, &all);
    done.assert_code(0);
    let corners = fs::read_to_string(path.join("corners.csv")).unwrap();
    assert_eq!(corners, "camera,pose,row,col,u,v\nleft,0,1,2,10,20\n");
    assert_documented(
        "import",
        "calib-offline/import-corners/1",
        &[done.json()],
        &[],
    );
    fs::write(
        path.join("c.vnl"),
        "# filename x y level\nl-1.png 1 2 0\nl-1.png 3 4 0\n",
    )
    .unwrap();
    let vnl = [
        "import",
        "c.vnl",
        "-o",
        "corners.csv",
        "--board",
        "1x2",
        "--force",
    ];
    run(path, &vnl)
        .assert_code(2)
        .assert_says(&["c.vnl", "--images"]);
    run(path, &[&vnl[..], &["--images", "left=l-*.png"]].concat()).assert_code(0);
    let corners = fs::read_to_string(path.join("corners.csv")).unwrap();
    assert_eq!(
        corners,
        "camera,pose,row,col,u,v\nleft,0,0,0,1,2\nleft,0,0,1,3,4\n"
    );
}
