//! The order in which textures are drawn, so that the few that are drawn show what the page says about all of them: one of each group
//! before a second one, those that do not match their measured surface first, then others that were compared with it, methods of a
//! scoreboard (which has figures of its own) and textures on a base last.

use super::verdict::{self, Answer};
use crate::data::{self, Data, RESIDUAL};
use sastrugi_schemas::tables::TerrainRow;
use std::collections::{BTreeMap, BTreeSet};

/// Textures drawn; all are in the table.
pub const TEXTURES_DRAWN: usize = 4;

/// A texture with its answer and the sentence on it, if it could be compared with the measured surface.
pub struct Judged<'a> {
    /// The texture.
    pub texture: &'a TerrainRow,
    /// Whether it matches, and why.
    pub verdict: Option<(Answer, String)>,
}

impl<'a> Judged<'a> {
    fn new(data: &'a Data, texture: &'a TerrainRow) -> Self {
        let verdict = super::alone(texture).and_then(|fit| verdict::of_texture(data, texture, &fit));
        Self { texture, verdict }
    }

    fn rank(&self) -> u8 {
        match self.verdict {
            Some((Answer::No, _)) => 0,
            Some(_) => 1,
            None => 2,
        }
    }
}

/// All textures. The first one does not match if any does not, and was compared if any was.
pub fn in_order(data: &Data) -> Vec<Judged<'_>> {
    let compared = of_scoreboards(data);
    let mut all: Vec<Judged<'_>> = data.of_stage("texture").map(|texture| Judged::new(data, texture)).collect();
    all.sort_by_cached_key(|one| {
        let texture = one.texture;
        (one.rank(), compared.contains(&texture.terrain_id), data::parameter(texture, "onto").is_some())
    });
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut placed: Vec<(usize, Judged<'_>)> = Vec::new();
    for one in all {
        let place = places.entry(data::label(one.texture)).or_default();
        *place += 1;
        placed.push((*place, one));
    }
    placed.sort_by_key(|(place, _)| *place);
    placed.into_iter().map(|(_, one)| one).collect()
}

/// Ids of the textures that are not drawn, and of their residuals.
pub fn undrawn(data: &Data) -> Vec<String> {
    let ids = |one: Judged<'_>| [one.texture.terrain_id.clone(), format!("{}{RESIDUAL}", one.texture.terrain_id)];
    in_order(data).into_iter().skip(TEXTURES_DRAWN).flat_map(ids).collect()
}

/// Ids of the textures of all scoreboards.
fn of_scoreboards(data: &Data) -> BTreeSet<String> {
    data.scoreboard.iter().map(|s| format!("{}-{}", s.texture_id, s.method.replace('_', "-"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;
    use sastrugi_schemas::tables::{ScoreRow, StructureRow, SurfaceRow};

    fn ids(data: &Data) -> Vec<&str> {
        in_order(data).into_iter().map(|one| one.texture.terrain_id.as_str()).collect()
    }

    /// A release with textures of these ids and groups, none of which has a residual.
    fn with_textures(textures: &[(&str, &str)]) -> Data {
        let mut data = made_up::full(1, 24);
        let one = data.of_stage("texture").next().unwrap().clone();
        data.terrains.retain(|t| t.stage != "texture");
        data.terrains.extend(textures.iter().map(|(id, group)| TerrainRow {
            terrain_id: (*id).into(),
            group: Some((*group).into()),
            ..one.clone()
        }));
        data
    }

    /// One of each group comes first; within a group, and among the first of all groups, those that do not match, then those that were compared.
    #[test]
    fn val_textures_that_do_not_match_come_first() {
        let textures = [("a-1", "a"), ("a-2", "a"), ("b-1", "b"), ("b-2", "b"), ("b-3", "b"), ("c-1", "c")];
        let mut data = with_textures(&textures);
        assert_eq!(ids(&data), ["a-1", "b-1", "c-1", "a-2", "b-2", "b-3"]);
        // The site counts as stationary; its residual is compared with two textures, one of twice its height and slope.
        data.fits.iter_mut().for_each(|fit| fit.stationarity_p = 0.5);
        let site = data.surface("jacksboro-corrected").unwrap().clone();
        let curve: Vec<StructureRow> = data.structure_of("jacksboro-corrected", "all").into_iter().cloned().collect();
        for (id, factor) in [("b-2.residual", 1.0), ("b-3.residual", 4.0)] {
            data.surfaces.push(SurfaceRow {
                surface_id: id.into(),
                cells: 2_000_000,
                sq_m: factor * site.sq_m,
                sdq: factor * site.sdq,
                ..site.clone()
            });
            data.structure.extend(curve.iter().map(|row| StructureRow {
                surface_id: id.into(),
                value_m2: factor * factor * row.value_m2,
                ..row.clone()
            }));
        }
        data.surfaces.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
        data.structure.sort_by(|a, b| a.surface_id.cmp(&b.surface_id));
        let answers: Vec<Option<Answer>> = in_order(&data).into_iter().map(|one| one.verdict.map(|v| v.0)).collect();
        assert_eq!(answers[0], Some(Answer::No));
        assert_eq!(answers.iter().filter(|answer| answer.is_some()).count(), 2);
        assert_eq!(ids(&data), ["b-3", "a-1", "c-1", "b-2", "a-2", "b-1"]);
        let undrawn = undrawn(&data);
        assert_eq!(undrawn, ["a-2", "a-2.residual", "b-1", "b-1.residual"]);
    }

    /// Scenes come before the methods of a scoreboard, and before textures on a base.
    #[test]
    fn val_methods_of_a_scoreboard_and_textures_on_a_base_come_last() {
        let textures = [("methods-fft-ma", "methods-fft-ma"), ("on-hill", "hill"), ("scene", "scene")];
        let mut data = with_textures(&textures);
        let on_hill = r#"{"fit":"jacksboro-corrected","onto":"hill"}"#;
        data.terrains.iter_mut().filter(|t| t.terrain_id == "on-hill").for_each(|t| t.params = on_hill.into());
        data.scoreboard = vec![ScoreRow {
            texture_id: "methods".into(),
            method: "fft_ma".into(),
            covariance_error_max: 0.0,
            covariance_error_rms: 0.0,
            realisations: 4,
            variance_mean: 1.0,
            variance_spread: 0.0,
            ratio_wanted: 1.0,
            ratio_found: 1.0,
            seam_jump_ratio: 1.0,
            operations: 1.0,
            memory_bytes: 1.0,
            refused: String::new(),
        }];
        assert_eq!(ids(&data), ["scene", "on-hill", "methods-fft-ma"]);
    }
}
