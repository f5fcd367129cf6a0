//! The same meshes, materials and loads in CalculiX, an independent program (Debian: `calculix-ccx`): linear
//! elasticity, and large displacements. With `NLGEOM` and `*ELASTIC`, version 2.20 uses the Green strain and the second
//! Piola-Kirchhoff stress, which is the St. Venant-Kirchhoff law. If the program is not installed, the test reports
//! it and passes.

use common::block;
use physics::body::load::traction;
use physics::mesh::{Cells, TetMesh};
use physics::{Body, BodyConfig, Equilibrium, EquilibriumOptions, SolidLaw, SolidMaterial, Vec3};
use std::fmt::Write as _;
use std::process::Command;

const MATERIAL: SolidMaterial = SolidMaterial {
    young: 1e6,
    poisson: 0.3,
    density: 1000.0,
};

/// A twisted block. It has no symmetry that could hide an error.
fn mesh(quadratic: bool) -> TetMesh {
    let mut mesh = block([6, 2, 2], 0.2, quadratic);
    for x in &mut mesh.positions {
        *x = Vec3::new(
            x.x,
            0.25 * x.y + 0.05 * x.x * x.x,
            0.3 * x.z - 0.04 * x.x * x.y,
        );
    }
    mesh
}

fn near_end(mesh: &TetMesh, at: f64) -> Vec<u32> {
    let numbered = (0_u32..).zip(&mesh.positions);
    numbered
        .filter(|(_, x)| (x.x - at).abs() < 1e-9)
        .map(|(vertex, _)| vertex)
        .collect()
}

fn deck(mesh: &TetMesh, fixed: &[u32], forces: &[Vec3], large: bool) -> String {
    // CalculiX reads numbers of at most twenty characters.
    let mut text = String::from("*NODE, NSET=ALL\n");
    for (node, x) in (1..).zip(&mesh.positions) {
        writeln!(text, "{node}, {:.12e}, {:.12e}, {:.12e}", x.x, x.y, x.z).unwrap();
    }
    // The quadratic tetrahedron of CalculiX orders the middles of edges as VTK does.
    let kind = if matches!(mesh.cells, Cells::Linear(_)) {
        "C3D4"
    } else {
        "C3D10"
    };
    writeln!(text, "*ELEMENT, TYPE={kind}, ELSET=BODY").unwrap();
    for (element, cell) in (1..).zip(mesh.cells.vertices()) {
        let nodes: Vec<String> = cell.iter().map(|vertex| (vertex + 1).to_string()).collect();
        writeln!(text, "{element}, {}", nodes.join(", ")).unwrap();
    }
    text.push_str("*BOUNDARY\n");
    for vertex in fixed {
        writeln!(text, "{}, 1, 3", vertex + 1).unwrap();
    }
    writeln!(
        text,
        "*MATERIAL, NAME=M\n*ELASTIC\n{:e}, {:e}",
        MATERIAL.young, MATERIAL.poisson
    )
    .unwrap();
    text.push_str("*SOLID SECTION, ELSET=BODY, MATERIAL=M\n");
    text.push_str(if large { "*STEP, NLGEOM, INC=1000\n*CONTROLS, PARAMETERS=FIELD\n1e-8, 1e-8\n*STATIC\n0.25, 1.\n*CLOAD\n" } else { "*STEP\n*STATIC\n*CLOAD\n" });
    for (node, force) in (1..).zip(forces) {
        for axis in 0..3 {
            if force[axis] != 0.0 {
                writeln!(text, "{node}, {}, {:.12e}", axis + 1, force[axis]).unwrap();
            }
        }
    }
    text.push_str("*NODE PRINT, NSET=ALL\nU\n*END STEP\n");
    text
}

/// The displacements at the last increment, or `None` if CalculiX is not installed.
fn calculix(name: &str, deck: &str, count: usize) -> Option<Vec<Vec3>> {
    if Command::new("ccx").arg("-v").output().is_err() {
        println!("SKIPPED: CalculiX is not installed (apt-get install calculix-ccx)");
        return None;
    }
    let folder = std::env::temp_dir().join(format!("palpate-ccx-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("job.inp"), deck).unwrap();
    let output = Command::new("ccx")
        .arg("job")
        .current_dir(&folder)
        .output()
        .unwrap();
    let log = String::from_utf8_lossy(&output.stdout).into_owned();
    let text = std::fs::read_to_string(folder.join("job.dat")).unwrap_or_default();
    std::fs::remove_dir_all(&folder).unwrap();
    let mut found = vec![Vec3::zeros(); count];
    let mut rows = 0;
    for line in text.lines() {
        let fields: Vec<f64> = line
            .split_whitespace()
            .map_while(|word| word.parse().ok())
            .collect();
        if let [node, x, y, z] = fields[..] {
            found[node as usize - 1] = Vec3::new(x, y, z);
            rows += 1;
        }
    }
    assert!(
        rows >= count && rows % count == 0,
        "CalculiX gave {rows} rows:\n{log}"
    );
    Some(found)
}

fn compare(quadratic: bool, law: SolidLaw, pull: Vec3, tolerance: f64) {
    let mesh = mesh(quadratic);
    let fixed = near_end(&mesh, 0.0);
    let (forces, _) = traction(&mesh, &near_end(&mesh, 1.0), pull);
    let large = law != SolidLaw::Linear;
    let name = format!("{law:?}-{quadratic}");
    let Some(theirs) = calculix(
        &name,
        &deck(&mesh, &fixed, &forces, large),
        mesh.positions.len(),
    ) else {
        return;
    };
    let config = BodyConfig {
        gravity: Vec3::zeros(),
        ..BodyConfig::default()
    };
    let mut body = Body::solid(&mesh, &[MATERIAL], law, config, &[]).unwrap();
    body.add_support(&fixed, [true; 3]).unwrap();
    body.set_external_forces(&forces).unwrap();
    body.set_load_factor(0.0).unwrap();
    let options = EquilibriumOptions {
        load_steps: 4,
        ..EquilibriumOptions::default()
    };
    Equilibrium::new(&body, options)
        .unwrap()
        .solve(&mut body, &[], 1.0)
        .unwrap();
    let (mut difference, mut largest) = (0.0_f64, 0.0_f64);
    for ((x, rest), theirs) in body.positions().zip(&mesh.positions).zip(&theirs) {
        difference = difference.max((x - rest - theirs).amax());
        largest = largest.max(theirs.amax());
    }
    println!(
        "{law:?} quadratic {quadratic}: largest {largest:.4e} m, difference {:.1e} of it",
        difference / largest
    );
    assert!(
        difference < tolerance * largest,
        "{law:?} {quadratic} {difference} {largest}"
    );
    assert!(
        !large || largest > 0.2,
        "the displacement is large: {largest}"
    );
}

#[test]
fn linear_elasticity_agrees_to_five_digits() {
    for quadratic in [false, true] {
        // The output file of CalculiX has seven digits.
        compare(
            quadratic,
            SolidLaw::Linear,
            Vec3::new(10.0, 20.0, -30.0),
            1e-5,
        );
    }
}

#[test]
fn large_displacements_agree_with_st_venant_kirchhoff() {
    for quadratic in [false, true] {
        // The increments of CalculiX end at residuals of 1e-8 of the mean force.
        compare(
            quadratic,
            SolidLaw::StVenantKirchhoff,
            Vec3::new(0.0, 4e3, -1e4),
            1e-5,
        );
    }
}
