use super::*;

type Case = (fn(&mut RouteParameters), &'static str);

fn changed(change: fn(&mut RouteParameters)) -> RouteParameters {
    let mut parameters = RouteParameters::default();
    change(&mut parameters);
    parameters
}

#[test]
fn val_wrong_parameters_are_refused_with_their_key() {
    RouteParameters::default().check().unwrap();
    let cases: [Case; 18] = [
        (|p| p.neighbours = 5, "neighbours"),
        (|p| p.plan_cell_m = Some(0.0), "plan_cell_m"),
        (|p| p.threshold_m = Some(-1.0), "threshold_m"),
        (|p| p.width_m = Some(f64::NAN), "width_m"),
        (|p| p.step_over_m = Some(-1.0), "step_over_m"),
        (|p| p.suboptimality = 0.99, "suboptimality"),
        (|p| p.suboptimality = f64::INFINITY, "suboptimality"),
        (|p| p.expansions_max = Some(0), "expansions_max"),
        (|p| p.smoothing_tolerance_m = -1.0, "smoothing_tolerance_m"),
        (|p| p.max_up_deg = Some(90.0), "max_up_deg"),
        (|p| p.max_down_deg = Some(0.0), "max_down_deg"),
        (|p| p.up_weight = -1.0, "up_weight"),
        (|p| p.down_weight = f64::NAN, "down_weight"),
        (|p| p.class_factors = [1.0, 0.0, 4.0], "class_factors.1"),
        (|p| p.band_rms_weight_per_m = -1.0, "band_rms_weight_per_m"),
        (|p| p.clearance_weight = -1.0, "clearance_weight"),
        (|p| p.clearance_max = 0.5, "clearance_max"),
        (|p| p.obstacle_margin_m = -0.1, "obstacle_margin_m"),
    ];
    for (change, key) in cases {
        assert_eq!(changed(change).check().unwrap_err().key, key);
    }
    // The floor of descents is checked where it is used.
    let floor = |cost| RouteParameters { cost, energy_floor: 0.0, ..RouteParameters::default() };
    assert_eq!(floor(Cost::Energy).check().unwrap_err().key, "energy_floor");
    assert!(floor(Cost::Slope).check().is_ok());
}

/// What each cost needs: nothing, a vehicle, or a raster.
#[test]
fn val_costs_are_refused_without_their_input() {
    for (cost, vehicle, raster) in [
        (Cost::Slope, false, false),
        (Cost::Energy, true, false),
        (Cost::Class, false, false),
        (Cost::BandRms, true, false),
        (Cost::Raster, false, true),
    ] {
        let parameters = RouteParameters { cost, ..RouteParameters::default() };
        for (has_vehicle, has_raster) in [(false, false), (false, true), (true, false), (true, true)] {
            // A vehicle never hurts; a raster that the cost does not use is a mistake.
            let expected = (has_vehicle || !vehicle) && has_raster == raster;
            let found = parameters.check_given(has_vehicle, has_raster).is_ok();
            assert_eq!(found, expected, "{cost:?}, vehicle {has_vehicle}, raster {has_raster}");
        }
    }
}

#[test]
fn val_factors_of_cells() {
    let parameters = RouteParameters { class_factors: [1.0, 2.0, 5.0], ..RouteParameters::default() };
    assert_eq!([0, 1, 2, 255].map(|code| parameters.class_factor(code)), [1.0, 2.0, 5.0, 5.0]);
    let rms = RouteParameters { band_rms_weight_per_m: 8.0, ..RouteParameters::default() };
    assert_eq!([0.0, 0.25].map(|rms_m| rms.band_rms_factor(rms_m)), [1.0, 3.0]);
}

#[test]
fn val_limits_of_the_study_take_precedence_over_the_vehicles() {
    let parameters = RouteParameters { max_up_deg: Some(10.0), ..RouteParameters::default() };
    assert_eq!(parameters.limits([25.0, 20.0]).unwrap().degrees(), [10.0, 20.0]);
    assert_eq!(RouteParameters::default().limits(RouteParameters::WITHOUT_VEHICLE_DEG).unwrap().degrees(), [30.0; 2]);
}

#[test]
fn val_settings_are_those_of_the_method() {
    let method = |parameters: &RouteParameters| parameters.settings(0.5).unwrap().method;
    assert_eq!(method(&RouteParameters::default()), route::Method::GridAstar);
    assert_eq!(method(&changed(|p| p.method = Search::ThetaStar)), route::Method::ThetaStar);
    let anytime = changed(|p| p.method = Search::Anytime);
    assert_eq!(method(&anytime), route::Method::Anytime { weight: 2.0, budget: u64::MAX });
    let budget = RouteParameters { suboptimality: 3.0, expansions_max: Some(7), ..anytime };
    assert_eq!(method(&budget), route::Method::Anytime { weight: 3.0, budget: 7 });
    // The step over is the cell size unless stated.
    let roadmap = changed(|p| p.method = Search::Roadmap);
    let vertices = VertexSettings { step_over_m: 0.5, ..VertexSettings::default() };
    assert_eq!(method(&roadmap), route::Method::Roadmap(vertices));
    let literal =
        RouteParameters { step_over_m: Some(0.0), threshold_m: Some(2.0), literal: true, repair: false, ..roadmap };
    let vertices = VertexSettings {
        step_over_m: 0.0,
        threshold_m: Some(2.0),
        repair: false,
        literal_filter: true,
        literal_border: true,
        literal_alone: true,
    };
    assert_eq!(method(&literal), route::Method::Roadmap(vertices));
    let neighbours = |parameters: &RouteParameters| parameters.settings(1.0).unwrap().neighbourhood.name();
    let four = changed(|p| p.neighbours = 4);
    assert_eq!([neighbours(&four), neighbours(&RouteParameters::default())], ["four", "eight"]);
}

#[test]
fn val_names_in_tables_are_those_in_studies() {
    for search in Search::ALL {
        assert_eq!(serde_json::to_value(search).unwrap(), search.name());
    }
    for cost in [Cost::Slope, Cost::Energy, Cost::Class, Cost::BandRms, Cost::Raster] {
        assert_eq!(serde_json::to_value(cost).unwrap(), cost.name());
    }
}
