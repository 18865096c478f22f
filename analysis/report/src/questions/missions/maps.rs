//! Missions on the class map of one terrain of each group.

use crate::ReportError;
use crate::content::{Figure, Numbers, slug};
use crate::data::{Data, Group, Mission};
use crate::questions::outcome::{self, ALL};
use crate::questions::relief::{MAP_WIDTH, class_map_words, extent};
use crate::questions::sql;
use crate::render::chart::{Entry, Mark};
use crate::render::map::{Key, Map};
use crate::render::svg::{Paint, Stroke, Symbol};
use crate::render::{number as set, picture, thin};
use crate::sample::sample;
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::tables::{SampleRow, TerrainRow};
use std::collections::BTreeMap;

/// Largest number of rows or columns of a class map.
const PIXELS: usize = 420;
/// Largest number of groups drawn.
const GROUPS_MAX: usize = 12;
/// Largest number of missions drawn on a terrain.
const MISSIONS_MAX: usize = 400;
/// Marks on maps do not follow the theme.
const DARK: Paint = Paint::Fixed([0x1b, 0x20, 0x26]);
const LIGHT: Paint = Paint::Fixed([0xff, 0xff, 0xff]);

/// The terrain of a group that is drawn, with its missions and their samples.
pub struct Drawn<'a> {
    group: String,
    /// The terrain.
    pub terrain: &'a TerrainRow,
    /// Number of its missions by outcome.
    counts: [usize; ALL.len()],
    /// All its missions.
    pub all: Vec<&'a Mission>,
    /// Those on the map: all, or a random sample of [`MISSIONS_MAX`] of them.
    pub missions: Vec<&'a Mission>,
    /// The samples of those, by mission.
    pub samples: Vec<SampleRow>,
}

/// The terrain of each group with the median share of successful missions.
pub fn drawn<'a>(data: &'a Data, groups: &[Group<'a, Mission>]) -> Result<Vec<Drawn<'a>>, ReportError> {
    let mut drawn = Vec::new();
    for group in groups.iter().take(GROUPS_MAX) {
        let Some(terrain) = middle(group).and_then(|id| data.terrain(id)) else { continue };
        let of_terrain = group.rows.iter().copied().filter(|m| m.terrain_id.as_str() == terrain.terrain_id);
        let all: Vec<&Mission> = of_terrain.collect();
        let counts = outcome::counts(all.iter().copied());
        let missions = sample(all.clone(), MISSIONS_MAX, &mut data.stream(&terrain.terrain_id, "missions drawn"));
        let ids = missions.iter().map(|m| m.mission_id.as_str()).collect();
        let samples = data.files.samples(&terrain.terrain_id, &ids)?;
        drawn.push(Drawn { group: group.name.clone(), terrain, counts, all, missions, samples });
    }
    Ok(drawn)
}

/// Id of the terrain with the median share of successes: the lower middle of an even number, the first of equals.
fn middle<'a>(group: &Group<'a, Mission>) -> Option<&'a str> {
    let mut terrains: BTreeMap<&str, Vec<&Mission>> = BTreeMap::new();
    group.rows.iter().for_each(|m| terrains.entry(&m.terrain_id).or_default().push(m));
    let share = |missions: &[&Mission]| outcome::counts(missions.iter().copied())[0] as f64 / missions.len() as f64;
    let mut ranked: Vec<(f64, &str)> = terrains.iter().map(|(id, missions)| (share(missions), *id)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)));
    let value = ranked.get(ranked.len().saturating_sub(1) / 2)?.0;
    ranked.iter().find(|r| r.0 == value).map(|r| r.1)
}

/// Samples of one mission among those of a terrain, which are sorted by mission.
pub fn of_mission<'a>(samples: &'a [SampleRow], mission: &Mission) -> &'a [SampleRow] {
    let id = mission.mission_id.as_str();
    let from = samples.partition_point(|s| s.mission_id.as_str() < id);
    &samples[from..][..samples[from..].partition_point(|s| s.mission_id.as_str() <= id)]
}

/// One map for each terrain whose class map is in the release.
pub fn figures(data: &Data, drawn: &[Drawn]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    for one in drawn {
        figures.extend(figure(data, one)?);
    }
    Ok(figures)
}

