//! What a scene says about tearing: fields, refusals with file, line and field, warnings, and notched meshes.

use host::engine::plan::{BodyPlan, stages};
use host::scene::spec::{Starts, TearLawName};
use host::scene::{LoadedScene, Scene};
use host::world::{Built, World};
use physics::mesh::{Mesh, TriMesh};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

/// A sheet with a notch between two hands. Each case changes one piece of it.
const BASE: &str = r#"name = "base"
gravity = [0, 0, 0]

[[body]]
name = "sheet"
mesh.sheet = { length = 0.2, width = 0.1, cells = [40, 20], pattern = "alternating" }
material = { young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }

[body.tear]
strength = 1e5
toughness = 1000

[[body.tear.notch]]
from = [0, 0.05, 0]
to = [0, 0.01, 0]

[[body.handle]]
name = "a"
group = "left"
device = "left"

[[body.handle]]
name = "b"
group = "right"
device = "right"

[[device]]
name = "left"
model = "falcon"
hand = {}

[[device]]
name = "right"
model = "falcon"
hand = {}
"#;

fn load(text: &str) -> Result<LoadedScene, Box<dyn Error>> {
    Ok(Scene::load_texts("x.toml", text, &BTreeMap::new())?)
}

fn built(text: &str) -> Result<Built, Box<dyn Error>> {
    Ok(World::new(&load(text)?)?.bodies.remove(0))
}

fn sheet(built: &Built) -> Result<&TriMesh, Box<dyn Error>> {
    match &built.mesh {
        Mesh::Sheet(mesh) => Ok(mesh),
        _ => Err("not a sheet".into()),
    }
}

/// The base with `piece` replaced.
fn changed(piece: &str, instead: &str) -> String {
    assert_eq!(BASE.matches(piece).count(), 1, "{piece:?} in the base");
    BASE.replace(piece, instead)
}

