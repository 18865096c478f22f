//! How far rovers get that know only what they see: efficiency and arrival by set of worlds, published trials beside ours, distance budgets,
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
use crate::ReportError;
use crate::content::Block;
use crate::data::Data;
use crate::render::number as set_number;
use sets::Set;
use worlds::{ARRIVED, EFFICIENCY, OF_ARRIVALS};

/// Registry entry.
pub const QUESTION: Question = Question { id: "rovers", name: "Rovers", title: "How far do the rovers get?", answer };

/// Fewest worlds that intervals should stand on.
const WORLDS_MIN: usize = 20;
/// Sets of which the first paragraph speaks.
const SPOKEN_MAX: usize = 6;

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let sets = sets::plain(data);
    if sets.is_empty() {
        return Ok(effects::blocks(data));
    }
    let mut blocks = vec![Block::Text(verdict(&sets))];
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
        Block::Heading("Ends, effort and contacts".into()),
        Block::Text(EFFORT.into()),
        Block::Figures(vec![outcomes::figure(&sets)]),
        Block::Table(efficiency::effort(&sets)),
    ]);
    let maps = tracks::figures(data, &sets)?;
    if !maps.is_empty() {
        blocks.extend([Block::Heading("Tracks".into()), Block::Text(tracks::WORDS.into()), Block::Figures(maps)]);
    }
    blocks.extend(design::blocks(data));
    blocks.extend(effects::blocks(data));
    blocks.push(Block::FoldedTable(efficiency::worlds(&sets)));
    Ok(blocks)
}

const EFFICIENCIES: &str = "Efficiency of a rover is the straight distance over what it drove and what was left in the end. Its mean over rovers and the straight distance over \
the mean distance are two figures: a few short ways lift the first, a few long ones lower the second. Intervals go over worlds, which are the independent trials: those of \
means and ratios are Student's for the linearised ratio of world totals (Cochran, 1977), on the logarithm; those of shares are Korn and Graubard's (1998), where all or no \
rovers arrive with worlds as single trials. Intervals and bands end at what a straight drive would have: an efficiency of 1; straight over mean distance may be slightly \
more, because rovers stop within a tolerance of their goal. At half the limit: each rover as if stopped after half of its distance limit. Over the ground's: over the efficiency of \
the shortest way on the whole map, for rovers that have one; the others stay in all figures.";
const ALIKE: &str = "Rovers of one world share its rocks and often a goal. The intraclass correlation is the share of the variance between worlds (analysis of variance, Searle's \
interval, exact for normal values); the design effect is the factor on the variance of a mean that it makes (Kish, 1965).";
const EFFORT: &str = "Contacts are rocks higher than the clearance that came under the rover, centre contacts those under its centre line. Means are over all rovers, those that \
were stopped included.";

/// How far the rovers got; `None` without rovers.
pub(super) fn in_words(data: &Data) -> Option<String> {
    let sets = sets::plain(data);
    (!sets.is_empty()).then(|| verdict(&sets))
}

/// What the sets say, in a sentence each.
fn verdict(sets: &[Set]) -> String {
    let sentence = |set: &Set| {
        let (arrived, efficiency, of_arrivals) = (ARRIVED.pooled(set), EFFICIENCY.pooled(set), OF_ARRIVALS.pooled(set));
        let [low, high] = arrived.ends();
        let interval = match arrived.interval {
            Some(_) => format!(" ({} to {} %)", set_number::fixed(100.0 * low, 0), set_number::fixed(100.0 * high, 0)),
            None => String::new(),
        };
        let arrivals = match of_arrivals.value.is_finite() {
            true => format!(", {} of those that arrive", set_number::significant(of_arrivals.value, 2)),
            false => String::new(),
        };
        format!(
            "{}: {}{interval} of the rovers reach their goal. The mean efficiency is {} of all rovers{arrivals}.",
            set.name,
            set_number::percent(arrived.value, 0),
            set_number::significant(efficiency.value, 2)
        )
    };
    let mut ranked: Vec<&Set> = sets.iter().collect();
    if sets.len() > SPOKEN_MAX {
        ranked.sort_by(|a, b| EFFICIENCY.pooled(b).value.total_cmp(&EFFICIENCY.pooled(a).value));
        ranked = [ranked.first(), ranked.last()].into_iter().flatten().copied().collect();
        let words: Vec<String> = ranked.iter().map(|s| sentence(s)).collect();
        return format!("The best and the worst of {} sets. {}", set_number::count(sets.len()), words.join(" "));
    }
    ranked.iter().map(|s| sentence(s)).collect::<Vec<_>>().join(" ")
}

/// Sets on too few worlds.
fn few_worlds(sets: &[Set]) -> Option<String> {
    let few: Vec<&Set> = sets.iter().filter(|s| s.worlds.len() < WORLDS_MIN).collect();
    let least = few.iter().map(|s| s.worlds.len()).min()?;
    let all =
        if few.len() == sets.len() { "Every set".to_owned() } else { format!("{} of {} sets", few.len(), sets.len()) };
    let ends = if least < 2 {
        "One world alone has no interval at all."
    } else {
        "Intervals over so few are wide, and only as good as their assumptions."
    };
    Some(format!(
        "{all} stands on fewer than {WORLDS_MIN} worlds (the least: {}). Rovers of one world are not independent, so worlds count, not rovers. {ends}",
        set_number::count(least)
    ))
}

/// Rovers that ended off the ground.
fn off_ground(sets: &[Set]) -> Option<String> {
    let all = || sets.iter().flat_map(Set::rovers);
    let off = all().filter(|r| sets::off_ground(r)).count();
    (off > 0).then(|| {
        format!(
            "{} of {} ended off the known ground. They have shown no efficiency: in its means they count as 0, and the greatest and the least of a world leave \
             them out.",
            set_number::count(off),
            set_number::counted(all().count(), "rover")
        )
    })
}

/// Rovers for which the ground has no way.
fn no_way(sets: &[Set]) -> Option<String> {
    let of = |is: bool| sets.iter().flat_map(Set::rovers).filter(|r| efficiency::without_way(r) == Some(is)).count();
    let (none, found) = (of(true), of(false));
    (none > 0).then(|| {
        format!(
            "For {} of {} rovers the ground has no way that keeps the wheels clear of rocks above the clearance and off steep sand. They stay in all \
             figures but the efficiency over the ground's.",
            set_number::count(none),
            set_number::count(none + found)
        )
    })
}
