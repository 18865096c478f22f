use super::*;
use proptest::prelude::*;

const POINTS: [[f64; 4]; 2] = [[500_000.25, -3.5, 12.0, 0.1], [1e3, 2.0, -7.25, 0.0]];

#[test]
fn val_columns_by_name_or_by_place() {
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
        ("", "holds no point"),
        ("x,y,z\n", "holds no point"),
        ("east,north,height\n1,2,3\n", "has no column `x`; it has east, north, height"),
        ("x,y,sigma\n1,2,3\n", "has no column `z`"),
        ("x,y,z\n1,2,3\n4,,6\n", "line 3, column 2: \"\" is not a finite number"),
        ("1,2,3\n4,5\n", "line 2, column 3"),
        ("x;y;z\n1,5;2;3\n", "line 2, column 1: \"1,5\""),
        ("x,y,z,sigma\n1,2,inf,0\n", "column 3: \"inf\""),
        ("x,y,z,sigma\n1,2,3,unknown\n", "column 4: \"unknown\""),
    ] {
        let said = parse(text.as_bytes()).unwrap_err().about(Path::new("laser.csv")).to_string();
        assert!(said.contains(words), "{text}: {said}");
    }
    assert!(parse(b"x,y,z\n\xff,2,3").is_err());
    assert!(read(Path::new("nowhere.csv")).is_err());
}

proptest! {
    /// Whatever the bytes, reading ends, with finite numbers or an error.
    #[test]
    fn prop_any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(points) = parse(&bytes) {
            prop_assert!(points.iter().flatten().all(|v| v.is_finite()));
        }
    }

    /// Numbers read back as they were written.
    #[test]
    fn prop_points_read_back(points in proptest::collection::vec(proptest::array::uniform4(-1e9..1e9), 1..20)) {
        let line = |p: &[f64; 4]| p.map(|v| format!("{v:?}")).join(",") + "\n";
        let text: String = points.iter().map(line).collect();
        prop_assert_eq!(parse(text.as_bytes()).unwrap(), points);
    }
}
