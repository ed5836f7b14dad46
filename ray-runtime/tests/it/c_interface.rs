//! The C interface in `c/`: `rays.h` says what the Rust code does, the example gives the bits of Rust on the
//! host and, where a cross compiler is there, on Arm in QEMU, with an FPU and without; a panic would not link.

use ray_runtime::{
    Aligned, EpipolarCurve, LookupError, MatchNoise, MeasureError, Measurement, OpenError,
    PixelPoint, ProjectError, Ray, RayBlob, Readout, ReadoutError, Rounding, SensorWindow, Table,
    Triangulation,
};
use std::path::Path;
use std::process::Command;

use super::c_build::{
    Arm, CORTEX_M0, CORTEX_M4, CORTEX_M4F, WARNINGS, build_for_host, c_folder, made, root, run,
    succeed,
};

static GOLDEN: [(&str, &Aligned<[u8]>); 4] = [
    (
        "stereo-v1.rays",
        &Aligned(*include_bytes!("../../../data/golden/stereo-v1.rays")),
    ),
    (
        "stereo-v2.rays",
        &Aligned(*include_bytes!("../../../data/golden/stereo-v2.rays")),
    ),
    (
        "stereo-v3-fast.rays",
        &Aligned(*include_bytes!("../../../data/golden/stereo-v3-fast.rays")),
    ),
    (
        "stereo-v3-small.rays",
        &Aligned(*include_bytes!("../../../data/golden/stereo-v3-small.rays")),
    ),
];

const HEADER: &str = include_str!("../../c/rays.h");
fn link_for_host(library: &Path, program: &Path) -> Command {
    let mut command = Command::new("cc");
    command
        .args(["-std=c99", "-O2"])
        .args(WARNINGS)
        .args(["example.c", "host.c"])
        .arg(library)
        .arg("-o")
        .arg(program)
        .current_dir(c_folder());
    command
}

/// The pixels of `example.c`.
struct Pixels(u32);

impl Pixels {
    fn next(&mut self) -> PixelPoint {
        let [u, v] = [64, 48].map(|extent_px: u32| {
            self.0 = self.0.wrapping_mul(1664525).wrapping_add(1013904223);
            let steps = (self.0 >> 8) % ((extent_px + 1) << 14);
            steps as f32 / 16384.0 - 1.0
        });
        PixelPoint::new(u, v)
    }
}

/// What `example.c` must print for a blob, and how many points are in it.
fn expected(blob: &RayBlob<'_>) -> (String, usize) {
    let (cameras, tests) = (blob.camera_count(), blob.run_self_tests().unwrap());
    let mut text = format!("cameras {cameras:02x}, self-tests {tests:02x} passed\n");
    text += &expected_info(blob);
    text += &expected_window(blob);
    let mut pixels = Pixels(1);
    let mut points = 0;
    for number in 0..4000 {
        let (first, second) = ((0, pixels.next()), (1, pixels.next()));
        let ray = blob.lookup(1, second.1).map_err(LookupError::code);
        let of_ray = |ray: Ray| {
            [ray.origin_mm, ray.direction]
                .map(<[f32; 3]>::from)
                .concat()
        };
        text += &field(ray.map(of_ray));

        let point = blob.triangulate(first, second);
        points += usize::from(point.is_ok());
        text += &field(point.map(of_point).map_err(MeasureError::code));
        if let (Ok(point), 0) = (point, number % 32) {
            text += &expected_search(blob, first, second, &point);
        }

        let measured = blob.triangulate_with_covariance(first, second);
        let of_measurement = |measured: Measurement| {
            let sigma_mm = measured.covariance.map(|c| c.sigma_mm().to_vec());
            let gap = [
                measured.signed_gap_mm(),
                measured.covariance.map_or(0.0, |known| known.gap_mm2),
            ];
            [
                of_point(measured.found),
                sigma_mm.unwrap_or_default(),
                gap.to_vec(),
            ]
            .concat()
        };
        text += &field(measured.map(of_measurement).map_err(MeasureError::code));
        if measured.is_ok() && number % 32 == 0 {
            let noise = MatchNoise::from_px(0.375).unwrap();
            let noisy = blob.triangulate_with_noise(first, second, noise).unwrap();
            let sigma_mm = noisy.covariance.map(|c| c.sigma_mm().to_vec());
            text += &field(Ok(sigma_mm.unwrap_or_default()));
        }
        text.push('\n');
    }
    (text, points)
}

fn of_point(found: Triangulation) -> Vec<f32> {
    let [x, y, z] = found.point_mm;
    vec![x, y, z, found.gap_squared_mm2]
}

