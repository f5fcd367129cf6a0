//! The cores of the machine, the cores that the kernel isolates, and the core that the tick takes.
//!
//! An isolated core (`isolcpus`) is in no process's mask until a thread asks for the core by number, so the mask alone
//! does not show the isolated cores. The kernel lists the online and the isolated cores in
//! `/sys/devices/system/cpu/online` and `isolated`. The format is that of the kernel's documentation
//! (`Documentation/admin-guide/cputopology.rst`): numbers and ranges, separated by commas, such as `0-3,6`.
//!
//! `topology/thread_siblings_list` of each core names the **siblings**: the hardware threads of one physical core, which
//! share its pipelines and caches. A busy sibling slows the tick down.
//!
//! The choice is a pure function of the two lists and the mask. `schedule` asks the system for the chosen core.

use std::fmt::Write as _;
use std::fs::read_to_string;
use std::path::Path;

/// Numbers from this one on are errors in the list: no kernel counts so many cores, and a range is expanded in memory.
const MOST_CORES: usize = 1 << 16;

/// The choice of a core for the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CoreChoice {
    /// The first isolated core that the system gives. Without an isolated core, the last core of the process's mask.
    #[default]
    Isolated,
    /// The last core of the process's mask, if the mask has at least two.
    Last,
    /// This core, even outside the process's mask (as an isolated core is).
    Id(usize),
    /// No core: the system chooses the core of the tick.
    Anywhere,
}

/// Error for a list of cores in another format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a list of cores: found {part:?} in {list:?}, allowed: numbers below {MOST_CORES} and ranges of them, such as 0-3,6"
)]
pub struct CoreListError {
    /// The whole list.
    pub list: String,
    /// The part that is neither a number nor a range.
    pub part: String,
}

/// The cores in a list of the kernel (`"0-3,6\n"`), ascending, without duplicates. An empty list has none.
///
/// # Errors
/// [`CoreListError`] for anything but numbers and ascending ranges, separated by commas.
///
/// ```
/// use runner::cores::parse_list;
///
/// assert_eq!(parse_list("2-3,5\n"), Ok(vec![2, 3, 5]));
/// assert_eq!(parse_list("\n"), Ok(vec![]));
/// assert!(parse_list("3-2").is_err());
/// ```
pub fn parse_list(list: &str) -> Result<Vec<usize>, CoreListError> {
    let list = list.trim();
    let mut cores = Vec::new();
    if list.is_empty() {
        return Ok(cores);
    }
    for part in list.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        match (number(first), number(last)) {
            (Some(first), Some(last)) if first <= last => cores.extend(first..=last),
            _ => {
                return Err(CoreListError {
                    list: list.to_owned(),
                    part: part.to_owned(),
                });
            }
        }
    }
    cores.sort_unstable();
    cores.dedup();
    Ok(cores)
}

/// The number of a core: digits only, without a sign.
fn number(text: &str) -> Option<usize> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let number = text.parse().ok().filter(|_| digits)?;
    (number < MOST_CORES).then_some(number)
}

/// A list in the kernel's format; `cores` must ascend.
///
/// ```
/// assert_eq!(runner::cores::list(&[2, 3, 5]), "2-3,5");
/// ```
pub fn list(cores: &[usize]) -> String {
    let mut text = String::new();
    for run in cores.chunk_by(|a, b| a + 1 == *b) {
        let comma = if text.is_empty() { "" } else { "," };
        // Writing to a string does not fail.
        let _ = match run {
            [first, .., last] => write!(text, "{comma}{first}-{last}"),
            [only] => write!(text, "{comma}{only}"),
            [] => Ok(()),
        };
    }
    text
}

/// Error for the number of a core that the machine does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found core {found}, allowed: {}", self.allowed())]
pub struct NoSuchCore {
    /// The number asked for.
    pub found: usize,
    /// The online cores.
    pub online: Vec<usize>,
    /// The online cores that the kernel isolates.
    pub isolated: Vec<usize>,
}

impl NoSuchCore {
    /// The numbers that the machine has, in words.
    pub fn allowed(&self) -> String {
        let isolated = if self.isolated.is_empty() {
            "none of them isolated".into()
        } else {
            format!("preferably an isolated one ({})", list(&self.isolated))
        };
        format!("an online core ({}), {isolated}", list(&self.online))
    }
}

/// The cores of a machine. Each list ascends.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cores {
    /// The online cores; empty if the system does not list them.
    pub online: Vec<usize>,
    /// The online cores that the kernel isolates.
    pub isolated: Vec<usize>,
    /// The cores that are siblings of each other, a list for each physical core with several.
    siblings: Vec<Vec<usize>>,
}

impl Cores {
    /// The cores of this machine. A list that the system does not give, or gives in another format, is empty.
    pub fn of_this_machine() -> Self {
        Self::below(Path::new("/"))
    }

