//! The tables of where the time of the fast step goes.

use study::speed::{Parts, Timed};

pub(super) fn print(found: &Parts) {
    if found.timed.is_empty() {
        return;
    }
    println!("\nWhere the time of the fast step goes:\n");
    println!(
        "| body | elements | step | part | median us | a step | share of step | kB | Mflop | GB/s | machine GB/s | share of bandwidth | Gflop/s | machine Gflop/s | share of peak |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for part in &found.timed {
        println!(
            "| {} | {} | {} | {} | {:.1} | {:.1} | {:.0} % | {:.0} | {:.3} | {:.1} | {:.1} | {:.0} % | {:.1} | {:.1} | {:.0} % |",
            part.body,
            part.elements,
            part.precision,
            part.part,
            1e6 * part.median,
            part.per_step,
            100.0 * part.per_step * part.median / step(found, part),
            1e-3 * part.bytes as f64,
            1e-6 * part.flops as f64,
            1e-9 * part.bytes_per_second,
            1e-9 * part.bandwidth,
            100.0 * part.share_of_bandwidth,
            1e-9 * part.flops_per_second,
            1e-9 * part.peak,
            100.0 * part.share_of_peak,
        );
    }
    println!(
        "\nMedians of processor time, each part repeated where the body is. A step: how often one does it, on average. \
         Bytes: every array once for each pass that reads or writes it. Machine: one thread reading a block as large as \
         the memory that the part touches, again and again, and multiplying and adding in registers without fusing the \
         two. The factorization, a library's, fuses them: its share may exceed what others can reach."
    );
    println!("\nMemory of the fast step:\n");
    println!(
        "| body | elements | step | stepper kB | of that, to refresh | bytes an element | body kB | bytes an element |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for memory in &found.memory {
        println!(
            "| {} | {} | {} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} |",
            memory.body,
            memory.elements,
            memory.precision,
            1e-3 * memory.stepper_bytes as f64,
            1e-3 * memory.refresher_bytes as f64,
            memory.stepper_per_element,
            1e-3 * memory.body_bytes as f64,
            memory.body_per_element,
        );
    }
}

/// The median of the step of which `part` is one (s).
fn step(found: &Parts, part: &Timed) -> f64 {
    let whole = found.timed.iter().find(|other| {
        other.part == "step" && other.body == part.body && other.precision == part.precision
    });
    whole.map_or(f64::NAN, |whole| whole.median)
}