/// What `print_info` must print.
fn expected_info(blob: &RayBlob<'_>) -> String {
    let identity = blob.identity().map(|byte| format!("{byte:02x}")).concat();
    let [error, distance] = [blob.max_error_px(), blob.working_distance_mm()].map(f32::to_bits);
    let length = blob.len();
    format!(
        "info | 00 {identity} {error:08x} {distance:08x} {length:08x}, header and library agree\n"
    )
}

/// What `print_search` must print.
fn expected_search(
    blob: &RayBlob<'_>,
    first: (usize, PixelPoint),
    second: (usize, PixelPoint),
    point: &Triangulation,
) -> String {
    let of_pixel = |pixel: PixelPoint| vec![pixel.u, pixel.v];
    let seen = |pixel: Result<PixelPoint, ProjectError>| {
        field(pixel.map(of_pixel).map_err(ProjectError::code))
    };
    let pixel = blob.project(1, point.point_mm);
    let mut text = seen(pixel);
    if let Ok(pixel) = pixel {
        let start = PixelPoint::new(pixel.u + 2.5, pixel.v);
        text += &seen(blob.project_near(1, point.point_mm, start));
    }
    let of_curve = |curve: EpipolarCurve<'_>| {
        curve
            .flat_map(|at| [of_pixel(at.pixel), at.point_mm.as_slice().to_vec()].concat())
            .collect()
    };
    let curve = blob.epipolar_curve(first, 1, [100.0, 3000.0], 8);
    text += &field(curve.map(of_curve).map_err(MeasureError::code));
    let third = PixelPoint::new(second.1.u + 0.5, second.1.v - 0.25);
    let nearest = blob.triangulate_many(&[first, second, (1, third)]);
    text + &field(nearest.map(of_point).map_err(MeasureError::code))
}

/// What `print_window` must print.
fn expected_window(blob: &RayBlob<'_>) -> String {
    let camera = blob.camera(1).unwrap();
    let sensor @ [width, height] = [camera.sensor_width, camera.sensor_height];
    let readout = Readout {
        sensor,
        first: [0, height / 2],
        image: [width / 2, height / 4],
        binning: [2, 2],
    };
    let window = SensorWindow::new(&camera, &readout).unwrap();
    let sensor = window.to_sensor(PixelPoint::new(3.25, 7.5));
    let back = window.from_sensor(sensor);
    let bits = field(Ok(vec![sensor.u, sensor.v, back.u, back.v]));
    format!("window{bits}\n")
}

/// An answer's bits behind a zero, or its code.
fn field(answer: Result<Vec<f32>, u8>) -> String {
    match answer {
        Ok(numbers) => numbers.iter().fold(" | 00".to_owned(), |text, number| {
            text + &format!(" {:08x}", number.to_bits())
        }),
        Err(code) => format!(" | {code:02x}"),
    }
}

/// Compares what a program printed for each golden blob with what Rust computes here.
pub(super) fn check_bits(mut print: impl FnMut(&Path) -> String) {
    for (name, bytes) in GOLDEN {
        let printed = print(&root().join("data/golden").join(name));
        let (expected, points) = expected(&RayBlob::open(&bytes.0).unwrap());
        assert!(points > 1000, "{name}: only {points} points");
        for (number, (found, expected)) in printed.lines().zip(expected.lines()).enumerate() {
            assert_eq!(found, expected, "{name}, line {number}: C left, Rust right");
        }
        assert_eq!(printed.len(), expected.len(), "{name}");
    }
}

