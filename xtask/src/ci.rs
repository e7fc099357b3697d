//! Every check in order, cheapest first within its kind; stops at the first that fails.

use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::Instant;

use crate::{SCANS, report};

/// A cargo command with the reason it is run.
struct Step {
    name: &'static str,
    why: &'static str,
    args: &'static [&'static str],
}

const STEPS: [Step; 6] = [
    Step {
        name: "fmt",
        why: "differences should show thoughts, not blanks",
        args: &["fmt", "--all", "--check"],
    },
    Step {
        name: "clippy",
        why: "undocumented items and likely mistakes stop here, tests and benches included",
        args: &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"],
    },
    Step {
        name: "cpu only",
        why: "users without a graphics device build no graphics stack",
        args: &["clippy", "-p", "manylight", "--no-default-features", "--", "-D", "warnings"],
    },
    Step {
        name: "device",
        why: "says which graphics device the tests run on, or why they skip it",
        args: &["test", "-p", "manylight", "--lib", "says_which_device", "--", "--nocapture"],
    },
    Step {
        name: "test",
        why: "unit, integration and documentation tests: the lower rungs of the ladder",
        args: &["test", "--workspace"],
    },
    Step {
        name: "doc",
        why: "a broken link in the documentation is a broken promise",
        args: &["doc", "--workspace", "--no-deps"],
    },
];

/// Runs all steps; failure of one ends the run.
pub(crate) fn run(root: &Path) -> ExitCode {
    let start = Instant::now();
    let mut done = 0;
    let scans = SCANS.iter().map(|s| (s.0, s.1));
    let all: Vec<_> = STEPS.iter().map(|s| (s.name, s.why)).chain(scans).collect();
    for (i, (name, why)) in all.iter().enumerate() {
        println!("== {name}: {why}");
        let step_start = Instant::now();
        let ok = match STEPS.get(i) {
            Some(step) => cargo(root, step.args),
            None => report(name, SCANS[i - STEPS.len()].2(root)),
        };
        println!("-- {name}: {:.1} s", step_start.elapsed().as_secs_f64());
        if !ok {
            eprintln!("ci: {name} failed after {done} of {} steps", all.len());
            return ExitCode::FAILURE;
        }
        done += 1;
    }
    println!("ci: all {done} steps passed in {:.1} s", start.elapsed().as_secs_f64());
    ExitCode::SUCCESS
}

fn cargo(root: &Path, args: &[&str]) -> bool {
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(program);
    command.current_dir(root).args(args).env("RUSTDOCFLAGS", "-D warnings");
    match command.status() {
        Ok(status) => status.success(),
        Err(problem) => {
            eprintln!("cannot start cargo: {problem}");
            false
        }
    }
}
