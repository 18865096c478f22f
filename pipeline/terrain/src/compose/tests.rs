use super::*;
use proptest::prelude::*;
use serde_json::json;

fn prepared(processes: Value) -> Box<dyn Generator> {
    crate::prepare(KIND, &json!({"size_px": [30, 20], "cell_m": 0.5, "processes": processes})).unwrap()
}

fn streams() -> Streams {
    Streams::for_seed(1, "terrain")
}

fn made(processes: Value, inputs: &[Grid]) -> Terrain {
    let inputs: Vec<Input> = inputs.iter().cloned().map(Input::from).collect();
    prepared(processes).generate(&streams(), &inputs).unwrap()
}

/// A ramp that rises by 1 per metre to the east.
fn ramp() -> Grid {
    let g = Geometry::square(40, 40, 0.5);
    Grid::new(g, (0..g.len()).map(|k| g.x(k % 40)).collect())
}

fn hills(process: u32) -> Grid {
    let generator = crate::prepare("spheroids", &json!({"size_px": [30, 20], "cell_m": 0.5})).unwrap();
    generator.generate(&streams().child(&format!("process-{process}")), &[]).unwrap().heights
}

#[test]
fn val_operations_are_those_of_the_table() {
    let o = |z: &[f64]| Grid::new(Geometry::square(1, z.len(), 1.0), z.to_vec());
    let (z, operand, w) = (o(&[1.0, 2.0, 3.0]), o(&[10.0, 20.0, 30.0]), o(&[0.0, 0.5, 1.0]));
    let joined = |join: params::Join| join.of(z.clone(), &operand, &w).values;
    assert_eq!(joined(params::Join::Add), [1.0, 12.0, 33.0]);
    assert_eq!(joined(params::Join::Multiply), [1.0, 21.0, 90.0]);
    assert_eq!(joined(params::Join::Blend), [1.0, 11.0, 30.0]);
    assert_eq!(scaled_to_relief(&z, 4.0).unwrap().values, [0.0, 2.0, 4.0]);
    let level = TerrainError::Level { part: "the processes so far" };
    assert_eq!(scaled_to_relief(&o(&[2.0, 2.0]), 4.0), Err(level));
}

#[test]
fn val_regions_rise_smoothly_between_their_values() {
    let operand = || Operand::Surface(NamedInput::heights("", ""));
    let region = |from, to| Region { operand: operand(), from, to };
    let weights = [1.0, 2.0, 2.5, 3.0, 4.0].map(|v| region(2.0, 3.0).weight(v));
    assert_eq!(weights, [0.0, 0.0, 0.5, 1.0, 1.0]);
    assert_eq!(region(3.0, 2.0).weight(2.25), 1.0 - region(2.0, 3.0).weight(2.25));
}

/// Each process modifies the result of the previous ones, with its own streams.
#[test]
fn val_processes_run_in_order() {
    let two = made(json!([{"kind": "spheroids"}, {"kind": "spheroids", "factor": 0.5}]), &[]).heights;
    let expected = ops::combine(&hills(1), &hills(2), |a, b| a + b * 0.5);
    assert_eq!(two.values, expected.values);
    let first = made(json!([{"kind": "spheroids"}, {"operation": "clip", "high_m": 9.0}, {"of": "ramp"}]), &[ramp()]);
    let last = made(json!([{"kind": "spheroids"}, {"of": "ramp"}, {"operation": "clip", "high_m": 9.0}]), &[ramp()]);

    assert!(first.heights.row(0)[29] >= 14.75 && last.heights.range().unwrap().1 == 9.0);
    let scaled = made(json!([{"of": "ramp"}, {"operation": "scale_to_relief", "relief_m": 3.0}]), &[ramp()]).heights;
    let (low, high) = scaled.range().unwrap();
    assert!((high - low - 3.0).abs() < 1e-12 && (0.5 * (low + high) - 7.5).abs() < 1e-12);
}

