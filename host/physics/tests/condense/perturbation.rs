//! The condensation compared with perturbing a handle and running the step again, and the limits of the condensation.

use common::*;
use nalgebra::UnitQuaternion;
use physics::linear::dense::{Clipper, Square};
use physics::{
    Body, BodyConfig, Border, CondenseError, Condensed, Condenser, Equilibrium, EquilibriumOptions,
    FactorCode, Freedom, HandlePose, HandleSpec, Material, SolidLaw, SolidMaterial, Tangent, Vec3,
};

const LX: f64 = 0.1;

fn three_handles(freedom: [Freedom; 3]) -> (Vec<HandleSpec>, physics::mesh::TriMesh) {
    let mesh = irregular(10, 4, LX, 0.04, 0.2, 47);
    let middle = |x: &Vec3| (x - Vec3::new(0.05, 0.02, 0.0)).norm() < 0.012;
    let mut handles = vec![
        handle(&mesh, freedom[0], |x| x.x < 1e-9),
        handle(&mesh, freedom[1], |x| x.x > LX - 1e-9),
        handle(&mesh, freedom[2], middle),
    ];
    // The origin lies away from the vertices, as the origin of a device does.
    handles[1].origin += Vec3::new(0.01, 0.0, 0.02);
    (handles, mesh)
}

/// A strip that its handles stretch and twist.
fn loaded(config: BodyConfig, freedom: [Freedom; 3]) -> (Body, Vec<HandlePose>) {
    loaded_strip(config, freedom, rubber(0.3), Border::Hinged)
}

/// The same strip of `material`. The two handles at its ends clamp or hinge their borders.
fn loaded_strip(
    config: BodyConfig,
    freedom: [Freedom; 3],
    material: Material,
    border: Border,
) -> (Body, Vec<HandlePose>) {
    let (mut handles, mesh) = three_handles(freedom);
    for handle in &mut handles[..2] {
        handle.border = border;
    }
    let sheet = Body::sheet(&mesh, &[material], config, &handles).unwrap();
    let mut poses = rest_poses(&handles);
    poses[1].position += Vec3::new(0.015, 0.002, 0.004);
    poses[1].rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -0.2, 0.1));
    poses[2].position += Vec3::new(0.004, 0.0, 0.006);
    (sheet, poses)
}

/// Derivative of all reactions by every motion of every handle. The step is run again with the target moved in the
/// positive and in the negative direction.
fn rerun(sheet: &Body, poses: &[HandlePose], h: f64, freedom: &[Freedom]) -> Square {
    // A step is linear in the displacement of the vertices. In the angle of a turn it has quadratic terms. The error of
    // the central difference is the square of the angle, 1e-8.
    let by = 1e-4;
    let mut result = Square::zeros(6 * poses.len());
    for (handle, freedom) in freedom.iter().enumerate() {
        for motion in 0..freedom.count() {
            let reactions = |sign: f64| {
                let mut targets = poses.to_vec();
                let axis = Vec3::ith(motion % 3, sign * by);
                if motion < 3 {
                    targets[handle].position += axis;
                } else {
                    targets[handle].rotation =
                        UnitQuaternion::from_scaled_axis(axis) * targets[handle].rotation;
                }
                let mut sheet = sheet.clone();
                sheet.solve(h, &targets).unwrap();
                let reactions = |i| sheet.handle_report(i).unwrap().reaction;
                (0..poses.len()).map(reactions).collect::<Vec<_>>()
            };
            let (plus, minus) = (reactions(1.0), reactions(-1.0));
            for (other, (plus, minus)) in plus.iter().zip(&minus).enumerate() {
                let force = (plus.force - minus.force) / (2.0 * by);
                let moment = (plus.moment - minus.moment) / (2.0 * by);
                for axis in 0..3 {
                    result[(6 * other + axis, 6 * handle + motion)] = force[axis];
                    result[(6 * other + 3 + axis, 6 * handle + motion)] = moment[axis];
                }
            }
        }
    }
    result
}

