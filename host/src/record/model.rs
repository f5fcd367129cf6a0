//! A local model as a ROS 2 message: the definition of the message, and the conversion from and to
//! [`LocalModel`].
//!
//! A message holds only the blocks in use. Two handles take two by two blocks. A block is 3 x 3 where only
//! translations are coupled, as for every device that actuates no rotation. Only the model of a torn body, or of a body
//! with a tear limit, has an entry with the data of the tear, at the end of the message. A message of a log that was
//! written before bodies could tear ends before that entry, and is read as the model of a whole body.

use rt_core::local_model::ModelHead;
use rt_core::{HandleReference, LocalModel, MAX_HANDLES, Mat6, PieceEnergy, TearLimit};

use super::cdr::{CdrReader, CdrWriter};
use super::geometry::geometry_messages;

/// Name of the message type.
pub(super) const SCHEMA_NAME: &str = "palpate_msgs/msg/LocalModel";

/// The message definition, with the definitions that it uses.
pub(super) const SCHEMA: &str = concat!(
    "\
# The linearized force of one body on all its handles. SI units; world axes; translation before rotation.
# The tick that took it into use is the first whose body names its sequence number.
uint64 sequence     # counts the models of this body, from one
uint64 time_ns      # when the linearized state held
float64 period      # of publication
float64 horizon     # how far ahead it is to be good for
float64 energy      # that hands at rest could get back
float64 released    # of the body's own, beyond the first model's energy
uint32 epoch        # of the topology
uint8 body          # index in a tick's bodies
uint8 block         # rows of a block: 6, or 3 where only translations are coupled
palpate_msgs/Handle[] handles
float64[] stiffness # (handles x block)^2 numbers, rows first
float64[] damping   # the same
palpate_msgs/Tear[] tear  # one where the body is torn or a tear limits the extrapolation, none otherwise
================================================================================
MSG: palpate_msgs/Handle
geometry_msgs/Pose pose
geometry_msgs/Twist twist
geometry_msgs/Wrench wrench  # on the hand
uint8 device                 # index in a tick's devices
geometry_msgs/Vector3 contact  # outward normal of what can push only; zero where held
geometry_msgs/Vector3 weight   # the part of the force that is weight
geometry_msgs/Wrench drift     # rate of the wrench beside what stiffness makes of the twist
================================================================================
MSG: palpate_msgs/Tear
float64 root        # sqrt(G) of the nearest tip at the reference (sqrt(J/m2))
float64 critical    # sqrt(G_c) (sqrt(J/m2)); zero without a tear limit
float64 area        # 1 / (q . K^-1 q) with the slopes q (m2)
uint8[] pieces      # number of the piece, by handle
float64[] stored    # energy that hands at rest could get back, by piece
float64[] released  # energy of the piece's own since the parting, by piece
float64[] slope     # of sqrt(G), by handle: translation (per m), then rotation (per rad)
",
    geometry_messages!()
);

/// A local model read back from a log: the index of its body, and the parts of the model that are in use.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelRow {
    /// Index of the body.
    pub body: u8,
    /// The numbers that do not belong to a handle.
    pub head: ModelHead,
    /// The handles, at most [`MAX_HANDLES`].
    pub handles: Vec<HandleReference>,
    /// Rows of a block, 3 or 6.
    block: usize,
    /// Stiffness, then damping, as in the message.
    matrices: [Vec<f64>; 2],
}

impl ModelRow {
    /// The model as the host published it.
    pub fn model(&self) -> LocalModel {
        let mut model = LocalModel::empty();
        model.head = self.head;
        for (to, from) in model.handles.iter_mut().zip(&self.handles) {
            *to = *from;
        }
        let (count, block) = (self.handles.len(), self.block);
        let [stiffness, damping] = &self.matrices;
        for (numbers, blocks) in [
            (stiffness, &mut model.stiffness),
            (damping, &mut model.damping),
        ] {
            let places = (0..count * block).flat_map(|r| (0..count * block).map(move |c| (r, c)));
            for ((r, c), number) in places.zip(numbers) {
                blocks[r / block][c / block][(r % block, c % block)] = *number;
            }
        }
        model
    }
}

/// Writes a model into `bytes`, in place of the former content.
pub(crate) fn encode(body: u8, model: &LocalModel, bytes: &mut Vec<u8>) {
    let count = model.handles().count();
    let block = if turns(model, count) { 6 } else { 3 };
    let mut out = CdrWriter::begin(bytes);
    let head = &model.head;
    out.u64(head.sequence);
    out.u64(head.time_ns);
    out.f64(head.period);
    out.f64(head.horizon);
    out.f64(head.energy);
    out.f64(head.released);
    out.u32(head.epoch);
    out.u8(body);
    out.u8(block as u8);
    out.u32(count as u32);
    for handle in model.handles() {
        out.pose(&handle.pose);
        out.twist(&handle.twist);
        out.wrench(&handle.wrench);
        out.u8(handle.device);
        out.vector(&handle.contact);
        out.vector(&handle.weight);
        out.wrench(&handle.drift);
    }
    for blocks in [&model.stiffness, &model.damping] {
        out.u32((count * block * count * block) as u32);
        for row in blocks.iter().take(count) {
            for r in 0..block {
                for matrix in row.iter().take(count) {
                    (0..block).for_each(|c| out.f64(matrix[(r, c)]));
                }
            }
        }
    }
    let torn = model.piece_count() > 1 || model.head.tear_limit.is_some();
    out.u32(u32::from(torn));
    if torn {
        encode_tear(model, count, &mut out);
    }
}

