//! The page that leads to the reports of a demo: needs nothing else, no network and no scripts.

use super::{Measured, words};
use maud::{DOCTYPE, PreEscaped, html};

/// A dataset on the page.
#[derive(Debug)]
pub struct Entry<'a> {
    /// Its name, also that of the folder with its report.
    pub name: &'a str,
    /// The verdict in a word.
    pub verdict: &'a str,
    /// What was measured.
    pub measured: &'a Measured,
    /// Where its report is, from the page.
    pub report: String,
}

/// The page as a file's content.
pub fn page(entries: &[Entry]) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "Demo: calibrated and measured" }
                style { (PreEscaped(include_str!("../report/page.css"))) }
            }
            body {
                main {
                    h1 { "Demo: calibrated, packed, and measured with the device's own code" }
                    @for entry in entries {
                        section {
                            h2 { (entry.name) }
                            p { "Verdict: " strong { (entry.verdict) } ". " a href=(entry.report) { "Full report" } }
                            table {
                                @for (name, fact) in words::lines(entry.measured) {
                                    tr { th { (name) } td { (fact) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    .into_string()
}
