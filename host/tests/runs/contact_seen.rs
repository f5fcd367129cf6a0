//! Contacts in the log and in the table of ticks: they are those of the host steps, and other scenes have none.

use host::log::Log;
use host::record::contact::MOST_POINTS;
use host::run::observer::Observers;
use host::run::replay::replay_watched;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, TickOutputs, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use physics::Vec3;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

fn scene(name: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    Ok(Scene::load(&folder.join(name))?)
}

/// The summary, the log and the table of a run.
fn seen(loaded: &LoadedScene, duration: f64) -> Result<(RunSummary, Log, String), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let [log, table] = ["run.mcap", "run.csv"].map(|name| folder.path().join(name));
    let options = RunOptions {
        duration: Some(duration),
        log: Some(log.clone()),
        ticks: TickOutputs {
            csv: Some(table.clone()),
            force_displacement: None,
        },
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(loaded)?, &options, &mut |_| ())?;
    assert_eq!(summary.failures, Vec::<String>::new());
    assert_eq!(summary.degradations, Vec::<String>::new());
    let log = Log::parse(&fs::read(log)?)?;
    Ok((summary, log, fs::read_to_string(table)?))
}

#[test]
fn log_and_table_have_the_contacts_of_the_summary() -> Outcome {
    let loaded = scene("scenes/sheet_on_sphere.toml")?;
    let (summary, log, table) = seen(&loaded, 0.4)?;
    let contact = summary.contact.ok_or("a scene with contact")?;
    let numbers: BTreeMap<&str, u32> = [("cloth", 0), ("ball", 1)].into();

    // One record of each step, in order.
    let steps: Vec<u64> = log.contacts.iter().map(|step| step.step).collect();
    assert_eq!(steps, (1..=steps.len() as u64).collect::<Vec<_>>());
    let last = log.contacts.last().ok_or("a step")?;
    assert!(!contact.pairs.is_empty());
    for pair in &contact.pairs {
        let sides = pair.between.each_ref().map(|name| numbers[&**name]);
        let sum = last.sum(sides);
        assert_eq!(sum.count as usize, pair.contacts);
        assert_eq!(sum.normal.to_bits(), pair.normal_force.to_bits());
        assert_eq!(sum.friction.to_bits(), pair.friction_force.to_bits());
        let touched = log.contacts.iter().filter(|step| step.sum(sides).count > 0);
        assert_eq!(touched.count() as u64, pair.steps);
        let depths = log.contacts.iter().map(|step| step.sum(sides).depth);
        assert_eq!(depths.fold(0.0, f64::max), pair.depth);
    }
    // The points of a step add up to its sums, if there are no more of them.
    let mut compared = 0;
    for step in &log.contacts {
        let count: u32 = step.sums.iter().map(|sum| sum.count).sum();
        assert_eq!(step.points.len(), MOST_POINTS.min(count as usize));
        let points = step.points.iter().filter(|point| point.sides == [0, 1]);
        let force: Vec3 = points.map(|point| point.force).sum();
        let sum = step.sum([0, 1]);
        if count as usize == step.points.len() && sum.count > 0 {
            assert!((force - sum.force).norm() < 1e-12 * sum.normal.max(1.0));
            compared += 1;
        }
    }
    assert!(compared > 10, "{compared}");

    // A row of the table has the newest step of which the log says that the tick follows it.
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| {
        names
            .iter()
            .position(|found| *found == name)
            .ok_or(name.to_owned())
    };
    let (normal, contacts) = (
        column("cloth_ball_normal_N")?,
        column("cloth_ball_contacts")?,
    );
    column("cloth_cloth_friction_N")?;
    column("cloth_cloth_depth_m")?;
    let mut newer = log.contacts.iter().peekable();
    let mut sum = last.sum([9, 9]);
    for (tick, line) in (0..).zip(lines) {
        while let Some(step) = newer.next_if(|step| step.tick <= tick) {
            sum = step.sum([0, 1]);
        }
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(
            cells[normal].parse::<f64>()?.to_bits(),
            sum.normal.to_bits()
        );
        assert_eq!(cells[contacts].parse::<u32>()?, sum.count);
    }

    // A replay makes the same table.
    let folder = tempfile::tempdir()?;
    let again = folder.path().join("again.csv");
    let outputs = TickOutputs {
        csv: Some(again.clone()),
        force_displacement: None,
    };
    let begin = || outputs.observe(&loaded.scene, Observers::new());
    let (report, observed) = replay_watched(&log, &loaded, &begin, &mut |_| ())?;
    assert!(report.is_exact() && observed.failures.is_empty());
    assert!(fs::read_to_string(again)? == table);
    Ok(())
}

