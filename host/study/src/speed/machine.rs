//! The machine on which times were taken.

use super::calibration;
use crate::elsewhere::SPEED;
use serde::Serialize;
use std::thread::available_parallelism;

/// The machine on which times were taken.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// The processor, as the system names it.
    pub processor: String,
    /// Cores that this program may use; every time is of one thread.
    pub cores: usize,
    /// Instruction sets for which the compiler was let to build all of the program.
    pub built_for: Vec<&'static str>,
    /// Instruction sets that were found when the program ran: factorizations choose by them.
    pub found: Vec<&'static str>,
    /// Time of the small kernel here (s), as the C program would print it.
    pub calibration: f64,
    /// Its time on the machine on which the other programs' figures were taken (s).
    pub calibration_elsewhere: f64,
}

impl Machine {
    /// This one. Takes a quarter of a second.
    pub(super) fn here() -> Self {
        Self {
            processor: processor(),
            cores: available_parallelism().map_or(1, usize::from),
            built_for: built_for(),
            found: found(),
            calibration: calibration::measure(),
            calibration_elsewhere: SPEED.calibration,
        }
    }

    /// A time taken elsewhere (s), scaled to this machine.
    pub fn scaled(&self, elsewhere: f64) -> f64 {
        elsewhere * self.calibration / self.calibration_elsewhere
    }
}

/// The first processor's name, by the system's list.
fn processor() -> String {
    let list = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let named = list.lines().find_map(|line| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == "model name").then(|| value.trim().to_owned())
    });
    named.unwrap_or_else(|| format!("unknown ({})", std::env::consts::ARCH))
}

/// Pairs of an instruction set's name and whether the compiler was let to use it everywhere.
fn built_for() -> Vec<&'static str> {
    let sets = [
        ("sse2", cfg!(target_feature = "sse2")),
        ("avx", cfg!(target_feature = "avx")),
        ("avx2", cfg!(target_feature = "avx2")),
        ("fma", cfg!(target_feature = "fma")),
        ("avx512f", cfg!(target_feature = "avx512f")),
        ("neon", cfg!(target_feature = "neon")),
    ];
    names(&sets)
}

#[cfg(target_arch = "x86_64")]
fn found() -> Vec<&'static str> {
    let sets = [
        ("sse2", is_x86_feature_detected!("sse2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    names(&sets)
}

#[cfg(not(target_arch = "x86_64"))]
fn found() -> Vec<&'static str> {
    built_for()
}

fn names(sets: &[(&'static str, bool)]) -> Vec<&'static str> {
    sets.iter()
        .filter(|(_, there)| *there)
        .map(|(name, _)| *name)
        .collect()
}
