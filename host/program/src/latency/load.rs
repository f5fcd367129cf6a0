//! The load that `palpate latency` makes: other processes, as the programs of a busy PC are. Each process is this program
//! again, does one kind of work without an end, and ends with the process that started it.
//!
//! The kinds are those of `stress-ng` that delay a realtime thread: busy processors, the bus of the memory, page faults, and a
//! disk that is written.

use std::fs::{File, remove_file};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio, id};

/// The first argument of a process that makes load.
const SERVE: &str = "--make-load";
/// Size of the blocks of memory that are copied, mapped and written (bytes): larger than a processor's caches.
const BLOCK: usize = 64 << 20;
/// Size of a page (bytes). A page that is larger is touched more often than necessary.
const PAGE: usize = 4096;

/// A kind of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Kind {
    /// A busy process for each core
    Cpu,
    /// Copies of memory that is larger than the caches, from a process for each two cores
    Memory,
    /// New memory that is touched page by page and given back
    Faults,
    /// A file that is written and forced to the disk, again and again
    Disk,
    /// No load: only the idle machine is measured
    None,
}

impl Kind {
    /// The name, as `--load` takes it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Memory => "memory",
            Self::Faults => "faults",
            Self::Disk => "disk",
            Self::None => "none",
        }
    }

    fn of(name: &str) -> Option<Self> {
        [Self::Cpu, Self::Memory, Self::Faults, Self::Disk]
            .into_iter()
            .find(|kind| kind.name() == name)
    }

    /// Number of its processes on a machine with `cores` cores.
    fn processes(self, cores: usize) -> usize {
        match self {
            Self::Cpu => cores,
            Self::Memory => cores.div_ceil(2),
            Self::Faults | Self::Disk => 1,
            Self::None => 0,
        }
    }
}

/// The processes that make load. They end when this value is dropped.
#[derive(Debug, Default)]
pub(super) struct Load(Vec<Child>);

impl Load {
    /// Starts the processes of `kinds` on `cores` cores. Files are written in `folder`.
    ///
    /// # Errors
    /// A process cannot be started.
    pub(super) fn begin(kinds: &[Kind], cores: usize, folder: &Path) -> io::Result<Self> {
        let program = std::env::current_exe()?;
        let mut load = Self::default();
        for kind in kinds {
            for _ in 0..kind.processes(cores) {
                let mut command = Command::new(&program);
                command.arg(SERVE).arg(kind.name()).arg(folder);
                // The pipe ends with this process, however it ends.
                command.stdin(Stdio::piped()).stdout(Stdio::null());
                load.0.push(command.spawn()?);
            }
        }
        Ok(load)
    }

    /// The error of a process that has ended; `None` while all of them work.
    pub(super) fn ended(&mut self) -> Option<String> {
        self.0.iter_mut().find_map(|child| {
            let status = child.try_wait().ok()??;
            Some(format!("a process that makes load ended: {status}"))
        })
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // A process that has ended is not there.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Makes load, if this process was started for that: `Some` with the code of the process at its end.
pub(crate) fn served() -> Option<ExitCode> {
    let mut arguments = std::env::args_os().skip(1);
    if arguments.next()? != SERVE {
        return None;
    }
    let kind = Kind::of(&arguments.next()?.to_string_lossy())?;
    let folder = PathBuf::from(arguments.next()?);
    let ends = || {
        let _ = io::stdin().read_to_end(&mut Vec::new());
        std::process::exit(0);
    };
    // A process without this thread would outlive the measurement.
    let ended = std::thread::Builder::new()
        .spawn(ends)
        .and_then(|_| work(kind, &folder));
    Some(match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            errln!("the load {}: {}: {error}", kind.name(), folder.display());
            ExitCode::FAILURE
        }
    })
}

/// Does one kind of work without an end.
fn work(kind: Kind, folder: &Path) -> io::Result<()> {
    match kind {
        Kind::Cpu => loop {
            std::hint::spin_loop();
        },
        Kind::Memory => {
            let (from, mut to) = (vec![1_u8; BLOCK], vec![0_u8; BLOCK]);
            loop {
                to.copy_from_slice(std::hint::black_box(&from));
                std::hint::black_box(&mut to);
            }
        }
        Kind::Faults => loop {
            // A block of this size is mapped anew each time.
            let mut block = vec![0_u8; BLOCK];
            for page in block.chunks_mut(PAGE) {
                page.fill(1);
            }
            std::hint::black_box(&mut block);
        },
        Kind::Disk => {
            // The file has no name while it is written, so nothing stays when the process is killed.
            let path = folder.join(format!(".palpate-load-{}", id()));
            let mut file = File::create_new(&path)?;
            remove_file(&path)?;
            let block = vec![1_u8; BLOCK / 8];
            loop {
                io::Seek::rewind(&mut file)?;
                file.write_all(&block)?;
                file.sync_all()?;
            }
        }
        Kind::None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_name_and_its_processes() {
        for (kind, processes) in [
            (Kind::Cpu, 4),
            (Kind::Memory, 2),
            (Kind::Faults, 1),
            (Kind::Disk, 1),
        ] {
            assert_eq!(
                (Kind::of(kind.name()), kind.processes(4)),
                (Some(kind), processes)
            );
        }
        assert_eq!((Kind::of("none"), Kind::of("")), (None, None));
        assert_eq!(Kind::None.processes(4), 0);
    }
}
