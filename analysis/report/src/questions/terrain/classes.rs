//! Roughness classes: their shares by group, and class maps with the missions driven on them.

use super::{median, representative};
use crate::ReportError;
use crate::content::{Figure, Numbers, Size, count, number, slug, text};
use crate::data::{Data, Group};
use crate::questions::outcome;
use crate::questions::relief::{MAP_WIDTH, exaggeration, extent};
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows, WIDTH};
use crate::render::map::{Key, Map};
use crate::render::svg::{Anchor, Paint, Stroke, Symbol, text_width};
use crate::render::{number as set, picture, thin};
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::tables::{MissionRow, SampleRow, TerrainRow};

/// Largest number of rows or columns of a class map.
const PIXELS: usize = 420;
/// Marks on maps do not follow the theme.
const DARK: Paint = Paint::Fixed([0x1b, 0x20, 0x26]);
const LIGHT: Paint = Paint::Fixed([0xff, 0xff, 0xff]);

/// Shares, then one map per group.
pub fn figures(data: &Data, groups: &[Group<TerrainRow>]) -> Result<Vec<Figure>, ReportError> {
    let mut figures: Vec<Figure> = shares(groups).into_iter().collect();
    for group in groups {
        figures.extend(map(data, group)?);
    }
    Ok(figures)
}

fn share(terrain: &TerrainRow, class: RoughnessClass) -> f64 {
    match class {
        RoughnessClass::Low => terrain.share_low,
        RoughnessClass::Semi => terrain.share_semi,
        RoughnessClass::High => terrain.share_high,
    }
}

/// A bar for each class and group (the median), with a mark for each terrain.
fn shares(groups: &[Group<TerrainRow>]) -> Option<Figure> {
    let known: Vec<&Group<TerrainRow>> =
        groups.iter().filter(|g| median(&g.rows, |t| t.share_low).is_finite()).collect();
    if known.is_empty() {
        return None;
    }
    let label = |g: &&Group<TerrainRow>| RowLabel { name: g.name.clone(), detail: format!("n = {}", g.rows.len()) };
    let labels: Vec<RowLabel> = known.iter().map(label).collect();
    let legend = class_entries();
    let mut rows = Rows::new(&labels, 62.0, (Axis::linear(0.0, 100.0), "share of the area, %"), &legend);
    for (row, group) in known.iter().enumerate() {
        RoughnessClass::ALL.into_iter().for_each(|class| share_bar(&mut rows, row, group, class));
    }
    Some(shares_figure(rows, &known))
}

fn share_bar(rows: &mut Rows, row: usize, group: &Group<TerrainRow>, class: RoughnessClass) {
    let y = rows.centre(row) + 18.0 * (class as usize as f64 - 1.0);
    let at = |rows: &Rows, share: f64| rows.x.clamped(100.0 * share);
    let middle = median(&group.rows, |t| share(t, class));
    let (Some(zero), Some(end)) = (at(rows, 0.0), at(rows, middle)) else { return };
    rows.svg.rect((zero, y - 7.0), (end - zero, 14.0), Paint::Fixed(class.colour()), 1.0);
    let terrains: Vec<f64> = group.rows.iter().filter_map(|t| at(rows, share(t, class))).collect();
    terrains.iter().for_each(|&x| rows.svg.ring((x, y), 2.2, Stroke::new(Paint::Ink, 0.9).faint(0.6)));
    let last = terrains.iter().copied().fold(end, f64::max);
    let value = set::percent(middle, 1);
    let width = text_width(&value, 11.5);
    // Behind the last mark; where there is no room, on the bar; where that is short, at the edge.
    let (x, anchor, paint) = match (last + 8.0 + width <= WIDTH, end - zero > width + 12.0) {
        (true, _) => (last + 8.0, Anchor::Start, Paint::Ink),
        (false, true) => (zero + 6.0, Anchor::Start, label_on(class)),
        (false, false) => (WIDTH - 1.0, Anchor::End, Paint::Ink),
    };
    rows.svg.text_sized((x, y + 4.0), anchor, paint, 11.5, &value);
}

/// Text on a bar of the class colour.
fn label_on(class: RoughnessClass) -> Paint {
    if class == RoughnessClass::Low { LIGHT } else { DARK }
}

fn shares_figure(rows: Rows, groups: &[&Group<TerrainRow>]) -> Figure {
    let terrains = groups.iter().flat_map(|g| g.rows.iter().copied());
    let names = ["terrain_id", "group", "share_low", "share_semi", "share_high", "share_border_m"];
    let in_words = |g: &&Group<TerrainRow>| {
        let parts =
            RoughnessClass::ALL.map(|c| format!("{} {}", c.name(), set::percent(median(&g.rows, |t| share(t, c)), 1)));
        format!("group {}: {}", g.name, parts.join(", "))
    };
    Figure {
        id: "class-shares".into(),
        title: "Shares of the roughness classes.".into(),
        caption: "Bars and figures are medians over terrains, circles the terrains. Medians need not add up to 100 %."
            .into(),
        description: format!("Median shares. {}.", groups.iter().map(in_words).collect::<Vec<_>>().join("; ")),
        svg: rows.svg,
        size: Size::Column,
        numbers: Numbers::select("tables/terrains where stage = 'terrain'", terrains, &names),
    }
}

fn class_entries() -> Vec<Entry> {
    RoughnessClass::ALL.map(|c| (Mark::Fill(Paint::Fixed(c.colour())), c.name().to_owned())).into()
}

