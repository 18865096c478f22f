//! Efficiency and arrival of each set: worlds as marks, means with intervals, correlation of the rovers on one world.

use super::outcomes;
use super::published::trial;
use super::sets::{Set, World, efficiency, off_ground, reached};
use super::worlds::{ARRIVED, DISTANCE, EFFICIENCY, GREATEST, LEAST, OF_ARRIVALS, Quantity, STRAIGHT, share};
use crate::content::{self, Numbers, TableBlock, count, number, text};
use crate::data::Data;
use crate::questions::clusters::LEVEL;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, RowLabel, Rows};
use crate::render::number as set_number;
use crate::render::svg::{Paint, Stroke, Symbol};
use sastrugi_numeric::sums;
use sastrugi_schemas::capital;
use sastrugi_schemas::tables::RoverRow;
use sastrugi_statistics::Intraclass;

/// Sets drawn; all are in the tables.
const DRAWN_MAX: usize = 16;
/// Query for the rows from which the tables are computed.
const QUERY: &str = "select terrain_id, rover_id, \"group\", stage_id, variant, navigator, outcome, straight_m, distance_m, efficiency, \
efficiency_half_limit, oracle, oracle_m from 'tables/rovers/*.parquet'";

/// Efficiency relative to the one that the ground allows; NaN where there is no path or none was searched for.
pub fn of_oracle(rover: &RoverRow) -> f64 {
    if rover.oracle == "found" { efficiency(rover) * rover.oracle_m / rover.straight_m } else { f64::NAN }
}

/// True where the ground has no path to the goal; `None` where none was searched for.
pub fn without_way(rover: &RoverRow) -> Option<bool> {
    matches!(rover.oracle.as_str(), "found" | "none").then(|| rover.oracle == "none")
}

/// Strips of the two efficiencies and of arrival.
pub fn figures(data: &Data, sets: &[Set]) -> Vec<content::Figure> {
    let drawn = &sets[..sets.len().min(DRAWN_MAX)];
    [EFFICIENCY, STRAIGHT, ARRIVED].iter().map(|f| strip(data, drawn, f, sets.len() - drawn.len())).collect()
}

fn strip(data: &Data, sets: &[Set], quantity: &Quantity, left_out: usize) -> content::Figure {
    let printed: Vec<Option<f64>> =
        sets.iter().map(|s| trial(data, s)?.value(quantity.id).filter(|_| quantity.id != EFFICIENCY.id)).collect();
    let bands = quantity.id != ARRIVED.id;
    let labels: Vec<RowLabel> = sets.iter().map(Set::label).collect();
    let mut legend: Vec<Entry> = vec![
        (Mark::Symbol(Symbol::Ring, Paint::Muted), "one world".into()),
        (Mark::Line(Stroke::new(Paint::Ink, 2.2)), "all, 95 % interval".into()),
    ];
    if bands && sets.iter().any(|s| s.worlds.len() > 1) {
        legend.push((Mark::Line(Stroke::new(Paint::Muted, 7.0).faint(0.3)), "band of one more world".into()));
    }
    if printed.iter().any(Option::is_some) {
        legend.push((Mark::Symbol(Symbol::Diamond, Paint::Ink), "paper, one world".into()));
    }
    let mut rows = Rows::new(&labels, 46.0, (Axis::linear(0.0, 1.0), quantity.name), &legend);
    for (row, (set, printed)) in sets.iter().zip(&printed).enumerate() {
        draw(&mut rows, row, set, quantity, bands, *printed);
    }
    let more = match left_out {
        0 => String::new(),
        n => format!(" The table has {}.", set_number::counted(n, "more set")),
    };
    content::Figure {
        id: content::slug(&format!("rover-{}", quantity.id.replace('_', "-"))),
        title: format!("{}.", capital(quantity.name)),
        caption: format!("The numbers at the rows are counts of rovers.{more}"),
        description: describe(sets, quantity),
        svg: rows.svg,
        numbers: numbers(sets, quantity),
    }
}

