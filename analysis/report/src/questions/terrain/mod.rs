//! Which terrains the release has: relief, classes, spectra and heights by group, and the parameters of every surface.

mod classes;
mod maps;
mod reliefs;
mod rendered;
mod spectra;

use super::Question;
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, count, number, text};
use crate::data::{Data, Group};
use crate::render::number as set;
use crate::sample::{ROWS_MAX, sample};
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::TerrainRow;
use std::collections::BTreeSet;

/// Query for the rows from which values of groups are computed.
const TERRAINS: &str = "select * from 'tables/terrains/*.parquet' where stage = 'terrain'";

/// Registry entry.
pub const QUESTION: Question = Question { id: "terrain", name: "Terrain", title: "What is the terrain like?", answer };

/// Groups of one family for which three terrains are drawn; with more, one each.
const GROUPS_WITH_THREE: usize = 3;
/// Largest relief over the smallest among groups that share a range of colours.
const RELIEFS_MAX: f64 = 4.0;
/// Groups drawn; every group is in the tables.
const GROUPS_MAX: usize = 12;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let groups = data.terrain_groups();
    if groups.is_empty() {
        let mut blocks = reliefs::of_dems(data)?;
        blocks.push(Block::FoldedTable(surfaces(data)));
        return Ok(blocks);
    }
    let drawn = &groups[..groups.len().min(GROUPS_MAX)];
    let mut blocks = vec![Block::Text(introduction(&groups)), Block::Table(medians(&groups))];
    blocks.extend(without_shares(&groups).map(Block::Text));
    if drawn.len() < groups.len() {
        blocks.push(Block::Text(format!(
            "The first {GROUPS_MAX} of {} groups are drawn; all are in the tables.",
            groups.len()
        )));
    }
    let (of_shape, of_heights) = (families(drawn, alike_in_shape), families(drawn, alike_in_heights));
    push(&mut blocks, "Relief", reliefs::figures(data, &of_heights)?);
    blocks.extend(rendered::blocks(data, drawn)?);
    push(&mut blocks, "Maps", maps::figures(data, drawn)?);
    push(&mut blocks, "Roughness classes", classes::figures(data, drawn)?);
    push(&mut blocks, "Spectra", of_shape.iter().flat_map(|f| spectra::spectra(data, f)).collect());
    push(&mut blocks, "Heights", of_heights.iter().flat_map(|f| spectra::distributions(data, f)).collect());
    blocks.push(Block::FoldedTable(all(data)));
    blocks.push(Block::FoldedTable(surfaces(data)));
    Ok(blocks)
}

/// Reliefs of the first group; empty if the release has none.
pub(super) fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    match data.terrain_groups().first() {
        Some(group) => reliefs::figures(data, &[vec![group.clone()]]),
        None => Ok(Vec::new()),
    }
}

/// Groups gathered into families: each joins the first family that it matches.
fn families<'a>(
    groups: &[Group<'a, TerrainRow>],
    alike: impl Fn(&[Group<TerrainRow>], &Group<TerrainRow>) -> bool,
) -> Vec<Vec<Group<'a, TerrainRow>>> {
    let mut families: Vec<Vec<Group<TerrainRow>>> = Vec::new();
    for group in groups {
        match families.iter_mut().find(|family| alike(family, group)) {
            Some(family) => family.push(group.clone()),
            None => families.push(vec![group.clone()]),
        }
    }
    families
}

/// Rows, columns and cell of a raster.
type Shape = (i64, i64, u64, u64);

fn shape(terrain: &TerrainRow) -> Shape {
    (terrain.rows, terrain.cols, terrain.cell_x_m.to_bits(), terrain.cell_y_m.to_bits())
}

fn shapes(rows: &[&TerrainRow]) -> BTreeSet<Shape> {
    rows.iter().map(|t| shape(t)).collect()
}

/// Every terrain has the same raster size and cell: spectra over the same frequencies, on common axes.
fn alike_in_shape(family: &[Group<TerrainRow>], group: &Group<TerrainRow>) -> bool {
    family.iter().all(|g| shapes(&g.rows) == shapes(&group.rows))
}

