//! `demo`: the whole chain on the data that comes with the program.

use super::Outcome;
use super::calibrate::{Estimate, FILES, calibrate_into};
use super::output::Console;
use crate::atomic_file::check_folder;
use crate::dataset::Dataset;
use crate::error::{Error, UsageError};
use crate::pipeline::CalibrateSettings;
use crate::report::facts::Facts;
use crate::report::record::Grade;
use crate::report::text;
use clap::Args;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline demo
  calib-offline demo -o demo-results";

/// The datasets of the demo, folders of `data/`.
const DATASETS: [&str; 2] = ["opencv-stereo", "stage"];

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE)]
pub struct DemoArgs {
    /// The folder for the results; earlier results of the demo in it are replaced
    #[arg(short, long, value_name = "DIR", default_value = "demo-results")]
    pub output: PathBuf,
    /// The folder with the datasets [default: data, here or beside the program's source]
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct DemoObject {
    schema: &'static str,
    datasets: Vec<DatasetObject>,
}

#[derive(Debug, Serialize)]
struct DatasetObject {
    dataset: PathBuf,
    #[serde(flatten)]
    facts: Facts,
    report: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// [`Error`] of the first dataset that fails; results of the datasets before it stand.
pub fn run(args: &DemoArgs, console: &Console, estimate: Estimate<'_>) -> Result<Outcome, Error> {
    check_folder(&args.output)?;
    let data = data_folder(args.data.as_deref())?;
    let settings = CalibrateSettings::default();
    let (mut words, mut datasets) = (String::new(), Vec::new());
    for name in DATASETS {
        let folder = data.join(name);
        let dataset = Dataset::load(&folder)?;
        console.narrate(&format!("dataset {}", folder.display()));
        let place = args.output.join(name);
        let written = calibrate_into(&place, &dataset, &settings, console, estimate)?;
        // Writing to a String cannot fail.
        let _ = write!(
            words,
            "{name}\n{}report          {}\n\n",
            text::summary(&written.calibration, Some(&written.blob)),
            place.join(FILES[2]).display()
        );
        datasets.push(DatasetObject {
            dataset: folder,
            facts: Facts::of(&written.calibration),
            report: place.join(FILES[2]),
        });
    }
    let failed = datasets.iter().any(|d| d.facts.verdict == Grade::Fail);
    let object = DemoObject {
        schema: "calib-offline/demo/1",
        datasets,
    };
    console.result(&words, &object);
    Ok(if failed {
        Outcome::VerdictFail
    } else {
        Outcome::Done
    })
}

/// Where the datasets are: as asked for, in the working folder, or in the source tree.
fn data_folder(asked: Option<&Path>) -> Result<PathBuf, Error> {
    let candidates = match asked {
        Some(folder) => vec![folder.to_owned()],
        None => vec![
            PathBuf::from("data"),
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../data"),
        ],
    };
    let is_there = |folder: &&PathBuf| folder.join(DATASETS[0]).is_dir();
    match candidates.iter().find(is_there) {
        Some(folder) => Ok(folder.clone()),
        None => Err(Error::Usage(UsageError::NotFound {
            path: candidates[0].join(DATASETS[0]),
        })),
    }
}
