//! Checks of the fields of the settings while they are read, as `check` does it for scenes.

use super::spec::CoreName;
use crate::check::visitors::{Number, Whole};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Unexpected, Visitor};
use std::fmt;
use std::path::PathBuf;

/// Most cores of a machine, as Linux counts them in a mask of the usual size.
const MOST_CORES: usize = 1024;

macro_rules! wholes {
    ($($name:ident: $allowed:literal, $low:literal, $high:literal => $kind:ty;)*) => {$(
        pub(super) fn $name<'de, D: Deserializer<'de>>(from: D) -> Result<Option<$kind>, D::Error> {
            let whole = Whole { allowed: $allowed, low: $low, high: $high };
            from.deserialize_u64(whole).map(|n| Some(n as $kind))
        }
    )*};
}

wholes! {
    optional_priority: "a whole number from 1 to 99", 1, 99 => u8;
    optional_file_mib: "a whole number from 1 to 1048576 (MiB)", 1, 1_048_576 => u64;
    optional_file_minutes: "a whole number from 1 to 10080 (min), a week", 1, 10_080 => u64;
    optional_total_mib: "a whole number from 1 to 1073741824 (MiB)", 1, 1_073_741_824 => u64;
}

/// Time after which something is tried again (s).
pub(super) fn optional_retry<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let allowed = "a number from 0.1 to 3600 (s)";
    let test = |v| (0.1..=3600.0).contains(&v);
    from.deserialize_f64(Number { allowed, test }).map(Some)
}

pub(super) fn optional_core<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<CoreName>, D::Error> {
    from.deserialize_any(CoreVisitor).map(Some)
}

pub(super) fn optional_cores<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Vec<usize>>, D::Error> {
    from.deserialize_seq(CoresVisitor).map(Some)
}

pub(super) fn optional_absolute<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<PathBuf>, D::Error> {
    from.deserialize_str(AbsoluteVisitor).map(Some)
}

struct CoreVisitor;

impl Visitor<'_> for CoreVisitor {
    type Value = CoreName;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("the number of a core, or `isolated`, `last` or `any`")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<CoreName, E> {
        match name {
            "isolated" => Ok(CoreName::Isolated),
            "last" => Ok(CoreName::Last),
            "any" => Ok(CoreName::Any),
            _ => Err(E::invalid_value(Unexpected::Str(name), &self)),
        }
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<CoreName, E> {
        let number = usize::try_from(value).ok().filter(|n| *n < MOST_CORES);
        number
            .map(CoreName::Number)
            .ok_or_else(|| E::invalid_value(Unexpected::Signed(value), &self))
    }
}

/// The number of a core.
struct Core(usize);

impl<'de> Deserialize<'de> for Core {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let whole = Whole {
            allowed: "the number of a core, 0 or above",
            low: 0,
            high: MOST_CORES as u64 - 1,
        };
        from.deserialize_u64(whole).map(|n| Self(n as usize))
    }
}

struct CoresVisitor;

impl<'de> Visitor<'de> for CoresVisitor {
    type Value = Vec<usize>;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a list of the numbers of cores, at least one, such as [1, 2]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Vec<usize>, A::Error> {
        let mut cores = Vec::new();
        while let Some(Core(core)) = from.next_element()? {
            cores.push(core);
        }
        if cores.is_empty() {
            return Err(A::Error::invalid_length(0, &self));
        }
        cores.sort_unstable();
        cores.dedup();
        Ok(cores)
    }
}

struct AbsoluteVisitor;

impl Visitor<'_> for AbsoluteVisitor {
    type Value = PathBuf;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("an absolute path, which begins with /")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<PathBuf, E> {
        let path = PathBuf::from(text);
        let plain = path.is_absolute() && !text.chars().any(char::is_control);
        plain
            .then_some(path)
            .ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}
