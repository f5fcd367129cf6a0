//! A link with latency: a model reaches the tick when its time of arrival has come, and no earlier.

use host::run::late::LateLink;
use rt_core::LocalModel;
use runner::link::{LinkConfig, TickEnd, link};

fn model(sequence: u64) -> LocalModel {
    let mut model = LocalModel::empty();
    model.head.sequence = sequence;
    model
}

/// The models that the tick takes: for each body with a new model, the body and the newest number.
fn taken(tick: &mut TickEnd) -> Vec<(usize, u64)> {
    let mut found = Vec::new();
    tick.take_models(|body, model| found.push((body, model.head.sequence)));
    found
}

#[test]
fn a_model_arrives_at_its_time_and_once() {
    let (mut tick, host, _log) = link(&LinkConfig::new(1000.0, 100.0));
    let mut late = LateLink::new(host, 4);
    late.send(3_000_000, 0, &model(1));
    let mut seen = Vec::new();
    for now_ns in [0, 2_999_999] {
        late.deliver(now_ns, |body, model| seen.push((body, model.head.sequence)));
        assert_eq!((seen.len(), taken(&mut tick)), (0, vec![]), "{now_ns}");
    }
    for (now_ns, expected) in [(3_000_000, vec![(0, 1)]), (4_000_000, vec![])] {
        late.deliver(now_ns, |body, model| seen.push((body, model.head.sequence)));
        assert_eq!(taken(&mut tick), expected, "{now_ns}");
    }
    assert_eq!(seen, [(0, 1)]);
}

#[test]
fn models_arrive_by_body_in_the_order_of_sending() {
    let config = LinkConfig {
        bodies: 2,
        ..LinkConfig::new(1000.0, 100.0)
    };
    let (mut tick, host, _log) = link(&config);
    let mut late = LateLink::new(host, 4);
    // The second model of the first body takes longer than the third.
    for (arrival_ns, body, sequence) in [(10, 0, 1), (40, 0, 2), (20, 1, 1), (30, 0, 3)] {
        late.send(arrival_ns, body, &model(sequence));
    }
    let mut seen = Vec::new();
    let mut at = |now_ns, tick: &mut TickEnd| {
        late.deliver(now_ns, |body, model| {
            seen.push((now_ns, body, model.head.sequence));
        });
        taken(tick)
    };
    assert_eq!(at(30, &mut tick), [(0, 3), (1, 1)]);
    assert_eq!(at(40, &mut tick), [(0, 2)]);
    assert_eq!(seen, [(30, 0, 1), (30, 1, 1), (30, 0, 3), (40, 0, 2)]);
}
