//! The study: how many trials, of which scene, under which schemes.

use super::draw::{Choice, Trouble};
use super::summary::{Band, row};
use super::verdict::Verdict as OfScheme;
use super::{CellResult, SCHEMES, Study, picture, table};
use crate::StudyError;
use crate::stress::study::quantities;
use crate::stress::{self, Done, Quantity, Verdict};
use host::plot::Picture;
use host::scene::LoadedScene;
use host::scene::spec::SchemeName;
use std::collections::BTreeMap;

/// The request of a person.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The scene; every trial draws a body of its own without one.
    pub loaded: Option<LoadedScene>,
    /// The seed of every random choice.
    pub seed: u64,
    /// Number of trials.
    pub trials: u64,
    /// The schemes; all if there are none.
    pub schemes: Vec<SchemeName>,
    /// The publication rates (Hz); those of [`Choice::default`] if there are none.
    pub rates: Vec<f64>,
    /// The kinds of fault; each kind if there are none.
    pub troubles: Vec<Trouble>,
}

/// The study of many trials.
pub struct Trials {
    /// The trials.
    pub study: Study,
    seed: u64,
    cells: u64,
    settings: serde_json::Value,
    schemes: Vec<(SchemeName, &'static str)>,
    /// The scheme of the scene.
    own: SchemeName,
    name: String,
}

impl Trials {
    /// The study that is asked for.
    ///
    /// # Errors
    /// As [`Study::new`].
    pub fn new(asked: Asked) -> Result<Self, StudyError> {
        let chosen = |name: &SchemeName| asked.schemes.is_empty() || asked.schemes.contains(name);
        let schemes = SCHEMES.into_iter().filter(|(name, _)| chosen(name));
        let schemes: Vec<_> = schemes.collect();
        let settings = settings(&asked, &schemes);
        let mut choice = Choice::default();
        if !asked.rates.is_empty() {
            choice.rates = asked.rates;
        }
        if !asked.troubles.is_empty() {
            choice.troubles = asked.troubles;
        }
        let scene = asked.loaded.as_ref().map(|loaded| &loaded.scene);
        let own = scene.map_or(SchemeName::Capped, |scene| scene.realtime.scheme);
        let name = scene.map_or("drawn bodies", |scene| &scene.name).to_owned();
        let study = match asked.loaded {
            Some(loaded) => Study::among(loaded, asked.seed, choice)?,
            None => Study::drawn(asked.seed, choice),
        };
        Ok(Self {
            study,
            seed: asked.seed,
            cells: asked.trials,
            settings,
            schemes,
            own,
            name,
        })
    }
}

/// Everything but seed and number that determines a cell. A file of a study without chosen rates and troubles has no
/// such settings.
fn settings(asked: &Asked, schemes: &[(SchemeName, &str)]) -> serde_json::Value {
    let mut settings = serde_json::json!({
        "schemes": schemes.iter().map(|(_, name)| name).collect::<Vec<_>>(),
    });
    if let Some(loaded) = &asked.loaded {
        let files = loaded.files.iter().map(|(name, bytes)| (name, bytes.len()));
        settings["scene"] = loaded.source.text.clone().into();
        settings["files"] = serde_json::json!(files.collect::<Vec<_>>());
    }
    if !asked.rates.is_empty() {
        settings["rates"] = serde_json::json!(asked.rates);
    }
    if !asked.troubles.is_empty() {
        settings["troubles"] = serde_json::json!(asked.troubles);
    }
    settings
}

impl stress::Study for Trials {
    type Outcome = CellResult;
    const NAME: &'static str = "scene";
    const SCHEMA: u32 = 4;
    const COMPARED: bool = true;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    fn settings(&self) -> serde_json::Value {
        self.settings.clone()
    }

    fn cell(&self, cell: u64, done: &Done<'_>) -> CellResult {
        self.study.cell_told(cell, &self.schemes, done)
    }

    fn announcement(&self) -> Option<String> {
        (self.cells > 1).then(|| {
            format!(
                "{} trials, each with a reference and {} schemes; fewer --runs or --schemes, or a lower --rate, take less \
                 time",
                self.cells,
                self.schemes.len()
            )
        })
    }

    fn summary(&self, cells: &BTreeMap<u64, CellResult>) -> String {
        let mut text = String::new();
        // The scheme of the scene is judged, or each scheme that was run in its place.
        let own = self
            .schemes
            .iter()
            .filter(|(scheme, _)| *scheme == self.own);
        let judged = match own.clone().count() {
            0 => self.schemes.clone(),
            _ => own.copied().collect(),
        };
        for (_, scheme) in judged {
            if let Some(verdict) = OfScheme::of(cells.iter(), scheme) {
                put!(text, "{verdict}");
            }
        }
        put!(
            text,
            "{}: {} trials, seed {}\n",
            self.name,
            cells.len(),
            self.seed
        );
        if self.study.tears() {
            put!(
                text,
                "a body tears, and a body that tears does not soften: trials of the trouble \"softening\" have no fault, \
                 and those of \"all\" have the others\n"
            );
        }
        table::write(&mut text, cells);
        text
    }

    fn verdict(&self, cells: &BTreeMap<u64, CellResult>) -> Verdict {
        let mut failed = cells
            .iter()
            .filter_map(|(number, cell)| Some((number, cell.failed.as_ref()?)));
        let first = failed.next();
        Verdict {
            incomplete: first.is_some(),
            lines: (first.iter())
                .map(|(number, why)| format!("cell {number}: {why}"))
                .collect(),
            ..Verdict::default()
        }
    }

    fn draw(&self, cells: &BTreeMap<u64, CellResult>) -> Option<Picture> {
        Some(picture::distributions(&self.name, cells))
    }

    fn quantities(cells: &BTreeMap<u64, CellResult>) -> Vec<Quantity> {
        quantities_of(cells)
    }
}

fn quantities_of(cells: &BTreeMap<u64, CellResult>) -> Vec<Quantity> {
    let all = Band::of(0.0, f64::INFINITY);
    let rows = SCHEMES.iter();
    let rows = rows.filter_map(|(_, scheme)| row(cells.iter(), scheme, all));
    rows.flat_map(|row| {
        quantities(
            &row.scheme,
            [
                ("bounded (%)", 100.0 * row.bounded),
                ("net energy, 99 % (mJ)", 1e3 * row.net_energy[0]),
                ("net energy, most (mJ)", 1e3 * row.net_energy[1]),
                ("ripple, most (N)", row.ripple[1]),
                ("force error, median (%)", 100.0 * row.error[0]),
                ("force error, 90 % (%)", 100.0 * row.error[1]),
                ("stiffness error, 90 % (%)", 100.0 * row.stiffness[1]),
                ("run error, median (%)", 100.0 * row.run_error[0]),
                ("run error, 90 % (%)", 100.0 * row.run_error[1]),
                ("capped, most (%)", 100.0 * row.capped[1]),
            ],
        )
    })
    .collect()
}
