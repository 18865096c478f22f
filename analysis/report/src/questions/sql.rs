//! DuckDB queries behind figures and tables, to be run in the folder of the release: they return the numbers themselves, or the rows
//! from which they are computed.

use crate::data::{Data, Group};
use sastrugi_schemas::tables::TerrainRow;

/// Columns of the table `missions` that are compared between groups.
const COMPARED: &str = "terrain_id, mission_id, pair_id, outcome, progress_m, efficiency, time_s, rms_vertical_acceleration_m_s2, \
rms_pitch_rate_deg_s, rms_roll_rate_deg_s, max_pitch_deg, max_roll_deg";

/// Label of a mission, or else of its terrain, or else the generator of the terrain.
const LABEL: &str = "coalesce(\"group\", (select coalesce(terrains.\"group\", terrains.kind) from 'tables/terrains/*.parquet' as terrains \
where terrains.terrain_id = missions.terrain_id))";

/// Missions of the plain run, of one outcome or of all: the name of the group, then `columns`.
pub fn missions(data: &Data, columns: &str, outcome: Option<&str>) -> String {
    let plain = data.missions.iter().any(|m| m.variant.is_none()).then(|| "variant is null".to_owned());
    let rules: Vec<String> =
        plain.into_iter().chain(outcome.map(|word| format!("outcome = {}", quoted(word)))).collect();
    let rules = if rules.is_empty() { String::new() } else { format!(" where {}", rules.join(" and ")) };
    let label = match data.missions.iter().all(|m| m.group.is_some()) {
        true => "\"group\"",
        false => LABEL,
    };
    let run = if data.has_several_runs() { " || ', ' || traverse_id" } else { "" };
    let name = if label == LABEL || !run.is_empty() { " as \"group\"" } else { "" };
    format!("select {label}{run}{name}, {columns} from 'tables/missions/*.parquet' as missions{rules}")
}

/// All columns that are compared between groups of missions.
pub fn compared(data: &Data) -> String {
    missions(data, COMPARED, None)
}

/// The same for every variant.
pub fn variants() -> String {
    format!("select variant, \"group\", traverse_id, {COMPARED} from 'tables/missions/*.parquet'")
}

/// The condition on the terrains of a group; `column` holds their ids.
pub fn of_group(column: &str, group: &Group<TerrainRow>) -> String {
    let plain = if group.rows.iter().all(|t| t.variant.is_none()) { " and variant is null" } else { "" };
    let label = quoted(&group.label);
    format!(
        "{column} in (select terrain_id from 'tables/terrains/*.parquet' where stage = 'terrain' and coalesce(\"group\", kind) = {label}{plain})"
    )
}

/// Text in single quotes.
pub fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}
