//! What to run.

use crate::Result;
use calib_simulate::SimulateError;
use calib_simulate::faults::{self, FAULTLESS, Fault, Poses, Recording, Rig, plant};
use std::fmt::{Display, Formatter};
use std::path::PathBuf;

/// Faults of the geometry alone, and none.
pub const WEAK: [&str; 3] = [FAULTLESS.name, "few-tilts", "frontal-one-depth"];

/// The command line, read.
pub struct Arguments {
    /// Recordings of a fault.
    pub draws: u64,
    /// Seed of the first.
    pub first: u64,
    pub rigs: Vec<Rig>,
    /// Besides the faultless recording, which the others are held against.
    pub faults: Vec<&'static Fault>,
    /// Another build of the program.
    pub beside: Option<PathBuf>,
    /// Recordings treated at a time.
    pub threads: usize,
    /// Whether only the table of weak geometry is asked for.
    pub is_weak_only: bool,
}

/// One recording to be made.
#[derive(Clone, Copy)]
pub struct Case {
    pub fault: &'static Fault,
    pub rig: Rig,
    pub poses: Poses,
    pub seed: u64,
}

impl Display for Case {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let (rig, poses) = (self.rig.name(), self.poses.name());
        write!(f, "{rig}, {}, {poses}, draw {}", self.fault.name, self.seed)
    }
}

impl Case {
    /// Makes it.
    pub fn recorded(&self) -> Result<Recording> {
        let recording = plant(self.fault, self.rig, self.poses, self.seed);
        Ok(recording.map_err(SimulateError::from)?)
    }
}

impl Arguments {
    pub fn read(arguments: impl Iterator<Item = String>) -> Result<Self> {
        let mut read = Self {
            draws: 1,
            first: 1,
            rigs: Vec::new(),
            faults: Vec::new(),
            beside: None,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            is_weak_only: false,
        };
        // Cargo says --bench to every one.
        let mut arguments = arguments.filter(|argument| argument != "--bench");
        while let Some(option) = arguments.next() {
            let mut value = || arguments.next().ok_or(format!("{option} needs a value"));
            match option.as_str() {
                "--draws" => read.draws = value()?.parse()?,
                "--first" => read.first = value()?.parse()?,
                "--threads" => read.threads = value()?.parse()?,
                "--beside" => read.beside = Some(value()?.into()),
                "--rig" => read.rigs.push(rig(&value()?)?),
                "--fault" => read.faults.push(fault(&value()?)?),
                "--weak" => read.is_weak_only = true,
                _ => return Err(format!("no option {option}").into()),
            }
        }
        if read.rigs.is_empty() {
            read.rigs.push(Rig::Plain);
        }
        if read.is_weak_only {
            read.faults = WEAK.into_iter().filter_map(faults::named).collect();
        } else if read.faults.is_empty() {
            read.faults = faults::all().collect();
        } else if read.faults.iter().all(|f| f.name != FAULTLESS.name) {
            read.faults.insert(0, &FAULTLESS);
        }
        Ok(read)
    }

    /// Every recording asked for.
    pub fn cases(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for &rig in &self.rigs {
            for &fault in &self.faults {
                let only = match fault.only {
                    None if self.is_weak_only => Some(Poses::HandHeld),
                    only => only,
                };
                let all = Poses::ALL.into_iter();
                for poses in all.filter(|poses| only.is_none_or(|only| only == *poses)) {
                    cases.extend((self.first..self.first + self.draws).map(|seed| Case {
                        fault,
                        rig,
                        poses,
                        seed,
                    }));
                }
            }
        }
        cases
    }
}

fn rig(name: &str) -> Result<Rig> {
    let found = Rig::ALL.into_iter().find(|rig| rig.name() == name);
    Ok(found.ok_or_else(|| format!("no rig {name}; there are plain, wide, window"))?)
}

fn fault(name: &str) -> Result<&'static Fault> {
    let names: Vec<_> = faults::all().map(|fault| fault.name).collect();
    let unknown = || format!("no fault {name}; there are {}", names.join(", "));
    Ok(faults::named(name).ok_or_else(unknown)?)
}