    /// The cores of the machine whose files are below `root`, as [`Self::of_this_machine`].
    pub fn below(root: &Path) -> Self {
        let read = |name: &str| {
            let text = read_to_string(root.join("sys/devices/system/cpu").join(name));
            text.ok().and_then(|text| parse_list(&text).ok())
        };
        let online = read("online").unwrap_or_default();
        let isolated = read("isolated").unwrap_or_default();
        let siblings = online.iter();
        let siblings =
            siblings.filter_map(|core| read(&format!("cpu{core}/topology/thread_siblings_list")));
        let mut siblings: Vec<_> = siblings.filter(|cores| cores.len() > 1).collect();
        siblings.sort();
        siblings.dedup();
        Self {
            siblings,
            ..Self::new(online, isolated)
        }
    }

    /// A machine with the cores `online`, of which the kernel isolates those in `isolated`. No core has a sibling.
    pub fn new(online: Vec<usize>, mut isolated: Vec<usize>) -> Self {
        isolated.retain(|core| online.contains(core));
        Self {
            online,
            isolated,
            siblings: Vec::new(),
        }
    }

    /// The same machine, in which the cores of each list are siblings of each other.
    #[cfg(test)]
    pub(crate) fn with_siblings(self, siblings: Vec<Vec<usize>>) -> Self {
        Self { siblings, ..self }
    }

    /// The other hardware threads of the physical core that has `core`.
    pub fn siblings(&self, core: usize) -> impl Iterator<Item = usize> {
        let with = self.siblings.iter().filter(move |all| all.contains(&core));
        with.flatten().copied().filter(move |other| *other != core)
    }

    /// Whether the kernel isolates `core`.
    pub(crate) fn is_isolated(&self, core: usize) -> bool {
        self.isolated.contains(&core)
    }

    /// Checks a choice before the system is asked for a core.
    ///
    /// # Errors
    /// [`NoSuchCore`] for a number that is not among the online cores. If the system does not list its cores, any
    /// number passes, and pinning will report an error.
    pub fn check(&self, choice: CoreChoice) -> Result<(), NoSuchCore> {
        match choice {
            CoreChoice::Id(found) if !self.online.is_empty() && !self.online.contains(&found) => {
                Err(NoSuchCore {
                    found,
                    online: self.online.clone(),
                    isolated: self.isolated.clone(),
                })
            }
            _ => Ok(()),
        }
    }

