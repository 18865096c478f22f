//! The recovered surfaces of a release, and which of them are drawn.

use crate::data::{Data, natural, of_key};
use sastrugi_schemas::tables::{PhotoclinometryBandRow, PhotoclinometryRow};

/// A recovered surface with its octaves of wavelength.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Its row.
    pub row: &'a PhotoclinometryRow,
    /// Octaves, the shortest first; empty where the true surface is not known.
    pub bands: &'a [PhotoclinometryBandRow],
}

impl Surface<'_> {
    /// Id of the recovered surface.
    pub fn id(&self) -> &str {
        &self.row.photoclinometry_id
    }

    /// True where there is a true surface to compare with.
    pub fn compared(&self) -> bool {
        self.row.slope_error_rms.is_finite()
    }
}

/// All recovered surfaces by item, with settings in natural order.
pub fn all(data: &Data) -> Vec<Surface<'_>> {
    let mut rows: Vec<&PhotoclinometryRow> = data.photoclinometry.iter().collect();
    rows.sort_by_key(|r| {
        (natural(&r.item_id), natural(r.variant.as_deref().unwrap_or_default()), natural(&r.photoclinometry_id))
    });
    let bands =
        |r: &PhotoclinometryRow| of_key(&data.photoclinometry_bands, |b| &b.photoclinometry_id, &r.photoclinometry_id);
    rows.into_iter().map(|row| Surface { row, bands: bands(row) }).collect()
}

/// For each item, the surfaces with the smallest and the largest slope error; all surfaces of an item without a truth.
pub fn chosen<'a, 'b>(surfaces: &'b [Surface<'a>]) -> Vec<&'b Surface<'a>> {
    let of_item = |run: &'b [Surface<'a>]| {
        let mut ranked: Vec<&Surface> = run.iter().collect();
        ranked.sort_by(|a, b| a.row.slope_error_rms.total_cmp(&b.row.slope_error_rms));
        match ranked[..] {
            [least, .., greatest] if greatest.row.slope_error_rms.is_finite() => vec![least, greatest],
            _ => ranked,
        }
    };
    surfaces.chunk_by(|a, b| a.row.item_id == b.row.item_id).flat_map(of_item).collect()
}
