//! The control law cannot panic or allocate. It is linked from the entries of the tick, and unreachable code is dropped.
//! The result contains no panic, and calls nothing but the device and copies of memory.
//!
//! The test reads the linked object, not a library archive. An archive contains code that the linker would drop, or no
//! code yet.
#![cfg(all(target_os = "linux", target_pointer_width = "64"))]

use object::elf::FileHeader64;
use object::read::elf::ElfFile;
use object::{Endianness, Object, ObjectSymbol};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The tick's entries, as `tests/no_panic/src/lib.rs` defines them.
const ENTRIES: [&str; 8] = [
    "law_accept",
    "law_accept_packed",
    "law_accept_patch",
    "law_cycle",
    "law_record",
    "law_tool_accept",
    "law_tool_tick",
    "law_velocity",
];
/// The functions of the device, which the tick must call.
const DEVICE: [&str; 2] = ["device_read", "device_write"];
/// The functions that the compiler may call to copy or compare plain data.
const MEMORY: [&str; 5] = ["memcpy", "memmove", "memset", "memcmp", "bcmp"];
/// Parts of the names of functions that panic: in `core::panicking`, or the cold paths of slices, results and options.
const PANICS: [&str; 2] = ["panic", "_fail"];

/// The names in an object.
struct Names {
    defined: Vec<String>,
    /// The names that are called and defined elsewhere.
    called: Vec<String>,
}

impl Names {
    fn panics(&self) -> Vec<&String> {
        let all = self.defined.iter().chain(&self.called);
        all.filter(|name| PANICS.iter().any(|part| name.contains(part)))
            .collect()
    }

    fn foreign(&self) -> Vec<&String> {
        let known = |name: &str| DEVICE.contains(&name) || MEMORY.contains(&name);
        self.called.iter().filter(|name| !known(name)).collect()
    }
}

/// Links the law, with the versions of the workspace, into a folder of its own.
fn link(name: &str, features: &[&str]) -> PathBuf {
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("no_panic");
    std::fs::copy(fixture.join("../../Cargo.lock"), fixture.join("Cargo.lock"))
        .expect("the workspace's versions can be taken over");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("no_panic");
    let output = Command::new(env!("CARGO"))
        .args(["rustc", "--lib", "--release", "--offline"])
        .args(features)
        .arg("--manifest-path")
        .arg(fixture.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        // Without the start-up code of the C library, the object contains only the law.
        .args([
            "--",
            "-Clink-arg=-nostartfiles",
            "-Clink-arg=-Wl,--gc-sections",
        ])
        // Flags meant for the whole workspace (coverage, say) would bring code of their own.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_BUILD_TARGET")
        .output()
        .expect("cargo runs");
    assert!(
        output.status.success(),
        "the law does not link:\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    // Both objects have the same name, so the first one is copied.
    let kept = target.join(name);
    std::fs::copy(target.join("release/liblaw.so"), &kept).expect("the object was written");
    kept
}

fn names(object: &Path) -> Names {
    let bytes = std::fs::read(object).expect("the object can be read");
    let elf: ElfFile<'_, FileHeader64<Endianness>> =
        ElfFile::parse(&*bytes).expect("the object is an ELF file");
    let named = |undefined: bool| {
        elf.symbols()
            .filter(|symbol| symbol.is_undefined() == undefined)
            .filter_map(|symbol| symbol.name().ok().map(str::to_owned))
            .filter(|name| !name.is_empty())
            .collect()
    };
    Names {
        defined: named(false),
        called: named(true),
    }
}

/// One test, so that the two builds do not wait for each other's folder.
#[test]
fn no_panic_is_left_in_the_linked_law_and_a_planted_one_is_found() {
    let law = names(&link("law.so", &[]));
    for name in ENTRIES {
        assert!(law.defined.iter().any(|n| n == name), "{name} is not there");
    }
    for name in DEVICE {
        assert!(law.called.iter().any(|n| n == name), "{name} is not called");
    }
    assert_eq!(law.panics(), Vec::<&String>::new(), "panics in the law");
    assert_eq!(law.foreign(), Vec::<&String>::new(), "calls out of the law");

    let planted = names(&link("planted.so", &["--features", "planted"]));
    let found = planted.panics();
    for part in ["panic_bounds_check", "law_can_panic"] {
        assert!(
            found.iter().any(|name| name.contains(part)),
            "{part} is not among {found:?}, though an index out of bounds was planted"
        );
    }
    // The clone of a controller allocates.
    let mut foreign = planted.foreign();
    foreign.sort();
    assert_eq!(foreign, ["law_can_allocate", "law_can_panic"]);
}
