//! What tests may need and not find: a graphics device, scenes of a real size. Where it may be
//! missing they are skipped with a reason, which `cargo xtask ci` lists at its end; where it may
//! not, they fail.

use std::path::PathBuf;

/// Begins the line that a skipped test prints.
pub const SKIPPED: &str = "skipped: ";
/// Variable that makes a missing graphics device a failure, unless it is empty. `all`: whatever a
/// graphics device may offer, too.
pub const REQUIRE_GPU: &str = "MANYLIGHT_REQUIRE_GPU";
/// Variable with the folder of the scenes of a real size.
pub const SCENES: &str = "MANYLIGHT_SCENES";
/// Where they lie unless the variable says otherwise.
const BESIDE_REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");

/// Says that the test at hand is skipped, and why.
pub fn skip(reason: &str) {
    eprintln!("{SKIPPED}{reason}");
}

/// Skips a test for want of a graphics device.
///
/// Panics: where tests of graphics devices are required
pub fn skip_without_device(reason: &str) {
    assert!(!is_device_required(), "{REQUIRE_GPU} is set: {reason}");
    skip(reason);
}

/// Skips a test for want of something that few graphics devices offer.
///
/// Panics: where tests of everything are required
pub fn skip_without_feature(reason: &str) {
    let is_required = std::env::var_os(REQUIRE_GPU).is_some_and(|value| value == "all");
    assert!(!is_required, "{REQUIRE_GPU}=all: {reason}");
    skip(reason);
}

/// Whether tests without a graphics device fail.
pub fn is_device_required() -> bool {
    std::env::var_os(REQUIRE_GPU).is_some_and(|value| !value.is_empty())
}

/// Folder of the scenes of a real size; without it the test at hand is skipped.
///
/// Panics: where the variable `CI` is set and the folder is not there
pub fn scenes() -> Option<PathBuf> {
    let folder = std::env::var_os(SCENES).filter(|folder| !folder.is_empty());
    let folder = folder.map_or(PathBuf::from(BESIDE_REPOSITORY), PathBuf::from);
    if folder.join("shots").is_dir() {
        return Some(folder);
    }
    let reason = format!("no test scenes in {}; set {SCENES}", folder.display());
    assert!(std::env::var_os("CI").is_none(), "{reason}");
    skip(&reason);
    None
}
