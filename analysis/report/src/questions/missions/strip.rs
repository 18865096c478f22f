//! Missions over time: pitch and roll, vertical acceleration, and the roughness class under the vehicle.

use super::maps::{Drawn, of_mission};
use crate::ReportError;
use crate::content::{Figure, Gives, Heading, Numbers, number, slug};
use crate::data::{Data, Group, Mission};
use crate::questions::outcome::{self, ALL};
use crate::questions::sql::quoted;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot, WIDTH, axis_room};
use crate::render::svg::{Anchor, Paint, Stroke, Svg};
use crate::render::{number as set, thin};
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::tables::SampleRow;

/// An angle of a sample, degrees.
type Angle = fn(&SampleRow) -> f64;

const PITCH: Stroke = Stroke { paint: Paint::Series(0), width: 1.6, dash: "", opacity: 1.0 };
const ROLL: Stroke = Stroke { paint: Paint::Series(1), width: 1.6, dash: "5 2.5", opacity: 1.0 };
const HEAVE: Stroke = Stroke { paint: Paint::Series(2), width: 1.1, dash: "", opacity: 1.0 };
/// Height of the band of classes, px.
const BAND: f64 = 12.0;
const ANGLES: f64 = 230.0;
const HEAVES: f64 = 190.0;
/// Outcomes shown, by their numbers: success, tipped, stuck.
const SHOWN: [usize; 3] = [0, 2, 1];

/// One figure for each outcome that has a mission with recorded samples.
pub fn figures(data: &Data, groups: &[Group<Mission>], drawn: &[Drawn]) -> Result<Vec<Figure>, ReportError> {
    let mut figures = Vec::new();
    for kind in SHOWN {
        let Some(mission) = shown(kind, groups, drawn) else { continue };
        // Several groups may be drawn on one terrain, each with the samples of its own missions; those of a large one are not all read.
        let read = drawn.iter().filter(|d| d.terrain.terrain_id == mission.terrain_id.as_str());
        let read = read.map(|d| of_mission(&d.samples, mission)).find(|samples| !samples.is_empty());
        let samples = match read {
            Some(samples) => samples.to_vec(),
            None => data.files.samples(&mission.terrain_id, &[mission.mission_id.as_str()].into())?,
        };
        figures.extend((samples.len() > 2).then(|| draw(mission, &samples)));
    }
    Ok(figures)
}

