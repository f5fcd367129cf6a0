//! Damaged scenes: no edit of a scene's text makes the reader panic, and every error is short.

use host::scene::{LoadedScene, Override, Scene, recording};
use proptest::collection::vec;
use proptest::prelude::*;
use std::collections::BTreeMap;

const SCENES: [&str; 2] = [
    include_str!("../../scenes/stretch.toml"),
    include_str!("../../scenes/cloth.toml"),
];

/// Replacements for a number.
const VALUES: [&str; 24] = [
    "0",
    "-1",
    "1e308",
    "-1e-308",
    "1e999",
    "nan",
    "-inf",
    "9223372036854775807",
    "99999999999999999999",
    "0x7f",
    "-0.0",
    "true",
    "\"\"",
    "'a'",
    "[]",
    "{}",
    "[[1]]",
    "{ a = 1 }",
    "1979-05-27",
    "\"\\u0000\"",
    "\"\"\"a\nb\"\"\"",
    "1_0",
    "[nan, 1, 2]",
    "",
];

/// An edit of a text. Places count from its start, modulo its length.
#[derive(Clone, Debug)]
enum Edit {
    FlipBit(usize, u8),
    DropLine(usize),
    DoubleLine(usize),
    SwapLines(usize, usize),
    Cut(usize),
    Value(usize, usize),
}

fn edit() -> impl Strategy<Value = Edit> {
    let place = 0_usize..1 << 20;
    prop_oneof![
        (place.clone(), 0_u8..8).prop_map(|(at, bit)| Edit::FlipBit(at, bit)),
        place.clone().prop_map(Edit::DropLine),
        place.clone().prop_map(Edit::DoubleLine),
        (place.clone(), place.clone()).prop_map(|(a, b)| Edit::SwapLines(a, b)),
        place.clone().prop_map(Edit::Cut),
        (place, 0..VALUES.len()).prop_map(|(at, value)| Edit::Value(at, value)),
    ]
}

/// The ranges of a text that hold a number or a name in quotes.
fn values(text: &str) -> Vec<std::ops::Range<usize>> {
    let is_value = |c: char| c.is_alphanumeric() || "+-.\"".contains(c);
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    for (at, c) in text.char_indices().filter(|(_, c)| is_value(*c)) {
        let end = at + c.len_utf8();
        match found.last_mut() {
            Some(last) if last.end == at => last.end = end,
            _ => found.push(at..end),
        }
    }
    found
}

fn apply(text: &str, edit: &Edit) -> String {
    let mut lines: Vec<&str> = text.split_inclusive('\n').collect();
    let count = lines.len().max(1);
    match *edit {
        _ if text.is_empty() => return String::new(),
        Edit::FlipBit(at, bit) => {
            let mut bytes = text.as_bytes().to_vec();
            let at = at % bytes.len();
            bytes[at] ^= 1 << bit;
            return String::from_utf8_lossy(&bytes).into_owned();
        }
        Edit::Cut(at) => {
            return String::from_utf8_lossy(&text.as_bytes()[..at % text.len()]).into_owned();
        }
        Edit::Value(at, value) => {
            let places = values(text);
            let Some(place) = places.get(at % places.len().max(1)) else {
                return text.to_owned();
            };
            return [&text[..place.start], VALUES[value], &text[place.end..]].concat();
        }
        Edit::DropLine(at) => drop(lines.remove(at % count)),
        Edit::DoubleLine(at) => lines.insert(at % count, lines[at % count]),
        Edit::SwapLines(a, b) => lines.swap(a % count, b % count),
    }
    lines.concat()
}

/// An error is one line, without control characters, and not too long to read.
fn is_readable(message: &str) -> bool {
    message.starts_with("x:") && message.len() < 1000 && !message.chars().any(char::is_control)
}

/// Whether all numbers of an accepted scene are finite.
fn is_finite(scene: &Scene) -> bool {
    // A debug print contains all numbers; text in quotes is not a number.
    let text = format!("{scene:?}").replace("\\\\", "").replace("\\\"", "");
    let numbers: String = text.split('"').step_by(2).collect();
    !["NaN", " inf", "-inf", "[inf"]
        .iter()
        .any(|found| numbers.contains(found))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_scene_is_read_or_refused_in_one_line(
        which in 0..SCENES.len(),
        edits in vec(edit(), 1..5),
    ) {
        let text = edits.iter().fold(SCENES[which].to_owned(), |text, edit| apply(&text, edit));
        match Scene::parse(&text, "x") {
            Ok(scene) => prop_assert!(is_finite(&scene), "{text}"),
            Err(error) => {
                let message = error.to_string();
                prop_assert!(is_readable(&message), "{message}");
            }
        }
    }

    #[test]
    fn a_damaged_recording_is_read_or_refused_in_one_line(edits in vec(edit(), 1..5)) {
        let text = "# a hand\ntime,x,y,z\n0,0,0,0\n0.01,1e-3,0,0\n0.02,2e-3,-1e-3,0\n".to_owned();
        let text = edits.iter().fold(text, |text, edit| apply(&text, edit));
        if let Err(error) = recording::parse(&text, "x") {
            let message = error.to_string();
            prop_assert!(is_readable(&message), "{message}");
        }
    }
}

/// What only the mesh tells is found after the scene was read.
#[test]
fn an_error_that_is_found_later_names_the_line_of_the_original_text() {
    let support = "[[body.support]]\nname = \"s\"\ngroup = \"nowhere\"\n";
    let body = "[[body]]\nname = \"b\"\nmesh.box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1] }\n\
                material = { young = 1e3, poisson = 0.3, density = 1000 }\n";
    let text = format!("name = \"a\"\n[loop]\nblend = 0.4\n{body}{support}");
    let scene = Scene::load_texts("a.toml", &text, &BTreeMap::new()).expect("a scene");
    let one = [Override::number("loop", "rate", 500.0)];
    let two = [Override::word("loop", "scheme", "hold")];
    let once = scene.overridden(&one).expect("a scene");
    let twice = once.overridden(&two).expect("a scene");
    let said = |scene: &LoadedScene| {
        let error = host::world::World::new(scene).expect_err("no such group");
        error.to_string()
    };
    assert!(said(&scene).starts_with("a.toml:10: "), "{}", said(&scene));
    assert_eq!(said(&once), said(&scene));
    assert_eq!(said(&twice), said(&scene));
}
