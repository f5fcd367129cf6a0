//! What the kernel counts for the thread of the tick: page faults and switches to other threads.
//!
//! The tick itself makes no system call to ask for these counts. Another thread reads them from `/proc/self/task`
//! (`proc_pid_stat(5)`, `proc_pid_status(5)`), and attributes what was added to the time since its previous reading.

use crate::clock::now_ns;
use crate::thread::TickThread;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

/// Counts of the kernel for a thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct KernelCounts {
    /// Page faults that took no data from a disk.
    pub minor_faults: u64,
    /// Page faults that took data from a disk.
    pub major_faults: u64,
    /// Switches to another thread that the thread did not ask for.
    pub involuntary_switches: u64,
}

impl KernelCounts {
    /// The counts that were added since `earlier`.
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            minor_faults: self.minor_faults.saturating_sub(earlier.minor_faults),
            major_faults: self.major_faults.saturating_sub(earlier.major_faults),
            involuntary_switches: self
                .involuntary_switches
                .saturating_sub(earlier.involuntary_switches),
        }
    }

    /// Both counts together.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            minor_faults: self.minor_faults + other.minor_faults,
            major_faults: self.major_faults + other.major_faults,
            involuntary_switches: self.involuntary_switches + other.involuntary_switches,
        }
    }

    /// Whether nothing was counted.
    pub fn is_zero(&self) -> bool {
        *self == Self::default()
    }
}

/// Reads the counts of one thread of this process.
#[derive(Debug)]
pub struct KernelWatch {
    stat: File,
    status: File,
}

impl KernelWatch {
    /// Opens the counts of the thread with the number `thread`.
    ///
    /// # Errors
    /// The thread is none of this process, or the system has no `/proc`.
    pub fn new(thread: i32) -> io::Result<Self> {
        let open = |name: &str| File::open(format!("/proc/self/task/{thread}/{name}"));
        Ok(Self {
            stat: open("stat")?,
            status: open("status")?,
        })
    }

    /// The counts so far; `None` if the thread has ended.
    pub fn read(&self) -> Option<KernelCounts> {
        let mut text = [0; 4096];
        let (minor_faults, major_faults) = faults(read(&self.stat, &mut text)?)?;
        let involuntary_switches = switches(read(&self.status, &mut text)?)?;
        Some(KernelCounts {
            minor_faults,
            major_faults,
            involuntary_switches,
        })
    }
}

/// What the kernel counted for the tick's thread between two times of the run (ns).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelWindow {
    /// The time of the previous reading.
    pub from_ns: u64,
    /// The time of this reading.
    pub to_ns: u64,
    /// The counts that were added.
    pub counts: KernelCounts,
}

/// The counts of the kernel for the tick's thread, window after window.
#[derive(Debug)]
pub struct KernelWindows {
    watch: KernelWatch,
    first_deadline_ns: u64,
    /// The time of the last reading (ns of the run), and the counts so far.
    last: (u64, KernelCounts),
}

impl KernelWindows {
    /// The windows from now on; `None` if the system does not tell the counts.
    pub fn of(thread: &TickThread) -> Option<Self> {
        let watch = KernelWatch::new(thread.number()).ok()?;
        let counts = watch.read()?;
        let first_deadline_ns = thread.first_deadline_ns();
        let now_ns = now_ns().saturating_sub(first_deadline_ns);
        Some(Self {
            watch,
            first_deadline_ns,
            last: (now_ns, counts),
        })
    }

    /// The window until now; `None` once the thread has ended.
    pub fn window(&mut self) -> Option<KernelWindow> {
        let counts = self.watch.read()?;
        let to_ns = now_ns().saturating_sub(self.first_deadline_ns);
        let (from_ns, before) = std::mem::replace(&mut self.last, (to_ns, counts));
        Some(KernelWindow {
            from_ns,
            to_ns,
            counts: counts.since(&before),
        })
    }
}

/// The number of this process's thread of that name; `None` if there is none.
pub fn thread_named(name: &str) -> Option<i32> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    threads.flatten().find_map(|thread| {
        let found = std::fs::read_to_string(thread.path().join("comm")).ok()?;
        let number = thread.file_name().to_str()?.parse().ok()?;
        (found.trim_end() == name).then_some(number)
    })
}

/// A file of the kernel from its beginning. The kernel writes it anew for each reading.
fn read<'a>(file: &File, text: &'a mut [u8]) -> Option<&'a str> {
    let length = file.read_at(text, 0).ok()?;
    str::from_utf8(text.get(..length)?).ok()
}

/// The minor and the major faults in the text of `stat`. The name of the thread may contain spaces and brackets.
fn faults(text: &str) -> Option<(u64, u64)> {
    let (_, after_name) = text.rsplit_once(')')?;
    // The state is field 3 of the manual page, the counts are fields 10 and 12.
    let mut fields = after_name.split_whitespace().skip(7);
    let minor = fields.next()?.parse().ok()?;
    let major = fields.nth(1)?.parse().ok()?;
    Some((minor, major))
}

/// The involuntary switches in the text of `status`.
fn switches(text: &str) -> Option<u64> {
    let mut lines = text.lines();
    let count = lines.find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"))?;
    count.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::thread::gettid;

    #[test]
    fn the_counts_are_those_of_the_manual_pages() {
        let stat = "77 (a (b) c) S 1 77 77 0 -1 4194624 1234 5 67 8 9 10 11 12 20 0 1 0 100";
        assert_eq!(faults(stat), Some((1234, 67)));
        let status = "Name:\tpalpate-tick\nvoluntary_ctxt_switches:\t150\nnonvoluntary_ctxt_switches:\t545\n";
        assert_eq!(switches(status), Some(545));
        for text in ["", "77", "77 (a) S", "77 (a) S 1 2 3 4 5 6 x 8 9"] {
            assert_eq!((faults(text), switches(text)), (None, None), "{text}");
        }
    }

    #[test]
    fn pages_that_a_thread_touches_first_are_its_faults() {
        const PAGES: u64 = 64;
        let (watch, ended) = std::thread::spawn(|| {
            let watch = KernelWatch::new(gettid().as_raw_nonzero().get())
                .expect("a thread of this process");
            let before = watch.read().expect("it runs");
            // Larger than what an allocator keeps: the pages come from the kernel, and the first write to each is a fault.
            let mut pages = vec![0_u8; (PAGES << 20) as usize];
            for page in pages.chunks_mut(1 << 20) {
                page[0] = 1;
            }
            let added = watch.read().expect("it runs").since(&before);
            assert!(added.minor_faults >= PAGES, "{added:?}");
            assert_eq!(added.plus(&before).since(&before), added);
            (
                watch,
                pages.iter().map(|&byte| u64::from(byte)).sum::<u64>(),
            )
        })
        .join()
        .expect("does not panic");
        assert_eq!(ended, PAGES);
        assert_eq!(watch.read(), None, "a thread that has ended has no counts");
        assert!(KernelWatch::new(1).is_err(), "a thread of another process");
    }
}
