use super::*;
use proptest::prelude::*;
use rt_core::Freedom;

const BASE: &str = r#"name = "Mine"
rate = 1000
mass = 0.1
damping = 0
friction = 0.2
position_step = 1e-5
max_force = 5
workspace_radius = 0.1
driver_stiffness = 1_000
driver_damping = 2.5
estimated = ["mass", "rotation.step"]

[rotation]
inertia = 1e-4
damping = 0.001
friction = 0
step = 1e-3
max_moment = 0.5
driver_stiffness = 2
driver_damping = 0

[sources]
mass = "a scale"
rotation.inertia = "a pendulum"
"#;

#[test]
fn a_file_gives_its_numbers_and_sources() {
    let file = DeviceFile::parse(BASE).unwrap();
    assert_eq!(file.name, "Mine");
    assert_eq!(file.model.driver_stiffness, 1000.0);
    assert_eq!(file.model.rate_hz, 1000);
    assert_eq!(file.model.rotation.unwrap().inertia, 1e-4);
    assert_eq!(file.estimated, ["mass", "rotation.step"]);
    assert_eq!(file.sources["rotation.inertia"], "a pendulum");
    // A device without a rotation has three degrees of freedom.
    let plain = without_rotation();
    let model = DeviceFile::parse(&plain).unwrap().model;
    assert_eq!((model.rotation, model.axes), (None, None));
    assert_eq!(model.freedom(), Freedom::Three);
}

fn without_rotation() -> String {
    let (plain, _) = BASE.split_once("[rotation]").unwrap();
    plain.replace(", \"rotation.step\"", "")
}

#[test]
fn a_device_moves_along_the_axes_of_its_file() {
    let axes = |list: &str| {
        let text = format!("axes = {list}\n{}", without_rotation());
        DeviceFile::parse(&text).map(|file| file.model.freedom())
    };
    for (list, free) in [
        ("[\"x\"]", [true, false, false]),
        ("[\"z\", \"x\"]", [true, false, true]),
    ] {
        assert_eq!(axes(list), Ok(Freedom::Along(Axes::new(free).unwrap())));
    }
    assert_eq!(axes("[\"x\", \"y\", \"z\"]"), Ok(Freedom::Three));
    for list in ["[]", "[\"w\"]", "[\"x\", \"x\"]", "\"x\"", "[1, 0, 0]"] {
        assert_eq!(
            axes(list).unwrap_err().to_string(),
            format!(
                "line 1: axes: found {list}, allowed: a list of one, two or three of \"x\", \"y\", \"z\", each once"
            )
        );
    }
    let turning = format!("axes = [\"x\"]\n{BASE}");
    let error = DeviceFile::parse(&turning).unwrap_err().to_string();
    assert!(
        error.starts_with("line 14: rotation: found ")
            && error.ends_with("no rotation on a device that moves along one or two axes"),
        "{error}"
    );
}

