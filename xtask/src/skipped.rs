//! Tests that said they were skipped, and why. They pass, so nobody would read it otherwise.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use manylight_testing::SKIPPED;

/// Begins what the tests that passed have printed.
const SUCCESSES: &str = "successes:";
/// Begins the last line of a test program.
const RESULT: &str = "test result:";

/// Names of tests by the reason they were skipped for.
#[derive(Debug, Default)]
pub(crate) struct Skipped(BTreeMap<String, Vec<String>>);

impl Skipped {
    /// Adds a test.
    pub(crate) fn add(&mut self, reason: &str, test: &str) {
        self.0.entry(reason.to_owned()).or_default().push(test.to_owned());
    }

    /// Runs tests that show what they print; whether all passed. What those printed that passed is
    /// read and not printed again.
    pub(crate) fn run(&mut self, mut command: Command) -> bool {
        let mut child = match command.stdout(Stdio::piped()).spawn() {
            Ok(child) => child,
            Err(problem) => {
                eprintln!("cannot start cargo: {problem}");
                return false;
            }
        };
        let printed = child.stdout.take().expect("asked for above");
        let lines = BufReader::new(printed).split(b'\n').map_while(Result::ok);
        self.read(lines.map(|line| String::from_utf8_lossy(&line).into_owned()), |line| {
            println!("{line}");
        });
        child.wait().is_ok_and(|status| status.success())
    }

    fn read(&mut self, lines: impl Iterator<Item = String>, mut pass_on: impl FnMut(&str)) {
        let (mut is_success, mut test) = (false, String::new());
        let (mut passed, mut skipped) = (Vec::new(), Vec::new());
        for line in lines {
            if line == SUCCESSES {
                is_success = true;
            } else if line.starts_with(RESULT) || line == "failures:" {
                is_success = false;
            }
            if !is_success {
                passed.extend(
                    line.strip_suffix(" ... ok")
                        .and_then(|l| l.strip_prefix("test "))
                        .map(str::to_owned),
                );
                pass_on(&line);
            } else if let Some(name) = heading(&line) {
                test = name.to_owned();
            } else if let Some(reason) = line.strip_prefix(SKIPPED) {
                skipped.push((reason.to_owned(), test.clone()));
            }
        }
        // What was skipped before and ran now was not skipped.
        for tests in self.0.values_mut() {
            tests.retain(|test| !passed.contains(test));
        }
        skipped.iter().for_each(|(reason, test)| self.add(reason, test));
        self.0.retain(|_, tests| !tests.is_empty());
    }

    /// Prints the tests, reason by reason.
    pub(crate) fn print(&self) {
        for (reason, tests) in &self.0 {
            println!("ci: skipped, {reason}: {}", tests.join(" "));
        }
    }
}

/// The name of the test whose words follow.
fn heading(line: &str) -> Option<&str> {
    line.strip_prefix("---- ")?.strip_suffix(" stdout ----")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ran_later_was_not_skipped() {
        let run = |skipped: &mut Skipped, reason: &str| {
            let passed = "test a ... ok\ntest b ... ok\nsuccesses:\n---- a stdout ----";
            let printed = format!("{passed}\n{reason}\ntest result: ok");
            skipped.read(printed.lines().map(str::to_owned), |_| ());
        };
        let mut skipped = Skipped::default();
        skipped.add("no driver", "a");
        skipped.add("no driver", "c");
        run(&mut skipped, "skipped: no queries");
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        let found: Vec<_> = skipped.0.clone().into_iter().collect();
        assert_eq!(
            found,
            [("no driver".into(), names(&["c"])), ("no queries".into(), names(&["a"]))]
        );
        run(&mut skipped, "FLIP .1");
        assert_eq!(
            skipped.0.into_iter().collect::<Vec<_>>(),
            [("no driver".into(), names(&["c"]))]
        );
    }

    #[test]
    fn what_tests_say_they_skip_is_found() {
        let printed = "running 3 tests\ntest a ... ok\ntest b::c ... ok\ntest d ... FAILED\n\n\
                       successes:\n\n---- a stdout ----\nFLIP .1\n\n---- b::c stdout ----\n\
                       skipped: no scenes\n\n\nsuccesses:\n    a\n    b::c\n\nfailures:\n\n\
                       ---- d stdout ----\nskipped: not this\n\ntest result: FAILED. 2 passed\n";
        let (mut skipped, mut rest) = (Skipped::default(), String::new());
        skipped.read(printed.lines().map(str::to_owned), |line| rest += line);
        assert_eq!(
            skipped.0.into_iter().collect::<Vec<_>>(),
            [("no scenes".into(), vec!["b::c".into()])]
        );
        assert!(rest.contains("not this") && rest.contains("2 passed"), "{rest}");
        assert!(!rest.contains("FLIP") && !rest.contains("no scenes"), "{rest}");
    }
}
