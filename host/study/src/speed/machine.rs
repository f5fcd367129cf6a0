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
    /// Cores that this program may use. Every time is that of one thread.
    pub cores: usize,
    /// Instruction sets that the compiler was allowed to use in the whole program.
    pub built_for: Vec<&'static str>,
    /// Instruction sets that were found at run time. Factorizations select their instructions by these.
    pub found: Vec<&'static str>,
    /// Time of the calibration kernel on this machine (s), scaled to the C program.
    pub calibration: f64,
    /// Time of the calibration kernel on the machine on which the figures of the other programs were taken (s).
    pub calibration_elsewhere: f64,
}

impl Machine {
    /// This machine. The measurement takes a quarter of a second.
    pub(crate) fn here() -> Self {
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

/// The name of the first processor in the list of the system.
fn processor() -> String {
    let list = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let named = list.lines().find_map(|line| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == "model name").then(|| value.trim().to_owned())
    });
    named.unwrap_or_else(|| format!("unknown ({})", std::env::consts::ARCH))
}

/// The instruction sets that the compiler was allowed to use in the whole program.
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