/// A belt that is drawn over a cylinder slips everywhere, so the ratio of the pulls of the hands is that of Euler and
/// Eytelwein for half a turn.
#[test]
fn the_hands_feel_the_ratio_of_a_belt_over_a_cylinder() -> Outcome {
    let loaded = scene("scenes/belt.toml")?;
    let (summary, log, table) = seen(&loaded, 4.0)?;
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let pulls = ["left_force_z_N", "right_force_z_N"].map(|name| {
        let column = names.iter().position(|found| *found == name);
        // The hands rest from 3.5 s on.
        let rows = table.lines().skip(1 + 3700);
        let cells = rows.map(|row| row.split(',').nth(column?)?.parse::<f64>().ok());
        let values: Option<Vec<f64>> = cells.collect();
        let values = values?;
        Some(values.iter().sum::<f64>() / values.len() as f64)
    });
    let [Some(slack), Some(tight)] = pulls else {
        return Err("two columns of numbers".into());
    };
    assert!(slack > 0.3, "{slack} N: the belt is taut");
    // At rest the ratio is that of Euler at most, but for chords of 3.3 mm instead of an arc of 40 mm. The springs of friction take
    // a hundredth of it, because the belt settles back by a part of their stretch.
    let euler = (0.3 * std::f64::consts::PI).exp();
    let ratio = tight / slack;
    assert!((0.99..1.005).contains(&(ratio / euler)), "{ratio}, {euler}");
    // While the hands move, each contact slips.
    let moving = log
        .contacts
        .iter()
        .filter(|step| (2.6e9..3.3e9).contains(&(step.time_ns as f64)));
    for step in moving {
        let sum = step.sum([0, 1]);
        assert!(sum.friction > 0.29 * sum.normal && sum.friction < 0.3001 * sum.normal);
    }
    assert_eq!(summary.contact.ok_or("contact")?.pairs.len(), 1);
    Ok(())
}

/// The hand folds the note on itself while the note is whole, and tears it. Nothing crosses. Whether the tear runs through or its
/// jagged sides catch on each other first is chaos: of 12 notes that are stiffer or softer by up to 0.5 %, 10 tear through.
#[test]
fn a_folded_banknote_touches_itself_and_tears() -> Outcome {
    let loaded = scene("scenes/folded_banknote.toml")?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(4.5),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(&loaded)?, &options, &mut |_| ())?;
    assert_eq!(summary.failures, Vec::<String>::new());
    let contact = summary.contact.ok_or("a scene with contact")?;
    assert_eq!((contact.sums.squeezed, contact.sums.dropped), (0, 0));
    // A contact deeper than the thickness of the paper would have crossed it.
    assert!(
        contact.pairs[0].depth < 0.0003,
        "{}",
        contact.pairs[0].depth
    );
    let log = Log::parse(&fs::read(path)?)?;
    let torn = log.tears.first().ok_or("a tear")?.time_ns;
    let folded = log.contacts.iter().filter(|step| step.time_ns < torn);
    let touching = folded.filter(|step| step.sum([0, 0]).count > 0).count();
    assert!(touching > 200, "{touching} steps of 2 ms before the tear");
    let tears = summary.tears.first().ok_or("a sheet that tears")?;
    // It runs from the tip of the notch to the other border over 17 edges and more.
    assert!(tears.edges > 15, "{} edges", tears.edges);
    Ok(())
}

#[test]
fn a_scene_without_contact_has_no_channel_and_no_column() -> Outcome {
    let (_, log, table) = seen(&scene("scenes/press.toml")?, 0.1)?;
    assert!(log.contacts.is_empty());
    assert!(
        !table
            .lines()
            .next()
            .unwrap_or_default()
            .contains("contacts")
    );
    Ok(())
}

/// The shipped block on an incline below its angle of friction stays, as its scene says.
#[test]
fn the_block_on_the_incline_stays() -> Outcome {
    let loaded = scene("scenes/block_on_incline.toml")?;
    let (summary, ..) = seen(&loaded, 2.0)?;
    let contact = summary.contact.ok_or("a scene with contact")?;
    let pair = &contact.pairs[0];
    // What slides has the coefficient of friction of 0.5 as the ratio; what stays, the slope of 0.45.
    let ratio = pair.friction_force / pair.normal_force;
    assert!((ratio - 0.45).abs() < 0.02, "{ratio}");
    // Its weight works on the way that the block slips by while it settles.
    let slip = contact.sums.taken / pair.friction_force;
    assert!(slip < 0.012, "{slip}");
    Ok(())
}
