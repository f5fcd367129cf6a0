//! The table of kinds of elements and laws.

use crate::speed::KernelRow;

pub(super) fn put(text: &mut String, rows: &[KernelRow]) {
    if rows.is_empty() {
        return;
    }
    put!(
        text,
        "\nEach kind of element and law, compressed or extended by a tenth in 0.5 s:\n"
    );
    put!(
        text,
        "| elements | law | number | assemble ns | linearize ns | product ns | assembled step ns | fast step ns | times as fast | assembled error | fast error |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|---|");
    for row in rows {
        put!(
            text,
            "| {} | {} | {} | {:.0} | {:.0} | {:.1} | {:.0} | {:.0} | {:.1} | {:.1e} | {:.1e} |",
            row.kind,
            row.law,
            row.elements,
            1e9 * row.assemble,
            1e9 * row.linearize,
            1e9 * row.product,
            1e9 * row.assembled_step,
            1e9 * row.fast_step,
            row.assembled_step / row.fast_step,
            row.assembled_error,
            row.fast_error,
        );
    }
    put!(
        text,
        "\nMedians of processor time per element. Linearize and product: those of the fast step, with bending. Steps: \
         solved to 1e-6. Errors: the largest error of the force over the motion, against implicit Euler by Newton's \
         method, relative to the largest force."
    );
}
