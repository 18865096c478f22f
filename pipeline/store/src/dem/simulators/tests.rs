use super::*;
use proptest::prelude::*;

/// Heights that differ under every rotation and reflection.
fn slanted(rows: usize, cols: usize) -> Grid {
    let geometry = Geometry { rows, cols, cell: [0.5, 0.25], origin: [1000.0, -20.0] };
    let height = |r: usize, c: usize| 100.0 + 0.3 * c as f64 - 0.7 * r as f64 + 0.01 * (r * c) as f64;
    Grid::new(geometry, (0..rows).flat_map(|r| (0..cols).map(move |c| height(r, c))).collect())
}

fn resampled(grid: &Grid, simulator: Simulator) -> Result<Export, DemError> {
    export(grid, simulator, Fit::Resample, None)
}

fn numbers(export: &Export) -> Value {
    let (_, bytes) = export.files.iter().find(|(name, _)| name == "import.json").unwrap();
    serde_json::from_slice(bytes).unwrap()
}

/// A supported size is not resampled; any other keeps the extent of its ground.
#[test]
fn val_sizes_that_fit_are_not_resampled() {
    for (simulator, fitting, smallest) in
        [(Simulator::Unreal, 127, 127), (Simulator::Unity, 65, 65), (Simulator::Gazebo, 129, 129)]
    {
        let fits = resampled(&slanted(fitting, fitting), simulator).unwrap();
        assert_eq!((numbers(&fits)["fit"]["method"].as_str(), fits.notes.len()), (Some("none"), 0));
        let other = resampled(&slanted(60, 40), simulator).unwrap();
        let found = numbers(&other);
        assert_eq!(found["posts"], json!([smallest, smallest]), "{}", simulator.name());
        assert_eq!(found["scene"]["ground_m"], json!([19.5, 14.75]));
        assert!(other.notes[0].contains("bilinear between the 40 x 60 cell centres"), "{:?}", other.notes);
    }
    for simulator in [Simulator::Mujoco, Simulator::Isaac] {
        let found = numbers(&resampled(&slanted(60, 40), simulator).unwrap());
        assert_eq!((found["posts"].clone(), found["fit"]["method"].as_str()), (json!([40, 60]), Some("none")));
    }
}

/// Levels in the files are the heights of the posts, to half a level: Unreal's image starts in the north, Unity's numbers in the south.
/// MuJoCo's are heights above the lowest post, in single precision, from the south.
#[test]
fn val_files_hold_the_heights_of_the_posts() {
    let bytes_of = |export: &Export, name: &str| {
        let (_, bytes) = export.files.iter().find(|(file, _)| file == name).unwrap();
        bytes.clone()
    };
    let of_levels = |export: &Export, levels: Vec<f64>| {
        let found = numbers(export)["settings"]["height_of_level"].clone();
        let [offset, step] = ["offset_m", "step_m"].map(|key| found[key].as_f64().unwrap());
        (levels.into_iter().map(|level| offset + step * level).collect::<Vec<f64>>(), step)
    };
    let agree = |heights: &[f64], grid: &Grid, tolerance: f64, south_first: bool| {
        assert_eq!(heights.len(), grid.values.len());
        for (k, height) in heights.iter().enumerate() {
            let (r, c) = (k / grid.cols(), k % grid.cols());
            let expected = grid.at(if south_first { grid.rows() - 1 - r } else { r }, c);
            assert!((height - expected).abs() <= tolerance, "{r} {c}: {height} {expected}");
        }
    };
    let grid = slanted(127, 127);
    let export = resampled(&grid, Simulator::Unreal).unwrap();
    let image = crate::dem::png::parse(&bytes_of(&export, "heightmap.png"), &Default::default()).unwrap();
    let (heights, step) = of_levels(&export, image.grid.values);
    agree(&heights, &grid, 0.5001 * step, false);

    let grid = slanted(65, 65);
    let export = resampled(&grid, Simulator::Unity).unwrap();
    let raw = bytes_of(&export, "heightmap.raw");
    let levels = raw.chunks_exact(2).map(|level| f64::from(u16::from_le_bytes([level[0], level[1]]))).collect();
    let (heights, step) = of_levels(&export, levels);
    agree(&heights, &grid, 0.5001 * step, true);

    let grid = slanted(30, 20);
    let field = bytes_of(&resampled(&grid, Simulator::Mujoco).unwrap(), "heights.hfield");
    let word = |at: usize| [field[at], field[at + 1], field[at + 2], field[at + 3]];
    assert_eq!([word(0), word(4)].map(i32::from_le_bytes), [30, 20]);
    let (low, _) = grid.range().unwrap();
    let heights: Vec<f64> =
        (8..field.len()).step_by(4).map(|at| low + f64::from(f32::from_le_bytes(word(at)))).collect();
    agree(&heights, &grid, 1e-5, true);
}