/// The header's names of what opening a blob can answer, without their beginning.
fn open_errors() -> [(&'static str, OpenError); 16] {
    let (need, have) = (0, 0);
    [
        ("TRUNCATED", OpenError::Truncated { need, have }),
        ("BAD_MAGIC", OpenError::BadMagic { found: 0 }),
        (
            "WRONG_VERSION",
            OpenError::WrongVersion {
                found: 0,
                supported: 0,
            },
        ),
        ("TRAILING_BYTES", OpenError::TrailingBytes { need, have }),
        (
            "BAD_CRC",
            OpenError::BadCrc {
                stated: 0,
                computed: 0,
            },
        ),
        ("MISALIGNED", OpenError::Misaligned { offset: 0 }),
        ("BAD_HEADER", OpenError::BadHeader),
        ("BAD_META", OpenError::BadMeta),
        ("BAD_PADDING", OpenError::BadPadding { at: 0 }),
        (
            "UNKNOWN_ENCODING",
            OpenError::UnknownEncoding {
                camera: 0,
                found: 0,
            },
        ),
        (
            "BAD_LAYOUT",
            OpenError::BadLayout {
                camera: 0,
                table: Table::Grid,
            },
        ),
        (
            "BAD_NUMBER",
            OpenError::BadNumber {
                camera: 0,
                table: Table::Grid,
            },
        ),
        ("BAD_PAIR", OpenError::BadPair { pair: 0 }),
        ("BAD_SECTION", OpenError::BadSection { section: 0 }),
        ("UNKNOWN_SECTION", OpenError::UnknownSection { tag: 0 }),
        (
            "WRONG_ROUNDING",
            OpenError::WrongRounding {
                found: Rounding::TowardZero,
            },
        ),
    ]
}

#[test]
fn codes_of_the_header_are_those_of_rust() {
    let measure = [
        ("OUTSIDE", MeasureError::Outside { camera: 0 }),
        (
            "NO_SUCH_CAMERA",
            MeasureError::NoSuchCamera {
                camera: 0,
                count: 0,
            },
        ),
        ("PARALLEL", MeasureError::Parallel),
        ("BEHIND", MeasureError::Behind),
        ("TOO_FEW_RAYS", MeasureError::TooFewRays { have: 0 }),
    ];
    let others = [
        ("UNSEEN", ProjectError::Unseen.code()),
        (
            "WRONG_SENSOR",
            ReadoutError::WrongSensor {
                calibrated: [0; 2],
                found: [0; 2],
            }
            .code(),
        ),
        ("NOT_ON_SENSOR", ReadoutError::NotOnSensor.code()),
    ];
    let of_c = [
        ("OK", 0),
        ("BAD_ARGUMENT", 128),
        ("NOT_OPEN", 129),
        ("SELF_TEST_FAILED", 130),
    ];
    let mut expected: Vec<(String, u8)> = open_errors()
        .map(|(name, error)| (name, error.code()))
        .into_iter()
        .chain(measure.map(|(name, error)| (name, error.code())))
        .chain(others)
        .chain(of_c)
        .map(|(name, code)| (format!("RAYS_{name}"), code))
        .collect();
    let mut found: Vec<(String, u8)> = HEADER
        .lines()
        .filter(|line| line.trim().starts_with("RAYS_"))
        .filter_map(|line| {
            let (name, rest) = line.trim().split_once(" = ")?;
            let code = rest.split([',', ' ']).next()?;
            Some((name.to_owned(), code.parse().ok()?))
        })
        .collect();
    expected.sort();
    found.sort();
    assert_eq!(found, expected);
}

#[test]
fn the_version_of_the_header_is_that_of_the_library() {
    let part = |name: &str| {
        let line = format!("#define RAYS_VERSION_{name} ");
        let found = HEADER.lines().find_map(|text| text.strip_prefix(&line));
        found.unwrap_or_else(|| panic!("no {name}")).to_owned()
    };
    let stated = ["MAJOR", "MINOR", "PATCH"].map(part).join(".");
    let manifest = std::fs::read_to_string(c_folder().join("Cargo.toml")).unwrap();
    assert!(
        manifest.contains(&format!("version = \"{stated}\"")),
        "{stated}"
    );
}

#[test]
fn the_example_gives_the_bits_of_rust_on_the_host() {
    let library = build_for_host("librays.a", &[]);
    let program = made("example-host");
    succeed(&mut link_for_host(&library, &program));
    check_bits(|blob| succeed(Command::new(&program).arg(blob)));
    // C++ takes the header, too.
    let mut command = Command::new("c++");
    command.args(["-std=c++11", "-fsyntax-only", "-x", "c++"]);
    succeed(command.args(WARNINGS).arg("rays.h").current_dir(c_folder()));
}

#[test]
fn what_cannot_be_opened_or_asked_has_its_code() {
    let library = build_for_host("librays-misuse.a", &[]);
    let program = made("misuse");
    let mut command = Command::new("cc");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/c_misuse.c");
    command.args(["-std=c99", "-O2", "-I."]).args(WARNINGS);
    command.arg(source).arg(library).arg("-o").arg(&program);
    succeed(command.current_dir(c_folder()));
    let printed = succeed(Command::new(&program).arg(root().join("data/golden/stereo-v2.rays")));
    assert_eq!(printed, "all as it should be\n");
}

#[test]
fn the_example_gives_the_bits_of_rust_with_an_fpu() {
    check_arm(&CORTEX_M4F);
}

#[test]
fn the_example_gives_the_bits_of_rust_without_an_fpu() {
    // Of the two, the smaller one has no division either.
    check_arm(&CORTEX_M4);
    check_arm(&CORTEX_M0);
}

fn check_arm(arm: &Arm) {
    if let Some(image) = arm.build("example", &["example.c", "qemu.c"]) {
        check_bits(|blob| arm.run(&image, blob));
    }
}

#[test]
fn a_panic_in_the_library_does_not_link() {
    let library = build_for_host("librays-panics.a", &["--features", "panics"]);
    let output = run(&mut link_for_host(&library, &made("example-panics")));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert!(
        said.contains("a_panic_is_reachable_in_this_library"),
        "{said}"
    );
}
