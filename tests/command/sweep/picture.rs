//! Pictures of sweeps: rows of a branch are joined, and never across a jump; over two numbers every cell has its class.

use flank::{
    map::sweep_figure,
    orbit::{Motion, MotionKind},
    plot::Style,
    study::{ContactMeasures, SweepRow},
    sweep::{Grid, Plan, Seeding},
};

fn row(row: usize, period: Option<u64>, word: &str, force: f64) -> SweepRow {
    let kind = if period.is_some() { MotionKind::Periodic } else { MotionKind::Chaotic };
    let motion = Motion {
        kind,
        period,
        word: Some(word.to_owned()),
        multiplier: None,
        exponent: None,
        rotation: None,
        cycles: 0,
        distance: 0.0,
        reason: None,
    };
    let shown = ContactMeasures { apart: 0.0, force: Some(force), deflection: [None; 2] };
    SweepRow { row, motion, contacts: vec![("mesh".to_owned(), shown)] }
}

#[test]
fn lines_end_at_jumps() {
    let plan = Plan::new(Grid::parse(&["/a=1:10:10"]).unwrap(), Seeding::Up);
    // A straight branch up to 4, a jump with the same period and word, another branch, another word from 8 on; 10 is chaotic.
    let force = [1.0, 2.0, 3.0, 4.0, 20.0, 21.0, 22.0, 23.0, 24.0, 25.0];
    let rows: Vec<SweepRow> =
        (0..10).map(|i| row(i, (i < 9).then_some(1), if i < 7 { "c0+" } else { "c0+ s0+" }, force[i])).collect();
    let figure = sweep_figure("scene", &plan, &rows, true).unwrap();
    let panel = figure.panels.iter().find(|panel| panel.title.contains("force")).unwrap();
    let lines: Vec<&[f64]> =
        panel.series.iter().filter(|series| series.style == Style::Line).map(|series| &series.x[..]).collect();
    assert_eq!(lines, [&[1.0, 2.0, 3.0, 4.0][..], &[5.0, 6.0, 7.0], &[8.0, 9.0]]);
    let points: usize = panel.series.iter().filter(|s| s.style == Style::Points).map(|s| s.x.len()).sum();
    assert_eq!(points, 10);
}

#[test]
fn a_plane_has_a_class_for_every_cell() {
    let plan = Plan::new(Grid::parse(&["/a=1:3:3", "/b=1:2:2"]).unwrap(), Seeding::Fresh);
    // The cell (3, 1) has failed: it has no row.
    let rows: Vec<SweepRow> =
        [0, 1, 2, 3, 5].map(|i| row(i, (i != 1).then_some(1 + i as u64 / 2), "", i as f64)).into_iter().collect();
    let figure = sweep_figure("scene", &plan, &rows, true).unwrap();
    let kinds = figure.panels[0].raster.as_ref().unwrap();
    let names: Vec<&str> = kinds.points.iter().map(|class| kinds.classes[usize::from(*class)].0.as_str()).collect();
    // Rows of the image from the top: b = 2, then b = 1; a to the right.
    assert_eq!(names, ["chaotic", "period 2", "period 3", "period 1", "period 2", "failed"]);
    assert_eq!(figure.panels.len(), 3);
}