/// West of 4 m lies the ramp, east of 6 m hills, and a blend in between; a mask leaves -1 m in the west. The weight is `3 t^2 - 2 t^3`, with t from
/// 0 to 1.
#[test]
fn val_blends_and_masks_follow_their_region() {
    let region = json!({"of": "ramp", "from": 4.0, "to": 6.0});
    let blend = json!([{"of": "ramp"}, {"operation": "blend", "kind": "spheroids", "region": region}]);
    let heights = made(blend, &[ramp(), ramp()]).heights;
    let weight = |k: usize| {
        let t = ((heights.geometry.x(k % 30) - 4.0) / 2.0).clamp(0.0, 1.0);
        3.0 * t * t - 2.0 * t * t * t
    };
    let (first, second) = (hills(1).values, hills(2).values);
    assert_eq!((first.len(), second.len()), (600, 600));
    for (k, hill) in second.iter().enumerate() {
        let (x, w) = (heights.geometry.x(k % 30), weight(k));
        let expected = (1.0 - w) * x + w * hill;
        assert!((heights.values[k] - expected).abs() < 1e-12, "{x}: {} {expected}", heights.values[k]);
    }
    let mask = json!([{"kind": "spheroids"}, {"operation": "mask", "outside_m": -1.0, "region": region}]);
    let masked = made(mask, &[ramp()]).heights;
    assert!((0..600).all(|k| heights.geometry.x(k % 30) > 4.0 || masked.values[k] == -1.0));
    for (k, hill) in first.iter().enumerate() {
        let expected = weight(k) * hill - (1.0 - weight(k));
        assert!((masked.values[k] - expected).abs() < 1e-12, "{k}: {} {expected}", masked.values[k]);
    }
}

/// A refined DEM keeps the DEM's position: between the posts of a ramp it is the ramp.
#[test]
fn val_a_refined_dem_keeps_its_position() {
    let g = Geometry { origin: [-10.0, -10.0], ..Geometry::square(12, 14, 3.0) };
    let dem = Grid::new(g, (0..g.len()).map(|k| g.x(k % 14) - 2.0 * g.y(k / 14)).collect());
    let plain = json!({"dem": "hill", "texture": false});
    let params = json!({"size_px": [30, 20], "cell_m": 0.5, "origin_m": [1.0, 2.0],
        "processes": [{"kind": "elaborate", "parameters": plain}]});
    let made = crate::prepare(KIND, &params).unwrap().generate(&streams(), &[dem.into()]).unwrap().heights;
    for (k, z) in made.values.iter().enumerate() {
        let (x, y) = (made.geometry.x(k % 30), made.geometry.y(k / 30));
        assert!((z - (x - 2.0 * y)).abs() < 1e-9, "{x} {y}: {z}");
    }
}

#[test]
fn val_surfaces_must_cover_the_cells() {
    let small = Grid::filled(Geometry::square(10, 10, 0.5), 1.0);
    let error = prepared(json!([{"of": "small"}])).generate(&streams(), &[small.into()]).unwrap_err();
    assert!(
        error.to_string().contains("\"small\"")
            && error.to_string().contains("covers x 0.25 to 4.75, y 0.25 to 4.75 m"),
        "{error}"
    );
    let error = prepared(json!([{"of": "small"}])).generate(&streams(), &[]).unwrap_err();
    assert!(error.to_string().contains("is missing"));
    let flat = Grid::filled(Geometry::square(40, 40, 0.5), 1.0);
    let error = prepared(json!([{"of": "flat"}])).generate_checked(&streams(), &[flat.into()]).unwrap_err();
    assert!(error.to_string().contains("same everywhere"), "{error}");
}

/// A surface that does not cover the cells is refused before it is read, with the same reason as in the run and under the key that names it;
/// positions that are not known yet are left to the run.
#[test]
fn val_places_are_checked_before_the_run() {
    let small = Grid::filled(Geometry::square(10, 10, 0.5), 1.0);
    let generator = prepared(json!([{"kind": "spheroids"}, {"of": "a"}, {"of": "small"}]));
    let wide = Geometry::square(40, 40, 0.5);
    assert_eq!(generator.check_places(&[Some(wide), None]), Ok(()));
    assert_eq!(generator.check_places(&[]), Ok(()));
    let error = generator.check_places(&[Some(wide), Some(small.geometry)]).unwrap_err();
    assert_eq!(error.key, "processes.2.of");
    let at_run = generator.generate(&streams(), &[Grid::filled(wide, 1.0).into(), small.into()]).unwrap_err();
    let reason = at_run.to_string().split_once("it covers").unwrap().1.to_owned();
    assert!(
        reason.contains("x 0.25 to 4.75, y 0.25 to 4.75 m") && error.message.ends_with(&reason),
        "{error} {at_run}"
    );
    // The origin of an elaborated DEM is that of the composition.
    let inner = prepared(json!([{"kind": "elaborate", "parameters": {"dem": "b"}}]));
    let error =
        inner.check_places(&[Some(Geometry { origin: [3.0, 0.0], ..Geometry::square(20, 20, 5.0) })]).unwrap_err();
    assert_eq!(error.key, "origin_m");
    // Up to the rounding of coordinates.
    let exact = Geometry { origin: [1e-9, -1e-9], ..Geometry::square(20, 30, 0.5) };
    assert_eq!(prepared(json!([{"of": "a"}])).check_places(&[Some(exact)]), Ok(()));
}

