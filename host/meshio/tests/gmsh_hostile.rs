//! No text makes the MSH reader panic, and what it accepts is a mesh.

mod support;

use meshio::{GmshError, MeshFileError, read_mesh};
use physics::mesh::Mesh;
use proptest::prelude::*;
use proptest::sample::Index;
use support::read;

const SMALL: &str = include_str!("small.msh");

/// One change to a file.
#[derive(Clone, Debug)]
enum Damage {
    Byte(Index, u8),
    Truncate(Index),
    DropLine(Index),
    RepeatLine(Index),
    SwapLines(Index, Index),
    /// Replaces a number by this text.
    Number(Index, &'static str),
}

fn damage() -> impl Strategy<Value = Damage> {
    const NUMBERS: [&str; 14] = [
        "NaN",
        "-NaN",
        "inf",
        "-1",
        "0",
        "1",
        "2",
        "3",
        "10",
        "1e308",
        "1e-320",
        "4294967296",
        "18446744073709551615",
        "99999999999999999999999999",
    ];
    prop_oneof![
        1 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Byte(at, byte)),
        1 => any::<Index>().prop_map(Damage::Truncate),
        2 => any::<Index>().prop_map(Damage::DropLine),
        2 => any::<Index>().prop_map(Damage::RepeatLine),
        2 => any::<(Index, Index)>().prop_map(|(a, b)| Damage::SwapLines(a, b)),
        6 => (any::<Index>(), prop::sample::select(&NUMBERS[..]))
            .prop_map(|(at, text)| Damage::Number(at, text)),
    ]
}

fn apply(damage: &Damage, bytes: &[u8]) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = bytes.split(|&b| b == b'\n').map(<[u8]>::to_vec).collect();
    match damage {
        Damage::Byte(at, byte) => {
            let mut bytes = bytes.to_vec();
            if !bytes.is_empty() {
                let at = at.index(bytes.len());
                bytes[at] = *byte;
            }
            return bytes;
        }
        Damage::Truncate(at) => return bytes[..at.index(bytes.len() + 1)].to_vec(),
        Damage::DropLine(at) => drop(lines.remove(at.index(lines.len()))),
        Damage::RepeatLine(at) => {
            let at = at.index(lines.len());
            lines.insert(at, lines[at].clone());
        }
        Damage::SwapLines(a, b) => {
            let count = lines.len();
            lines.swap(a.index(count), b.index(count));
        }
        Damage::Number(at, text) => {
            let is_number = |word: &[u8]| word.first().is_some_and(|b| b"-0123456789".contains(b));
            let mut words: Vec<Vec<Vec<u8>>> = lines
                .iter()
                .map(|line| line.split(|&b| b == b' ').map(<[u8]>::to_vec).collect())
                .collect();
            let mut numbers: Vec<&mut Vec<u8>> = words
                .iter_mut()
                .flatten()
                .filter(|word| is_number(word))
                .collect();
            if !numbers.is_empty() {
                let at = at.index(numbers.len());
                *numbers[at] = text.as_bytes().to_vec();
            }
            lines = words.into_iter().map(|line| line.join(&b' ')).collect();
        }
    }
    lines.join(&b'\n')
}

