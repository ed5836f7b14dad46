//! The C library as a `CMake` package and by pkg-config: built, installed, found by somebody else's project, and run.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::c_build::{build_for_host, c_folder, made, root, run, succeed};
use super::c_interface::check_bits;

/// An installation of the package, with the library that cargo built for the other tests; `None`, with the reason said, without `CMake`.
fn install(name: &str) -> Option<PathBuf> {
    if Command::new("cmake").arg("--version").output().is_err() {
        eprintln!(
            "cmake is missing, so the CMake package was not tried: run scripts/install-embedded.sh"
        );
        return None;
    }
    let library = build_for_host(&format!("librays-{name}.a"), &[]);
    // The package installs it under its own name.
    let folder = made(&format!("{name}-library"));
    std::fs::create_dir_all(&folder).unwrap();
    let archive = folder.join("librays.a");
    std::fs::copy(library, &archive).unwrap();
    let (build, prefix) = (
        made(&format!("{name}-build")),
        made(&format!("{name}-prefix")),
    );
    for folder in [&build, &prefix] {
        let _ = std::fs::remove_dir_all(folder);
    }
    let mut configure = Command::new("cmake");
    configure.arg("-S").arg(c_folder()).arg("-B").arg(&build);
    configure.arg(format!("-DRAYS_LIBRARY={}", archive.display()));
    configure.arg("-DCMAKE_INSTALL_LIBDIR=lib");
    succeed(configure.arg(format!("-DCMAKE_INSTALL_PREFIX={}", prefix.display())));
    succeed(Command::new("cmake").arg("--build").arg(&build));
    succeed(Command::new("cmake").arg("--install").arg(&build));
    Some(prefix)
}

