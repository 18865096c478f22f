//! Releases with any number of missions, made straight from rows: nothing is generated or driven. For tests and measurements of what reads a
//! release.

use sastrugi_numeric::{Stream, Streams};
use sastrugi_schemas::manifest::Origin;
use sastrugi_schemas::tables;
use sastrugi_schemas::{Cell, Column, ColumnType, Table};
use sastrugi_store::digest;
use sastrugi_store::release::{Head, PartWriter, ReleaseBuilder, ReleaseError, TablePart};
use std::path::Path;

/// Missions of a run on each terrain.
pub const MISSIONS_PER_TERRAIN: usize = 20;
/// Groups of terrains, from smooth to rough.
const GROUPS: [&str; 3] = ["1-smooth", "2-wavy", "3-rough"];
/// The groups of Majhor and Bos, with which the report compares.
const PUBLISHED_GROUPS: [&str; 3] = ["2.3", "2.45", "2.6"];
/// The tables of such a release.
const TABLES: [&str; 9] = [
    "terrains",
    "surfaces",
    "psd",
    "structure",
    "profile_psd",
    "height_distribution",
    "missions",
    "fits",
    "covariance",
];
/// Bins of each curve of a surface.
const BINS: i64 = 24;
/// Length of a mission, m.
const LENGTH_M: f64 = 25.0;
/// The fit of all textures, which sorts before terrains and textures.
const FIT: &str = "f";
const STUDY: &str = "[study]\nname = \"synthetic\"\ntitle = \"Synthetic missions\"\nseed = 7\ndate = \"2026-01-01\"\n";

/// What a synthetic release has.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shape {
    /// Missions, rounded up to whole terrains: of the plain run and of all variants together.
    pub missions: usize,
    /// Whether the groups are those of a paper and share the draws of their missions, as with `pairing = "common"`.
    pub is_paired: bool,
    /// Variants of the run, each with [`MISSIONS_PER_TERRAIN`] missions on each terrain.
    pub variants: usize,
    /// Whether there are as many textures as terrains, all of one fit.
    pub has_textures: bool,
}

impl Shape {
    /// Missions alone: three groups, one run.
    pub fn of_missions(missions: usize) -> Self {
        Self { missions, ..Self::default() }
    }

    fn terrains(&self) -> usize {
        self.missions.div_ceil(MISSIONS_PER_TERRAIN * (1 + self.variants))
    }

    fn textures(&self) -> usize {
        if self.has_textures { self.terrains() } else { 0 }
    }

    fn group(&self, terrain: usize) -> &'static str {
        if self.is_paired { PUBLISHED_GROUPS[terrain % 3] } else { GROUPS[terrain % 3] }
    }

    /// Block of the pairs of a terrain: those of one block share the draws of their missions.
    fn block(&self, terrain: usize) -> String {
        if self.is_paired { format!("m-{:07}", terrain / 3) } else { format!("m@{}", terrain_id(terrain)) }
    }

    /// Ids of the surfaces, in order.
    fn surfaces(self) -> impl Iterator<Item = String> {
        let fit = self.has_textures.then(|| FIT.to_owned());
        let textures = (0..self.textures()).map(texture_id);
        let textures = textures.flat_map(|id| [id.clone(), format!("{id}.residual")]);
        fit.into_iter().chain((0..self.terrains()).map(terrain_id)).chain(textures)
    }
}

fn terrain_id(terrain: usize) -> String {
    format!("t-{terrain:07}")
}

/// Sorts after the terrains.
fn texture_id(texture: usize) -> String {
    format!("x-{texture:07}")
}

/// Writes a sealed release. It has a study, terrains in three groups with their curves, and missions; no rasters, samples or recordings.
/// Rows are drawn and written one after the other.
///
/// # Errors
/// The file system failed, or `dest` holds files that are not a release.
pub fn release(dest: &Path, shape: &Shape) -> Result<(), ReleaseError> {
    let head = Head {
        name: "synthetic".to_owned(),
        study_sha256: digest::of_text(STUDY),
        seed: 7,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        license: "CC0-1.0".to_owned(),
    };
    let mut builder = ReleaseBuilder::beside(dest, head)?;
    builder.write_text("study.toml", STUDY, Origin::default())?;
    let part = |table| TablePart { table, name: TablePart::WHOLE.to_owned(), origin: Default::default() };
    let parts = TABLES.iter().filter_map(|name| tables::by_name(name)).map(part).collect();
    builder.write_tables(parts, |part, writer| fill(part.table, shape, writer))?;
    builder.seal(dest).map(drop)
}

