//! The wrenches that may be commanded after a device let go.
//!
//! The tick commands no force to a device that reports that it let go ([`Rendering`]), and the force returns along a
//! ramp. The tick computes some wrenches before it has read that state. Such a wrench would bring the whole force back
//! at once. The thread of a device therefore counts its exchanges. With each wrench, the tick hands over the number of
//! the newest exchange whose state it has read. The gate holds back a wrench from before the state that reports the
//! let-go. The tick reads only the newest state, so every state reports the let-go until the tick has read one of them.
//! Before the first force, the device has no force to let go. A device that idles until the run begins therefore
//! reports no let-go.

use rt_core::{Reading, Rendering, Wrench};

/// Holds back the wrenches that were computed before the tick could know that the device had let go.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gate {
    /// The number of the last exchange, from one.
    number: u64,
    /// The number of the last exchange in which the device had let go.
    let_go: u64,
    /// The number of the newest exchange whose state the tick has read, according to the wrenches.
    seen: u64,
    /// Whether the state of this exchange reports that the device had let go.
    tells: bool,
    /// Whether the last wrench that was commanded has a force or a moment.
    acts: bool,
    /// Whether any commanded wrench had a force or a moment.
    has_acted: bool,
}

impl Gate {
    /// Begins an exchange with a wrench of the tick, which had read the state of the exchange `seen` when it computed the
    /// wrench (zero for none). Returns the wrench to command.
    pub(super) fn pass(&mut self, wrench: &Wrench, seen: u64) -> Wrench {
        self.number = self.number.wrapping_add(1);
        self.seen = self.seen.max(seen);
        self.tells = self.seen < self.let_go;
        let command = if self.tells { Wrench::zero() } else { *wrench };
        self.acts = command != Wrench::zero();
        self.has_acted |= self.acts;
        command
    }

    /// Begins an exchange without a wrench of the tick. Returns the wrench to command, which is zero. If there was no
    /// force before, this exchange is no let-go.
    pub(super) fn let_go(&mut self) -> Wrench {
        self.number = self.number.wrapping_add(1);
        if self.acts {
            self.let_go = self.number;
        }
        self.acts = false;
        self.tells = self.seen < self.let_go;
        Wrench::zero()
    }

    /// Ends the exchange with its answer. The answer then states whether the device rendered the wrench of the tick.
    pub(super) fn end(&mut self, answer: &mut Reading) {
        let Ok(state) = answer else {
            return;
        };
        match state.rendering {
            Rendering::LetGo if !self.has_acted => state.rendering = Rendering::Commanded,
            Rendering::Commanded if self.tells => state.rendering = Rendering::LetGo,
            Rendering::Commanded => {}
            Rendering::LetGo | Rendering::Fault(_) => self.let_go = self.number,
        }
    }

