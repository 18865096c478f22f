use super::*;
use proptest::prelude::*;
use std::fs;

fn of(text: &str, options: &TransectOptions) -> Result<Transects, DemError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("profile.csv");
    fs::write(&path, text).unwrap();
    read(&path, options)
}

fn plain(text: &str) -> Transects {
    of(text, &TransectOptions::default()).unwrap()
}

fn every(spacing_m: f64) -> TransectOptions {
    TransectOptions { spacing_m: Some(spacing_m), ..TransectOptions::default() }
}

#[test]
fn val_distances_by_name_or_by_even_steps() {
    let expected = [vec![1.0, 1.5, -2.0], vec![4.0, 5.0, 6.25]];
    for text in [
        "Upwind_distance(m) a b\n0.5,1,4\n1,1.5,5\n1.5,-2,6.25\n",
        "\u{feff}\"x\";a;b\r\n0.5;1;4\r\n1;1.5;5\r\n1.5;-2;6.25\r\n\r\n",
        "x\ta\tb\n1.5\t1\t4\n1\t1.5\t5\n0.5\t-2\t6.25",
        "# made by hand\nstation [m], a, b\n10, 1, 4\n# a rest\n10.5, 1.5, 5\n11, -2, 6.25\n",
    ] {
        let found = plain(text);
        assert_eq!((found.spacing_m, &found.profiles[..]), (0.5, &expected[..]), "{text}");
        assert_eq!(found.names, ["a", "b"]);
    }
    let bare = plain("0.5 1 4\n1 1.5 5\n1.5 -2 6.25\n");
    assert_eq!((bare.spacing_m, &bare.profiles[..]), (0.5, &expected[..]));
    assert_eq!(bare.names, ["profile 1", "profile 2"]);
}

#[test]
fn val_heights_alone_need_a_spacing() {
    let one = of("1\n2\nnan\n4\n", &every(0.1)).unwrap();
    assert_eq!((one.spacing_m, one.profiles.len(), one.names[0].as_str()), (0.1, 1, "profile 1"));
    assert!(one.profiles[0][2].is_nan() && one.profiles[0][3] == 4.0);
    let error = of("1\n2\n3\n", &TransectOptions::default()).unwrap_err();
    assert!(!error.unusable_input() && error.to_string().contains("spacing"), "{error}");
    // Heights that happen to rise evenly.
    let ramp = TransectOptions { distance_column: Some(false), ..every(2.0) };
    assert_eq!(of("1 5\n2 7\n3 6\n", &ramp).unwrap().profiles.len(), 2);
    assert_eq!(of("1 5\n2 7\n3 6\n", &TransectOptions::default()).unwrap().profiles.len(), 1);
    // Uneven first columns without a name are heights.
    assert_eq!(of("1 5\n2 7\n3.1 6\n", &every(2.0)).unwrap().profiles.len(), 2);
}

#[test]
fn val_missing_heights() {
    let found = plain("x,a,b\n0,,1\n1,NA,-9999\n2,3,-\n3,4,NaN\n");
    let missing = |heights: &[f64]| heights.iter().map(|z| z.is_nan()).collect::<Vec<_>>();
    assert_eq!(missing(&found.profiles[0]), [true, true, false, false]);
    assert_eq!(missing(&found.profiles[1]), [false, true, true, true]);
}

