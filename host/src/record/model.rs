//! A local model as a log keeps it: only the parts in use.
//!
//! Two handles take two by two blocks. A block is 3 x 3 if only translations are coupled, as for every device that actuates
//! no rotation. Only the model of a torn body, or of a body with a tear limit, has an entry with the data of the tear, at
//! the end of the message. A message of a log that was written before bodies could tear ends before that entry, and is
//! read as the model of a whole body.

use super::field::{Record, Visitor, fields, record};
use super::kind::{Stamp, kind};
use rt_core::local_model::ModelHead;
use rt_core::publication::Publication;
use rt_core::{HandleReference, LocalModel, MAX_HANDLES, Mat6, PieceEnergy, TearLimit};

/// A local model with the index of its body, and the parts of the model that are in use.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelRow {
    /// Index of the body.
    pub body: u8,
    /// The numbers that do not belong to a handle, without those of the tear.
    pub head: ModelHead,
    /// The handles, without the numbers of the tear.
    pub handles: Vec<HandleReference>,
    /// Rows of a block, 3 or 6.
    block: u8,
    /// Numbers of the blocks, rows first.
    stiffness: Vec<f64>,
    damping: Vec<f64>,
    /// One if the body is torn or a tear limits the extrapolation, none otherwise.
    tear: Vec<Torn>,
    /// The work of contacts with other bodies (J), if there was any.
    received: Vec<f64>,
}

/// What a tear adds to a model.
#[derive(Clone, Debug, PartialEq)]
struct Torn {
    limit: TearLimit,
    /// Number of the piece, by handle.
    pieces: Vec<u8>,
    /// Energies by piece.
    stored: Vec<f64>,
    released: Vec<f64>,
    /// Six slopes by handle.
    slope: Vec<f64>,
}

impl ModelRow {
    /// The used part of a model of the body of index `body`.
    pub fn new(body: u8, model: &LocalModel) -> Self {
        let block = if turns(model) { 6 } else { 3 };
        let handles: Vec<_> = model.handles().copied().collect();
        let matrix = |blocks: &[[Mat6; MAX_HANDLES]; MAX_HANDLES]| {
            let places = places(handles.len(), block);
            places
                .map(|[(i, r), (j, c)]| blocks[i][j][(r, c)])
                .collect()
        };
        let count = model.piece_count();
        let torn = (count > 1 || model.head.tear_limit.is_some()).then(|| {
            let energies = model.head.pieces.iter().take(usize::from(count));
            let slopes = handles.iter().flat_map(|handle| handle.tear_slope.iter());
            Torn {
                limit: model.head.tear_limit,
                pieces: handles.iter().map(|handle| handle.piece).collect(),
                stored: energies.clone().map(|piece| piece.stored).collect(),
                released: energies.map(|piece| piece.released).collect(),
                slope: slopes.copied().collect(),
            }
        });
        let ModelHead {
            pieces, tear_limit, ..
        } = ModelHead::empty();
        Self {
            body,
            head: ModelHead {
                pieces,
                tear_limit,
                received: 0.0,
                ..model.head
            },
            block: block as u8,
            stiffness: matrix(&model.stiffness),
            damping: matrix(&model.damping),
            tear: torn.into_iter().collect(),
            received: (Some(model.head.received).filter(|work| *work != 0.0))
                .into_iter()
                .collect(),
            handles,
        }
    }

    /// The stamp of its message.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            body: 0,
            number: None,
            time_ns: self.head.time_ns,
        }
    }

    /// The model as the host published it.
    pub fn model(&self) -> LocalModel {
        let mut model = LocalModel::empty();
        model.head = self.head;
        model.head.received = self.received.first().copied().unwrap_or(0.0);
        for (to, from) in model.handles.iter_mut().zip(&self.handles) {
            *to = *from;
        }
        for (numbers, blocks) in [
            (&self.stiffness, &mut model.stiffness),
            (&self.damping, &mut model.damping),
        ] {
            let places = places(self.handles.len(), usize::from(self.block));
            for ([(i, r), (j, c)], number) in places.zip(numbers) {
                blocks[i][j][(r, c)] = *number;
            }
        }
        for torn in &self.tear {
            model.head.tear_limit = torn.limit;
            let energies = torn.stored.iter().zip(&torn.released);
            for (piece, (&stored, &released)) in model.head.pieces.iter_mut().zip(energies) {
                *piece = PieceEnergy { stored, released };
            }
            let slopes = torn.slope.as_chunks::<6>().0.iter();
            let each = torn.pieces.iter().zip(slopes);
            for (handle, (piece, slope)) in model.handles.iter_mut().zip(each) {
                handle.piece = *piece;
                handle.tear_slope = (*slope).into();
            }
        }
        model
    }
}

