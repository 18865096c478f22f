use super::*;
use proptest::prelude::*;
use proptest::sample::Index;
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
fn val_errors_give_line_and_column() {
    for (text, words) in [
        ("", "no lines of heights"),
        ("x,a\n", "no lines of heights"),
        ("x,a\n0,1\n1,two\n2,3\n", "line 3, column 2: \"two\" is not a number"),
        ("1,abc\n", "line 1, column 2: \"abc\""),
        ("x;a\n0;1,5\n", "line 2, column 2: \"1,5\" is not a number; use a decimal point"),
        ("x,a\n0,inf\n1,2\n", "line 2, column 2: \"inf\" is not finite"),
        ("x,a\n\n# rest\n0,1\n1,2,3\n", "line 5 has 3 columns; the lines before it have 2"),
        ("x,a\n0,1\n2\n", "line 3 has 1 column; the lines before it have 2"),
        ("x,a,b\n0,1\n1,2\n", "names 3 columns, but line 2 has 2"),
        ("x\n0,1\n1,2\n", "names 1 column, but line 2 has 2"),
        ("x,a\n0,1\n1,2\n3,4\n4,5\n", "line 3, column 1: distances are not evenly spaced"),
        ("x,a\n0,1\nnan,2\n2,4\n", "line 3, column 1"),
        ("x,a\n5,1\n5,2\n5,4\n", "line 2, column 1"),
        ("x,a\n0,1\n", "only one line"),
        ("x,a,b\n0,1,\n1,2,\n", "profile 2 has no heights"),
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
    assert!(of("0\n1\n2\n", &only).unwrap_err().to_string().contains("only distances"));
    assert!(
        read(Path::new("nothing.csv"), &TransectOptions::default()).unwrap_err().to_string().contains("no such file")
    );
}

#[test]
fn val_transects_are_recognised_by_ending() {
    let folder = tempfile::tempdir().unwrap();
    let is = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        looks_like(&path)
    };
    assert!(is("a.csv", "x,z\n") && is("a.TXT", "1\n2\n"));
    assert!(!is("a.tif", "x") && !is("grid.txt", "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n"));
}

/// The form of a published table of four profiles: names separated by blanks, values by commas, distances that start half a spacing
/// from zero, 15 digits.
#[test]
fn val_a_table_in_its_published_form() {
    let height = |profile: usize, k: usize| (1000 * profile + k) as f64 / 7.0 - 12.0;
    let line = |k: usize| {
        let heights = (0..4).map(|profile| format!("{:.15}", height(profile, k)));
        [format!("{k}.5")].into_iter().chain(heights).collect::<Vec<_>>().join(",") + "\n"
    };
    let values: String = (0..200).map(line).collect();
    let found = plain(&format!("Upwind_distance(m) WD90(m) WD120(m) WD150(m) WD186(m)\n{values}"));
    assert_eq!(found.spacing_m, 1.0);
    assert_eq!(found.names, ["WD90(m)", "WD120(m)", "WD150(m)", "WD186(m)"]);
    assert_eq!(found.profiles.iter().map(Vec::len).collect::<Vec<_>>(), [200; 4]);
    for (profile, heights) in found.profiles.iter().enumerate() {
        assert!(heights.iter().enumerate().all(|(k, z)| (z - height(profile, k)).abs() < 1e-12), "{profile}");
    }
}

/// What is wrong with a table.
#[derive(Clone, Copy, Debug)]
enum Damage {
    Nothing,
    /// A height that is a word.
    Word(Index, Index),
    /// A line with one field more than the others.
    Field(Index),
    /// A line that is missing.
    Gap(Index),
    /// A height that is marked as missing.
    NoHeight(Index, Index),
}

/// A table whose first column holds distances half a metre apart.
#[derive(Clone, Debug)]
struct Table {
    text: String,
    /// The heights by profile, or words of the refusal.
    expected: Result<Vec<Vec<f64>>, String>,
}