#[test]
fn val_inputs_follow_the_order_of_the_processes() {
    let region = json!({"of": "b", "from": 0.0, "to": 1.0});
    let generator = prepared(json!([{"of": "a", "region": region}, {"kind": "spheroids"}, {"of": "c"}]));
    let inputs: Vec<(String, String)> = generator.inputs().into_iter().map(|b| (b.key, b.name)).collect();
    let expected = [("processes.0.of", "a"), ("processes.0.region.of", "b"), ("processes.2.of", "c")];
    assert_eq!(inputs, expected.map(|(k, n)| (k.to_owned(), n.to_owned())));
}

/// Every generator that needs no other surface can take part.
#[test]
fn prop_every_generator_composes() {
    let mut composed = 0;
    for kind in crate::kinds().iter().filter(|k| k.kind != KIND && crate::prepare(k.kind, &Value::Null).is_ok()) {
        let params =
            json!({"size_px": [32, 24], "cell_m": 0.05, "origin_m": [2.0, 1.0], "processes": [{"kind": kind.kind}]});
        let generator = crate::prepare(KIND, &params).unwrap_or_else(|e| panic!("{}: {e}", kind.kind));
        if generator.inputs().is_empty() {
            let made = generator.generate(&streams(), &[]).unwrap_or_else(|e| panic!("{}: {e}", kind.kind));
            assert_eq!(made.heights.geometry, generator.geometry(), "{}", kind.kind);
            assert!(made.maps.iter().all(|m| m.values.geometry == generator.geometry()), "{}", kind.kind);
            composed += 1;
        }
    }
    // All but `compose` itself and `elaborate`, which needs a DEM.
    assert_eq!(composed, crate::kinds().len() - 2);
}

/// Notes of a generator are attributed to its process, or to its region.
#[test]
fn val_notes_of_generators_are_kept() {
    let listing = json!([{"kind": "mavs_perlin", "parameters": {"compat": true}}, {"kind": "cascade"}]);
    let generator = prepared(listing);
    let alone = crate::prepare("mavs_perlin", &json!({"size_px": [30, 20], "cell_m": 0.5, "compat": true})).unwrap();
    let of_process = |note: &String| generator.notes().contains(&format!("process 1 alone: {note}"));
    assert!(!alone.notes().is_empty() && alone.notes().iter().all(of_process));
    let wide = json!({"size_px": [70, 64], "processes": [{"kind": "spheroids", "region": {"kind": "cascade", "from": 0, "to": 1}}]});
    let made = crate::prepare(KIND, &wide).unwrap().generate(&streams(), &[]).unwrap();
    let of_region = |note: &String| note.starts_with("region of process 1 alone: ");
    assert!(made.notes.iter().all(of_region) && made.notes[0].contains("zeta(1)"), "{:?}", made.notes);
}

/// Size, cell and origin are keys of the composition: a generator that cannot use them is reported under its `kind`.
#[test]
fn val_a_refused_origin_is_attributed_to_the_composition() {
    let processes = json!([{"kind": "spheroids"}, {"kind": "gap"}]);
    let params = json!({"size_px": [90, 90], "cell_m": 0.25, "origin_m": [0.1, 0.0], "processes": processes});
    let error = crate::prepare(KIND, &params).err().unwrap();
    assert!(error.key == "processes.1.kind" && error.message.contains("the `origin_m` of the composition"), "{error}");
}

/// The listing behind `mavs_gaussian` may choose another cell.
#[test]
fn val_cells_of_a_listing_are_refused() {
    let processes = json!([{"kind": "mavs_gaussian", "parameters": {"compat": true, "hi_len_m": 1.5}}]);
    let params = json!({"size_px": [5, 5], "cell_m": 3.0, "processes": processes});
    let error = crate::prepare(KIND, &params).err().unwrap();
    assert!(error.key == "processes.0.parameters" && error.message.contains("instead of 5 x 5"), "{error}");
}