    /// The cores to try for the tick, best first. `allowed` is the process's mask, ascending. The last core of the mask
    /// is a candidate only if the mask has another core for the rest of the process.
    pub fn candidates(&self, choice: CoreChoice, allowed: &[usize]) -> Vec<usize> {
        let last = match allowed {
            [_, .., last] => Some(*last),
            _ => None,
        };
        match choice {
            CoreChoice::Isolated => self.isolated.iter().copied().chain(last).collect(),
            CoreChoice::Last => last.into_iter().collect(),
            CoreChoice::Id(core) => vec![core],
            CoreChoice::Anywhere => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection::btree_set;
    use proptest::prelude::*;

    proptest! {
        /// Any set of cores is read back from its written list.
        #[test]
        fn a_list_is_read_as_it_was_written(cores in btree_set(0..MOST_CORES, 0..40)) {
            let cores: Vec<_> = cores.into_iter().collect();
            prop_assert_eq!(parse_list(&list(&cores)), Ok(cores.clone()));
            // The kernel ends its lines, and may write the parts in any order.
            let mixed: Vec<_> = cores.iter().rev().map(ToString::to_string).collect();
            prop_assert_eq!(parse_list(&(mixed.join(",") + "\n")), Ok(cores));
        }

        /// A range, as the kernel writes it, holds every number between its ends.
        #[test]
        fn a_range_has_all_that_lies_between_its_ends(
            first in 0..1000_usize, length in 1..100_usize, gap in 2..50_usize,
        ) {
            let next = first + length - 1 + gap;
            let text = format!("{first}-{},{next}", first + length - 1);
            let expected: Vec<_> = (first..first + length).chain([next]).collect();
            prop_assert_eq!(parse_list(&text), Ok(expected));
        }

        /// No text makes the function panic or take much memory; an accepted list is written back to the same list.
        #[test]
        fn any_other_text_is_refused_with_its_part(text in "[-0-9, \\na]{0,12}|.{0,12}") {
            match parse_list(&text) {
                Ok(cores) => prop_assert_eq!(parse_list(&list(&cores)), Ok(cores)),
                Err(error) => prop_assert!(text.contains(&error.part)),
            }
        }
    }

    #[test]
    fn invalid_lists_are_refused() {
        for text in [
            ",",
            "1,",
            "-",
            "1-",
            "-1",
            "3-2",
            "+1",
            "0x1",
            "1 2",
            "1-2-3",
            "65536",
            "0-18446744073709551615",
            "99999999999999999999999",
        ] {
            let error = parse_list(text).expect_err(text);
            assert!(error.to_string().contains("allowed"), "{error}");
        }
    }

    #[test]
    fn the_machine_has_the_cores_that_the_kernel_lists() {
        let listed = |name: &str| {
            let text = read_to_string(format!("/sys/devices/system/cpu/{name}"));
            text.map_or_else(|_| Vec::new(), |text| parse_list(&text).expect("a list"))
        };
        let machine = Cores::of_this_machine();
        let expected = Cores::new(listed("online"), listed("isolated"));
        assert_eq!(
            (machine.online, machine.isolated),
            (expected.online, expected.isolated)
        );
    }

    #[test]
    fn the_siblings_of_a_core_are_the_other_threads_of_its_physical_core() {
        let root = tempfile::tempdir().expect("a folder");
        let cpu = root.path().join("sys/devices/system/cpu");
        let write = |name: &str, text: &str| {
            let path = cpu.join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("ours");
            std::fs::write(path, text).expect("ours");
        };
        write("online", "0-4\n");
        for (core, list) in [(0, "0,2"), (1, "1,3"), (2, "0,2"), (3, "1,3"), (4, "4")] {
            let name = format!("cpu{core}/topology/thread_siblings_list");
            write(&name, &format!("{list}\n"));
        }
        let cores = Cores::below(root.path());
        for (core, siblings) in [(0, vec![2]), (3, vec![1]), (4, vec![]), (9, vec![])] {
            assert_eq!(cores.siblings(core).collect::<Vec<_>>(), siblings, "{core}");
        }
    }

    #[test]
    fn an_isolated_core_comes_first_and_the_last_of_the_mask_after_it() {
        // As with `isolcpus=2-3`: no process's mask has the isolated cores.
        let cores = Cores::new(vec![0, 1, 2, 3], vec![2, 3]);
        let of = |choice, mask: &[usize]| cores.candidates(choice, mask);
        assert_eq!(of(CoreChoice::Isolated, &[0, 1]), [2, 3, 1]);
        assert_eq!(of(CoreChoice::Isolated, &[0]), [2, 3]);
        assert_eq!(of(CoreChoice::Last, &[0, 1]), [1]);
        assert_eq!(of(CoreChoice::Last, &[0]), [0; 0]);
        assert_eq!(of(CoreChoice::Id(3), &[0, 1]), [3]);
        assert_eq!(of(CoreChoice::Id(0), &[0, 1]), [0]);
        assert_eq!(of(CoreChoice::Anywhere, &[0, 1]), [0; 0]);
        let plain = Cores::new(vec![0, 1], vec![]);
        assert_eq!(plain.candidates(CoreChoice::Isolated, &[0, 1]), [1]);
        assert_eq!(plain.candidates(CoreChoice::Isolated, &[1]), [0; 0]);
    }

    #[test]
    fn an_isolated_core_that_is_off_is_no_choice() {
        // The kernel lists the cores that were isolated at boot, even those that have been switched off since.
        let cores = Cores::new(vec![0, 1, 3], vec![2, 3]);
        assert_eq!(cores.candidates(CoreChoice::Isolated, &[0, 1]), [3, 1]);
        assert!(cores.is_isolated(3) && !cores.is_isolated(2) && !cores.is_isolated(0));
    }

    #[test]
    fn a_core_that_does_not_exist_is_refused_with_the_list_of_cores() {
        let cores = Cores::new(vec![0, 1, 2, 3, 6], vec![3, 6]);
        for core in [0, 3, 6] {
            assert_eq!(cores.check(CoreChoice::Id(core)), Ok(()));
        }
        for core in [4, 7, usize::MAX] {
            let error = cores.check(CoreChoice::Id(core)).expect_err("not on");
            let text = error.to_string();
            for part in [
                &format!("found core {core}"),
                "0-3,6",
                "preferably an isolated one (3,6)",
            ] {
                assert!(text.contains(part), "{part} in {text}");
            }
        }
        for choice in [CoreChoice::Isolated, CoreChoice::Last, CoreChoice::Anywhere] {
            assert_eq!(cores.check(choice), Ok(()));
        }
        let plain = Cores::new(vec![0, 1], vec![]);
        let error = plain.check(CoreChoice::Id(2)).expect_err("not on");
        assert!(
            error.to_string().ends_with("(0-1), none of them isolated"),
            "{error}"
        );
        // A system that lists no cores refuses none.
        assert_eq!(Cores::default().check(CoreChoice::Id(4)), Ok(()));
    }
}
