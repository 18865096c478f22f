//! One mission against time: pitch, roll, and the roughness class under the vehicle.

use crate::ReportError;
use crate::content::{Figure, Numbers, Size, slug};
use crate::data::Data;
use crate::questions::outcome;
use crate::render::axis::Axis;
use crate::render::chart::{Entry, Mark, Plot};
use crate::render::svg::{Paint, Stroke};
use crate::render::{number as set, thin};
use sastrugi_numeric::sums;
use sastrugi_schemas::RoughnessClass;
use sastrugi_schemas::tables::{MissionRow, SampleRow};

/// A figure of a sample.
type Angle = fn(&SampleRow) -> f64;

const PITCH: Stroke = Stroke { paint: Paint::Series(0), width: 1.6, dash: "", opacity: 1.0 };
const ROLL: Stroke = Stroke { paint: Paint::Series(1), width: 1.6, dash: "5 2.5", opacity: 1.0 };
/// Height of the band of classes, in the units of the axis's length.
const BAND: f64 = 0.05;

/// The successful mission whose vertical acceleration is nearest to the median of all successful ones (the first mission
/// when none succeeded); `None` without its samples.
pub fn figure(data: &Data) -> Result<Option<Figure>, ReportError> {
    let Some(mission) = typical(data) else { return Ok(None) };
    let mut samples = data.files.samples(&mission.terrain_id)?;
    samples.retain(|s| s.mission_id == mission.mission_id);
    Ok((samples.len() > 1).then(|| draw(mission, &samples)))
}

fn typical(data: &Data) -> Option<&MissionRow> {
    let figure = |m: &MissionRow| m.rms_vertical_acceleration_m_s2;
    let goals: Vec<&MissionRow> =
        data.missions.iter().filter(|m| outcome::successful(m) && figure(m).is_finite()).collect();
    let middle = sums::median(&goals.iter().map(|m| figure(m)).collect::<Vec<_>>());
    let distance = |m: &MissionRow| (figure(m) - middle).abs();
    goals.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).or(data.missions.first())
}

fn draw(mission: &MissionRow, samples: &[SampleRow]) -> Figure {
    let id = slug(&format!("mission-{}-{}", mission.terrain_id, mission.mission_id));
    let angles = || samples.iter().flat_map(|s| [s.pitch_deg, s.roll_deg]).filter(|v| v.is_finite());
    let (low, high) = (angles().fold(0.0, f64::min), angles().fold(0.0, f64::max));
    let room = (high - low).max(1.0);
    let y = Axis::linear(low - 0.16 * room, high + 0.06 * room);
    let end = samples.last().map_or(0.0, |s| s.time_s);
    let mut plot = Plot::new((900.0, 320.0), (Axis::linear(0.0, end), "time, s"), (y, "angle, °"), &legend(samples));
    plot.clip(&format!("{id}-clip"));
    draw_classes(&mut plot, samples);
    plot.line([(0.0, 0.0), (end, 0.0)], Stroke::new(Paint::Muted, 1.0));
    let angles: [(Angle, Stroke); 2] = [(|s| s.pitch_deg, PITCH), (|s| s.roll_deg, ROLL)];
    for (angle, stroke) in angles {
        let placed = plot.place(samples.iter().map(|s| (s.time_s, angle(s))));
        plot.svg.polyline(&thin::line(&placed, 0.7), stroke);
    }
    plot.svg.close();
    finish(id, mission, samples, plot)
}

fn legend(samples: &[SampleRow]) -> Vec<Entry> {
    let mut entries: Vec<Entry> =
        vec![(Mark::Line(PITCH), "pitch (nose down positive)".into()), (Mark::Line(ROLL), "roll".into())];
    let occurs = |class: &RoughnessClass| samples.iter().any(|s| s.class == Some(*class as i64));
    let classes = RoughnessClass::ALL.into_iter().filter(occurs);
    entries.extend(classes.map(|c| (Mark::Fill(Paint::Fixed(c.colour())), c.name().to_owned())));
    entries
}

/// A band along the bottom of the frame, one box per run of one class.
fn draw_classes(plot: &mut Plot, samples: &[SampleRow]) {
    let (low, high) = plot.y.range();
    for run in samples.chunk_by(|a, b| a.class == b.class) {
        let class = run[0].class.and_then(|c| u8::try_from(c).ok()).and_then(RoughnessClass::from_code);
        let times = [run[0].time_s, run[run.len() - 1].time_s + spacing(samples)];
        let corners = plot.place([(times[0], low + BAND * (high - low)), (times[1], low)]);
        if let (Some(class), [from, to]) = (class, corners.as_slice()) {
            plot.svg.rect(*from, (to.0 - from.0, to.1 - from.1), Paint::Fixed(class.colour()), 1.0);
        }
    }
}

/// Time between samples.
fn spacing(samples: &[SampleRow]) -> f64 {
    samples.get(1).map_or(0.0, |s| s.time_s - samples[0].time_s)
}

fn finish(id: String, mission: &MissionRow, samples: &[SampleRow], plot: Plot) -> Figure {
    let outcome = outcome::ALL[outcome::index(mission)].name;
    let which = if outcome::successful(mission) {
        "the successful mission with the middle vertical acceleration"
    } else {
        "the first mission"
    };
    let caption = format!(
        "Mission {} on {} ({outcome}, {}), {which}. The band at the foot is the roughness class under the vehicle. \
         Recording: {}.",
        mission.mission_id,
        mission.terrain_id,
        set::with_unit(mission.time_s, 3, "s"),
        mission.path
    );
    let description = format!(
        "Pitch and roll over {}; largest pitch {}, largest roll {}.",
        set::with_unit(mission.time_s, 3, "s"),
        set::with_unit(mission.max_pitch_deg, 3, "°"),
        set::with_unit(mission.max_roll_deg, 3, "°")
    );
    let query =
        format!("tables/samples where terrain_id = '{}' and mission_id = '{}'", mission.terrain_id, mission.mission_id);
    let numbers = Numbers::select(query, samples, &["sample", "time_s", "pitch_deg", "roll_deg", "class"]);
    Figure { id, title: "Pitch and roll.".into(), caption, description, svg: plot.svg, size: Size::Wide, numbers }
}