#[test]
fn val_maps_of_generators_are_kept() {
    let maps = |processes| made(processes, &[]).maps;
    let one = maps(json!([{"kind": "cascade"}, {"kind": "spheroids"}]));
    assert_eq!(one.iter().map(|m| m.name).collect::<Vec<_>>(), ["flux"]);
    let two = maps(json!([{"kind": "cascade"}, {"kind": "cascade"}]));
    assert_eq!(two.len(), 1);
    assert_ne!(one[0].values, two[0].values);
}

/// A map has values where its process takes effect, and roughness maps are dropped: x below 4 m is masked off or blended over.
#[test]
fn val_maps_follow_their_region() {
    let region = |from: f64, to: f64| json!({"of": "ramp", "from": from, "to": to});
    let known = |processes: Value, inputs: &[Grid]| -> Vec<bool> {
        let maps = made(processes, inputs).maps;
        maps.first().map_or_else(Vec::new, |map| map.values.row(7).iter().map(|v| v.is_finite()).collect())
    };
    let east: Vec<bool> = (0..30).map(|k| 0.5 * k as f64 + 0.25 > 4.0).collect();
    let west: Vec<bool> = east.iter().map(|e| !e).collect();
    let cascade = || json!({"kind": "cascade"});
    let add = json!([{"kind": "spheroids"}, {"kind": "cascade", "region": region(4.0, 4.1)}]);
    assert_eq!(known(add, &[ramp()]), east);
    let mask = json!([cascade(), {"operation": "mask", "region": region(4.0, 4.1)}]);
    assert_eq!(known(mask, &[ramp()]), east);
    let blend = json!([cascade(), {"operation": "blend", "kind": "spheroids", "region": region(4.0, 4.1)}]);
    assert_eq!(known(blend, &[ramp()]), west);
    let over = json!([cascade(), {"operation": "blend", "kind": "spheroids"}]);
    assert!(known(over, &[]).is_empty());
    let rough = json!({"roughness": {"band_m": [1.0, 2.5]}});
    let made = made(json!([{"kind": "mavs_perlin", "parameters": rough, "factor": 3.0}]), &[]);
    assert!(made.maps.is_empty() && made.notes.iter().all(|n| n.starts_with("process 1 alone: ")), "{:?}", made.notes);
}

