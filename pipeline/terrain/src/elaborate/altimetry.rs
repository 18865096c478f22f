//! Sparse altimetry: measured points that an elaborated surface passes through.
//!
//! # What
//! With z the elaborated surface, bilinear between lattice points, point k of height `z_k` requires a shift of `D_k = z_k - z(x_k, y_k)`.
//! The surface is shifted by
//! $$ C(p) = \frac{\sum_k w_k D_k}{\sum_k w_k + \sum_j w_j}, \qquad w = \left( \frac{\max(R - d, 0)}{R\,d} \right)^2 $$
//! over the points k and the posts j of the DEM within R of p. `d` is the distance of p from the lattice cell that contains the point, whose
//! four corners are all shifted by `D_k`, or from the lattice point nearest to the post; R is the post spacing, the larger of the two.
//!
//! * Exact at points: the bilinear surface over the lattice is `z_k` there. If samples are farther apart than lattice points, this holds
//!   for points that lie on samples.
//! * Exact at posts: C is 0 at each.
//! * No ringing: C is a weighted mean of the shifts and of the posts' zeros, so it lies between 0 and the largest shift nearby.
//! * Local: C is 0 farther than R from all points, and a function of position alone, so that windows and zooms of one surface agree bit by
//!   bit. The order of the points does not matter. C has continuous value and slope outside the cells that contain points.
//!
//! A point with a standard error sigma is soft: its shift is `D_k (1 - sigma^2 / D_k^2)`, and 0 if `|D_k| < sigma` (positive-part
//! shrinkage of James and Stein, 1961). The surface passes within sigma of it, and the larger the shift, the closer.
//!
//! Points within three lattice spacings of each other are refused, because a lattice cannot pass through both. A point that close to a
//! post is left out, because the surface already passes through the post; it is refused if it lies above or below the post by more than its
//! distance (45 degrees) plus three sigma.
//!
//! # Source
//! Inverse-distance weights: Shepard (1968, doi:10.1145/800186.810616); weights that vanish at R: Franke and Nielson (1980,
//! doi:10.1002/nme.1620151110). Kriging would need a covariance of the DEM's errors, and overshoots next to a post.
//!
//! # Cost and memory
//! For each point within R of the window, the surface at up to four lattice points; for each sample, the points and posts within R. 80 bytes
//! per point.

use sastrugi_numeric::{Geometry, sums};
use std::collections::BTreeMap;

/// Points this close to each other, or to a post, share lattice points; lattice units.
const APART: f64 = 3.0;
/// A coordinate this close to a lattice point lies on it; lattice units.
const ON_LATTICE: f64 = 1e-6;
/// Steepest permitted slope to a nearby post, m per m.
const SLOPE_MAX: f64 = 1.0;
/// Additional permitted difference from a nearby post, standard errors.
const SIGMAS_MAX: f64 = 3.0;

/// Why points cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AltimetryError {
    /// Coordinates or height that are not finite, or a negative standard error.
    #[error(
        "point {number} of the altimetry is [{x}, {y}, {z}], sigma {sigma}; all must be finite, and sigma 0 or above"
    )]
    NotFinite {
        /// Number of the point, from 1.
        number: usize,
        /// Easting.
        x: f64,
        /// Northing.
        y: f64,
        /// Height.
        z: f64,
        /// Standard error.
        sigma: f64,
    },
    /// Beyond the outer posts.
    #[error("point {number} of the altimetry, x = {x}, y = {y} m, does not lie between the outer posts of the DEM")]
    Outside {
        /// Number of the point, from 1.
        number: usize,
        /// Easting, m.
        x: f64,
        /// Northing, m.
        y: f64,
    },
    /// Two points too close for a lattice to pass through both.
    #[error(
        "points {first} and {second} of the altimetry are {apart_m:.4} m apart, at x = {x}, y = {y} m; \
         they must be at least {least_m:.4} m apart; average them"
    )]
    TooClose {
        /// Number of the first point, from 1.
        first: usize,
        /// Number of the second point.
        second: usize,
        /// Distance, m.
        apart_m: f64,
        /// Easting, m.
        x: f64,
        /// Northing, m.
        y: f64,
        /// Minimum distance, m.
        least_m: f64,
    },
    /// A point and a post that contradict each other.
    #[error(
        "point {number} of the altimetry, at x = {x}, y = {y} m, lies only {apart_m:.4} m from a post of the DEM but \
         {difference_m:.3} m above it; remove the point or correct the DEM"
    )]
    Contradiction {
        /// Number of the point, from 1.
        number: usize,
        /// Distance, m.
        apart_m: f64,
        /// Easting, m.
        x: f64,
        /// Northing, m.
        y: f64,
        /// Its height above the post, m.
        difference_m: f64,
    },
}

