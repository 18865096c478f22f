//! Releases with any number of missions, made straight from rows: nothing is generated or driven. For tests and measurements of what reads a
//! release.

use sastrugi_numeric::{Stream, Streams};
use sastrugi_schemas::manifest::Origin;
use sastrugi_schemas::tables;
use sastrugi_schemas::{Cell, Column, ColumnType, Table};
use sastrugi_store::digest;
use sastrugi_store::release::{Head, PartWriter, ReleaseBuilder, ReleaseError, TablePart};
use std::path::Path;

/// Missions on each terrain.
pub const MISSIONS_PER_TERRAIN: usize = 20;
/// Groups of terrains, from smooth to rough.
const GROUPS: [&str; 3] = ["1-smooth", "2-wavy", "3-rough"];
/// The tables of such a release.
const TABLES: [&str; 6] = ["terrains", "surfaces", "psd", "structure", "height_distribution", "missions"];
/// Bins of each curve of a terrain.
const BINS: i64 = 24;
/// Length of a mission, m.
const LENGTH_M: f64 = 25.0;
const STUDY: &str = "[study]\nname = \"synthetic\"\ntitle = \"Synthetic missions\"\nseed = 7\ndate = \"2026-01-01\"\n";

/// Writes a sealed release with this many missions, rounded up to whole terrains of [`MISSIONS_PER_TERRAIN`]. It has a study, terrains in
/// three groups with their curves, and missions; no rasters, samples or recordings. Rows are drawn and written one after the other.
///
/// # Errors
/// The file system failed, or `dest` holds files that are not a release.
pub fn release(dest: &Path, missions: usize) -> Result<(), ReleaseError> {
    let terrains = missions.div_ceil(MISSIONS_PER_TERRAIN);
    let head = Head {
        name: "synthetic".to_owned(),
        study_sha256: digest::of_text(STUDY),
        seed: 7,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        license: "CC0-1.0".to_owned(),
    };
    let mut builder = ReleaseBuilder::beside(dest, head)?;
    builder.write_text("study.toml", STUDY, Origin::default())?;
    let part = |table| TablePart { table, name: TablePart::WHOLE.to_owned(), origin: Origin::default() };
    let parts = TABLES.iter().filter_map(|name| tables::by_name(name)).map(part).collect();
    builder.write_tables(parts, |part, writer| fill(part.table, terrains, writer))?;
    builder.seal(dest).map(drop)
}

/// Writes the rows of a table, from a random stream of its own.
fn fill(table: &Table, terrains: usize, writer: &mut PartWriter<'_>) -> Result<(), ReleaseError> {
    let mut stream = Streams::for_seed(7, "synthetic").stream(table.name);
    for terrain in 0..terrains {
        let (id, level) = (format!("t-{terrain:07}"), (terrain % GROUPS.len()) as f64);
        match table.name {
            "missions" => missions(table, &id, level, &mut stream, writer)?,
            "terrains" => writer.push(terrain_row(table, &id, level, &mut stream))?,
            "surfaces" => writer.push(row(table, |column| (column == "surface_id").then(|| text(&id))))?,
            _ => (0..BINS).try_for_each(|bin| writer.push(curve_row(table, &id, bin, &mut stream)))?,
        }
    }
    Ok(())
}

/// Missions on a terrain: on rougher ground fewer reach the goal, and those of one terrain resemble each other.
fn missions(
    table: &Table,
    terrain: &str,
    level: f64,
    stream: &mut Stream,
    writer: &mut PartWriter<'_>,
) -> Result<(), ReleaseError> {
    let (share, scale) = (0.95 - 0.15 * level + 0.04 * stream.normal(), 1.0 + 0.3 * level + 0.1 * stream.normal());
    for mission in 1..=MISSIONS_PER_TERRAIN {
        let is_success = stream.uniform() < share;
        let failure = if stream.uniform() < 0.7 { "stuck" } else { "tipped" };
        let [x, y, angle] = [5.0, 45.0, 1.0].map(|high| stream.uniform_in(0.0, high));
        let (sin, cos) = libm::sincos(angle);
        let reached_m = if is_success { LENGTH_M } else { stream.uniform_in(1.0, LENGTH_M) };
        let [heave, pitch, roll] = [0.6, 13.0, 9.5].map(|median| median * scale * libm::exp(0.2 * stream.normal()));
        let number = |value: f64| Some(Cell::F64(value));
        writer.push(row(table, |column| match column {
            "terrain_id" => Some(text(terrain)),
            "mission_id" => Some(text(&format!("run-{mission:04}"))),
            "group" => Some(text(GROUPS[level as usize])),
            "variant" | "split" => Some(Cell::Null),
            "pair_id" => Some(text(&format!("m@{terrain}-{mission:04}"))),
            "traverse_id" => Some(text("run")),
            "vehicle" => Some(text("husky_a200")),
            "outcome" => Some(text(if is_success { "success" } else { failure })),
            "path" => Some(text(&format!("mcap/{terrain}/run-{mission:04}.mcap"))),
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

fn terrain_row(table: &Table, id: &str, level: f64, stream: &mut Stream) -> Vec<Cell> {
    let slope = (0.2 + 0.1 * level) * libm::exp(0.1 * stream.normal());
    let low = (0.9 - 0.1 * level + 0.02 * stream.normal()).clamp(0.0, 1.0);
    row(table, |column| match column {
        "terrain_id" => Some(text(id)),
        "group" => Some(text(GROUPS[level as usize])),
        "variant" | "split" => Some(Cell::Null),
        "stage" => Some(text("terrain")),
        "kind" => Some(text("multifractal")),
        "params" => Some(text("{\"size_px\":[64,64],\"cell_m\":0.8}")),
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

/// A row of a spectrum, structure function or histogram.
fn curve_row(table: &Table, id: &str, bin: i64, stream: &mut Stream) -> Vec<Cell> {
    let (at, noise) = (libm::exp(0.1 * bin as f64), libm::exp(0.1 * stream.normal()));
    row(table, |column| match column {
        "surface_id" => Some(text(id)),
        "direction" => Some(text("all")),
        "bin" => Some(Cell::I64(bin)),
        "frequency_cycles_m" => Some(Cell::F64(0.02 * at)),
        "psd_m4" => Some(Cell::F64(0.01 * noise * libm::pow(at, -3.5))),
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