fn figure(data: &Data, drawn: &Drawn) -> Result<Option<Figure>, ReportError> {
    let Drawn { group, terrain, counts, all, missions, samples } = drawn;
    let Some(codes) = data.files.classes(&format!("classes/{}.tif", terrain.terrain_id))? else { return Ok(None) };
    let heights = data.files.grid(&terrain.path)?;
    let picture = picture::classes(&codes, heights.as_ref(), exaggeration(terrain.rms_slope), PIXELS)?;
    let id = slug(&format!("missions-{}", terrain.terrain_id));
    let mut map = Map::new(&picture, MAP_WIDTH, &Key::Entries(&entries(counts)));
    map.clip(&format!("{id}-clip"));
    missions.iter().for_each(|m| draw_mission(&mut map, m, &track_of(samples, m)));
    map.svg.close();
    let occurred = ALL.iter().zip(counts).filter(|(_, n)| **n > 0);
    let outcomes: Vec<String> = occurred.map(|(o, n)| format!("{} {n}", o.name)).collect();
    let columns = ["mission_id", "outcome", "start_x_m", "start_y_m", "goal_x_m", "goal_y_m", "time_s", "path"];
    let plain = if all.iter().all(|m| m.variant.is_none()) { " and variant is null" } else { "" };
    let query = format!("terrain_id = {}{plain}", sql::quoted(&terrain.terrain_id));
    Ok(Some(Figure {
        id,
        title: format!("Missions, group {group}."),
        caption: format!(
            "{}: {} of {} reached the goal{}. Background: {} over the relief.",
            terrain.terrain_id,
            set::count(counts[0]),
            set::counted(all.len(), "mission"),
            if missions.len() < all.len() {
                format!("; a random sample of {MISSIONS_MAX} is drawn")
            } else {
                String::new()
            },
            class_map_words(data)
        ),
        description: format!("Map of missions, {}; missions by outcome: {}.", extent(&codes), outcomes.join(", ")),
        svg: map.svg,
        numbers: Numbers::select(&query, missions.iter().copied(), &columns).of_all(all.len()),
    }))
}

/// Classes, then the outcomes that occur, then start and goal.
fn entries(counts: &[usize; ALL.len()]) -> Vec<Entry> {
    let class = |c| (Mark::Fill(Paint::Fixed(picture::class_colour(c))), RoughnessClass::name(c).to_owned());
    let mut entries: Vec<Entry> = RoughnessClass::ALL.map(class).into();
    for (i, n) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
        // The ink of a legend must show on the page in either theme.
        let stroke = Stroke { paint: Paint::Outcome(i), ..outcome::track(i) };
        entries.push((Mark::Track(stroke, ALL[i].symbol), format!("{} ({n})", ALL[i].name)));
    }
    entries.push((Mark::Symbol(Symbol::Ring, Paint::Ink), "start".into()));
    if counts[1..].iter().any(|n| *n > 0) {
        entries.push((Mark::Symbol(Symbol::Frame, Paint::Ink), "goal not reached".into()));
    }
    entries
}

/// The path driven where it was recorded, otherwise the straight line from start to goal; of a mission that never moved, its start.
fn track_of(samples: &[SampleRow], mission: &Mission) -> Vec<(f64, f64)> {
    let path: Vec<(f64, f64)> = of_mission(samples, mission).iter().map(|s| (s.x_m, s.y_m)).collect();
    let start = (mission.start_x_m, mission.start_y_m);
    match path.len() {
        0 if mission.time_s == 0.0 => vec![start],
        0 => vec![start, (mission.goal_x_m, mission.goal_y_m)],
        1 => path,
        _ => thin::every(&path, 80),
    }
}

fn draw_mission(map: &mut Map, mission: &Mission, path: &[(f64, f64)]) {
    let placed: Vec<(f64, f64)> = path.iter().filter_map(|&(x, y)| map.at(x, y)).collect();
    let (Some(&start), Some(&end)) = (placed.first(), placed.last()) else { return };
    let kind = outcome::index(mission);
    let stroke = outcome::track(kind);
    map.svg.polyline(&placed, Stroke::new(LIGHT, 3.4).faint(0.75));
    map.svg.polyline(&placed, stroke);
    map.svg.disc(start, 3.6, LIGHT, 1.0);
    map.svg.symbol(Symbol::Ring, start, 3.4, DARK);
    if let Some(goal) = map.at(mission.goal_x_m, mission.goal_y_m).filter(|_| !outcome::successful(mission)) {
        map.svg.rect((goal.0 - 3.2, goal.1 - 3.2), (6.4, 6.4), LIGHT, 0.9);
        map.svg.symbol(Symbol::Frame, goal, 3.0, DARK);
    }
    map.svg.symbol(ALL[kind].symbol, end, 5.4, LIGHT);
    map.svg.symbol(ALL[kind].symbol, end, 4.2, stroke.paint);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mission that ended where it started has a single sample, or none and no time: it is marked there, not driven to its goal.
    #[test]
    fn val_missions_that_never_moved_stay_at_their_start() {
        let (data, shelf) = crate::tests::made_up::parts(1, 24);
        let all: Vec<SampleRow> = shelf.samples.values().flatten().cloned().collect();
        let of = |m: &&Mission| all.iter().any(|s| s.mission_id == m.mission_id.as_str());
        let driven = data.missions.iter().find(of).unwrap();
        let (start, goal) = ((driven.start_x_m, driven.start_y_m), (driven.goal_x_m, driven.goal_y_m));
        let first = all.iter().find(|s| s.mission_id == driven.mission_id.as_str()).unwrap().clone();
        assert_eq!(track_of(std::slice::from_ref(&first), driven), [(first.x_m, first.y_m)]);
        let halted = Mission { time_s: 0.0, ..driven.clone() };
        assert_eq!(track_of(&[], &halted), [start]);
        // Without a recording, the line of the mission stands for its path.
        assert_eq!(track_of(&[], &Mission { time_s: 3.0, ..halted }), [start, goal]);
    }
}
