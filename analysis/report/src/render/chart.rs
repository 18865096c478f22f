//! Charts: a frame for x-y data, a frame for one row per category, and legends.

use super::axis::{Axis, Tick};
use super::svg::{Anchor, Paint, Stroke, Svg, Symbol, TEXT, fitted, text_width};
use sastrugi_statistics::BoxPlot;

/// Width of an ordinary figure, px: about the width of a phone, so that its text stays readable there.
pub const WIDTH: f64 = 400.0;
/// Free space at the right of every frame, px.
const RIGHT: f64 = 16.0;
/// Room for the ticks and the title of a horizontal axis, px.
const BELOW: f64 = 44.0;
/// Height of one row of a legend, px.
const LEGEND_ROW: f64 = 20.0;

/// Sample of a legend.
#[derive(Clone, Copy, Debug)]
pub enum Mark {
    /// A line.
    Line(Stroke),
    /// A filled box.
    Fill(Paint),
    /// A mark.
    Symbol(Symbol, Paint),
    /// A line that ends in a mark.
    Track(Stroke, Symbol),
}

/// One entry of a legend.
pub type Entry = (Mark, String);

/// A frame with two axes.
#[derive(Debug)]
pub struct Plot {
    /// The drawing.
    pub svg: Svg,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    corner: (f64, f64),
    size: (f64, f64),
}

impl Plot {
    /// An empty frame of the given size (px, px) with grid, ticks, axis titles and legend.
    pub fn new(
        (width, height): (f64, f64),
        (x, x_title): (Axis, &str),
        (y, y_title): (Axis, &str),
        legend: &[Entry],
    ) -> Self {
        let room = axis_room(&y, height - legend_height(legend, width));
        Self::with_room((width, height), (x, x_title), (y, y_title), legend, room)
    }

    /// The same with `left` px for the vertical axis, so that frames below each other share their left edge.
    pub fn with_room(
        (width, height): (f64, f64),
        (x, x_title): (Axis, &str),
        (y, y_title): (Axis, &str),
        legend: &[Entry],
        left: f64,
    ) -> Self {
        let top = 8.0 + legend_height(legend, width);
        let bottom = height - BELOW;
        let y = y.over(bottom, top);
        let y_ticks = y_ticks(&y, bottom - top);
        let x = x.over(left, width - RIGHT);
        let mut svg = Svg::new(width, height);
        draw_legend(&mut svg, legend, (0.0, 4.0), width);
        let mut plot = Self { svg, x, y, corner: (left, top), size: (width - RIGHT - left, bottom - top) };
        plot.draw_x(x_title);
        plot.draw_y(&y_ticks, y_title);
        plot
    }

    fn draw_x(&mut self, title: &str) {
        let (left, bottom) = (self.corner.0, self.corner.1 + self.size.1);
        for (at, label) in places(&self.x, &fitting(&self.x, self.size.0, |t| text_width(&t.label, TEXT) + 16.0)) {
            self.svg.segment((at, self.corner.1), (at, bottom), Stroke::new(Paint::Hairline, 1.0));
            self.svg.text((at, bottom + 17.0), Anchor::Middle, Paint::Muted, &label);
        }
        self.svg.segment((left, bottom), (left + self.size.0, bottom), Stroke::new(Paint::Muted, 1.0));
        self.svg.text((left + 0.5 * self.size.0, bottom + 37.0), Anchor::Middle, Paint::Ink, title);
    }

    fn draw_y(&mut self, ticks: &[Tick], title: &str) {
        let (left, right) = (self.corner.0, self.corner.0 + self.size.0);
        for (at, label) in places(&self.y, ticks) {
            self.svg.segment((left, at), (right, at), Stroke::new(Paint::Hairline, 1.0));
            self.svg.text((left - 7.0, at + 4.3), Anchor::End, Paint::Muted, &label);
        }
        self.svg.text_upwards((13.0, self.corner.1 + 0.5 * self.size.1), Anchor::Middle, Paint::Ink, title);
    }

    /// Positions of data points on the page; points that the axes cannot show are left out.
    pub fn place(&self, points: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
        points.into_iter().filter_map(|(x, y)| Some((self.x.at(x)?, self.y.at(y)?))).collect()
    }

