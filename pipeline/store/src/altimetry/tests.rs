use super::*;
use proptest::prelude::*;

const POINTS: [[f64; 4]; 2] = [[500_000.25, -3.5, 12.0, 0.1], [1e3, 2.0, -7.25, 0.0]];

#[test]
fn val_columns_by_name_or_by_position() {
    for text in [
        "x,y,z,sigma\n500000.25,-3.5,12,0.1\n1000,2,-7.25,\n",
        "\u{feff}# laser\r\n\"Z_m\";X;track;SIGMA_m;\"y\"\r\n12;500000.25;a;0.1;-3.5\r\n\r\n-7.25;1e3;b;;2\r\n",
        "500000.25 -3.5 12 0.1\n1000 2 -7.25 0",
        "x\ty\tz\tsigma\n# a rest\n500000.25\t-3.5\t12\t0.1\n1000\t2\t-7.25\t0\n",
    ] {
        assert_eq!(parse(text.as_bytes()).unwrap(), POINTS, "{text}");
    }
    let exact = parse(b"x y z\n1 2 3\n4 5 6\n").unwrap();
    assert_eq!(exact, [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]);
    assert_eq!(parse(b"1,2,3\n4,5,6\n").unwrap(), exact);
}

#[test]
fn val_unusable_tables_are_refused() {
    for (text, words) in [
        ("", "has no points"),
        ("x,y,z\n", "has no points"),
        ("east,north,height\n1,2,3\n", "has no column `x`; found east, north, height"),
        ("x,y,sigma\n1,2,3\n", "has no column `z`"),
        ("x,y,z\n1,2,3\n4,,6\n", "line 3, column 2: \"\" is not a finite number"),
        ("1,2,3\n4,5\n", "line 2, column 3"),
        ("x;y;z\n1,5;2;3\n", "line 2, column 1: \"1,5\""),
        ("x,y,z,sigma\n1,2,inf,0\n", "column 3: \"inf\""),
        ("x,y,z,sigma\n1,2,3,unknown\n", "column 4: \"unknown\""),
    ] {
        let message = parse(text.as_bytes()).unwrap_err().about(Path::new("laser.csv")).to_string();
        assert!(message.contains(words), "{text}: {message}");
    }
    assert!(parse(b"x,y,z\n\xff,2,3").is_err());
    assert!(read(Path::new("nowhere.csv")).is_err());
}

proptest! {
    /// A damaged number is refused with its place, whatever the column; a missing standard error is 0.
    #[test]
    fn prop_damaged_points_are_refused_with_the_place(
        points in proptest::collection::vec(proptest::array::uniform4(-1e9..1e9), 1..20),
        line in any::<proptest::sample::Index>(),
        column in 0usize..4,
        damage in proptest::sample::select(vec!["", "inf", "NaN", "1.5.2", "rock"]),
    ) {
        let line = line.index(points.len());
        let mut fields: Vec<[String; 4]> = points.iter().map(|p| p.map(|v| format!("{v:?}"))).collect();
        fields[line][column] = damage.to_owned();
        let text: String = fields.iter().map(|fields| fields.join(",") + "\n").collect();
        let found = parse(format!("x,y,z,sigma\n{text}").as_bytes());
        if damage.is_empty() && column == 3 {
            let mut expected = points.clone();
            expected[line][3] = 0.0;
            prop_assert_eq!(found.unwrap(), expected);
        } else {
            let words = format!("line {}, column {}: \"{damage}\" is not a finite number", line + 2, column + 1);
            prop_assert_eq!(found.unwrap_err().to_string(), words);
        }
    }

    /// Numbers are read back exactly as written.
    #[test]
    fn prop_points_read_back(points in proptest::collection::vec(proptest::array::uniform4(-1e9..1e9), 1..20)) {
        let line = |p: &[f64; 4]| p.map(|v| format!("{v:?}")).join(",") + "\n";
        let text: String = points.iter().map(line).collect();
        prop_assert_eq!(parse(text.as_bytes()).unwrap(), points);
    }
}