/// The largest difference of the rows and columns in `freedom`, as a fraction of the largest entry. The factor `length`
/// makes rotations comparable with translations.
fn difference(a: &Square, b: &Square, length: f64, freedom: &[Freedom]) -> f64 {
    let unit = |slot: usize| if slot % 6 < 3 { 1.0 } else { length };
    let has = |slot: usize| slot % 6 < freedom[slot / 6].count();
    let (mut error, mut scale) = (0.0_f64, 0.0_f64);
    for i in (0..a.size()).filter(|&i| has(i)) {
        for j in (0..a.size()).filter(|&j| has(j)) {
            let unit = unit(i) * unit(j);
            error = error.max((a[(i, j)] - b[(i, j)]).abs() / unit);
            scale = scale.max(b[(i, j)].abs() / unit);
        }
    }
    error / scale
}

fn dynamic(condensed: &Condensed, h: f64) -> Square {
    let mut sum = condensed.raw_stiffness.clone();
    for j in 0..sum.size() {
        for i in 0..sum.size() {
            sum[(i, j)] += condensed.mass[(i, j)] / (h * h) + condensed.raw_damping[(i, j)] / h;
        }
    }
    sum
}

fn config() -> BodyConfig {
    BodyConfig {
        gravity: Vec3::new(0.0, 0.0, -9.81),
        mass_damping: 2.0,
        stiffness_damping: 2e-3,
        bending: 1.0,
        ..tight()
    }
}

#[test]
fn at_the_period_of_the_step_the_condensation_repeats_the_perturbed_step() {
    let freedom = [Freedom::Rigid, Freedom::Rigid, Freedom::Translation];
    let (mut sheet, poses) = loaded(config(), freedom);
    settle(&mut sheet, &poses, 1.0, 60).unwrap();
    for h in [1e-3, 1.0 / 60.0] {
        sheet.assemble();
        let mut condenser = Condenser::new(&sheet).unwrap();
        let condensed = condenser.condense(&sheet, h).unwrap();
        let rerun = rerun(&sheet, &poses, h, &freedom);
        let error = difference(&dynamic(condensed, h), &rerun, condensed.length, &freedom);
        // The required accuracy is 1 %. The perturbed steps have an error of 1e-8.
        assert!(error < 1e-6, "{h}: {error:e}");
    }
}

#[test]
fn the_condensation_with_clamped_borders_repeats_the_perturbed_step() {
    let freedom = [Freedom::Rigid, Freedom::Rigid, Freedom::Translation];
    // The strip is so thick that its bending resists the turns of the handles.
    let material = Material {
        thickness: 0.01,
        ..rubber(0.3)
    };
    let mut turns = Vec::new();
    for border in [Border::Hinged, Border::Clamped] {
        let (mut sheet, poses) = loaded_strip(config(), freedom, material, border);
        settle(&mut sheet, &poses, 1.0, 60).unwrap();
        for h in [1e-3, 1.0 / 60.0] {
            sheet.assemble();
            let mut condenser = Condenser::new(&sheet).unwrap();
            let condensed = condenser.condense(&sheet, h).unwrap();
            let rerun = rerun(&sheet, &poses, h, &freedom);
            let error = difference(&dynamic(condensed, h), &rerun, condensed.length, &freedom);
            println!("{border:?} {h}: {error:e}");
            assert!(error < 1e-6, "{border:?} {h}: {error:e}");
            turns.push(condensed.raw_stiffness[(4, 4)]);
        }
    }
    // The first handle, whose origin is in the middle of its edge, turns about the edge against the clamp alone.
    println!("{turns:?}");
    assert!(turns[3] > 10.0 * turns[1].abs(), "{turns:?}");
}

#[test]
fn portable_kernels_repeat_to_the_bit_and_differ_from_the_fastest_by_rounding() {
    let freedom = [Freedom::Rigid, Freedom::Rigid, Freedom::Translation];
    let (mut sheet, poses) = loaded(config(), freedom);
    settle(&mut sheet, &poses, 1.0, 60).unwrap();
    sheet.assemble();
    let condensed = |code, period| {
        let mut condenser = Condenser::with_code(&sheet, code).unwrap();
        condenser.condense(&sheet, period).unwrap().clone()
    };
    let entries = |m: &Square, other: &Square| {
        let size = 6 * 3;
        let each = (0..size).flat_map(|r| (0..size).map(move |c| (r, c)));
        each.fold((0.0_f64, 0.0_f64), |(largest, apart), at| {
            (
                largest.max(m[at].abs()),
                apart.max((m[at] - other[at]).abs()),
            )
        })
    };
    for period in [1e-3, 1.0 / 60.0, 1.0] {
        let portable = condensed(FactorCode::Portable, period);
        let fastest = condensed(FactorCode::Fastest, period);
        assert_eq!(portable, condensed(FactorCode::Portable, period));
        assert_eq!(fastest, condensed(FactorCode::Fastest, period));
        for (a, b) in [
            (&portable.stiffness, &fastest.stiffness),
            (&portable.damping, &fastest.damping),
        ] {
            let (largest, apart) = entries(a, b);
            println!("{period}: {:.1e} of the largest entry", apart / largest);
            // The tolerance is the rounding times the condition number of the step's matrix, which is largest at the
            // longest period.
            assert!(
                apart < 1e-10 * largest,
                "{period}: {apart:e} of {largest:e}"
            );
        }
    }
}

