//! Sizes, widths, file names and words that must not stay.

use std::path::Path;

use crate::Findings;
use crate::source::{self, Source};

/// Hard limit of lines in a Rust file, and in a shader.
const MAX_LINES: [usize; 2] = [600, 400];
/// Hard limit of columns.
const MAX_COLUMNS: usize = 100;
/// File stems that say nothing about their content.
const BANNED_STEMS: [&str; 5] = ["utils", "helpers", "common", "misc", "old"];
/// Macros that mark unfinished work; split so that this file does not name them.
const BANNED_WORDS: [&str; 3] =
    [concat!("todo", "!"), concat!("dbg", "!"), concat!("unimpl", "emented!")];

/// Checks every Rust and shader file, and reports medians and the largest file.
pub(crate) fn check(root: &Path) -> Result<Findings, String> {
    let mut findings = Findings::default();
    for (kind, extensions) in [("Rust", ["rs", "rs"]), ("shader", ["wesl", "wgsl"])] {
        let mut files = source::files(root, "crates", &extensions)?;
        files.extend(source::files(root, "xtask", &extensions)?);
        files.iter().for_each(|file| findings.violations.extend(violations(file)));
        files.sort_by_key(|f| f.text.lines().count());
        if let (Some(middle), Some(last)) = (files.get(files.len() / 2), files.last()) {
            findings.report.push(format!(
                "{} {kind} files: median {} lines, largest {} ({})",
                files.len(),
                middle.text.lines().count(),
                last.text.lines().count(),
                last.path
            ));
        }
    }
    Ok(findings)
}

/// What is wrong with one file. A line `// tidy: <reason>` waives the limit of lines.
fn violations(file: &Source) -> Vec<String> {
    let mut found = Vec::new();
    let Source { path, text } = file;
    let stem = Path::new(path).file_stem().map(|s| s.to_string_lossy()).unwrap_or_default();
    if BANNED_STEMS.contains(&&*stem) {
        found.push(format!("{path}: the name says nothing; name the file after its content"));
    }
    let max = MAX_LINES[usize::from(!path.ends_with(".rs"))];
    let lines = text.lines().count();
    if lines > max && !text.lines().any(|l| l.starts_with("// tidy: ")) {
        found.push(format!("{path}: {lines} lines, at most {max}; split it by step"));
    }
    for (i, line) in text.lines().enumerate() {
        let columns = line.chars().count();
        if columns > MAX_COLUMNS {
            found.push(format!("{path}:{}: {columns} columns, at most {MAX_COLUMNS}", i + 1));
        }
        for word in BANNED_WORDS.iter().filter(|word| line.contains(**word)) {
            found.push(format!("{path}:{}: {word} marks unfinished work; finish it", i + 1));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(path: &str, text: String) -> usize {
        violations(&Source { path: path.to_owned(), text }).len()
    }

    #[test]
    fn each_rule_is_seen() {
        assert_eq!(count("a/grid.rs", "fn f() {}\n".repeat(600)), 0);
        assert_eq!(count("a/grid.rs", "fn f() {}\n".repeat(601)), 1);
        assert_eq!(count("a/grid.wesl", "\n".repeat(401)), 1);
        assert_eq!(count("a/grid.rs", format!("// tidy: a table\n{}", "\n".repeat(700))), 0);
        assert_eq!(count("a/utils.rs", String::new()), 1);
        assert_eq!(count("a/b.rs", "é".repeat(100)), 0);
        assert_eq!(count("a/b.rs", "é".repeat(101)), 1);
        for word in BANNED_WORDS {
            assert_eq!(count("a/b.rs", format!("{word}()")), 1);
        }
    }
}