/// A crop is the middle of the DEM, at its position in the scene; a crop larger than the DEM is refused.
#[test]
fn val_crops_keep_heights_and_position() {
    let grid = slanted(140, 131);
    for (simulator, size) in [(Simulator::Unreal, 127), (Simulator::Gazebo, 129), (Simulator::Unity, 129)] {
        let made = export(&grid, simulator, Fit::Crop, None).unwrap();
        let (row, col) = ((140 - size) / 2, (131 - size) / 2);
        let posts = posts(&grid, simulator, Fit::Crop).unwrap();
        assert_eq!(posts.heights.values, grid.window(row, col, size, size).values);
        let south_west = [grid.geometry.x(col) - 1000.0, grid.geometry.y(row + size - 1) + 20.0];
        assert_eq!(posts.south_west_m(), south_west);
        let found = numbers(&made);
        assert_eq!((found["fit"]["method"].as_str(), &found["posts"]), (Some("crop"), &json!([size, size])));
        assert!(made.notes[0].contains("the middle of the 131 x 140 cell centres"), "{:?}", made.notes);
        let refused = export(&slanted(140, 33), simulator, Fit::Crop, None);
        assert_eq!(refused.is_err(), simulator != Simulator::Unity, "{refused:?}");
    }
    let fits = export(&slanted(127, 127), Simulator::Unreal, Fit::Crop, None).unwrap();
    assert_eq!(fits, resampled(&slanted(127, 127), Simulator::Unreal).unwrap());
}

/// Each refusal is one sentence that names the simulator and the remedy.
#[test]
fn val_unsuitable_dems_are_refused() {
    let refusal = |grid: &Grid, simulator| resampled(grid, simulator).unwrap_err().to_string();
    let mut holed = slanted(10, 10);
    holed.values[17] = f64::NAN;
    for simulator in [Simulator::Unreal, Simulator::Unity, Simulator::Gazebo, Simulator::Mujoco] {
        let found = refusal(&holed, simulator);
        assert!(found.starts_with(simulator.name()) && found.contains("the DEM has 1 cell without data"), "{found}");
    }
    assert!(resampled(&holed, Simulator::Isaac).is_ok(), "a mesh has holes");
    holed.values.fill(f64::NAN);
    let thin = slanted(1, 10);
    let large = Geometry::square(4098, 8, 1.0);
    for simulator in Simulator::ALL {
        assert!(resampled(&holed, simulator).is_err() && resampled(&thin, simulator).is_err());
        let found = check_size(&large, simulator, Fit::Resample).err().map(|e| e.to_string()).unwrap_or_default();
        let limited = [Simulator::Unity, Simulator::Gazebo].contains(&simulator);
        assert_eq!(found.contains("more than 4097 posts a side"), limited, "{found}");
    }
    assert!(check_size(&Geometry::square(8130, 8, 1.0), Simulator::Unreal, Fit::Resample).is_err());
    assert!(check_size(&Geometry::square(4097, 4097, 1.0), Simulator::Isaac, Fit::Resample).is_err());
}

