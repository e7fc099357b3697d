//! Files that appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::Error;

/// A sink that writes and seeks, as the file encoders need.
pub trait WriteSeek: Write + Seek {}
impl<T: Write + Seek> WriteSeek for T {}

/// Writes a file through a temporary one in the same folder that replaces it at the end.
///
/// The file is synced before the rename, so that a crash leaves the earlier content or the new
/// one. A link is followed; a device such as `/dev/null` is written directly.
///
/// Errors: `Write` on system failures and where [`check_target`] refuses, else what `write`
/// returns; in both cases the temporary file is removed and an earlier file is untouched.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut dyn WriteSeek) -> Result<(), Error>,
) -> Result<(), Error> {
    check_target(path)?;
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if target.exists() && !target.is_file() {
        let device = OpenOptions::new().write(true).open(&target);
        return fill(path, device.map_err(|source| Error::write(path, source))?, write).map(drop);
    }
    let (file, temporary) = create_temporary(&target).map_err(|e| Error::write(path, e))?;
    let guard = RemoveOnDrop(Some(temporary));
    let file = fill(path, file, write)?;
    file.sync_all().map_err(|source| Error::write(path, source))?;
    drop(file);
    guard.rename(&target).map_err(|source| Error::write(path, source))
}

/// Refuses what can be no output: folders, too long names, and pipes, whose opening waits for a
/// reader. Devices such as `/dev/null` are none of these.
///
/// Errors: `Write`.
pub fn check_target(path: &Path) -> Result<(), Error> {
    let kind = match fs::metadata(path) {
        Ok(meta) => meta.file_type(),
        Err(error) if error.kind() == io::ErrorKind::InvalidFilename => {
            return Err(Error::write(path, error));
        }
        Err(_) => return Ok(()),
    };
    if kind.is_dir() {
        return Err(Error::write(path, io::ErrorKind::IsADirectory.into()));
    }
    #[cfg(unix)]
    let is_device = std::os::unix::fs::FileTypeExt::is_char_device(&kind);
    #[cfg(not(unix))]
    let is_device = true;
    if !kind.is_file() && !is_device {
        return Err(Error::write(path, io::Error::other("it is a pipe or a socket, not a file")));
    }
    Ok(())
}

/// Runs the caller's writer through a buffer and flushes it.
fn fill(
    path: &Path,
    file: File,
    write: impl FnOnce(&mut dyn WriteSeek) -> Result<(), Error>,
) -> Result<File, Error> {
    let mut sink = BufWriter::with_capacity(1 << 16, file);
    write(&mut sink)?;
    sink.into_inner().map_err(|error| Error::write(path, error.into_error()))
}

/// Creates a new hidden file beside the target.
fn create_temporary(target: &Path) -> io::Result<(File, PathBuf)> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    if target.file_name().is_none() {
        return Err(io::ErrorKind::InvalidFilename.into());
    }
    loop {
        // Not made from the target's name, which may be as long as names can be.
        let count = COUNTER.fetch_add(1, Ordering::Relaxed);
        let temporary = target.with_file_name(format!(".manylight-{}-{count}.tmp", process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
            opened => return opened.map(|file| (file, temporary)),
        }
    }
}

/// A temporary file that vanishes unless it is renamed.
struct RemoveOnDrop(Option<PathBuf>);

impl RemoveOnDrop {
    /// Gives the file its final name.
    fn rename(mut self, target: &Path) -> io::Result<()> {
        if let Some(temporary) = &self.0 {
            fs::rename(temporary, target)?;
        }
        self.0 = None;
        Ok(())
    }
}

impl Drop for RemoveOnDrop {
    fn drop(&mut self) {
        if let Some(temporary) = &self.0 {
            // A failure here has no remedy and must not hide the error being returned.
            let _ = fs::remove_file(temporary);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Folder;

    #[test]
    fn failure_leaves_the_earlier_file_and_no_other() {
        let folder = Folder::new();
        let path = folder.path("kept.bin");
        write_atomic(&path, |sink| {
            sink.write_all(b"old").map_err(|source| Error::write(Path::new("x"), source))
        })
        .unwrap();
        let failed = write_atomic(&path, |sink| {
            sink.write_all(b"half").map_err(|source| Error::write(Path::new("x"), source))?;
            Err(Error::encode(Path::new("x"), "test", "interrupted"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(folder.file_count(), 1);
    }

    #[test]
    fn the_longest_name_is_written() {
        let folder = Folder::new();
        let path = folder.path(&"n".repeat(255));
        write_atomic(&path, |_| Ok(())).unwrap();
        assert!(path.exists());
    }

    #[test]
    fn missing_folder_and_folder_as_target_are_errors() {
        let folder = Folder::new();
        assert!(write_atomic(&folder.path("no/such/file"), |_| Ok(())).is_err());
        assert!(write_atomic(&folder.path(""), |_| Ok(())).is_err());
        assert!(write_atomic(Path::new("/"), |_| Ok(())).is_err());
        assert_eq!(folder.file_count(), 0);
    }

    #[test]
    fn panic_in_the_writer_removes_the_temporary_file() {
        let folder = Folder::new();
        let path = folder.path("x");
        let caught = std::panic::catch_unwind(|| write_atomic(&path, |_| panic!("on purpose")));
        assert!(caught.is_err());
        assert_eq!(folder.file_count(), 0);
    }
}
