//! A room may use only rooms listed above it in `crates/manylight/src/lib.rs`.

use std::path::Path;

use crate::Findings;
use crate::source::{self, Source};

pub(crate) const HOUSE: &str = "crates/manylight/src";

/// Reads the list of rooms and every room's files.
pub(crate) fn check(root: &Path) -> Result<Findings, String> {
    let files = source::files(root, HOUSE, &["rs"])?;
    let lib = files
        .iter()
        .find(|f| f.path == format!("{HOUSE}/lib.rs"))
        .ok_or_else(|| format!("{HOUSE}/lib.rs is missing"))?;
    let rooms = rooms(&lib.text);
    let mut findings = Findings::default();
    findings.report.push(format!("{} rooms: {}", rooms.len(), rooms.join(" ")));
    for file in &files {
        findings.violations.extend(upward_doors(file, &rooms));
    }
    Ok(findings)
}

/// The rooms of the house, in order.
pub(crate) fn rooms_of_house(root: &Path) -> Result<Vec<String>, String> {
    let path = root.join(HOUSE).join("lib.rs");
    let text = std::fs::read_to_string(&path);
    Ok(rooms(&text.map_err(|e| format!("cannot read {}: {e}", path.display()))?))
}

/// Names of the modules that `lib.rs` lists, in order, test modules left out.
fn rooms(lib: &str) -> Vec<String> {
    let name = |line: &str| {
        let line = line.trim();
        let line = line.strip_prefix("pub ").unwrap_or(line);
        let line = line.strip_prefix("pub(crate) ").unwrap_or(line);
        Some(line.strip_prefix("mod ")?.strip_suffix(';')?.trim().to_owned())
    };
    source::product_lines(lib).into_iter().filter_map(|(_, line)| name(line)).collect()
}

/// Uses of rooms below this file's own room. Tests may look anywhere.
fn upward_doors(file: &Source, rooms: &[String]) -> Vec<String> {
    let Some(inside) = file.path.strip_prefix(HOUSE).and_then(|p| p.strip_prefix('/')) else {
        return Vec::new();
    };
    let room = inside.split('/').next().unwrap_or(inside).trim_end_matches(".rs");
    let is_test = inside.split('/').any(|part| matches!(part, "tests.rs" | "tests"));
    let Some(own) = rooms.iter().position(|r| r == room).filter(|_| !is_test) else {
        return Vec::new();
    };
    let lines = source::product_lines(&file.text);
    let code: String = lines.iter().flat_map(|(_, line)| [*line, "\n"]).collect();
    used_rooms(&code)
        .into_iter()
        .filter_map(|(offset, used)| {
            let below = rooms.iter().position(|r| *r == used)? > own;
            let line = lines.get(code[..offset].matches('\n').count())?.0;
            let text = format!(
                "{}:{line}: room `{room}` uses `{used}`, which lib.rs lists below it; move the \
                 code to the lower room or the shared part to a room above both",
                file.path
            );
            below.then_some(text)
        })
        .collect()
}

/// First path segments after `crate::`, groups in braces included, with byte offsets.
fn used_rooms(code: &str) -> Vec<(usize, String)> {
    let mut used = Vec::new();
    for (start, key) in code.match_indices("crate::") {
        let word_before = code[..start].chars().next_back();
        if word_before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let after = start + key.len();
        if !code[after..].starts_with('{') {
            used.push((after, identifier(&code[after..])));
            continue;
        }
        // In a group, a room's name follows the opening brace or a comma at depth one.
        let mut depth = 0;
        for (i, c) in code[after..].char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                break;
            }
            if depth == 1 && (c == '{' || c == ',') {
                let rest = &code[after + i + 1..];
                let space = rest.len() - rest.trim_start().len();
                used.push((after + i + 1 + space, identifier(rest.trim_start())));
            }
        }
    }
    used
}

fn identifier(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIB: &str = "pub mod error;\nmod bvh; // rays\npub(crate) mod gather;\n\
                       #[cfg(test)]\nmod scenes;\nmod frame;\n";

    fn doors(path: &str, text: &str) -> usize {
        let file = Source { path: format!("{HOUSE}/{path}"), text: text.to_owned() };
        upward_doors(&file, &rooms(LIB)).len()
    }

    #[test]
    fn rooms_are_read_in_order() {
        assert_eq!(rooms(LIB), ["error", "bvh", "gather", "frame"]);
    }

    #[test]
    fn downward_and_own_doors_are_open() {
        assert_eq!(doors("gather/mod.rs", "use crate::bvh::Bvh;\nuse crate::gather::X;"), 0);
        assert_eq!(doors("lib.rs", "use crate::frame::X;"), 0);
        assert_eq!(doors("gather/mod.rs", "// crate::frame\nuse mycrate::frame::X;"), 0);
    }

    #[test]
    fn upward_doors_are_seen() {
        assert_eq!(doors("bvh/mod.rs", "use crate::gather::X;"), 1);
        assert_eq!(doors("bvh.rs", "fn f() { crate::frame::run() }"), 1);
        assert_eq!(doors("gather/grid/cpu.rs", "use crate::{error::Error,\n frame};"), 1);
        assert_eq!(doors("bvh/cpu.rs", "use crate::{bvh::{gather, X}, gather::{frame}};"), 1);
    }

    #[test]
    fn tests_may_look_anywhere() {
        assert_eq!(doors("bvh/tests.rs", "use crate::frame::X;"), 0);
        let text = "#[cfg(test)]\nmod tests {\n use crate::frame::X;\n}\n";
        assert_eq!(doors("bvh/mod.rs", text), 0);
        assert_eq!(doors("bvh/mod.rs", &format!("{text}use crate::frame::X;")), 1);
    }
}
