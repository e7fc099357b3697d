//! Files of the repository, and Rust text without tests or comments.

use std::fs;
use std::path::{Path, PathBuf};

/// A text file with its path from the root, `/`-separated.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) path: String,
    pub(crate) text: String,
}

/// All files below `dir` (from the root) with one of these extensions, sorted by path; build
/// outputs and hidden folders are left out. A folder that does not exist holds nothing.
pub(crate) fn files(root: &Path, dir: &str, extensions: &[&str]) -> Result<Vec<Source>, String> {
    let mut found = Vec::new();
    let mut open = vec![root.join(dir)];
    while let Some(folder) = open.pop() {
        let Ok(entries) = fs::read_dir(&folder) else { continue };
        for entry in entries.flatten() {
            let (path, name) = (entry.path(), entry.file_name());
            let name = name.to_string_lossy();
            if path.is_dir() && !name.starts_with('.') && name != "target" && name != "shared" {
                open.push(path);
            } else if path.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found.into_iter().map(|path| read(root, path)).collect()
}

fn read(root: &Path, path: PathBuf) -> Result<Source, String> {
    let text =
        fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    let path = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
    Ok(Source { path, text })
}

/// Lines of Rust with their numbers, without `//` comments and without the items (modules,
/// functions, uses) that `#[cfg(test)]` marks. Braces in strings must balance.
pub(crate) fn product_lines(text: &str) -> Vec<(usize, &str)> {
    let mut kept = Vec::new();
    // Some(depth): inside a test item, `depth` braces deep.
    let mut skipping: Option<i32> = None;
    for (i, line) in text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or("");
        if code.trim() == "#[cfg(test)]" {
            skipping = Some(0);
            continue;
        }
        let Some(depth) = skipping else {
            kept.push((i + 1, code));
            continue;
        };
        let opened = code.matches('{').count() as i32 - code.matches('}').count() as i32;
        let depth = depth + opened;
        let ended = depth <= 0 && (code.contains('}') || code.trim_end().ends_with(';'));
        skipping = if ended { None } else { Some(depth) };
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::product_lines;

    #[test]
    fn tests_and_comments_are_left_out() {
        let text =
            "a; // x\n#[cfg(test)]\nmod tests {\n  fn t() { }\n}\nb;\n#[cfg(test)]\nmod t;\nc;";
        let kept: Vec<_> = product_lines(text).into_iter().map(|l| (l.0, l.1.trim())).collect();
        assert_eq!(kept, [(1, "a;"), (6, "b;"), (9, "c;")]);
    }
}
