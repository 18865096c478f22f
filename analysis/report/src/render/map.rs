//! Maps: a picture of the ground with scale bar, north arrow and legend.

use super::axis::Axis;
use super::chart::{Entry, draw_legend, legend_height};
use super::colour::Rgb;
use super::number;
use super::picture::Picture;
use super::svg::{Anchor, Paint, Stroke, Svg, TEXT};

/// Largest height of a map over its width.
const TALLEST: f64 = 1.25;

/// A map being drawn.
#[derive(Debug)]
pub struct Map {
    /// The drawing.
    pub svg: Svg,
    x: Axis,
    y: Axis,
    size: (f64, f64),
}

/// Key to the colours of a map.
#[derive(Debug)]
pub enum Key<'a> {
    /// Colours from low to high, their ends, and their meaning with its unit.
    Ramp {
        /// Colours in order.
        colours: &'a [Rgb],
        /// Values at either end.
        range: (f64, f64),
        /// Quantity and unit, such as `height, m`.
        title: &'a str,
        /// Colour and meaning of cells without data.
        absent: Option<(Rgb, &'a str)>,
    },
    /// Separate entries.
    Entries(&'a [Entry]),
}

impl Map {
    /// The picture over `width` px, with its key below.
    pub fn new(picture: &Picture, width: f64, key: &Key) -> Self {
        let [size_x, size_y] = picture.size_m;
        let scale = (width / size_x).min(TALLEST * width / size_y);
        let size = (size_x * scale, size_y * scale);
        let mut svg = Svg::new(width, size.1 + 34.0 + key_height(key, width));
        let crisp = (picture.pixels[0] as f64) < 0.5 * size.0;
        svg.picture((0.0, 0.0), size, &picture.data_uri, crisp);
        let [x0, y0] = picture.origin_m;
        let x = Axis::linear(x0, x0 + size_x).over(0.0, size.0);
        let y = Axis::linear(y0, y0 + size_y).over(size.1, 0.0);
        let mut map = Self { svg, x, y, size };
        map.draw_scale(size_x, scale);
        map.draw_north(size.0 - 10.0, size.1 + 8.0);
        map.draw_key(key, size.1 + 34.0, width);
        map
    }

    /// Position of a point of the ground on the page.
    pub fn at(&self, x_m: f64, y_m: f64) -> Option<(f64, f64)> {
        Some((self.x.at(x_m)?, self.y.at(y_m)?))
    }

    /// Starts drawing clipped at the picture; end it with `map.svg.close()`. `name` must be unique on the page.
    pub fn clip(&mut self, name: &str) {
        self.svg.clip(name, (0.0, 0.0), self.size);
    }

    fn draw_scale(&mut self, size_m: f64, scale: f64) {
        let ticks = Axis::linear(0.0, 0.45 * size_m).ticks(3);
        let Some(length_m) = ticks.last().map(|t| t.value) else { return };
        let (y, to) = (self.size.1 + 18.0, length_m * scale);
        self.svg.segment((0.5, y), (to, y), Stroke::new(Paint::Ink, 2.0));
        for end in [0.5, to] {
            self.svg.segment((end, y - 4.0), (end, y + 4.0), Stroke::new(Paint::Ink, 1.2));
        }
        self.svg.text((to + 8.0, y + 4.3), Anchor::Start, Paint::Ink, &distance(length_m));
    }

    fn draw_north(&mut self, x: f64, y: f64) {
        self.svg.polygon(&[(x, y), (x + 5.0, y + 17.0), (x, y + 13.0), (x - 5.0, y + 17.0)], Paint::Ink);
        self.svg.text((x - 9.0, y + 14.0), Anchor::End, Paint::Ink, "N");
    }

    fn draw_key(&mut self, key: &Key, top: f64, width: f64) {
        match key {
            Key::Entries(entries) => draw_legend(&mut self.svg, entries, (0.0, top), width),
            Key::Ramp { colours, range, title, absent } => {
                self.draw_ramp(colours, *range, title, top);
                if let Some((colour, words)) = absent {
                    self.svg.rect((0.0, top + 44.0), (18.0, 12.0), Paint::Fixed(*colour), 1.0);
                    self.svg.text((26.0, top + 54.0), Anchor::Start, Paint::Ink, words);
                }
            }
        }
    }

    fn draw_ramp(&mut self, colours: &[Rgb], (low, high): (f64, f64), title: &str, top: f64) {
        let length = self.size.0.min(300.0);
        let step = length / colours.len().max(1) as f64;
        for (i, &colour) in colours.iter().enumerate() {
            // Half a pixel of overlap hides the seams.
            self.svg.rect((i as f64 * step, top + 2.0), (step + 0.5, 10.0), Paint::Fixed(colour), 1.0);
        }
        let (left, right) = (number::significant(low, 3), number::significant(high, 3));
        self.svg.text((0.0, top + 28.0), Anchor::Start, Paint::Muted, &left);
        self.svg.text((length, top + 28.0), Anchor::End, Paint::Muted, &right);
        self.svg.text((0.5 * length, top + 28.0), Anchor::Middle, Paint::Ink, title);
    }
}

fn key_height(key: &Key, width: f64) -> f64 {
    match key {
        Key::Entries(entries) => legend_height(entries, width),
        Key::Ramp { absent, .. } => 36.0 + if absent.is_some() { TEXT + 12.0 } else { 0.0 },
    }
}

/// A length in m or km.
fn distance(length_m: f64) -> String {
    let (length, unit) = if length_m >= 1000.0 { (length_m / 1000.0, "km") } else { (length_m, "m") };
    format!("{} {unit}", number::plain(length, 3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::xml::assert_well_formed;

    #[test]
    fn val_places_follow_the_grid_convention() {
        let picture =
            Picture { data_uri: "data:,".into(), size_m: [10.0, 5.0], origin_m: [100.0, 50.0], pixels: [2, 1] };
        let map = Map::new(&picture, 300.0, &Key::Entries(&[]));
        assert_eq!(map.at(100.0, 50.0), Some((0.0, 150.0)));
        assert_eq!(map.at(110.0, 55.0), Some((300.0, 0.0)));
        assert_eq!(map.at(102.5, 53.75), Some((75.0, 37.5)));
        assert_well_formed(&map.svg.finish("m", "t", "d"));
    }

    /// 30 px a metre: the longest of at most three round lengths below 45 % of the width is 4 m, 120 px.
    #[test]
    fn val_the_scale_bar_has_its_length() {
        let picture = Picture { data_uri: "data:,".into(), size_m: [10.0, 5.0], origin_m: [0.0; 2], pixels: [2, 1] };
        let svg = Map::new(&picture, 300.0, &Key::Entries(&[])).svg.finish("m", "t", "d");
        assert!(svg.contains("<line x1=\"0.5\" y1=\"168\" x2=\"120\" y2=\"168\"") && svg.contains(">4 m<"), "{svg}");
    }

    /// A map taller than wide is at most 1.25 times as high as the page is wide, with the same scale in both directions.
    #[test]
    fn val_tall_maps_are_bounded() {
        let picture = Picture { data_uri: "data:,".into(), size_m: [10.0, 50.0], origin_m: [0.0; 2], pixels: [2, 10] };
        let map = Map::new(&picture, 400.0, &Key::Entries(&[]));
        assert_eq!(map.at(0.0, 0.0), Some((0.0, 500.0)));
        assert_eq!(map.at(10.0, 50.0), Some((100.0, 0.0)));
    }

    #[test]
    fn val_distances() {
        assert_eq!(distance(20.0), "20 m");
        assert_eq!(distance(0.5), "0.5 m");
        assert_eq!(distance(0.05), "0.05 m");
        assert_eq!(distance(10_000.0), "10 km");
        assert_eq!(distance(1000.0), "1 km");
    }
}