/// The mission of an outcome that is shown: the middle one of all on the drawn terrains, or on all terrains if these have none.
fn shown<'a>(kind: usize, groups: &[Group<'a, Mission>], drawn: &[Drawn<'a>]) -> Option<&'a Mission> {
    let of_kind = |m: &&&Mission| outcome::index(m) == kind;
    let near: Vec<&Mission> = drawn.iter().flat_map(|d| d.all.iter().filter(of_kind).copied()).collect();
    let all = || groups.iter().flat_map(|g| g.rows.iter().filter(of_kind).copied()).collect();
    middle(if near.is_empty() { all() } else { near })
}

/// The mission with the median vertical acceleration; those without a value come last.
fn middle(mut missions: Vec<&Mission>) -> Option<&Mission> {
    // NaN without a sign sorts after all numbers.
    let figure = |m: &Mission| m.rms_vertical_acceleration_m_s2.abs();
    missions.sort_by(|a, b| figure(a).total_cmp(&figure(b)));
    let known = missions.iter().filter(|m| figure(m).is_finite()).count();
    missions.get(known.max(1).saturating_sub(1) / 2).copied()
}

/// Second difference of the height over the squared time step, m/s2: NaN at both ends and where time does not advance.
fn heaves(samples: &[SampleRow]) -> Vec<f64> {
    let mut all = vec![f64::NAN; samples.len()];
    for (i, w) in samples.windows(3).enumerate() {
        let step = 0.5 * (w[2].time_s - w[0].time_s);
        all[i + 1] = if step > 0.0 { (w[2].z_m - 2.0 * w[1].z_m + w[0].z_m) / (step * step) } else { f64::NAN };
    }
    all
}

/// An axis that holds zero and the values, at least `least` long, with room below and above as shares of its length.
fn axis(values: impl Iterator<Item = f64> + Clone, least: f64, (below, above): (f64, f64)) -> Axis {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = (finite.clone().fold(0.0, f64::min), finite.fold(0.0, f64::max));
    let length = (high - low).max(least);
    Axis::linear(low - below * length, high + above * length)
}

fn draw(mission: &Mission, samples: &[SampleRow]) -> Figure {
    let id = slug(&format!("mission-{}-{}", mission.terrain_id, mission.mission_id));
    let heaves = heaves(samples);
    let angle_axis = axis(samples.iter().flat_map(|s| [s.pitch_deg, s.roll_deg]), 1.0, (0.06, 0.18));
    let heave_axis = axis(heaves.iter().copied(), 0.1, (0.2, 0.06));
    let room = axis_room(&angle_axis, ANGLES).max(axis_room(&heave_axis, HEAVES));
    let mut svg = Svg::new(WIDTH, ANGLES + HEAVES);
    svg.inset((0.0, 0.0), &angles(&id, mission, samples, angle_axis, room).svg);
    svg.inset((0.0, ANGLES), &vertical(&id, samples, &heaves, heave_axis, room).svg);
    finish(id, mission, samples, &heaves, svg)
}

fn time_axis(samples: &[SampleRow]) -> Axis {
    Axis::linear(0.0, samples.last().map_or(0.0, |s| s.time_s))
}

fn angles(id: &str, mission: &Mission, samples: &[SampleRow], y: Axis, room: f64) -> Plot {
    let entries: [Entry; 2] =
        [(Mark::Line(PITCH), "pitch (nose down positive)".into()), (Mark::Line(ROLL), "roll".into())];
    let x = (time_axis(samples), "");
    let mut plot = Plot::with_room((WIDTH, ANGLES), x, (y, "angle, °"), &entries, room);
    plot.clip(&format!("{id}-angles"));
    let end = plot.x.range().1;
    plot.line([(0.0, 0.0), (end, 0.0)], Stroke::new(Paint::Muted, 1.0));
    let curves: [(Angle, Stroke); 2] = [(|s| s.pitch_deg, PITCH), (|s| s.roll_deg, ROLL)];
    for (angle, stroke) in curves {
        let placed = plot.place(samples.iter().map(|s| (s.time_s, angle(s))));
        plot.svg.polyline(&thin::line(&placed, 0.7), stroke);
    }
    plot.svg.close();
    mark_end(&mut plot, mission, samples);
    plot
}

/// The mark of the outcome at the last sample, on the zero line, with its name.
fn mark_end(plot: &mut Plot, mission: &Mission, samples: &[SampleRow]) {
    let kind = outcome::index(mission);
    let end = samples.last().map_or(0.0, |s| s.time_s);
    let Some(&(x, y)) = plot.place([(end, 0.0)]).first() else { return };
    plot.svg.symbol(ALL[kind].symbol, (x, y), 8.0, Paint::Paper);
    plot.svg.symbol(ALL[kind].symbol, (x, y), 6.0, Paint::Outcome(kind));
    let top = plot.place([(end, plot.y.range().1)]).first().map_or(y, |p| p.1);
    let words = format!("{} after {}", ALL[kind].name, set::with_unit(mission.time_s, 3, "s"));
    plot.svg.text((x - 8.0, top + 17.0), Anchor::End, Paint::Outcome(kind), &words);
}

fn vertical(id: &str, samples: &[SampleRow], heaves: &[f64], y: Axis, room: f64) -> Plot {
    let axes = ((time_axis(samples), "time, s"), (y, "m/s²"));
    let mut plot = Plot::with_room((WIDTH, HEAVES), axes.0, axes.1, &legend(samples), room);
    plot.clip(&format!("{id}-heaves"));
    let end = plot.x.range().1;
    plot.line([(0.0, 0.0), (end, 0.0)], Stroke::new(Paint::Muted, 1.0));
    plot.line(samples.iter().zip(heaves).map(|(s, a)| (s.time_s, *a)), HEAVE);
    draw_classes(&mut plot, samples);
    plot.svg.close();
    plot
}

fn legend(samples: &[SampleRow]) -> Vec<Entry> {
    let mut entries: Vec<Entry> = vec![(Mark::Line(HEAVE), "vertical acceleration".into())];
    let occurs = |class: &RoughnessClass| samples.iter().any(|s| s.class == Some(*class as i64));
    let entry = |c: RoughnessClass| (Mark::Fill(Paint::Fixed(c.colour())), format!("class {}", c.name()));
    entries.extend(RoughnessClass::ALL.into_iter().filter(occurs).map(entry));
    entries
}

/// A band along the bottom of the frame, one box per run of one class.
fn draw_classes(plot: &mut Plot, samples: &[SampleRow]) {
    let low = plot.y.range().0;
    for run in samples.chunk_by(|a, b| a.class == b.class) {
        let class = run[0].class.and_then(|c| u8::try_from(c).ok()).and_then(RoughnessClass::from_code);
        let times = [run[0].time_s, run[run.len() - 1].time_s + spacing(samples)];
        let corners = plot.place(times.map(|t| (t, low)));
        if let (Some(class), [from, to]) = (class, corners.as_slice()) {
            plot.svg.rect((from.0, from.1 - BAND), (to.0 - from.0, BAND), Paint::Fixed(class.colour()), 1.0);
        }
    }
}

/// Time between samples.
fn spacing(samples: &[SampleRow]) -> f64 {
    samples.get(1).map_or(0.0, |s| s.time_s - samples[0].time_s)
}

fn finish(id: String, mission: &Mission, samples: &[SampleRow], heaves: &[f64], svg: Svg) -> Figure {
    let outcome = ALL[outcome::index(mission)].name;
    let caption = format!(
        "{} on {}. Top: pitch and roll. Bottom: vertical acceleration and, along the lower edge, the roughness class under the vehicle, \
         cell by cell before the class map was closed. Recording: {}.",
        mission.mission_id, mission.terrain_id, mission.path
    );
    let largest = heaves.iter().filter(|v| v.is_finite()).fold(0.0, |a: f64, v| a.max(v.abs()));
    let description = format!(
        "Pitch, roll and vertical acceleration over {} until {outcome}; largest pitch {}, largest roll {}, largest vertical \
         acceleration {}.",
        set::with_unit(mission.time_s, 3, "s"),
        set::with_unit(mission.max_pitch_deg, 3, "°"),
        set::with_unit(mission.max_roll_deg, 3, "°"),
        set::with_unit(largest, 3, "m/s²"),
    );
    let query =
        format!("terrain_id = {} and mission_id = {}", quoted(&mission.terrain_id), quoted(&mission.mission_id));
    let columns = ["sample", "time_s", "pitch_deg", "roll_deg", "z_m", "class"];
    let mut numbers = Numbers { gives: Gives::Input, ..Numbers::select(&query, samples, &columns) };
    numbers.columns.push(Heading { name: "vertical_acceleration_m_s2".into(), unit: "m/s2".into() });
    numbers.rows.iter_mut().zip(heaves).for_each(|(row, a)| row.push(number(*a)));
    Figure { id, title: format!("A mission with the outcome {outcome}."), caption, description, svg, numbers }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::questions::missions::maps;

    /// The mission shown is the median of all missions on the drawn terrains, also where their maps show a sample.
    #[test]
    fn val_the_mission_shown_is_the_median_of_all() {
        let mut data = crate::tests::made_up::full(1, 24);
        data.missions.retain(|m| m.variant.is_none());
        let few = std::mem::take(&mut data.missions);
        let copy = |(k, m): (usize, &Mission)| Mission {
            mission_id: format!("{}-{k:03}", m.mission_id).into(),
            rms_vertical_acceleration_m_s2: m.rms_vertical_acceleration_m_s2 + 1e-3 * k as f64,
            ..m.clone()
        };
        data.missions = few.iter().flat_map(|m| (0..100).map(move |k| (k, m))).map(copy).collect();
        let groups = data.mission_groups();
        let drawn = maps::drawn(&data, &groups).unwrap();
        assert!(drawn.len() == 3 && drawn.iter().all(|d| d.all.len() == 800 && d.missions.len() == 400));
        for kind in SHOWN {
            let of_kind = data.missions.iter().filter(|m| outcome::index(m) == kind);
            let mut values: Vec<f64> = of_kind.map(|m| m.rms_vertical_acceleration_m_s2).collect();
            values.sort_by(f64::total_cmp);
            let expected = values[(values.len() - 1) / 2];
            assert_eq!(shown(kind, &groups, &drawn).unwrap().rms_vertical_acceleration_m_s2, expected);
        }
    }
}
