//! Which cores the machine has, which of them the kernel keeps aside, and which one the tick takes.
//!
//! A core that is isolated (`isolcpus`) is in no process's mask until a thread asks for it by number, so the mask
//! alone does not show it. The kernel lists the cores that are on and those that are isolated in
//! `/sys/devices/system/cpu/online` and `isolated`, in the format of its documentation
//! (`Documentation/admin-guide/cputopology.rst`): numbers and ranges with commas between, `0-3,6`.
//!
//! The choice is a pure function of the two lists and the mask; `schedule` asks the system for what was chosen.

use std::fmt::Write as _;
use std::fs::read_to_string;

/// Numbers from here on are taken for an error in the list: no kernel counts so many cores, and a range is written
/// out in memory.
const MOST_CORES: usize = 1 << 16;

/// Which core the tick is pinned to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CoreChoice {
    /// The first isolated core that the system gives; without one, the last of the process's mask.
    #[default]
    Isolated,
    /// The last of those in the process's mask, if there are at least two.
    Last,
    /// This one, also when it is outside the process's mask (an isolated core is).
    Id(usize),
    /// None: the tick goes where the system puts it.
    Anywhere,
}

/// A list of cores that cannot be read.
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

/// The cores in a list of the kernel's (`"0-3,6\n"`), ascending, each once. An empty list has none.
///
/// # Errors
/// [`CoreListError`] for anything but numbers and ascending ranges with commas between.
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

/// A number of a core: digits only, without a sign.
fn number(text: &str) -> Option<usize> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let number = text.parse().ok().filter(|_| digits)?;
    (number < MOST_CORES).then_some(number)
}

/// A list in the kernel's format; `cores` ascending.
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

/// A core that was asked for by number and is not there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "found core {found}, allowed: a core that is on ({}), {}",
    list(online),
    isolated_too(isolated)
)]
pub struct NoSuchCore {
    /// The number asked for.
    pub found: usize,
    /// The cores that are on.
    pub online: Vec<usize>,
    /// Those of them that the kernel keeps aside.
    pub isolated: Vec<usize>,
}

fn isolated_too(isolated: &[usize]) -> String {
    if isolated.is_empty() {
        "none of them isolated".into()
    } else {
        format!("best an isolated one ({})", list(isolated))
    }
}

/// The cores of a machine. Each list ascends.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cores {
    /// Those that are on; nothing where the system does not say.
    pub online: Vec<usize>,
    /// Those that are on and that the kernel keeps aside.
    pub isolated: Vec<usize>,
}

impl Cores {
    /// This machine's. Lists that the system does not give, or gives in another format, are empty.
    pub fn of_this_machine() -> Self {
        let read = |name: &str| {
            let text = read_to_string(format!("/sys/devices/system/cpu/{name}"));
            text.ok().and_then(|text| parse_list(&text).ok())
        };
        let online = read("online").unwrap_or_default();
        let isolated = read("isolated").unwrap_or_default();
        Self::new(online, isolated)
    }

    /// A machine with the cores `online` and, of those, the ones in `isolated` kept aside.
    pub fn new(online: Vec<usize>, mut isolated: Vec<usize>) -> Self {
        isolated.retain(|core| online.contains(core));
        Self { online, isolated }
    }

    /// Whether the kernel keeps `core` aside.
    pub fn is_isolated(&self, core: usize) -> bool {
        self.isolated.contains(&core)
    }

    /// Checks a choice before anything is asked of the system.
    ///
    /// # Errors
    /// [`NoSuchCore`] for a number that is not among the cores that are on. Where the system does not list them, any
    /// number passes, and pinning tells.
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

    /// The cores to try for the tick, best first, when the process's mask is `allowed` (ascending). The last of the
    /// mask is among them only where the mask has another core for the rest of the process.
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
        /// What is written is read back, for any set of cores.
        #[test]
        fn a_list_is_read_as_it_was_written(cores in btree_set(0..MOST_CORES, 0..40)) {
            let cores: Vec<_> = cores.into_iter().collect();
            prop_assert_eq!(parse_list(&list(&cores)), Ok(cores.clone()));
            // The kernel ends its lines, and the order of the parts is the kernel's own affair.
            let mixed: Vec<_> = cores.iter().rev().map(ToString::to_string).collect();
            prop_assert_eq!(parse_list(&(mixed.join(",") + "\n")), Ok(cores));
        }

        /// Ranges in a row, as the kernel writes them, are every number between their ends.
        #[test]
        fn a_range_has_all_that_lies_between_its_ends(
            first in 0..1000_usize, length in 1..100_usize, gap in 2..50_usize,
        ) {
            let next = first + length - 1 + gap;
            let text = format!("{first}-{},{next}", first + length - 1);
            let expected: Vec<_> = (first..first + length).chain([next]).collect();
            prop_assert_eq!(parse_list(&text), Ok(expected));
        }

        /// No text makes it panic or take much memory, and what it accepts it writes back to the same list.
        #[test]
        fn any_other_text_is_refused_with_its_part(text in "[-0-9, \\na]{0,12}|.{0,12}") {
            match parse_list(&text) {
                Ok(cores) => prop_assert_eq!(parse_list(&list(&cores)), Ok(cores)),
                Err(error) => prop_assert!(text.contains(&error.part)),
            }
        }
    }

    #[test]
    fn lists_that_are_none_are_refused() {
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
    fn an_isolated_core_comes_first_and_the_last_of_the_mask_after_it() {
        // As with `isolcpus=2-3`: the mask of every process leaves the isolated cores out.
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
        // The kernel lists what was isolated at boot, also after it has been switched off.
        let cores = Cores::new(vec![0, 1, 3], vec![2, 3]);
        assert_eq!(cores.candidates(CoreChoice::Isolated, &[0, 1]), [3, 1]);
        assert!(cores.is_isolated(3) && !cores.is_isolated(2) && !cores.is_isolated(0));
    }

    #[test]
    fn a_number_that_is_no_core_is_refused_with_those_that_are() {
        let cores = Cores::new(vec![0, 1, 2, 3, 6], vec![3, 6]);
        for core in [0, 3, 6] {
            assert_eq!(cores.check(CoreChoice::Id(core)), Ok(()));
        }
        for core in [4, 7, usize::MAX] {
            let error = cores.check(CoreChoice::Id(core)).expect_err("not on");
            let text = error.to_string();
            for part in [&format!("found core {core}"), "0-3,6", "isolated one (3,6)"] {
                assert!(text.contains(part), "{part} in {text}");
            }
        }
        for choice in [CoreChoice::Isolated, CoreChoice::Last, CoreChoice::Anywhere] {
            assert_eq!(cores.check(choice), Ok(()));
        }
        // A system that tells nothing refuses nothing.
        assert_eq!(Cores::default().check(CoreChoice::Id(4)), Ok(()));
    }
}
