//! Writes a file whole or not at all. No reader sees a half-written result, and a failed write leaves the
//! older file unchanged.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct AtomicFileError {
    /// The file.
    pub path: PathBuf,
    /// The system's error.
    pub source: io::Error,
}

/// Replaces the file at `path` by `content`. The function writes a temporary file in the same folder, flushes
/// this file to the disk and renames it. A link is followed. A device or a pipe is written to directly. The names of
/// the standard streams (`/dev/stdout`) mean the streams of this process, wherever they lead: a file to which the output
/// is redirected is not replaced, and a reader that closes the pipe of the output has read enough.
///
/// # Errors
/// If the folder is missing or not writable, or the disk is full.
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<(), AtomicFileError> {
    replace(path, content).map_err(|source| AtomicFileError {
        path: path.to_owned(),
        source,
    })
}

fn replace(path: &Path, content: &[u8]) -> io::Result<()> {
    match stream(path) {
        Some(Stream::Output) => {
            let mut output = io::stdout().lock();
            return match output.write_all(content).and_then(|()| output.flush()) {
                // Its reader has read enough.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                written => written,
            };
        }
        Some(Stream::Error) => return io::stderr().lock().write_all(content),
        None => {}
    }
    let target = target(path);
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(there) if !there.is_file() => {
            return fs::OpenOptions::new()
                .write(true)
                .open(path)?
                .write_all(content);
        }
        _ => {}
    }
    let folder = folder_of(&target);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".palpate-").suffix(".tmp");
    ordinary_permissions(&mut builder);
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    file.persist(&target).map_err(|error| error.error)?;
    Ok(())
}

/// A standard stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The standard output.
    Output,
    /// The standard error.
    Error,
}

/// The standard stream that the path names, if it names one.
pub fn stream(path: &Path) -> Option<Stream> {
    match path.to_str()? {
        "/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1" => Some(Stream::Output),
        "/dev/stderr" | "/dev/fd/2" | "/proc/self/fd/2" => Some(Stream::Error),
        _ => None,
    }
}

/// The file that a write to `path` would replace or create: links are followed, also a link to a file that does not
/// exist. Different paths of one place give the same path.
pub fn target(path: &Path) -> PathBuf {
    if let Ok(there) = fs::canonicalize(path) {
        return there;
    }
    let mut target = path.to_owned();
    // Linux follows 40 links.
    for _ in 0..40 {
        match fs::read_link(&target) {
            Ok(next) => target = folder_of(&target).join(next),
            Err(_) => break,
        }
    }
    // The folder may be new, too.
    match target.file_name() {
        Some(name) => self::target(folder_of(&target)).join(name),
        None => target,
    }
}

/// The folder of a file.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// Gives the temporary file the permissions of any new file, less the user's mask. By default a temporary file
/// is closed to other users.
#[cfg(unix)]
fn ordinary_permissions(builder: &mut tempfile::Builder) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(fs::Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
fn ordinary_permissions(_: &mut tempfile::Builder) {}

/// Writes a value as indented JSON, either completely or not at all.
///
/// # Errors
///
/// [`AtomicFileError`] if the file cannot be written.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), AtomicFileError> {
    // This fails only for maps whose keys are no strings and for failing writers. There are none of either.
    let mut json = serde_json::to_string_pretty(value).unwrap_or_default();
    json.push('\n');
    write_atomically(path, json.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_no_temporary_file_remains() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("plot.svg");
        write_atomically(&path, b"old and longer").expect("first");
        write_atomically(&path, b"new").expect("second");
        assert_eq!(fs::read(&path).expect("the file"), b"new");
        assert_eq!(fs::read_dir(&folder).expect("the folder").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let mode = |name: &str| {
            let metadata = fs::metadata(folder.path().join(name)).expect("the file");
            metadata.permissions().mode()
        };
        fs::write(folder.path().join("plain"), b"").expect("plain");
        write_atomically(&folder.path().join("atomic"), b"").expect("atomic");
        assert_eq!(mode("plain"), mode("atomic"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_a_device_is_written_to() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"old").expect("the file");
        std::os::unix::fs::symlink(&file, &link).expect("the link");
        write_atomically(&link, b"new").expect("through the link");
        assert_eq!(fs::read(&file).expect("the file"), b"new");
        assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
        write_atomically(Path::new("/dev/null"), b"gone").expect("the device");
        // A link to a file that does not exist yet.
        fs::remove_file(&file).expect("removed");
        write_atomically(&link, b"newer").expect("through the link");
        assert_eq!(fs::read(&file).expect("the file"), b"newer");
        assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
    }

    #[test]
    fn a_place_has_one_path_also_before_it_exists() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |path: &str| target(&folder.path().join(path));
        let expected = fs::canonicalize(&folder).expect("a folder").join("new/a/b");
        for path in ["new/a/b", "./new/./a/b", "new//a/b"] {
            assert_eq!(at(path), expected, "{path}");
        }
        let here = std::env::current_dir().expect("a folder");
        assert_eq!(target(Path::new("new/b")), here.join("new/b"));
        assert_eq!(target(Path::new("./new/b")), here.join("new/b"));
    }

    #[test]
    fn an_error_names_the_path() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("missing/plot.svg");
        let error = write_atomically(&missing, b"").expect_err("no folder");
        assert!(error.to_string().contains("missing/plot.svg"), "{error}");
        let error = write_atomically(folder.path(), b"").expect_err("a folder");
        assert_eq!(error.source.kind(), io::ErrorKind::IsADirectory);
    }
}
