//! A unilateral wall inside the tick: how stiff it may be on each device before energy comes out of it.

/// The stiffness (N/m) up to which a sampled wall is passive at a hand that meets the device's own damping `b`
/// (N s/m): J. E. Colgate and G. Schenkel, "Passivity of a class of sampled-data systems" (1997), `b = K T / 2`.
pub fn plain_bound(damping: f64, period: f64) -> f64 {
    2.0 * damping / period
}
