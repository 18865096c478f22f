//! A small SVG writer. Every shape has its colour twice: as a presentation attribute (so that a figure file looks right in
//! any program) and as a class (so that the page can follow the reader's light or dark theme).

use super::colour::{Rgb, hex};
use std::fmt::Write;

/// Size of ordinary text in figures, px.
pub const TEXT: f64 = 12.5;
/// Widths of characters over the text size in DejaVu Sans, the widest of the usual `system-ui` fonts, in classes that are rounded up.
const WIDTHS: [(&str, f64); 7] = [
    ("ijlIJ' ,.·/:;\\|", 0.34),
    ("frt-()[]!¹²³⁰⁴⁵⁶⁷⁸⁹", 0.42),
    ("ckszLF*_`°–⁻?\"", 0.58),
    ("abdeghnopquvxyPTYES0123456789{}$µρσ", 0.64),
    ("ABCKRVXZ", 0.70),
    ("wDGHNOQU&", 0.82),
    ("M#+<=>^~±×−≤≥", 0.87),
];
/// Width of any other character: `m`, `W`, `%`, a dash, a letter of another script.
const OTHER: f64 = 1.0;

/// A colour that may follow the theme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paint {
    /// Text and marks.
    Ink,
    /// Secondary text, axes.
    Muted,
    /// Grid lines.
    Hairline,
    /// The page itself.
    Paper,
    /// Category by number (groups), cyclic.
    Series(usize),
    /// Outcome of a mission by number.
    Outcome(usize),
    /// The same in any theme (marks on pictures, colours of a legend).
    Fixed(Rgb),
}

/// Colours of [`Paint::Series`] in the light theme.
pub const SERIES: [Rgb; 6] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x8f, 0x68],
    [0xb0, 0x54, 0x86],
    [0x8a, 0x6d, 0x00],
    [0x4b, 0x4f, 0xa6],
];
/// Colours of [`Paint::Outcome`] in the light theme: success, stuck, tipped, out of bounds, timeout, anything else.
pub const OUTCOMES: [Rgb; 6] = [
    [0x00, 0x7a, 0x55],
    [0x22, 0x26, 0x2b],
    [0xb5, 0x17, 0x4e],
    [0x7a, 0x4a, 0x12],
    [0x5a, 0x3c, 0xa8],
    [0x6b, 0x70, 0x76],
];

impl Paint {
    /// Class without its `f-` (fill) or `l-` (line) prefix, and colour in the light theme.
    fn parts(self) -> (String, Rgb) {
        let cyclic = |name: &str, i: usize, list: &[Rgb]| (format!("{name}{}", i % list.len()), list[i % list.len()]);
        match self {
            Self::Ink => ("ink".into(), [0x1b, 0x20, 0x26]),
            Self::Muted => ("muted".into(), [0x5b, 0x65, 0x70]),
            Self::Hairline => ("hair".into(), [0xe1, 0xe5, 0xe9]),
            Self::Paper => ("paper".into(), [0xff, 0xff, 0xff]),
            Self::Series(i) => cyclic("s", i, &SERIES),
            Self::Outcome(i) => cyclic("o", i, &OUTCOMES),
            Self::Fixed(colour) => (String::new(), colour),
        }
    }

    fn attributes(self, attribute: &str) -> String {
        let (class, colour) = self.parts();
        let prefix = if attribute == "fill" { "f" } else { "l" };
        let class = if class.is_empty() { class } else { format!(" class=\"{prefix}-{class}\"") };
        format!("{class} {attribute}=\"{}\"", hex(colour))
    }
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    /// Colour.
    pub paint: Paint,
    /// Width, px.
    pub width: f64,
    /// Dash pattern of SVG; empty for a full line.
    pub dash: &'static str,
    /// Opacity in 0..1.
    pub opacity: f64,
}

impl Stroke {
    /// A full, opaque line.
    pub fn new(paint: Paint, width: f64) -> Self {
        Self { paint, width, dash: "", opacity: 1.0 }
    }

    /// The same with a dash pattern.
    pub fn dashed(self, dash: &'static str) -> Self {
        Self { dash, ..self }
    }