/// Also, heights overlap and their ranges are within a factor of each other, so that one colour range suits all. Measured ground at hundreds
/// of metres would leave no contrast for terrains around 0, and hills would leave none for potholes.
fn alike_in_heights(family: &[Group<TerrainRow>], group: &Group<TerrainRow>) -> bool {
    let b = heights(group);
    let alike = |other: &Group<TerrainRow>| {
        let a = heights(other);
        let [relief_a, relief_b] = [a, b].map(|[low, high]| high - low);
        let overlap = a[0] <= b[1] && b[0] <= a[1];
        overlap && relief_a.max(relief_b) <= RELIEFS_MAX * relief_a.min(relief_b)
    };
    alike_in_shape(family, group) && family.iter().all(alike)
}

/// Lowest and highest height of all terrains of a group.
fn heights(group: &Group<TerrainRow>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    group.rows.iter().fold(none, |[low, high], t| [low.min(t.height_min_m), high.max(t.height_max_m)])
}

/// True when all cells lie in the border that shares leave out.
fn too_small(terrain: &TerrainRow) -> bool {
    let side_m = (terrain.rows as f64 * terrain.cell_y_m).min(terrain.cols as f64 * terrain.cell_x_m);
    !terrain.share_low.is_finite() && 0.5 * side_m < terrain.share_border_m
}

/// Which terrains are too small to have shares; `None` when there are none.
fn without_shares(groups: &[Group<TerrainRow>]) -> Option<String> {
    let small: Vec<&TerrainRow> = groups.iter().flat_map(|g| &g.rows).copied().filter(|t| too_small(t)).collect();
    let mut names: Vec<String> = small.iter().take(GROUPS_MAX).map(|t| t.terrain_id.clone()).collect();
    if small.len() > names.len() {
        names.push(format!("and {} more", small.len() - names.len()));
    }
    let border = borders(&small);
    (!small.is_empty())
        .then(|| format!("No class shares for {}: surface too small, all cells lie in {border}.", names.join(", ")))
}

/// The borders that the shares of these terrains leave out, in words.
fn borders(terrains: &[&TerrainRow]) -> String {
    let mut borders: Vec<f64> = terrains.iter().map(|t| t.share_border_m).filter(|b| b.is_finite()).collect();
    borders.sort_by(f64::total_cmp);
    borders.dedup();
    match borders[..] {
        [] => "the border".into(),
        [one] => format!("a border of {} m", set::plain(one, 3)),
        [least, .., most] => {
            format!("a border of {} to {} m", set::plain(least, 3), set::plain(most, 3))
        }
    }
}

fn push(blocks: &mut Vec<Block>, heading: &str, figures: Vec<Figure>) {
    if !figures.is_empty() {
        blocks.extend([Block::Heading(heading.into()), Block::Figures(figures)]);
    }
}

fn introduction(groups: &[Group<TerrainRow>]) -> String {
    let n: usize = groups.iter().map(|g| g.rows.len()).sum();
    let names: Vec<String> = groups.iter().map(|g| format!("{} ({})", g.name, g.rows.len())).take(GROUPS_MAX).collect();
    let more = if groups.len() > GROUPS_MAX { " …" } else { "" };
    let border = borders(&groups.iter().flat_map(|g| &g.rows).copied().collect::<Vec<_>>());
    format!(
        "The release has {} in {}: {}{more}. The roughness class of a cell follows from its largest gradient to its eight neighbours; \
         shares leave out {border} and are computed before the class map is closed. Reliefs are lit from the north-west. Their colours \
         span the 1st to 99th percentile of the heights, or the lowest to the highest height where these lie far beyond. Where a few \
         cells rise above level ground, the colours begin below the ground, so that it is not drawn darkest.",
        set::counted(n, "terrain"),
        set::counted(groups.len(), "group"),
        names.join(", ")
    )
}

