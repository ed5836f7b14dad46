//! Builds the C library and programs with it, for the host and for Arm in QEMU.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};

/// As strict as a C compiler gets.
pub(crate) const WARNINGS: [&str; 4] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_owned()
}

pub(crate) fn c_folder() -> PathBuf {
    root().join("ray-runtime/c")
}

/// A file that a test makes.
pub(crate) fn made(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// What a command printed, which must succeed.
pub(crate) fn succeed(command: &mut Command) -> String {
    let output = run(command);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success(),
        "{command:?}: {}\n{said}",
        output.status
    );
    String::from_utf8(output.stdout).unwrap()
}

pub(crate) fn run(command: &mut Command) -> Output {
    command.stdin(Stdio::null()).output().unwrap_or_else(|error| {
        panic!("{command:?} cannot be run ({error}): install a C compiler, or run scripts/install-embedded.sh")
    })
}

/// Builds the library for the host, in a target folder of its own and without what the cargo that
/// runs this test left in the environment.
pub(crate) fn build_for_host(name: &str, more: &[&str]) -> PathBuf {
    // One at a time: each build puts its library in the same place.
    static BUILDING: Mutex<()> = Mutex::new(());
    let _building = BUILDING.lock().unwrap_or_else(PoisonError::into_inner);
    let target_dir = root().join("target/c");
    let mut command = Command::new(env!("CARGO"));
    command
        .args(["build", "--release", "--locked", "--quiet"])
        .args(more)
        .current_dir(c_folder())
        .env("CARGO_TARGET_DIR", &target_dir)
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS");
    succeed(&mut command);
    let library = made(name);
    std::fs::copy(target_dir.join("release/librays.a"), &library).unwrap();
    library
}

/// A kind of Arm: its Rust target, what its C compiler is told, and where QEMU runs it.
pub(crate) struct Arm {
    target: &'static str,
    flags: &'static [&'static str],
    machine: [&'static str; 2],
}

pub(crate) const CORTEX_M4F: Arm = Arm {
    target: "thumbv7em-none-eabihf",
    flags: &["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],
    machine: ["mps2-an386", "cortex-m4"],
};

#[allow(dead_code, reason = "not every program of tests has a use for each")]
pub(crate) const CORTEX_M4: Arm = Arm {
    target: "thumbv7em-none-eabi",
    flags: &["-mcpu=cortex-m4", "-mfloat-abi=soft"],
    machine: ["mps2-an386", "cortex-m4"],
};

pub(crate) const CORTEX_M0: Arm = Arm {
    target: "thumbv6m-none-eabi",
    flags: &["-mcpu=cortex-m0", "-mfloat-abi=soft"],
    machine: ["mps2-an385", "cortex-m3"],
};

/// Ends with this code where there is no toolchain for a target.
const NO_TOOLCHAIN: i32 = 3;

impl Arm {
    /// An image of these files of the C folder; `None`, with the reason said, where a compiler is missing.
    pub(crate) fn build(&self, name: &str, sources: &[&str]) -> Option<PathBuf> {
        const COMPILER: &str = "arm-none-eabi-gcc";
        if Command::new(COMPILER).arg("--version").output().is_err() {
            eprintln!(
                "{COMPILER} is missing, so C was not tried on {}: install gcc-arm-none-eabi, or run scripts/install-embedded.sh",
                self.target
            );
            return None;
        }
        let mut build = Command::new(root().join("scripts/embedded-cargo.sh"));
        build.args(["build", "--release", "--locked", "--quiet"]);
        build.args(["--target", self.target, "--manifest-path"]);
        let output = run(build.arg(c_folder().join("Cargo.toml")));
        let said = String::from_utf8_lossy(&output.stderr);
        if output.status.code() == Some(NO_TOOLCHAIN) {
            eprintln!("C was not tried on {}: {said}", self.target);
            return None;
        }
        assert!(output.status.success(), "{}: {said}", self.target);

        let library = root().join("target/embedded").join(self.target);
        let image = made(&format!("{name}-{}.elf", self.target));
        let mut link = Command::new(COMPILER);
        link.args(["-mthumb", "-std=c99", "-O2", "-ffreestanding", "-nostdlib"])
            .args(self.flags)
            .args(WARNINGS)
            // Without --gc-sections: no part of the library may refer to what exists nowhere.
            .args(["-Wl,-z,noexecstack", "-T", "qemu.ld"])
            .args(sources)
            .arg(library.join("release/librays.a"))
            .arg("-o")
            .arg(&image)
            .current_dir(c_folder());
        succeed(&mut link);
        Some(image)
    }

    /// What an image prints in QEMU, with this blob in its flash.
    pub(crate) fn run(&self, image: &Path, blob: &Path) -> String {
        let [machine, cpu] = self.machine;
        let file = blob.display().to_string().replace(',', ",,");
        let loader = format!("loader,file={file},addr=0x21000000,force-raw=on");
        let mut qemu = Command::new("timeout");
        qemu.args(["120", "qemu-system-arm", "-machine", machine, "-cpu", cpu])
            .args(["-display", "none", "-monitor", "none", "-serial", "none"])
            .args(["-semihosting-config", "enable=on,target=native"])
            .args(["-device", &loader, "-kernel"])
            .arg(image);
        succeed(&mut qemu)
    }
}
