//! The messages between a run and the process of a plug-in, one packet of a socket each: the answer to the opening, then
//! a wrench and an answer in turn. Both ends are one program on one machine.

use super::abi::{Capabilities, State, Wrench};

/// Longest message (bytes): an answer to the opening with the text of an error.
pub(super) const LONGEST: usize = 4096;
/// Length of the capabilities (bytes).
const CAPABILITIES: usize = 40;
/// Length of an answer to a wrench (bytes).
const ANSWER: usize = 124;
/// Length of a wrench (bytes).
const WRENCH: usize = 48;

/// The first message of the process of a plug-in.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Opening {
    /// The device is open.
    Open {
        /// The name that the plug-in gives its device.
        name: String,
        capabilities: Capabilities,
    },
    /// The reason why the device is not open.
    Refused(String),
}

impl Opening {
    pub(super) fn encode(&self) -> Vec<u8> {
        let (first, numbers, text) = match self {
            Self::Refused(problem) => (0, Vec::new(), problem),
            Self::Open { name, capabilities } => (1, capabilities.encode(), name),
        };
        let mut bytes = vec![first];
        bytes.extend(numbers);
        bytes.extend(text.bytes());
        bytes.truncate(LONGEST);
        bytes
    }

    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let (first, rest) = bytes.split_first()?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        match first {
            0 => Some(Self::Refused(text(rest))),
            1 => Some(Self::Open {
                name: text(rest.get(CAPABILITIES..)?),
                capabilities: Capabilities::decode(rest.get(..CAPABILITIES)?)?,
            }),
            _ => None,
        }
    }
}

impl Capabilities {
    fn encode(&self) -> Vec<u8> {
        let bits = [self.sensed, self.actuated].map(u32::to_le_bytes);
        let numbers = [
            self.max_force,
            self.max_moment,
            self.workspace_radius,
            self.position_step,
        ];
        let mut bytes = bits.concat();
        bytes.extend(numbers.map(f64::to_le_bytes).concat());
        bytes
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let mut reader = Reader(bytes);
        Some(Self {
            sensed: u32::from_le_bytes(reader.next()?),
            actuated: u32::from_le_bytes(reader.next()?),
            max_force: reader.number()?,
            max_moment: reader.number()?,
            workspace_radius: reader.number()?,
            position_step: reader.number()?,
        })
    }
}

/// A wrench.
pub(super) fn encode_wrench(wrench: &Wrench) -> [u8; WRENCH] {
    let mut bytes = [0; WRENCH];
    let numbers = wrench.force.iter().chain(&wrench.moment);
    for (to, number) in bytes.chunks_exact_mut(8).zip(numbers) {
        to.copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

/// The wrench in a message; `None` if the message is no wrench.
pub(super) fn decode_wrench(bytes: &[u8]) -> Option<Wrench> {
    let mut reader = Reader(bytes);
    Some(Wrench {
        force: reader.numbers()?,
        moment: reader.numbers()?,
    })
}

/// The result of the plug-in and the state that it filled in.
pub(super) fn encode_answer(code: i32, state: &State) -> Vec<u8> {
    let numbers = [
        &state.position[..],
        &state.orientation,
        &state.velocity,
        &state.angular_velocity,
    ];
    let mut bytes = Vec::with_capacity(ANSWER);
    bytes.extend(code.to_le_bytes());
    bytes.extend(numbers.concat().iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(state.time_ns.to_le_bytes());
    bytes.extend(state.buttons.to_le_bytes());
    bytes.extend(state.rendering.to_le_bytes());
    bytes
}

/// The answer in a message; `None` if the message is no answer.
pub(super) fn decode_answer(bytes: &[u8]) -> Option<(i32, State)> {
    let mut reader = Reader(bytes);
    let code = i32::from_le_bytes(reader.next()?);
    let state = State {
        position: reader.numbers()?,
        orientation: reader.numbers()?,
        velocity: reader.numbers()?,
        angular_velocity: reader.numbers()?,
        time_ns: u64::from_le_bytes(reader.next()?),
        buttons: u32::from_le_bytes(reader.next()?),
        rendering: u32::from_le_bytes(reader.next()?),
    };
    reader.0.is_empty().then_some((code, state))
}

/// Reads the fields of a message in turn.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn next<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    fn number(&mut self) -> Option<f64> {
        self.next().map(f64::from_le_bytes)
    }

    fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.number()?;
        }
        Some(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_message_comes_back_from_its_bytes() {
        let wrench = Wrench {
            force: [1.0, -2.0, 3.5],
            moment: [0.25, f64::MIN_POSITIVE, -0.0],
        };
        let bytes = encode_wrench(&wrench);
        let again = decode_wrench(&bytes).expect("a wrench");
        assert_eq!((again.force, again.moment), (wrench.force, wrench.moment));
        assert!(decode_wrench(&bytes[1..]).is_none());
        let state = State {
            position: [1.0, 2.0, 3.0],
            orientation: [4.0, 5.0, 6.0, 7.0],
            velocity: [8.0, 9.0, 10.0],
            angular_velocity: [11.0, 12.0, 13.0],
            time_ns: 1 << 60,
            buttons: 5,
            rendering: 6,
        };
        let bytes = encode_answer(-19, &state);
        assert_eq!(bytes.len(), ANSWER);
        let (code, again) = decode_answer(&bytes).expect("an answer");
        assert_eq!((code, format!("{again:?}")), (-19, format!("{state:?}")));
        assert!(decode_answer(&bytes[1..]).is_none() && decode_answer(&[0; ANSWER + 1]).is_none());
        for opening in [
            Opening::Refused("no device".into()),
            Opening::Open {
                name: "arm".into(),
                capabilities: Capabilities {
                    sensed: 7,
                    actuated: 3,
                    max_force: 5.0,
                    max_moment: 0.5,
                    workspace_radius: 0.1,
                    position_step: 1e-5,
                },
            },
        ] {
            assert_eq!(Opening::decode(&opening.encode()), Some(opening));
        }
        assert_eq!(Opening::decode(&[]), None);
        assert_eq!(Opening::decode(&[1, 0, 0]), None);
        assert_eq!(Opening::decode(&[2]), None);
    }
}
