//! One shader text from a file and what it imports.

use super::{Features, KernelInfo, SceneTraits, Variant};
use std::collections::HashSet;

/// Shader files, and which take the place of others where a device offers more.
#[derive(Clone, Copy, Debug)]
pub struct Sources<'a> {
    /// Path below `src`, without extension, and text.
    pub files: &'a [(&'a str, &'a str)],
    /// Files for devices that offer more.
    pub variants: &'a [Variant],
}

/// The text of a kernel: its constants, then every imported file once, then its own.
///
/// A line `import package::math::sequence;` stands for the file `math/sequence.wgsl`. Names are
/// shared by all files; an entry point is a function `main`, which no imported file may have. Lines
/// that `enable` something go to the top.
///
/// Errors: a sentence that names the missing file or the circle of imports, and who asked for it
pub fn link(
    kernel: &KernelInfo,
    sources: Sources<'_>,
    features: Features,
    traits: SceneTraits,
) -> Result<String, String> {
    let text = kernel.prefix(traits);
    let mut linker =
        Linker { sources, features, enabled: String::new(), text, done: HashSet::new() };
    linker.add(kernel.shader, &mut Vec::new())?;
    Ok(linker.enabled + &linker.text)
}

struct Linker<'a> {
    sources: Sources<'a>,
    features: Features,
    enabled: String,
    text: String,
    done: HashSet<String>,
}

impl Linker<'_> {
    fn add(&mut self, path: &str, open: &mut Vec<String>) -> Result<(), String> {
        let path = self.features.file(path, self.sources.variants);
        if self.done.contains(path) {
            return Ok(());
        }
        let asked_by =
            || open.last().map_or(String::new(), |by| format!(", imported by {by}.wgsl"));
        if open.iter().any(|p| p == path) {
            return Err(format!("{path}.wgsl imports itself by way of {}", open.join(", ")));
        }
        let Some((_, source)) = self.sources.files.iter().find(|s| s.0 == path) else {
            return Err(format!("no shader {path}.wgsl{}", asked_by()));
        };
        open.push(path.to_owned());
        let mut own = String::new();
        for line in source.lines() {
            match import_of(line) {
                Some(imported) => self.add(&imported, open)?,
                None if line.starts_with("enable ") => self.enable(line),
                None => own += line,
            }
            own.push('\n');
        }
        open.pop();
        self.text += &format!("// {path}.wgsl\n{own}");
        self.done.insert(path.to_owned());
        Ok(())
    }

    fn enable(&mut self, line: &str) {
        if !self.enabled.lines().any(|l| l == line) {
            self.enabled += &format!("{line}\n");
        }
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
    use crate::gpu::Feature;

    const FILES: &[(&str, &str)] = &[
        ("a", "import package::b;\nimport package::c::d;\nfn main() { b(); d(); }"),
        ("b", "import package::c::d;\nfn b() {}"),
        ("c/d", "fn d() {}"),
        ("x", "import package::y;"),
        ("y", "import package::x;"),
        ("z", "import package::lost;"),
        ("d_half", "enable f16;\nimport package::b_half;\nfn d() -> f16 {}"),
        ("b_half", "enable f16;\nfn b_half() {}"),
    ];
    const VARIANTS: &[Variant] = &[Variant { feature: Feature::Half, of: "c/d", by: "d_half" }];
    const SOURCES: Sources<'_> = Sources { files: FILES, variants: VARIANTS };

    fn linked(shader: &'static str) -> Result<String, String> {
        let kernel =
            KernelInfo { shader, workgroup: [4, 1, 1], scene: false, constants: &[], ports: &[] };
        link(&kernel, SOURCES, Features::NONE, SceneTraits::ALL)
    }

    #[test]
    fn a_variant_stands_for_its_file_where_the_feature_is_chosen() {
        let kernel = KernelInfo {
            shader: "a",
            workgroup: [4, 1, 1],
            scene: false,
            constants: &[],
            ports: &[],
        };
        let with = |feature| link(&kernel, SOURCES, Features::only(feature), SceneTraits::ALL);
        let half = with(Feature::Half).expect("linked");
        assert!(half.starts_with("enable f16;\nconst"), "{half}");
        assert!(half.contains("fn d() -> f16 {}") && half.matches("fn b_half()").count() == 1);
        assert!(!half.contains("fn d() {}"));
        let other = with(Feature::Bindless).expect("linked");
        assert_eq!(other, linked("a").expect("linked"));
    }

    #[test]
    fn kernels_that_look_at_a_scene_know_what_is_in_it() {
        let kernel = |scene| KernelInfo {
            shader: "b",
            workgroup: [4, 1, 1],
            scene,
            constants: &[],
            ports: &[],
        };
        let traits = SceneTraits { placements: false, holes: true };
        let text = |scene| link(&kernel(scene), SOURCES, Features::NONE, traits).expect("linked");
        assert!(text(true).contains("const HAS_PLACEMENTS: bool = false;"));
        assert!(text(true).contains("const HAS_HOLES: bool = true;"));
        assert!(!text(false).contains("HAS_"));
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
