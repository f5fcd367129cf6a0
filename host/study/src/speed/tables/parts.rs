//! The tables of the distribution of the fast step's time over its parts.

use crate::speed::{Parts, Timed};

pub(super) fn put(text: &mut String, found: &Parts) {
    if found.timed.is_empty() {
        return;
    }
    put!(text, "\nDistribution of the time of the fast step:\n");
    put!(
        text,
        "| body | elements | step | part | median us | per step | fraction of step | kB | Mflop | GB/s | machine GB/s | fraction of bandwidth | Gflop/s | machine Gflop/s | fraction of peak |"
    );
    put!(
        text,
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for part in &found.timed {
        put!(
            text,
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
            100.0 * part.fraction_of_bandwidth,
            1e-9 * part.flops_per_second,
            1e-9 * part.peak,
            100.0 * part.fraction_of_peak,
        );
    }
    put!(
        text,
        "\nMedians of processor time. Each part is repeated in the present state of the body. Per step: mean number of \
         executions in a step. Bytes: every array counts once for each pass that reads or writes the array. Machine: one \
         thread that repeatedly reads a block as large as the memory of the part, and one that multiplies and adds in \
         registers without fused operations. The factorization belongs to a library and uses fused operations: its \
         fraction of the peak may exceed that of the other parts."
    );
    put!(text, "\nMemory of the fast step:\n");
    put!(
        text,
        "| body | elements | step | stepper kB | of which refresher kB | bytes per element | body kB | bytes per element |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|");
    for memory in &found.memory {
        put!(
            text,
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

/// The median time of the step to which `part` belongs (s).
fn step(found: &Parts, part: &Timed) -> f64 {
    let whole = found.timed.iter().find(|other| {
        other.part == "step" && other.body == part.body && other.precision == part.precision
    });
    whole.map_or(f64::NAN, |whole| whole.median)
}
