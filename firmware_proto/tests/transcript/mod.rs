//! Transcripts: lines of commands, and the answers of the protocol, each answer behind two spaces.
//!
//! The golden vectors (`vectors/`) are transcripts, and the implementation in C99 reads the same commands
//! (`c/transcript.c`). Both must give the same answers to the last byte. Empty lines and lines that begin with `#` stay
//! as they are. Bytes are in hexadecimal, numbers in decimal.
//!
//! | command | answer |
//! |---|---|
//! | `decode BYTES` | the fields of the report, or the reason for its refusal |
//! | `packet BYTES` | the packet of the report |
//! | `stream` | none; a new stream decoder |
//! | `push BYTES` | the reports that the bytes complete, and the number of refused packets so far |
//! | `device CAPABILITIES [GEOMETRY JOINT...]` | none; a new device with the properties in these reports |
//! | `home`, `homed`, `reset`, `fault NUMBER` | the mode |
//! | `receive TIME BYTES` | the outcome of the report |
//! | `actuate TIME` | force and moment |
//! | `report TIME BUTTONS POWERED LIMITED BYTES` | the report; the measurement is that in the given state or counts |
//! | `counters` | the counters of the device |

pub(crate) mod golden;

use firmware_proto::device::{Accepted, Device, Geometry, Inputs, Joint, Measured, Refusal};
use firmware_proto::report::{Condition, LENGTH, Report, ReportError, Sends};
use firmware_proto::stream::{Decoder, packet};
use std::fmt::Write;
use std::num::NonZeroU8;

/// The state of a transcript.
#[derive(Default)]
pub(crate) struct Transcript {
    decoder: Decoder,
    pub(crate) device: Option<Device>,
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a String grows");
        text
    })
}

fn unhex(text: &str) -> Vec<u8> {
    let digits = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).expect("hexadecimal");
    (0..text.len()).step_by(2).map(digits).collect()
}

/// The transcript of some lines of commands; lines of answers among them are left out.
pub(crate) fn run(text: &str) -> String {
    let mut transcript = Transcript::default();
    let mut all = String::new();
    for line in text.lines().filter(|line| !line.starts_with("  ")) {
        all += line;
        all += "\n";
        for answer in transcript.answer(line) {
            all += "  ";
            all += &answer;
            all += "\n";
        }
    }
    all
}

impl Transcript {
    /// The lines that answer a command.
    pub(crate) fn answer(&mut self, line: &str) -> Vec<String> {
        let words: Vec<_> = line.split(' ').collect();
        match words[..] {
            [""] | ["#", ..] => Vec::new(),
            ["decode", bytes] => match Report::decode(&unhex(bytes)) {
                Ok(report) => {
                    assert_eq!(hex(&report.encode()), bytes);
                    fields(&report)
                }
                Err(error) => vec![format!("refused {}", reason(&error))],
            },
            ["decode"] => vec!["refused length 0".into()],
            ["packet", bytes] => {
                let report = <[u8; LENGTH]>::try_from(&unhex(bytes)[..]).expect("a report");
                vec![hex(&packet(&report))]
            }
            ["stream"] => {
                self.decoder = Decoder::new();
                Vec::new()
            }
            ["push", bytes] => {
                let mut answers = Vec::new();
                for byte in unhex(bytes) {
                    let report = self.decoder.push(byte);
                    answers.extend(report.map(|report| hex(report)));
                }
                answers.push(format!("refused {}", self.decoder.refused()));
                answers
            }
            ["device", ref parts @ ..] => {
                self.device = Some(device(parts));
                Vec::new()
            }
            _ => vec![self.device_answer(&words)],
        }
    }