/// The terrains of a group in order of their RMS slope: the middle one is the group's representative.
fn by_slope<'a>(group: &Group<'a, TerrainRow>) -> Vec<&'a TerrainRow> {
    let mut rows = group.rows.clone();
    rows.sort_by(|a, b| a.rms_slope.total_cmp(&b.rms_slope));
    rows
}

/// The terrain with the median RMS slope of its group (the lower middle of an even number).
fn representative<'a>(group: &Group<'a, TerrainRow>) -> Option<&'a TerrainRow> {
    let rows = by_slope(group);
    rows.get(rows.len().saturating_sub(1) / 2).copied()
}

/// A quantity whose median describes a group: name, unit, value.
type Column = (&'static str, &'static str, fn(&TerrainRow) -> f64);

const MEDIANS: [Column; 7] = [
    ("relief", "m", |t| t.relief_m),
    ("RMS height", "m", |t| t.rms_height_m),
    ("RMS slope", "1", |t| t.rms_slope),
    ("low", "%", |t| 100.0 * t.share_low),
    ("semi", "%", |t| 100.0 * t.share_semi),
    ("high", "%", |t| 100.0 * t.share_high),
    ("PSD slope", "1", |t| t.psd_slope),
];

/// Median of a quantity over the rows that have it.
fn median(rows: &[&TerrainRow], figure: impl Fn(&TerrainRow) -> f64) -> f64 {
    let values: Vec<f64> = rows.iter().map(|t| figure(t)).collect();
    sums::median(&sums::finite(&values))
}

fn medians(groups: &[Group<TerrainRow>]) -> TableBlock {
    let columns: Vec<(&str, &str)> =
        [("group", ""), ("terrains", "")].into_iter().chain(MEDIANS.map(|(name, unit, _)| (name, unit))).collect();
    let mut numbers = Numbers::computed(TERRAINS, &columns);
    for group in groups {
        let figures = MEDIANS.iter().map(|(_, _, figure)| number(median(&group.rows, figure)));
        numbers.row([text(&group.name), count(group.rows.len())].into_iter().chain(figures));
    }
    TableBlock { id: "terrain-medians".into(), caption: "Terrain by group (medians over terrains)".into(), numbers }
}

/// Parameters of every surface of the release.
fn surfaces(data: &Data) -> TableBlock {
    let names = [
        "surface_id",
        "stage",
        "fit_id",
        "cell_x_m",
        "valid_share",
        "sq_m",
        "sa_m",
        "ssk",
        "sku",
        "sz_m",
        "sdq",
        "sal_m",
        "aspect_ratio",
        "direction_deg",
        "hurst_exponent",
        "hurst_standard_error",
        "hurst_lag_min_m",
        "hurst_lag_max_m",
        "zeta_1",
        "zeta_1_standard_error",
        "zeta_2",
        "zeta_2_standard_error",
    ];
    let listed = sample(data.surfaces.iter().collect(), ROWS_MAX, &mut data.stream("surfaces", "listed"));
    let numbers = Numbers::select("", listed, &names).of_all(data.surfaces.len());
    TableBlock { id: "surfaces".into(), caption: "All surfaces (ISO 25178)".into(), numbers }
}

fn all(data: &Data) -> TableBlock {
    let names = [
        "terrain_id",
        "group",
        "variant",
        "kind",
        "rows",
        "cols",
        "cell_x_m",
        "relief_m",
        "rms_height_m",
        "rms_slope",
        "band_rms_m",
        "share_low",
        "share_semi",
        "share_high",
        "psd_slope",
        "skewness",
        "kurtosis",
        "path",
    ];
    let all: Vec<&TerrainRow> = data.of_stage("terrain").collect();
    let count = all.len();
    let listed = sample(all, ROWS_MAX, &mut data.stream("terrains", "listed"));
    let numbers = Numbers::select("stage = 'terrain'", listed, &names).of_all(count);
    TableBlock { id: "terrains".into(), caption: "All terrains".into(), numbers }
}