/// A level surface has no relief to scale by.
#[test]
fn val_planes_are_exported() {
    let plane = Grid::filled(Geometry::square(129, 129, 0.5), -3.25);
    for simulator in Simulator::ALL {
        let found = numbers(&resampled(&plane, simulator).unwrap());
        assert!(found["scene"]["height_min_m"] == -3.25 && found["scene"]["height_max_m"] == -3.25);
    }
}

/// Triangle corners at cell centres, in three formats: counter-clockwise from above, without holes.
#[test]
fn val_meshes_leave_holes_out() {
    let mut grid = slanted(3, 3);
    grid.values[0] = f64::NAN;
    let text = String::from_utf8(mesh::obj(&grid, None).unwrap()).unwrap();
    let lines = |start: &str| text.lines().filter(|l| l.starts_with(start)).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(lines("v ")[0], "v 1000.75 -19.375 100.3");
    assert_eq!((lines("v ").len(), lines("f ").len()), (8, 6));
    assert_eq!(lines("f ")[0], "f 1 4 5");
    let usda = String::from_utf8(mesh::usda(&grid, None).unwrap()).unwrap();
    assert!(usda.contains("points = [(0.75, 0.625, 100.3), "), "{usda}");
    let glb = mesh::glb(&grid, None).unwrap();
    assert_eq!(u32::from_le_bytes(glb[8..12].try_into().unwrap()) as usize, glb.len());
    grid.values[2..].fill(f64::NAN);
    let meshes = [mesh::usda, mesh::glb, mesh::obj];
    assert!(meshes.iter().all(|mesh| mesh(&grid, None).is_err()), "no triangle is left");
    assert!(meshes.iter().all(|mesh| mesh(&slanted(20, 1), None).is_err()), "a line is not a surface");
}

/// A decimated mesh has the stated numbers of vertices and triangles in all formats and folders; others do not mention decimation.
#[test]
fn val_decimated_meshes_state_their_error() {
    let grid = slanted(129, 129);
    let limits = MeshLimits { error_max_m: Some(0.5), triangles_max: None };
    let decimation = Decimation::new(&grid, &limits).unwrap();
    let stated = decimation.to_json();
    let [vertices, triangles] = ["vertices", "triangles"].map(|key| stated[key].as_u64().unwrap() as usize);
    assert!(triangles < 2000 && stated["triangles_of_dem"] == 2 * 128 * 128, "{stated}");
    assert!(stated["error_max_m"].as_f64().unwrap() <= 0.5, "{stated}");
    let count = |text: &str, start: &str| text.lines().filter(|line| line.starts_with(start)).count();
    let text = String::from_utf8(mesh::obj(&grid, Some(&decimation)).unwrap()).unwrap();
    assert_eq!((count(&text, "v "), count(&text, "f ")), (vertices, triangles));
    assert!(text.contains(&decimation.sentence()), "{text}");
    let usda = String::from_utf8(mesh::usda(&grid, Some(&decimation)).unwrap()).unwrap();
    assert!(usda.contains(&decimation.sentence()) && usda.contains("def Xform \"Terrain\" (\n"), "{usda}");
    let glb = mesh::glb(&grid, Some(&decimation)).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let scene: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    assert_eq!(scene["meshes"][0]["extras"], stated);
    for simulator in [Simulator::Gazebo, Simulator::Isaac] {
        let made = export(&grid, simulator, Fit::Resample, Some(&limits)).unwrap();
        assert_eq!(numbers(&made)["settings"]["decimation"]["triangles"], triangles);
        assert_eq!(made.notes, [decimation.sentence()]);
        assert!(numbers(&resampled(&grid, simulator).unwrap())["settings"].get("decimation").is_none());
    }
    let unreal = resampled(&grid, Simulator::Unreal).unwrap();
    assert_eq!(export(&grid, Simulator::Unreal, Fit::Resample, Some(&limits)).unwrap(), unreal);
}

