//! Published formulas for z0 and zero-plane displacement.

/// Half of Lettau's drag coefficient for the average obstacle.
const LETTAU: f64 = 0.5;
/// A of Macdonald et al. for staggered arrays.
const MACDONALD_A: f64 = 4.43;
/// beta of Macdonald et al. for staggered arrays with A = 4.43.
const MACDONALD_BETA: f64 = 1.0;
/// Drag coefficient of a cube.
const CUBE_DRAG: f64 = 1.2;
/// Von Karman constant, as given by Macdonald et al.
const VON_KARMAN: f64 = 0.4;

/// `z0 = 0.5 h* lambda_f`, m (Lettau 1969), for obstacles of height `height_m` with a frontal area per ground area of
/// `frontal_area_index`.
///
/// ```
/// use sastrugi_roughness::lettau_z0_m;
///
/// // Hummocks of 20 cm that show the wind a tenth of their ground as frontal area.
/// assert!((lettau_z0_m(0.2, 0.1) - 0.01).abs() < 1e-15);
/// ```
pub fn lettau_z0_m(height_m: f64, frontal_area_index: f64) -> f64 {
    LETTAU * height_m * frontal_area_index
}

/// `z0 = f h*^2 / (4 X)`, m (Munro 1989), for obstacles of height `height_m` (twice the standard deviation) that a profile meets
/// `upcrossings_per_m` times per metre: Lettau's formula with `s = h* X / (2 f)` and `S = (X / f)^2`.
pub fn munro_z0_m(height_m: f64, upcrossings_per_m: f64) -> f64 {
    lettau_z0_m(height_m, 0.5 * height_m * upcrossings_per_m)
}

/// Zero-plane displacement over obstacle height, `z_d / h = 1 + A^-lambda_p (lambda_p - 1)`, from 0 to 1 (Macdonald et al. 1998,
/// Eq. 23). A plan-area index of 1 or more means ground without gaps and gives 1.
pub fn macdonald_displacement(plan_area_index: f64) -> f64 {
    // f64::min would turn NaN into 1.
    let covered = if plan_area_index > 1.0 { 1.0 } else { plan_area_index };
    1.0 + libm::pow(MACDONALD_A, -covered) * (covered - 1.0)
}

/// `z0 = h (1 - z_d / h) exp(-(0.5 beta (C_D / kappa^2) (1 - z_d / h) lambda_f)^-0.5)`, m (Macdonald et al. 1998, Eq. 26), for
/// obstacles of height `height_m`; 0 without frontal area, or if the plan-area index leaves no gaps.
pub fn macdonald_z0_m(height_m: f64, plan_area_index: f64, frontal_area_index: f64) -> f64 {
    let open = 1.0 - macdonald_displacement(plan_area_index);
    let drag = 0.5 * MACDONALD_BETA * CUBE_DRAG / (VON_KARMAN * VON_KARMAN) * open * frontal_area_index;
    height_m * open * libm::exp(-1.0 / drag.sqrt())
}