    /// Starts drawing clipped at the frame; end it with `plot.svg.close()`. `name` must be unique on the page.
    pub fn clip(&mut self, name: &str) {
        self.svg.clip(name, self.corner, self.size);
    }

    /// A line through data.
    pub fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, stroke: Stroke) {
        let placed = self.place(points);
        self.svg.polyline(&placed, stroke);
    }

    /// A note in the upper right corner of the frame.
    pub fn note(&mut self, row: usize, text: &str) {
        let at = (self.corner.0 + self.size.0 - 8.0, self.corner.1 + 18.0 + 17.0 * row as f64);
        self.svg.text(at, Anchor::End, Paint::Ink, text);
    }
}

/// Room that a vertical axis needs at the left of a frame, px; `height` is that of the frame without its legend.
pub fn axis_room(y: &Axis, height: f64) -> f64 {
    let length = height - BELOW - 8.0;
    30.0 + y_ticks(&y.over(length, 0.0), length).iter().map(|t| text_width(&t.label, TEXT)).fold(0.0, f64::max)
}

fn y_ticks(y: &Axis, length: f64) -> Vec<Tick> {
    fitting(y, length, |_| TEXT + 12.0)
}

/// A row of a [`Rows`] frame.
#[derive(Clone, Debug)]
pub struct RowLabel {
    /// Name of the category.
    pub name: String,
    /// A smaller line below it (`n = 20`).
    pub detail: String,
}

/// A frame with one row per category and a horizontal axis.
#[derive(Debug)]
pub struct Rows {
    /// The drawing.
    pub svg: Svg,
    /// Horizontal axis.
    pub x: Axis,
    top: f64,
    row_height: f64,
    left: f64,
}

impl Rows {
    /// An empty frame with labels, grid, ticks, axis title and legend.
    pub fn new(labels: &[RowLabel], row_height: f64, (x, title): (Axis, &str), legend: &[Entry]) -> Self {
        let widest = |text: fn(&RowLabel) -> &str| labels.iter().map(move |l| text_width(text(l), TEXT));
        let left = widest(|l| &l.name).chain(widest(|l| &l.detail)).fold(24.0, f64::max).min(150.0) + 14.0;
        let top = 8.0 + legend_height(legend, WIDTH);
        let bottom = top + row_height * labels.len() as f64;
        let mut svg = Svg::new(WIDTH, bottom + 46.0);
        draw_legend(&mut svg, legend, (0.0, 4.0), WIDTH);
        let mut rows = Self { svg, x: x.over(left, WIDTH - RIGHT), top, row_height, left };
        rows.draw_axis(bottom, title);
        labels.iter().enumerate().for_each(|(i, label)| rows.draw_label(i, label));
        rows
    }

    fn draw_axis(&mut self, bottom: f64, title: &str) {
        let width = WIDTH - RIGHT - self.left;
        for (at, label) in places(&self.x, &fitting(&self.x, width, |t| text_width(&t.label, TEXT) + 16.0)) {
            self.svg.segment((at, self.top), (at, bottom), Stroke::new(Paint::Hairline, 1.0));
            self.svg.text((at, bottom + 17.0), Anchor::Middle, Paint::Muted, &label);
        }
        self.svg.segment((self.left, bottom), (self.left + width, bottom), Stroke::new(Paint::Muted, 1.0));
        self.svg.text((self.left + 0.5 * width, bottom + 37.0), Anchor::Middle, Paint::Ink, title);
    }

    fn draw_label(&mut self, row: usize, label: &RowLabel) {
        let (x, y) = (self.left - 10.0, self.centre(row));
        let shift = if label.detail.is_empty() { 4.3 } else { -3.0 };
        let cut = |text: &str| fitted(text, self.left - 12.0, TEXT);
        let (name, detail) = (cut(&label.name), cut(&label.detail));
        self.svg.text((x, y + shift), Anchor::End, Paint::Ink, &name);
        if !detail.is_empty() {
            self.svg.text_sized((x, y + 12.0), Anchor::End, Paint::Muted, 11.0, &detail);
        }
    }