/// Invalid limits, and fewer triangles than the outline needs.
#[test]
fn val_limits_of_meshes_are_checked() {
    let grid = slanted(20, 30);
    let refused = |error_max_m: Option<f64>, triangles_max: Option<usize>| {
        Decimation::new(&grid, &MeshLimits { error_max_m, triangles_max }).unwrap_err().to_string()
    };
    assert!(refused(Some(-1.0), None).contains("must be 0 m or more, got -1 m"));
    assert!(refused(Some(f64::NAN), None).contains("got NaN m"));
    assert!(refused(None, Some(1)).contains("take 2 triangles"));
    let both = MeshLimits { error_max_m: Some(1e-6), triangles_max: Some(40) };
    let sentence = Decimation::new(&grid, &both).unwrap().sentence();
    assert!(sentence.ends_with("; an error of 0.000001 m would take more triangles"), "{sentence}");
}

/// Heights or a relief beyond single precision, which would be written as infinite, are refused.
#[test]
fn val_heights_beyond_single_precision_are_refused() {
    for high in [1e300, 3e38] {
        let mut grid = slanted(4, 4);
        grid.values[5] = high;
        grid.values[6] = -high;
        for simulator in Simulator::ALL {
            let found = resampled(&grid, simulator).unwrap_err().to_string();
            assert!(found.contains("e38 m does not fit in single") || found.contains("1e300 m does"), "{found}");
        }
    }
    let mut grid = slanted(4, 4);
    grid.values[5] = 1e300;
    for name in ["a.tif", "a.obj", "a.glb", "a.usda"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let found = crate::dem::write(&path, &grid, &Default::default(), &Default::default()).unwrap_err().to_string();
        assert!(found.ends_with("the height 1e300 m does not fit in single precision") && !path.exists(), "{found}");
    }
}

/// Gazebo's collision mesh keeps millimetres of relief at high elevation, and is aligned with the heightmap.
#[test]
fn val_small_relief_high_up_is_kept() {
    let geometry = Geometry { rows: 50, cols: 65, cell: [0.5; 2], origin: [1000.0, -20.0] };
    let height = |k: usize| 6000.0 + 0.0275 * ((k * 7919) % 3250) as f64 / 3249.0;
    let grid = Grid::new(geometry, (0..3250).map(height).collect());
    let export = resampled(&grid, Simulator::Gazebo).unwrap();
    let text = |name: &str| {
        let (_, bytes) = export.files.iter().find(|(file, _)| file == name).unwrap();
        String::from_utf8(bytes.clone()).unwrap()
    };
    let collision = text("collision.obj");
    let heights = collision.lines().filter(|line| line.starts_with("v ")).filter_map(|line| line.split(' ').nth(3));
    let distinct = heights.collect::<std::collections::HashSet<_>>();
    assert!(distinct.len() > 10_000 && distinct.contains("0"), "{} heights", distinct.len());
    let [x, y] = posts(&grid, Simulator::Gazebo, Fit::Resample).unwrap().centre_m();
    let poses = [format!("<pose>{x} {y} 6000 0 0 0</pose>"), format!("<pose>-{x} -{y} 0 0 0 0</pose>")];
    assert!(poses.iter().all(|pose| text("model.sdf").contains(pose)), "{}", text("model.sdf"));
}

