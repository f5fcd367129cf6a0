//! No bytes make a reader of meshes panic, and what it accepts is a mesh.

mod support;

use meshio::read_mesh;
use physics::mesh::{Mesh, TriMesh};
use proptest::prelude::*;
use proptest::sample::Index;
use support::read_with_pattern;

/// Fuzz targets that are meshes, with a name that picks the format.
const TARGETS: [(&str, &str); 5] = [
    ("gmsh", "x.msh"),
    ("obj", "x.obj"),
    ("vtk_legacy", "x.vtk"),
    ("vtk_xml", "x.vtu"),
    // Solids and threads of every format, which follows from how a file begins.
    ("solid", "x"),
];

fn read_and_check(name: &str, bytes: &[u8]) -> Result<(), TestCaseError> {
    let mesh = read_mesh(name, bytes);
    match &mesh {
        Ok(Mesh::Sheet(mesh)) => prop_assert_eq!(mesh.validate(), Ok(())),
        Ok(Mesh::Thread(mesh)) => prop_assert_eq!(mesh.validate(), Ok(())),
        Ok(Mesh::Solid(mesh)) => prop_assert_eq!(mesh.validate(), Ok(())),
        Err(_) => {}
    }
    let cut = read_with_pattern(name, bytes, 0.01);
    if let Ok(cut) = &cut {
        prop_assert_eq!(cut.validate(), Ok(()));
        let uncut = TriMesh {
            flat_pattern: None,
            ..cut.clone()
        };
        prop_assert_eq!(&mesh, &Ok(Mesh::Sheet(uncut)));
    }
    for error in [mesh.err(), cut.err()].into_iter().flatten() {
        let text = error.to_string();
        prop_assert!(!text.contains('\n') && text.len() < 600, "{}", text);
    }
    Ok(())
}

#[test]
fn the_corpus_of_the_fuzzers_breaks_no_reader() {
    for (target, name) in TARGETS {
        for input in corpus::inputs(target).expect("the corpus is in the repository") {
            // Each reader meets the files of all formats, too.
            for name in ["x.msh", "x.obj", "x.vtk", "x.vtp", "x", name] {
                read_and_check(name, &input.bytes).expect("one line, or a valid mesh");
            }
        }
    }
}

#[test]
fn a_file_that_is_cut_anywhere_is_refused_or_whole() {
    for (target, name) in TARGETS {
        for seed in corpus::seeds(target).expect("the seeds are in the repository") {
            for end in 0..seed.bytes.len() {
                read_and_check(name, &seed.bytes[..end]).expect("one line, or a valid mesh");
            }
        }
    }
}

/// One change to a file.
#[derive(Clone, Debug)]
enum Damage {
    Byte(Index, u8),
    Cut(Index, Index),
    Repeat(Index, Index),
    /// Replaces a number by this text.
    Number(Index, &'static str),
    /// Writes this number over eight bytes.
    Bytes(Index, u64),
}

fn damage() -> impl Strategy<Value = Damage> {
    const NUMBERS: [&str; 14] = [
        "NaN",
        "-inf",
        "-1",
        "0",
        "1",
        "2",
        "3",
        "7",
        "1e308",
        "1e-320",
        "1000000000",
        "4294967296",
        "18446744073709551615",
        "99999999999999999999999999",
    ];
    let large = prop_oneof![
        Just(0),
        Just(1),
        Just(u64::MAX),
        Just(u64::MAX / 2),
        Just(1 << 32),
        Just(1_000_000_000),
        any::<u64>()
    ];
    prop_oneof![
        1 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Byte(at, byte)),
        1 => any::<(Index, Index)>().prop_map(|(a, b)| Damage::Cut(a, b)),
        1 => any::<(Index, Index)>().prop_map(|(a, b)| Damage::Repeat(a, b)),
        2 => (any::<Index>(), large).prop_map(|(at, number)| Damage::Bytes(at, number)),
        5 => (any::<Index>(), prop::sample::select(&NUMBERS[..]))
            .prop_map(|(at, text)| Damage::Number(at, text)),
    ]
}

fn apply(damage: &Damage, bytes: &mut Vec<u8>) {
    let range = |a: &Index, b: &Index, len: usize| {
        let (a, b) = (a.index(len + 1), b.index(len + 1));
        a.min(b)..a.max(b)
    };
    match damage {
        Damage::Byte(at, byte) if !bytes.is_empty() => {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        Damage::Cut(a, b) => drop(bytes.drain(range(a, b, bytes.len()))),
        Damage::Repeat(a, b) => bytes.extend_from_within(range(a, b, bytes.len())),
        Damage::Bytes(at, number) if !bytes.is_empty() => {
            let at = at.index(bytes.len());
            for (to, from) in bytes[at..].iter_mut().zip(number.to_le_bytes()) {
                *to = from;
            }
        }
        Damage::Number(at, text) => {
            let is_digit = |byte: &u8| byte.is_ascii_digit();
            let starts: Vec<usize> = (0..bytes.len())
                .filter(|&k| is_digit(&bytes[k]) && (k == 0 || !is_digit(&bytes[k - 1])))
                .collect();
            if !starts.is_empty() {
                let start = starts[at.index(starts.len())];
                let length = bytes[start..]
                    .iter()
                    .take_while(|byte| is_digit(byte))
                    .count();
                bytes.splice(start..start + length, text.bytes());
            }
        }
        _ => {}
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn damaged_files_are_refused_or_valid(
        target in 0..TARGETS.len(),
        file in any::<Index>(),
        damages in prop::collection::vec(damage(), 1..4),
    ) {
        let (target, name) = TARGETS[target];
        let mut seeds = corpus::seeds(target).expect("the seeds are in the repository");
        let mut bytes = seeds.swap_remove(file.index(seeds.len())).bytes;
        for damage in &damages {
            apply(damage, &mut bytes);
        }
        read_and_check(name, &bytes)?;
    }

    #[test]
    fn any_bytes_are_refused_or_valid(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        text in "[ \n\tvfgo#0-9./-]{0,100}",
    ) {
        for (_, name) in TARGETS {
            read_and_check(name, &bytes)?;
            read_and_check(name, text.as_bytes())?;
        }
    }
}
