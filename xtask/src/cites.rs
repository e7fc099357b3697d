//! Citations such as `[LinYuksel19, Eq. 5]` and the bibliography agree in both directions.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::Findings;
use crate::source::{self, Source};

const BIBLIOGRAPHY: &str = "docs/papers.bib";

/// Compares the keys cited under `crates/` and in the documents with the bibliography's.
pub(crate) fn check(root: &Path) -> Result<Findings, String> {
    let bibliography = std::fs::read_to_string(root.join(BIBLIOGRAPHY))
        .map_err(|e| format!("cannot read {BIBLIOGRAPHY}: {e}"))?;
    let mut files = source::files(root, "crates", &["rs", "wesl", "wgsl"])?;
    files.extend(source::files(root, "docs", &["md"])?);
    Ok(compare(&files, &keys(&bibliography)))
}

fn compare(files: &[Source], known: &BTreeSet<String>) -> Findings {
    let mut cited: BTreeMap<String, String> = BTreeMap::new();
    for file in files {
        for (i, line) in file.text.lines().enumerate() {
            let comment = match file.path.ends_with(".md") {
                true => line,
                false => line.split_once("//").map_or("", |(_, comment)| comment),
            };
            for key in citations(comment) {
                cited.entry(key).or_insert_with(|| format!("{}:{}", file.path, i + 1));
            }
        }
    }
    let mut findings = Findings::default();
    findings.report.push(format!("{} works cited, {} known", cited.len(), known.len()));
    for (key, place) in cited.iter().filter(|(key, _)| !known.contains(*key)) {
        findings.violations.push(format!("{place}: [{key}] is not in {BIBLIOGRAPHY}"));
    }
    for key in known.iter().filter(|key| !cited.contains_key(*key)) {
        findings.violations.push(format!("{BIBLIOGRAPHY}: nothing cites {key}; remove it"));
    }
    findings
}

/// Keys of the entries, `@kind{Key,`.
fn keys(bibliography: &str) -> BTreeSet<String> {
    let key = |line: &str| {
        let entry = line.trim().strip_prefix('@')?;
        Some(entry.split_once('{')?.1.trim_end_matches(',').trim().to_owned())
    };
    bibliography.lines().filter_map(key).collect()
}

/// Keys cited in a text: after `[` or `; `, names in capitals and two digits of the year, then
/// `,`, `;` or `]`.
fn citations(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for group in text.split('[').skip(1) {
        let Some((inside, after)) = group.split_once(']') else { continue };
        // `[Text](url)` and `[Text]: url` are links.
        if after.starts_with('(') || after.starts_with(": http") {
            continue;
        }
        for part in inside.split(';') {
            let key = part.split(',').next().unwrap_or("").trim();
            if is_key(key) {
                found.push(key.to_owned());
            }
        }
    }
    found
}

fn is_key(key: &str) -> bool {
    let letters = key.trim_end_matches(|c: char| c.is_ascii_digit());
    key.len() - letters.len() == 2
        && letters.len() >= 3
        && letters.starts_with(|c: char| c.is_ascii_uppercase())
        && letters.chars().all(|c| c.is_ascii_alphabetic())
        && letters.chars().any(|c| c.is_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn citations_are_told_from_links_and_indices() {
        let text = "[LinYuksel19, Eq. 5] and [Chao82; Keller97]: not [`Vec3`], [Vpl], [Abc10](x)";
        assert_eq!(citations(text), ["LinYuksel19", "Chao82", "Keller97"]);
    }

    #[test]
    fn missing_and_unused_keys_are_seen() {
        let known = keys("@article{Chao82,\n  title = {x}\n}\n@book{Keller97,\n");
        assert_eq!(known.len(), 2);
        let run = |text: &str| {
            let source = Source { path: "crates/a.rs".to_owned(), text: text.to_owned() };
            compare(&[source], &known).violations.len()
        };
        assert_eq!(run("/// [Chao82, Alg. 1]\n// [Keller97]"), 0);
        assert_eq!(run("/// [Chao82]"), 1);
        assert_eq!(run("/// [Chao82] [Keller97] [Other01]"), 1);
        assert_eq!(run("let x = y[Chao82]; // [Keller97]"), 1);
    }
}
