//! `completions`: what a shell needs to complete verbs, options and files, from the definitions that are parsed by.

use super::Outcome;
use super::output::Console;
use clap::{Args, Command};
use clap_complete::Shell;
use serde::Serialize;

const EXAMPLE: &str = "\
Example:
  calib-offline completions bash > ~/.local/share/bash-completion/completions/calib-offline
  calib-offline completions zsh > ~/.zfunc/_calib-offline
  calib-offline completions fish > ~/.config/fish/completions/calib-offline.fish";

const FORMATS: &str = "\
With --json, schema calib-offline/completions/1:
  shell, script";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL")]
    pub shell: Shell,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct CompletionsObject<'a> {
    schema: &'static str,
    shell: String,
    script: &'a str,
}

/// Runs the verb; `command` is the whole program's.
pub fn run(args: &CompletionsArgs, mut command: Command, console: &Console) -> Outcome {
    let mut script = Vec::new();
    let name = command.get_name().to_owned();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    let script = String::from_utf8_lossy(&script);
    let object = CompletionsObject {
        schema: "calib-offline/completions/1",
        shell: args.shell.to_string(),
        script: &script,
    };
    console.result(&script, &object);
    Outcome::Done
}