/// An export that fails leaves the earlier one as it was; one that succeeds replaces its files, and no others.
#[test]
fn val_failed_exports_leave_the_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let [old, new] = [4, 5].map(|side| resampled(&slanted(side, side), Simulator::Mujoco).unwrap());
    let holds = |export: &Export, but: &str| {
        let mut files = export.files.iter().filter(|(name, _)| name != but);
        files.all(|(name, bytes)| fs::read(out.join(name)).is_ok_and(|found| found == *bytes))
    };
    write(&out, &old).unwrap();
    assert!(holds(&old, ""));
    // The last file cannot be written.
    let (last, _) = new.files.iter().rfind(|(name, _)| name != IMPORT).unwrap();
    fs::remove_file(out.join(last)).unwrap();
    fs::create_dir_all(out.join(last).join("in the way")).unwrap();
    let refused = write(&out, &new).unwrap_err().to_string();
    assert!(refused.contains("is a folder, but the export has a file of that name"), "{refused}");
    assert!(holds(&old, last) && out.join(last).join("in the way").is_dir());
    assert_eq!(fs::read_dir(&out).unwrap().count(), old.files.len(), "nothing else is left");
    assert!(check_folder(&out, Simulator::Mujoco).is_ok());
    fs::remove_dir_all(out.join(last)).unwrap();
    fs::write(out.join("notes.txt"), "mine").unwrap();
    write(&out, &new).unwrap();
    assert!(holds(&new, "") && out.join("notes.txt").is_file());
    assert_eq!(fs::read_dir(&out).unwrap().count(), new.files.len() + 1);
}

/// A link in place of a file of an export stays, and so does the earlier export.
#[cfg(unix)]
#[test]
fn val_links_in_an_export_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let [out, kept] = ["out", "kept"].map(|name| folder.path().join(name));
    let [old, new] = [4, 5].map(|side| resampled(&slanted(side, side), Simulator::Mujoco).unwrap());
    write(&out, &old).unwrap();
    fs::write(&kept, "kept").unwrap();
    fs::remove_file(out.join(README)).unwrap();
    std::os::unix::fs::symlink(&kept, out.join(README)).unwrap();
    let refused = write(&out, &new).unwrap_err();
    let words = "README.md: is a symbolic link, which the output would replace";
    assert!(matches!(refused, DemError::Unfit { .. }) && refused.to_string().contains(words), "{refused}");
    assert!(out.join(README).is_symlink() && fs::read_to_string(&kept).unwrap() == "kept");
    assert_eq!(fs::read_dir(&out).unwrap().count(), old.files.len(), "nothing else is left");
    let others = old.files.iter().filter(|(name, _)| name != README);
    others.for_each(|(name, bytes)| assert!(fs::read(out.join(name)).unwrap() == *bytes, "{name}"));
}

/// A pipe in place of the description of an export is not read, which could block for ever.
#[cfg(unix)]
#[test]
fn val_pipes_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    assert!(std::process::Command::new("mkfifo").arg(folder.path().join(IMPORT)).status().unwrap().success());
    let refused = check_folder(folder.path(), Simulator::Isaac).unwrap_err().to_string();
    assert!(refused.ends_with("the folder has files but no export for isaac; choose a new folder"), "{refused}");
}

/// A folder is reused only for the same simulator, and never if it has unrelated files.
#[test]
fn val_folders_with_other_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let refused = |simulator| check_folder(&out, simulator).err().map(|e| e.to_string());
    assert_eq!(refused(Simulator::Isaac), None);
    fs::create_dir(&out).unwrap();
    fs::write(out.join(".sastrugi-partial-1-0"), b"left").unwrap();
    assert_eq!(refused(Simulator::Isaac), None, "a file under construction");
    fs::write(out.join(README), b"mine").unwrap();
    let found = refused(Simulator::Isaac).unwrap_or_default();
    assert!(found.ends_with("the folder has files but no export for isaac; choose a new folder"), "{found}");
    for other in ["[]", "{\"program\": \"blender/4\", \"target\": \"isaac\"}", "{\"target\": \"isaac\"}"] {
        fs::write(out.join(IMPORT), other).unwrap();
        assert!(refused(Simulator::Isaac).is_some(), "{other}");
    }
    fs::remove_dir_all(&out).unwrap();
    write(&out, &resampled(&slanted(4, 4), Simulator::Isaac).unwrap()).unwrap();
    assert_eq!(refused(Simulator::Isaac), None);
    assert!(refused(Simulator::Mujoco).is_some());
    fs::write(out.join(IMPORT), "{\"program\": \"sastrugi/0.0.9\", \"target\": \"isaac\"}").unwrap();
    assert_eq!(refused(Simulator::Isaac), None, "another version");
}

