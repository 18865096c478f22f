//! How the loss of a member affects a team: errors around the loss, time to return to tolerance, tracks, events.

use super::Question;
use super::clusters::{Clusters, LEVEL, stream};
use super::routes::TERRAINS_MIN;
use super::team::{Instant, Run, Scene, TOLERABLE, errors, runs, tracks};
use crate::ReportError;
use crate::content::{Block, Figure, Numbers, TableBlock, number, slug, text};
use crate::data::Data;
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::{FormationEventRow, FormationRow};
use std::collections::{BTreeMap, BTreeSet};

/// Registry entry.
pub const QUESTION: Question =
    Question { id: "losses", name: "Losses", title: "Do teams recover from the loss of a member?", answer };

/// How long a team must stay in tolerance to count as recovered, s.
const HOLD_S: f64 = 5.0;
/// Time drawn before and after a loss, s.
const WINDOW_S: [f64; 2] = [10.0, 60.0];
/// Recovery time of a team that does not recover: longer than any run, but finite, so that medians and bootstrap samples sort it.
const NEVER_S: f64 = 1e12;
/// Largest number of losses whose tracks are drawn.
const TRACKS_MAX: usize = 3;

/// A loss.
struct Loss<'a> {
    run: &'a FormationRow,
    event: &'a FormationEventRow,
    /// Instants from some time before the loss to the next one of the run or its end, with their time since the loss.
    instants: Vec<Instant>,
}

impl Loss<'_> {
    /// Time until the team is in tolerance and stays there for [`HOLD_S`]; `None` if that does not happen before the next loss or the
    /// end of the run, or if there are no followers.
    fn recovery_s(&self) -> Option<f64> {
        let after: Vec<&Instant> = self.instants.iter().filter(|i| i.time_s >= 0.0).collect();
        let within = |i: &&Instant| i.worst_m <= TOLERABLE * self.run.spacing_m;
        let mut stretches = after.chunk_by(|a, b| within(a) == within(b)).filter(|s| within(&s[0]));
        let held = stretches.find(|s| s[s.len() - 1].time_s - s[0].time_s >= HOLD_S)?;
        Some(held[0].time_s)
    }

    /// True if the team was in tolerance just before the loss; `None` if it had no followers then.
    fn in_tolerance_before(&self) -> Option<bool> {
        let last = self.instants.iter().rfind(|i| i.time_s < 0.0)?;
        Some(last.worst_m <= TOLERABLE * self.run.spacing_m)
    }
}

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let rows: Vec<&FormationRow> = data.formations.iter().filter(|f| f.lost > 0).collect();
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let runs = runs(data, &rows)?;
    let losses = losses(data, &runs);
    let mut blocks = vec![Block::Text(verdict(data, &losses, &rows)), Block::Table(table(data, &losses))];
    blocks.push(Block::Figures(curves(&losses)));
    let maps = maps(data, &losses)?;
    if !maps.is_empty() {
        let words = format!(
            "{} of {}: those with the shortest, the median and the longest time until the team returned to tolerance, where they differ. \
             Members are marked at the loss; the window is fourteen spacings wide.",
            set::count(maps.len()),
            set::counted(losses.len(), "loss")
        );
        blocks.extend([Block::Heading("Tracks around a loss".into()), Block::Text(words), Block::Figures(maps)]);
    }
    blocks.push(Block::FoldedTable(events(data, &rows)));
    Ok(blocks)
}

/// Losses of the runs in order of run and time.
fn losses<'a>(data: &'a Data, runs: &[Run<'a>]) -> Vec<Loss<'a>> {
    let mut losses = Vec::new();
    for Run { row, instants } in runs {
        let of_run =
            |e: &&FormationEventRow| e.terrain_id == row.terrain_id && e.run_id == row.run_id && e.kind == "lost";
        let events: Vec<&FormationEventRow> =
            data.formation_events.iter().filter(of_run).filter(|e| e.time_s.is_finite()).collect();
        for (k, event) in events.iter().enumerate() {
            let before = k.checked_sub(1).map_or(f64::NEG_INFINITY, |b| events[b].time_s);
            let next = events.get(k + 1).map_or(f64::INFINITY, |n| n.time_s);
            let near = |i: &&Instant| i.time_s >= before.max(event.time_s - WINDOW_S[0]) && i.time_s < next;
            let shifted = |i: &Instant| Instant { time_s: i.time_s - event.time_s, ..*i };
            losses.push(Loss { run: row, event, instants: instants.iter().filter(near).map(shifted).collect() });
        }
    }
    losses
}

/// Losses whose recovery can be determined: the team has followers and its spacing is known.
fn telling<'a, 'b>(losses: &'b [Loss<'a>]) -> Vec<&'b Loss<'a>> {
    let tells = |l: &&Loss| l.run.spacing_m > 0.0 && l.instants.iter().any(|i| i.time_s >= 0.0);
    losses.iter().filter(tells).collect()
}

