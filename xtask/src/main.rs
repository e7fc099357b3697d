//! Developer commands: `cargo xtask <command>`; without one, the list.
//!
//! Everything a document or a rule of the house claims is checked here, by plain text scanning.

mod source;
mod tidy;
mod doors;
mod cites;
mod docs;
mod shaders;
mod driver;
mod setup;
mod skipped;
mod ci;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What a step found: a report for people, and violations that fail it.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    /// Lines worth reading when nothing is wrong.
    pub(crate) report: Vec<String>,
    /// One sentence per violation, with file and line.
    pub(crate) violations: Vec<String>,
}

/// A scanner over the repository.
type Scan = fn(&Path) -> Result<Findings, String>;

/// Name, the reason it exists, and the scan.
const SCANS: [(&str, &str, Scan); 5] = [
    ("doors", "a room that uses a room below it turns the house into a knot", doors::check),
    ("shaders", "a shader that no test links fails at its user's", shaders::check),
    ("tidy", "a file that does not fit in the head is not read", tidy::check),
    ("cites", "a citation that leads nowhere is worse than none", cites::check),
    ("docs", "prose about files goes stale where no machine looks", docs::check),
];

fn main() -> ExitCode {
    let root = root();
    let Some(command) = std::env::args().nth(1) else {
        eprintln!("cargo xtask <command>\n  ci      every check, in order; what .ci/run runs");
        eprintln!("  setup   installs what the checks need beyond Rust, and sets a driver aside");
        for (name, why, _) in SCANS {
            eprintln!("  {name:<7} {why}");
        }
        return ExitCode::from(2);
    };
    match command.as_str() {
        "ci" => return ci::run(&root),
        "setup" => return setup::run(&root),
        _ => {}
    }
    match SCANS.iter().find(|scan| scan.0 == command) {
        Some((name, _, scan)) => match report(name, scan(&root)) {
            true => ExitCode::SUCCESS,
            false => ExitCode::FAILURE,
        },
        None => {
            eprintln!("unknown command {command:?}; run `cargo xtask` for the list");
            ExitCode::from(2)
        }
    }
}

/// Prints what a scan found; true if nothing is wrong.
pub(crate) fn report(name: &str, result: Result<Findings, String>) -> bool {
    let findings = match result {
        Ok(findings) => findings,
        Err(problem) => {
            eprintln!("{name}: {problem}");
            return false;
        }
    };
    findings.report.iter().for_each(|line| println!("  {line}"));
    findings.violations.iter().for_each(|line| eprintln!("{name}: {line}"));
    findings.violations.is_empty()
}

/// The repository's root, one above this package.
fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().expect("xtask lies inside the repository").to_owned()
}
