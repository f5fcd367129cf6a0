//! A simulated device runs inside the realtime tick. After its construction, reading and writing never allocate,
//! whatever the wrench and the time.

use alloc_count::calls::{Counting, count};
use devices::ReplayDevice;
use devices::conformance::Suite;
use rt_core::{Device, Vec3};
use sim::{
    DeviceModel, Fault, Faulty, Hand, SimDevice, Sine, Task, TaskKind, Trajectory, Tremor, Wired,
};

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
    let watch = |call: &mut dyn FnMut()| assert_eq!(count(call), 0, "allocations in a call");
    // One device has three degrees of freedom, the other six.
    for model in ["falcon", "virtuose6d"] {
        let model = DeviceModel::named(model).unwrap();
        let make = || Wired::new(SimDevice::new(model, Some(hand.clone()), 1e-3).unwrap());
        let suite = Suite::new("wired").watched(&watch);
        suite.check(|| Box::new(make()));
        let fault = [(0..50_000_000, Fault::Silent)];
        let suite = suite.states(450);
        suite.check(|| Box::new(Faulty::new(Box::new(make()), fault.to_vec())));
        let readings: Vec<_> = (0..500).map(|k| make().read(k * 1_000_000)).collect();
        suite.check(|| Box::new(ReplayDevice::new(model.capabilities(), readings.clone())));
    }
}
