//! Co-registration of two DEMs, and the texts that report it.

use crate::job::JobError;
use sastrugi_schemas::coregistration::{Coregistration, Minus};
use sastrugi_schemas::counted;
use sastrugi_store::dem::{Crs, Dem};
use sastrugi_texture::coregister::{Coregistered, SIGNIFICANCE, coregister};

/// Conversion of degrees to metres starts at each DEM's own corner, so the relative position of two DEMs would be lost.
pub const IN_DEGREES: &str =
    "is in degrees; DEMs are co-registered in metres: reproject both (gdalwarp -t_srs EPSG:...)";

/// The difference of a DEM and another one co-registered to it.
///
/// # Errors
/// DEMs in different coordinate systems, or that cannot be co-registered.
pub fn coregistered(dem: &Dem, other: &Dem) -> Result<Coregistered, JobError> {
    check_systems(&dem.info.crs, &other.info.crs)?;
    coregister(&dem.grid, &other.grid).map_err(JobError::input)
}

/// Refuses two DEMs in different coordinate systems.
///
/// # Errors
/// When both have an EPSG code and the codes differ.
pub fn check_systems(one: &Crs, two: &Crs) -> Result<(), JobError> {
    if let (Some(one), Some(two)) = (one.epsg, two.epsg)
        && one != two
    {
        return Err(JobError::input(format!(
            "the DEMs are in EPSG:{one} and EPSG:{two}; reproject the second: gdalwarp -t_srs EPSG:{one} -r bilinear"
        )));
    }
    Ok(())
}

/// A sentence on the subtracted DEM and its co-registration.
pub fn sentence(minus: &Minus) -> String {
    let c = &minus.coregistration;
    let moved = c.shift_m.map_or_else(String::new, |[east, north]| {
        let errors = c.standard_errors.as_ref().and_then(|e| e.shift_m);
        let error = |k: usize| errors.map_or_else(String::new, |e| format!(" +- {:.3}", e[k]));
        format!("shifted {east:.3}{} m east and {north:.3}{} m north, ", error(0), error(1))
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

/// The number of rounds, with its noun.
pub fn rounds(c: &Coregistration) -> String {
    counted(c.iterations, "round")
}

/// The verdict on a co-registration.
pub fn verdict(c: &Coregistration) -> String {
    if c.shift_m.is_none() {
        return "no horizontal shift: the ground has no slopes in two directions; B was only raised and tilted"
            .to_owned();
    }
    if !c.converged {
        let text = "the difference contains the relief of both DEMs";
        return format!("co-registration did not converge in {}: {text}", rounds(c));
    }
    let [plane, after] = [c.nmad_plane_m, c.nmad_after_m].map(|nmad| format!("{nmad:.4} m"));
    let not_lower = format!("does not lower NMAD ({plane} with raise and tilt alone, {after} with it)");
    match (c.gained, c.shift_p) {
        (Some(true), _) if c.nmad_after_m < c.nmad_plane_m => {
            format!("co-registration gained: the shift lowered NMAD from {plane} (raise and tilt alone) to {after}")
        }
        (Some(true), _) => format!(
            "co-registration gained: the shift is significant, although it {not_lower}: the cells of B lay between those of A, where \
             interpolation averages the noise of B"
        ),
        (Some(false), Some(p)) if p < SIGNIFICANCE => {
            format!("co-registration gained nothing: the shift is significant but {not_lower}")
        }
        (Some(false), Some(p)) => format!(
            "co-registration gained nothing: horizontally, B lies on A within the uncertainty of the shift (p = {p:.2})"
        ),
        _ => "co-registration converged; without standard errors, its gain cannot be assessed".to_owned(),
    }
}

/// The verdict, if it is a warning to users of the difference.
pub fn warning(c: &Coregistration) -> Option<String> {
    (c.shift_m.is_none() || !c.converged).then(|| verdict(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found() -> Coregistration {
        Coregistration {
            shift_m: Some([0.07, -0.04]),
            raise_m: -3.0,
            tilt: [0.0; 2],
            standard_errors: None,
            shift_p: Some(0.001),
            gained: Some(true),
            median_before_m: 3.0,
            median_plane_m: None,
            median_after_m: None,
            nmad_before_m: 0.2,
            nmad_plane_m: 0.19,
            nmad_after_m: 0.1,
            cells: 9000,
            iterations: 4,
            converged: true,
        }
    }

    #[test]
    fn val_verdicts() {
        let gained = "co-registration gained: the shift lowered NMAD from 0.1900 m (raise and tilt alone) to 0.1000 m";
        assert_eq!(verdict(&found()), gained);
        let check = |c: Coregistration, words: &str| assert!(verdict(&c).contains(words), "{}", verdict(&c));
        let not_lower = "does not lower NMAD (0.1900 m with raise and tilt alone, 0.1900 m with it)";
        check(Coregistration { nmad_after_m: 0.19, ..found() }, not_lower);
        check(Coregistration { nmad_after_m: 0.19, ..found() }, "gained: the shift is significant, although it");
        let lost = Coregistration { gained: Some(false), ..found() };
        check(lost.clone(), "co-registration gained nothing: the shift is significant but does not lower NMAD");
        check(Coregistration { shift_p: Some(0.3), ..lost.clone() }, "within the uncertainty of the shift (p = 0.30)");
        check(Coregistration { shift_p: Some(SIGNIFICANCE), ..lost }, "within the uncertainty of the shift (p = 0.05)");
        let unknown = Coregistration { gained: None, shift_p: None, ..found() };
        check(unknown, "without standard errors, its gain cannot be assessed");
    }

    /// Only what makes the difference unusable is a warning.
    #[test]
    fn val_warnings() {
        assert_eq!(warning(&found()), None);
        assert_eq!(warning(&Coregistration { gained: Some(false), shift_p: Some(0.9), ..found() }), None);
        let unsettled = Coregistration { converged: false, iterations: 1, ..found() };
        let expected = "co-registration did not converge in 1 round: the difference contains the relief of both DEMs";
        assert_eq!(warning(&unsettled).as_deref(), Some(expected));
        let level = Coregistration { shift_m: None, shift_p: None, gained: None, ..found() };
        assert!(warning(&level).unwrap().starts_with("no horizontal shift"));
    }

    #[test]
    fn val_the_sentence_states_shift_and_raise() {
        let minus = Minus { file: "b.tif".to_owned(), sha256: String::new(), coregistration: found() };
        let expected = "b.tif was shifted 0.070 m east and -0.040 m north, raised -3.000 m and subtracted on 9000 cells: \
            NMAD 0.2000 m before, 0.1000 m after; 4 rounds; co-registration gained";
        assert!(sentence(&minus).starts_with(expected), "{}", sentence(&minus));
        let level = Coregistration { shift_m: None, ..found() };
        let minus = Minus { coregistration: level, ..minus };
        assert!(sentence(&minus).starts_with("b.tif was raised -3.000 m and subtracted"), "{}", sentence(&minus));
    }
}