/// The posts of a DEM, and the lattice under them.
#[derive(Clone, Copy, Debug)]
pub struct Posts {
    /// The DEM's cells.
    pub geometry: Geometry,
    /// Basic spacing, m.
    pub spacing_m: f64,
    /// Position of lattice point 0, m.
    pub offset_m: [f64; 2],
}

impl Posts {
    /// A position in lattice units.
    pub fn to_lattice(self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.offset_m[0]) / self.spacing_m, (y - self.offset_m[1]) / self.spacing_m]
    }

    /// The lattice point nearest to the post of a column and a row from the south.
    fn post(&self, col: usize, row_from_south: usize) -> [f64; 2] {
        let g = &self.geometry;
        self.to_lattice([g.x(col), g.y(g.rows - 1 - row_from_south)]).map(f64::round)
    }

    /// R, lattice units.
    pub fn reach(&self) -> f64 {
        self.geometry.cell[0].max(self.geometry.cell[1]) / self.spacing_m
    }

    /// Calls `f` for the lattice points of posts within R of a position along either axis (lattice units), from the south.
    fn near(&self, place: [f64; 2], mut f: impl FnMut([f64; 2])) {
        let (g, reach) = (&self.geometry, self.reach());
        // One more on either side: the lattice point of a post is not exactly at its position.
        let range = |axis: usize, count: usize| {
            let at = |lattice: f64| {
                let place_m = lattice * self.spacing_m + self.offset_m[axis];
                (place_m - g.origin[axis]) / g.cell[axis] - 0.5
            };
            let [low, high] = [at(place[axis] - reach).floor() - 1.0, at(place[axis] + reach).ceil() + 2.0];
            low.max(0.0) as usize..(high.max(0.0) as usize).min(count)
        };
        for row in range(1, g.rows) {
            range(0, g.cols).for_each(|col| f(self.post(col, row)));
        }
    }
}

/// A measured point, placed on the lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Surrounding lattice points: the smallest and the largest column and row; equal if it lies on a lattice point.
    pub corners: [[i64; 2]; 2],
    /// Fractions of the way from the smallest to the largest column and row.
    pub shares: [f64; 2],
    /// Height, m.
    z_m: f64,
    /// Standard error of the height, m; 0 for an exact point.
    sigma_m: f64,
    /// Its number in the input, from 1.
    number: usize,
    /// Position, m.
    place_m: [f64; 2],
}

impl Point {
    fn new(posts: &Posts, number: usize, [x, y, z_m, sigma_m]: [f64; 4]) -> Self {
        let at = posts.to_lattice([x, y]).map(|at| if (at - at.round()).abs() < ON_LATTICE { at.round() } else { at });
        let corners = [at.map(|at| at.floor() as i64), at.map(|at| at.ceil() as i64)];
        Self { corners, shares: at.map(|at| at - at.floor()), z_m, sigma_m, number, place_m: [x, y] }
    }

    /// Distance of a lattice point from the cell, lattice units.
    fn distance(&self, place: [f64; 2]) -> f64 {
        let [low, high] = self.corners;
        let beyond = |axis: usize| (low[axis] as f64 - place[axis]).max(place[axis] - high[axis] as f64).max(0.0);
        length([beyond(0), beyond(1)])
    }

    /// Height of the bilinear surface at the point, m.
    fn height_on(&self, z: &impl Fn([i64; 2]) -> f64) -> f64 {
        let ([low, high], [east, north]) = (self.corners, self.shares);
        let along = |j: i64| {
            let west = z([low[0], j]);
            if east > 0.0 { west + (z([high[0], j]) - west) * east } else { west }
        };
        let south = along(low[1]);
        if north > 0.0 { south + (along(high[1]) - south) * north } else { south }
    }

    /// Shift of the surface, m.
    fn move_m(&self, z_m: f64) -> f64 {
        let whole = self.z_m - z_m;
        let shrunk = (whole * whole - self.sigma_m * self.sigma_m).max(0.0);
        if self.sigma_m > 0.0 && whole != 0.0 { shrunk / whole } else { whole }
    }
}

fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// Weight of a datum at a distance below R.
fn weight(distance: f64, reach: f64) -> f64 {
    let w = (reach - distance) / (reach * distance);
    w * w
}

/// Points that a surface can pass through, in canonical order.
#[derive(Clone, Debug)]
pub struct Points {
    posts: Posts,
    points: Vec<Point>,
    /// How many were left out because they lie at posts.
    at_posts: usize,
}

