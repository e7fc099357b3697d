//! What the checks need beyond Rust.

use std::path::Path;
use std::process::{Command, ExitCode};

/// Where Vulkan drivers tell of themselves.
const DRIVERS: [&str; 2] = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
/// Debian's packages of a Vulkan driver that needs no graphics hardware, and of the loader.
const PACKAGES: [&str; 2] = ["mesa-vulkan-drivers", "libvulkan1"];

/// Installs a software Vulkan driver where there is no Vulkan driver at all.
pub(crate) fn run() -> ExitCode {
    if has_driver() {
        println!("setup: a Vulkan driver is there");
        return ExitCode::SUCCESS;
    }
    let update = apt(&["update", "-qq"]);
    let install = ["install", "-y", "-qq", "--no-install-recommends", PACKAGES[0], PACKAGES[1]];
    if update.and_then(|()| apt(&install)).is_ok() && has_driver() {
        println!("setup: {} installed", PACKAGES.join(" and "));
        return ExitCode::SUCCESS;
    }
    eprintln!(
        "setup: no Vulkan driver, and {} could not be installed with apt-get; install a driver \
         for this machine, or run the checks without the tests of the graphics device",
        PACKAGES.join(" and ")
    );
    ExitCode::FAILURE
}

fn has_driver() -> bool {
    let is_driver =
        |entry: std::fs::DirEntry| entry.path().extension().is_some_and(|e| e == "json");
    let folder = |path: &&str| std::fs::read_dir(Path::new(path)).into_iter().flatten().flatten();
    let named = std::env::var_os("VK_ICD_FILENAMES").or(std::env::var_os("VK_DRIVER_FILES"));
    named.is_some() || DRIVERS.iter().flat_map(folder).any(is_driver)
}

/// Runs apt-get, as root by way of sudo where that is not who we are.
fn apt(args: &[&str]) -> Result<(), ()> {
    let run = |program: &str, args: &[&str]| {
        let mut command = Command::new(program);
        command.args(args).env("DEBIAN_FRONTEND", "noninteractive");
        command.status().is_ok_and(|s| s.success())
    };
    let with_sudo: Vec<&str> = ["-n", "apt-get"].iter().chain(args).copied().collect();
    if run("apt-get", args) || run("sudo", &with_sudo) { Ok(()) } else { Err(()) }
}
