//! The manylight program: glue between arguments, files and the renderer.

mod args;
mod backend;
mod bench;
mod compare;
mod diff_stages;
mod info;
mod memory;
mod output;
mod render;
mod sequence;
mod threads;

use clap::Parser;
use std::io::Write;
use std::process::ExitCode;

/// Errors end the program with this code.
const EXIT_ERROR: u8 = 2;
/// A check that failed ends the program with this code.
const EXIT_CHECK_FAILED: u8 = 1;

/// Text of an error, ready for the user.
pub(crate) type Failure = Box<dyn std::error::Error>;

/// What a command found.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All is well.
    Done,
    /// A limit given by the user was passed.
    CheckFailed,
}

fn main() -> ExitCode {
    let args = match args::Args::try_parse() {
        Ok(args) => args,
        Err(e) if e.use_stderr() && !is_missing_command(&e) => {
            // The first paragraph says what is wrong; usage and tips follow.
            let text = e.to_string();
            let lines = text.trim_start_matches("error: ").lines().map(str::trim);
            let problem: Vec<_> = lines.take_while(|line| !line.is_empty()).collect();
            let problem: Failure = format!("{}; see --help", problem.join(" ")).into();
            let _ = writeln!(std::io::stderr(), "manylight: {}", describe(&*problem));
            return ExitCode::from(EXIT_ERROR);
        }
        Err(e) => {
            // Nothing can be done about a closed terminal.
            let _ = e.print();
            return if e.use_stderr() { ExitCode::from(EXIT_ERROR) } else { ExitCode::SUCCESS };
        }
    };
    let outcome = run(&args.command);
    match outcome {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => ExitCode::from(EXIT_CHECK_FAILED),
        Err(e) if is_broken_pipe(&*e) => ExitCode::SUCCESS,
        Err(e) => {
            let _ = writeln!(std::io::stderr(), "manylight: {}", describe(&*e));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

fn run(command: &args::Command) -> Result<Outcome, Failure> {
    threads::start(match command {
        args::Command::Render(a) => a.settings.threads,
        args::Command::Bench(a) => a.settings.threads,
        args::Command::DiffStages(a) => a.settings.threads,
        _ => None,
    })?;
    match command {
        args::Command::Render(a) => render::run(a),
        args::Command::Compare(a) => compare::run(a),
        args::Command::Bench(a) => bench::run(a),
        args::Command::DiffStages(a) => diff_stages::run(a),
        args::Command::Info(a) => info::run_info(a),
        args::Command::Devices(a) => info::run_devices(a),
        args::Command::Methods(a) => info::run_methods(a),
    }
}

/// Whether the command line names no command: the answer is the manual.
fn is_missing_command(error: &clap::Error) -> bool {
    error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
}

/// Longest message, characters; names in arguments and files have no limit.
const MAX_MESSAGE_CHARS: usize = 1500;

/// An error in one line, whatever names it repeats.
fn describe(error: &(dyn std::error::Error + 'static)) -> String {
    // Files have errors of their own; a bare one comes from printing results.
    let text = match error.downcast_ref::<std::io::Error>() {
        Some(e) => format!("cannot print the result: {e}; check where the output is sent"),
        None => error.to_string(),
    };
    let visible = |c: char| if c.is_control() { ' ' } else { c };
    text.chars().take(MAX_MESSAGE_CHARS).map(visible).collect()
}

/// A reader that had enough, as in `manylight … | head`, where there is nothing else to do.
fn is_broken_pipe(error: &(dyn std::error::Error + 'static)) -> bool {
    error
        .downcast_ref::<std::io::Error>()
        .is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}
