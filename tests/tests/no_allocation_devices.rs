//! A simulated device runs inside the realtime tick: reading and writing never allocate after its construction.
use palpate_tests::counting::{Counting, count};
use rt_core::{Device, Vec3, Wrench};
use sim::{DeviceModel, Hand, SimDevice, Sine, Task, TaskKind, Trajectory, Tremor, Wired};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn reads_and_writes_never_allocate() {
    let reach = [(0.0, Vec3::zeros()), (0.5, Vec3::new(0.02, 0.0, 0.0))];
    let sway = Sine {
        amplitude: Vec3::new(0.0, 0.01, 0.0),
        frequency: 2.0,
        phase: 0.0,
    };
    let recording: Vec<_> = (0..100)
        .map(|k| {
            (
                0.01 * f64::from(k),
                Vec3::new(0.0, 0.0, 1e-4 * f64::from(k)),
            )
        })
        .collect();
    let task = Task::new(TaskKind::Rub, Vec3::new(0.0, 0.0, -1.0));
    let trajectory = Trajectory::new_sum([
        task.trajectory(1).unwrap(),
        Trajectory::new_waypoints(&reach).unwrap(),
        Trajectory::new_sines(&[sway], 0.5).unwrap(),
        Trajectory::new_recorded(&recording).unwrap(),
    ]);
    let hand = Hand::new(trajectory).with_tremor(Tremor::new(1e-4, 1).unwrap());
    assert_eq!(count(|| drop(std::hint::black_box(Box::new(7)))), 2);
    // A device of three degrees of freedom and one of six.
    for model in ["falcon", "virtuose6d"] {
        let model = DeviceModel::named(model).unwrap();
        let hand = Some(hand.clone());
        let mut device = Wired::new(SimDevice::new(model, hand, 1e-3).unwrap());
        let mut refused = 0;
        let calls = count(|| {
            for tick in 0..2000 {
                let now = tick * 1_000_000;
                let state = device.read(now);
                refused += u32::from(state.is_err());
                let force = state.map_or(Vec3::zeros(), |state| state.pose.position * -500.0);
                let wrench = Wrench {
                    force,
                    moment: force * 0.05,
                };
                refused += u32::from(device.write(now, &wrench).is_err());
            }
        });
        assert_eq!((calls, refused), (0, 0));
    }
}
