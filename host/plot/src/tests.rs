use super::{
    Cause, Component, DeviceSeries, Map, MapCell, MapLine, MapPanel, Mark, Marker, Panel, Picture,
    PlotData, Role, Scale, Series, collisions, force_and_position, line_chart, map, panels,
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
            cause: Cause::Limited,
            of: String::new(),
        }],
        ..PlotData::default()
    }
}

/// Asserts that a page is well-formed: every tag is closed and every number is finite.
fn check(picture: &Picture) -> String {
    let svg = picture.svg();
    assert!(svg.starts_with("<svg width=\"") && svg.trim_end().ends_with("</svg>"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    let count = |tag: &str| svg.matches(tag).count();
    assert_eq!(count("<text"), count("</text>"));
    assert_eq!(count("<"), count(">"));
    assert!(!svg.chars().any(|c| c.is_control() && c != '\n'));
    assert_eq!(collisions(picture), [""; 0]);
    svg
}

#[test]
fn a_run_is_drawn_along_the_axis_that_is_asked_for_or_by_its_norm() {
    // Pull along x, and a tenth of a newton along y.
    let drawn = |component| {
        check(&force_and_position(&PlotData {
            component,
            ..stretch(1000)
        }))
    };
    let along = drawn(Component::Axis(1));
    assert!(along.contains("Force along y (N)"), "{along}");
    assert!(along.contains("Displacement along y (mm)"), "{along}");
    assert_ne!(along, drawn(Component::Axis(0)));
    assert_eq!(drawn(Component::Axis(0)), drawn(Component::Principal));
    let norm = drawn(Component::Norm);
    assert!(norm.contains("Force, norm (N)"), "{norm}");
    let component = |component: Component| component.of(&nalgebra::Vector3::new(3.0, 0.0, -4.0));
    assert_eq!(
        (component(Component::Axis(2)), component(Component::Norm)),
        (-4.0, 5.0)
    );
}

#[test]
fn a_run_shows_names_units_and_marks() {
    let svg = check(&force_and_position(&stretch(1000)));
    assert!(svg.starts_with(
        "<svg width=\"800\" height=\"560\" stroke-linejoin=\"round\" viewBox=\"0 0 3200 2240\""
    ));
    for text in [
        "stretch &lt;1&gt; &amp; more",
        "seed 7",
        "left hand",
        "right hand",
        "Force along x (N)",
        "Displacement along x (mm)",
        "Time (s)",
        "force or slew limited",
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
    let svg = force_and_position(&data).svg();
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
            cause: Cause::Limited,
            of: String::new(),
        });
    }
    let svg = check(&force_and_position(&data));
    // Two points in each of 718 columns of two panels, for four devices, and about 30 bytes a point; the lines of three
    // devices are dashed, and each dash repeats its style.
    assert!(svg.len() < 1_000_000, "{} bytes", svg.len());
}

#[test]
fn equal_data_gives_equal_bytes() {
    assert_eq!(
        force_and_position(&stretch(500)).svg(),
        force_and_position(&stretch(500)).svg()
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
            cause: Cause::Fading,
            of: "a".to_owned(),
        });
        faulty.marks.push(Mark {
            from: 0.5,
            to: fault,
            cause: Cause::Held,
            of: "b\u{1}".to_owned(),
        });
    }
    let mut all_faulty = stretch(100);
    all_faulty.time.fill(f64::NAN);
    let mut short = stretch(50);
    short.devices[0].force.truncate(3);
    short.devices[1].position.clear();
    let single = stretch(1);
    for data in [nothing, constant, faulty, all_faulty, short, single] {
        check(&force_and_position(&data));
    }
}

