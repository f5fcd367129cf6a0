//! Files that the program reads. A name that leads to something else is refused if a read of it would wait for ever.

use rustix::fs::OFlags;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

/// The beginnings of the names of streams that are open already, such as the shell's `<(...)`.
const OPEN: [&str; 3] = ["/dev/stdin", "/dev/fd/", "/proc/self/fd/"];

/// Opens a file for reading. The function does not wait, because a named pipe may have no program at its other end.
///
/// # Errors
/// The error of the system. For a pipe, a socket or a folder, the error states what to give instead. Streams that are
/// open already are accepted unchanged.
pub fn open(path: &Path) -> io::Result<File> {
    if path
        .to_str()
        .is_some_and(|path| OPEN.iter().any(|open| path.starts_with(open)))
    {
        return File::open(path);
    }
    let refuse = |problem: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    // The system opens no socket, and its error does not name the reason.
    if path.metadata()?.file_type().is_socket() {
        return refuse("this is a socket; give a file");
    }
    let mut options = OpenOptions::new();
    options
        .read(true)
        .custom_flags(OFlags::NONBLOCK.bits() as i32);
    let file = options.open(path)?;
    let there = file.metadata()?;
    if there.file_type().is_fifo() {
        return refuse("this is a pipe; give a file, such as one made by `cat PIPE > FILE`");
    }
    if there.is_dir() {
        return refuse("this is a folder; give a file");
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::os::unix::net::UnixListener;

    /// A read of the pipe would wait for ever.
    #[test]
    fn a_pipe_a_socket_and_a_folder_are_refused_and_a_file_is_read() {
        let folder = std::env::temp_dir().join(format!("palpate-input-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let at = |name: &str| folder.join(name);
        let mode = rustix::fs::Mode::from_raw_mode(0o600);
        rustix::fs::mknodat(
            rustix::fs::CWD,
            at("pipe"),
            rustix::fs::FileType::Fifo,
            mode,
            0,
        )
        .expect("a pipe");
        let _listener = UnixListener::bind(at("socket")).expect("a socket");
        std::fs::create_dir(at("folder")).expect("a folder");
        for name in ["pipe", "socket", "folder"] {
            let error = open(&at(name)).expect_err("no file").to_string();
            assert!(
                error.starts_with(&format!("this is a {name}; give a file")),
                "{error}"
            );
        }
        std::fs::write(at("file"), "text").expect("a file");
        let mut text = String::new();
        let mut file = open(&at("file")).expect("a file");
        file.read_to_string(&mut text).expect("its text");
        assert_eq!(text, "text");
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
