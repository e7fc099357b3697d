//! Shaders: imported from rooms above, listed for the linker, declared as kernels and checked.

use std::path::Path;

use crate::Findings;
use crate::doors::{HOUSE, rooms_of_house};
use crate::source::{self, Source};

/// Where the linker finds the text of every shader.
const LIST: &str = "crates/manylight/src/gpu/shaders.rs";

/// Looks at every shader of the house.
pub(crate) fn check(root: &Path) -> Result<Findings, String> {
    let rooms = rooms_of_house(root)?;
    let shaders = source::files(root, HOUSE, &["wgsl"])?;
    let rust = source::files(root, HOUSE, &["rs"])?;
    let list = rust.iter().find(|f| f.path == LIST).map_or("", |f| f.text.as_str());
    let mut findings = Findings::default();
    let kernels = shaders.iter().filter(|s| is_kernel(s)).count();
    findings.report.push(format!("{} shader files, {kernels} of them kernels", shaders.len()));
    for shader in &shaders {
        findings.violations.extend(upward_imports(shader, &rooms));
        let name = name_of(shader);
        if !list.contains(&format!("\"{name}\"")) {
            findings.violations.push(format!("{}: not listed in {LIST}", shader.path));
        }
        if is_kernel(shader) && !rust.iter().any(|file| declares(&file.text, name)) {
            let text = format!("{}: no kernel! declares it and lists its INFO", shader.path);
            findings.violations.push(text);
        }
    }
    Ok(findings)
}

/// Path below the house, without extension.
fn name_of(shader: &Source) -> &str {
    let path = shader.path.strip_prefix(HOUSE).unwrap_or(&shader.path);
    path.trim_start_matches('/').trim_end_matches(".wgsl")
}

fn is_kernel(shader: &Source) -> bool {
    shader.text.contains("@compute")
}

/// Whether a file declares the kernel `struct Name = "shader"`, and names `Name::INFO` somewhere:
/// in the list that its tests check.
fn declares(rust: &str, shader: &str) -> bool {
    let key = format!("= \"{shader}\"");
    rust.match_indices(&key).any(|(at, _)| {
        let name = rust[..at].trim_end().rsplit(|c: char| c.is_whitespace()).next();
        name.is_some_and(|name| rust.contains(&format!("&{name}::INFO")))
    })
}

/// Imports from rooms that `lib.rs` lists below the shader's own.
fn upward_imports(shader: &Source, rooms: &[String]) -> Vec<String> {
    let place = |name: &str| rooms.iter().position(|room| room == name);
    let own = name_of(shader).split('/').next().and_then(place);
    let imports = shader.text.lines().enumerate().filter_map(|(i, line)| {
        let path = line.trim().strip_prefix("import package::")?.strip_suffix(';')?;
        Some((i + 1, path.split("::").next()?))
    });
    let above = imports.filter(|(_, room)| place(room) > own);
    above
        .map(|(line, room)| {
            let path = &shader.path;
            format!("{path}:{line}: imports from `{room}`, which lib.rs lists below its own room")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_go_up_the_list_alone() {
        let rooms = ["math", "bvh", "world"].map(str::to_owned);
        let count = |text: &str| {
            let shader = Source { path: format!("{HOUSE}/bvh/x.wgsl"), text: text.to_owned() };
            upward_imports(&shader, &rooms).len()
        };
        assert_eq!(count("import package::math::warp;\nimport package::bvh::y;"), 0);
        assert_eq!(count("import package::world::scene;"), 1);
    }

    #[test]
    fn kernels_are_declared_and_checked() {
        let declared = "kernel! { pub struct Cast = \"world/cast\", [64, 1, 1]; }";
        assert!(!declares(declared, "world/cast"));
        assert!(declares(&format!("{declared} &[&Cast::INFO]"), "world/cast"));
        assert!(!declares(&format!("{declared} &[&Cast::INFO]"), "world/other"));
    }
}
