//! Theta* against the any-angle optima of Oh and Leong's test data (Any-Angle-Pathfinding, 2017).
//!
//! In the data, cells are blocked, and paths run between corners of cells and may graze blocked ones. Here, nodes are cell centres, and a line keeps
//! off blocked cells and their corners. Each cell of the data becomes `finer` x `finer` of ours, so the blocked areas are the same and each of our
//! paths is valid in the data; straight pieces inside one free cell join its ends to those of the data. The published optimum is therefore a lower
//! bound on our path, but not an upper one: our paths pass corners at a distance of half a cell of ours.

use super::scenarios::text;
use crate::map::{Neighbourhood, TravelMap};
use crate::search::grid::GridNetwork;
use crate::search::theta_star;
use crate::testing::{drawn, ground, thesis_costs};

/// A map and its problems: column and row of start and goal, and the length of the shortest path.
struct Course {
    rows: Vec<String>,
    problems: Vec<([[usize; 2]; 2], f64)>,
}

fn courses() -> Vec<Course> {
    let mut courses: Vec<Course> = Vec::new();
    for line in text("any_angle.txt.gz").lines() {
        let mut words = line.split(' ');
        match (words.next().unwrap(), courses.last_mut()) {
            ("map", _) => courses.push(Course { rows: Vec::new(), problems: Vec::new() }),
            ("problem", Some(course)) => {
                let mut next = || words.next().unwrap();
                let ends = [0; 2].map(|_| [0; 2].map(|_| next().parse().unwrap()));
                course.problems.push((ends, next().parse().unwrap()));
            }
            (row, Some(course)) => course.rows.push(row.to_owned()),
            (_, None) => panic!("{line}"),
        }
    }
    courses
}

impl Course {
    /// Number of our cells along the side of one cell of the data.
    fn map(&self, finer: usize) -> TravelMap {
        let wide = |row: &String| row.chars().flat_map(|cell| std::iter::repeat_n(cell, finer)).collect::<String>();
        let rows: Vec<String> = self.rows.iter().flat_map(|row| std::iter::repeat_n(wide(row), finer)).collect();
        drawn(&rows.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// Our cell (row, column) that touches a corner of the data, inside a free cell.
    fn beside(&self, [col, row]: [usize; 2], finer: usize) -> [usize; 2] {
        let near = |at: usize| [(at.checked_sub(1), at * finer - usize::from(at > 0)), (Some(at), at * finer)];
        let cells = near(row).into_iter().flat_map(|r| near(col).map(|c| (r, c)));
        let free = |cell: (Option<usize>, Option<usize>)| {
            let (row, col) = (self.rows.get(cell.0?)?, cell.1?);
            (row.as_bytes().get(col) == Some(&b'.')).then_some(())
        };
        let found = cells.into_iter().find(|(r, c)| free((r.0, c.0)).is_some());
        found.map(|(r, c)| [r.1, c.1]).unwrap()
    }
}

/// Relative excess of Theta*, joined to the ends, over the published optimum, for every `stride`-th problem; and the number of problems without a
/// path on our cells.
fn excesses(finer: usize, stride: usize) -> (Vec<f64>, usize) {
    // From the centre of our cell to the corner of the data, in cells of the data.
    let to_corner = std::f64::consts::FRAC_1_SQRT_2 / finer as f64;
    let (mut excesses, mut without) = (Vec::new(), 0);
    let mut count = 0;
    for course in courses() {
        let map = course.map(finer);
        let costs = thesis_costs(&map);
        let grid = GridNetwork { ground: ground(&map, &costs), neighbourhood: Neighbourhood::Eight };
        for (ends, optimum) in &course.problems {
            count += 1;
            if (count - 1) % stride != 0 {
                continue;
            }
            let [start, goal] = ends.map(|end| course.beside(end, finer)).map(|[row, col]| map.node(row, col));
            match theta_star::search(&grid, start, goal) {
                Some(found) => excesses.push((found.cost / finer as f64 + 2.0 * to_corner) / optimum - 1.0),
                None => without += 1,
            }
        }
    }
    excesses.sort_by(f64::total_cmp);
    (excesses, without)
}

/// Number of published problems.
const PROBLEMS: usize = 1802;

/// No path is shorter than the optimum; the median and the largest excess are at most those given, a little above the values in `docs/navigation.md`.
fn check(finer: usize, stride: usize, [median_max, most_max]: [f64; 2]) {
    let (excesses, without) = excesses(finer, stride);
    // Each passage is at least `finer` of our cells wide, so there is always a path.
    assert_eq!((excesses.len(), without), (PROBLEMS.div_ceil(stride), 0));
    let quantile = |share: f64| excesses[(share * (excesses.len() - 1) as f64) as usize];
    println!(
        "cells {finer} times finer: {} problems, {without} without a path on our cells; least excess {:.2e}, median {:.4}, 99 % {:.4}, most {:.4}",
        excesses.len() + without,
        quantile(0.0),
        quantile(0.5),
        quantile(0.99),
        quantile(1.0)
    );
    assert!(quantile(0.0) >= -1e-6, "a path below the optimum: {}", quantile(0.0));
    assert!(quantile(0.5) <= median_max && quantile(1.0) <= most_max, "{} {}", quantile(0.5), quantile(1.0));
}

#[test]
fn val_theta_star_is_never_below_every_fortieth_published_optimum() {
    check(4, 40, [0.1, 0.6]);
}

#[test]
#[ignore = "slow: ./test --full"]
fn val_theta_star_is_never_below_any_published_optimum() {
    check(2, 1, [0.1, 1.2]);
    check(4, 1, [0.05, 0.6]);
    check(8, 8, [0.025, 0.25]);
}
