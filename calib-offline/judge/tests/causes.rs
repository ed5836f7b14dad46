//! The vocabulary of causes against the faults that are planted.

use calib_judge::cause::Code;
use calib_simulate::faults;
use std::collections::BTreeSet;

/// Codes that no planted recording of corners can have: `blur` is one of images, and a rig that is not
/// central where it ought to be is no fault of a recording.
const NOT_PLANTED: [Code; 2] = [Code::NonCentralUnexpected, Code::Blur];

#[test]
fn planted_faults_are_called_by_codes_that_there_are_and_few_are_never_planted() {
    let codes: BTreeSet<Code> = faults::all()
        .flat_map(|fault| fault.codes)
        .map(|code| serde_json::from_value((*code).into()).unwrap())
        .collect();
    assert!(codes.is_disjoint(&BTreeSet::from(NOT_PLANTED)));
    // The vocabulary has thirty words.
    assert_eq!(codes.len() + NOT_PLANTED.len(), 30);
}