    /// The same, translucent.
    pub fn faint(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    fn attributes(&self) -> String {
        let dash = if self.dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", self.dash) };
        let opacity = opacity("stroke-opacity", self.opacity);
        format!("{} stroke-width=\"{}\"{dash}{opacity}", self.paint.attributes("stroke"), px(self.width))
    }
}

/// Alignment of a text at its point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Anchor {
    /// The text starts there.
    Start,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    End,
}

/// Shapes of marks, distinguishable without colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Symbol {
    /// Filled disc.
    Disc,
    /// Filled square.
    Square,
    /// Filled triangle, tip up.
    Triangle,
    /// Filled diamond.
    Diamond,
    /// Two crossed strokes.
    Cross,
    /// Open circle.
    Ring,
    /// Open square.
    Frame,
}

/// A figure being drawn.
#[derive(Clone, Debug)]
pub struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// An empty figure of the given size, px.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new() }
    }

    /// Size, px.
    pub fn size(&self) -> (f64, f64) {
        (self.width, self.height)
    }

    /// Straight line.
    pub fn segment(&mut self, from: (f64, f64), to: (f64, f64), stroke: Stroke) {
        let [x1, y1, x2, y2] = [from.0, from.1, to.0, to.1].map(px);
        self.push(format!("<line x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"{}/>", stroke.attributes()));
    }

    /// Line through points; fewer than two points draw nothing.
    pub fn polyline(&mut self, points: &[(f64, f64)], stroke: Stroke) {
        if points.len() > 1 {
            let data = path_data(points);
            let style = "stroke-linejoin=\"round\" stroke-linecap=\"round\"";
            self.push(format!("<path d=\"{data}\" fill=\"none\" {style}{}/>", stroke.attributes()));
        }
    }

    /// Filled rectangle; nothing for an empty one.
    pub fn rect(&mut self, corner: (f64, f64), size: (f64, f64), fill: Paint, opaque: f64) {
        if size.0 > 0.0 && size.1 > 0.0 {
            let [x, y, w, h] = [corner.0, corner.1, size.0, size.1].map(px);
            let (fill, opacity) = (fill.attributes("fill"), opacity("fill-opacity", opaque));
            self.push(format!("<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"{fill}{opacity}/>"));
        }
    }

    /// Outline of a rectangle.
    pub fn frame(&mut self, corner: (f64, f64), size: (f64, f64), stroke: Stroke) {
        let [x, y, w, h] = [corner.0, corner.1, size.0, size.1].map(px);
        let style = stroke.attributes();
        self.push(format!("<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"none\"{style}/>"));
    }

    /// Disc.
    pub fn disc(&mut self, centre: (f64, f64), radius: f64, fill: Paint, opaque: f64) {
        let [x, y, r] = [centre.0, centre.1, radius].map(px);
        let (fill, opacity) = (fill.attributes("fill"), opacity("fill-opacity", opaque));
        self.push(format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"{fill}{opacity}/>"));
    }

    /// Circle without fill.
    pub fn ring(&mut self, centre: (f64, f64), radius: f64, stroke: Stroke) {
        let [x, y, r] = [centre.0, centre.1, radius].map(px);
        self.push(format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"none\"{}/>", stroke.attributes()));
    }

    /// Filled polygon.
    pub fn polygon(&mut self, points: &[(f64, f64)], fill: Paint) {
        if points.len() > 2 {
            self.push(format!("<path d=\"{}Z\"{}/>", path_data(points), fill.attributes("fill")));
        }
    }

    /// Translucent polygon.
    pub fn area(&mut self, points: &[(f64, f64)], fill: Paint, opaque: f64) {
        if points.len() > 2 {
            let (fill, opacity) = (fill.attributes("fill"), opacity("fill-opacity", opaque));
            self.push(format!("<path d=\"{}Z\"{fill}{opacity}/>", path_data(points)));
        }
    }

    /// Another figure with its upper left corner at `corner`.
    pub fn inset(&mut self, corner: (f64, f64), other: &Svg) {
        let [x, y] = [corner.0, corner.1].map(px);
        self.push(format!("<g transform=\"translate({x} {y})\">\n{}</g>", other.body));
    }

    /// A mark of about `radius` px.
    pub fn symbol(&mut self, symbol: Symbol, (x, y): (f64, f64), radius: f64, paint: Paint) {
        let r = radius;
        match symbol {
            Symbol::Disc => self.disc((x, y), r, paint, 1.0),
            Symbol::Square => self.rect((x - 0.88 * r, y - 0.88 * r), (1.76 * r, 1.76 * r), paint, 1.0),
            Symbol::Triangle => {
                self.polygon(&[(x, y - 1.2 * r), (x + 1.1 * r, y + 0.8 * r), (x - 1.1 * r, y + 0.8 * r)], paint)
            }
            Symbol::Diamond => {
                self.polygon(&[(x, y - 1.3 * r), (x + 1.3 * r, y), (x, y + 1.3 * r), (x - 1.3 * r, y)], paint)
            }
            Symbol::Cross => {
                let stroke = Stroke::new(paint, 0.6 * r);
                self.segment((x - r, y - r), (x + r, y + r), stroke);
                self.segment((x - r, y + r), (x + r, y - r), stroke);
            }
            Symbol::Ring => self.ring((x, y), r, Stroke::new(paint, 0.45 * r)),
            Symbol::Frame => self.frame((x - r, y - r), (2.0 * r, 2.0 * r), Stroke::new(paint, 0.45 * r)),
        }
    }

    /// Text of size [`TEXT`].
    pub fn text(&mut self, at: (f64, f64), anchor: Anchor, paint: Paint, text: &str) {
        self.text_sized(at, anchor, paint, TEXT, text);
    }

    /// Text of any size.
    pub fn text_sized(&mut self, at: (f64, f64), anchor: Anchor, paint: Paint, size: f64, text: &str) {
        let place = format!("x=\"{}\" y=\"{}\"", px(at.0), px(at.1));
        self.push_text(&place, anchor, paint, size, text);
    }

    /// Text that reads upwards.
    pub fn text_upwards(&mut self, at: (f64, f64), anchor: Anchor, paint: Paint, text: &str) {
        let place = format!("transform=\"translate({} {}) rotate(-90)\"", px(at.0), px(at.1));
        self.push_text(&place, anchor, paint, TEXT, text);
    }

    fn push_text(&mut self, place: &str, anchor: Anchor, paint: Paint, size: f64, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let (fill, size, text) = (paint.attributes("fill"), px(size), escape(text));
        self.push(format!("<text {place} font-size=\"{size}\"{anchor}{fill}>{text}</text>"));
    }

    /// A picture given as a data URI, stretched over the rectangle; `crisp` shows its pixels as squares.
    pub fn picture(&mut self, corner: (f64, f64), size: (f64, f64), data_uri: &str, crisp: bool) {
        let [x, y, w, h] = [corner.0, corner.1, size.0, size.1].map(px);
        let style = if crisp { " style=\"image-rendering:pixelated\"" } else { "" };
        self.push(format!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\"{style} href=\"{data_uri}\"/>"
        ));
    }

    /// Clips everything until [`Svg::close`] at the rectangle. `name` must be unique on the page.
    pub fn clip(&mut self, name: &str, corner: (f64, f64), size: (f64, f64)) {
        let (name, [x, y, w, h]) = (escape(name), [corner.0, corner.1, size.0, size.1].map(px));
        self.push(format!(
            "<clipPath id=\"{name}\"><rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/></clipPath><g clip-path=\"url(#{name})\">"
        ));
    }

    /// Ends [`Svg::clip`].
    pub fn close(&mut self) {
        self.push("</g>".into());
    }

    /// The finished element, with its accessible name. `id` must be unique on the page.
    pub fn finish(&self, id: &str, title: &str, description: &str) -> String {
        let [w, h] = [self.width, self.height].map(px);
        let (id, title, description) = (escape(id), escape(title), escape(description));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" role=\"img\" \
             aria-labelledby=\"{id}-title {id}-desc\" font-family=\"system-ui, -apple-system, 'Segoe UI', Roboto, \
             'Liberation Sans', sans-serif\"><title id=\"{id}-title\">{title}</title><desc id=\"{id}-desc\">{description}</desc>\
             \n{}</svg>\n",
            self.body
        )
    }

    fn push(&mut self, element: String) {
        self.body.push_str(&element);
        self.body.push('\n');
    }
}