/// The position of each number of a matrix over `handles` handles, rows first: handle and row, then handle and column.
fn places(handles: usize, block: usize) -> impl Iterator<Item = [(usize, usize); 2]> {
    let size = handles * block;
    let places = (0..size).flat_map(move |r| (0..size).map(move |c| [r, c]));
    places.map(move |place| place.map(|at| (at / block, at % block)))
}

/// Whether any block couples rotations. The comparison is bit by bit: a negative zero counts as an entry.
fn turns(model: &LocalModel) -> bool {
    let entry = |m: &Mat6, r: usize, c: usize| (r >= 3 || c >= 3) && m[(r, c)].to_bits() != 0;
    let turns = |m: &Mat6| (0..6).any(|r| (0..6).any(|c| entry(m, r, c)));
    model.blocks().flatten().any(turns)
}

kind! { ModelRow: "palpate_msgs/msg/LocalModel", Run, |_| "/model".to_owned(); }

record! { ModelRow: Self::new(0, &LocalModel::empty()), Self::count;
    head: flat;
    "uint8 body          # index in a tick's bodies" body;
    "uint8 block         # rows of a block: 6, or 3 where only translations are coupled" block;
    "palpate_msgs/Handle[] handles" handles: list "handle";
    "float64[] stiffness # (handles x block)^2 numbers, rows first" stiffness;
    "float64[] damping   # the same" damping;
    "palpate_msgs/Tear[] tear  # one where the body is torn or a tear limits the extrapolation, none otherwise" tear: tail "tear";
    "float64[] received # optional: work of contacts with other bodies, one number if there was any" received: late;
}

impl ModelRow {
    /// Counts the handles. `None` if the lengths of the lists contradict each other.
    fn count(&mut self) -> Option<()> {
        let count = self.handles.len();
        self.head.handle_count = count as u8;
        let size = (count * usize::from(self.block)).pow(2);
        let sound = |torn: &Torn| {
            let pieces = torn.stored.len().max(torn.released.len());
            torn.pieces.len() == count && torn.slope.len() == 6 * count && pieces <= MAX_HANDLES
        };
        let whole = count <= MAX_HANDLES
            && (self.block == 3 || self.block == 6)
            && self.stiffness.len() == size
            && self.damping.len() == size;
        (whole && self.tear.len() <= 1 && self.received.len() <= 1 && self.tear.iter().all(sound))
            .then_some(())
    }
}

record! { ModelHead: Self::empty();
    "# The linearized force of one body on all its handles. SI units; world axes; translation before rotation.";
    "# The tick that took it into use is the first whose body names its sequence number.";
    "uint64 sequence     # counts the models of this body, from one" sequence;
    "uint64 time_ns      # when the linearized state held" time_ns;
    "float64 period      # of publication" period;
    "float64 horizon     # how far ahead it is to be good for" horizon;
    "float64 energy      # that hands at rest could get back" energy;
    "float64 released    # of the body's own, which no hand has supplied" released;
    "uint32 epoch        # of the topology" epoch;
    handle_count: skip;
    // The entry of the tear has both.
    pieces: skip;
    tear_limit: skip;
    // It stands at the end.
    received: skip;
}

record! { HandleReference: Self::zero();
    "geometry_msgs/Pose pose" pose;
    "geometry_msgs/Twist twist" twist;
    "geometry_msgs/Wrench wrench  # on the hand" wrench;
    "uint8 device                 # index in a tick's devices" device;
    "geometry_msgs/Vector3 contact  # outward normal of what can push only; zero where held" contact;
    "geometry_msgs/Vector3 weight   # the part of the force that is weight" weight;
    "geometry_msgs/Wrench drift     # rate of the wrench beside what stiffness makes of the twist" drift;
    // The entry of the tear has both.
    piece: skip;
    tear_slope: skip;
}

record! { Torn: Self { limit: TearLimit::none(), pieces: vec![], stored: vec![], released: vec![], slope: vec![] };
    limit: flat;
    "uint8[] pieces      # number of the piece, by handle" pieces;
    "float64[] stored    # energy that hands at rest could get back, by piece" stored;
    "float64[] released  # energy of the piece's own since the parting, by piece" released;
    "float64[] slope     # of sqrt(G), by handle: translation (per m), then rotation (per rad)" slope;
}

record! { TearLimit: Self::none();
    "float64 root        # sqrt(G) of the nearest tip at the reference (sqrt(J/m2))" root;
    "float64 critical    # sqrt(G_c) (sqrt(J/m2)); zero without a tear limit" critical;
    "float64 area        # 1 / (q . K^-1 q) with the slopes q (m2)" area;
}