#[test]
fn val_impossible_processes_are_refused() {
    let refused = |processes: Value| {
        let params = json!({"size_px": [30, 20], "processes": processes});
        let error = crate::prepare(KIND, &params).err().unwrap();
        (error.key, error.message)
    };
    for (processes, key, word) in [
        (json!([]), "processes", "empty"),
        (json!([{"operation": "multiply", "kind": "spheroids"}]), "processes", "first"),
        (json!([{}]), "processes.0.kind", "missing"),
        (json!([{"kind": "sphere"}]), "processes.0.kind", "known ones"),
        (json!([{"kind": "spheroids", "of": "a"}]), "processes.0.of", "one of them"),
        (json!([{"of": "a", "parameters": {"preset": "plain"}}]), "processes.0.parameters", "belong"),
        (json!([{"kind": "spheroids", "parameters": {"cell_m": 1.0}}]), "processes.0.parameters.cell_m", "whole"),
        (json!([{"kind": "spheroids", "parameters": {"spheroids": 0}}]), "processes.0.parameters.spheroids", "between"),
        (json!([{"kind": "spheroids", "relief_m": 1.0}]), "processes.0.relief_m", "`add`"),
        (json!([{"of": "a"}, {"operation": "mask"}]), "processes.1.region", "missing"),
        (json!([{"of": "a"}, {"operation": "clip"}]), "processes.1.low_m", "missing"),
        (json!([{"of": "a"}, {"operation": "clip", "low_m": 2.0, "high_m": 1.0}]), "processes.1.low_m", "below"),
        (json!([{"of": "a"}, {"operation": "scale_to_relief"}]), "processes.1.relief_m", "missing"),
        (json!([{"of": "a", "region": {"of": "b", "from": 1.0, "to": 1.0}}]), "processes.0.region.to", "two values"),
        (json!([{"of": "a", "region": {"from": 1.0, "to": 2.0}}]), "processes.0.region.kind", "missing"),
    ] {
        let (found, message) = refused(processes.clone());
        assert!(found == key && message.contains(word), "{processes}: {found} {message}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// For any numbers, a valid list of processes fails with a reason, or gives finite heights that are not flat.
    #[test]
    fn prop_any_list_is_generated_or_refused(words in proptest::collection::vec((0usize..6, any::<bool>(), -3.0f64..3.0), 1..6)) {
        let operations = ["add", "multiply", "blend", "mask", "clip", "scale_to_relief"];
        let region = |number: f64| json!({"kind": "spheroids", "from": 0.0, "to": number});
        let process = |(operation, everywhere, number): (usize, bool, f64)| {
            let mut process = json!({"operation": operations[operation]});
            match operations[operation] {
                "clip" => process["high_m"] = json!(number),
                "scale_to_relief" => process["relief_m"] = json!(number.abs()),
                "mask" => process["region"] = region(number),
                _ => {
                    process["kind"] = json!("spheroids");
                    process["factor"] = json!(number);
                    if !everywhere {
                        process["region"] = region(number);
                    }
                }
            }
            process
        };
        let first = json!({"kind": "spheroids"});
        let processes: Vec<Value> = std::iter::once(first).chain(words.into_iter().map(process)).collect();
        let generator = crate::prepare(KIND, &json!({"size_px": [9, 8], "processes": processes})).unwrap();
        match generator.generate_checked(&streams(), &[]) {
            Ok(made) => {
                let (low, high) = made.heights.range().unwrap();
                prop_assert!(made.heights.finite_count() == 72 && high > low);
            }
            Err(TerrainError::Level { .. }) => {}
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}

/// The centre line of a trail is a line of the surface, with the final heights; a second trail and those of an operand get distinct
/// names. All parameters are written out, and read back to the same surface.
#[test]
fn val_trails_are_lines_of_the_surface() {
    let small = json!({"width_m": 3.2, "turning_radius_m": 3.0});
    let params = json!({"size_m": [30, 24], "cell_m": 0.2, "processes": [
        {"kind": "spheroids", "factor": 0.05},
        {"operation": "trail", "trail": small},
        {"operation": "trail", "trail": {"follows": "loop", "loop_share": 0.35, "width_m": 3.2, "turning_radius_m": 3.0}},
        {"operation": "clip", "high_m": 0.5},
    ]});
    let generator = crate::prepare(KIND, &params).unwrap();
    let made = generator.generate(&streams(), &[]).unwrap();
    assert_eq!(made.lines.iter().map(|line| line.name.as_str()).collect::<Vec<_>>(), ["trail", "trail-2"]);
    for [x, y, z] in made.lines.iter().flat_map(|line| &line.points_m) {
        assert_eq!(made.heights.height(*x, *y), Some(*z));
    }
    assert_eq!(made.lines[1].points_m.first(), made.lines[1].points_m.last());
    assert!(
        generator.notes().iter().any(|n| n.starts_with("process 2: ruts of 0.25 m are too narrow for cells of 0.2 m"))
    );
    let written = generator.parameters();
    assert_eq!(written.pointer("/processes/1/trail/border_m"), Some(&json!(3.0)));
    assert_eq!(crate::prepare(KIND, &written).unwrap().parameters(), written);
    assert_eq!(crate::prepare(KIND, &written).unwrap().generate(&streams(), &[]).unwrap(), made);
    let processes = json!([{"kind": "compose", "parameters": {"processes": params["processes"]}}]);
    let nested = json!({"size_m": [30, 24], "cell_m": 0.2, "processes": processes});
    let nested = crate::prepare(KIND, &nested).unwrap().generate(&streams(), &[]).unwrap();
    assert_eq!(nested.lines.len(), 2);
}

#[test]
fn val_trails_need_ground_and_their_own_operation() {
    let refused = |processes: Value| {
        let params = json!({"size_m": [30, 24], "cell_m": 0.2, "processes": processes});
        crate::prepare(KIND, &params).err().unwrap().key
    };
    assert_eq!(refused(json!([{"operation": "trail"}])), "processes");
    assert_eq!(refused(json!([{"kind": "spheroids", "trail": {}}])), "processes.0.trail");
    assert_eq!(refused(json!([{"kind": "spheroids"}, {"operation": "trail", "factor": 2.0}])), "processes.1.factor");
    let wide = json!([{"kind": "spheroids"}, {"operation": "trail", "trail": {"width_m": 30.0}}]);
    assert!(refused(wide).starts_with("processes.1.trail."));
}
