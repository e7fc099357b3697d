//! The frames of a sequence: which, into which files, and which have to be rendered before them.

use crate::{Failure, output};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Most frames of one run.
const MAX_FRAMES: u32 = 1_000_000;
/// Digits of a number where the name of a file does not say how many.
const DIGITS: usize = 4;

/// The frames of `--frames`.
pub fn parse(text: &str) -> Result<RangeInclusive<u32>, Failure> {
    let ends = text.split_once("..").and_then(|(first, last)| {
        Some((first.trim().parse::<u32>().ok()?, last.trim().parse::<u32>().ok()?))
    });
    match ends.filter(|(first, last)| first <= last && last - first < MAX_FRAMES) {
        Some((first, last)) => Ok(first..=last),
        None => Err(format!(
            "--frames {text}: write FIRST..LAST, both rendered, at most {MAX_FRAMES} frames, for \
             example 0..47"
        )
        .into()),
    }
}

/// How many frames are finished, and which are not; files that could not be written later, or are
/// inputs, are refused before any work is done.
///
/// Finished are those of which all files are there and not empty, unless all are to be rendered.
pub fn find_unfinished(
    frames: RangeInclusive<u32>,
    outputs: &[&PathBuf],
    overwrite: bool,
    inputs: &output::Inputs,
) -> Result<(usize, Vec<u32>), Failure> {
    let is_finished = |file: &PathBuf| file.metadata().is_ok_and(|m| m.is_file() && m.len() > 0);
    let keeps = !overwrite && !outputs.is_empty();
    let (mut finished, mut unfinished) = (0, Vec::new());
    for frame in frames {
        let files: Vec<_> = outputs.iter().map(|path| file_of(path, frame)).collect();
        if keeps && files.iter().all(is_finished) {
            finished += 1;
            continue;
        }
        for file in &files {
            output::check_target(file)?;
            inputs.check(file)?;
        }
        unfinished.push(frame);
    }
    Ok((finished, unfinished))
}

/// The file of a frame: its number stands for the last `####` of the name, else before its ending.
pub fn file_of(path: &Path, frame: u32) -> PathBuf {
    let (before, digits, after) = around_number(path);
    path.with_file_name(format!("{before}{frame:0digits$}{after}"))
}

/// Whether a frame of one output and a frame of another in the same folder may have one name.
pub fn may_meet(a: &Path, b: &Path) -> bool {
    let [(before_a, _, after_a), (before_b, _, after_b)] = [a, b].map(around_number);
    let is_digit = |c: char| c.is_ascii_digit();
    let same_before = before_a.trim_end_matches(is_digit) == before_b.trim_end_matches(is_digit);
    let same_after = after_a.trim_start_matches(is_digit) == after_b.trim_start_matches(is_digit);
    // Digits beside the number of the one may be part of the number of the other.
    let lead = before_a.starts_with(&before_b) || before_b.starts_with(&before_a);
    let trail = after_a.ends_with(&after_b) || after_b.ends_with(&after_a);
    same_before && same_after && lead && trail
}

/// What stands before the number of a frame, its least digits, and what stands behind it.
fn around_number(path: &Path) -> (String, usize, String) {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.unwrap_or_default();
    let Some(end) = name.rfind('#') else {
        let (stem, ending) = name.rsplit_once('.').unwrap_or((&name, ""));
        return (format!("{stem}."), DIGITS, format!(".{ending}"));
    };
    let before = name[..end].trim_end_matches('#');
    (before.to_owned(), end + 1 - before.len(), name[end + 1..].to_owned())
}

/// Something to be done for a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// What is remembered does not lead to what follows.
    Forget,
    /// A frame that is remembered, and not written.
    WarmUp(u32),
    /// A frame that is written.
    Write(u32),
}

/// What is to be done for frames that are not finished; where they add up, up to `warm_up` frames
/// come before each that does not follow another one.
pub fn plan(unfinished: impl Iterator<Item = u32>, warm_up: Option<u32>) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut next = None;
    for frame in unfinished {
        if let Some(warm_up) = warm_up.filter(|_| next != Some(frame)) {
            let mut first = frame.saturating_sub(warm_up);
            match next.filter(|next| (first..frame).contains(next)) {
                // What is remembered leads there.
                Some(next) => first = next,
                None => steps.push(Step::Forget),
            }
            steps.extend((first..frame).map(Step::WarmUp));
        }
        steps.push(Step::Write(frame));
        next = frame.checked_add(1);
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_two_ends() {
        assert_eq!(parse("3..5").expect("a range"), 3..=5);
        assert_eq!(parse(" 7 .. 7 ").expect("a range"), 7..=7);
        for text in ["", "3", "5..3", "-1..2", "0..4294967295", "a..b", "1...3", "1..=3"] {
            let problem = parse(text).expect_err(text).to_string();
            assert!(problem.contains("write FIRST..LAST"), "{problem}");
        }
    }

    #[test]
    fn numbers_go_where_the_name_says() {
        for (path, expected) in [
            ("out/a.exr", "out/a.0007.exr"),
            ("a.b.png", "a.b.0007.png"),
            ("o##/a_###.png", "o##/a_007.png"),
            ("####.png", "0007.png"),
            ("a#b#.png", "a#b7.png"),
            ("é##.png", "é07.png"),
        ] {
            assert_eq!(file_of(Path::new(path), 7), Path::new(expected), "{path}");
        }
        assert_eq!(file_of(Path::new("a.#.png"), 123), Path::new("a.123.png"));
    }

    #[test]
    fn outputs_whose_files_may_meet_are_known() {
        let meet = |a: &str, b: &str| may_meet(Path::new(a), Path::new(b));
        assert!(meet("a.png", "a.####.png"));
        // Frame 10 of the one is frame 0 of the other.
        assert!(meet("a.#.png", "a.1#.png"));
        assert!(meet("#1.png", "#.png"));
        assert!(!meet("a.png", "a.exr"));
        assert!(!meet("a.#.png", "a.1_#.png"));
        assert!(!meet("a1####.png", "a2####.png"));
        assert!(!meet("#1.png", "#2.png"));
    }

    #[test]
    fn frames_that_add_up_are_warmed_up_after_each_gap() {
        use Step::{Forget, WarmUp, Write};
        assert_eq!(plan([3, 4, 6].into_iter(), None), [Write(3), Write(4), Write(6)]);
        let steps = plan([1, 2, 5].into_iter(), Some(2));
        let expected = [Forget, WarmUp(0), Write(1), Write(2), WarmUp(3), WarmUp(4), Write(5)];
        assert_eq!(steps, expected);
        let steps = plan([1, 2, 6].into_iter(), Some(2));
        assert_eq!(steps[4..], [Forget, WarmUp(4), WarmUp(5), Write(6)][..]);
        assert_eq!(plan([0].into_iter(), Some(9)), [Forget, Write(0)]);
        assert_eq!(plan([8].into_iter(), Some(0)), [Forget, Write(8)]);
    }
}