/// The message of a scene that cannot be built, or else its warnings.
fn says(text: &str) -> String {
    let loaded = match Scene::load_texts("x.toml", text, &BTreeMap::new()) {
        Ok(loaded) => loaded,
        Err(error) => return error.to_string(),
    };
    let warnings = match World::new(&loaded) {
        Ok(world) => world.warnings,
        Err(error) => return error.to_string(),
    };
    let lines: Vec<_> = warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

/// Checks cases of a piece of the base, its replacement and the message.
fn check(cases: &[(&str, &str, &str)]) {
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|(piece, instead, expected)| {
            let found = says(&changed(piece, instead));
            (found != *expected).then(|| format!("{instead}\n  is  {found}\n  not {expected}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_scene_gives_its_law_its_material_and_its_defaults() -> Outcome {
    let tear = built(BASE)?.tear.ok_or("the sheet tears")?;
    assert_eq!(tear.law, TearLawName::Toughness);
    assert_eq!([tear.strength, tear.toughness], [1e5, 1000.0]);
    assert_eq!(tear.starts, Starts::Tips);
    assert_eq!(tear.snapping, 0.3);
    // 861 vertices and the twins of the notch: 29 is the root of 841 to 899.
    assert_eq!(tear.room, 64 + 6 * 29);
    assert!(tear.materials.iter().all(|m| m.young == 1e6));

    let all = "law = \"thesis\"\nstarts = \"anywhere\"\nsnapping = 0\nroom = 50\nstrength = 2e5";
    let tear = built(&changed("strength = 1e5", all))?.tear;
    let tear = tear.ok_or("the sheet tears")?;
    assert_eq!(
        (tear.law, tear.starts),
        (TearLawName::Thesis, Starts::Anywhere)
    );
    assert_eq!((tear.snapping, tear.room), (0.0, 50));
    Ok(())
}

#[test]
fn a_sheet_without_notches_tears_anywhere_and_a_sheet_without_the_table_nowhere() -> Outcome {
    let notch = "[[body.tear.notch]]\nfrom = [0, 0.05, 0]\nto = [0, 0.01, 0]\n";
    let tear = built(&changed(notch, ""))?.tear.ok_or("the sheet tears")?;
    assert_eq!(tear.starts, Starts::Anywhere);
    assert!(tear.tips.is_empty());
    let table = "[body.tear]\nstrength = 1e5\ntoughness = 1000\n";
    let whole = changed(notch, "").replace(table, "");
    let whole = built(&whole)?;
    assert_eq!(whole.tear, None);
    assert_eq!(sheet(&whole)?.positions.len(), 41 * 21);
    Ok(())
}

#[test]
fn a_notch_doubles_the_vertices_between_its_root_and_its_tip_and_keeps_the_area() -> Outcome {
    let built = built(BASE)?;
    let mesh = sheet(&built)?;
    mesh.validate()?;
    // The notch follows eight edges of 5 mm of the mesh: its root and seven more vertices are doubled.
    assert_eq!(mesh.positions.len(), 41 * 21 + 8);
    assert_eq!(mesh.triangles.len(), 1600);
    assert!((mesh.area() - 0.02).abs() < 1e-15);
    let tear = built.tear.as_ref().ok_or("the sheet tears")?;
    let [tip] = tear.tips[..] else {
        return Err("one tip".into());
    };
    let place = mesh.positions[tip as usize];
    assert!(
        (place.x.abs() + (place.y - 0.01).abs()) < 1e-12,
        "{place:?}"
    );
    // The twin of the root is on the upper border, too: the border has one vertex more.
    let top = mesh.group("top").ok_or("a group of the border")?;
    assert_eq!(top.members.len(), 42);
    // The body is made of the notched mesh.
    assert_eq!(built.body.positions().len(), mesh.positions.len());
    Ok(())
}

#[test]
fn an_inclined_slit_has_two_tips_where_the_scene_puts_them() -> Outcome {
    let slit = changed(
        "from = [0, 0.05, 0]\nto = [0, 0.01, 0]",
        "from = [-0.017, -0.02, 0]\nto = [0.021, 0.013, 0]",
    );
    let built = built(&slit)?;
    let mesh = sheet(&built)?;
    mesh.validate()?;
    assert!((mesh.area() - 0.02).abs() < 1e-12);
    let tips = &built.tear.as_ref().ok_or("the sheet tears")?.tips;
    assert_eq!(tips.len(), 2);
    let mut places: Vec<_> = tips
        .iter()
        .map(|&tip| mesh.positions[tip as usize])
        .collect();
    places.sort_by(|a, b| a.x.total_cmp(&b.x));
    // A tip is where the scene puts it, or at the next vertex: within half a diagonal of a cell.
    for (place, [x, y]) in places.iter().zip([[-0.017, -0.02], [0.021, 0.013]]) {
        assert!((place.x - x).hypot(place.y - y) < 0.0072, "{place:?}");
    }
    Ok(())
}

#[test]
fn a_row_of_cuts_has_two_tips_a_cut() -> Outcome {
    let row = "from = [0, 0.04, 0]\nto = [0, 0.02, 0]\ncount = 2\nstep = [0, -0.04, 0]";
    let built = built(&changed("from = [0, 0.05, 0]\nto = [0, 0.01, 0]", row))?;
    assert_eq!(built.tear.ok_or("the sheet tears")?.tips.len(), 4);
    Ok(())
}

#[test]
fn notches_are_in_the_axes_of_the_mesh_and_move_with_the_body() -> Outcome {
    let flat = built(BASE)?;
    let placed =
        "name = \"sheet\"\nposition = [0.5, 0, 0]\nrotation = { axis = [1, 0, 0], degrees = 90 }";
    let placed = built(&changed("name = \"sheet\"", placed))?;
    assert_eq!(
        placed.tear.ok_or("tears")?.tips,
        flat.tear.as_ref().ok_or("tears")?.tips
    );
    for (flat, placed) in sheet(&flat)?.positions.iter().zip(placed.mesh.positions()) {
        let expected = [0.5 + flat.x, -flat.z, flat.y];
        assert_eq!([placed.x, placed.y, placed.z], expected);
    }
    Ok(())
}

#[test]
fn fields_and_groups_follow_the_triangles_that_a_notch_divides() -> Outcome {
    // Regions take the triangles of the notched mesh; each triangle has a material.
    let region = "[body.tear]\nsnapping = 0\n";
    let slit = changed(
        "from = [0, 0.05, 0]\nto = [0, 0.01, 0]",
        "from = [-0.017, -0.02, 0]\nto = [0.021, 0.013, 0]",
    );
    let built = built(&slit.replace("[body.tear]\n", region))?;
    let mesh = sheet(&built)?;
    assert!(
        mesh.triangles.len() > 400,
        "without snapping, triangles are divided"
    );
    let tear = built.tear.as_ref().ok_or("the sheet tears")?;
    assert_eq!(tear.materials.len(), mesh.triangles.len());
    assert_eq!(built.young.len(), mesh.triangles.len());
    Ok(())
}

#[test]
fn values_out_of_range_are_refused_with_line_and_field() {
    check(&[
        (
            "strength = 1e5",
            "strength = 0",
            "x.toml:10: body[0].tear.strength: found 0, allowed: a number above 0",
        ),
        (
            "toughness = 1000",
            "toughness = -1",
            "x.toml:11: body[0].tear.toughness: found -1, allowed: a number above 0",
        ),
        (
            "strength = 1e5\n",
            "",
            "x.toml:9: body[0].tear: missing field `strength`",
        ),
        (
            "strength = 1e5",
            "law = \"griffith\"",
            "x.toml:10: body[0].tear.law: found \"griffith\", allowed: `toughness` or `thesis`",
        ),
        (
            "strength = 1e5",
            "starts = \"borders\"",
            "x.toml:10: body[0].tear.starts: found \"borders\", allowed: `tips` or `anywhere`",
        ),
        (
            "strength = 1e5",
            "snapping = 0.6",
            "x.toml:10: body[0].tear.snapping: found 0.6, allowed: a number from 0 to 0.5",
        ),
        (
            "strength = 1e5",
            "room = 0",
            "x.toml:10: body[0].tear.room: found 0, allowed: a whole number from 1 to 1000000",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, 0.01]",
            "x.toml:15: body[0].tear.notch[0].to: found [0, 0.01], allowed: a list of 3",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, 0.05, 0]",
            "x.toml:15: body[0].tear.notch[0].to: found [0.0, 0.05, 0.0], allowed: another point than `from`",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, 0.01, 0]\ncount = 3",
            "x.toml:16: body[0].tear.notch[0].count: found 3 cuts without a `step`, allowed: 1, or a `step` from each \
             cut to the next",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, 0.01, 0]\nstep = [0, 0.1, 0]",
            "x.toml:16: body[0].tear.notch[0].step: found [0.0, 0.1, 0.0], allowed: no such field for one cut: give a \
             `count` above 1",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, 0.01, 0]\ncount = 2\nstep = [0, 0, 0]",
            "x.toml:17: body[0].tear.notch[0].step: found [0.0, 0.0, 0.0], allowed: any step but [0, 0, 0]",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, 0.01, 0.002]",
            "x.toml:13: body[0].tear.notch[0]: found a notch from [0, 0.05, 0] to [0, 0.01, 0.002], 2.00e-3 m off the \
             plane of the sheet, allowed: a notch in the plane of the sheet",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, -0.07, 0]",
            "x.toml:13: body[0].tear.notch[0]: found a notch from [0, 0.05, 0] to [0, -0.07, 0], out of the sheet, \
             allowed: a notch from the border into the sheet, or with both ends inside",
        ),
        (
            "to = [0, 0.01, 0]",
            "to = [0, -0.05, 0]",
            "x.toml:13: body[0].tear.notch[0]: found a notch from [0, 0.05, 0] to [0, -0.05, 0], from border to \
             border, allowed: a notch that ends inside the sheet",
        ),
        (
            "group = \"left\"",
            "box = [[-0.11, 0.045, -0.01], [0.005, 0.06, 0.01]]",
            "x.toml:13: body[0].tear.notch[0]: found a notch that reaches the handle about [-0.0477, 0.0475, 0.0000] m, \
             allowed: a notch beside the handles: make the notch shorter, or the group or the box of the handle smaller",
        ),
    ]);
}

