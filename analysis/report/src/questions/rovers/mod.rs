//! How far rovers with limited sensing get: efficiency and arrival by set of worlds, comparison with published trials, distance budgets,
//! effort, tracks, designs.

mod arrival;
mod design;
mod effects;
mod efficiency;
mod outcomes;
mod published;
mod sets;
mod tracks;
mod worlds;

use super::Question;
use super::clusters::LEVEL;
use crate::ReportError;
use crate::content::{Block, Figure};
use crate::data::Data;
use crate::render::number as set_number;
use sets::Set;
use worlds::{ARRIVED, EFFICIENCY, OF_ARRIVALS};

/// Registry entry.
pub const QUESTION: Question = Question { id: "rovers", name: "Rovers", title: "How far do the rovers get?", answer };

/// Fewest worlds for reliable intervals.
const WORLDS_MIN: usize = 20;
/// Sets described in the first paragraph.
const SPOKEN_MAX: usize = 6;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let sets = sets::plain(data);
    if sets.is_empty() {
        return Ok(effects::blocks(data));
    }
    let mut blocks = vec![Block::Result(verdict(&sets))];
    blocks.extend(few_worlds(&sets).map(Block::Warning));
    blocks.extend(no_way(&sets).map(Block::Warning));
    blocks.extend(off_ground(&sets).map(Block::Warning));
    blocks.extend(published::blocks(data, &sets));
    blocks.extend([
        Block::Heading("Efficiency and arrival".into()),
        Block::Text(EFFICIENCIES.into()),
        Block::Figures(efficiency::figures(data, &sets)),
        Block::Table(efficiency::table(&sets)),
    ]);
    let alike = Block::Table(efficiency::intraclass(&sets));
    if !alike.is_empty() {
        blocks.extend([Block::Text(ALIKE.into()), alike]);
    }
    blocks.extend(arrival::blocks(&sets));
    blocks.extend([
        Block::Heading("Outcomes, effort and contacts".into()),
        Block::Text(EFFORT.into()),
        Block::Figures(vec![outcomes::figure(&sets)]),
        Block::Table(efficiency::effort(&sets)),
    ]);
    blocks.extend(efficiency::without_interval(&sets).map(Block::Text));
    let maps = tracks::figures(data, &sets)?;
    if !maps.is_empty() {
        blocks.extend([Block::Heading("Tracks".into()), Block::Text(tracks::WORDS.into()), Block::Figures(maps)]);
    }
    blocks.extend(design::blocks(data));
    blocks.extend(effects::blocks(data));
    blocks.push(Block::FoldedTable(efficiency::worlds(&sets)));
    Ok(blocks)
}

const EFFICIENCIES: &str = "The efficiency of a rover is the straight distance over the sum of the distance driven and the distance left at the end. Its mean over rovers differs from \
the straight distance over the mean distance: a few short drives raise the first, a few long ones lower the second. Intervals are over worlds, which are the independent trials. For \
means and ratios they are Student's, for the linearised ratio of world totals (Cochran, 1977), on the logarithm; for shares they are Korn and Graubard's (1998), with worlds as single \
trials if all or no rovers arrive. Intervals and bands end at the value of a straight drive: an efficiency of 1; straight over mean distance may be slightly larger, because rovers stop \
within a tolerance of their goal. At half the limit: each rover as if stopped after half of its distance limit. The shortest path is that on the complete map; only rovers that have \
one count in that column, and all rovers in the others.";
const ALIKE: &str = "Rovers on one world share its rocks and often a goal. The intraclass correlation is the share of the variance that lies between worlds (analysis of variance, \
Searle's interval, exact for normal values). The design effect is the factor by which it increases the variance of a mean (Kish, 1965).";
const EFFORT: &str = "Contacts are rocks higher than the clearance that passed under the rover; centre contacts are those under its centre line. Means are over all rovers, including \
those that were stopped.";

/// The first map of tracks; empty if the release has none.
pub(super) fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    Ok(tracks::first(data, &sets::plain(data), "summary-rovers-clip")?.into_iter().collect())
}