/// Somebody else's project, with the example as its program.
fn project(name: &str, finds: &str) -> PathBuf {
    let folder = made(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let sources = c_folder().display().to_string();
    let text = format!(
        "cmake_minimum_required(VERSION 3.20)\nproject(theirs LANGUAGES C)\n{finds}\n\
         add_executable(theirs {sources}/example.c {sources}/host.c)\n\
         target_link_libraries(theirs PRIVATE rays::rays)\n"
    );
    std::fs::write(folder.join("CMakeLists.txt"), text).unwrap();
    folder
}

fn configure(project: &Path, definitions: &[String]) -> Command {
    let mut command = Command::new("cmake");
    command
        .arg("-S")
        .arg(project)
        .arg("-B")
        .arg(project.join("build"));
    command.args(definitions);
    command
}

/// Builds a project and compares what its program prints with Rust.
fn build_and_check(project: &Path) {
    succeed(
        Command::new("cmake")
            .arg("--build")
            .arg(project.join("build")),
    );
    let program = project.join("build/theirs");
    check_bits(|blob| succeed(Command::new(&program).arg(blob)));
}

/// What `CMake` said, which it breaks into lines where it likes to.
fn in_one_line(said: &[u8]) -> String {
    let said = String::from_utf8_lossy(said);
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_project_finds_the_installed_package() {
    let Some(prefix) = install("cmake") else {
        return;
    };
    let prefixes = [format!("-DCMAKE_PREFIX_PATH={}", prefix.display())];
    let theirs = project("cmake-theirs", "find_package(rays 0.1 REQUIRED)");
    succeed(&mut configure(&theirs, &prefixes));
    build_and_check(&theirs);
    // Another minor version of 0.x may have other names.
    let theirs = project("cmake-too-new", "find_package(rays 0.2 REQUIRED)");
    assert!(!run(&mut configure(&theirs, &prefixes)).status.success());
}

#[test]
fn a_project_takes_the_folder_in_and_cargo_builds() {
    if Command::new("cmake").arg("--version").output().is_err() {
        return;
    }
    let finds = format!("add_subdirectory({} rays)", c_folder().display());
    let theirs = project("cmake-folder", &finds);
    // Where the other tests have built it, so that it is not built once more; under its lock, as they do.
    let _ = build_for_host("librays-folder.a", &[]);
    let cargo = root().join("target/c");
    let definitions = [format!("-DRAYS_CARGO_TARGET_DIR={}", cargo.display())];
    succeed(configure(&theirs, &definitions).env_remove("RUSTFLAGS"));
    build_and_check(&theirs);
    let wrong = ["-DRAYS_LIBRARY=/nowhere/librays.a".to_owned()];
    let _ = std::fs::remove_dir_all(theirs.join("build"));
    let output = run(&mut configure(&theirs, &wrong));
    let said = in_one_line(&output.stderr);
    assert!(
        !output.status.success() && said.contains("which is not there"),
        "{said}"
    );
}

#[test]
fn pkg_config_knows_the_flags() {
    let Some(prefix) = install("pkg-config") else {
        return;
    };
    let mut ask = Command::new("pkg-config");
    ask.args(["--cflags", "--libs", "rays"]);
    ask.env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig"));
    if Command::new("pkg-config")
        .arg("--version")
        .output()
        .is_err()
    {
        eprintln!(
            "pkg-config is missing, so rays.pc was not tried: run scripts/install-embedded.sh"
        );
        return;
    }
    let flags = succeed(&mut ask);
    let program = made("pkg-config-theirs");
    let mut link = Command::new("cc");
    link.args(["-std=c99", "-O2"]);
    link.args(["example.c", "host.c"].map(|file| c_folder().join(file)));
    // Not in the folder of the header, which pkg-config must find.
    link.args(flags.split_whitespace()).arg("-o").arg(&program);
    succeed(link.current_dir(made("")));
    check_bits(|blob| succeed(Command::new(&program).arg(blob)));
}

/// Zephyr is not here: its functions are stood in for, and its module chooses the target and hands on the library.
#[test]
fn the_zephyr_module_chooses_the_target_by_the_board() {
    if Command::new("cmake").arg("--version").output().is_err() {
        return;
    }
    let module = c_folder().join("zephyr").display().to_string();
    let archive = build_for_host("librays-zephyr.a", &[]);
    let try_board = |name: &str, options: &str| {
        let folder = made(&format!("zephyr-{name}"));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let text = format!(
            "cmake_minimum_required(VERSION 3.20)\nproject(zephyr LANGUAGES C)\nset(CONFIG_RAYS y)\n{options}\n\
             function(zephyr_include_directories)\nmessage(STATUS \"includes ${{ARGV}}\")\nendfunction()\n\
             function(zephyr_link_libraries)\nmessage(STATUS \"links ${{ARGV}}\")\nendfunction()\n\
             add_subdirectory({module} module)\n"
        );
        std::fs::write(folder.join("CMakeLists.txt"), text).unwrap();
        run(&mut configure(&folder, &[]))
    };
    for (name, options, target) in [
        (
            "m0",
            "set(CONFIG_CPU_CORTEX_M0PLUS y)",
            "thumbv6m-none-eabi",
        ),
        ("m4", "set(CONFIG_CPU_CORTEX_M4 y)", "thumbv7em-none-eabi"),
        (
            "m7",
            "set(CONFIG_CPU_CORTEX_M7 y)\nset(CONFIG_FP_HARDABI y)",
            "thumbv7em-none-eabihf",
        ),
        (
            "m33",
            "set(CONFIG_CPU_CORTEX_M33 y)\nset(CONFIG_FP_HARDABI y)",
            "thumbv8m.main-none-eabihf",
        ),
        (
            "riscv",
            "set(CONFIG_RISCV y)",
            "riscv32imac-unknown-none-elf",
        ),
    ] {
        let output = try_board(name, options);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{name}: {output:?}");
        assert!(said.contains("links rays::rays"), "{name}: {said}");
        let target = format!("cargo builds for target \"{target}\"");
        assert!(said.contains(&target), "{name}: {said}");
    }
    let library = format!("set(RAYS_LIBRARY {})", archive.display());
    assert!(try_board("own", &library).status.success());
    let output = try_board("unknown", "");
    let said = in_one_line(&output.stderr);
    assert!(
        !output.status.success() && said.contains("set RAYS_RUST_TARGET"),
        "{said}"
    );
}