#[test]
fn a_chart_shows_its_labels_and_counts_the_points_that_it_omits() {
    let series = [
        Series {
            name: "hold".to_owned(),
            points: vec![(10.0, 0.5), (100.0, 0.05), (1000.0, 0.0)],
            marker: Marker::Circle,
            ..Series::default()
        },
        Series {
            name: "linear".to_owned(),
            points: vec![(10.0, 1e-3), (f64::NAN, 1.0), (100.0, 1e-5)],
            marker: Marker::Cross,
            ..Series::default()
        },
    ];
    for (log_x, log_y) in [(true, true), (false, true), (true, false), (false, false)] {
        // Labels of axes begin with capitals, whoever wrote them.
        let svg = check(&line_chart(
            "Error",
            "rate (Hz)",
            "error (N)",
            log_x,
            log_y,
            &series,
        ));
        for text in ["Error (N)", "Rate (Hz)", "hold", "linear (1 not drawn)"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.contains("hold (1 not drawn)"), log_y);
    }
    let svg = check(&line_chart("", "", "", true, true, &[]));
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
        subtitle: "b = 0.005 N s/m, 3 ticks late".to_owned(),
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
    let page = Map {
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
    let svg = check(&map(&page));
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
    check(&map(&Map::default()));
    let nothing = check(&map(&Map {
        panels: vec![MapPanel::default()],
        ..Map::default()
    }));
    assert!(nothing.contains("no data"));
}

#[test]
fn causes_that_act_at_one_time_are_below_each_other_and_name_what_they_acted_on() {
    let mut data = stretch(1000);
    let mark = |cause, of: &str, from, to| Mark {
        from,
        to,
        cause,
        of: of.to_owned(),
    };
    data.marks = vec![
        mark(Cause::Stalled, "", 0.0, 0.1),
        mark(Cause::Capped, "sheet", 0.1, 0.5),
        mark(Cause::Limited, "left hand", 0.2, 0.3),
        mark(Cause::Capped, "organ", 0.2, 0.8),
    ];
    let svg = check(&force_and_position(&data));
    for text in [
        "force capped: sheet, organ",
        "force or slew limited: left hand",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    // The strips of both causes are below each other, though the causes act at one time.
    let strip = |color: &str| {
        let strips = svg.lines().filter(|line| {
            line.contains(color) && line.contains("opacity=\"1\"") && line.contains("height=\"16\"")
        });
        let tops =
            strips.filter_map(|line| line.split("y=\"").nth(1)?.split('"').next()?.parse().ok());
        tops.collect::<Vec<i32>>()
    };
    let (capped, limited) = (strip("#CC79A7"), strip("#56B4E9"));
    // What acts at another time is in the first row.
    assert_eq!(strip("#A5A5A5")[1..], capped[1..]);
    // The first is that of the legend, and then there is one in each panel.
    assert_eq!((capped.len(), limited.len()), (3, 3));
    for (above, below) in capped.iter().zip(&limited).skip(1) {
        assert!((below - above - 16).abs() <= 1, "{above} {below}");
    }
}

#[test]
fn texts_of_any_length_keep_to_the_page() {
    let long = "a name of a scene that nobody would read to its end ".repeat(6);
    let mut data = stretch(200);
    data.title.clone_from(&long);
    data.subtitle.clone_from(&long);
    data.devices[0].name.clone_from(&long);
    // Coordinates that need long labels.
    for (k, position) in data.devices[0].position.iter_mut().enumerate() {
        position[0] = 1e4 * k as f64;
    }
    check(&force_and_position(&data));
    let series = Series {
        name: long.clone(),
        points: vec![(1e-7, 123_456.0), (3e9, 123_456.5)],
        spread: vec![[1e-8, 1e-6]],
        ..Series::default()
    };
    for (log_x, log_y) in [(true, true), (false, false)] {
        check(&line_chart(
            &long,
            "x",
            "y",
            log_x,
            log_y,
            std::slice::from_ref(&series),
        ));
    }
    for columns in 1..=3 {
        let panel = Panel {
            title: long.clone(),
            x_label: "force error (%)".to_owned(),
            y_label: "fraction of runs".to_owned(),
            x_scale: Scale::LogarithmicAbove(1e-3),
            series: vec![series.clone()],
            x_covers: vec![5e-4, 1.1e-3],
            ..Panel::default()
        };
        check(&panels(&long, &long, columns, &vec![panel; 4]));
    }
}

#[test]
fn zero_is_drawn_as_zero_and_one_value_is_data() {
    let panel = |points: Vec<(f64, f64)>| {
        let panel = Panel {
            x_label: "net energy (mJ)".to_owned(),
            y_label: "fraction of runs".to_owned(),
            x_scale: Scale::LogarithmicAbove(1e-3),
            series: vec![Series {
                name: "linear".to_owned(),
                points,
                role: Role::Scheme("linear"),
                ..Series::default()
            }],
            ..Panel::default()
        };
        check(&panels("Energy", "", 2, &[panel]))
    };
    let all_zero = panel(vec![(0.0, 0.0), (0.0, 1.0)]);
    assert!(!all_zero.contains("no data") && all_zero.contains("\n0\n"));
    let one = panel(vec![(5.0, 1.0)]);
    assert!(!one.contains("no data") && one.contains("<circle"));
    assert!(panel(Vec::new()).contains("no data"));
}

#[test]
fn curves_that_coincide_show_each_other() {
    let points = vec![(0.0, 0.0), (1.0, 1.0)];
    let series = ["linear", "classic", "capped"].map(|name| Series {
        name: name.to_owned(),
        points: points.clone(),
        role: Role::Scheme(name),
        ..Series::default()
    });
    let svg = line_chart("Schemes", "x", "y", false, false, &series).svg();
    // Length of the strokes of each colour: the lower line is whole, and those above it leave gaps.
    let inked = |color: &str| -> f64 {
        let strokes = svg
            .lines()
            .filter(|line| line.starts_with("<polyline") && line.contains(color));
        let points = strokes.filter_map(|line| line.split("points=\"").nth(1)?.split('"').next());
        points
            .map(|points| {
                let path: Vec<(f64, f64)> = points
                    .split_whitespace()
                    .filter_map(|point| point.split_once(','))
                    .map(|(x, y)| (x.parse().expect("x"), y.parse().expect("y")))
                    .collect();
                let lengths = path
                    .windows(2)
                    .map(|p| (p[1].0 - p[0].0).hypot(p[1].1 - p[0].1));
                lengths.sum::<f64>()
            })
            .sum()
    };
    let [linear, classic, capped] = ["#009E73", "#CC79A7", "#222222"].map(inked);
    assert!(
        classic < 0.55 * linear && capped < 0.5 * linear,
        "{linear} {classic} {capped}"
    );
    assert!(
        classic > 0.3 * linear && capped > 0.2 * linear,
        "{linear} {classic} {capped}"
    );
}
