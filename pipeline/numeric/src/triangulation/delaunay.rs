//! Incremental Delaunay triangulation of integer points in a rectangle (Lawson, 1977; Guibas and Stolfi, 1985).
//!
//! Points are columns and rows of a grid, so that both the orientation test and the in-circle test are exact in integers: nothing
//! depends on rounding. Half-edge `3 t + k` leads from corner `k` of triangle `t` to the next corner; its twin is the same edge of the
//! neighbouring triangle, in the opposite direction.

/// Marks an edge without a twin, which lies on the rectangle.
const NONE: u32 = u32::MAX;

/// A point, column from the west and row from the south.
pub(super) type Point = [i64; 2];

/// An edge of the polygon around a new vertex.
#[derive(Clone, Copy, Debug)]
struct Link {
    from: u32,
    to: u32,
    twin: u32,
}

/// A Delaunay triangulation that grows point by point.
#[derive(Clone, Debug)]
pub(super) struct Delaunay {
    points: Vec<Point>,
    /// Corners of the triangles, counter-clockwise seen from above.
    corners: Vec<u32>,
    twins: Vec<u32>,
    /// Triangles that the last insertion created or changed, with duplicates.
    touched: Vec<u32>,
    /// Edges that may violate the Delaunay condition.
    doubtful: Vec<u32>,
}

impl Delaunay {
    /// The rectangle from (0, 0) to `[right, top]` as two triangles.
    pub(super) fn new([right, top]: Point) -> Self {
        Self {
            points: vec![[0, 0], [right, 0], [right, top], [0, top]],
            corners: vec![0, 1, 3, 2, 3, 1],
            twins: vec![NONE, 4, NONE, NONE, 1, NONE],
            touched: Vec::new(),
            doubtful: Vec::new(),
        }
    }

    /// Number of triangles.
    pub(super) fn len(&self) -> usize {
        self.corners.len() / 3
    }

    /// Corners of a triangle.
    pub(super) fn triangle(&self, triangle: u32) -> [Point; 3] {
        let first = 3 * triangle;
        [first, first + 1, first + 2].map(|edge| self.origin(edge))
    }

    /// Triangles that the last insertion created or changed, ascending.
    pub(super) fn take_touched(&mut self) -> Vec<u32> {
        self.touched.sort_unstable();
        self.touched.dedup();
        std::mem::take(&mut self.touched)
    }

    /// A triangle that contains a point of the rectangle, found by walking from triangle `start`.
    pub(super) fn locate(&self, point: Point, start: u32) -> u32 {
        let mut triangle = start;
        // In a Delaunay triangulation, no walk visits a triangle twice.
        for _ in 0..self.len() {
            let first = 3 * triangle;
            let crossed = (first..first + 3).find(|&edge| self.side(edge, point) < 0).map(|edge| self.twin(edge));
            match crossed {
                Some(twin) if twin != NONE => triangle = twin / 3,
                _ => break,
            }
        }
        triangle
    }

    /// Adds a point that lies inside the triangle or on one of its edges, but not on a corner.
    pub(super) fn insert(&mut self, point: Point, triangle: u32) {
        let vertex = self.points.len() as u32;
        self.points.push(point);
        self.touched.clear();
        let first = 3 * triangle;
        let on_edge = (first..first + 3).find(|&edge| self.side(edge, point) == 0);
        match on_edge.map(|edge| (edge, self.twin(edge))) {
            None => {
                let ring = [first, first + 1, first + 2].map(|edge| self.link(edge));
                self.fan(vertex, &ring, &[triangle], true);
            }
            Some((edge, NONE)) => {
                let ring = [next(edge), previous(edge)].map(|edge| self.link(edge));
                self.fan(vertex, &ring, &[triangle], false);
            }
            Some((edge, twin)) => {
                let ring = [next(edge), previous(edge), next(twin), previous(twin)].map(|edge| self.link(edge));
                self.fan(vertex, &ring, &[triangle, twin / 3], true);
            }
        }
        self.legalise();
    }

    /// Flips diagonals of squares of four neighbouring vertices, where both diagonals are Delaunay edges, so that they run from north-west to
    /// south-east.
    pub(super) fn turn_square_diagonals(&mut self) {
        for edge in 0..self.corners.len() as u32 {
            let twin = self.twin(edge);
            if twin == NONE {
                continue;
            }
            let [a, b] = [self.origin(edge), self.origin(next(edge))];
            let others = [previous(edge), previous(twin)].map(|edge| self.origin(edge));
            let is_rising = (b[0] - a[0]).abs() == 1 && b[0] - a[0] == b[1] - a[1];
            if is_rising && others.iter().all(|other| *other == [a[0], b[1]] || *other == [b[0], a[1]]) {
                self.flip(edge, twin);
            }
        }
    }

