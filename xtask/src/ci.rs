//! Every check in order, cheapest first within its kind; stops at the first that fails.

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use manylight_testing::{REQUIRE_GPU, is_device_required};

use crate::driver::Driver;
use crate::skipped::Skipped;
use crate::{SCANS, report};

/// A cargo command with the reason it is run.
struct Step {
    name: &'static str,
    why: &'static str,
    args: &'static [&'static str],
}

/// Which of the steps says what its tests skip.
const TEST: &str = "test";

/// Which of the steps is run with the driver that `setup` set aside.
const WITH_DRIVER: &str = "features";

/// The package of the program.
const PROGRAM: &str = "manylight-cli";

const STEPS: [Step; 8] = [
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
        args: &["test", "--workspace", "--lib", "says_which_device", "--", "--nocapture"],
    },
    Step {
        name: TEST,
        why: "unit, integration and documentation tests: the lower rungs of the ladder",
        args: &["test", "--workspace", "--", "--show-output"],
    },
    Step {
        name: WITH_DRIVER,
        why: "what few drivers offer is tested with one that is set aside",
        args: &[
            "test",
            "-p",
            "manylight",
            "--lib",
            "--test",
            "validation",
            "--",
            "--show-output",
            "ray_queries",
            "bindless",
            "large_limits",
        ],
    },
    Step {
        name: "doc",
        why: "a broken link in the documentation is a broken promise",
        args: &["doc", "--workspace", "--no-deps", "--exclude", PROGRAM],
    },
    Step {
        name: "doc program",
        why: "it has the library's name, and both pages at once would overwrite each other",
        args: &["doc", "-p", PROGRAM, "--no-deps"],
    },
];

/// Runs all steps; failure of one ends the run.
pub(crate) fn run(root: &Path) -> ExitCode {
    let start = Instant::now();
    let mut done = 0;
    let mut skipped = Skipped::default();
    let scans = SCANS.iter().map(|s| (s.0, s.1));
    let all: Vec<_> = STEPS.iter().map(|s| (s.name, s.why)).chain(scans).collect();
    for (i, (name, why)) in all.iter().enumerate() {
        println!("== {name}: {why}");
        let step_start = Instant::now();
        let ok = match STEPS.get(i) {
            Some(step) if step.name == WITH_DRIVER => with_driver(root, step.args, &mut skipped),
            Some(step) if step.name == TEST => skipped.run(command(root, step.args)),
            Some(step) => run_command(command(root, step.args)),
            None => report(name, SCANS[i - STEPS.len()].2(root)),
        };
        println!("-- {name}: {:.1} s", step_start.elapsed().as_secs_f64());
        if !ok {
            skipped.print();
            eprintln!("ci: {name} failed after {done} of {} steps", all.len());
            return ExitCode::FAILURE;
        }
        done += 1;
    }
    skipped.print();
    println!("ci: all {done} steps passed in {:.1} s", start.elapsed().as_secs_f64());
    ExitCode::SUCCESS
}

/// Runs tests with the driver that was set aside. Without it they are skipped, or fail where tests
/// of graphics devices are required.
fn with_driver(root: &Path, args: &[&str], skipped: &mut Skipped) -> bool {
    let Some(driver) = Driver::find(root) else {
        let reason = "no Vulkan driver with ray queries is set aside; `cargo xtask setup` does so \
                      on Debian";
        match is_device_required() {
            true => eprintln!("{reason}, and {REQUIRE_GPU} is set"),
            false => skipped.add(reason, &format!("step {WITH_DRIVER}")),
        }
        return !is_device_required();
    };
    // A filter that no name of a test matches would pass.
    match count_tests(root, args) {
        Ok(count) => println!("  {count} tests"),
        Err(problem) => {
            eprintln!("{problem}");
            return false;
        }
    }
    let mut command = command(root, args);
    command.envs(driver.environment()).env(REQUIRE_GPU, "all");
    skipped.run(command)
}

/// How many tests `cargo test` with these arguments runs; an error without any.
fn count_tests(root: &Path, args: &[&str]) -> Result<usize, String> {
    let listed = |more: &[&str]| {
        let mut command = command(root, args);
        let output = command.args(more).stderr(Stdio::inherit()).output();
        let output = output.map_err(|problem| format!("cannot start cargo: {problem}"))?;
        let text = String::from_utf8_lossy(&output.stdout);
        Ok::<_, String>(text.lines().filter(|line| line.ends_with(": test")).count())
    };
    match listed(&["--list"])?.saturating_sub(listed(&["--list", "--ignored"])?) {
        0 => Err(format!("no test is run by cargo {}", args.join(" "))),
        count => Ok(count),
    }
}

fn run_command(mut command: Command) -> bool {
    match command.status() {
        Ok(status) => status.success(),
        Err(problem) => {
            eprintln!("cannot start cargo: {problem}");
            false
        }
    }
}

fn command(root: &Path, args: &[&str]) -> Command {
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(program);
    command.current_dir(root).args(args).env("RUSTDOCFLAGS", "-D warnings");
    command
}
