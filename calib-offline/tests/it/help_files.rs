//! `completions` and `man` know every verb that the program has.

use crate::common::run;
use calib_offline::cli::args::Cli;
use clap::CommandFactory as _;
use std::process::Command;

fn verbs() -> Vec<String> {
    let program = Cli::command();
    let names = program
        .get_subcommands()
        .map(|verb| verb.get_name().to_owned());
    names.collect()
}

#[test]
fn every_shell_completes_every_verb_and_its_options() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let said = run(folder.path(), &["completions", shell]);
        said.assert_code(0)
            .assert_prints(&["max-error-px", "match-noise-px"]);
        for verb in verbs() {
            said.assert_prints(&[&verb]);
        }
        let object = run(folder.path(), &["completions", shell, "--json"]).json();
        assert_eq!(object["shell"], shell);
        assert_eq!(
            object["script"].as_str().unwrap().trim_end(),
            said.stdout.trim_end()
        );
    }
    let said = run(folder.path(), &["completions", "bash"]);
    std::fs::write(folder.path().join("script"), &said.stdout).unwrap();
    let mut bash = Command::new("bash");
    bash.arg("-n").arg(folder.path().join("script"));
    assert!(bash.status().unwrap().success());
    run(folder.path(), &["completions", "tcsh"])
        .assert_code(2)
        .assert_says(&["bash", "fish"]);
}

#[test]
fn every_verb_has_its_page() {
    let folder = tempfile::tempdir().unwrap();
    let said = run(folder.path(), &["man", "-o", "pages", "--json"]);
    let pages = said.json()["pages"].as_array().unwrap().len();
    assert_eq!(pages, 1 + verbs().len());
    for verb in verbs() {
        let path = folder.path().join(format!("pages/calib-offline-{verb}.1"));
        let page = std::fs::read_to_string(path).unwrap();
        assert!(page.starts_with(".ie") || page.contains(".TH "), "{verb}");
        // What holds for every verb, too.
        assert!(page.contains("quiet"), "{verb}");
    }
    run(folder.path(), &["man", "-o", "pages"])
        .assert_code(2)
        .assert_says(&["exists", "--force"]);
    run(folder.path(), &["man", "-o", "pages", "--force"]).assert_code(0);
}
