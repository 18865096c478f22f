//! The picture of one route: the searched and the smoothed path over the shaded relief, with obstacles.

use crate::ReportError;
use crate::content::slug;
use crate::render::chart::{Entry, Mark};
use crate::render::map::{Key, Map};
use crate::render::picture;
use crate::render::svg::{Anchor, Paint, Stroke, Svg, Symbol, TEXT, fitted};
use sastrugi_imaging::hillshade::exaggeration;
use sastrugi_numeric::Grid;

/// Width of the map, px.
const WIDTH: f64 = 640.0;
/// Free space around the map, px.
const GAP: f64 = 14.0;
/// Room for title and numbers above the map, px.
const HEAD: f64 = 52.0;
/// Size of the title, px.
const TITLE: f64 = 15.0;
/// Largest number of pixels of the relief along a side.
const PIXELS: usize = 900;
/// Marks on maps do not follow the theme.
const DARK: Paint = Paint::Fixed([0x1b, 0x20, 0x26]);
const LIGHT: Paint = Paint::Fixed([0xff, 0xff, 0xff]);
const BLOCKED: Paint = Paint::Fixed([0x8a, 0x1f, 0x1f]);

/// Content of the picture. Points are in the coordinates of the heights, m.
#[derive(Clone, Copy, Debug)]
pub struct RoutePicture<'a> {
    /// Heights, m.
    pub heights: &'a Grid,
    /// RMS slope of the heights, which sets the exaggeration of the relief.
    pub rms_slope: f64,
    /// The path before smoothing.
    pub searched: &'a [[f64; 3]],
    /// The smoothed path.
    pub smoothed: &'a [[f64; 3]],
    /// Rings of obstacles.
    pub obstacles: &'a [Vec<[f64; 2]>],
    /// Title.
    pub title: &'a str,
    /// Length, cost and slopes, in one line.
    pub words: &'a str,
}

impl RoutePicture<'_> {
    /// As an SVG picture.
    ///
    /// # Errors
    /// When the relief cannot be drawn.
    ///
    /// ```
    /// use sastrugi_numeric::{Geometry, Grid};
    /// use sastrugi_report::RoutePicture;
    ///
    /// let heights = Grid::filled(Geometry::square(20, 30, 1.0), 5.0);
    /// let path = [[2.5, 2.5, 5.0], [22.5, 17.5, 5.0]];
    /// let picture = RoutePicture {
    ///     heights: &heights,
    ///     rms_slope: 0.0,
    ///     searched: &path,
    ///     smoothed: &path,
    ///     obstacles: &[],
    ///     title: "level ground",
    ///     words: "25 m",
    /// };
    /// let svg = picture.svg()?;
    /// assert!(svg.contains(">level ground<") && svg.contains(">start<"));
    /// // The legend names only what is drawn.
    /// assert!(!svg.contains(">obstacle<"));
    /// # Ok::<(), sastrugi_report::ReportError>(())
    /// ```
    pub fn svg(&self) -> Result<String, ReportError> {
        let range = self.heights.range().unwrap_or((0.0, 0.0));
        let picture = picture::relief(self.heights, range, exaggeration(self.rms_slope), PIXELS)?;
        let id = slug(&format!("route-{}", self.title));
        let mut map = Map::new(&picture, WIDTH, &Key::Entries(&self.entries()));
        map.clip(&format!("{id}-clip"));
        self.draw(&mut map);
        map.svg.close();
        let (width, height) = map.svg.size();
        let mut svg = Svg::new(width + 2.0 * GAP, height + HEAD + GAP);
        svg.rect((0.0, 0.0), svg.size(), Paint::Paper, 1.0);
        svg.text_sized((GAP, 22.0), Anchor::Start, Paint::Ink, TITLE, &fitted(self.title, width, TITLE));
        svg.text((GAP, 42.0), Anchor::Start, Paint::Muted, &fitted(self.words, width, TEXT));
        svg.inset((GAP, HEAD), &map.svg);
        Ok(svg.finish(&id, self.title, self.words))
    }

    fn entries(&self) -> Vec<Entry> {
        let mut entries = vec![
            (Mark::Line(Stroke::new(Paint::Ink, 2.4)), "route".to_owned()),
            (Mark::Line(Stroke::new(Paint::Ink, 1.2).dashed("3 3")), "as searched".to_owned()),
            (Mark::Symbol(Symbol::Ring, Paint::Ink), "start".to_owned()),
            (Mark::Symbol(Symbol::Disc, Paint::Ink), "goal".to_owned()),
        ];
        if !self.obstacles.is_empty() {
            entries.push((Mark::Fill(BLOCKED), "obstacle".to_owned()));
        }
        entries
    }

    fn draw(&self, map: &mut Map) {
        for ring in self.obstacles {
            let corners: Vec<(f64, f64)> = ring.iter().filter_map(|&[x, y]| map.at(x, y)).collect();
            map.svg.area(&corners, BLOCKED, 0.55);
        }
        let place = |map: &Map, points: &[[f64; 3]]| -> Vec<(f64, f64)> {
            points.iter().filter_map(|&[x, y, _]| map.at(x, y)).collect()
        };
        let (searched, smoothed) = (place(map, self.searched), place(map, self.smoothed));
        map.svg.polyline(&searched, Stroke::new(LIGHT, 2.6).faint(0.6));
        map.svg.polyline(&searched, Stroke::new(DARK, 1.2).dashed("3 3"));
        map.svg.polyline(&smoothed, Stroke::new(LIGHT, 4.6).faint(0.85));
        map.svg.polyline(&smoothed, Stroke::new(DARK, 2.4));
        if let (Some(&start), Some(&goal)) = (smoothed.first(), smoothed.last()) {
            for end in [start, goal] {
                map.svg.disc(end, 6.0, LIGHT, 1.0);
            }
            map.svg.ring(start, 4.2, Stroke::new(DARK, 2.0));
            map.svg.disc(goal, 4.6, DARK, 1.0);
        }
    }
}
