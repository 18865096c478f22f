//! Images of a planetary surface of 1024 x 1024 cells, compared with a floor: one pass of shading.
//!
//! The floor reads three heights per cell and computes its brightness, which every image needs. A nadir image adds a ray and a march to the
//! sun for every sample; oblique and pinhole views march along the ray too. Run one-threaded:
//! `RAYON_NUM_THREADS=1 cargo bench -p sastrugi-benches --bench imaging`.

use divan::Bencher;
use divan::counter::ItemsCount;
use sastrugi_imaging::{CameraParameters, RenderParameters, Scene, Sun, render};
use sastrugi_numeric::{Grid, Streams};
use serde_json::json;

const SIDE: usize = 1024;

fn main() {
    divan::main();
}

fn heights() -> Grid {
    let processes = json!([{"kind": "texture"}, {"kind": "rocks", "coverage": 0.176}]);
    let params = json!({"cell_m": 0.02, "basic_spacing_m": 0.01, "size_px": [SIDE, SIDE], "processes": processes});
    let generator = sastrugi_terrain::prepare("planetary", &params).expect("the bench's own parameters are valid");
    generator.generate(&Streams::for_seed(1, "terrain"), &[]).expect("the bench's own surface").heights
}

fn parameters(camera: CameraParameters, shadows: bool) -> RenderParameters {
    let sun = Sun { azimuth_deg: 110.0, elevation_deg: 30.0 };
    RenderParameters { sun, camera, samples: 1, shadows, ..RenderParameters::default() }
}

fn bench(bencher: Bencher, parameters: &RenderParameters) {
    let (heights, streams) = (heights(), Streams::for_seed(1, "image"));
    bencher
        .counter(ItemsCount::new(SIDE * SIDE))
        .bench(|| render(&Scene { heights: &heights, albedo: None }, parameters, &streams));
}

fn oblique(size_px: Option<[usize; 2]>) -> CameraParameters {
    let (azimuth_deg, elevation_deg) = (200.0, 40.0);
    CameraParameters::Parallel { azimuth_deg, elevation_deg, pixel_m: Some(0.02), size_px, target_m: None }
}

/// The floor.
#[divan::bench(sample_count = 10)]
fn one_pass_of_shading(bencher: Bencher) {
    let heights = heights();
    let p = parameters(CameraParameters::default(), false);
    let (light, view) = (p.sun.direction(), [0.0, 0.0, 1.0]);
    bencher.counter(ItemsCount::new(SIDE * SIDE)).bench(|| {
        let cell = heights.geometry.cell;
        let brightness = |r: usize, c: usize| {
            let z = heights.at(r, c);
            let slopes = [(heights.at(r, c + 1) - z) / cell[0], (heights.at(r - 1, c) - z) / cell[1]];
            p.albedo * p.photometry.of_slopes(slopes, light, view)
        };
        let cells = (1..SIDE).flat_map(|r| (0..SIDE - 1).map(move |c| (r, c)));
        cells.map(|(r, c)| brightness(r, c)).collect::<Vec<f64>>()
    });
}

#[divan::bench(sample_count = 10)]
fn nadir_without_shadows(bencher: Bencher) {
    bench(bencher, &parameters(CameraParameters::default(), false));
}

#[divan::bench(sample_count = 10)]
fn nadir(bencher: Bencher) {
    bench(bencher, &parameters(CameraParameters::default(), true));
}

/// As many pixels as the surface has cells.
#[divan::bench(sample_count = 10)]
fn oblique_parallel(bencher: Bencher) {
    bench(bencher, &parameters(oblique(Some([SIDE, SIDE])), true));
}

/// A rover's view.
#[divan::bench(sample_count = 10)]
fn pinhole(bencher: Bencher) {
    let camera = CameraParameters::Pinhole {
        position_m: [10.0, 0.5, 0.3],
        target_m: [10.0, 10.0, 0.0],
        above_ground: true,
        field_of_view_deg: 60.0,
        size_px: [SIDE, SIDE],
    };
    bench(bencher, &parameters(camera, true));
}
