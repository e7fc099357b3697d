//! A Vulkan driver beside the system's: one that works on the processor and offers what the
//! system's may lack. It is unpacked into the build folder and never installed.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Debian's packages that are unpacked; what else they need, the system's driver needs too.
const PACKAGES: [&str; 3] = ["mesa-vulkan-drivers", "libdrm2", "libdrm-amdgpu1"];
/// Who signs them.
const KEYRING: &str = "/usr/share/keyrings/debian-archive-keyring.gpg";
/// Name of the driver's file.
const LIBRARY: &str = "libvulkan_lvp.so";
/// Name of the file that tells the loader of it.
const DESCRIPTION: &str = "driver.json";

/// A driver that is ready.
#[derive(Debug)]
pub(crate) struct Driver {
    description: PathBuf,
    libraries: PathBuf,
}

impl Driver {
    /// The one that was set aside.
    pub(crate) fn find(root: &Path) -> Option<Self> {
        let folder = folder(root);
        let description = folder.join(DESCRIPTION);
        let libraries = libraries(&folder)?;
        description.exists().then_some(Self { description, libraries })
    }

    /// Sets one aside, unless it is there.
    ///
    /// Errors: a sentence that says what is missing, where there is no Debian or no network
    pub(crate) fn set_aside(root: &Path) -> Result<Self, String> {
        if let Some(driver) = Self::find(root) {
            return Ok(driver);
        }
        let folder = folder(root);
        // What an earlier try left.
        let _ = std::fs::remove_dir_all(&folder);
        download(&suite()?, &folder)?;
        let libraries = libraries(&folder).ok_or(format!("the packages hold no {LIBRARY}"))?;
        let library = libraries.join(LIBRARY);
        let missing = missing(&library, &libraries)?;
        if !missing.is_empty() {
            return Err(format!("{LIBRARY} needs {missing}, which this system lacks"));
        }
        // The loader takes any version up to its own.
        let text = format!(
            "{{\"file_format_version\": \"1.0.0\", \"ICD\": {{\"library_path\": {library:?}, \
             \"api_version\": \"1.3.0\"}}}}\n"
        );
        let description = folder.join(DESCRIPTION);
        std::fs::write(&description, text).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(Self { description, libraries })
    }

    /// Environment of programs that use it and no other.
    pub(crate) fn environment(&self) -> Vec<(&'static str, PathBuf)> {
        let description = || self.description.clone();
        let libraries = self.libraries.clone();
        // The second name is that of older loaders.
        vec![
            ("VK_DRIVER_FILES", description()),
            ("VK_ICD_FILENAMES", description()),
            ("LD_LIBRARY_PATH", libraries),
        ]
    }
}

/// Where it lies: in the folder of builds.
fn folder(root: &Path) -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    root.join(target).join("vulkan")
}

/// The folder with the driver's file.
fn libraries(folder: &Path) -> Option<PathBuf> {
    let machines = std::fs::read_dir(folder.join("usr/lib")).ok()?.flatten();
    machines.map(|machine| machine.path()).find(|machine| machine.join(LIBRARY).exists())
}

/// The part of Debian's archive with a driver that is new enough.
fn suite() -> Result<String, String> {
    let text = std::fs::read_to_string("/etc/os-release").unwrap_or_default();
    let value = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key));
        line.map(|value| value.trim_matches('"').to_owned())
    };
    let name = value("VERSION_CODENAME=").filter(|_| value("ID=").as_deref() == Some("debian"));
    match name.as_deref() {
        None => Err("this is no Debian with a name".to_owned()),
        Some("bookworm") => Ok("bookworm-backports".to_owned()),
        Some(name) => Ok(name.to_owned()),
    }
}

/// Downloads the packages and unpacks them, with lists and caches of their own.
fn download(suite: &str, folder: &Path) -> Result<(), String> {
    let packages = folder.join("packages");
    let lists = folder.join("lists");
    for path in [&packages, &lists.join("partial"), &folder.join("cache/archives/partial")] {
        std::fs::create_dir_all(path).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let sources = folder.join("sources.list");
    let line = format!("deb [signed-by={KEYRING}] http://deb.debian.org/debian {suite} main\n");
    std::fs::write(&sources, line).map_err(|e| format!("{}: {e}", sources.display()))?;
    let options = [
        format!("Dir::Etc::sourcelist={}", sources.display()),
        "Dir::Etc::sourceparts=-".to_owned(),
        format!("Dir::State::lists={}", lists.display()),
        format!("Dir::Cache={}", folder.join("cache").display()),
        "APT::Sandbox::User=root".to_owned(),
    ];
    let apt = |arguments: &[&str]| {
        let options = options.iter().flat_map(|option| ["-o", option]);
        run(Command::new("apt-get").args(options).arg("-qq").args(arguments).current_dir(&packages))
    };
    apt(&["update"])?;
    apt(&[&["download"], &PACKAGES[..]].concat())?;
    let entries = std::fs::read_dir(&packages).map_err(|e| format!("{}: {e}", folder.display()))?;
    for package in entries.flatten().map(|entry| entry.path()) {
        run(Command::new("dpkg").arg("-x").arg(package).arg(folder))?;
    }
    for path in [packages, lists, folder.join("cache")] {
        std::fs::remove_dir_all(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{name} failed, {status}")),
        Err(problem) => Err(format!("{name} does not start: {problem}")),
    }
}

/// What a library needs and does not find.
fn missing(library: &Path, beside: &Path) -> Result<String, String> {
    let output = Command::new("ldd").arg(library).env("LD_LIBRARY_PATH", beside).output();
    let output = output.map_err(|problem| format!("ldd does not start: {problem}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let names = text.lines().filter(|line| line.contains("not found"));
    let names: Vec<_> = names.filter_map(|line| line.split_whitespace().next()).collect();
    Ok(names.join(", "))
}