/// Checks what must hold of any text, and says whether it was a mesh.
fn judge(bytes: &[u8]) -> bool {
    match read_mesh("x.msh", bytes) {
        Ok(mesh) => {
            match mesh {
                Mesh::Thread(mesh) => mesh.validate().unwrap(),
                Mesh::Sheet(mesh) => mesh.validate().unwrap(),
                Mesh::Solid(mesh) => mesh.validate().unwrap(),
            }
            true
        }
        Err(error) => {
            let message = error.to_string();
            let is_placed = message.starts_with("line ") || message.starts_with("byte ");
            assert!(is_placed, "{message}");
            assert!(!message.contains('\n') && message.len() < 250, "{message}");
            false
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn a_damaged_file_is_an_error_or_a_mesh(damages in prop::collection::vec(damage(), 1..4)) {
        let damaged =
            damages.iter().fold(SMALL.as_bytes().to_vec(), |bytes, damage| apply(damage, &bytes));
        judge(&damaged);
    }

    #[test]
    fn any_bytes_are_an_error_or_a_mesh(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        text in "[$0-9a-z .\n-]{0,100}",
    ) {
        judge(&bytes);
        judge(text.as_bytes());
        judge(format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n{text}").as_bytes());
    }
}

#[test]
fn every_truncation_and_every_lost_line_is_judged() {
    // Only the last marker's own end may be lost without harm.
    let whole = SMALL.trim_end().len();
    for end in 0..=SMALL.len() {
        assert_eq!(
            judge(&SMALL.as_bytes()[..end]),
            end >= whole,
            "cut at byte {end}"
        );
    }
    // Without a line the file is wrong, but for the one line that nothing else depends on.
    for dropped in 0..SMALL.lines().count() {
        let kept = SMALL
            .lines()
            .enumerate()
            .filter(|&(line, _)| line != dropped);
        let text: Vec<&str> = kept.map(|(_, text)| text).collect();
        let harmless = SMALL
            .lines()
            .nth(dropped)
            .is_some_and(|line| line.starts_with("a section"));
        assert_eq!(
            judge(text.join("\n").as_bytes()),
            harmless,
            "without line {}",
            dropped + 1
        );
    }
}

#[test]
fn numbers_that_are_damaged_where_they_matter_are_found() {
    // All but a few of the damages above are errors, so the property is not met by accepting everything;
    // and an undamaged file is a mesh, so it is not met by refusing everything.
    assert!(judge(SMALL.as_bytes()));
    let numbered = SMALL.replace("\n1 1 0 0.5 0.5\n", "\n1 NaN 0 0.5 0.5\n");
    assert_ne!(numbered, SMALL);
    let found = read_mesh("x.msh", numbered.as_bytes());
    assert!(matches!(
        found,
        Err(MeshFileError::Gmsh(GmshError::Syntax { .. }))
    ));
}

#[test]
fn every_element_may_be_in_many_groups() {
    // The most work that a text can ask for: the product of elements and of an entity's groups, which
    // the limit on its tags bounds.
    let triangles = 20_000;
    let lines = |count: u32, line: &dyn Fn(u32) -> String| {
        (1..=count).map(line).collect::<Vec<_>>().join("\n")
    };
    let names = lines(256, &|tag| format!("2 {tag} \"name {tag}\""));
    let tags = lines(16, &|tag| (2 * tag).to_string()).replace('\n', " ");
    let nodes = lines(triangles + 2, &|tag| tag.to_string());
    let places = lines(triangles + 2, &|k| format!("{} {} 0", k / 2, k % 2));
    let elements = lines(triangles, &|k| format!("{k} {k} {} {}", k + 1, k + 2));
    let text = format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n256\n{names}\n$EndPhysicalNames\n\
         $Entities\n0 0 1 0\n1 0 0 0 1 1 0 16 {tags} 0\n$EndEntities\n\
         $Nodes\n1 {n} 1 {n}\n2 1 0 {n}\n{nodes}\n{places}\n$EndNodes\n\
         $Elements\n1 {triangles} 1 {triangles}\n2 1 2 {triangles}\n{elements}\n$EndElements\n",
        n = triangles + 2,
    );
    let mesh = read("x.msh", text.as_bytes()).unwrap();
    assert_eq!(mesh.triangle_groups.len(), 16);
    assert!(
        mesh.triangle_groups
            .iter()
            .all(|g| g.members.len() == 20_000)
    );
    let more = text.replace("1 1 0 16 2 4", "1 1 0 17 2 3 4");
    assert_eq!(
        read("x.msh", more.as_bytes()).unwrap_err().to_string(),
        "line 265: expected at most 16 physical tags of one entity, found \"17 2 3 4 6 8 10 12 14 16 18 20 22 24 26 \"..."
    );
}
