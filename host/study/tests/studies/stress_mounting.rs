//! Mounted devices in the studies: the axes and the origin of a device do not change what its hand feels.

use host::scene::{LoadedScene, Scene};
use std::collections::BTreeMap;
use study::stress::hold::judge;
use study::stress::scene::{SCHEMES, Study};

const SHEET: &str = include_str!("../../../scenes/stress/sheet.toml");

/// The sheet, with `mounting` for both devices, and with the targets of its two hands.
fn sheet(mounting: [&str; 2], targets: [&str; 2]) -> LoadedScene {
    let mut devices = SHEET.split("model = \"falcon\"");
    let [before, left, right] = [(); 3].map(|()| devices.next().expect("two devices"));
    let model = |mounting| format!("model = \"falcon\"\n{mounting}");
    let left = left.replace("-0.012, 0.0, 0.0", targets[0]);
    let right = right.replace("0.012, 0.0, 0.0", targets[1]);
    let text = [
        before,
        &model(mounting[0]),
        &left,
        &model(mounting[1]),
        &right,
    ]
    .concat();
    Scene::load_texts("sheet.toml", &text, &BTreeMap::new()).expect("the scene is sound")
}

const PLAIN: [&str; 2] = ["-0.012, 0.0, 0.0", "0.012, 0.0, 0.0"];

/// Rounding differs between the axes, and the runs amplify it. The differences lie far below every other error.
fn assert_alike(found: f64, expected: f64, what: &str) {
    let off = (found - expected).abs();
    assert!(
        off <= 1e-6 * expected.abs().max(1e-3),
        "{what}: {found} for {expected}"
    );
}

#[test]
fn a_turned_device_renders_the_same_forces() {
    // A third of a turn about the diagonal exchanges the axes: z of the device is x of the scene, so the counts of the
    // encoder are the same.
    let turned = "mounting.rotation = { axis = [1, 1, 1], degrees = 120 }";
    let mounted = sheet([turned; 2], ["0.0, 0.0, -0.012", "0.0, 0.0, 0.012"]);
    let found = judge(mounted).expect("it runs");
    let expected = judge(sheet([""; 2], PLAIN)).expect("it runs");
    assert_alike(found.count, expected.count, "count");
    for (scheme, expected) in &expected.schemes {
        let found = &found.schemes[scheme];
        let each = [
            ("peak", found.force_errors.peak, expected.force_errors.peak),
            (
                "hold",
                found.force_errors.hold_error,
                expected.force_errors.hold_error,
            ),
            (
                "run",
                found.force_errors.run_error,
                expected.force_errors.run_error,
            ),
            ("error", found.error, expected.error),
            ("stiffness", found.stiffness_error, expected.stiffness_error),
        ];
        for (what, found, expected) in each {
            assert_alike(found, expected, &format!("{scheme}, {what}"));
        }
        assert!(found.force_errors.peak > 0.5, "the hands pull: {found:?}");
    }
}

#[test]
fn a_device_that_stands_elsewhere_meets_the_same_trials() {
    // 526 counts of the Falcon from the handles, which rest at 100 mm on either side.
    let shift = 526.0 * 0.038e-3;
    let at = |x: f64| format!("mounting.origin = [{:?}, 0.0, 0.0]", x + shift);
    let mounted = sheet([&at(-0.1), &at(0.1)], PLAIN);
    let study = |loaded| {
        let study = Study::new(loaded, 1).expect("it is sound");
        let capped = SCHEMES[5];
        study.cell(2, &[capped])
    };
    let (found, expected) = (study(mounted), study(sheet([""; 2], PLAIN)));
    assert_eq!(found.draw, expected.draw);
    let [found, expected] = [&found, &expected].map(|cell| cell.schemes["capped"]);
    assert_alike(found.error, expected.error, "error");
    assert_alike(found.force_errors.peak, expected.force_errors.peak, "peak");
    assert_alike(found.stillness.motion, expected.stillness.motion, "motion");
}