fn draw(rows: &mut Rows, row: usize, set: &Set, quantity: &Quantity, bands: bool, printed: Option<f64>) {
    let (y, paint) = (rows.centre(row), Paint::Series(set.index));
    let band = quantity.one_more(set).filter(|_| bands);
    if let Some((from, to)) = band.and_then(|b| Some((rows.x.clamped(b.low)?, rows.x.clamped(b.high)?))) {
        rows.svg.rect((from, y - 13.0), ((to - from).max(1.0), 26.0), paint, 0.13);
    }
    for (k, (_, value)) in quantity.values(set).into_iter().enumerate() {
        // Lanes keep equal values apart.
        let lane = 4.0 * ((k % 5) as f64 - 2.0) * 0.5 - 5.0;
        if let Some(x) = rows.x.clamped(value) {
            rows.svg.ring((x, y + lane), 2.6, Stroke::new(paint, 1.1).faint(0.85));
        }
    }
    let pooled = quantity.pooled(set);
    let [low, high] = pooled.ends();
    if let (Some(from), Some(to)) = (rows.x.clamped(low), rows.x.clamped(high)) {
        rows.svg.segment((from, y + 7.0), (to, y + 7.0), Stroke::new(Paint::Ink, 2.2));
    }
    if let Some(x) = rows.x.clamped(pooled.value) {
        rows.svg.disc((x, y + 7.0), 3.2, Paint::Ink, 1.0);
    }
    if let Some(x) = printed.and_then(|v| rows.x.clamped(v)) {
        rows.svg.symbol(Symbol::Diamond, (x, y - 5.0), 5.2, Paint::Paper);
        rows.svg.symbol(Symbol::Diamond, (x, y - 5.0), 4.0, Paint::Ink);
    }
}

fn describe(sets: &[Set], quantity: &Quantity) -> String {
    let part = |s: &Set| {
        let pooled = quantity.pooled(s);
        let [low, high] = pooled.ends();
        let interval = pooled.interval.map_or_else(String::new, |_| {
            format!(" ({} to {})", set_number::significant(low, 3), set_number::significant(high, 3))
        });
        format!("{}: {}{interval}", s.name, set_number::significant(pooled.value, 3))
    };
    format!("{} by set. {}.", capital(quantity.name), sets.iter().map(part).collect::<Vec<_>>().join("; "))
}

fn numbers(sets: &[Set], quantity: &Quantity) -> Numbers {
    let mut numbers = Numbers::computed(QUERY, &[("set", ""), ("terrain_id", ""), (quantity.id, quantity.unit)]);
    for set in sets {
        quantity.values(set).into_iter().for_each(|v| numbers.row([text(&set.name), text(v.0), number(v.1)]));
    }
    numbers
}

/// Both efficiencies, and how much of them is due to the distance limit and to the ground.
pub fn table(sets: &[Set]) -> TableBlock {
    let columns = [
        ("set", ""),
        ("worlds", "1"),
        ("rovers", "1"),
        ("reached", "%"),
        ("low", "%"),
        ("high", "%"),
        ("efficiency of arrivals", "1"),
        ("mean efficiency", "1"),
        ("low", "1"),
        ("high", "1"),
        ("straight over mean distance", "1"),
        ("low", "1"),
        ("high", "1"),
        ("efficiency at half the limit", "1"),
        ("efficiency over that of the shortest path", "1"),
        ("no path exists", "%"),
    ];
    let mut numbers = Numbers::computed(QUERY, &columns);
    for set in sets {
        let arrived = ARRIVED.pooled(set);
        let (all, straight) = (EFFICIENCY.pooled(set), STRAIGHT.pooled(set));
        let [reached, low, high] = [arrived.value, arrived.ends()[0], arrived.ends()[1]].map(|v| number(100.0 * v));
        let mean = |of: fn(&RoverRow) -> f64| number(set.mean(of, LEVEL).value);
        numbers.row([
            text(&set.name),
            count(set.worlds.len()),
            count(set.count()),
            reached,
            low,
            high,
            number(OF_ARRIVALS.pooled(set).value),
            number(all.value),
            number(all.ends()[0]),
            number(all.ends()[1]),
            number(straight.value),
            number(straight.ends()[0]),
            number(straight.ends()[1]),
            mean(|r| if off_ground(r) { 0.0 } else { r.efficiency_half_limit }),
            mean(of_oracle),
            number(100.0 * share(set, without_way).value),
        ]);
    }
    TableBlock {
        id: "rover-efficiency".into(),
        caption: "Efficiency and arrival, with 95 % intervals over worlds".into(),
        numbers,
    }
}

