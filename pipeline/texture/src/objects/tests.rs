use super::*;
use sastrugi_numeric::Streams;

const COLS: usize = 200;

fn noise() -> Vec<f64> {
    let mut s = Streams::for_seed(1, "objects-test").stream("field");
    (0..COLS * COLS).map(|_| s.normal()).collect()
}

/// White normal cells: 40 000 cells, chance of any beyond 5 standard deviations 2.3 %; this field has none.
#[test]
fn val_a_surface_without_objects_is_left_alone() {
    let object = find(&noise(), COLS, BoxWindow { half: [8, 8] });
    assert_eq!(object.iter().filter(|&&o| o).count(), 0);
}

/// A cone 20 standard deviations high is found down to its skirt, but not the cells around it, which lie below the moving
/// average that it raises.
#[test]
fn val_a_tree_is_found_completely() {
    let mut values = noise();
    let distance = |k: usize| (((k / COLS) as f64 - 100.0), ((k % COLS) as f64 - 90.0));
    let radius = |k: usize| {
        let (y, x) = distance(k);
        (x * x + y * y).sqrt()
    };
    for (k, v) in values.iter_mut().enumerate() {
        *v += (20.0 * (1.0 - radius(k) / 6.0)).max(0.0);
    }
    let object = find(&values, COLS, BoxWindow { half: [8, 8] });
    assert!((0..values.len()).filter(|&k| radius(k) < 4.0).all(|k| object[k]));
    assert!((0..values.len()).filter(|&k| radius(k) > 12.0).all(|k| !object[k]));
}

#[test]
fn val_no_data_and_constant_rasters() {
    let window = BoxWindow { half: [1, 1] };
    assert!(find(&[], 1, window).is_empty());
    assert_eq!(find(&[f64::NAN; 9], 3, window), vec![false; 9]);
    assert_eq!(find(&[4.0; 9], 3, window), vec![false; 9]);
}

/// Slopes (a third of the raster) whose texture is ten times that of the flats around them have no objects; a cone that stands
/// out from its own surroundings is found on flats and slopes alike.
#[test]
fn val_rough_places_are_not_objects() {
    let rough = |k: usize| if k % COLS < COLS / 3 { 10.0 } else { 1.0 };
    let mut values: Vec<f64> = noise().iter().enumerate().map(|(k, v)| rough(k) * v).collect();
    let window = BoxWindow { half: [8, 8] };
    assert_eq!(find(&values, COLS, window).iter().filter(|&&o| o).count(), 0);
    let tops = [100 * COLS + 30, 60 * COLS + 140];
    for top in tops {
        for (k, v) in values.iter_mut().enumerate() {
            let (y, x) = ((k / COLS).abs_diff(top / COLS) as f64, (k % COLS).abs_diff(top % COLS) as f64);
            *v += (20.0 * rough(top) * (1.0 - (x * x + y * y).sqrt() / 6.0)).max(0.0);
        }
    }
    let object = find(&values, COLS, window);
    assert!(tops.iter().all(|&top| object[top]));
    assert!(object.iter().filter(|&&o| o).count() < 2 * 250);
}

/// One line of cells: nine blocks along it.
#[test]
fn val_transects() {
    let mut values = noise()[..400].to_vec();
    values[200..206].iter_mut().for_each(|v| *v += 30.0);
    let object = find(&values, 400, BoxWindow { half: [0, 15] });
    assert!(object[200..206].iter().all(|o| *o));
    assert!(object.iter().filter(|&&o| o).count() < 12);
}

/// Lazily computed scales match the definition: medians of all blocks, then of nine around each.
#[test]
fn val_scales_equal_the_definition() {
    let rough = |k: usize| if k % COLS < COLS / 3 { 10.0 } else { 1.0 };
    let deviation: Vec<f64> = noise().iter().enumerate().map(|(k, v)| (rough(k) * v).abs()).collect();
    for window in [BoxWindow { half: [8, 8] }, BoxWindow { half: [40, 3] }, BoxWindow { half: [200, 5] }] {
        let scales = Scales::of(&deviation, COLS, window);
        let shape = [deviation.len() / COLS, COLS];
        let count = [0, 1].map(|k| (shape[k] / window.cells()[k]).max(1));
        let block = |k: usize| {
            let place = [k / COLS, k % COLS];
            [0, 1].map(|axis| (place[axis] / window.cells()[axis]).min(count[axis] - 1))
        };
        let mut own = vec![Vec::new(); count[0] * count[1]];
        deviation.iter().enumerate().for_each(|(k, d)| own[block(k)[0] * count[1] + block(k)[1]].push(*d));
        let own: Vec<f64> = own.into_iter().map(median).collect();
        let wide = (9 / count[0].min(3)).min(count[1]);
        let tall = (9 / wide).min(count[0]);
        let raster = Sizes::of(&deviation).exceeded_by(0.5);
        for k in (0..deviation.len()).step_by(7) {
            let [row, col] = block(k);
            let near = around(row, tall, count[0]).flat_map(|r| around(col, wide, count[1]).map(move |c| (r, c)));
            let local = median(near.map(|(r, c)| own[r * count[1] + c]).collect());
            assert_eq!(scales.scale(k), NORMAL_CONSISTENCY * raster.max(local));
            assert_eq!(scales.exceeded(k, 2.5), deviation[k] > 2.5 * (NORMAL_CONSISTENCY * raster.max(local)));
        }
    }
}
