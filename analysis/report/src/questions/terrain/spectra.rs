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
            sampled(data, group).map_or_else(String::new, |sample| format!(", for {sample}"))
        );
        let (drawn, of_all) = in_words(data, group, curves);
        let description = format!("Log-log spectra of {drawn}; median slope{of_all} {}.", set::fixed(middle, 2));
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
        let (drawn, of_all) = in_words(data, group, curves);
        let is_one = group.rows.len() == 1;
        let [of, median] = if is_one { ["Height distribution", ""] } else { ["Height distributions", "median "] };
        let description = format!(
            "{of} of {drawn}; {median}skewness{of_all} {}, {median}kurtosis {} (3 for a normal distribution).",
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
        let caption = description.clone();
        finish(id, format!("Heights, group {}.", group.name), &caption, description, plot, numbers.of_all(all))
    };
    drawn.iter().map(figure).collect()
}

/// Number of terrains of a group whose curves are kept.
fn kept(data: &Data, group: &Group<TerrainRow>) -> usize {
    group.rows.iter().filter(|t| !data.without_curves.contains(&t.terrain_id)).count()
}

/// Of how many terrains the lines are a sample, in words; `None` if every terrain has one.
fn sampled(data: &Data, group: &Group<TerrainRow>) -> Option<String> {
    let (kept, all) = (kept(data, group), group.rows.len());
    (kept < all).then(|| format!("a random sample of {} of {}", set::count(kept), set::count(all)))
}

/// The terrains whose curves are drawn, and what the medians are of where these are not all.
fn in_words(data: &Data, group: &Group<TerrainRow>, curves: &[Curve]) -> (String, &'static str) {
    match sampled(data, group) {
        Some(sample) => (format!("{sample} terrains"), " of all terrains"),
        None => (set::counted(curves.len(), "terrain"), ""),
    }
}

/// Approximate number of rows of all terrains of a group, estimated from the terrains whose curves are kept. It has two digits, because surfaces
/// differ in their numbers of bins.
fn of_whole_group(data: &Data, group: &Group<TerrainRow>, rows: usize) -> usize {
    let (kept, all) = (kept(data, group), group.rows.len());
    if kept == all { rows } else { two_digits(rows * all / kept.max(1)).max(rows + 1) }
}

/// The number rounded to two digits.
fn two_digits(n: usize) -> usize {
    let unit = 10_usize.pow(n.checked_ilog10().unwrap_or(0).saturating_sub(1));
    (n + unit / 2) / unit * unit
}

fn file_id(what: &str, group: &Group<TerrainRow>) -> String {
    slug(&format!("{what}-{}", group.name))
}

fn finish(id: String, title: String, caption: &str, description: String, plot: Plot, numbers: Numbers) -> Figure {
    Figure { id, title, caption: caption.into(), description, svg: plot.svg, numbers }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_estimates_have_two_digits() {
        let rounded = [0, 7, 99, 104, 105, 1249, 1250, 98_765].map(two_digits);
        assert_eq!(rounded, [0, 7, 99, 100, 110, 1200, 1300, 99_000]);
    }

    /// The band of a slope is stated. Its line is drawn only where the spectra reach both ends of the band; where they do not, the caption says so.
    #[test]
    fn val_slopes_are_drawn_where_the_spectrum_covers_their_band() {
        let data = |covers: &dyn Fn(f64) -> bool| {
            let mut data = crate::tests::made_up::full(1, 24);
            data.psd.retain(|row| covers(row.frequency_cycles_m));
            data
        };
        let told = |data: &Data| {
            let figure = spectra(data, &data.terrain_groups()).swap_remove(0);
            let svg = figure.svg.finish(&figure.id, &figure.title, &figure.description);
            (figure.caption, svg.contains(">slope \u{2212}3.60<"))
        };
        // A side of 50.4 m with cells of 2.1 m: 4 cycles to half the Nyquist frequency.
        let ends = "0.079 to 0.12 cycles/m";
        let (caption, is_drawn) = told(&data(&|_| true));
        assert!(caption.ends_with(&format!("; dashed: the median of their slopes, fitted from {ends}.")), "{caption}");
        assert!(is_drawn);
        // A spectrum may end a factor of 1.5 within the band: its bins leave that much free.
        for (covered, expected) in [(0.0..0.07, false), (0.15..1.0, false), (0.0..0.085, true), (0.1..1.0, true)] {
            let (caption, is_drawn) = told(&data(&|f| covered.contains(&f)));
            let words =
                format!("does not cover the band in which its slope is fitted, {ends}, so the slope is not drawn.");
            assert_eq!((is_drawn, !caption.ends_with(&words)), (expected, expected), "{caption}");
        }
    }

    /// One terrain has no median.
    #[test]
    fn val_one_terrain_has_no_median() {
        let data = crate::tests::made_up::full(1, 24);
        let caption = distributions(&data, &data.terrain_groups()).swap_remove(0).caption;
        assert!(caption.starts_with("Height distribution of 1 terrain; skewness 0.10, kurtosis "), "{caption}");
    }

    /// Of a group with many terrains, lines are of a sample and medians of all; both are named as what they are.
    #[test]
    fn val_lines_of_a_sample_and_medians_of_all_are_told_apart() {
        let mut data = crate::tests::made_up::full(3, 24);
        let texts = |data: &Data| {
            let groups = data.terrain_groups();
            let [psd, heights] =
                [spectra(data, &groups), distributions(data, &groups)].map(|mut all| all.swap_remove(0));
            assert_eq!(heights.caption, heights.description);
            (psd.caption, psd.description, heights.description, psd.numbers.sampled_of.is_some())
        };
        let (caption, psd, heights, is_sampled) = texts(&data);
        assert!(caption.starts_with("Radially averaged two-dimensional power spectral density, one line per terrain"));
        assert!(!caption.contains("sample") && !is_sampled, "{caption}");
        assert!(psd.starts_with("Log-log spectra of 3 terrains; median slope \u{2212}3.60"), "{psd}");
        assert!(heights.starts_with("Height distributions of 3 terrains; median skewness 0.10,"), "{heights}");
        data.without_curves = ["d2.30-0001".to_owned()].into();
        let without = data.without_curves.clone();
        data.psd.retain(|row| !without.contains(&row.surface_id));
        data.heights.retain(|row| !without.contains(&row.surface_id));
        let (caption, psd, heights, is_sampled) = texts(&data);
        assert!(caption.contains(", one line per terrain, for a random sample of 2 of 3") && is_sampled, "{caption}");
        let of_sample = "a random sample of 2 of 3 terrains; median";
        assert!(psd.starts_with(&format!("Log-log spectra of {of_sample} slope of all terrains ")), "{psd}");
        assert!(
            heights.starts_with(&format!("Height distributions of {of_sample} skewness of all terrains ")),
            "{heights}"
        );
    }
}