#[test]
fn val_refusals_name_the_place() {
    for (text, words) in [
        ("", "no line of heights"),
        ("x,a\n", "no line of heights"),
        ("x,a\n0,1\n1,two\n2,3\n", "line 3, column 2: \"two\" is no number"),
        ("1,abc\n", "line 1, column 2: \"abc\""),
        ("x;a\n0;1,5\n", "line 2, column 2: \"1,5\" is no number; decimals are written with a point"),
        ("x,a\n0,inf\n1,2\n", "line 2, column 2: \"inf\" is not finite"),
        ("x,a\n\n# rest\n0,1\n1,2,3\n", "line 5 has 3 columns; the lines before have 2"),
        ("x,a,b\n0,1\n1,2\n", "names 3 columns; line 2 has 2"),
        ("x,a\n0,1\n1,2\n3,4\n4,5\n", "line 3, column 1: the distance is off its even place"),
        ("x,a\n0,1\nnan,2\n2,4\n", "line 3, column 1"),
        ("x,a\n5,1\n5,2\n5,4\n", "line 2, column 1"),
        ("x,a\n0,1\n", "one line only"),
        ("x,a,b\n0,1,\n1,2,\n", "profile 2 has no height"),
    ] {
        let error = of(text, &TransectOptions::default()).unwrap_err();
        assert!(error.unusable_input() && error.to_string().contains(words), "{text:?}: {error}");
        assert!(error.to_string().contains("profile.csv"));
    }
    let bytes = Columns::parse(b"1,2\n\xff,3\n").err().unwrap();
    assert!(bytes.to_string().contains("byte 4"));
    let other = of("x,a\n0,1\n1,2\n", &every(2.0)).unwrap_err();
    assert!(!other.unusable_input() && other.to_string().contains("1 m apart, not 2 m"), "{other}");
    assert!(of("x,a\n0,1\n1,2\n", &every(1.0)).is_ok());
    assert!(of("1\n2\n", &every(-1.0)).unwrap_err().to_string().contains("above 0"));
    let only = TransectOptions { distance_column: Some(true), ..TransectOptions::default() };
    assert!(of("0\n1\n2\n", &only).unwrap_err().to_string().contains("distances only"));
    assert!(
        read(Path::new("nothing.csv"), &TransectOptions::default()).unwrap_err().to_string().contains("no such file")
    );
}

#[test]
fn val_what_may_be_a_transect() {
    let folder = tempfile::tempdir().unwrap();
    let is = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        looks_like(&path)
    };
    assert!(is("a.csv", "x,z\n") && is("a.TXT", "1\n2\n"));
    assert!(!is("a.tif", "x") && !is("grid.txt", "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n"));
}

/// Four profiles over ice, measured from the air: 200 heights every metre, first and last line as in the file.
#[test]
fn val_the_greenland_profiles() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/greenland_ice_profiles_S5_uav_1m.txt");
    if !path.exists() {
        eprintln!("skipped: ../shared/data/greenland_ice_profiles_S5_uav_1m.txt is absent");
        return;
    }
    assert!(looks_like(&path));
    let found = read(&path, &TransectOptions::default()).unwrap();
    assert_eq!(found.spacing_m, 1.0);
    assert_eq!(found.names, ["WD90(m)", "WD120(m)", "WD150(m)", "WD186(m)"]);
    assert!(found.profiles.iter().all(|p| p.len() == 200 && p.iter().all(|z| z.is_finite())));
    assert_eq!(found.profiles[0][0], 0.564916968345642);
    assert_eq!(found.profiles[3][199], -1.29122316837311);
}

proptest! {
    /// What is written is read back; whatever else is in the file, it is read or refused.
    #[test]
    fn prop_profiles_come_back(
        profiles in prop::collection::vec(prop::collection::vec(-1e3f64..1e3, 12), 1..5),
        spacing in prop::sample::select(vec![0.01, 0.1, 1.0 / 3.0, 1.0, 25.0]),
        mark in prop::sample::select(vec![",", ";", "\t", " "]),
    ) {
        let line = |k: usize| {
            let heights = profiles.iter().map(|p| p[k].to_string());
            [(k as f64 * spacing).to_string()].into_iter().chain(heights).collect::<Vec<_>>().join(mark)
        };
        let found = plain(&(0..12).map(|k| line(k) + "\n").collect::<String>());
        prop_assert!((found.spacing_m - spacing).abs() < 1e-12);
        prop_assert_eq!(found.profiles, profiles);
    }

    #[test]
    fn prop_any_text_is_read_or_refused(text in "[0-9a-z,;.\\-# \t\n\"]{0,80}", cell in 0.0f64..2.0) {
        let _ = of(&text, &every(cell));
        let _ = of(&text, &TransectOptions::default());
    }
}