    /// The number of the last exchange, from one.
    pub(super) fn number(&self) -> u64 {
        self.number
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rt_core::{DeviceError, DeviceState, Vec3};

    /// An event between a tick and the thread of its device.
    #[derive(Clone, Copy, Debug)]
    enum Step {
        /// The tick reads the newest state and hands a wrench over: no force if the state says that the device let go.
        Tick,
        /// The thread exchanges the newest wrench, or lets go if there is none.
        Exchange {
            device_lets_go: bool,
            lost_answer: bool,
        },
    }

    fn step() -> impl Strategy<Value = Step> {
        let exchange = (0..8_u8, 0..8_u8).prop_map(|(lets_go, lost)| Step::Exchange {
            device_lets_go: lets_go == 0,
            lost_answer: lost == 0,
        });
        prop_oneof![Just(Step::Tick), exchange]
    }

    struct Pipe {
        gate: Gate,
        /// The wrench that waits, with the number that the tick has seen.
        handed: Option<(Wrench, u64)>,
        reply: Option<(DeviceState, u64)>,
        seen: u64,
        /// Whether the force is gone, and no tick has learned it yet.
        untold: bool,
        last: Wrench,
        has_acted: bool,
    }

    impl Pipe {
        fn take(&mut self, step: Step) {
            match step {
                Step::Tick => {
                    let mut force = Vec3::x();
                    if let Some((state, number)) = self.reply.take() {
                        self.seen = number;
                        if state.rendering != Rendering::Commanded {
                            force = Vec3::zeros();
                            self.untold = false;
                        }
                    }
                    let moment = Vec3::zeros();
                    self.handed = Some((Wrench { force, moment }, self.seen));
                }
                Step::Exchange {
                    device_lets_go,
                    lost_answer,
                } => {
                    let command = match self.handed.take() {
                        Some((wrench, seen)) => self.gate.pass(&wrench, seen),
                        None => self.gate.let_go(),
                    };
                    let acts = command != Wrench::zero();
                    assert!(!(acts && self.untold), "a force from before the let-go");
                    self.untold |= !acts && self.last != Wrench::zero() && self.gate.tells;
                    self.last = command;
                    self.has_acted |= acts;
                    let mut state = DeviceState::resting();
                    if device_lets_go {
                        state.rendering = Rendering::LetGo;
                    }
                    let mut answer = Ok(state);
                    if lost_answer {
                        answer = Err(DeviceError::NoReport);
                    }
                    self.gate.end(&mut answer);
                    if let Ok(state) = answer {
                        self.untold |= device_lets_go && self.has_acted;
                        self.reply = Some((state, self.gate.number()));
                    }
                }
            }
        }
    }

    #[test]
    fn a_device_that_idles_before_the_first_force_tells_nothing_but_a_fault() {
        let push = Wrench {
            force: Vec3::x(),
            moment: Vec3::zeros(),
        };
        let told = |gate: &mut Gate, rendering| {
            let mut answer = Ok(DeviceState {
                rendering,
                ..DeviceState::resting()
            });
            gate.end(&mut answer);
            answer.map(|state| state.rendering)
        };
        let mut gate = Gate::default();
        gate.let_go();
        assert_eq!(told(&mut gate, Rendering::LetGo), Ok(Rendering::Commanded));
        gate.pass(&Wrench::zero(), 1);
        assert_eq!(told(&mut gate, Rendering::LetGo), Ok(Rendering::Commanded));
        gate.pass(&Wrench::zero(), 2);
        let fault = Rendering::Fault(1);
        assert_eq!(told(&mut gate, fault), Ok(fault));
        assert_eq!(gate.pass(&push, 3), push);
        assert_eq!(told(&mut gate, Rendering::LetGo), Ok(Rendering::LetGo));
    }

    /// A force that the tick has taken away itself is not let go a second time.
    #[test]
    fn a_let_go_that_the_tick_has_read_is_told_no_more() {
        let push = Wrench {
            force: Vec3::x(),
            moment: Vec3::zeros(),
        };
        let rendering = |gate: &mut Gate| {
            let mut answer = Ok(DeviceState::resting());
            gate.end(&mut answer);
            answer.map(|state| state.rendering)
        };
        let mut gate = Gate::default();
        assert_eq!(gate.pass(&push, 0), push);
        assert_eq!(rendering(&mut gate), Ok(Rendering::Commanded));
        gate.let_go();
        assert_eq!(rendering(&mut gate), Ok(Rendering::LetGo));
        // The tick has still not read it.
        gate.let_go();
        assert_eq!(rendering(&mut gate), Ok(Rendering::LetGo));
        // The tick has read the second exchange, and hands no force over. Then it is silent again.
        assert_eq!(gate.pass(&Wrench::zero(), 2), Wrench::zero());
        assert_eq!(rendering(&mut gate), Ok(Rendering::Commanded));
        gate.let_go();
        assert_eq!(rendering(&mut gate), Ok(Rendering::Commanded));
        assert_eq!(gate.number(), 5);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_force_returns_before_a_tick_knows_that_it_was_let_go(
            steps in prop::collection::vec(step(), 1..200),
        ) {
            let mut pipe = Pipe {
                gate: Gate::default(),
                handed: None,
                reply: None,
                seen: 0,
                untold: false,
                last: Wrench::zero(),
                has_acted: false,
            };
            for step in steps {
                pipe.take(step);
            }
            // A device that renders has its force again after four ticks: the state that tells, the wrench without a
            // force, the state that renders, and the wrench.
            for _ in 0..4 {
                pipe.take(Step::Tick);
                pipe.take(Step::Exchange { device_lets_go: false, lost_answer: false });
            }
            prop_assert!(pipe.last != Wrench::zero());
        }
    }

    /// A device with a fault holds no force, and no wrench from before brings the force back when the fault is over.
    #[test]
    fn after_a_fault_the_force_waits_until_the_tick_has_read_it() {
        let push = Wrench {
            force: Vec3::x(),
            moment: Vec3::zeros(),
        };
        let end = |gate: &mut Gate, rendering| {
            let mut answer = Ok(DeviceState {
                rendering,
                ..DeviceState::resting()
            });
            gate.end(&mut answer);
            answer.map(|state| state.rendering)
        };
        for rendering in [Rendering::Fault(3), Rendering::LetGo] {
            let mut gate = Gate::default();
            assert_eq!(gate.pass(&push, 0), push);
            assert_eq!(end(&mut gate, rendering), Ok(rendering));
            assert_eq!(gate.pass(&push, 0), Wrench::zero());
            let told = end(&mut gate, Rendering::Commanded);
            assert_eq!(told, Ok(Rendering::LetGo));
            assert_eq!(gate.pass(&push, 2), push);
        }
    }
}