/// Writes the rows of a table, from a random stream of its own.
fn fill(table: &Table, shape: &Shape, writer: &mut PartWriter<'_>) -> Result<(), ReleaseError> {
    let mut stream = Streams::for_seed(7, "synthetic").stream(table.name);
    match table.name {
        "missions" => {
            (0..shape.terrains()).try_for_each(|terrain| missions(table, shape, terrain, &mut stream, writer))
        }
        "terrains" => {
            // The checked parameters, as a study stores them with each terrain: 1 to 2 kB.
            let generator = sastrugi_terrain::prepare("multifractal", &serde_json::json!({}));
            let params = generator.map_or_else(|_| String::new(), |generator| generator.parameters().to_string());
            for terrain in 0..shape.terrains() {
                writer.push(terrain_row(table, shape, terrain, &params, &mut stream))?;
            }
            (0..shape.textures()).try_for_each(|texture| writer.push(texture_row(table, texture)))
        }
        "fits" if shape.has_textures => writer.push(fit_row(table)),
        "covariance" if shape.has_textures => (0..BINS).try_for_each(|bin| writer.push(covariance_row(table, bin))),
        "fits" | "covariance" => Ok(()),
        "surfaces" => shape.surfaces().try_for_each(|id| writer.push(surface_row(table, &id, &mut stream))),
        _ => {
            for id in shape.surfaces() {
                (0..BINS).try_for_each(|bin| writer.push(curve_row(table, &id, bin, &mut stream)))?;
            }
            Ok(())
        }
    }
}

/// Missions on a terrain, of the plain run, then of each variant: on rougher ground fewer reach the goal, and those of one terrain resemble
/// each other.
fn missions(
    table: &Table,
    shape: &Shape,
    terrain: usize,
    stream: &mut Stream,
    writer: &mut PartWriter<'_>,
) -> Result<(), ReleaseError> {
    let (id, block, group) = (terrain_id(terrain), shape.block(terrain), shape.group(terrain));
    let level = (terrain % GROUPS.len()) as f64;
    let (share, scale) = (0.95 - 0.15 * level + 0.04 * stream.normal(), 1.0 + 0.3 * level + 0.1 * stream.normal());
    let all =
        (0..=shape.variants).flat_map(|variant| (1..=MISSIONS_PER_TERRAIN).map(move |mission| (variant, mission)));
    for (variant, mission) in all {
        let run = if variant == 0 { "run".to_owned() } else { format!("run-v{variant:04}") };
        let is_success = stream.uniform() < share;
        let failure = if stream.uniform() < 0.7 { "stuck" } else { "tipped" };
        let [x, y, angle] = [5.0, 45.0, 1.0].map(|high| stream.uniform_in(0.0, high));
        let (sin, cos) = libm::sincos(angle);
        let reached_m = if is_success { LENGTH_M } else { stream.uniform_in(1.0, LENGTH_M) };
        let [heave, pitch, roll] = [0.6, 13.0, 9.5].map(|median| median * scale * libm::exp(0.2 * stream.normal()));
        let number = |value: f64| Some(Cell::F64(value));
        writer.push(row(table, |column| match column {
            "terrain_id" => Some(text(&id)),
            "mission_id" => Some(text(&format!("{run}-{mission:04}"))),
            "group" => Some(text(group)),
            "variant" if variant > 0 => Some(text(&format!("vehicle_changes.tyre.damping_n_s_m = {variant}"))),
            "variant" | "split" => Some(Cell::Null),
            "pair_id" => Some(text(&format!("{block}-{mission:04}"))),
            "traverse_id" => Some(text(&run)),
            "vehicle" => Some(text("husky_a200")),
            "outcome" => Some(text(if is_success { "success" } else { failure })),
            "path" => Some(text(&format!("mcap/{id}/{run}-{mission:04}.mcap"))),
            "start_x_m" => number(x),
            "start_y_m" => number(y),
            "goal_x_m" => number(x + LENGTH_M * cos),
            "goal_y_m" => number(y + LENGTH_M * sin),
            "progress_m" | "path_length_m" => number(reached_m),
            "efficiency" => {
                if is_success {
                    number(0.98)
                } else {
                    Some(Cell::Null)
                }
            }
            "time_s" => number(reached_m / 0.7 + pitch / 10.0),
            "rms_vertical_acceleration_m_s2" => number(heave),
            "rms_pitch_rate_deg_s" | "rms_body_pitch_rate_deg_s" => number(pitch),
            "rms_roll_rate_deg_s" | "rms_body_roll_rate_deg_s" => number(roll),
            "max_pitch_deg" => number(2.0 * pitch),
            "max_roll_deg" => number(2.0 * roll),
            "sample_rate_hz" => number(20.0),
            _ => None,
        }))?;
    }
    Ok(())
}