#[test]
fn bodies_that_cannot_tear_are_refused() {
    check(&[
        (
            "mesh.sheet = { length = 0.2, width = 0.1, cells = [40, 20], pattern = \"alternating\" }\nmaterial = { \
             young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }",
            "mesh.thread = { length = 0.2, segments = 10 }\nmaterial = { young = 1e6, area = 1e-6, density = 1000 }",
            "x.toml:9: body[0].tear: found the tear of a thread, allowed: no such table, because only sheets tear",
        ),
        (
            "mesh.sheet = { length = 0.2, width = 0.1, cells = [40, 20], pattern = \"alternating\" }\nmaterial = { \
             young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }",
            "mesh.box = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2] }\nmaterial = { young = 1e6, poisson = 0.3, \
             density = 1000 }",
            "x.toml:9: body[0].tear: found the tear of a solid, allowed: no such table, because only sheets tear",
        ),
        (
            "density = 1000 }",
            "density = 1000, weave = { young_weft = 1e6, shear = 1e5 } }",
            "x.toml:9: body[0].tear: found the tear of a woven sheet, allowed: no such table, because only isotropic \
             sheets tear",
        ),
        (
            "[[body.handle]]\nname = \"a\"",
            "[[body.region]]\nbox = [[0, -1, -1], [1, 1, 1]]\nyoung = 2e6\n[[body.handle]]\nname = \"a\"",
            "x.toml:9: body[0].tear: found the tear of a sheet of several materials, allowed: no such table, or \
             `young`, `poisson` and `thickness` that are equal everywhere",
        ),
        (
            "name = \"b\"",
            "name = \"b\"\nborder = \"clamped\"",
            "x.toml:24: body[0].handle[1].border: found \"clamped\", allowed: \"hinged\" for a body that tears",
        ),
        (
            "[[body.handle]]\nname = \"a\"",
            "[[body.support]]\nname = \"s\"\ngroup = \"top\"\nborder = \"clamped\"\n[[body.handle]]\nname = \"a\"",
            "x.toml:20: body[0].support[0].border: found \"clamped\", allowed: \"hinged\" for a body that tears",
        ),
        (
            "[[body]]",
            "[host]\nsolver = \"incomplete\"\n[[body]]",
            "x.toml:5: host.solver: found \"incomplete\", allowed: \"auto\" or \"frozen\", because the body \"sheet\" \
             tears",
        ),
        (
            "[[body.tear.notch]]\nfrom = [0, 0.05, 0]\nto = [0, 0.01, 0]\n",
            "starts = \"tips\"\n",
            "x.toml:13: body[0].tear.starts: found \"tips\" without a notch, allowed: \"anywhere\", or a \
             `[[body.tear.notch]]` that has a tip",
        ),
    ]);
}

