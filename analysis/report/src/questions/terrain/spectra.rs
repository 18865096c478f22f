//! Power spectral densities with their fitted slopes, and height distributions, one frame per group on common axes.

use super::median;
use crate::content::{Figure, Numbers, slug};
use crate::data::{Data, Group};
use crate::questions::curves::{self, Curve};
use crate::questions::sql;
use crate::render::chart::Plot;
use crate::render::number as set;
use crate::render::svg::{Paint, Stroke};
use sastrugi_schemas::tables::{HeightDistributionRow, PsdRow, TerrainRow};

/// A group that has curves.
type Drawn<'a, 'b> = (&'b Group<'a, TerrainRow>, Vec<Curve>);

fn drawn<'a, 'b>(groups: &'b [Group<'a, TerrainRow>], points: impl Fn(&str) -> Vec<(f64, f64)>) -> Vec<Drawn<'a, 'b>> {
    let curves = |g: &Group<TerrainRow>| {
        // Thin lines keep many curves distinguishable.
        let opacity = (3.0 / g.rows.len() as f64).clamp(0.25, 1.0);
        let stroke = Stroke::new(Paint::Series(g.index), if g.rows.len() > 3 { 1.1 } else { 1.7 }).faint(opacity);
        let curve = |t: &&TerrainRow| Curve { name: None, stroke, points: points(&t.terrain_id) };
        g.rows.iter().map(curve).filter(|c| c.points.len() > 1).collect::<Vec<_>>()
    };
    groups.iter().map(|g| (g, curves(g))).filter(|(_, c)| !c.is_empty()).collect()
}

/// One frame per group.
pub fn spectra(data: &Data, groups: &[Group<TerrainRow>]) -> Vec<Figure> {
    let drawn = drawn(groups, |id| curves::spectrum(&data.spectrum(id)));
    let ranges = curves::ranges(drawn.iter().flat_map(|(_, c)| c));
    let figure = |(group, curves): &Drawn| {
        let id = file_id("psd", group);
        let middle = median(&group.rows, |t| t.psd_slope);
        let band = curves::slope_band(group.rows[0]);
        let covered = curves::covers(band, curves);
        let slope = curves::slope(middle, band, curves).filter(|_| covered);
        let mut plot = curves::spectra(&id, curves, ranges, slope);
        if slope.is_some() {
            plot.note(0, &format!("slope {}", set::fixed(middle, 2)));
        }
        let ends = format!("{} to {}", set::significant(band[0], 2), set::with_unit(band[1], 2, "cycles/m"));
        let of_slope = match (covered, slope.is_some()) {
            (true, true) => format!("; dashed: the median of their slopes, fitted from {ends}."),
            (true, false) => ".".to_owned(),
            (false, _) => format!(
                ". The spectrum does not cover the band in which its slope is fitted, {ends}, so the slope is not drawn."
            ),
        };
        let caption = format!(
            "Radially averaged two-dimensional power spectral density, one line per terrain{}{of_slope}",
            sampled(data, group)
        );
        let description = format!(
            "Log-log spectra of {}; median slope {}.",
            set::counted(curves.len(), "terrain"),
            set::fixed(middle, 2)
        );
        let rows: Vec<&PsdRow> = group.rows.iter().flat_map(|t| data.spectrum(&t.terrain_id)).collect();
        let all = of_whole_group(data, group, rows.len());
        let names = ["surface_id", "bin", "frequency_cycles_m", "psd_m4", "modes"];
        let numbers = Numbers::select(
            &format!("{} and frequency_cycles_m > 0 and psd_m4 > 0", sql::of_group("surface_id", group)),
            rows,
            &names,
        );
        finish(id, format!("Spectra, group {}.", group.name), &caption, description, plot, numbers.of_all(all))
    };
    drawn.iter().map(figure).collect()
}

/// One frame per group.
pub fn distributions(data: &Data, groups: &[Group<TerrainRow>]) -> Vec<Figure> {
    let drawn = drawn(groups, |id| curves::histogram(&data.histogram(id)));
    let ranges = curves::ranges(drawn.iter().flat_map(|(_, c)| c));
    let figure = |(group, curves): &Drawn| {
        let id = file_id("heights", group);
        let plot = curves::distributions(&id, curves, ranges);
        let [skewness, kurtosis] = [median(&group.rows, |t| t.skewness), median(&group.rows, |t| t.kurtosis)];
        let description = format!(
            "Height distributions of {}; median skewness {}, median kurtosis {} (3 for a normal distribution).",
            set::counted(curves.len(), "terrain"),
            set::fixed(skewness, 2),
            set::fixed(kurtosis, 2)
        );
        let rows: Vec<&HeightDistributionRow> = group.rows.iter().flat_map(|t| data.histogram(&t.terrain_id)).collect();
        let all = of_whole_group(data, group, rows.len());
        let names = ["surface_id", "bin", "low_m", "high_m", "cells", "density_per_m"];
        let numbers = Numbers::select(
            &format!("{} and isfinite(density_per_m)", sql::of_group("surface_id", group)),
            rows,
            &names,
        );
        let caption = match sampled(data, group) {
            words if words.is_empty() => description.clone(),
            words => format!("{description} Lines are those{words}."),
        };
        finish(id, format!("Heights, group {}.", group.name), &caption, description, plot, numbers.of_all(all))
    };
    drawn.iter().map(figure).collect()
}

/// Number of terrains of a group whose curves are kept.
fn kept(data: &Data, group: &Group<TerrainRow>) -> usize {
    group.rows.iter().filter(|t| !data.without_curves.contains(&t.terrain_id)).count()
}

/// Of how many terrains the lines are a sample, in words; empty if every terrain has one.
fn sampled(data: &Data, group: &Group<TerrainRow>) -> String {
    let (kept, all) = (kept(data, group), group.rows.len());
    if kept == all {
        String::new()
    } else {
        format!(" of a random sample of {} of the {}", set::count(kept), set::count(all))
    }
}

/// Approximate number of rows of all terrains of a group, from those of the terrains whose curves are kept.
fn of_whole_group(data: &Data, group: &Group<TerrainRow>, rows: usize) -> usize {
    rows * group.rows.len() / kept(data, group).max(1)
}

fn file_id(what: &str, group: &Group<TerrainRow>) -> String {
    slug(&format!("{what}-{}", group.name))
}

fn finish(id: String, title: String, caption: &str, description: String, plot: Plot, numbers: Numbers) -> Figure {
    Figure { id, title, caption: caption.into(), description, svg: plot.svg, numbers }
}