/// The table of some lines of heights, with or without names.
fn table(mut heights: Vec<[f64; 3]>, mark: &str, named: bool, damage: Damage) -> Table {
    let mut fields: Vec<Vec<String>> = heights
        .iter()
        .enumerate()
        .map(|(k, heights)| [0.5 * k as f64].iter().chain(heights).map(f64::to_string).collect())
        .collect();
    // Number of the first line of values.
    let first = 1 + usize::from(named);
    let refusal = match damage {
        Damage::Nothing => None,
        Damage::NoHeight(line, column) => {
            let (line, column) = (line.index(fields.len()), column.index(3));
            fields[line][1 + column] = "NA".to_owned();
            heights[line][column] = f64::NAN;
            None
        }
        Damage::Word(line, column) => {
            let (line, column) = (line.index(fields.len()), 1 + column.index(3));
            fields[line][column] = "rock".to_owned();
            Some(format!("line {}, column {}: \"rock\" is not a number", first + line, column + 1))
        }
        Damage::Field(line) => {
            let line = 1 + line.index(fields.len() - 1);
            fields[line].push("7".to_owned());
            Some(format!("line {} has 5 columns; the lines before it have 4", first + line))
        }
        Damage::Gap(line) => {
            fields.remove(1 + line.index(fields.len() - 2));
            // Without a name, a column of uneven steps is not a column of distances.
            Some(match named {
                true => format!("line {}, column 1: distances are not evenly spaced", first + 1),
                false => "has no column of distances".to_owned(),
            })
        }
    };
    let names = if named { vec![["x", "a", "b", "c"].map(str::to_owned).to_vec()] } else { vec![] };
    let text: String = names.iter().chain(&fields).map(|fields| fields.join(mark) + "\n").collect();
    let by_profile: Vec<Vec<f64>> = (0..3).map(|column| heights.iter().map(|line| line[column]).collect()).collect();
    Table { text, expected: refusal.map_or(Ok(by_profile), Err) }
}

fn tables() -> impl Strategy<Value = Table> {
    let heights = prop::collection::vec(prop::array::uniform3(-1e3..1e3f64), 4..30);
    let mark = prop::sample::select(vec![",", ";", "\t", " ", " ; "]);
    let damage = prop_oneof![
        3 => Just(Damage::Nothing),
        1 => any::<(Index, Index)>().prop_map(|(line, column)| Damage::Word(line, column)),
        1 => any::<Index>().prop_map(Damage::Field),
        1 => any::<Index>().prop_map(Damage::Gap),
        2 => any::<(Index, Index)>().prop_map(|(line, column)| Damage::NoHeight(line, column)),
    ];
    (heights, mark, any::<bool>(), damage)
        .prop_map(|(heights, mark, named, damage)| table(heights, mark, named, damage))
}

proptest! {
    /// Written profiles are read back exactly.
    #[test]
    fn prop_profiles_are_read_back(
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

    /// Heights are read back bit for bit, missing ones as NaN; a damaged table is refused with line and column.
    #[test]
    fn prop_tables_are_read_back_or_refused_with_the_place(table in tables()) {
        let bits = |profiles: &[Vec<f64>]| -> Vec<Vec<Option<u64>>> {
            profiles.iter().map(|p| p.iter().map(|z| (!z.is_nan()).then_some(z.to_bits())).collect()).collect()
        };
        match (of(&table.text, &TransectOptions::default()), &table.expected) {
            (Ok(found), Ok(profiles)) => {
                prop_assert_eq!(found.spacing_m, 0.5);
                prop_assert_eq!(bits(&found.profiles), bits(profiles));
            }
            (Err(error), Err(words)) => {
                let message = error.to_string();
                prop_assert!(message.contains(words.as_str()) && message.contains("profile.csv"), "{}", message);
            }
            (found, expected) => prop_assert!(false, "found {:?}, expected {:?}", found, expected),
        }
    }
}
