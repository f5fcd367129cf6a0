//! Where the sockets of runs are.
//!
//! Each run has a file `PID.sock` in the folder `palpate` of `$XDG_RUNTIME_DIR`, or in `/tmp/palpate-UID` if the system
//! gives no such folder. Only the owner can write the folder, and only the owner and the group can enter it.

use super::SocketError;
use rustix::process::{Pid, geteuid, test_kill_process};
use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Ending of a socket's name.
const ENDING: &str = "sock";
/// Mode of a folder: its owner writes, its group reads.
const FOLDER_MODE: u32 = 0o750;

/// The folders in which runs of this user have their sockets. A run takes the first of them.
pub fn folders() -> Vec<PathBuf> {
    let given = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let given = given.filter(|path| path.is_absolute() && path.is_dir());
    let own = given.map(|path| path.join("palpate"));
    let shared = PathBuf::from(format!("/tmp/palpate-{}", geteuid().as_raw()));
    own.into_iter().chain([shared]).collect()
}

/// The path of this process's socket.
pub fn of_this_process() -> PathBuf {
    let folder = folders().into_iter().next().unwrap_or_default();
    folder.join(format!("{}.{ENDING}", std::process::id()))
}

/// The sockets in `folder`, newest first. A folder that does not exist, or that another user can write, has none.
///
/// # Errors
/// The folder cannot be read.
pub fn sockets_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    match folder.symlink_metadata() {
        Ok(data) if is_ours(&data) => {}
        Ok(_) => return Ok(Vec::new()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    }
    let entries = fs::read_dir(folder)?;
    let paths = entries.flatten().map(|entry| entry.path());
    let sockets = paths.filter(|path| path.extension().is_some_and(|ending| ending == ENDING));
    let mut dated: Vec<_> = sockets
        .map(|path| {
            let made = path.symlink_metadata().and_then(|data| data.modified());
            (made.ok(), path)
        })
        .collect();
    dated.sort_by(|a, b| b.cmp(a));
    Ok(dated.into_iter().map(|(_, path)| path).collect())
}

/// Makes `folder` if it does not exist, and checks that no other user can write it. Removes the sockets of processes that
/// no longer exist.
///
/// # Errors
/// [`SocketError`] if the folder cannot be made, or belongs to another user.
pub(super) fn prepare(folder: &Path) -> Result<(), SocketError> {
    let failed = |source| SocketError::Folder {
        folder: folder.to_owned(),
        source,
    };
    match fs::DirBuilder::new().mode(FOLDER_MODE).create(folder) {
        // The mask of the process may have taken bits away.
        Ok(()) => {
            fs::set_permissions(folder, fs::Permissions::from_mode(FOLDER_MODE)).map_err(failed)?;
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(failed(error)),
    }
    let data = folder.symlink_metadata().map_err(failed)?;
    if !is_ours(&data) {
        return Err(SocketError::NotOurs {
            folder: folder.to_owned(),
            owner: data.uid(),
            mode: data.mode() & 0o777,
        });
    }
    for socket in sockets_in(folder).map_err(failed)? {
        if is_of_a_dead_process(&socket) {
            // Another run may have removed the file at the same time.
            let _ = fs::remove_file(socket);
        }
    }
    Ok(())
}

/// Whether a folder belongs to this user and no other user can write it. `data` is not that of the target of a link: somebody
/// else could have made the link.
fn is_ours(data: &fs::Metadata) -> bool {
    data.is_dir() && data.uid() == geteuid().as_raw() && data.mode() & 0o022 == 0
}

fn is_of_a_dead_process(socket: &Path) -> bool {
    let name = socket.file_stem().and_then(|name| name.to_str());
    let pid = name
        .and_then(|name| name.parse().ok())
        .and_then(Pid::from_raw);
    pid.is_some_and(|pid| test_kill_process(pid) == Err(rustix::io::Errno::SRCH))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_folder_is_ours_and_keeps_only_sockets_of_living_processes()
    -> Result<(), Box<dyn std::error::Error>> {
        let place = tempfile::tempdir()?;
        let folder = place.path().join("palpate");
        prepare(&folder)?;
        assert_eq!(folder.metadata()?.mode() & 0o777, 0o750);
        let own = folder.join(format!("{}.sock", std::process::id()));
        // No process has this number: the kernel's limit is 2^22.
        let dead = folder.join("2147483647.sock");
        let other = folder.join("name.sock");
        for path in [&own, &dead, &other] {
            fs::write(path, [])?;
        }
        prepare(&folder)?;
        let mut left = sockets_in(&folder)?;
        left.sort();
        let mut expected = vec![own, other];
        expected.sort();
        assert_eq!(left, expected);
        Ok(())
    }

    #[test]
    fn a_folder_that_others_can_write_and_a_link_are_refused()
    -> Result<(), Box<dyn std::error::Error>> {
        let place = tempfile::tempdir()?;
        let open = place.path().join("open");
        fs::create_dir(&open)?;
        for mode in [0o770, 0o702, 0o777] {
            fs::set_permissions(&open, fs::Permissions::from_mode(mode))?;
            let refused = prepare(&open);
            assert!(
                matches!(refused, Err(SocketError::NotOurs { mode: found, .. }) if found == mode),
                "{refused:?}"
            );
        }
        let good = place.path().join("good");
        prepare(&good)?;
        let link = place.path().join("link");
        std::os::unix::fs::symlink(&good, &link)?;
        assert!(matches!(prepare(&link), Err(SocketError::NotOurs { .. })));
        assert!(sockets_in(&place.path().join("none"))?.is_empty());
        Ok(())
    }
}