/// A quantity in which the rovers on one world may resemble each other: name and value.
struct Alike(&'static str, fn(&RoverRow) -> f64);
const ALIKE: [Alike; 2] = [Alike("efficiency", efficiency), Alike("reached", |r| f64::from(u8::from(reached(r))))];

/// Intraclass correlation of the rovers on one world.
pub fn intraclass(sets: &[Set]) -> TableBlock {
    let columns = [
        ("set", ""),
        ("quantity", ""),
        ("worlds", "1"),
        ("rovers", "1"),
        ("intraclass correlation", "1"),
        ("low", "1"),
        ("high", "1"),
        ("design effect", "1"),
        ("effective number of rovers", "1"),
    ];
    let mut numbers = Numbers::computed(QUERY, &columns).with_mixed_units();
    for set in sets {
        for Alike(name, of) in ALIKE {
            let clusters: Vec<Vec<f64>> = set.worlds.iter().map(|w| w.values(of)).collect();
            let Some(i) = Intraclass::of(&clusters, LEVEL) else { continue };
            numbers.row([
                text(&set.name),
                text(name),
                count(i.clusters),
                count(i.values),
                number(i.correlation.estimate),
                number(i.correlation.low),
                number(i.correlation.high),
                number(i.design_effect),
                number((i.values as f64 / i.design_effect).round()),
            ]);
        }
    }
    TableBlock { id: "rover-intraclass".into(), caption: "Correlation of the rovers on one world".into(), numbers }
}

/// Every world separately.
pub fn worlds(sets: &[Set]) -> TableBlock {
    let columns = [
        ("set", ""),
        ("terrain_id", ""),
        ("rovers", "1"),
        ("reached", "1"),
        ("mean_efficiency", "1"),
        ("straight_over_mean_distance", "1"),
        ("mean_distance_m", "m"),
        ("greatest_efficiency", "1"),
        ("least_efficiency", "1"),
        ("without_way", "1"),
    ];
    let mut numbers = Numbers::computed(QUERY, &columns);
    let ways = |w: &World| w.rovers.iter().filter(|r| without_way(r) == Some(true)).count();
    for (set, world) in sets.iter().flat_map(|s| s.worlds.iter().map(move |w| (s, w))) {
        numbers.row([
            text(&set.name),
            text(world.terrain_id),
            count(world.rovers.len()),
            count(world.rovers.iter().filter(|r| outcomes::index(r) == 0).count()),
            number(EFFICIENCY.of(world)),
            number(STRAIGHT.of(world)),
            number(DISTANCE.of(world)),
            number(GREATEST.of(world)),
            number(LEAST.of(world)),
            count(ways(world)),
        ]);
    }
    TableBlock { id: "rover-worlds".into(), caption: "Rovers by world".into(), numbers }
}

/// Largest ratio of the ends of an interval of contacts that still says something.
const ENDS_MAX: f64 = 100.0;

/// Mean contacts of a rover with their interval: NaN without one, or where its ends are too far apart.
fn contacts(set: &Set) -> [f64; 3] {
    let mean = set.mean(|r| r.contacts as f64, LEVEL);
    let [low, high] = mean.ends();
    if high <= ENDS_MAX * low { [mean.value, low, high] } else { [mean.value, f64::NAN, f64::NAN] }
}

/// The sets with contacts, but on too few worlds for an interval of them; `None` if there are none.
pub fn without_interval(sets: &[Set]) -> Option<String> {
    let is_wide = |set: &&Set| {
        let [mean, low, _] = contacts(set);
        mean > 0.0 && low.is_nan() && set.worlds.len() > 1
    };
    let names: Vec<&str> = sets.iter().filter(is_wide).map(|set| set.name.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "Too few worlds for an interval of the contacts, whose ends would be more than a factor of {ENDS_MAX:.0} apart: {}.",
            names.join("; ")
        )
    })
}

/// Mean effort of a rover.
pub fn effort(sets: &[Set]) -> TableBlock {
    let columns = [
        ("set", ""),
        ("distance", "m"),
        ("time", "s"),
        ("cycles", "1"),
        ("turns", "1"),
        ("turned", "deg"),
        ("reversals", "1"),
        ("cycles with hazards", "1"),
        ("contacts", "1"),
        ("low", "1"),
        ("high", "1"),
        ("centre contacts", "1"),
        ("no centre contact", "%"),
        ("greatest tilt", "deg"),
        ("pitch rate, RMS", "deg/s"),
    ];
    let query = "select terrain_id, rover_id, \"group\", stage_id, variant, distance_m, time_s, cycles, turns, turned_deg, reversals, hazards, contacts, \
                 centre_contacts, max_tilt_deg, rms_pitch_rate_deg_s from 'tables/rovers/*.parquet'";
    let mut numbers = Numbers::computed(query, &columns);
    for set in sets {
        let mean = |of: fn(&RoverRow) -> f64| number(set.mean(of, LEVEL).value);
        let [contacts, low, high] = contacts(set).map(number);
        let tilt = sums::finite(&set.rovers().map(|r| r.max_tilt_deg).collect::<Vec<_>>());
        numbers.row([
            text(&set.name),
            mean(|r| r.distance_m),
            mean(|r| r.time_s),
            mean(|r| r.cycles as f64),
            mean(|r| r.turns as f64),
            mean(|r| r.turned_deg),
            mean(|r| r.reversals as f64),
            mean(|r| r.hazards as f64),
            contacts,
            low,
            high,
            mean(|r| r.centre_contacts as f64),
            number(100.0 * share(set, |r| Some(r.centre_contacts == 0)).value),
            number(tilt.into_iter().fold(f64::NEG_INFINITY, f64::max)),
            mean(|r| r.rms_pitch_rate_deg_s),
        ]);
    }
    TableBlock { id: "rover-effort".into(), caption: "Effort and contacts, means over rovers".into(), numbers }
}
