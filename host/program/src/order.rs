//! An order of the operator as `--order` names it: `arm@0.5`, `stop@2`, `take@1`.

use devices::panel::{Order, TimedOrder};

/// The order that `text` names.
///
/// # Errors
/// The text that was found, and the allowed texts.
pub(super) fn order(text: &str) -> Result<TimedOrder, String> {
    parse(text).ok_or_else(|| {
        format!("found \"{text}\", allowed: arm@TIME, stop@TIME or take@TIME, in seconds, such as arm@0.5")
    })
}

fn parse(text: &str) -> Option<TimedOrder> {
    let (name, at) = text.split_once('@')?;
    let order = Order::ALL.into_iter().find(|order| order.name() == name)?;
    let at = at.parse::<f64>().ok();
    let at = at.filter(|at| at.is_finite() && *at >= 0.0)?;
    Some(TimedOrder { order, at })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_read_as_the_help_says() {
        let of = |order, at| Ok(TimedOrder { order, at });
        assert_eq!(order("arm@0.5"), of(Order::Arm, 0.5));
        assert_eq!(order("stop@2"), of(Order::Stop, 2.0));
        assert_eq!(order("take@1e-1"), of(Order::Take, 0.1));
        for wrong in ["", "arm", "arm@", "arm@-1", "arm@nan", "halt@1", "stop@1+1"] {
            let error = order(wrong).expect_err(wrong);
            assert!(error.starts_with(&format!("found \"{wrong}\"")), "{error}");
        }
    }
}
