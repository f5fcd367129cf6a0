//! The states and the capabilities that a plug-in fills in.

use super::Input;
use devices::plugin::{abi, capabilities, state_of};
use rt_core::{Axes, Freedom};

/// Reads the bytes of the structures that a plug-in fills in: its state, and its capabilities. Returns how many of them
/// were accepted.
///
/// # Panics
/// If a state or the capabilities that no device has are accepted.
pub fn plugin_state(bytes: &[u8]) -> usize {
    let mut input = Input::new(bytes);
    let mut accepted = 0;
    let found = abi::Capabilities {
        sensed: input.u32(),
        actuated: input.u32(),
        max_force: input.f64(),
        max_moment: input.f64(),
        workspace_radius: input.f64(),
        position_step: input.f64(),
    };
    if let Some(capabilities) = capabilities(&found) {
        accepted += 1;
        for number in [
            capabilities.max_force,
            capabilities.workspace_radius,
            capabilities.position_step,
        ] {
            assert!(number.is_finite() && number > 0.0, "{capabilities:?}");
        }
        let moment = capabilities.max_moment;
        assert!(moment.is_finite() && (moment > 0.0) == capabilities.actuated.turns());
    }
    let state = abi::State {
        position: [input.f64(), input.f64(), input.f64()],
        orientation: [input.f64(), input.f64(), input.f64(), input.f64()],
        velocity: [input.f64(), input.f64(), input.f64()],
        angular_velocity: [input.f64(), input.f64(), input.f64()],
        time_ns: u64::from_le_bytes(input.array()),
        buttons: input.u32(),
        rendering: input.u32(),
    };
    let x = Axes::new([true, false, false]).map(Freedom::Along);
    for sensed in [Some(Freedom::Three), Some(Freedom::Six), x]
        .into_iter()
        .flatten()
    {
        let Some(state) = state_of(&state, sensed) else {
            continue;
        };
        accepted += 1;
        assert!(state.is_finite(), "{state:?}");
        let turn = state.pose.rotation.coords.norm();
        assert!((turn - 1.0).abs() < 1e-9, "{state:?}");
        assert_eq!(sensed.part(&state.pose.position), state.pose.position);
        assert_eq!(sensed.part(&state.twist.linear), state.twist.linear);
    }
    accepted
}