#[test]
fn in_motion_the_condensation_repeats_the_perturbed_step_for_translations() {
    let freedom = [Freedom::Fixed, Freedom::Translation, Freedom::Translation];
    let (mut sheet, mut poses) = loaded(config(), freedom);
    let h = 2e-3;
    for i in 0..60 {
        poses[1].position.x += 2e-4;
        poses[2].position.z += 1e-4 * f64::from(i % 5);
        sheet.step(h, &poses).unwrap();
    }
    sheet.assemble();
    let mut condenser = Condenser::new(&sheet).unwrap();
    let condensed = condenser.condense(&sheet, h).unwrap();
    let rerun = rerun(&sheet, &poses, h, &freedom);
    let error = difference(&dynamic(condensed, h), &rerun, condensed.length, &freedom);
    // The step is linear, so the comparison is exact up to the solver's 1e-13 of the first residual over a motion of
    // 1e-4.
    assert!(error < 1e-8, "{error:e}");
    // A clamp has no rows. A handle without rotations has no rows for rotations.
    for slot in (0..18).filter(|slot| *slot < 6 || slot % 6 >= 3) {
        for other in 0..18 {
            assert_eq!(condensed.stiffness[(slot, other)], 0.0);
            assert_eq!(condensed.damping[(other, slot)], 0.0);
        }
    }
}

#[test]
fn in_the_static_limit_a_common_motion_of_the_handles_meets_no_stiffness() {
    let freedom = [Freedom::Rigid, Freedom::Rigid, Freedom::Rigid];
    let (mut sheet, poses) = loaded(
        BodyConfig {
            mass_damping: 0.0,
            ..config()
        },
        freedom,
    );
    settle(&mut sheet, &poses, 1.0, 60).unwrap();
    sheet.assemble();
    let mut condenser = Condenser::new(&sheet).unwrap();
    let condensed = condenser.condense(&sheet, 1e4).unwrap();
    let k = &condensed.raw_stiffness;
    let scale = (0..3).map(|i| k[(i, i)]).fold(0.0, f64::max);
    for i in (0..18).filter(|i| i % 6 < 3) {
        for axis in 0..3 {
            let sum: f64 = (0..3).map(|handle| k[(i, 6 * handle + axis)]).sum();
            // The mass adds (1e4 s)^-2, which is negligible. The error is the rounding times the condition number of
            // the matrix.
            assert!(sum.abs() < 1e-9 * scale, "{i} {axis}: {sum:e} {scale:e}");
        }
    }
}

fn assert_definite(matrix: &Square, length: f64) {
    let size = matrix.size();
    let unit = |slot: usize| if slot % 6 < 3 { 1.0 } else { length };
    let mut random = Random(53);
    let largest = (0..size)
        .map(|i| matrix[(i, i)] / unit(i).powi(2))
        .fold(0.0, f64::max);
    for j in 0..size {
        for i in 0..size {
            assert_eq!(matrix[(i, j)], matrix[(j, i)]);
        }
    }
    for _ in 0..1000 {
        let motion: Vec<f64> = (0..size).map(|i| random.signed() / unit(i)).collect();
        let mut energy = 0.0;
        for j in 0..size {
            for i in 0..size {
                energy += motion[i] * matrix[(i, j)] * motion[j];
            }
        }
        // The clipping leaves 1e-12 of the largest eigenvalue, and the trace bounds that eigenvalue.
        assert!(energy >= -1e-11 * largest * size as f64, "{energy:e}");
    }
}

