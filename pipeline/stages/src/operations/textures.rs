//! The memory that a texture needs, its addition to its base, and notes on the result.

use crate::error::Error;
use crate::job::JobError;
use crate::memory;
use sastrugi_numeric::{Geometry, Grid};
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::synth::fft_ma::{self, CovarianceOf};
use sastrugi_texture::synth::residual::NO_LONG_WAVES;
use sastrugi_texture::synth::tile::DEFAULT_CELL_M;
use sastrugi_texture::{Needs, Prospect};
use serde_json::{Value, json};

/// A texture with its heights multiplied by a factor.
pub fn scaled(texture: Grid, factor: f64) -> Grid {
    if factor == 1.0 { texture } else { texture.map(|height| factor * height) }
}

/// Whether a method can synthesise what a measured background lacks (`covariance = "residual"`): FFT-MA and those that repeat a site.
pub fn completes_background(method: &str) -> bool {
    method == fft_ma::kind().kind || sastrugi_texture::needs(method).is_some_and(|needs| needs != Needs::Covariance)
}

/// Sets the cells of a texture that repeats a site to those of the site, unless they are given.
pub fn on_site_cells(method: &str, parameters: &mut Value, cell_m: Option<[f64; 2]>) {
    let repeats = sastrugi_texture::needs(method).is_some_and(|needs| needs != Needs::Covariance);
    let (Some([x, y]), true, true) = (cell_m, repeats, parameters["cell_m"].is_null()) else { return };
    parameters["cell_m"] = if x == y { json!(x) } else { json!([x, y]) };
}

/// Refuses an FFT-MA texture of a measured covariance or of a residual for which memory is lacking, before it is bound to its fit: binding
/// transforms such a covariance on the complete torus.
///
/// # Errors
/// Parameters that the method refuses, too little memory.
pub fn check_memory(method: &str, parameters: &Value, fit: &FitFile) -> Result<(), Error> {
    let is_transformed = fit.map.is_some() || parameters["covariance"] == json!(CovarianceOf::Residual);
    if method != fft_ma::kind().kind || !is_transformed {
        return Ok(());
    }
    let prospect = Prospect {
        torus_m: 0.0,
        cell_m: fit.cell_m,
        cells: None,
        window_m: fit.window_m.unwrap_or_default(),
        is_measured: fit.map.is_some(),
        max_lag: fit.map.as_ref().map_or([0; 2], |map| map.max_lag),
        has_statistics: fit.statistics.is_some(),
    };
    let method = sastrugi_texture::method(method, parameters)?;
    method.check_prospect(&prospect)?;
    memory::check("the texture", method.cost_of(&prospect).memory_bytes)
}

/// Notes on a texture that fills holes, without the note on long waves: the surroundings of a hole supply them.
pub fn notes_on_filling(notes: Vec<String>) -> impl Iterator<Item = String> {
    notes.into_iter().filter(|note| !note.starts_with(NO_LONG_WAVES))
}

/// A note on holes filled by `method` with an empirical fit.
pub fn fill_note(fit: &FitFile, method: &str) -> Option<String> {
    let model = &fit.map.as_ref()?.model;
    Some(match sastrugi_texture::needs(method) {
        Some(Needs::Statistics | Needs::Residual) => {
            format!(
                "the fit is empirical; the fitted model ({model}) only weights the measured cells around a hole, which is filled with texture of the site"
            )
        }
        _ => format!(
            "the fit is empirical; holes are filled with the fitted model ({model}), not with the measured covariance"
        ),
    })
}

/// A note on a texture added to the DEM to which its model was fitted; `background` states where to find that DEM without its
/// texture.
pub fn has_its_texture(background: &str) -> String {
    format!(
        "the base is the fitted DEM, which still has its own texture; add the texture to the background of the fit instead \
         ({background}; in a release, fit/<id>.background.tif)"
    )
}

/// Adds a texture to a base. A texture that does not repeat without seams must cover the base.
///
/// # Errors
/// Different cell sizes, or a base larger than such a texture.
pub fn lay_onto(base: &Grid, texture: &Grid, periodic: bool, factors: Option<&Grid>) -> Result<Grid, JobError> {
    match uncovered(&base.geometry, &texture.geometry).filter(|_| !periodic) {
        Some(why) => Err(JobError::new(why)),
        None => sastrugi_texture::modulated_onto(base, texture, factors).map_err(JobError::new),
    }
}

/// Why a texture that does not repeat cannot be added to a base: it is smaller.
pub fn uncovered(base: &Geometry, texture: &Geometry) -> Option<String> {
    let larger = base.rows > texture.rows || base.cols > texture.cols;
    larger.then(|| {
        format!(
            "the base of {} x {} cells is larger than the texture of {} x {} cells, which does not repeat without seams; make the \
             texture larger or periodic",
            base.rows, base.cols, texture.rows, texture.cols
        )
    })
}