    fn device_answer(&mut self, words: &[&str]) -> String {
        let device = self.device.as_mut().expect("a device comes first");
        let time = |text: &str| text.parse::<u32>().expect("a time");
        let bytes = match *words {
            ["receive", _, bytes] => unhex(bytes),
            _ => Vec::new(),
        };
        match *words {
            ["home"] => mode(device.home(), device),
            ["homed"] => mode(device.homed(), device),
            ["reset"] => mode(device.reset(), device),
            ["fault", number] => {
                device.fault(number.parse::<NonZeroU8>().expect("a fault"));
                mode(true, device)
            }
            ["receive", now] | ["receive", now, _] => match device.receive(&bytes, time(now)) {
                Ok(Accepted::Hello) => "accepted hello".into(),
                Ok(Accepted::Wrench) => "accepted wrench".into(),
                Ok(Accepted::Release) => "accepted release".into(),
                Err(Refusal::Report(error)) => format!("refused {}", reason(&error)),
                Err(Refusal::Busy) => "refused busy".into(),
                Err(Refusal::Session) => "refused session".into(),
                Err(Refusal::Mode) => "refused mode".into(),
                Err(Refusal::Sequence) => "refused sequence".into(),
                Err(Refusal::Age) => "refused age".into(),
                Err(Refusal::Limit) => "refused limit".into(),
            },
            ["actuate", now] => {
                let wrench = device.actuate(time(now));
                numbers(wrench.force.iter().chain(&wrench.moment))
            }
            ["report", now, buttons, powered, limited, bytes] => {
                let inputs = Inputs {
                    buttons: buttons.parse().expect("buttons"),
                    powered: powered == "1",
                    limited: limited == "1",
                };
                let measured = match Report::decode(&unhex(bytes)) {
                    Ok(Report::State(state)) => Measured::Pose {
                        position: state.position,
                        orientation: state.orientation,
                        velocity: state.velocity,
                        angular_velocity: state.angular_velocity,
                    },
                    Ok(Report::Encoders(report)) => Measured::Counts {
                        counts: report.counts,
                        number: report.number,
                    },
                    other => panic!("{other:?}"),
                };
                hex(&device.report(time(now), inputs, &measured))
            }
            ["counters"] => {
                let c = device.counters();
                numbers([
                    c.accepted,
                    c.length,
                    c.check_sum,
                    c.version,
                    c.kind,
                    c.range,
                    c.busy,
                    c.session,
                    c.mode,
                    c.sequence,
                    c.age,
                    c.limit,
                    c.watchdog,
                ])
            }
            _ => panic!("no command: {words:?}"),
        }
    }
}

fn mode(done: bool, device: &Device) -> String {
    let done = if done { "yes" } else { "no" };
    format!("{done}, mode {}", device.mode() as u8)
}

fn device(parts: &[&str]) -> Device {
    let mut model = None;
    let mut geometry = Geometry::default();
    for part in parts {
        match Report::decode(&unhex(part)).expect("a valid report") {
            Report::Capabilities(report) => model = Some(report.model),
            Report::Geometry(report) => {
                geometry.kinematics = report.kinematics;
                geometry.number = report.number;
                geometry.parameters = report.parameters;
            }
            Report::Joint(report) => {
                geometry.joints[usize::from(report.encoder)] = Joint {
                    quantity: report.quantity,
                    scale: report.scale,
                    offset: report.offset,
                };
            }
            other => panic!("{other:?}"),
        }
    }
    Device::new(model.expect("capabilities come first"), geometry)
}

fn reason(error: &ReportError) -> String {
    match *error {
        ReportError::Length { found } => format!("length {found}"),
        ReportError::Crc { expected, found } => format!("check sum {found}, expected {expected}"),
        ReportError::Version { found } => format!("version {found}"),
        ReportError::Kind { found, .. } | ReportError::UnexpectedKind { found } => {
            format!("kind {found}")
        }
        ReportError::OutOfRange { field, found, .. } => format!("{} {found}", field.name()),
    }
}

fn numbers<T: ToString>(numbers: impl IntoIterator<Item = T>) -> String {
    let each: Vec<_> = numbers
        .into_iter()
        .map(|number| number.to_string())
        .collect();
    each.join(" ")
}

