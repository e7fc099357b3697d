//! What the checks need beyond Rust.

use crate::driver::Driver;
use std::path::Path;
use std::process::{Command, ExitCode};

/// Where Vulkan drivers tell of themselves.
const DRIVERS: [&str; 2] = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
/// Debian's packages of a Vulkan driver that needs no graphics hardware, and of the loader.
const DRIVER_PACKAGES: [&str; 2] = ["mesa-vulkan-drivers", "libvulkan1"];
/// Where Vulkan layers tell of themselves.
const LAYERS: [&str; 3] = [
    "/usr/share/vulkan/explicit_layer.d",
    "/usr/local/share/vulkan/explicit_layer.d",
    "/etc/vulkan/explicit_layer.d",
];
/// File of the layer that checks calls.
const VALIDATION: &str = "VkLayer_khronos_validation.json";
/// Debian's package of it.
const LAYER_PACKAGES: [&str; 1] = ["vulkan-validationlayers"];

/// Installs a software Vulkan driver where there is no Vulkan driver at all, and the layer that
/// checks what is asked of one; sets a driver aside that offers more.
pub(crate) fn run(root: &Path) -> ExitCode {
    if has_driver() {
        println!("setup: a Vulkan driver is there");
    } else if !(install(&DRIVER_PACKAGES) && has_driver()) {
        eprintln!(
            "setup: no Vulkan driver, and {} could not be installed with apt-get; install a driver \
             for this machine, or run the checks without the tests of the graphics device",
            DRIVER_PACKAGES.join(" and ")
        );
        return ExitCode::FAILURE;
    }
    if has_validation() {
        println!("setup: the Vulkan validation layer is there");
    } else if !(install(&LAYER_PACKAGES) && has_validation()) {
        // The tests that need it say so.
        eprintln!("setup: {} could not be installed with apt-get", LAYER_PACKAGES[0]);
    }
    match Driver::set_aside(root) {
        Ok(_) => println!("setup: a Vulkan driver with ray queries is set aside"),
        // One step of the checks needs it, and says so.
        Err(problem) => eprintln!("setup: no Vulkan driver with ray queries set aside: {problem}"),
    }
    ExitCode::SUCCESS
}

/// Installs Debian packages; whether that went well.
fn install(packages: &[&str]) -> bool {
    let options = ["install", "-y", "-qq", "--no-install-recommends"];
    let is_done = apt(&["update", "-qq"]).and_then(|()| apt(&[&options, packages].concat()));
    if is_done.is_ok() {
        println!("setup: {} installed", packages.join(" and "));
    }
    is_done.is_ok()
}

fn has_validation() -> bool {
    LAYERS.iter().any(|folder| Path::new(folder).join(VALIDATION).exists())
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