    /// A line through all rows at a value.
    pub fn vertical(&mut self, value: f64, rows: usize) {
        if let Some(x) = self.x.at(value) {
            let bottom = self.top + self.row_height * rows as f64;
            self.svg.segment((x, self.top), (x, bottom), Stroke::new(Paint::Muted, 1.4));
        }
    }

    /// Vertical centre of a row on the page.
    pub fn centre(&self, row: usize) -> f64 {
        self.top + (row as f64 + 0.5) * self.row_height
    }
}

/// Additions to a box plot in its row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside {
    /// Interval of the median, if there is one.
    pub interval: Option<(f64, f64)>,
    /// A published median to be marked, if there is one.
    pub published: Option<f64>,
}

impl Rows {
    /// Draws a box plot into a row: the box and whiskers above, the median's interval just below. A whisker that would end inside the box ends at its
    /// edge: a quartile of few values is interpolated between the last value that counts and an outlier.
    pub fn box_plot(&mut self, row: usize, plot: &BoxPlot, beside: Beside, paint: Paint) {
        let y = self.centre(row) - 3.0;
        let half = (0.26 * self.row_height).min(11.0);
        let at = |v: f64| self.x.clamped(v);
        let (whisker_low, whisker_high) =
            (plot.whisker_low.min(plot.quartile_low), plot.whisker_high.max(plot.quartile_high));
        let (Some(low), Some(high)) = (at(whisker_low), at(whisker_high)) else { return };
        let [Some(q1), Some(median), Some(q3)] = [plot.quartile_low, plot.median, plot.quartile_high].map(at) else {
            return;
        };
        let (least, most) = self.x.range();
        let (shown, beyond): (Vec<f64>, Vec<f64>) = plot.outliers.iter().partition(|v| **v >= least && **v <= most);
        let interval = beside.interval.and_then(|(a, b)| Some((at(a)?, at(b)?)));
        let published = beside.published.and_then(at);
        let line = Stroke::new(paint, 1.3);
        for (from, to) in [(low, q1), (q3, high)] {
            self.svg.segment((from, y), (to, y), line);
        }
        for end in [low, high] {
            self.svg.segment((end, y - 0.5 * half), (end, y + 0.5 * half), line);
        }
        self.svg.rect((q1, y - half), (q3 - q1, 2.0 * half), paint, 0.22);
        self.svg.frame((q1, y - half), (q3 - q1, 2.0 * half), line);
        self.svg.segment((median, y - half), (median, y + half), Stroke::new(paint, 3.0));
        for x in shown.into_iter().filter_map(at) {
            self.svg.ring((x, y), 2.4, Stroke::new(paint, 1.1).faint(0.8));
        }
        for x in beyond.into_iter().filter_map(at) {
            let towards = if x > median { 1.0 } else { -1.0 };
            self.svg
                .polygon(&[(x - 3.0 * towards, y - 4.0), (x + 3.0 * towards, y), (x - 3.0 * towards, y + 4.0)], paint);
        }
        if let Some((from, to)) = interval {
            let below = y + half + 6.0;
            self.svg.segment((from, below), (to, below), Stroke::new(Paint::Ink, 2.2));
            self.svg.disc((median, below), 2.6, Paint::Ink, 1.0);
        }
        if let Some(x) = published {
            self.svg.symbol(Symbol::Diamond, (x, y), 4.6, Paint::Paper);
            self.svg.symbol(Symbol::Diamond, (x, y), 3.4, Paint::Ink);
        }
    }
}

/// Height of a legend, px.
pub fn legend_height(entries: &[Entry], width: f64) -> f64 {
    let rows = legend_places(entries, width).last().map_or(0, |&(_, row)| row + 1);
    rows as f64 * LEGEND_ROW + if rows > 0 { 4.0 } else { 0.0 }
}

/// Draws a legend with its upper left corner at `corner`.
pub fn draw_legend(svg: &mut Svg, entries: &[Entry], corner: (f64, f64), width: f64) {
    for ((mark, label), (x, row)) in entries.iter().zip(legend_places(entries, width)) {
        let (x, y) = (corner.0 + x, corner.1 + (row as f64 + 0.5) * LEGEND_ROW);
        draw_mark(svg, *mark, (x, y));
        svg.text((x + 30.0, y + 4.3), Anchor::Start, Paint::Ink, &fitted(label, width - 34.0, TEXT));
    }
}

