//! The substep changes the motion of a simulated device by too little to change a conclusion.
//!
//! Every device in every grip does every task against a spring and a damper that are rendered from encoder counts at 1
//! kHz, with friction, quantization and tremor. Halving the substep must change positions by less than 1 % of the
//! stroke, and every energy by less than 1 % of the energy lost and stored.

use rt_core::{Device, Vec3, Wrench};
use sim::{
    Arm, DeviceModel, Hand, MechanicalEnergy, SimDevice, Task, TaskKind, Tremor, Wrist, device,
};

/// Runs for four seconds. Returns the true position at each tick and the account at the end.
fn run(model: DeviceModel, hand: &Hand, substep_ns: u64) -> (Vec<Vec3>, MechanicalEnergy) {
    let mut device = SimDevice::new(model, Some(hand.clone()), 1e-3)
        .unwrap()
        .with_substep_ns(substep_ns)
        .unwrap();
    let mut places = Vec::new();
    for tick in 0..4000 {
        let now = tick * 1_000_000;
        let state = device.read(now).unwrap();
        // Within the passive limit of every device, 2 b / T, or with some damping of the arm.
        let force = state.pose.position * -100.0 - state.twist.linear * 1.0;
        let turn = state.pose.rotation.scaled_axis();
        let wrench = Wrench {
            force,
            moment: turn * -1.0 + Vec3::new(0.05, 0.0, 0.1),
        };
        device.write(now, &wrench).unwrap();
        places.push(device.position());
    }
    (places, *device.energy())
}

fn energies(account: &MechanicalEnergy) -> [(&'static str, f64); 7] {
    [
        ("motor work", account.motor_work),
        ("hand work", account.hand_work),
        ("friction", account.friction_loss),
        ("damping", account.damping_loss),
        ("arm", account.arm_loss),
        ("stored", account.stored()),
        ("on hand", account.on_hand()),
    ]
}

#[test]
fn halving_the_substep_changes_results_by_less_than_a_hundredth() {
    let (mut worst_place, mut worst_energy): (f64, f64) = (0.0, 0.0);
    for (device, model) in DeviceModel::all() {
        for (grip, arm) in Arm::GRIPS {
            for (seed, (name, kind)) in TaskKind::ALL.into_iter().enumerate() {
                // A device of one or two degrees of freedom has the task along its own axes.
                let direction = model.freedom().part(&Vec3::new(0.3, -0.2, -1.0));
                let task = Task::new(kind, direction);
                let hand = Hand::new(task.trajectory(seed as u64).unwrap())
                    .with_arm(arm)
                    .with_wrist(Wrist::named(grip).unwrap())
                    .with_tremor(Tremor::new(1e-4, seed as u64).unwrap());
                let (coarse, a) = run(model, &hand, device::SUBSTEP_NS);
                let (fine, b) = run(model, &hand, device::SUBSTEP_NS / 2);
                let stroke = fine.iter().map(Vec3::norm).fold(0.0, f64::max);
                let pairs = coarse.iter().zip(&fine);
                let moved = pairs.map(|(p, q)| (p - q).norm()).fold(0.0, f64::max);
                let at = format!("{device}, {grip}, {name}");
                // A relaxed hand does not move the heaviest device against its friction.
                assert!(moved <= 0.01 * stroke, "{at}: {moved} of {stroke}");
                if stroke > 0.0 {
                    worst_place = worst_place.max(moved / stroke);
                }
                let turned_over = b.lost() + b.stored();
                for ((what, a), (_, b)) in energies(&a).into_iter().zip(energies(&b)) {
                    let change = (a - b).abs() / turned_over;
                    assert!(change < 0.01, "{at}: {what} {a} {b}");
                    worst_energy = worst_energy.max(change);
                }
                // Rounding of up to 160,000 substeps.
                assert!(a.residual().abs() < 1e-10 * turned_over, "{at}");
                // Friction dissipated energy, unless a relaxed hand is too soft to move a paddle or a pantograph.
                let holds = stroke < 1e-3 && model.axes.is_some() && grip == "relaxed";
                assert!(b.friction_loss > 1e-6 || holds, "{at}");
            }
        }
    }
    println!("worst change of a place {worst_place:.1e}, of an energy {worst_energy:.1e}");
}