#[test]
fn implausible_values_are_warned_of() {
    let notch = "[[body.tear.notch]]\nfrom = [0, 0.05, 0]\nto = [0, 0.01, 0]\n";
    check(&[
        ("name = \"base\"", "name = \"base\"", ""),
        (
            "strength = 1e5",
            "strength = 2e5",
            "x.toml:10: body[0].tear.strength: found 0.2 of `young`, usual: 1e-6 to 0.1 of `young`; the sheet stretches \
             by more than 10 % before it tears, and its law is for small strains",
        ),
        (
            "toughness = 1000",
            "toughness = 2e6",
            "x.toml:11: body[0].tear.toughness: found 2e6 J/m^2, usual: 0.1 to 1e6 J/m^2; is the exponent right? tissue \
             takes 10 to 1e4 J/m^2, paper 1e3 to 3e4 J/m^2",
        ),
    ]);
    assert_eq!(
        says(&changed("toughness = 1000", "toughness = 0.5")),
        "x.toml:11: body[0].tear.toughness: found edges of 5.37e-3 m for an Irwin length of 5.00e-5 m, usual: edges up to \
         10 times young * toughness / strength^2; is the value in kJ/m^2? toughness is in J/m^2: 1 kJ/m^2 is 1000; \
         otherwise make the mesh finer, or the strength smaller"
    );
    // On large triangles a notch ends where a vertex is.
    let coarse = changed("cells = [40, 20]", "cells = [6, 3]");
    let coarse = coarse.replace("to = [0, 0.01, 0]", "to = [0.093, 0, 0]");
    assert_eq!(
        says(&coarse),
        "x.toml:13: body[0].tear.notch[0]: found a notch that ends at [0.0867, 0.0034, 0.0000], 0.0071 m from [0.0930, \
         0.0000, 0.0000]: no vertex of the mesh can move there, usual: an end within 2 % of the notch's length; make the \
         mesh finer, or let the notch end at a vertex of the mesh\nx.toml:13: body[0].tear.notch[0]: found a notch of 3.2 \
         edges, usual: 7 edges or more; its tear starts at a load that is up to 10 % too large where the sheet \
         is pulled evenly: make the mesh finer"
    );
    // An edge of the scene's mesh is 5.4 mm long.
    assert_eq!(
        says(&changed("to = [0, 0.01, 0]", "to = [0, 0.04, 0]")),
        "x.toml:13: body[0].tear.notch[0]: found a notch of 1.9 edges, usual: 7 edges or more; its tear starts at a load that \
         is up to 14 % too large where the sheet is pulled evenly: make the mesh finer"
    );
    let slit = changed("from = [0, 0.05, 0]", "from = [0, 0.02, 0]");
    assert_eq!(
        says(&slit.replace("to = [0, 0.01, 0]", "to = [0, -0.01, 0]")),
        "x.toml:13: body[0].tear.notch[0]: found a slit of 5.6 edges, usual: 10 edges or more; its tear starts at a load that \
         is up to 10 % too large where the sheet is pulled evenly: make the mesh finer"
    );
    let fine = changed(notch, "").replace("toughness = 1000", "toughness = 2.5");
    assert_eq!(
        says(&fine),
        "x.toml:10: body[0].tear.strength: found edges of 5.37e-3 m for an Irwin length of 2.50e-4 m, usual: edges up to \
         10 times young * toughness / strength^2; tears start later than the material's: make the mesh finer, or the \
         strength smaller"
    );
}