fn draw_mark(svg: &mut Svg, mark: Mark, (x, y): (f64, f64)) {
    match mark {
        Mark::Line(stroke) => svg.segment((x + 1.0, y), (x + 24.0, y), stroke),
        Mark::Fill(paint) => svg.rect((x + 4.0, y - 6.0), (18.0, 12.0), paint, 1.0),
        Mark::Symbol(symbol, paint) => svg.symbol(symbol, (x + 13.0, y), 4.0, paint),
        Mark::Track(stroke, symbol) => {
            svg.segment((x + 1.0, y), (x + 18.0, y), stroke);
            svg.symbol(symbol, (x + 20.0, y), 4.0, stroke.paint);
        }
    }
}

/// Position along the row, and row, of every entry.
fn legend_places(entries: &[Entry], width: f64) -> Vec<(f64, usize)> {
    let (mut x, mut row) = (0.0, 0);
    let place = |(_, label): &Entry| {
        let needed = 44.0 + text_width(label, TEXT);
        if x > 0.0 && x + needed - 14.0 > width {
            (x, row) = (0.0, row + 1);
        }
        let place = (x, row);
        x += needed;
        place
    };
    entries.iter().map(place).collect()
}

/// As many ticks as fit into `length` px when each needs `room` px.
fn fitting(axis: &Axis, length: f64, room: impl Fn(&Tick) -> f64) -> Vec<Tick> {
    let fits = |ticks: &Vec<Tick>| {
        let widest = ticks.iter().map(&room).fold(0.0, f64::max);
        widest * ticks.len() as f64 <= length + widest
    };
    (2..=7).rev().map(|most| axis.ticks(most)).find(fits).unwrap_or_default()
}

