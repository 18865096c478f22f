use super::*;
use sastrugi_numeric::Geometry;
use sastrugi_schemas::{Cell, ColumnType};

/// A sample of a vehicle that heads east; every other column holds the number of its position. Four wheels.
fn sample(number: i64, fps: u32) -> SampleRow {
    let cell = |(k, column): (usize, &sastrugi_schemas::Column)| match column.column_type {
        ColumnType::Text => Cell::Text("a".to_owned()),
        ColumnType::F64 => Cell::F64(k as f64),
        ColumnType::I64 => Cell::I64(number),
        ColumnType::Bool => Cell::Bool(true),
        ColumnType::F32List => Cell::F32List(vec![k as f32; 4]),
        ColumnType::F64List => Cell::F64List(vec![k as f64; 4]),
    };
    let row = SampleRow::from_cells(SampleRow::TABLE.columns.iter().enumerate().map(cell).collect()).unwrap();
    let time_s = number as f64 / f64::from(fps);
    SampleRow { time_s, x_m: 4.0 + 0.5 * number as f64, y_m: 4.0, z_m: 5.0, yaw_deg: 0.0, ..row }
}

/// A plane that rises by 1 m per metre to the east.
fn ground() -> Grid {
    let geometry = Geometry::square(8, 8, 1.0);
    Grid::new(geometry, (0..geometry.len()).map(|k| 100.0 + geometry.x(k % 8)).collect())
}

/// Every value of a frame has its name, and stands where its name says.
#[test]
fn val_values_stand_where_their_names_say() {
    let rows: Vec<SampleRow> = (0..3).map(|k| sample(k, 20)).collect();
    let shape = patch(2.0, 0.5).unwrap();
    let features = features(&shape, 4);
    let names = &features[0].names;
    let values = state(&rows);
    assert_eq!(names.len(), 3 + 17 + 7 * 4);
    assert_eq!(values.len(), 3 * names.len());
    let second = |name: &str| values[names.len() + names.iter().position(|known| known == name).unwrap()];
    assert_eq!([second("x_from_start_m"), second("y_from_start_m"), second("z_from_start_m")], [0.5, 0.0, 0.0]);
    for (name, _) in MEASURED.iter().filter(|(name, _)| *name != "yaw_deg") {
        let position = SampleRow::TABLE.position(name).unwrap();
        assert_eq!(second(name), position as f32, "{name}");
    }
    for (name, _) in OF_WHEELS {
        let position = SampleRow::TABLE.position(name).unwrap();
        assert_eq!(second(&format!("{name}[3]")), position as f32, "{name}");
    }
    let position = |name: &str| SampleRow::TABLE.position(name).unwrap() as f32;
    assert_eq!(commands(&rows[..1]), [position("command_speed_m_s"), position("command_yaw_rate_deg_s")]);
    assert_eq!(features[3].names, ["command_speed_m_s", "command_yaw_rate_deg_s"]);
    assert_eq!(features[1].shape, Shape::Matrix([4, 4]));
}

/// Heights count from the ground under the vehicle, wherever it stands; beyond the terrain they are 0 and unknown.
#[test]
fn val_patches_count_from_the_ground_under_the_vehicle() {
    let shape = patch(2.0, 0.5).unwrap();
    let row = |value: f32| vec![value; 4];
    let (heights, known) = patches(&[sample(0, 20)], &ground(), &shape);
    assert_eq!((heights, known), ([row(0.75), row(0.25), row(-0.25), row(-0.75)].concat(), vec![true; 16]));
    // At x = 7.25 m, the points farthest ahead lie at 8 m; the outer cell centres are at 7.5 m.
    let at_edge = SampleRow { x_m: 7.25, ..sample(0, 20) };
    let (heights, known) = patches(&[at_edge], &ground(), &shape);
    assert_eq!(heights, [row(0.0), row(0.25), row(-0.25), row(-0.75)].concat());
    assert_eq!(known, [vec![false; 4], vec![true; 12]].concat());
    // A vehicle that stands beyond the terrain knows nothing.
    let beyond = SampleRow { x_m: 7.75, ..sample(0, 20) };
    assert_eq!(patches(&[beyond], &ground(), &shape), (vec![0.0; 16], vec![false; 16]));
}

#[test]
fn val_uneven_samples_are_refused() {
    let even: Vec<SampleRow> = (0..4).map(|k| sample(k, 20)).collect();
    assert!(check_times(&even, 20).is_ok());
    let error = check_times(&even, 10).unwrap_err().to_string();
    let expected = "mission a on a: sample 1 is at 0.05 s, but 10 frames per second put it at 0.1 s; LeRobot requires a constant rate";
    assert_eq!(error, expected);
    assert!(check_times(&even[1..], 20).is_err());
}

#[test]
fn val_rates_are_whole() {
    assert_eq!(whole_rate(20.0).ok(), Some(20));
    for rate in [0.0, 0.5, 19.97, -1.0, f64::NAN, f64::INFINITY] {
        assert!(whole_rate(rate).is_err(), "{rate}");
    }
}

#[test]
fn val_a_patch_is_a_whole_number_of_cells() {
    assert_eq!(patch(PATCH_M, PATCH_CELL_M).unwrap().rows(), 32);
    let error = patch(1.0, 0.3).unwrap_err();
    assert!(matches!(&error, Error::Usage(message) if message.contains("whole number of cells, 1 to 512")), "{error}");
}

#[test]
fn val_notes_tell_what_was_left_out() {
    assert!(Counts::default().notes().is_empty());
    let notes = Counts { left_out: 2, points: 1000, unknown: 125 }.notes();
    assert!(notes[0].starts_with("left out 2 missions without commands"), "{notes:?}");
    assert!(notes[1].starts_with("12.50 % of the points"), "{notes:?}");
    let one = Counts { left_out: 1, ..Counts::default() }.notes();
    assert!(one[0].starts_with("left out 1 mission without commands"), "{one:?}");
}
