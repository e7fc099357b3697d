//! One shader text from a file and what it imports.

use super::KernelInfo;
use std::collections::HashSet;

/// The text of a kernel: its constants, then every imported file once, then its own.
///
/// A line `import package::math::sequence;` stands for the file `math/sequence.wgsl`. Names are
/// shared by all files; an entry point is a function `main`, which no imported file may have.
///
/// Errors: a sentence that names the missing file or the circle of imports, and who asked for it
pub fn link(kernel: &KernelInfo, sources: &[(&str, &str)]) -> Result<String, String> {
    let mut linker = Linker { sources, text: kernel.prefix(), done: HashSet::new() };
    linker.add(kernel.shader, &mut Vec::new())?;
    Ok(linker.text)
}

struct Linker<'a> {
    sources: &'a [(&'a str, &'a str)],
    text: String,
    done: HashSet<String>,
}

impl Linker<'_> {
    fn add(&mut self, path: &str, open: &mut Vec<String>) -> Result<(), String> {
        if self.done.contains(path) {
            return Ok(());
        }
        let asked_by =
            || open.last().map_or(String::new(), |by| format!(", imported by {by}.wgsl"));
        if open.iter().any(|p| p == path) {
            return Err(format!("{path}.wgsl imports itself by way of {}", open.join(", ")));
        }
        let Some((_, source)) = self.sources.iter().find(|s| s.0 == path) else {
            return Err(format!("no shader {path}.wgsl{}", asked_by()));
        };
        open.push(path.to_owned());
        let mut own = String::new();
        for line in source.lines() {
            match import_of(line) {
                Some(imported) => self.add(&imported, open)?,
                None => own += line,
            }
            own.push('\n');
        }
        open.pop();
        self.text += &format!("// {path}.wgsl\n{own}");
        self.done.insert(path.to_owned());
        Ok(())
    }
}

/// The path of an import line.
fn import_of(line: &str) -> Option<String> {
    let path = line.trim().strip_prefix("import package::")?.strip_suffix(';')?;
    Some(path.replace("::", "/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCES: &[(&str, &str)] = &[
        ("a", "import package::b;\nimport package::c::d;\nfn main() { b(); d(); }"),
        ("b", "import package::c::d;\nfn b() {}"),
        ("c/d", "fn d() {}"),
        ("x", "import package::y;"),
        ("y", "import package::x;"),
        ("z", "import package::lost;"),
    ];

    fn linked(shader: &'static str) -> Result<String, String> {
        let kernel =
            KernelInfo { shader, workgroup: [4, 1, 1], scene: false, constants: &[], ports: &[] };
        link(&kernel, SOURCES)
    }

    #[test]
    fn every_file_comes_once_and_before_its_users() {
        let text = linked("a").expect("linked");
        let at = |s: &str| text.find(s).unwrap_or_else(|| panic!("{s} in {text}"));
        assert!(at("fn d()") < at("fn b()") && at("fn b()") < at("fn main()"));
        assert_eq!(text.matches("fn d()").count(), 1);
        assert!(text.contains("const GROUP_X: u32 = 4u;"));
    }

    #[test]
    fn lost_and_circular_imports_are_named() {
        let lost = linked("z").expect_err("lost");
        assert_eq!(lost, "no shader lost.wgsl, imported by z.wgsl");
        assert!(linked("x").expect_err("circle").contains("imports itself"));
    }
}
