//! Motions of obstacles: a table `time,x,y,z,qw,qx,qy,qz` with one row for each pose (s, m, unit quaternion).

use super::csv::Table;
use super::error::SceneError;
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use physics::contact::obstacle::TimedPose;

/// Largest speed of an obstacle's origin and of a vertex between two rows (m/s). What is faster jumps.
pub const FASTEST: f64 = 20.0;
/// Largest rate of rotation between two rows (rad/s).
pub const FASTEST_TURN: f64 = 100.0;
/// Largest difference of the length of a quaternion from 1.
const LENGTH: f64 = 1e-3;

/// Reads a table of poses in the axes of the scene. The times increase; the first time is arbitrary.
///
/// Messages call the file `name`. The memory is bounded by the number of lines.
///
/// # Errors
///
/// [`SceneError::Value`] with the line, the column, the value found and the allowed values: also for a quaternion whose
/// length is not 1, and for a motion faster than [`FASTEST`] or [`FASTEST_TURN`].
pub fn parse(text: &str, name: &str) -> Result<Vec<TimedPose>, SceneError> {
    let table = Table {
        what: "a motion",
        columns: ["time", "x", "y", "z", "qw", "qx", "qy", "qz"],
        name,
    };
    let mut poses: Vec<TimedPose> = Vec::new();
    for (line, [time, x, y, z, qw, qx, qy, qz]) in table.rows(text)? {
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        let length = quaternion.norm();
        if (length - 1.0).abs().is_nan() || (length - 1.0).abs() > LENGTH {
            let found = format!("a quaternion of length {length:?}");
            let allowed = format!("a quaternion of length 1, within {LENGTH}");
            return Err(table.wrong(line, "qw", &found, allowed));
        }
        let rotation = UnitQuaternion::from_quaternion(quaternion);
        let pose = Isometry3::from_parts([x, y, z].into(), rotation);
        if let Some(last) = poses.last() {
            let during = time - last.time;
            let speed = (pose.translation.vector - last.pose.translation.vector).norm() / during;
            if speed.is_nan() || speed > FASTEST {
                let found = format!("a jump: {speed:.4e} m/s from the row before");
                let allowed = format!("up to {FASTEST} m/s");
                return Err(table.wrong(line, "x", &found, allowed));
            }
            let turn = pose.rotation.angle_to(&last.pose.rotation) / during;
            if turn > FASTEST_TURN {
                let found = format!("a jump: {turn:.4e} rad/s from the row before");
                let allowed = format!("up to {FASTEST_TURN} rad/s");
                return Err(table.wrong(line, "qw", &found, allowed));
            }
        }
        poses.push(TimedPose { time, pose });
    }
    Ok(poses)
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::Vec3;

    const HEAD: &str = "time,x,y,z,qw,qx,qy,qz\n";

    #[test]
    fn a_table_of_poses_is_read() {
        let text = format!("# a wheel\n{HEAD}0,1,2,3,1,0,0,0\n0.5,1,2,3,0.7071,0,0,0.7071\n");
        let poses = parse(&text, "a.csv").expect("two poses");
        assert_eq!(poses[0].pose, Isometry3::translation(1.0, 2.0, 3.0));
        let turn = poses[1].pose.rotation.scaled_axis();
        let quarter = core::f64::consts::FRAC_PI_2;
        assert!((turn - Vec3::z() * quarter).norm() < 1e-15, "{turn}");
    }

    #[test]
    fn wrong_poses_are_refused() {
        let begin = format!("{HEAD}0,0,0,0,1,0,0,0\n");
        for (row, said) in [
            (
                "0.1,0,0,0,0.5,0,0,0",
                "a.csv:3: qw: found a quaternion of length 0.5, allowed: a quaternion of length 1, within 0.001",
            ),
            (
                "0.1,0,3,0,1,0,0,0",
                "a.csv:3: x: found a jump: 3.0000e1 m/s from the row before, allowed: up to 20 m/s",
            ),
            (
                "0.01,0,0,0,0,1,0,0",
                "a.csv:3: qw: found a jump: 3.1416e2 rad/s from the row before, allowed: up to 100 rad/s",
            ),
            ("0.1,1e300,0,0,1,0,0,0", "a.csv:3: x: found a jump: "),
            (
                "0,0,0,0,1,0,0,0",
                "a.csv:3: time: found 0.0, allowed: a time after 0.0",
            ),
            (
                "0.1,0,0",
                "a.csv:3: found 3 columns, allowed: 8 columns, time,x,y,z,qw,qx,qy,qz: ",
            ),
        ] {
            let found = parse(&format!("{begin}{row}\n"), "a.csv").expect_err(row);
            assert!(found.to_string().starts_with(said), "{found}");
        }
    }
}