    /// Connects a vertex to a ring of edges around it, counter-clockwise. The first triangles reuse the numbers of old ones.
    fn fan(&mut self, vertex: u32, ring: &[Link], reused: &[u32], closed: bool) {
        let count = ring.len();
        let mut numbers = Vec::with_capacity(count);
        for k in 0..count {
            let number = reused.get(k).copied().unwrap_or_else(|| self.add_triangle());
            numbers.push(number);
        }
        for (k, link) in ring.iter().enumerate() {
            let edge = 3 * numbers[k];
            let has_after = closed || k + 1 < count;
            let has_before = closed || k > 0;
            let (after, before) = (numbers[(k + 1) % count], numbers[(k + count - 1) % count]);
            let at = edge as usize;
            self.corners[at..at + 3].copy_from_slice(&[link.from, link.to, vertex]);
            self.join(edge, link.twin);
            self.twins[at + 1] = if has_after { 3 * after + 2 } else { NONE };
            self.twins[at + 2] = if has_before { 3 * before + 1 } else { NONE };
            self.doubtful.push(edge);
            self.touched.push(numbers[k]);
        }
    }

    fn add_triangle(&mut self) -> u32 {
        let number = self.len() as u32;
        self.corners.extend([NONE; 3]);
        self.twins.extend([NONE; 3]);
        number
    }

    /// Flips edges until no circumcircle of a triangle contains another vertex.
    fn legalise(&mut self) {
        while let Some(edge) = self.doubtful.pop() {
            let twin = self.twin(edge);
            if twin == NONE {
                continue;
            }
            let corners = [edge, next(edge), previous(edge)].map(|edge| self.origin(edge));
            if in_circle(corners, self.origin(previous(twin))) {
                self.flip(edge, twin);
                self.touched.push(twin / 3);
                self.doubtful.extend([edge, previous(twin)]);
            }
        }
    }

    /// Replaces an edge by the other diagonal of the quadrangle around it: `a b p` and `b a d` become `a d p` and `b p d`.
    fn flip(&mut self, edge: u32, twin: u32) {
        let [p, d] = [previous(edge), previous(twin)].map(|edge| self.corners[edge as usize]);
        let [beyond_b, beyond_a] = [next(edge), next(twin)].map(|edge| self.twin(edge));
        self.corners[next(edge) as usize] = d;
        self.corners[next(twin) as usize] = p;
        self.join(edge, beyond_a);
        self.join(twin, beyond_b);
        self.join(next(edge), next(twin));
    }

    fn join(&mut self, edge: u32, twin: u32) {
        self.twins[edge as usize] = twin;
        if twin != NONE {
            self.twins[twin as usize] = edge;
        }
    }

    fn link(&self, edge: u32) -> Link {
        Link { from: self.corners[edge as usize], to: self.corners[next(edge) as usize], twin: self.twin(edge) }
    }

    fn twin(&self, edge: u32) -> u32 {
        self.twins[edge as usize]
    }

    fn origin(&self, edge: u32) -> Point {
        self.points[self.corners[edge as usize] as usize]
    }

    /// Positive for a point to the left of an edge, 0 on its line.
    fn side(&self, edge: u32, point: Point) -> i64 {
        doubled_area([self.origin(edge), self.origin(next(edge)), point])
    }
}

const fn next(edge: u32) -> u32 {
    if edge % 3 == 2 { edge - 2 } else { edge + 1 }
}

const fn previous(edge: u32) -> u32 {
    if edge.is_multiple_of(3) { edge + 2 } else { edge - 1 }
}

/// Twice the area of a triangle; positive counter-clockwise.
pub(super) const fn doubled_area([a, b, c]: [Point; 3]) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// True if a point lies inside the circumcircle of a triangle with counter-clockwise corners.
fn in_circle(corners: [Point; 3], point: Point) -> bool {
    let [[ax, ay], [bx, by], [cx, cy]] =
        corners.map(|corner| [i128::from(corner[0] - point[0]), i128::from(corner[1] - point[1])]);
    let square = |x: i128, y: i128| x * x + y * y;
    let determinant = square(ax, ay) * (bx * cy - cx * by) - square(bx, by) * (ax * cy - cx * ay)
        + square(cx, cy) * (ax * by - bx * ay);
    determinant > 0
}