fn verdict(data: &Data, losses: &[Loss], rows: &[&FormationRow]) -> String {
    let lost: i64 = rows.iter().map(|r| r.lost).sum();
    let telling = telling(losses);
    let before = telling.iter().filter(|l| l.in_tolerance_before() == Some(true)).count();
    let back: Vec<f64> = telling.iter().filter_map(|l| l.recovery_s()).collect();
    let members = set::counted(count_of(lost), "member");
    let were = if lost == 1 { "was" } else { "were" };
    let introduction = format!("{members} {were} lost in {}.", set::counted(rows.len(), "run"));
    if telling.is_empty() {
        return format!("{introduction} No recording shows what followed.");
    }
    let time = match back.is_empty() {
        true => "No team returned to tolerance.".to_owned(),
        false => format!(
            "After {} of {}, the team returned to tolerance ({} of the spacing, every follower, for at least {} s); the median time is {}{}, \
             counting losses without a return as longer than any.",
            set::count(back.len()),
            set::counted(telling.len(), "loss"),
            set::percent(TOLERABLE, 0),
            set::fixed(HOLD_S, 0),
            time_words(sums::median(&recoveries(&telling).iter().map(|r| r.1).collect::<Vec<_>>())),
            interval_words(data, &telling)
        ),
    };
    let before = match before {
        0 => "No team was".to_owned(),
        1 => "1 team was".to_owned(),
        n => format!("{} teams were", set::count(n)),
    };
    format!("{introduction} {time} {before} in tolerance just before the loss.")
}

fn count_of(n: i64) -> usize {
    usize::try_from(n).unwrap_or(0)
}

/// Recovery time after each loss, with its terrain; [`NEVER_S`] if the team does not recover.
fn recoveries<'a>(losses: &[&Loss<'a>]) -> Vec<(&'a str, f64)> {
    losses.iter().map(|l| (l.run.terrain_id.as_str(), l.recovery_s().unwrap_or(NEVER_S))).collect()
}

/// A median of recoveries in words.
fn time_words(time_s: f64) -> String {
    if time_s < 0.25 * NEVER_S { set::with_unit(time_s, 3, "s") } else { "longer than recorded".into() }
}

fn interval_words(data: &Data, losses: &[&Loss]) -> String {
    let items = recoveries(losses);
    let terrains = items.iter().map(|i| i.0).collect::<BTreeSet<_>>().len();
    if terrains < TERRAINS_MIN {
        return format!(" (no interval: only {})", set::counted(terrains, "terrain"));
    }
    let mut stream = stream(data, "losses", "recovery");
    let interval = Clusters::new(&[items]).interval(&mut stream, LEVEL, |pooled| sums::median(&pooled[0]));
    interval.map_or_else(String::new, |i| {
        format!(
            " ({} % interval {} to {}, resampling terrains)",
            set::fixed(100.0 * LEVEL, 0),
            time_words(i.low),
            time_words(i.high)
        )
    })
}

fn table(data: &Data, losses: &[Loss]) -> TableBlock {
    let columns = [
        ("run", ""),
        ("terrain", ""),
        ("formation", ""),
        ("lost at", "s"),
        ("member", "1"),
        ("in tolerance before", ""),
        ("back in tolerance after", "s"),
        ("largest error", "m"),
        ("rearranged", ""),
        ("outcome", ""),
    ];
    let query = "select terrain_id, run_id, event, time_s, kind, member, text from 'tables/formation_events/*.parquet' where kind in ('lost', 'rearranged')";
    let mut numbers = Numbers::computed(query, &columns);
    for loss in losses {
        let known = loss.run.spacing_m > 0.0;
        let before = match loss.in_tolerance_before().filter(|_| known) {
            Some(true) => "yes",
            Some(false) => "no",
            None => set::ABSENT,
        };
        let worst = loss.instants.iter().filter(|i| i.time_s >= 0.0).map(|i| i.worst_m).fold(f64::NAN, f64::max);
        numbers.row([
            text(&loss.run.run_id),
            text(&loss.run.terrain_id),
            text(&loss.run.formation),
            number(loss.event.time_s),
            loss.event.member.map_or(sastrugi_schemas::Cell::Null, sastrugi_schemas::Cell::I64),
            text(before),
            number(loss.recovery_s().filter(|_| known).unwrap_or(f64::NAN)),
            number(worst),
            text(rearranged(data, loss)),
            text(&loss.run.outcome),
        ]);
    }
    TableBlock { id: "losses".into(), caption: "Losses".into(), numbers }
}