fn terrain_row(table: &Table, shape: &Shape, terrain: usize, params: &str, stream: &mut Stream) -> Vec<Cell> {
    let (id, level) = (terrain_id(terrain), (terrain % GROUPS.len()) as f64);
    let slope = (0.2 + 0.1 * level) * libm::exp(0.1 * stream.normal());
    let low = (0.9 - 0.1 * level + 0.02 * stream.normal()).clamp(0.0, 1.0);
    row(table, |column| match column {
        "terrain_id" => Some(text(&id)),
        "group" => Some(text(shape.group(terrain))),
        "variant" | "split" => Some(Cell::Null),
        "stage" => Some(text("terrain")),
        "kind" => Some(text("multifractal")),
        "params" => Some(text(params)),
        "stream" => Some(text(&format!("item/7/terrain/{id}"))),
        "path" => Some(text(&format!("terrain/{id}.tif"))),
        "rows" | "cols" => Some(Cell::I64(64)),
        "cell_x_m" | "cell_y_m" => Some(Cell::F64(0.8)),
        "height_min_m" => Some(Cell::F64(-slope)),
        "height_max_m" => Some(Cell::F64(slope)),
        "relief_m" => Some(Cell::F64(2.0 * slope)),
        "rms_height_m" | "rms_slope" => Some(Cell::F64(slope)),
        "share_low" => Some(Cell::F64(low)),
        "share_semi" => Some(Cell::F64(0.8 * (1.0 - low))),
        "share_high" => Some(Cell::F64(0.2 * (1.0 - low))),
        "psd_slope" => Some(Cell::F64(-3.5 + 0.1 * level)),
        _ => None,
    })
}

fn texture_row(table: &Table, texture: usize) -> Vec<Cell> {
    let id = texture_id(texture);
    row(table, |column| match column {
        "terrain_id" => Some(text(&id)),
        "group" | "variant" | "split" | "stream" => Some(Cell::Null),
        "stage" => Some(text("texture")),
        "kind" => Some(text("fft_ma")),
        "params" => Some(text(&format!("{{\"fit\":\"{FIT}\",\"method\":\"fft_ma\",\"periodic\":true}}"))),
        "path" => Some(text(&format!("texture/{id}.tif"))),
        "rows" | "cols" => Some(Cell::I64(64)),
        "cell_x_m" | "cell_y_m" => Some(Cell::F64(0.8)),
        "height_min_m" => Some(Cell::F64(-0.3)),
        "height_max_m" | "relief_m" => Some(Cell::F64(0.3)),
        "rms_height_m" | "rms_slope" => Some(Cell::F64(0.1)),
        _ => None,
    })
}