#[test]
fn the_published_matrices_are_symmetric_and_semidefinite() {
    let freedom = [Freedom::Rigid, Freedom::Rigid, Freedom::Translation];
    let (mut sheet, poses) = loaded(config(), freedom);
    settle(&mut sheet, &poses, 1.0, 60).unwrap();
    sheet.assemble();
    let mut condenser = Condenser::new(&sheet).unwrap();
    let condensed = condenser.condense(&sheet, 1.0 / 60.0).unwrap();
    assert_definite(&condensed.stiffness, condensed.length);
    assert_definite(&condensed.damping, condensed.length);
    assert_eq!(condensed.damping_clip.count, 0);
}

#[test]
fn a_loose_sheet_in_one_hand_has_a_local_model() {
    // The sheet is flat, without bending, and held at a corner. Its static stiffness is singular.
    let mesh = grid(6, 6, LX, LX, Split::Right);
    let handles = [handle(&mesh, Freedom::Rigid, |x| x.x + x.y < 0.02)];
    let config = BodyConfig {
        mass_damping: 1.0,
        stiffness_damping: 1e-3,
        ..tight()
    };
    let mut sheet = Body::sheet(&mesh, &[rubber(0.3)], config, &handles).unwrap();
    let mut condenser = Condenser::new(&sheet).unwrap();
    assert_eq!(
        condenser.condense(&sheet, 0.01).map(|_| ()),
        Err(CondenseError::NotAssembled)
    );
    sheet.assemble();
    let condensed = condenser.condense(&sheet, 0.01).unwrap();
    assert_definite(&condensed.stiffness, condensed.length);
    // A flat membrane has no stiffness out of its plane. The free nodes do not follow the hand, so the hand feels no
    // force.
    let (out, along) = (condensed.stiffness[(2, 2)], condensed.stiffness[(0, 0)]);
    assert!(out.abs() < 1e-9 * along, "{out:e} {along:e}");
    let period = condenser.condense(&sheet, -1.0).map(|_| ());
    assert_eq!(period, Err(CondenseError::Period { found: -1.0 }));
}

#[test]
fn a_sheet_held_everywhere_or_nowhere_has_a_local_model() {
    let mesh = grid(2, 2, LX, LX, Split::Right);
    let all = [handle(&mesh, Freedom::Rigid, |_| true)];
    let mut sheet = Body::sheet(&mesh, &[rubber(0.3)], tight(), &all).unwrap();
    sheet.step(1e-3, &rest_poses(&all)).unwrap();
    sheet.assemble();
    let mut condenser = Condenser::new(&sheet).unwrap();
    let condensed = condenser.condense(&sheet, 0.01).unwrap();
    // The body is rigid: it has mass and no stiffness.
    assert!((condensed.mass[(0, 0)] / sheet.total_mass() - 1.0).abs() < 1e-12);
    assert!(
        condensed
            .stiffness
            .as_slice()
            .iter()
            .all(|k| k.abs() < 1e-9)
    );

    let mut loose = Body::sheet(&mesh, &[rubber(0.3)], tight(), &[]).unwrap();
    loose.step(1e-3, &[]).unwrap();
    let mut condenser_of_none = Condenser::new(&loose).unwrap();
    assert_eq!(
        condenser_of_none
            .condense(&loose, 0.01)
            .unwrap()
            .stiffness
            .size(),
        0
    );
    assert_eq!(
        condenser.condense(&loose, 0.01).map(|_| ()),
        Err(CondenseError::Topology)
    );
}

#[test]
fn clipping_gives_the_nearest_semidefinite_matrix() {
    // The eigenvalues are 3 and -1 along (1, 1) and (1, -1). Clipping leaves only the first.
    let mut matrix = Square::zeros(2);
    matrix[(0, 0)] = 1.0;
    matrix[(1, 1)] = 1.0;
    matrix[(0, 1)] = 2.0;
    matrix[(1, 0)] = 2.0;
    let mut clipper = Clipper::new(2);
    let clip = clipper.clip(&mut matrix, &[1.0, 1.0]);
    assert_eq!(clip.count, 1);
    // The tolerance is the rounding of a rotation.
    assert!((clip.fraction - 1.0 / 3.0).abs() < 1e-15);
    assert!(
        matrix.as_slice().iter().all(|k| (k - 1.5).abs() < 1e-15),
        "{matrix:?}"
    );
    let again = matrix.clone();
    assert_eq!(clipper.clip(&mut matrix, &[1.0, 1.0]).count, 0);
    assert_eq!(matrix, again);
}