#[test]
fn a_plan_names_the_tearing_and_its_cost_only_where_a_body_tears() -> Outcome {
    let why = |text: &str| -> Result<Vec<(bool, String)>, Box<dyn Error>> {
        let loaded = load(text)?;
        let plan = BodyPlan::new(&World::new(&loaded)?, 0);
        let stages = stages(&loaded.scene, &[plan]);
        let named = |name: &str| stages.iter().find(|stage| stage.name == name);
        let both = [named("stress"), named("tear")].into_iter().flatten();
        Ok(both
            .map(|stage| (stage.needed, stage.why.clone()))
            .collect())
    };
    let table = "[body.tear]\nstrength = 1e5\ntoughness = 1000\n";
    let notch = "[[body.tear.notch]]\nfrom = [0, 0.05, 0]\nto = [0, 0.01, 0]\n";
    let none = (false, "no tear threshold".to_owned());
    let whole = changed(table, "").replace(notch, "");
    assert_eq!(why(&whole)?, [none.clone(), none]);
    let at_tips = why(BASE)?;
    assert!(!at_tips[0].0);
    assert!(
        at_tips[1].0
            && at_tips[1].1.contains(
                "tears start at 1 tip; room for 238 more vertices; a piece without a hand"
            ),
        "{at_tips:?}"
    );
    // 6.5 edges: late by more than 5 %, and by less than what a warning takes.
    let short = changed("to = [0, 0.01, 0]", "to = [0, 0.015, 0]");
    assert_eq!(says(&short), "");
    let short = why(&short)?;
    assert!(
        short[1].1.contains(
            "tears start at 1 tip up to 6 % late, because a notch is short for its mesh; room"
        ),
        "{short:?}"
    );
    let anywhere = why(&changed(notch, ""))?;
    assert!(
        anywhere[0].0 && anywhere[1].1.contains("tears start anywhere"),
        "{anywhere:?}"
    );
    Ok(())
}

#[test]
fn the_scenes_of_tearing_have_a_notch_beside_their_hands() -> Outcome {
    let names = [
        "banknote",
        "banknote_shear",
        "inclined",
        "perforated",
        "tear_cloth",
        "trousers",
    ];
    for name in names {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{name}.toml"));
        let loaded = Scene::load(&path)?;
        let built = World::new(&loaded)?.bodies.remove(0);
        let tear = built.tear.as_ref().ok_or("a scene of tearing tears")?;
        assert!(!tear.tips.is_empty(), "{name}");
        assert_eq!(loaded.scene.devices.len(), 2, "{name}");
        assert!(
            (1200..=2000).contains(&sheet(&built)?.triangles.len()),
            "{name}"
        );
        // Nothing starts where the hands hold: their vertices are none of the tips.
        for handle in &built.handles {
            assert!(
                tear.tips.iter().all(|tip| !handle.vertices.contains(tip)),
                "{name}"
            );
        }
    }
    Ok(())
}
