//! Sparse altimetry: measured points that an elaborated surface passes through.
//!
//! # What
//! With z the elaborated surface, bilinear between lattice points, point k of height `z_k` asks for a move of `D_k = z_k - z(x_k, y_k)`.
//! The surface moves by
//! $$ C(p) = \frac{\sum_k w_k D_k}{\sum_k w_k + \sum_j w_j}, \qquad w = \left( \frac{\max(R - d, 0)}{R\,d} \right)^2 $$
//! over the points k and the posts j of the DEM within R of p. `d` is the distance of p from the lattice cell that holds the point, whose
//! four corners all move by `D_k`, or from the lattice point nearest to the post; R is the distance of the posts, the larger of the two.
//!
//! * Through every point: the bilinear surface over the lattice is `z_k` there. Where samples are farther apart than lattice points, that holds
//!   at points on samples.
//! * Posts stay: C is 0 at each.
//! * No ringing: C is a weighted mean of the moves and of the posts' zeros. It lies between 0 and the largest move around.
//! * Local: C is 0 beyond R of all points, and a function of the place alone, so that windows and zooms of one surface agree bit by bit.
//!   The order of the points does not matter. It has no steps or bends outside of the cells that hold points.
//!
//! A point with a standard error sigma is soft: its move is `D_k (1 - sigma^2 / D_k^2)`, and 0 where `|D_k| < sigma` (positive-part
//! shrinkage of James and Stein, 1961). The surface passes within sigma of it, and the closer the farther it has to move.
//!
//! Points within three lattice spacings of each other are refused, because a lattice cannot pass through both. So close to a post, a
//! point is left out, because the post is exact already, and refused where it lies more than its distance (45 degrees) and three sigma above or
//! below the post.
//!
//! # Source
//! Inverse distance weights: Shepard (1968, doi:10.1145/800186.810616); weights that end at R: Franke and Nielson (1980,
//! doi:10.1002/nme.1620151110). Kriging would need a covariance of the DEM's errors, and overshoots beside a post.
//!
//! # Cost and memory
//! For each point within R of the window the surface at up to four lattice points; for each sample the points and posts within R. 80 bytes a
//! point.

use sastrugi_numeric::{Geometry, sums};
use std::collections::BTreeMap;

/// Points this near to each other, or to a post, share lattice points; lattice units.
const APART: f64 = 3.0;
/// A coordinate this near to a lattice point lies on it; lattice units.
const ON_LATTICE: f64 = 1e-6;
/// Steepest difference from a post nearby, m per m.
const SLOPE_MAX: f64 = 1.0;
/// Largest difference from a post nearby beyond that, standard errors.
const SIGMAS_MAX: f64 = 3.0;

/// Why points cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AltimetryError {
    /// Not a place or height.
    #[error(
        "point {number} of the altimetry is [{x}, {y}, {z}], sigma {sigma}; all must be finite, and sigma 0 or above"
    )]
    NotFinite {
        /// Its number, from 1.
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
        /// Its number, from 1.
        number: usize,
        /// Easting, m.
        x: f64,
        /// Northing, m.
        y: f64,
    },
    /// Two points that no lattice passes through.
    #[error(
        "points {first} and {second} of the altimetry are {apart_m:.4} m apart, at x = {x}, y = {y} m; \
         points must be at least {least_m:.4} m apart: average them"
    )]
    TooClose {
        /// Number of the one, from 1.
        first: usize,
        /// Number of the other.
        second: usize,
        /// Distance, m.
        apart_m: f64,
        /// Easting, m.
        x: f64,
        /// Northing, m.
        y: f64,
        /// Least distance, m.
        least_m: f64,
    },
    /// A point and a post that contradict each other.
    #[error(
        "point {number} of the altimetry lies {apart_m:.4} m beside a post of the DEM, at x = {x}, y = {y} m, and \
         {difference_m:.3} m above it; leave one of the two out"
    )]
    Contradiction {
        /// Its number, from 1.
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
    /// Place of lattice point 0, m.
    pub offset_m: [f64; 2],
}

impl Posts {
    /// A place in lattice units.
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

    /// Calls `f` for the lattice points of posts within R along either axis of a place (lattice units), south first.
    fn near(&self, place: [f64; 2], mut f: impl FnMut([f64; 2])) {
        let (g, reach) = (&self.geometry, self.reach());
        // One more on either side: the lattice point of a post is not quite its place.
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
    /// Lattice points around it: the least and the largest column and row; the same where it lies on one.
    pub corners: [[i64; 2]; 2],
    /// Shares of the way from the least to the largest column and row.
    pub shares: [f64; 2],
    /// Height, m.
    z_m: f64,
    /// Standard error of it, m; 0 for none.
    sigma_m: f64,
    /// Its number among those given, from 1.
    number: usize,
    /// Place, m.
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

    /// How far the surface moves, m.
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

/// Points that a surface can pass through, in an order of their own.
#[derive(Clone, Debug)]
pub struct Points {
    posts: Posts,
    points: Vec<Point>,
    /// How many were left out at posts.
    at_posts: usize,
}

impl Points {
    /// Points `[x, y, z, sigma]` (m) on a DEM; `post_m` tells the height of the post at a column and a row from the south.
    ///
    /// # Errors
    /// The first that cannot be used.
    pub fn new(posts: Posts, given: &[[f64; 4]], post_m: impl Fn(usize, usize) -> f64) -> Result<Self, AltimetryError> {
        let mut points = Vec::with_capacity(given.len());
        for (k, point) in given.iter().enumerate() {
            check(&posts, k + 1, point)?;
            points.push(Point::new(&posts, k + 1, *point));
        }
        // Two points with one key share a cell, and are refused.
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

    /// The points that matter between two corners (lattice units).
    pub fn within_reach(&self, low: [f64; 2], high: [f64; 2]) -> Self {
        let reach = self.posts.reach();
        let near = |p: &&Point| {
            (0..2).all(|a| p.corners[1][a] as f64 > low[a] - reach && (p.corners[0][a] as f64) < high[a] + reach)
        };
        Self { points: self.points.iter().filter(near).copied().collect(), ..*self }
    }

    /// True when there is none.
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

    /// How far the surface moves, with `z` its height at the lattice points of [`Self::corners`], m.
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

/// The square of side R that holds a place.
fn square(place: [f64; 2], reach: f64) -> [i64; 2] {
    place.map(|at| (at / reach).floor() as i64)
}

/// The squares that a point reaches.
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

/// Whether a point stands for a post.
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

/// How far the surface moves, everywhere.
#[derive(Clone, Debug)]
pub struct Correction {
    posts: Posts,
    /// Points with their moves, m.
    moves: Vec<(Point, f64)>,
    /// Places in `moves` of the points that reach a square.
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

    /// The sentence on what the points do.
    pub fn note(&self) -> String {
        let moves: Vec<f64> = self.moves.iter().map(|(_, move_m)| *move_m).collect();
        let squares: Vec<f64> = moves.iter().map(|m| m * m).collect();
        let (rms_m, most_m) = (sums::mean(&squares).sqrt(), moves.iter().fold(0.0, |most: f64, m| most.max(m.abs())));
        let mut note = format!(
            "{} points of the altimetry near the window move the surface by {rms_m:.3} m (root mean square), at most {most_m:.3} m",
            moves.len()
        );
        if self.at_posts > 0 {
            note.push_str(&format!("; {} of all lie at posts of the DEM and are left out", self.at_posts));
        }
        note
    }
}
