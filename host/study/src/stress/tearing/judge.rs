//! Judges a run of a random tear: the rules that it must keep.

use host::engine::Engine;
use host::engine::body::HostBody;
use host::run::ended::Ended;
use physics::TearReport;
use physics::tear::Sheet;
use physics::tear::strength::{Symmetric, cannot_start, highest, stresses};
use physics::topology::Edit;
use rt_core::{LocalModel, Telemetry};
use runner::TickLoop;
use runner::link::LogRecord;
use sim::NetEnergy;

/// The largest net energy of the hands (J).
pub const NET_ENERGY: f64 = 1e-3;

/// The account of the hands of one piece, since the sheet parted for the hands: since the first tick that renders a model
/// with this piece. Before, the hands are joined by a sheet that is whole for them, and one hand may do work on another.
struct Piece {
    hands: Vec<usize>,
    /// Work on each hand when the sheet parted (J).
    before: Vec<f64>,
    net: NetEnergy,
}

/// The pieces of a published model: the hands of each, and the energy that it stores by the model (J).
struct ModelPieces {
    sequence: u64,
    pieces: Vec<(Vec<usize>, f64)>,
}

impl ModelPieces {
    fn of(model: &LocalModel) -> Self {
        let energies = model
            .head
            .pieces
            .iter()
            .take(usize::from(model.piece_count()));
        let mut pieces: Vec<_> = energies
            .map(|energy| (Vec::new(), energy.stored.max(0.0)))
            .collect();
        for handle in model.handles() {
            let (hands, _) = &mut pieces[usize::from(handle.piece)];
            hands.push(usize::from(handle.device));
        }
        Self {
            sequence: model.head.sequence,
            pieces,
        }
    }
}

/// Follows a run.
pub(super) struct Judge {
    /// A checksum over all ticks (FNV-1a).
    checksum: u64,
    /// All edits.
    pub(super) journal: Vec<Edit>,
    /// The report of the tears.
    pub(super) report: TearReport,
    /// Number of pieces at the end.
    pub(super) pieces: usize,
    /// The largest force (N).
    pub(super) peak: f64,
    whole: NetEnergy,
    parts: Vec<Piece>,
    /// Work on each hand so far (J).
    works: Vec<f64>,
    /// Mass of each device (kg), and the kinetic energy of this mass (J).
    masses: Vec<f64>,
    moving: Vec<f64>,
    /// The models in which the sheet has parted and that no tick has used yet.
    coming: Vec<ModelPieces>,
    stress: Vec<Symmetric>,
    /// The first tick in which a value was not finite.
    infinite: Option<u64>,
    /// The first tick in which a skipped test would have found a start.
    missed: Option<u64>,
    faults: u64,
    first_fault: Option<String>,
    panicked: Option<String>,
}

impl Judge {
    /// For devices of these moving masses (kg).
    pub(super) fn new(engine: &Engine, masses: Vec<f64>) -> Self {
        let bodies = engine.bodies().iter();
        let stored = bodies.map(|body| body.body().total_energy()).sum();
        let surfaces = engine
            .bodies()
            .iter()
            .filter_map(|body| body.body().surface());
        let triangles = surfaces.map(|surface| surface.limits().triangles).max();
        Self {
            checksum: 0xcbf2_9ce4_8422_2325,
            journal: Vec::new(),
            report: TearReport::default(),
            pieces: 1,
            peak: 0.0,
            whole: NetEnergy::new(stored),
            parts: Vec::new(),
            works: Vec::new(),
            moving: vec![0.0; masses.len()],
            masses,
            coming: Vec::new(),
            stress: vec![[0.0; 3]; triangles.unwrap_or(0)],
            infinite: None,
            missed: None,
            faults: 0,
            first_fault: None,
            panicked: None,
        }
    }