/// Costs are computed from posts, not from the cells of the DEM.
#[test]
fn val_costs_count_posts() {
    let cost =
        |rows, cols, simulator| check_size(&Geometry::square(rows, cols, 0.1), simulator, Fit::Resample).unwrap();
    assert_eq!(cost(30, 1026, Simulator::Gazebo), cost(2049, 2049, Simulator::Gazebo));
    assert_eq!(cost(3, 4097, Simulator::Unreal), cost(8129, 8129, Simulator::Unreal));
    assert_eq!(cost(40, 50, Simulator::Isaac), cost(50, 40, Simulator::Isaac));
    for simulator in Simulator::ALL {
        let grid = slanted(129, 129);
        let files: usize = resampled(&grid, simulator).unwrap().files.iter().map(|(_, bytes)| bytes.len()).sum();
        let stated = cost(129, 129, simulator).file_bytes as f64;
        // Text files add to the heights.
        assert!((files as f64) < 1.1 * stated + 8e3 && files as f64 > 0.3 * stated, "{}: {files}", simulator.name());
    }
}

/// The scene of a DEM in degrees is not a shift of the DEM's coordinates, and the files say so.
#[test]
fn val_degrees_have_no_shift() {
    let grid = slanted(4, 4);
    let found = numbers(&resampled(&grid, Simulator::Mujoco).unwrap());
    assert_eq!(found["scene"]["dem_minus_scene_m"], json!([1000.0, -20.0]));
    let export = export_from_degrees(&grid, Simulator::Mujoco, Fit::Resample, None).unwrap();
    assert!(numbers(&export)["scene"]["dem_minus_scene_m"].is_null());
    let (_, readme) = export.files.iter().find(|(name, _)| name == README).unwrap();
    assert!(String::from_utf8_lossy(readme).contains("corner of the DEM, which is in degrees;"));
}

proptest! {
    /// For any heights, levels cover the full range, and rounded scales are large enough.
    #[test]
    fn prop_levels_cover_every_height(
        heights in prop::collection::vec(-9e3f64..9e3, 9), scale in 1e-3f64..1.0,
    ) {
        let grid = Grid::new(Geometry::square(3, 3, 0.1), heights.iter().map(|z| z * scale).collect());
        for simulator in [Simulator::Unreal, Simulator::Unity, Simulator::Gazebo] {
            let posts = posts(&grid, simulator, Fit::Resample).unwrap();
            let found = numbers(&resampled(&grid, simulator).unwrap());
            let level = &found["settings"]["height_of_level"];
            let (offset, step) = (level["offset_m"].as_f64().unwrap(), level["step_m"].as_f64().unwrap());
            let rounding = 1e-9 * posts.high_m.abs().max(posts.low_m.abs());
            prop_assert!(offset - 0.5 * step <= posts.low_m + rounding);
            prop_assert!(offset + 65535.5 * step >= posts.high_m - rounding);
            prop_assert!(step <= 1.001 * (posts.relief_m() + 0.002) / 65534.0);
        }
    }

    #[test]
    fn prop_rounding_up_keeps_six_digits(value in 1e-9f64..1e9) {
        let rounded = levels::rounded_up(value);
        prop_assert!(rounded >= value && rounded < value * (1.0 + 3e-5));
        // A digit, a point and five digits.
        let text = format!("{rounded:e}");
        prop_assert!(text.split('e').next().unwrap().len() <= 7);
    }
}
