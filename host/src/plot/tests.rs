use super::{
    DeviceSeries, Map, MapCell, MapLine, MapPanel, Mark, Marker, PlotData, Series,
    force_and_position_svg, line_chart_svg, map_svg,
};

/// Two hands that pull apart for `samples` ms, with noise.
fn stretch(samples: u32) -> PlotData {
    let time: Vec<f64> = (0..samples).map(|i| f64::from(i) * 1e-3).collect();
    let device = |name: &str, sign: f64| {
        let x: Vec<f64> = (0..samples)
            .map(|i| {
                sign * (f64::from(i) / f64::from(samples)
                    + 0.1 * f64::from(i % 1009 * 7919 % 1009) / 1e3)
            })
            .collect();
        DeviceSeries {
            name: name.to_owned(),
            force: x.iter().map(|x| [-3.0 * x, 0.1, 0.0]).collect(),
            position: x.iter().map(|x| [0.05 * x, 0.0, 0.1]).collect(),
        }
    };
    PlotData {
        title: "stretch <1> & more".to_owned(),
        subtitle: "seed 7".to_owned(),
        time,
        devices: vec![device("left hand", -1.0), device("right hand", 1.0)],
        marks: vec![Mark {
            from: 0.2,
            to: 0.4,
            label: "force limited".to_owned(),
        }],
    }
}

/// Asserts that a page is well-formed: every tag is closed and every number is finite.
fn check(svg: &str) {
    assert!(svg.starts_with("<svg width=\"") && svg.trim_end().ends_with("</svg>"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    let count = |tag: &str| svg.matches(tag).count();
    assert_eq!(count("<text"), count("</text>"));
    assert_eq!(count("<"), count(">"));
    assert!(!svg.chars().any(|c| c.is_control() && c != '\n'));
}

#[test]
fn a_run_shows_names_units_and_marks() {
    let svg = force_and_position_svg(&stretch(1000));
    check(&svg);
    assert!(svg.starts_with(
        "<svg width=\"960\" height=\"600\" stroke-linejoin=\"round\" viewBox=\"0 0 3840 2400\""
    ));
    for text in [
        "stretch &lt;1&gt; &amp; more",
        "seed 7",
        "left hand",
        "right hand",
        "Force along x (N)",
        "Displacement along x (mm)",
        "Time (s)",
        "force limited",
    ] {
        assert!(svg.contains(text), "{text}");
    }
}

#[test]
fn devices_in_several_directions_name_theirs() {
    let mut data = stretch(100);
    for force in &mut data.devices[1].force {
        *force = [0.0, 0.0, 2.0];
    }
    let svg = force_and_position_svg(&data);
    assert!(svg.contains("left hand, along x") && svg.contains("right hand, along z"));
}

#[test]
fn ten_minutes_of_four_devices_stay_small() {
    let mut data = stretch(600_000);
    data.devices.extend(data.devices.clone());
    for i in 0..20_000 {
        let from = f64::from(i) * 0.03;
        data.marks.push(Mark {
            from,
            to: from + 0.01,
            label: "force limited".to_owned(),
        });
    }
    let svg = force_and_position_svg(&data);
    check(&svg);
    assert!(svg.len() < 300_000, "{} bytes", svg.len());
}

#[test]
fn equal_data_gives_equal_bytes() {
    assert_eq!(
        force_and_position_svg(&stretch(500)),
        force_and_position_svg(&stretch(500))
    );
}

#[test]
fn any_data_gives_a_picture() {
    let nothing = PlotData::default();
    let mut constant = stretch(10);
    for device in &mut constant.devices {
        device.force.fill([0.0; 3]);
        device.position.fill([1.0; 3]);
    }
    let mut faulty = stretch(1000);
    let faults = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN_POSITIVE,
    ];
    for (i, fault) in faults.into_iter().enumerate() {
        faulty.time[7 * i] = fault;
        faulty.devices[0].force[11 * i][1] = fault;
        faulty.devices[1].position[13 * i][0] = fault;
        faulty.marks.push(Mark {
            from: fault,
            to: 1.0,
            label: "a".to_owned(),
        });
        faulty.marks.push(Mark {
            from: 0.5,
            to: fault,
            label: "b\u{1}".to_owned(),
        });
    }
    let mut all_faulty = stretch(100);
    all_faulty.time.fill(f64::NAN);
    let mut short = stretch(50);
    short.devices[0].force.truncate(3);
    short.devices[1].position.clear();
    let single = stretch(1);
    for data in [nothing, constant, faulty, all_faulty, short, single] {
        check(&force_and_position_svg(&data));
    }
}

#[test]
fn a_chart_shows_its_labels_and_counts_the_points_that_it_omits() {
    let series = [
        Series {
            name: "hold".to_owned(),
            points: vec![(10.0, 0.5), (100.0, 0.05), (1000.0, 0.0)],
            marker: Marker::Circle,
        },
        Series {
            name: "linear".to_owned(),
            points: vec![(10.0, 1e-3), (f64::NAN, 1.0), (100.0, 1e-5)],
            marker: Marker::Cross,
        },
    ];
    for (log_x, log_y) in [(true, true), (false, true), (true, false), (false, false)] {
        let svg = line_chart_svg("Error", "Rate (Hz)", "Error (N)", log_x, log_y, &series);
        check(&svg);
        for text in ["Error (N)", "Rate (Hz)", "hold", "linear (1 not drawn)"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.contains("hold (1 not drawn)"), log_y);
    }
    let svg = line_chart_svg("", "", "", true, true, &[]);
    check(&svg);
    assert!(svg.contains("no data"));
}

#[test]
fn a_map_shows_cells_lines_points_and_its_scale() {
    let cell = |x: f64, y: f64, value| MapCell {
        x: [x, x + 1.0],
        y: [y, 10.0 * y],
        value,
    };
    let panel = |title: &str| MapPanel {
        title: title.to_owned(),
        cells: vec![
            cell(0.0, 1.0, 0.0),
            cell(0.0, 10.0, 1e-3),
            cell(1.0, 1.0, f64::NAN),
        ],
        first: MapLine {
            line: vec![(0.0, 5.0), (2.0, 50.0)],
            points: vec![(1.0, 20.0), (9.0, 1.0)],
        },
        second: MapLine {
            line: vec![(0.0, 80.0), (2.0, 90.0)],
            points: vec![(1.0, 85.0)],
        },
    };
    let map = Map {
        title: "walls".to_owned(),
        x_label: "damping".to_owned(),
        y_label: "stiffness".to_owned(),
        scale_label: "energy (J)".to_owned(),
        below_label: "none".to_owned(),
        decades: [-6, 0],
        lines: ["exact".to_owned(), "stable".to_owned()],
        panels: vec![panel("falcon"), panel("touch"), panel("a"), panel("b")],
        ..Map::default()
    };
    let svg = map_svg(&map);
    check(&svg);
    for text in [
        "walls",
        "falcon",
        "touch",
        "exact",
        "stable",
        "energy (J)",
        "10⁻⁶",
        "none",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    // Each point has two circles. One point of each panel lies outside. The legend has a mark for each line.
    assert_eq!(svg.matches("<circle").count(), 2 * (4 * 2 + 2));
    let empty = map_svg(&Map::default());
    check(&empty);
    let nothing = map_svg(&Map {
        panels: vec![MapPanel::default()],
        ..Map::default()
    });
    check(&nothing);
    assert!(nothing.contains("no data"));
}
