use super::*;

type Case = (fn(&mut TeamParameters), &'static str);

#[test]
fn val_defaults_make_a_team_of_four() {
    let parameters = TeamParameters::default();
    parameters.check().unwrap();
    assert_eq!(parameters.formation().unwrap().slots().len(), 4);
    assert_eq!(parameters.sample_every(), Ok(10));
}

#[test]
fn val_wrong_parameters_are_refused() {
    let refused = |change: fn(&mut TeamParameters)| {
        let mut parameters = TeamParameters::default();
        change(&mut parameters);
        parameters.check().unwrap_err()
    };
    let cases: [Case; 20] = [
        (|p| p.spacing_m = 0.0, "spacing_m"),
        (|p| p.spacing_m = 0.9, "spacing_m"),
        (|p| p.radius_m = -0.1, "radius_m"),
        (|p| p.margin_m = f64::NAN, "margin_m"),
        (|p| p.speed_min_m_s = 2.0, "speed_min_m_s"),
        (|p| p.speed_max_m_s = 0.5, "speed_max_m_s"),
        (|p| p.accelerate_m_s2 = 0.0, "accelerate_m_s2"),
        (|p| p.slow_m_s2 = -1.0, "slow_m_s2"),
        (|p| p.tolerance = 0.5, "tolerance"),
        (|p| p.look_ahead = 0, "look_ahead"),
        (|p| p.sample_rate_hz = 3.0, "sample_rate_hz"),
        (|p| p.sample_rate_hz = 20.0, "sample_rate_hz"),
        (|p| p.members = Some(0), "members"),
        (|p| p.members = Some(1001), "members"),
        (|p| p.slots = Shape::Line.pattern().unwrap().slots(2, 10.0), "slots"),
        (|p| p.formation = Shape::Custom, "slots"),
        (|p| p.losses = vec![Loss { time_s: 1.0, member: 5 }], "losses.0"),
        (|p| p.losses = vec![Loss { time_s: -1.0, member: 1 }], "losses.0.time_s"),
        (|p| p.drawn_losses = 4, "drawn_losses"),
        (|p| p.waypoint_spacing_m = Some(0.0), "waypoint_spacing_m"),
    ];
    for (change, key) in cases {
        assert_eq!(refused(change).key, key);
    }
}

#[test]
fn val_custom_slots_are_the_team() {
    let slots = Shape::Wedge.pattern().unwrap().slots(3, 4.0);
    let custom = TeamParameters { formation: Shape::Custom, slots, ..TeamParameters::default() };
    custom.check().unwrap();
    assert_eq!(custom.formation().unwrap().slots()[2].from_leader_m, [4.0, 4.0]);
    assert!(custom.pattern_spacing_m().is_nan());
    let both = TeamParameters { members: Some(3), ..custom };
    assert_eq!(both.check().unwrap_err().key, "members");
}

#[test]
fn val_legs_are_as_long_as_the_spacing_unless_stated() {
    let plain = TeamParameters { spacing_m: 7.0, ..TeamParameters::default() };
    assert_eq!(plain.leg_max_m(), 7.0);
    assert_eq!(TeamParameters { waypoint_spacing_m: Some(3.0), ..plain.clone() }.leg_max_m(), 3.0);
    assert_eq!(TeamParameters { literal_waypoints: true, ..plain }.leg_max_m(), f64::INFINITY);
}

#[test]
fn val_samples_are_a_number_of_steps_apart() {
    let every = |sample_rate_hz, step_s| {
        TeamParameters { sample_rate_hz, step_s, ..TeamParameters::default() }.sample_every().ok()
    };
    assert_eq!([every(10.0, 0.1), every(2.0, 0.1), every(0.5, 0.25)], [Some(1), Some(5), Some(8)]);
    assert_eq!([every(4.0, 0.1), every(20.0, 0.1)], [None, None]);
}