fn condition_fields(condition: &Condition) -> Vec<String> {
    vec![
        format!("time {} us", condition.time_us),
        format!("since {} us", condition.since_us),
        format!("wrench {}", condition.wrench),
        format!("buttons {}", condition.buttons),
        format!("status {}", condition.status),
        format!("mode {}", condition.mode as u8),
        format!("refused {}", condition.refused),
        format!("fault {}", condition.fault),
    ]
}

fn fields(report: &Report) -> Vec<String> {
    let head = |name: &str, sequence: u16, session: u32| {
        vec![
            name.to_string(),
            format!("sequence {sequence}"),
            format!("session {session}"),
        ]
    };
    let mut lines;
    match report {
        Report::State(r) => {
            lines = head("state", r.sequence, r.session);
            lines.extend(condition_fields(&r.condition));
            lines.push(format!("position {} (0.1 um)", numbers(r.position)));
            lines.push(format!("orientation {}", numbers(r.orientation)));
            lines.push(format!("velocity {} um/s", numbers(r.velocity)));
            let turning = numbers(r.angular_velocity);
            lines.push(format!("angular velocity {turning} mrad/s"));
        }
        Report::Encoders(r) => {
            lines = head("encoders", r.sequence, r.session);
            lines.extend(condition_fields(&r.condition));
            lines.push(format!("counts {}", numbers(r.counts)));
            lines.push(format!("number {}", r.number));
        }
        Report::Capabilities(r) => {
            lines = head("capabilities", r.sequence, r.session);
            let model = &r.model;
            let firmware = model.firmware;
            lines.push(format!("hello {}", r.hello));
            lines.push(format!("sensed {}", model.sensed));
            lines.push(format!("actuated {}", model.actuated));
            lines.push(format!(
                "firmware {}.{}.{}",
                firmware.major, firmware.minor, firmware.patch
            ));
            lines.push(format!("force {} uN", model.max_force));
            lines.push(format!("moment {} uN m", model.max_moment));
            lines.push(format!("radius {} (0.1 um)", model.workspace_radius));
            lines.push(format!("step {} nm", model.position_step_nm));
            lines.push(format!("rate {} to {} Hz", model.rate[0], model.rate[1]));
            lines.push(format!("watchdog {} us", r.watchdog_us));
            lines.push(format!("hello time {} us", r.hello_time_us));
            let (sends, encoders) = match model.sends {
                Sends::Poses => (1, 0),
                Sends::Counts { encoders } => (2, encoders),
            };
            lines.push(format!("sends {sends}"));
            lines.push(format!("encoders {encoders}"));
            let name: String = model
                .name
                .iter()
                .filter(|&&b| b != 0)
                .map(|&b| char::from(b))
                .collect();
            lines.push(format!("model {name}"));
        }
        Report::Geometry(r) => {
            lines = head("geometry", r.sequence, r.session);
            lines.push(format!("kinematics {}", r.kinematics));
            lines.push(format!("number {}", r.number));
            lines.push(format!("parameters {}", numbers(r.parameters)));
        }
        Report::Joint(r) => {
            lines = head("joint", r.sequence, r.session);
            lines.push(format!("encoder {}", r.encoder));
            lines.push(format!("quantity {}", r.quantity as u8));
            lines.push(format!("scale {} (0.000001)", r.scale));
            lines.push(format!("offset {}", r.offset));
        }
        Report::Wrench(r) => {
            lines = head("wrench", r.sequence, r.session);
            lines.push(format!("answers {}", r.answers));
            lines.push(format!("flags {}", r.flags));
            lines.push(format!("force {} uN", numbers(r.force)));
            lines.push(format!("moment {} uN m", numbers(r.moment)));
        }
        Report::Hello(r) => {
            lines = head("hello", r.sequence, r.session);
            lines.push(format!("newest {}", r.newest));
            lines.push(format!("watchdog {} us", r.watchdog_us));
        }
    }
    lines
}