/// The class map of the group's representative among the terrains with missions (among all where none was driven).
fn map(data: &Data, group: &Group<TerrainRow>) -> Result<Option<Figure>, ReportError> {
    let driven = |t: &&TerrainRow| !data.missions_on(&t.terrain_id).is_empty();
    let with_missions = Group { rows: group.rows.iter().copied().filter(driven).collect(), ..group.clone() };
    let Some(terrain) = representative(&with_missions).or_else(|| representative(group)) else { return Ok(None) };
    let path = format!("classes/{}.tif", terrain.terrain_id);
    let Some(codes) = data.files.classes(&path)? else { return Ok(None) };
    let heights = data.files.grid(&terrain.path)?;
    let picture = picture::classes(&codes, heights.as_ref(), exaggeration(terrain.rms_slope), PIXELS)?;
    let missions = data.missions_on(&terrain.terrain_id);
    let samples = if missions.is_empty() { Vec::new() } else { data.files.samples(&terrain.terrain_id)? };
    let mut map = Map::new(&picture, MAP_WIDTH, &Key::Entries(&map_entries(missions)));
    map.clip(&format!("{}-clip", map_id(terrain)));
    missions.iter().for_each(|m| draw_mission(&mut map, m, &track_of(&samples, m)));
    map.svg.close();
    Ok(Some(map_figure(map, group, terrain, missions, &extent(&codes))))
}

/// Classes, then the outcomes that occur, then start and goal.
fn map_entries(missions: &[MissionRow]) -> Vec<Entry> {
    let class = |c| (Mark::Fill(Paint::Fixed(picture::class_colour(c))), RoughnessClass::name(c).to_owned());
    let mut entries: Vec<Entry> = RoughnessClass::ALL.map(class).into();
    let counts = outcome::counts(missions);
    for (i, n) in counts.into_iter().enumerate().filter(|(_, n)| *n > 0) {
        // The ink of a legend must show on the page in either theme.
        let stroke = Stroke { paint: Paint::Outcome(i), ..outcome::track(i) };
        entries.push((Mark::Track(stroke, outcome::ALL[i].symbol), format!("{} ({n})", outcome::ALL[i].name)));
    }
    if !missions.is_empty() {
        entries.push((Mark::Symbol(Symbol::Ring, Paint::Ink), "start".into()));
    }
    if counts[0] < missions.len() {
        entries.push((Mark::Symbol(Symbol::Frame, Paint::Ink), "goal not reached".into()));
    }
    entries
}

/// The path driven where it was recorded, else the straight line that was asked for.
fn track_of(samples: &[SampleRow], mission: &MissionRow) -> Vec<(f64, f64)> {
    let of_mission = samples.iter().filter(|s| s.mission_id == mission.mission_id);
    let path: Vec<(f64, f64)> = of_mission.map(|s| (s.x_m, s.y_m)).collect();
    match path.len() {
        0 | 1 => vec![(mission.start_x_m, mission.start_y_m), (mission.goal_x_m, mission.goal_y_m)],
        _ => thin::every(&path, 80),
    }
}

fn draw_mission(map: &mut Map, mission: &MissionRow, path: &[(f64, f64)]) {
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
    map.svg.symbol(outcome::ALL[kind].symbol, end, 5.4, LIGHT);
    map.svg.symbol(outcome::ALL[kind].symbol, end, 4.2, stroke.paint);
}

fn map_figure(
    map: Map,
    group: &Group<TerrainRow>,
    terrain: &TerrainRow,
    missions: &[MissionRow],
    extent: &str,
) -> Figure {
    let counts = outcome::counts(missions);
    let occurred = outcome::ALL.iter().zip(counts).filter(|(_, n)| *n > 0);
    let words: Vec<String> = occurred.map(|(o, n)| format!("{} {n}", o.name)).collect();
    let outcomes =
        if words.is_empty() { "no missions".into() } else { format!("missions by outcome: {}", words.join(", ")) };
    Figure {
        id: map_id(terrain),
        title: format!("Classes, group {}.", group.name),
        caption: format!("{}, closed class map over its relief; {outcomes}.", terrain.terrain_id),
        description: format!("Map of roughness classes, {extent}; {outcomes}."),
        svg: map.svg,
        size: Size::Column,
        numbers: map_numbers(terrain, missions),
    }
}

fn map_id(terrain: &TerrainRow) -> String {
    slug(&format!("classes-{}", terrain.terrain_id))
}

fn map_numbers(terrain: &TerrainRow, missions: &[MissionRow]) -> Numbers {
    let names = ["mission_id", "outcome", "start_x_m", "start_y_m", "goal_x_m", "goal_y_m", "time_s", "path"];
    if missions.is_empty() {
        let columns = [("file", ""), ("rows", "1"), ("cols", "1"), ("cell_x_m", "m")];
        let mut numbers = Numbers::new(format!("classes/{}.tif", terrain.terrain_id), &columns);
        let side = |n: i64| usize::try_from(n).map_or(sastrugi_schemas::Cell::Null, count);
        let file = text(format!("classes/{}.tif", terrain.terrain_id));
        numbers.row([file, side(terrain.rows), side(terrain.cols), number(terrain.cell_x_m)]);
        return numbers;
    }
    Numbers::select(format!("tables/missions where terrain_id = '{}'", terrain.terrain_id), missions, &names)
}