/// A cube of quadratic tetrahedra under a load, between two plates, with a support on one side.
fn cube_between_plates(law: SolidLaw) -> (Body, Vec<HandlePose>) {
    let mesh = cube(2, 0.1, true);
    let face = |axis: usize, at: f64| -> Vec<u32> {
        let near = |x: &Vec3| (x[axis] - at).abs() < 1e-9;
        let inner = |x: &Vec3| axis == 2 || (x.z > 1e-9 && x.z < 1.0 - 1e-9);
        let chosen = (0_u32..)
            .zip(&mesh.positions)
            .filter(|(_, x)| near(x) && inner(x));
        chosen.map(|(vertex, _)| vertex).collect()
    };
    let handles = [0.0, 1.0].map(|at| HandleSpec {
        vertices: face(2, at),
        origin: Vec3::new(0.5, 0.4, at),
        freedom: Freedom::Rigid,
        border: Border::Hinged,
    });
    let material = SolidMaterial {
        young: 1e4,
        poisson: 0.4,
        density: 1000.0,
    };
    let config = BodyConfig {
        bending: 0.0,
        ..config()
    };
    let mut body = Body::solid(&mesh, &[material], law, config, &handles).unwrap();
    body.add_support(&face(0, 0.0), [true, false, false])
        .unwrap();
    let mut poses = rest_poses(&handles);
    poses[1].position += Vec3::new(0.05, 0.0, -0.1);
    poses[1].rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.1, 0.0, 0.2));
    (body, poses)
}

#[test]
fn the_condensation_of_a_solid_repeats_the_perturbed_step() {
    let freedom = [Freedom::Rigid; 2];
    for law in [SolidLaw::Corotational, SolidLaw::StableNeoHookean] {
        let (mut body, poses) = cube_between_plates(law);
        settle(&mut body, &poses, 1.0, 60).unwrap();
        for h in [1e-3, 1.0 / 60.0] {
            body.assemble();
            let mut condenser = Condenser::new(&body).unwrap();
            let rerun = rerun(&body, &poses, h, &freedom);
            let condensed = condenser.condense(&body, h).unwrap();
            let found = dynamic(condensed, h);
            let error = difference(&found, &rerun, condensed.length, &freedom);
            println!("{law:?} h = {h}: {error:.1e}");
            // The central difference of the turns has an error of 1e-8 of the largest entry.
            assert!(error < 1e-7, "{law:?} {h} {error}");
        }
    }
}

#[test]
fn static_condensation_is_the_response_of_the_body_at_rest() {
    let (mut body, poses) = cube_between_plates(SolidLaw::StableNeoHookean);
    let mut equilibrium = Equilibrium::new(&body, EquilibriumOptions::default()).unwrap();
    equilibrium.solve(&mut body, &poses, 1.0).unwrap();
    body.assemble_with(Tangent::Exact);
    let mut condenser = Condenser::new(&body).unwrap();
    let condensed = condenser.condense_static(&body).unwrap().clone();
    let by = 1e-5;
    let (mut error, mut largest) = (0.0_f64, 0.0_f64);
    for motion in 0..3 {
        let mut reactions = |sign: f64| {
            let mut moved = body.clone();
            let mut targets = poses.clone();
            targets[1].position[motion] += sign * by;
            equilibrium.solve(&mut moved, &targets, 1.0).unwrap();
            moved.handle_report(1).unwrap().reaction.force
        };
        let slope = (reactions(1.0) - reactions(-1.0)) / (2.0 * by);
        for axis in 0..3 {
            let found = condensed.raw_stiffness[(6 + axis, 6 + motion)];
            error = error.max((found - slope[axis]).abs());
            largest = largest.max(slope[axis].abs());
        }
    }
    // The residuals are 1e-9 of the forces, and the displacements are 1e-5 of the edge. The error is at most 1e-4, and
    // smaller after the last, quadratic iteration of Newton's method.
    assert!(error < 1e-5 * largest, "{error} {largest}");
}
