//! Selection of the points of a cloud to be gridded, and their extent.

use super::cloud::{Cloud, Point};
use super::header::DeclaredSize;
use crate::dem::crs::Crs;
use crate::dem::raster::Refusal;
use sastrugi_schemas::{counted, shown};

/// The selected points of a cloud.
pub(super) struct Chosen<'a> {
    pub cloud: &'a Cloud,
    /// Select only points of class 2, ground.
    pub ground_only: bool,
}

impl Chosen<'_> {
    /// Calls `f` with every selected point, in the order of the file.
    pub fn for_each(&self, mut f: impl FnMut(Point)) -> Result<(), Refusal> {
        self.cloud.for_each(|point| {
            if !point.is_noise() && (point.is_ground() || !self.ground_only) {
                f(point);
            }
        })
    }
}

/// Number and extent of the selected points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Survey {
    pub points: u64,
    /// Lowest and highest x and y.
    pub low: [f64; 2],
    pub high: [f64; 2],
}

/// Surveys all points in one pass; also returns notes on the points left out.
pub(super) fn survey(chosen: &Chosen<'_>) -> Result<(Survey, Vec<String>), Refusal> {
    let cloud = chosen.cloud;
    let (mut points, mut noise, mut other) = (0_u64, 0_u64, 0_u64);
    let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
    cloud.for_each(|point| {
        if point.is_noise() {
            noise += 1;
        } else if chosen.ground_only && !point.is_ground() {
            other += 1;
        } else {
            points += 1;
            for axis in 0..2 {
                low[axis] = low[axis].min(point.stored[axis]);
                high[axis] = high[axis].max(point.stored[axis]);
            }
        }
    })?;
    let total = counted(cloud.declared.points, "point");
    if points == 0 && other > 0 {
        return Err(Refusal::new(format!("has {total}, but none of class 2, ground")));
    }
    if points == 0 {
        return Err(Refusal::new(format!("every point is withheld or noise, {total} in all")));
    }
    let place = |stored: [i32; 2]| [0, 1].map(|axis| cloud.coordinate(axis, f64::from(stored[axis])));
    let survey = Survey { points, low: place(low), high: place(high) };
    let mut notes = cloud.crs.unit_notes();
    if cloud.crs == Crs::default() {
        notes.push("the file names no reference system; coordinates are treated as metres".to_owned());
    }
    if noise > 0 {
        let noise = counted(noise, "point");
        notes.push(format!("left out {noise} marked as withheld or noise (classes 7 and 18)"));
    }
    if other > 0 {
        notes.push(format!("left out {} not of class 2, ground", counted(other, "point")));
    }
    Ok((survey, notes))
}

/// Refuses points outside the box that the header states. A box may be rounded by a cell, or by the step of the stored coordinates.
pub(super) fn check_stated(survey: &Survey, declared: &DeclaredSize, cell_m: f64) -> Result<(), Refusal> {
    let DeclaredSize { stated_low, stated_high, scale, .. } = declared;
    let is_outside = |&axis: &usize| {
        let rounding = scale[axis].max(cell_m);
        survey.low[axis] < stated_low[axis] - rounding || survey.high[axis] > stated_high[axis] + rounding
    };
    let Some(axis) = (0..2).find(is_outside) else { return Ok(()) };
    let [low, high] = [stated_low[axis], stated_high[axis]].map(shown);
    let [from, to] = [survey.low[axis], survey.high[axis]].map(shown);
    Err(Refusal::new(format!(
        "its header states {} from {low} to {high} m, but its points reach from {from} to {to} m; correct the box in the header, or \
         remove the points outside it",
        ["x", "y"][axis]
    )))
}
