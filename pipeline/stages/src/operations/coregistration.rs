//! Co-registration of two DEMs that were read, and what is said of it.

use crate::job::JobError;
use sastrugi_schemas::coregistration::{Coregistration, Minus};
use sastrugi_store::dem::Dem;
use sastrugi_texture::coregister::{Coregistered, SIGNIFICANCE, coregister};

/// Degrees become metres from each DEM's own corner, and their places are lost.
pub const IN_DEGREES: &str =
    "is in degrees; DEMs are co-registered in metres: reproject both (gdalwarp -t_srs EPSG:...)";

/// One DEM less another that was co-registered to it.
///
/// # Errors
/// DEMs in different coordinate systems, or that cannot be co-registered.
pub fn coregistered(dem: &Dem, other: &Dem) -> Result<Coregistered, JobError> {
    let (one, two) = (dem.info.crs.epsg, other.info.crs.epsg);
    if let (Some(one), Some(two)) = (one, two)
        && one != two
    {
        return Err(JobError::input(format!(
            "the DEMs are in EPSG:{one} and EPSG:{two}; bring the second to the first: gdalwarp -t_srs EPSG:{one} -r bilinear"
        )));
    }
    coregister(&dem.grid, &other.grid).map_err(JobError::input)
}

/// What was subtracted and how it was co-registered, in a sentence.
pub fn sentence(minus: &Minus) -> String {
    let c = &minus.coregistration;
    let moved = c.shift_m.map_or_else(String::new, |[east, north]| {
        let errors = c.standard_errors.as_ref().and_then(|e| e.shift_m);
        let error = |k: usize| errors.map_or_else(String::new, |e| format!(" +- {:.3}", e[k]));
        format!("moved {east:.3}{} m east and {north:.3}{} m north, ", error(0), error(1))
    });
    format!(
        "{} was {moved}raised {:.3} m and subtracted on {} cells: NMAD {:.4} m before, {:.4} m after; {}; {}",
        minus.file,
        c.raise_m,
        c.cells,
        c.nmad_before_m,
        c.nmad_after_m,
        rounds(c),
        verdict(c)
    )
}

/// How many rounds it took.
pub fn rounds(c: &Coregistration) -> String {
    format!("{} {}", c.iterations, if c.iterations == 1 { "round" } else { "rounds" })
}

/// What a co-registration came to.
pub fn verdict(c: &Coregistration) -> String {
    if c.shift_m.is_none() {
        return "no horizontal shift: the ground has no slopes in two directions; B was raised and tilted only"
            .to_owned();
    }
    if !c.converged {
        let text = "the difference holds the relief of both DEMs";
        return format!("co-registration did not converge in {}: {text}", rounds(c));
    }
    let [plane, after] = [c.nmad_plane_m, c.nmad_after_m].map(|nmad| format!("{nmad:.4} m"));
    let not_lower = format!("does not lower NMAD ({plane} with raise and tilt alone, {after} with it)");
    match (c.gained, c.shift_p) {
        (Some(true), _) if c.nmad_after_m < c.nmad_plane_m => {
            format!("co-registration gained: the shift lowered NMAD from {plane} (raise and tilt alone) to {after}")
        }
        (Some(true), _) => format!(
            "co-registration gained: the shift is significant, though it {not_lower}: B lay between A's cells, where reading it \
             averages its noise"
        ),
        (Some(false), Some(p)) if p < SIGNIFICANCE => {
            format!("co-registration gained nothing: the shift is significant but {not_lower}")
        }
        (Some(false), Some(p)) => format!(
            "co-registration gained nothing: horizontally, B lies on A within the uncertainty of the shift (p = {p:.2})"
        ),
        _ => "co-registration converged; without standard errors no gain can be shown".to_owned(),
    }
}

/// The verdict, where it is one that a user of the difference must know.
pub fn warning(c: &Coregistration) -> Option<String> {
    (c.shift_m.is_none() || !c.converged).then(|| verdict(c))
}