fn places(axis: &Axis, ticks: &[Tick]) -> Vec<(f64, String)> {
    ticks.iter().filter_map(|t| Some((axis.at(t.value)?, t.label.clone()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::xml::assert_well_formed;

    #[test]
    fn prop_legends_wrap_inside_the_width() {
        let entry = |n: usize| (Mark::Fill(Paint::Ink), "x".repeat(n));
        let entries: Vec<Entry> = [30, 12, 3, 40, 5].map(entry).into();
        let places = legend_places(&entries, WIDTH);
        assert!(places.windows(2).all(|w| w[1].1 > w[0].1 || w[1].0 > w[0].0));
        for ((_, label), (x, _)) in entries.iter().zip(&places) {
            assert!(x + 30.0 + text_width(label, TEXT) <= WIDTH);
        }
        assert_eq!(legend_height(&[], WIDTH), 0.0);
    }

    /// The frame ends 16 px from the right, 44 px above the bottom, and 8 px below the top; larger values are further up.
    #[test]
    fn val_points_are_placed_in_the_frame() {
        let axes = [Axis::linear(0.0, 10.0), Axis::linear(-1.0, 1.0)];
        let plot = Plot::with_room((400.0, 300.0), (axes[0], "x"), (axes[1], "y"), &[], 50.0);
        assert_eq!(plot.place([(0.0, -1.0), (10.0, 1.0), (5.0, 0.0)]), [(50.0, 256.0), (384.0, 8.0), (217.0, 132.0)]);
        assert!(plot.place([(f64::NAN, 0.0), (1.0, f64::INFINITY)]).is_empty());
        let log = Plot::with_room((400.0, 300.0), (Axis::log(1.0, 100.0), "x"), (axes[1], "y"), &[], 50.0);
        assert!(log.place([(0.0, 0.0), (-1.0, 0.0)]).is_empty());
        assert!((log.place([(10.0, 0.0)])[0].0 - 217.0).abs() < 1e-9);
    }

    /// Quartiles 2.5, 5 and 7.5 on an axis of 34.6 px a unit that starts at 38 px; the row's centre is at 31 px, the box 3 px above it.
    #[test]
    fn val_box_plots_are_drawn_at_their_quartiles() {
        let label = RowLabel { name: "a".into(), detail: String::new() };
        let mut rows = Rows::new(&[label], 46.0, (Axis::linear(0.0, 10.0), "x"), &[]);
        assert_eq!((rows.x.at(0.0), rows.x.at(10.0), rows.centre(0)), (Some(38.0), Some(384.0), 31.0));
        let before = rows.svg.finish("id", "t", "d");
        let plot = BoxPlot::of(&[0.0, 2.5, 5.0, 7.5, 10.0]).unwrap();
        let beside = Beside { interval: Some((2.5, 7.5)), published: Some(10.0) };
        rows.box_plot(0, &plot, beside, Paint::Series(0));
        let svg = rows.svg.finish("id", "t", "d");
        let drawn = |shape: &str| svg.matches(shape).count() - before.matches(shape).count();
        // Box and outline, median, both whiskers, and below them the median's interval.
        assert_eq!(drawn("x=\"124.5\" y=\"17\" width=\"173\" height=\"22\""), 2, "{svg}");
        assert_eq!(drawn("<line x1=\"211\" y1=\"17\" x2=\"211\" y2=\"39\""), 1);
        assert_eq!(drawn("<line x1=\"38\" y1=\"28\" x2=\"124.5\" y2=\"28\""), 1);
        assert_eq!(drawn("<line x1=\"297.5\" y1=\"28\" x2=\"384\" y2=\"28\""), 1);
        assert_eq!(drawn("<line x1=\"124.5\" y1=\"45\" x2=\"297.5\" y2=\"45\""), 1);
        // The published median is a diamond on a paler one at the end of the axis.
        assert_eq!(drawn("<path d=\"M384.0 "), 2);
    }

    /// Of 0, 1, 2 and 10, the last value that is not an outlier is 2 (107.2 px), but the box ends at 4 (176.4 px): nothing ends at 2.
    #[test]
    fn val_whiskers_do_not_end_inside_the_box() {
        let label = RowLabel { name: "a".into(), detail: String::new() };
        let mut rows = Rows::new(&[label], 46.0, (Axis::linear(0.0, 10.0), "x"), &[]);
        rows.box_plot(0, &BoxPlot::of(&[0.0, 1.0, 2.0, 10.0]).unwrap(), Beside::default(), Paint::Series(0));
        let svg = rows.svg.finish("id", "t", "d");
        let ends_at = |x: &str| svg.contains(&format!("x1=\"{x}\" y1=\"22.5\" x2=\"{x}\" y2=\"33.5\""));
        assert!(ends_at("176.4") && !ends_at("107.2"), "{svg}");
    }

    #[test]
    fn prop_ticks_fit() {
        for high in [1e-7, 0.3, 12.0, 123_456.0] {
            let axis = Axis::linear(-high, high).over(0.0, 200.0);
            let room = |t: &Tick| text_width(&t.label, TEXT) + 16.0;
            let ticks = fitting(&axis, 200.0, room);
            let gaps = ticks.windows(2).map(|w| axis.at(w[1].value).unwrap() - axis.at(w[0].value).unwrap());
            let widest = ticks.iter().map(room).fold(0.0, f64::max);
            assert!(gaps.fold(f64::MAX, f64::min) >= 0.6 * widest, "{high}");
        }
    }

    #[test]
    fn prop_box_plots_of_anything_are_well_formed() {
        let label = RowLabel { name: "<a&b>".into(), detail: "n = 0".into() };
        let mut rows = Rows::new(&[label], 46.0, (Axis::linear(0.0, 1.0), "x"), &[]);
        let plot = BoxPlot::of(&[0.1, 0.1, 0.2, 1e9]).unwrap();
        let beside = Beside { interval: Some((f64::NAN, 0.2)), published: Some(f64::INFINITY) };
        rows.box_plot(0, &plot, beside, Paint::Series(0));
        rows.box_plot(0, &plot, Beside::default(), Paint::Series(0));
        let out = rows.svg.finish("id", "t", "d");
        assert_well_formed(&out);
        assert!(!out.contains("NaN"));
    }
}