/// Descriptions of the rearrangements after a loss.
fn rearranged(data: &Data, loss: &Loss) -> String {
    let event = loss.event;
    let own = |e: &&FormationEventRow| {
        e.terrain_id == event.terrain_id && e.run_id == event.run_id && e.kind == "rearranged" && e.event > event.event
    };
    let next = data.formation_events.iter().filter(|e| {
        e.terrain_id == event.terrain_id && e.run_id == event.run_id && e.kind == "lost" && e.event > event.event
    });
    let until = next.map(|e| e.event).min().unwrap_or(i64::MAX);
    let words: Vec<&str> =
        data.formation_events.iter().filter(own).filter(|e| e.event < until).map(|e| e.text.as_str()).collect();
    if words.is_empty() { set::ABSENT.into() } else { words.join(" ") }
}

/// Errors around the losses of each formation.
fn curves(losses: &[Loss]) -> Vec<Figure> {
    let mut formations: BTreeMap<&str, Vec<Vec<Instant>>> = BTreeMap::new();
    for loss in losses {
        let shown = loss.instants.iter().filter(|i| i.time_s <= WINDOW_S[1]).copied().collect();
        formations.entry(&loss.run.formation).or_default().push(shown);
    }
    let figure = |(formation, series): (&str, Vec<Vec<Instant>>)| {
        let caption = format!(
            "{}. Means over followers and losses; the band holds 5 to 95 % of the losses. A loss drops out at the next loss of its run.",
            set::counted(series.len(), "loss")
        );
        let query = "select terrain_id, run_id, member, time_s, depth_error_m, width_error_m from 'tables/formation_samples/*.parquet' where state != 'lost'";
        let words = [format!("Errors around a loss, {formation}."), caption];
        errors(slug(&format!("loss-errors-{formation}")), words, &series, "time since the loss, s", query.to_owned())
    };
    formations.into_iter().filter_map(figure).collect()
}

/// Tracks around the losses with the shortest, the median and the longest recovery.
fn maps(data: &Data, losses: &[Loss]) -> Result<Vec<Figure>, ReportError> {
    let mut ranked: Vec<(f64, &Loss)> =
        telling(losses).into_iter().map(|l| (l.recovery_s().unwrap_or(f64::INFINITY), l)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let last = ranked.len().saturating_sub(1);
    let places: BTreeSet<usize> = [0, last / 2, last].into_iter().collect();
    let mut figures = Vec::new();
    for (_, loss) in places.into_iter().take(TRACKS_MAX).filter_map(|k| ranked.get(k)) {
        let member = loss.event.member.unwrap_or(1);
        let scene = Scene {
            id: slug(&format!("loss-tracks-{}-{}-{}", loss.run.terrain_id, loss.run.run_id, loss.event.event)),
            title: format!("Loss of member {member}, {}.", loss.run.formation),
            run: loss.run,
            time_s: loss.event.time_s,
            member,
            marks: "at the loss",
        };
        figures.extend(tracks(data, scene)?);
    }
    Ok(figures)
}

fn events(data: &Data, rows: &[&FormationRow]) -> TableBlock {
    let with_losses: BTreeSet<(&str, &str)> = rows.iter().map(|r| (r.terrain_id.as_str(), r.run_id.as_str())).collect();
    let kinds = ["lost", "rearranged"];
    let shown = data.formation_events.iter().filter(|e| {
        kinds.contains(&e.kind.as_str()) && with_losses.contains(&(e.terrain_id.as_str(), e.run_id.as_str()))
    });
    let names = ["terrain_id", "run_id", "time_s", "kind", "member", "text"];
    let numbers = Numbers::select("kind in ('lost', 'rearranged')", shown, &names);
    TableBlock { id: "loss-events".into(), caption: "Losses and rearrangements".into(), numbers }
}