fn encode_tear(model: &LocalModel, count: usize, out: &mut CdrWriter) {
    let limit = &model.head.tear_limit;
    for number in [limit.root, limit.critical, limit.area] {
        out.f64(number);
    }
    out.u32(count as u32);
    model.handles().for_each(|handle| out.u8(handle.piece));
    let pieces = model
        .head
        .pieces
        .iter()
        .take(usize::from(model.piece_count()));
    out.u32(pieces.len() as u32);
    pieces.clone().for_each(|piece| out.f64(piece.stored));
    out.u32(pieces.len() as u32);
    pieces.for_each(|piece| out.f64(piece.released));
    out.u32(6 * count as u32);
    for handle in model.handles() {
        handle.tear_slope.iter().for_each(|slope| out.f64(*slope));
    }
}

/// Whether any block couples rotations. The comparison is bit by bit: a negative zero counts as an entry.
fn turns(model: &LocalModel, count: usize) -> bool {
    let entry = |m: &Mat6, r: usize, c: usize| (r >= 3 || c >= 3) && m[(r, c)].to_bits() != 0;
    let turns = |m: &Mat6| (0..6).any(|r| (0..6).any(|c| entry(m, r, c)));
    let rows = model.stiffness.iter().take(count);
    let rows = rows.chain(model.damping.iter().take(count));
    rows.flat_map(|row| row.iter().take(count)).any(turns)
}

/// Reads a model back; `None` if the message is too short or its sizes are inconsistent.
pub(super) fn decode(message: &[u8]) -> Option<ModelRow> {
    let mut from = CdrReader::begin(message)?;
    let mut head = ModelHead {
        sequence: from.u64()?,
        time_ns: from.u64()?,
        period: from.f64()?,
        horizon: from.f64()?,
        energy: from.f64()?,
        released: from.f64()?,
        epoch: from.u32()?,
        ..ModelHead::empty()
    };
    let (body, block) = (from.u8()?, usize::from(from.u8()?));
    let count = from.u32()? as usize;
    if count > MAX_HANDLES || !(block == 3 || block == 6) {
        return None;
    }
    head.handle_count = count as u8;
    let mut handles = (0..count)
        .map(|_| decode_handle(&mut from))
        .collect::<Option<Vec<_>>>()?;
    let size = (count * block).pow(2);
    let mut matrix = || {
        if from.u32()? as usize != size {
            return None;
        }
        (0..size).map(|_| from.f64()).collect::<Option<Vec<_>>>()
    };
    let matrices = [matrix()?, matrix()?];
    match from.u32() {
        None | Some(0) => {}
        Some(1) => decode_tear(&mut from, &mut handles, &mut head)?,
        Some(_) => return None,
    }
    Some(ModelRow {
        body,
        head,
        handles,
        block,
        matrices,
    })
}

/// Reads the data of a tear into handles and head.
fn decode_tear(
    from: &mut CdrReader,
    handles: &mut [HandleReference],
    head: &mut ModelHead,
) -> Option<()> {
    head.tear_limit = TearLimit {
        root: from.f64()?,
        critical: from.f64()?,
        area: from.f64()?,
    };
    if from.u32()? as usize != handles.len() {
        return None;
    }
    for handle in handles.iter_mut() {
        handle.piece = from.u8()?;
    }
    let mut each = [const { Vec::new() }; 2];
    for numbers in &mut each {
        let count = from.u32()? as usize;
        if count > MAX_HANDLES {
            return None;
        }
        *numbers = (0..count).map(|_| from.f64()).collect::<Option<Vec<_>>>()?;
    }
    let [stored, released] = each;
    for (piece, (stored, released)) in head.pieces.iter_mut().zip(stored.into_iter().zip(released))
    {
        *piece = PieceEnergy { stored, released };
    }
    if from.u32()? as usize != 6 * handles.len() {
        return None;
    }
    for slope in handles
        .iter_mut()
        .flat_map(|handle| handle.tear_slope.iter_mut())
    {
        *slope = from.f64()?;
    }
    Some(())
}

fn decode_handle(from: &mut CdrReader) -> Option<HandleReference> {
    Some(HandleReference {
        pose: from.pose()?,
        twist: from.twist()?,
        wrench: from.wrench()?,
        device: from.u8()?,
        contact: from.vector()?,
        weight: from.vector()?,
        drift: from.wrench()?,
        ..HandleReference::zero()
    })
}
