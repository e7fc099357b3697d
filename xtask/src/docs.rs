//! Paths that documents name in backticks exist.

use std::path::Path;

use crate::Findings;
use crate::source::{self, Source};

/// First folders that make a word in backticks a path of the repository.
const FOLDERS: [&str; 7] = ["crates/", "docs/", "xtask/", "assets/", "bench/", ".ci/", ".cargo/"];

/// Looks at every document of the repository.
pub(crate) fn check(root: &Path) -> Result<Findings, String> {
    let documents = source::files(root, "", &["md"])?;
    let mut findings = Findings::default();
    findings.report.push(format!("{} documents", documents.len()));
    for document in &documents {
        findings.violations.extend(dangling(document, &|path| root.join(path).exists()));
    }
    Ok(findings)
}

/// Named paths that do not exist, from the root or from the document's own folder.
fn dangling(document: &Source, exists: &dyn Fn(&str) -> bool) -> Vec<String> {
    let mut found = Vec::new();
    let folder = document.path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let mut fenced = false;
    for (i, line) in document.text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            continue;
        }
        // Every second part between backticks is code.
        for word in line.split('`').skip(1).step_by(2).filter(|_| !fenced) {
            let path = word.split("::").next().unwrap_or(word);
            if is_path(path) && !exists(path) && !exists(&format!("{folder}/{path}")) {
                found.push(format!("{}:{}: `{path}` does not exist", document.path, i + 1));
            }
        }
    }
    found
}

/// A path of the repository: below a known folder, without blanks or placeholders.
fn is_path(word: &str) -> bool {
    let plain = |c: char| c.is_alphanumeric() || "/._-".contains(c);
    let at_root = [".md", ".toml"].iter().any(|end| word.ends_with(end)) && !word.contains('/');
    word.chars().all(plain)
        && !word.contains("NNNN")
        && (FOLDERS.iter().any(|f| word.starts_with(f)) || at_root && word.len() > 5)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(text: &str) -> usize {
        let document = Source { path: "docs/a.md".to_owned(), text: text.to_owned() };
        dangling(&document, &|path| matches!(path, "crates/x/src/lib.rs" | "docs/b.md")).len()
    }

    #[test]
    fn existing_paths_and_other_words_pass() {
        assert_eq!(count("`crates/x/src/lib.rs` `b.md` `a/b` `docs/*.md` `docs/NNNN-x.md`"), 0);
        assert_eq!(count("```\n`crates/gone.rs`\n```"), 0);
        assert_eq!(count("`crates/x/src/lib.rs::f`"), 0);
    }

    #[test]
    fn missing_paths_are_seen() {
        assert_eq!(count("see `crates/gone.rs` and `GONE.md`"), 2);
        assert_eq!(count("`docs/gone.md`"), 1);
    }
}
