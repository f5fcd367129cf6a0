//! The tables of the study.

use super::{DAMPING, Motion, RATES, VelocityStudy};
use crate::Results;

impl Results for VelocityStudy {
    fn tables(&self) -> String {
        let mut text = String::new();
        put_means(&mut text, self);
        put_devices(&mut text, self);
        text
    }
}

fn put_means(text: &mut String, found: &VelocityStudy) {
    put!(
        text,
        "RMS error of the velocity (mm/s), chatter under {DAMPING} N s/m in a slow press (N), largest damping that \
         stops the bare device (N s/m);\ngeometric means over all devices at {} Hz\n",
        RATES.map(|rate| rate.to_string()).join(" and ")
    );
    put!(
        text,
        "| method | longest delay ms | press | rub | hand | tap | hold | all | chatter | stable |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|");
    for mean in &found.means {
        put_part!(text, "| {} | {:.1} ", mean.method, 1e3 * mean.delay);
        for rms in mean.rms.iter().chain([&mean.all]) {
            put_part!(text, "| {:.1} ", 1e3 * rms);
        }
        put!(text, "| {:.3} | {:.1} |", mean.chatter, mean.stable);
    }
}

fn put_devices(text: &mut String, found: &VelocityStudy) {
    put!(
        text,
        "\nBy device: error and lag in the motion of a hand, error in a hold\n"
    );
    put!(
        text,
        "| device | Hz | method | hand mm/s | lag ms | hold mm/s | chatter | stable |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|");
    for row in &found.rows {
        let of = |motion| row.errors.iter().find(|e| e.motion == motion);
        let (Some(hand), Some(hold)) = (of(Motion::Hand), of(Motion::Hold)) else {
            continue;
        };
        put!(
            text,
            "| {} | {} | {} | {:.1} | {:.2} | {:.1} | {:.3} | {:.1} |",
            row.device,
            row.rate,
            row.method,
            1e3 * hand.rms,
            1e3 * hand.lag,
            1e3 * hold.rms,
            row.chatter,
            row.stable
        );
    }
}