/// Sets the cells of a texture to those of its base, and its size too, where the study states neither and the default cells do not suit the base.
pub fn on_base_cells(base: &Geometry, parameters: &mut Value) {
    let suits = || sastrugi_texture::check_cells(base.cell, [DEFAULT_CELL_M; 2]).is_ok();
    if !parameters["cell_m"].is_null() || suits() {
        return;
    }
    let [x, y] = base.cell;
    parameters["cell_m"] = if x == y { json!(x) } else { json!([x, y]) };
    if !states_size(parameters) {
        on_base_size(base, parameters);
    }
}

/// Sets the size of a texture to that of its base.
pub fn on_base_size(base: &Geometry, parameters: &mut Value) {
    parameters["size_px"] = json!([base.cols, base.rows]);
}

/// Whether parameters of a texture state its size.
pub fn states_size(parameters: &Value) -> bool {
    ["size_m", "size_px"].iter().any(|key| !parameters[*key].is_null())
}

/// A doubt about a texture whose stated size is not that of its base, which has the same cells; `None` if it is.
pub fn size_doubt(base: &Geometry, texture: &Geometry) -> Option<String> {
    if [texture.rows, texture.cols] == [base.rows, base.cols] {
        return None;
    }
    let [[x, y], [base_x, base_y]] = [texture, base].map(|g| g.size().map(|side| (1e6 * side).round() / 1e6));
    let what = match uncovered(base, texture) {
        Some(_) => "repeats over its base of",
        None => "is cut to its base of",
    };
    let (cols, rows) = (base.cols, base.rows);
    Some(format!("{x} m x {y} m {what} {base_x} m x {base_y} m, whose size is `size_px = [{cols}, {rows}]`"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_schemas::fit::CovarianceMap;

    /// Cells that are not stated are the base's where the default of 0.1 m does not suit it, and then a size that is not stated is too.
    #[test]
    fn val_cells_follow_the_base() {
        let set = |cell: [f64; 2], parameters: Value| {
            let mut own = parameters;
            on_base_cells(&Geometry { rows: 30, cols: 40, cell, origin: [7.0, 9.0] }, &mut own);
            own
        };
        assert_eq!(set([0.05; 2], json!({})), json!({ "cell_m": 0.05, "size_px": [40, 30] }));
        assert_eq!(set([0.05, 0.06], json!({ "size_m": [2, 2] })), json!({ "cell_m": [0.05, 0.06], "size_m": [2, 2] }));
        for (cell, kept) in [([0.1; 2], json!({})), ([0.05; 2], json!({ "cell_m": 0.2 }))] {
            assert_eq!(set(cell, kept.clone()), kept);
        }
    }

    /// A larger texture is cut and a smaller one repeats, if it can.
    #[test]
    fn val_sizes_beside_the_base() {
        let [base, small, large] = [[30, 40], [30, 20], [30, 50]].map(|[rows, cols]| Geometry::square(rows, cols, 0.1));
        assert_eq!((uncovered(&base, &base), uncovered(&base, &large), size_doubt(&base, &base)), (None, None, None));
        assert!(uncovered(&base, &small).is_some_and(|why| why.contains("30 x 40 cells is larger than")));
        let doubt = |texture: &Geometry| size_doubt(&base, texture).unwrap();
        assert_eq!(doubt(&small), "2 m x 3 m repeats over its base of 4 m x 3 m, whose size is `size_px = [40, 30]`");
        assert!(doubt(&large).starts_with("5 m x 3 m is cut to its base of 4 m x 3 m"), "{}", doubt(&large));
    }

    /// Where holes are filled, no base is recommended for long waves.
    #[test]
    fn val_a_filled_hole_needs_no_base() {
        let notes = [format!("{NO_LONG_WAVES}, 2 m; add it to a base that has them"), "made of cells".to_owned()];
        assert_eq!(notes_on_filling(notes.to_vec()).collect::<Vec<_>>(), ["made of cells"]);
    }

    /// Only `fft_ma` fills holes with texture of the fitted model. Without a measured covariance there is no note.
    #[test]
    fn val_notes_on_filled_holes_name_what_the_model_is_for() {
        let map = CovarianceMap { model: "exponential".to_owned(), ..CovarianceMap::default() };
        let fit = FitFile { map: Some(map), ..FitFile::default() };
        let said = |method: &str| fill_note(&fit, method).unwrap();
        assert!(said("fft_ma").contains("holes are filled with the fitted model (exponential)"), "{}", said("fft_ma"));
        for method in ["modulated", "wavelet_statistics", "quilting", "exemplar"] {
            assert!(!said(method).contains("holes are filled with the fitted model"), "{}", said(method));
            assert!(said(method).contains("the fitted model (exponential) only weights"), "{}", said(method));
        }
        assert_eq!(fill_note(&FitFile::default(), "quilting"), None);
    }
}