/// Arrival and efficiency of the sets, in a sentence each.
fn verdict(sets: &[Set]) -> String {
    let sentence = |set: &Set| {
        let (arrived, efficiency, of_arrivals) = (ARRIVED.pooled(set), EFFICIENCY.pooled(set), OF_ARRIVALS.pooled(set));
        let [low, high] = arrived.ends().map(|end| set_number::fixed(100.0 * end, 0));
        let level = set_number::fixed(100.0 * LEVEL, 0);
        let interval = match arrived.interval {
            Some(_) => format!(" ({level} % interval {low} to {high} %)"),
            None => String::new(),
        };
        let [all, arrivals] = [efficiency, of_arrivals].map(|mean| set_number::significant(mean.value, 2));
        let arrivals = match of_arrivals.value.is_finite() && arrivals != all {
            true => format!(", {arrivals} for those that arrive"),
            false => String::new(),
        };
        format!(
            "{}: {}{interval} of {} on {} reach their goal; the mean efficiency is {all}{arrivals}.",
            set.name,
            set_number::percent(arrived.value, 0),
            set_number::counted(set.count(), "rover"),
            set_number::counted(set.worlds.len(), "world")
        )
    };
    let mut ranked: Vec<&Set> = sets.iter().collect();
    if sets.len() > SPOKEN_MAX {
        ranked.sort_by(|a, b| EFFICIENCY.pooled(b).value.total_cmp(&EFFICIENCY.pooled(a).value));
        ranked = [ranked.first(), ranked.last()].into_iter().flatten().copied().collect();
        let words: Vec<String> = ranked.iter().map(|s| sentence(s)).collect();
        let sets = set_number::count(sets.len());
        return format!("The most and the least efficient of {sets} sets. {}", words.join(" "));
    }
    ranked.iter().map(|s| sentence(s)).collect::<Vec<_>>().join(" ")
}

/// Sets with too few worlds.
fn few_worlds(sets: &[Set]) -> Option<String> {
    let few: Vec<&Set> = sets.iter().filter(|s| s.worlds.len() < WORLDS_MIN).collect();
    let least = few.iter().map(|s| s.worlds.len()).min()?;
    let all = match few.len() {
        1 if sets.len() == 1 => return Some(few_of_one(least)),
        n if n == sets.len() => "Every set has".to_owned(),
        1 => format!("1 of {} sets has", sets.len()),
        n => format!("{n} of {} sets have", sets.len()),
    };
    Some(format!(
        "{all} fewer than {WORLDS_MIN} worlds (the smallest number is {}). {UNITS} {}",
        set_number::count(least),
        intervals_over(least)
    ))
}

/// What counts in the statistics of rovers.
const UNITS: &str =
    "Rovers on one world are not independent, so the sample size is the number of worlds, not of rovers.";

/// The same of the only set.
fn few_of_one(worlds: usize) -> String {
    format!(
        "The rovers drove on {}, fewer than {WORLDS_MIN}. {UNITS} {}",
        set_number::counted(worlds, "world"),
        intervals_over(worlds)
    )
}

fn intervals_over(worlds: usize) -> &'static str {
    if worlds < 2 {
        "A single world gives no interval."
    } else {
        "Intervals over so few worlds are wide, and only as good as their assumptions."
    }
}

/// Rovers that ended off the known ground.
fn off_ground(sets: &[Set]) -> Option<String> {
    let all = || sets.iter().flat_map(Set::rovers);
    let off = all().filter(|r| sets::off_ground(r)).count();
    (off > 0).then(|| {
        format!(
            "{} of {} ended off the known ground. Such a rover counts as 0 in mean efficiencies and is left out of the greatest and the least efficiency of its \
             world.",
            set_number::count(off),
            set_number::counted(all().count(), "rover")
        )
    })
}

/// Rovers for which the ground has no path.
fn no_way(sets: &[Set]) -> Option<String> {
    let of = |is: bool| sets.iter().flat_map(Set::rovers).filter(|r| efficiency::without_way(r) == Some(is)).count();
    let (none, found) = (of(true), of(false));
    (none > 0).then(|| {
        format!(
            "For {} of {}, the ground has no path that keeps the wheels clear of rocks above the clearance and off steep sand. Only the efficiency over that \
             of the shortest path leaves such rovers out.",
            set_number::count(none),
            set_number::counted(none + found, "rover")
        )
    })
}