impl Points {
    /// Points `[x, y, z, sigma]` (m) on a DEM; `post_m` gives the height of the post at a column and a row from the south.
    ///
    /// # Errors
    /// The first point that cannot be used.
    pub fn new(posts: Posts, given: &[[f64; 4]], post_m: impl Fn(usize, usize) -> f64) -> Result<Self, AltimetryError> {
        let mut points = Vec::with_capacity(given.len());
        for (k, point) in given.iter().enumerate() {
            check(&posts, k + 1, point)?;
            points.push(Point::new(&posts, k + 1, *point));
        }
        // Two points with the same key share a cell, and are refused.
        points.sort_by_key(|p| (p.corners[0][1], p.corners[0][0]));
        check_apart(&posts, &points)?;
        let mut free = Vec::with_capacity(points.len());
        for point in &points {
            if !is_at_post(&posts, point, &post_m)? {
                free.push(*point);
            }
        }
        Ok(Self { posts, at_posts: points.len() - free.len(), points: free })
    }

    /// The points within reach of a rectangle, given by two corners (lattice units).
    pub fn within_reach(&self, low: [f64; 2], high: [f64; 2]) -> Self {
        let reach = self.posts.reach();
        let near = |p: &&Point| {
            (0..2).all(|a| p.corners[1][a] as f64 > low[a] - reach && (p.corners[0][a] as f64) < high[a] + reach)
        };
        Self { points: self.points.iter().filter(near).copied().collect(), ..*self }
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The lattice points around all points, each once, in order.
    pub fn corners(&self) -> Vec<[i64; 2]> {
        let of = |p: &Point| {
            let [low, high] = p.corners;
            [[low[0], low[1]], [high[0], low[1]], [low[0], high[1]], [high[0], high[1]]]
        };
        let mut all: Vec<[i64; 2]> = self.points.iter().flat_map(of).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The shift of the surface, with `z` its height at the lattice points of [`Self::corners`], m.
    pub fn correction(&self, z: impl Fn([i64; 2]) -> f64) -> Correction {
        let posts = self.posts;
        let moves: Vec<(Point, f64)> = self.points.iter().map(|p| (*p, p.move_m(p.height_on(&z)))).collect();
        let mut squares: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        for (k, (point, _)) in moves.iter().enumerate() {
            for square in within(point, posts.reach()) {
                squares.entry(square).or_default().push(k);
            }
        }
        Correction { posts, moves, squares, at_posts: self.at_posts }
    }
}

/// The square of side R that contains a position.
fn square(place: [f64; 2], reach: f64) -> [i64; 2] {
    place.map(|at| (at / reach).floor() as i64)
}

/// The squares within reach of a point.
fn within(point: &Point, reach: f64) -> impl Iterator<Item = [i64; 2]> {
    let [low, high] = point.corners.map(|corner| corner.map(|at| at as f64));
    let (first, last) = (square(low.map(|at| at - reach), reach), square(high.map(|at| at + reach), reach));
    (first[1]..=last[1]).flat_map(move |j| (first[0]..=last[0]).map(move |i| [i, j]))
}

fn check(posts: &Posts, number: usize, &[x, y, z, sigma]: &[f64; 4]) -> Result<(), AltimetryError> {
    if ![x, y, z, sigma].iter().all(|v| v.is_finite()) || sigma < 0.0 {
        return Err(AltimetryError::NotFinite { number, x, y, z, sigma });
    }
    let g = &posts.geometry;
    let inside = (g.x(0)..=g.x(g.cols - 1)).contains(&x) && (g.y(g.rows - 1)..=g.y(0)).contains(&y);
    if inside { Ok(()) } else { Err(AltimetryError::Outside { number, x, y }) }
}

/// Refuses points that share lattice points; they are sorted from south to north.
fn check_apart(posts: &Posts, points: &[Point]) -> Result<(), AltimetryError> {
    let least_m = APART * posts.spacing_m;
    for (k, a) in points.iter().enumerate() {
        let near = points[k + 1..].iter().take_while(|b| (b.corners[0][1] - a.corners[0][1]) as f64 <= APART + 1.0);
        for b in near {
            let apart_m = length([0, 1].map(|axis| a.place_m[axis] - b.place_m[axis]));
            if apart_m < least_m {
                let (first, second) = (a.number.min(b.number), a.number.max(b.number));
                let [x, y] = a.place_m;
                return Err(AltimetryError::TooClose { first, second, apart_m, x, y, least_m });
            }
        }
    }
    Ok(())
}

/// Whether a point lies at a post and agrees with it.
fn is_at_post(posts: &Posts, point: &Point, post_m: &impl Fn(usize, usize) -> f64) -> Result<bool, AltimetryError> {
    let g = &posts.geometry;
    let [x, y] = point.place_m;
    let [col, row] = [(x - g.x(0)) / g.cell[0], (y - g.y(g.rows - 1)) / g.cell[1]].map(|at| at.round() as usize);
    let apart_m = length([x - g.x(col), y - g.y(g.rows - 1 - row)]);
    let height_m = post_m(col, row);
    if apart_m >= APART * posts.spacing_m || !height_m.is_finite() {
        return Ok(false);
    }
    let difference_m = point.z_m - height_m;
    // Heights are measured in single precision at best.
    let rounding_m = 1e-6 * (1.0 + height_m.abs());
    if difference_m.abs() <= SLOPE_MAX * apart_m + SIGMAS_MAX * point.sigma_m + rounding_m {
        Ok(true)
    } else {
        Err(AltimetryError::Contradiction { number: point.number, apart_m, x, y, difference_m })
    }
}

/// Shift of the surface, everywhere.
#[derive(Clone, Debug)]
pub struct Correction {
    posts: Posts,
    /// Points with their shifts, m.
    moves: Vec<(Point, f64)>,
    /// For each square, the indices in `moves` of the points within reach.
    squares: BTreeMap<[i64; 2], Vec<usize>>,
    at_posts: usize,
}

impl Correction {
    /// C at a lattice point, m.
    pub fn at(&self, place: [f64; 2]) -> f64 {
        let reach = self.posts.reach();
        let (mut moved, mut weights) = (0.0, 0.0);
        for k in self.squares.get(&square(place, reach)).into_iter().flatten() {
            let (point, move_m) = &self.moves[*k];
            let distance = point.distance(place);
            if distance == 0.0 {
                return *move_m;
            }
            if distance < reach {
                let w = weight(distance, reach);
                moved += w * move_m;
                weights += w;
            }
        }
        if weights == 0.0 {
            return 0.0;
        }
        let mut on_post = false;
        self.posts.near(place, |post| {
            let distance = length([post[0] - place[0], post[1] - place[1]]);
            on_post |= distance == 0.0;
            if distance > 0.0 && distance < reach {
                weights += weight(distance, reach);
            }
        });
        if on_post { 0.0 } else { moved / weights }
    }

    /// A note on the effect of the points.
    pub fn note(&self) -> String {
        let moves: Vec<f64> = self.moves.iter().map(|(_, move_m)| *move_m).collect();
        let squares: Vec<f64> = moves.iter().map(|m| m * m).collect();
        let (rms_m, most_m) = (sums::mean(&squares).sqrt(), moves.iter().fold(0.0, |most: f64, m| most.max(m.abs())));
        let mut note = format!(
            "altimetry points near the window: {}; they shift the surface by {rms_m:.3} m RMS, {most_m:.3} m at most",
            moves.len()
        );
        if self.at_posts > 0 {
            note.push_str(&format!("; points left out because they lie at posts of the DEM: {}", self.at_posts));
        }
        note
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The shift at lattice points around three points, one of them on a lattice point, against the formula of the header over all points and
    /// all posts.
    #[test]
    fn val_the_shift_is_the_weighted_mean() {
        // Posts at multiples of 8 east and 6 north; R is 8.
        let geometry = Geometry { rows: 5, cols: 6, cell: [8.0, 6.0], origin: [-4.0, -3.0] };
        let posts = Posts { geometry, spacing_m: 1.0, offset_m: [0.0; 2] };
        let given = [[11.3, 9.6, 2.0, 0.0], [20.0, 15.0, -1.0, 0.0], [28.5, 9.25, 0.5, 0.0]];
        let correction = Points::new(posts, &given, |_, _| 0.0).unwrap().correction(|_| 0.0);
        let weight = |d: f64| if d < 8.0 { ((8.0 - d) / (8.0 * d)) * ((8.0 - d) / (8.0 * d)) } else { 0.0 };
        let mut changed = 0;
        for (i, j) in (-3..45).flat_map(|i| (-3..30).map(move |j| (f64::from(i), f64::from(j)))) {
            // Distance from the cell of a point, and its height, which is the shift of level ground.
            let data = given.map(|[x, y, z, _]| {
                let beyond = |at: f64, p: f64| (at.floor() - p).max(p - at.ceil()).max(0.0);
                (length([beyond(x, i), beyond(y, j)]), z)
            });
            let places = (0..6).flat_map(|col| (0..5).map(move |row| [8.0 * f64::from(col), 6.0 * f64::from(row)]));
            let distances: Vec<f64> = places.map(|[x, y]| length([x - i, y - j])).collect();
            let wanted = if let Some((_, z)) = data.iter().find(|(d, _)| *d == 0.0) {
                *z
            } else if distances.contains(&0.0) {
                0.0
            } else {
                let moved: f64 = data.iter().map(|(d, z)| weight(*d) * z).sum();
                let all = data.iter().map(|(d, _)| *d).chain(distances).map(weight).sum::<f64>();
                if moved == 0.0 { 0.0 } else { moved / all }
            };
            let found = correction.at([i, j]);
            assert!((found - wanted).abs() < 1e-12, "{i} {j}: {found} {wanted}");
            changed += usize::from(found != 0.0);
        }
        assert!(changed > 200, "{changed}");
    }
}