/// Width of a text on the page, rounded up, px.
pub fn text_width(text: &str, size: f64) -> f64 {
    size * text.chars().map(character_width).sum::<f64>()
}

/// Width over the text size, rounded up.
fn character_width(c: char) -> f64 {
    WIDTHS.iter().find(|(characters, _)| characters.contains(c)).map_or(OTHER, |(_, width)| *width)
}

/// The text cut to a width, with an ellipsis if anything was cut.
pub fn fitted(text: &str, width: f64, size: f64) -> String {
    if text_width(text, size) <= width {
        return text.into();
    }
    let mut room = width - text_width("…", size);
    let fits = |c: &char| {
        room -= size * character_width(*c);
        room >= 0.0
    };
    let kept: String = text.chars().take_while(fits).collect();
    format!("{kept}…")
}

/// Text as XML character data or attribute value. Characters that XML 1.0 forbids become U+FFFD.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' => out.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A coordinate to a hundredth of a pixel, without trailing zeros; 0 for a value that is not finite.
fn px(value: f64) -> String {
    if !value.is_finite() {
        return "0".into();
    }
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn opacity(attribute: &str, value: f64) -> String {
    if value < 1.0 { format!(" {attribute}=\"{}\"", px(value)) } else { String::new() }
}

fn path_data(points: &[(f64, f64)]) -> String {
    let mut data = String::new();
    for (i, &(x, y)) in points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()).enumerate() {
        let _ = write!(data, "{}{:.1} {:.1}", if i == 0 { 'M' } else { 'L' }, x, y);
    }
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::xml::assert_well_formed;

    #[test]
    fn prop_hostile_text_stays_text() {
        let mut svg = Svg::new(10.0, 10.0);
        let hostile = "<script>alert('x')</script>&\"\u{0}\u{1b}]]>";
        svg.text((1.0, 1.0), Anchor::Start, Paint::Ink, hostile);
        svg.clip(hostile, (0.0, 0.0), (1.0, 1.0));
        svg.close();
        let out = svg.finish(hostile, hostile, hostile);
        assert_well_formed(&out);
        assert!(!out.contains("<script"));
    }

    #[test]
    fn prop_no_shape_prints_non_finite_numbers() {
        let mut svg = Svg::new(f64::NAN, f64::INFINITY);
        let bad = (f64::NAN, f64::NEG_INFINITY);
        let stroke = Stroke::new(Paint::Series(9), f64::NAN).dashed("3 2").faint(f64::NAN);
        svg.segment(bad, bad, stroke);
        svg.polyline(&[bad, (0.0, 1.0), (2.0, f64::NAN), (3.0, 3.0)], stroke);
        svg.rect(bad, bad, Paint::Paper, 0.5);
        svg.frame(bad, bad, stroke);
        svg.ring(bad, f64::NAN, stroke);
        use Symbol::*;
        for symbol in [Disc, Square, Triangle, Diamond, Cross, Ring, Frame] {
            svg.symbol(symbol, bad, 3.0, Paint::Outcome(7));
        }
        svg.text_upwards(bad, Anchor::Middle, Paint::Muted, "x");
        let out = svg.finish("a", "b", "c");
        assert_well_formed(&out);
        assert!(!out.contains("NaN") && !out.contains("inf"), "{out}");
    }

    #[test]
    fn val_coordinates_are_short() {
        assert_eq!(px(1.0), "1");
        assert_eq!(px(-0.001), "0");
        assert_eq!(px(10.256), "10.26");
        assert_eq!(px(100.0), "100");
    }

    /// Advances of DejaVu Sans, from its table `hmtx`, over 2048 units: no class is narrower than its widest character.
    #[test]
    fn val_texts_are_as_wide_as_in_dejavu_sans() {
        let dejavu =
            [('m', 1995.0), ('w', 1675.0), ('e', 1260.0), ('0', 1303.0), (' ', 651.0), ('+', 1716.0), ('W', 2025.0)];
        assert!(dejavu.iter().all(|&(c, units)| character_width(c) >= units / 2048.0));
        // Not so wide that labels are cut needlessly: by that table, "meadow + snow" has 104.06 px at 12.5 px.
        let width = text_width("meadow + snow", TEXT);
        assert!((104.06..108.0).contains(&width), "{width}");
        assert_eq!(fitted("meadow + snow", width, TEXT), "meadow + snow");
        assert_eq!(fitted("abcdefgh", 10.0 * (3.0 * 0.64 + 0.58 + 1.0) + 0.1, 10.0), "abcd…");
    }
}
