//! Axes, grids, and the order in which points are visited.

use flank::sweep::{Axis, Grid, Plan, Seeding, SweepDirection};
use proptest::prelude::*;

fn values(text: &str) -> Vec<f64> {
    let axis = Axis::parse(text).unwrap();
    (0..axis.count()).map(|i| axis.value(i)).collect()
}

#[test]
fn an_axis_is_read() {
    assert_eq!(values("/a=0:1:5"), [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert_eq!(values("/a=0.05:0.3:26")[18], 0.23);
    assert_eq!(values("/a=-0.3:0.3:7"), [-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3]);
    assert_eq!(values("/a=1:1000:4:log"), [1.0, 10.0, 100.0, 1000.0]);
    assert_eq!(values("/a=-1:-100:3:log"), [-1.0, -10.0, -100.0]);
    assert_eq!(values("/a=3,1,2.5"), [3.0, 1.0, 2.5]);
    assert_eq!(values("/a=7"), [7.0]);
    assert_eq!(Axis::parse("/a=b/c=1").unwrap().pointer, "/a=b/c");
}

#[test]
fn every_fault_of_every_axis_is_named() {
    let error = Grid::parse(&["train/x=0:nan:1", "/b", "/c=5:0:3:log", "/d=1,inf,", "/e=1:2", "/f=2:2:3"]).unwrap_err();
    let found: Vec<(&str, &str)> = error.0.iter().map(|f| (&*f.pointer, &*f.found)).collect();
    assert_eq!(
        found,
        [
            ("train/x=0:nan:1", "\"train/x\" as pointer"),
            ("train/x=0:nan:1", "\"nan\""),
            ("train/x=0:nan:1", "\"1\" as count"),
            ("/b", "no equals sign"),
            ("/c=5:0:3:log", "5 to 0 in equal ratios"),
            ("/d=1,inf,", "\"inf\""),
            ("/d=1,inf,", "\"\""),
            ("/e=1:2", "\"1:2\""),
            ("/f=2:2:3", "3 values from 2 to 2"),
        ]
    );
    let many = ["/a=1", "/b=0:1:100001", "/a=0:1:100001"];
    assert_eq!(Grid::parse(&many).unwrap_err().0.len(), 3, "three axes, one twice, too many points");
    assert!(Grid::parse(&[] as &[&str]).is_err());
}

#[test]
fn the_last_axis_runs_fastest() {
    let grid = Grid::parse(&["/a=1,2", "/b=10:30:3"]).unwrap();
    let points: Vec<Vec<f64>> = (0..grid.points()).map(|i| grid.values(i)).collect();
    assert_eq!(points, [[1.0, 10.0], [1.0, 20.0], [1.0, 30.0], [2.0, 10.0], [2.0, 20.0], [2.0, 30.0]]);
    assert_eq!(grid.indices(4), [1, 1]);
}

proptest! {
    #[test]
    fn a_range_has_its_ends_and_reads_the_same_backwards(
        a in -1e6f64..1e6, b in -1e6f64..1e6, count in 2usize..60, log in any::<bool>()
    ) {
        let (a, b) = if log { (a.abs() + 1e-3, b.abs() + 1e-3) } else { (a, b) };
        // Farther apart than the smallest step allowed.
        prop_assume!((a - b).abs() > 1e-3);
        let tail = if log { ":log" } else { "" };
        let up = values(&format!("/a={a}:{b}:{count}{tail}"));
        let mut down = values(&format!("/a={b}:{a}:{count}{tail}"));
        down.reverse();
        prop_assert_eq!(&up, &down);
        prop_assert_eq!((up[0], up[count - 1]), (a, b));
        prop_assert!(up.windows(2).all(|w| (w[1] - w[0]) * (b - a).signum() > 0.0));
    }
}

fn chains(seeding: Seeding) -> Vec<Vec<usize>> {
    let plan = Plan::new(Grid::parse(&["/a=1,2", "/b=1,2,3"]).unwrap(), seeding);
    (0..plan.chains()).map(|chain| plan.chain(chain).collect()).collect()
}

#[test]
fn chains_run_along_the_last_axis() {
    assert_eq!(chains(Seeding::Fresh), [[0], [1], [2], [3], [4], [5]]);
    assert_eq!(chains(Seeding::Up), [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(chains(Seeding::Down), [[2, 1, 0], [5, 4, 3]]);
    assert_eq!(chains(Seeding::Both), [[0, 2, 4], [5, 3, 1], [6, 8, 10], [11, 9, 7]]);
}

#[test]
fn with_both_directions_a_point_has_two_rows() {
    let plan = Plan::new(Grid::parse(&["/a=1,2"]).unwrap(), Seeding::Both);
    let rows: Vec<(f64, SweepDirection)> =
        (0..plan.rows()).map(|i| (plan.cell(i).values[0], plan.cell(i).direction)).collect();
    assert_eq!(
        rows,
        [
            (1.0, SweepDirection::Up),
            (1.0, SweepDirection::Down),
            (2.0, SweepDirection::Up),
            (2.0, SweepDirection::Down)
        ]
    );
}