fn surface_row(table: &Table, id: &str, stream: &mut Stream) -> Vec<Cell> {
    let height_m = 0.1 * libm::exp(0.05 * stream.normal());
    row(table, |column| match column {
        "surface_id" => Some(text(id)),
        "stage" => Some(text("terrain")),
        "fit_id" => Some(Cell::Null),
        "cells" => Some(Cell::I64(4096)),
        "cell_x_m" | "cell_y_m" => Some(Cell::F64(0.8)),
        "sq_m" | "sa_m" | "sp_m" | "sv_m" | "sz_m" | "sdq" => Some(Cell::F64(height_m)),
        "sku" => Some(Cell::F64(3.0)),
        _ => None,
    })
}

/// An exponential covariance of 0.1 m and a range of 1 m.
fn fit_row(table: &Table) -> Vec<Cell> {
    row(table, |column| match column {
        "fit_id" => Some(text(FIT)),
        "dem_id" => Some(text("site")),
        "mode" => Some(text("corrected")),
        "model" => Some(text("exponential")),
        "window_x_m" | "window_y_m" => Some(Cell::F64(20.0)),
        "sigma_m" | "sigma_low_m" | "sigma_high_m" | "naive_sigma_m" | "band_rms_m" => Some(Cell::F64(0.1)),
        "sigma2_over_range_m" | "sigma2_over_range_low_m" | "sigma2_over_range_high_m" => Some(Cell::F64(0.01)),
        "trim_level" => Some(Cell::F64(0.05)),
        "interval_level" => Some(Cell::F64(0.95)),
        name if name.ends_with("_p") => Some(Cell::F64(0.5)),
        "block_sigma_low_m" | "block_range_low_m" | "increment_1m_m" | "hurst" => Some(Cell::Null),
        "warnings" | "replicates" | "block_replicates" => None,
        _ => Some(Cell::F64(1.0)),
    })
}

fn covariance_row(table: &Table, bin: i64) -> Vec<Cell> {
    let lag_m = 0.8 * bin as f64;
    row(table, |column| match column {
        "fit_id" => Some(text(FIT)),
        "bin" => Some(Cell::I64(bin)),
        "azimuth_deg" => Some(Cell::Null),
        "pairs" => Some(Cell::I64(4000)),
        "lag_m" => Some(Cell::F64(lag_m)),
        "covariance_low_m2" | "covariance_high_m2" => Some(Cell::Null),
        _ => Some(Cell::F64(0.01 * libm::exp(-lag_m))),
    })
}

/// A row of a spectrum, structure function or histogram.
fn curve_row(table: &Table, id: &str, bin: i64, stream: &mut Stream) -> Vec<Cell> {
    let (at, noise) = (libm::exp(0.1 * bin as f64), libm::exp(0.1 * stream.normal()));
    row(table, |column| match column {
        "surface_id" => Some(text(id)),
        "direction" => Some(text(if table.name == "structure" { "all" } else { "x" })),
        "bin" => Some(Cell::I64(bin)),
        "frequency_cycles_m" => Some(Cell::F64(0.02 * at)),
        "psd_m4" | "psd_m3" => Some(Cell::F64(0.01 * noise * libm::pow(at, -3.5))),
        "lag_m" => Some(Cell::F64(at)),
        "value_m2" => Some(Cell::F64(0.01 * noise * at)),
        "low_m" => Some(Cell::F64(0.1 * (bin - BINS / 2) as f64)),
        "high_m" => Some(Cell::F64(0.1 * (bin - BINS / 2) as f64 + 0.1)),
        "density_per_m" => Some(Cell::F64(noise)),
        _ => None,
    })
}

fn text(words: &str) -> Cell {
    Cell::Text(words.to_owned())
}

/// A row with the cells that are given by column, and zeros, empty text and empty lists elsewhere.
fn row(table: &Table, given: impl Fn(&str) -> Option<Cell>) -> Vec<Cell> {
    let zero = |column: &Column| match column.column_type {
        ColumnType::Text => Cell::Text(String::new()),
        ColumnType::F64 => Cell::F64(0.0),
        ColumnType::I64 => Cell::I64(0),
        ColumnType::Bool => Cell::Bool(false),
        ColumnType::F32List => Cell::F32List(Vec::new()),
        ColumnType::F64List => Cell::F64List(Vec::new()),
    };
    table.columns.iter().map(|column| given(column.name).unwrap_or_else(|| zero(column))).collect()
}
