//! A sheet that tears, with its stepper: what every run of the study steps in virtual time.

use crate::StudyError;
use host::engine::tears::MOST_PAIRS;
use physics::motion::stepper::Ledger;
use physics::tear::TearMaterial;
use physics::topology::Reserve;
use physics::{
    Body, HandlePose, Starts, Stepper, StepperOptions, StepperReport, TearOptions, TearReport,
    Tearing,
};

/// Length of a step (s).
pub(super) const STEP: f64 = 1e-3;

/// A sheet that tears, with its stepper.
#[derive(Debug)]
pub(super) struct Rig {
    pub(super) body: Body,
    pub(super) stepper: Stepper<f64>,
    pub(super) tearing: Tearing,
    /// The account of all steps.
    pub(super) ledger: Ledger,
    /// Length of a step (s).
    step: f64,
    /// Kinetic and elastic energy and energy of the weight at the start (J).
    begin: f64,
}

impl Rig {
    /// A sheet whose tears begin at `tips`, with steps of a millisecond.
    pub(super) fn new(
        body: Body,
        material: TearMaterial,
        snapping: f64,
        tips: &[u32],
    ) -> Result<Self, StudyError> {
        let options = TearOptions {
            material,
            starts: Starts::Tips,
            snapping,
            skips: true,
        };
        Self::with(body, options, tips, STEP)
    }

    /// A sheet whose tears begin at `tips`, with steps of `step` (s).
    pub(super) fn with(
        mut body: Body,
        options: TearOptions,
        tips: &[u32],
        step: f64,
    ) -> Result<Self, StudyError> {
        let room = body.vertex_count().max(400);
        body.make_tearable(Reserve {
            vertices: room,
            triangles: 2 * room,
        })?;
        let tearing = Tearing::new(&body, options, tips)?;
        let options = StepperOptions {
            tolerance: 1e-8,
            ..StepperOptions::default()
        };
        let mut stepper = Stepper::new(&body, options)?;
        stepper.reserve_pairs(MOST_PAIRS);
        stepper.keep_ledger(true);
        stepper.prepare(&body, step)?;
        let mut rig = Self {
            body,
            stepper,
            tearing,
            ledger: Ledger::default(),
            step,
            begin: 0.0,
        };
        rig.begin = rig.stored();
        Ok(rig)
    }

    /// Makes a step with the handles at `targets` at its end.
    pub(super) fn step(&mut self, targets: &[HandlePose]) -> Result<StepperReport, StudyError> {
        renew(&mut self.body, &mut self.stepper, self.step)?;
        let report = self
            .stepper
            .step(&mut self.body, self.step, targets, || false)?;
        if let Some(ledger) = self.stepper.ledger() {
            self.ledger += *ledger;
        }
        Ok(report)
    }

    /// Lets the tears grow.
    pub(super) fn tear(&mut self) -> TearReport {
        *self.tearing.advance(&mut self.body, &mut self.stepper)
    }

    /// Kinetic and elastic energy and energy of the weight, from the start (J).
    pub(super) fn stored(&self) -> f64 {
        let elastic = self.stepper.elastic_energy();
        self.body.kinetic_energy() + elastic + self.body.load_potential() - self.begin
    }

    /// The force of the sheet on a hand (N).
    pub(super) fn force(&self, hand: usize) -> physics::Vec3 {
        let report = self.body.handle_report(hand);
        report.map_or(physics::Vec3::zeros(), |report| report.wrench_on_hand.force)
    }
}

/// Makes a factor of the present topology for the `stepper` of a torn `body`, if this would pay. Steps take `h` seconds.
pub(crate) fn renew(body: &mut Body, stepper: &mut Stepper<f64>, h: f64) -> Result<(), StudyError> {
    if stepper.wants_factor() {
        let mut mirror = body.clone();
        mirror.reassemble();
        let mut fresh = Stepper::new(&mirror, stepper.options)?;
        fresh.prepare(&mirror, h)?;
        fresh.adopt(stepper, body)?;
        *stepper = fresh;
    }
    Ok(())
}