    /// Takes a tick.
    pub(super) fn see(&mut self, tick: &TickLoop, telemetry: &Telemetry, engine: Option<&Engine>) {
        let mut finite = true;
        self.works.clear();
        for (device, shown) in tick.devices.iter().zip(&telemetry.devices) {
            let force = shown.wrench.force;
            let place = shown.pose.position;
            for value in force.iter().chain(place.iter()) {
                finite &= value.is_finite();
                for byte in value.to_bits().to_le_bytes() {
                    self.checksum = (self.checksum ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
                }
            }
            self.peak = self.peak.max(force.norm());
            self.works
                .push(device.probe().map_or(f64::NAN, |probe| probe.on_hand));
        }
        let devices = tick.devices.iter().zip(&self.masses);
        for (moving, (device, mass)) in self.moving.iter_mut().zip(devices) {
            let speed = device
                .probe()
                .map_or(0.0, |probe| probe.twist.linear.norm());
            *moving = 0.5 * mass * speed * speed;
        }
        self.whole.observe(self.works.iter().copied());
        let body = engine.and_then(|engine| engine.bodies().first());
        if let Some(body) = body {
            let positions = body.body().node_positions();
            finite &= positions.iter().flatten().all(|x| x.is_finite());
            if self.misses(body) {
                self.missed = self.missed.or(Some(telemetry.tick));
            }
            if let Some(tears) = body.tears() {
                self.pieces = tears.pieces().count();
            }
        }
        if !finite {
            self.infinite = self.infinite.or(Some(telemetry.tick));
        }
    }

    /// Whether the energy density rules out a start although a free vertex reaches the strength.
    fn misses(&mut self, body: &HostBody) -> bool {
        let Some((tears, surface)) = body.tears().zip(body.body().surface()) else {
            return false;
        };
        let (body, material) = (body.body(), tears.tearing().options().material);
        let sheet = Sheet::from(surface);
        let density = stresses(&sheet, body.node_positions(), &material, &mut self.stress);
        let is_free = |vertex: u32| !body.is_held(vertex);
        cannot_start(density, &material)
            && highest(&sheet, &self.stress, material.strength, is_free).is_some()
    }

    /// Takes what the log gets: models before the ticks that use them, ticks after [`see`](Self::see).
    pub(super) fn log(&mut self, record: LogRecord<'_>) {
        match record {
            LogRecord::Model(_, model) if model.piece_count() > 1 => {
                self.coming.push(ModelPieces::of(model));
            }
            LogRecord::Model(..) | LogRecord::Patch(..) => {}
            LogRecord::Tick(telemetry) => self.account(telemetry),
        }
    }

    /// Follows the accounts of the pieces in a tick, and begins them when the sheet parts.
    fn account(&mut self, telemetry: &Telemetry) {
        let (works, moving) = (&self.works, &self.moving);
        for part in &mut self.parts {
            let hands = part.hands.iter().zip(&part.before);
            part.net
                .observe(hands.map(|(hand, before)| works[*hand] - before));
        }
        let [body, ..] = &telemetry.bodies;
        let used = self
            .coming
            .iter()
            .rposition(|m| m.sequence == body.sequence);
        let Some(used) = used else {
            return;
        };
        let parts = self.coming.drain(..=used).next_back();
        let Some(parts) = parts.filter(|parts| parts.pieces.len() != self.parts.len()) else {
            return;
        };
        // The rendered sheet stores no more than the hands have supplied.
        let stored = body.energy.stored.min(-self.whole.now()).max(0.0);
        let whole: f64 = parts.pieces.iter().map(|(_, stored)| stored).sum();
        let count = parts.pieces.len() as f64;
        self.parts = (parts.pieces.into_iter())
            .map(|(hands, own)| {
                let share = if whole > 0.0 {
                    own / whole
                } else {
                    1.0 / count
                };
                // The work on a hand contains what the moving mass of its device gives it.
                let moving: f64 = hands.iter().map(|hand| moving[*hand]).sum();
                Piece {
                    before: hands.iter().map(|hand| works[*hand]).collect(),
                    net: NetEnergy::new(stored * share + moving),
                    hands,
                }
            })
            .collect();
    }

    /// Ends the run.
    pub(super) fn end(&mut self, running: &Ended) {
        let engine = &running.host.engine;
        let stats = engine.stats();
        (self.faults, self.first_fault) = (stats.faults, stats.first_fault.clone());
        self.panicked.clone_from(&running.panicked);
        if let Some(tears) = engine.bodies().first().and_then(HostBody::tears) {
            self.report = *tears.tearing().report();
            self.journal = tears.tearing().journal().to_vec();
        }
    }

    /// The checksum over all ticks.
    pub(super) fn bytes(&self) -> u64 {
        self.checksum
    }

    /// The largest net energy of the hands of the whole sheet and of its pieces (J).
    pub(super) fn net_energy(&self) -> f64 {
        let parts = self.parts.iter().map(|part| part.net.largest());
        parts.fold(self.whole.largest(), f64::max)
    }

    /// The rules that the run broke.
    pub(super) fn failures(&self) -> Vec<String> {
        let mut found = Vec::new();
        if let Some(tick) = self.infinite {
            found.push(format!("a value is not finite in tick {tick}"));
        }
        if let Some(tick) = self.missed {
            found.push(format!(
                "a stress test that was skipped in tick {tick} would have found a start"
            ));
        }
        let net = self.net_energy();
        if net.is_nan() || net > NET_ENERGY {
            found.push(format!("the hands got {:.2} mJ of net energy", 1e3 * net));
        }
        if self.faults > 0 {
            let first = self.first_fault.as_deref().unwrap_or_default();
            found.push(format!(
                "{} faults of the host; the first: {first}",
                self.faults
            ));
        }
        if let Some(panic) = &self.panicked {
            found.push(format!("the host panicked: {panic}"));
        }
        found
    }
}