#[test]
fn each_mistake_is_reported_with_line_and_field() {
    let numbers = "rate, mass, damping, friction, position_step, max_force, workspace_radius, \
                   output_delay, driver_stiffness, driver_damping";
    let turning = "inertia, damping, friction, step, max_moment, driver_stiffness, driver_damping";
    let all = format!(
        "{numbers}, rotation.{}",
        turning.replace(", ", ", rotation.")
    );
    let cases = [
        (
            "mass = 0.1",
            "mass = 0",
            "line 3: mass: found 0, allowed: a number above 0 and up to 1e6".to_owned(),
        ),
        (
            "mass = 0.1",
            "mass = nan",
            "line 3: mass: found nan, allowed: a number above 0 and up to 1e6".to_owned(),
        ),
        (
            "mass = 0.1",
            "mass = \"a\"",
            "line 3: mass: found \"a\", allowed: a number above 0 and up to 1e6".to_owned(),
        ),
        (
            "mass = 0.1\n",
            "",
            "line 1: missing field `mass`".to_owned(),
        ),
        (
            "mass = 0.1",
            "mass = 0.1\nmas = 1",
            format!(
                "line 4: mas: unknown field, allowed: {numbers}, name, protocol, axes, estimated, rotation, sources"
            ),
        ),
        (
            "rate = 1000",
            "rate = 1000.5",
            "line 2: rate: found 1000.5, allowed: a whole number from 100 to 10000 (Hz)".to_owned(),
        ),
        (
            "damping = 0\n",
            "damping = -1\n",
            "line 4: damping: found -1, allowed: a number from 0 to 1e6".to_owned(),
        ),
        (
            "position_step = 1e-5",
            "position_step = 1",
            "line 6: position_step: found 1, allowed: a number above 0 and up to 0.1".to_owned(),
        ),
        (
            "position_step = 1e-5",
            "position_step = 0",
            "line 6: position_step: found 0, allowed: a number above 0 and up to 0.1".to_owned(),
        ),
        (
            "inertia = 1e-4\n",
            "",
            "line 13: rotation: missing field `inertia`".to_owned(),
        ),
        (
            "step = 1e-3",
            "step = -1e-3",
            "line 17: rotation.step: found -1e-3, allowed: a number above 0 and up to 0.1"
                .to_owned(),
        ),
        (
            "step = 1e-3",
            "stop = 1e-3",
            format!("line 17: rotation.stop: unknown field, allowed: {turning}"),
        ),
        (
            "\"rotation.step\"",
            "\"rotation\"",
            format!("line 11: estimated[1]: found \"rotation\", allowed: {all}"),
        ),
        (
            "mass = \"a scale\"",
            "mass = 3",
            "line 23: sources.mass: found 3, allowed: a text of one line in quotes".to_owned(),
        ),
        (
            "mass = \"a scale\"",
            "name = \"a\"",
            format!("line 23: sources.name: unknown field, allowed: {numbers}, rotation"),
        ),
        (
            "\"Mine\"",
            "\" \"",
            "line 1: name: found \" \", allowed: a text of one line in quotes".to_owned(),
        ),
        (
            "\"Mine\"",
            "\"Mine",
            "line 1: not valid TOML: invalid basic string, expected `\"`".to_owned(),
        ),
    ];
    for (piece, instead, expected) in cases {
        assert!(BASE.contains(piece), "{piece:?}");
        let error = DeviceFile::parse(&BASE.replacen(piece, instead, 1)).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}

/// The rows of the table of fields in the book: field, unit, range, default, meaning.
fn rows_of_the_book() -> Vec<[&'static str; 5]> {
    let book = include_str!("../../../../../docs/src/scenes.md");
    let (_, part) = book.split_once("### Fields of a device file").unwrap();
    let rows = part.lines().filter(|line| line.starts_with("| `"));
    rows.map(|row| {
        let cells: Vec<_> = row.trim_matches('|').split('|').map(str::trim).collect();
        cells
            .try_into()
            .unwrap_or_else(|_| panic!("not five cells: {row}"))
    })
    .collect()
}

#[test]
fn the_table_of_the_book_has_every_field_with_its_range_and_no_other() {
    let rows = rows_of_the_book();
    let named: Vec<_> = rows
        .iter()
        .map(|[field, ..]| field.trim_matches('`').to_owned())
        .collect();
    let mut fields: Vec<_> = DeviceFile::fields().collect();
    let mut sorted = named.clone();
    fields.sort();
    sorted.sort();
    assert_eq!(sorted, fields);

    let is_number = |field: &String| DeviceFile::numbers(true).any(|number| number == *field);
    for (field, [_, unit, range, default, meaning]) in named.iter().zip(&rows) {
        assert!(!meaning.is_empty() && !default.is_empty(), "{field}");
        assert_eq!(!unit.is_empty(), is_number(field), "{field}: unit");
        // The file without the field shows whether there is a default. The file with a wrong value shows the range.
        let (table, name) = field.split_once('.').unwrap_or(("", field));
        let with = |value: Option<&str>| {
            let mut section = "";
            let mut lines: Vec<String> = Vec::new();
            for line in BASE.lines() {
                section = line
                    .strip_prefix('[')
                    .map_or(section, |rest| rest.trim_end_matches(']'));
                let hit = section == table && line.split(" = ").next() == Some(name);
                let line = if hit {
                    value.map(|value| format!("{name} = {value}"))
                } else {
                    Some(line.to_owned())
                };
                lines.extend(line);
            }
            DeviceFile::parse(&lines.join("\n"))
        };
        if ["axes", "protocol", "output_delay"].contains(&field.as_str()) {
            // The base lacks these fields, so they have a default.
            let error = DeviceFile::parse(&format!("{field} = true\n{BASE}")).unwrap_err();
            assert!(
                error.to_string().ends_with(&format!("allowed: {range}")),
                "{error}"
            );
            continue;
        }
        if ["rotation", "estimated", "sources"].contains(&field.as_str()) {
            continue;
        }
        assert_eq!(*default, "required", "{field}");
        let missing = with(None).unwrap_err().to_string();
        assert!(
            missing.ends_with(&format!("missing field `{name}`")),
            "{missing}"
        );
        let wrong = with(Some("true")).unwrap_err().to_string();
        assert!(
            wrong.ends_with(&format!("{field}: found true, allowed: {range}")),
            "{wrong}"
        );
    }
}

proptest! {
    #[test]
    fn any_edited_file_is_read_or_refused_in_one_line(
        cut in 0..BASE.len(), length in 0..40_usize, put in ".{0,12}",
    ) {
        let end = (cut + length).min(BASE.len());
        // The text is ASCII.
        let text = format!("{}{put}{}", &BASE[..cut], &BASE[end..]);
        if let Err(error) = DeviceFile::parse(&text) {
            let line = error.to_string();
            prop_assert!(line.lines().count() == 1 && line.len() < 1000, "{line}");
            prop_assert!(error.line >= 1 && error.line <= text.lines().count() + 1);
        }
    }
}
