//! Sweeps of toy maps: grid order, branches, threads, journals torn, foreign or in use.

use std::{
    collections::HashSet,
    fs,
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};

use flank::{
    Task,
    output::OutputError,
    sweep::{Begin, Ending, Grid, Journal, Plan, RowWork, Seeding, SweepError, Tally, run},
};
use rayon::prelude::*;
use serde_json::Value;

const FILES: [&str; 4] = ["sweep.csv", "sweep.jsonl", "sweep.json", "flank-manifest.json"];
const SEEDINGS: [Seeding; 4] = [Seeding::Fresh, Seeding::Up, Seeding::Down, Seeding::Both];

fn plan(axes: &[&str], seeding: Seeding) -> Plan {
    Plan::new(Grid::parse(axes).unwrap(), seeding)
}

/// x ← tanh 3x + a, which has two stable fixed points for |a| < 0.4344: there cosh² 3x = 3 and a = tanh 3x − x.
fn bistable(cell: &RowWork, seed: Option<&f64>) -> Result<(Toy, f64), String> {
    let a = *cell.values.last().unwrap();
    // OK not to have converged: what a row is does not depend on it.
    let x = (0..400).fold(seed.copied().unwrap_or(0.1), |x, _| (3.0 * x).tanh() + a);
    Ok(((x, seed.is_some()), x))
}

/// Where the map ended, and whether it was given a start.
type Toy = (f64, bool);

fn open(folder: &Path, begin: Begin, plan: &Plan) -> Result<Option<Journal<Toy, f64>>, SweepError> {
    let mut header = plan.header();
    header.insert("map".to_owned(), "bistable".into());
    Journal::open(folder, begin, header, plan)
}

/// Sweeps until `most` points are done by `work`; gives the tally if nothing is missing then.
fn sweep_with(
    folder: &Path,
    begin: Begin,
    plan: &Plan,
    threads: usize,
    most: usize,
    work: impl Fn(&RowWork, Option<&f64>) -> Result<(Toy, f64), String> + Sync,
) -> Option<Tally> {
    let mut journal = open(folder, begin, plan).unwrap().unwrap();
    let (interrupted, done) = (AtomicBool::new(most == 0), AtomicUsize::new(0));
    let point = |cell: &RowWork, seed: Option<&f64>| {
        let row = work(cell, seed);
        if done.fetch_add(1, Ordering::Relaxed) + 1 >= most {
            interrupted.store(true, Ordering::Relaxed);
        }
        row
    };
    let task = Task::new(&interrupted, &|_| ());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    match pool.install(|| run(plan, &mut journal, point, task)).unwrap() {
        Ending::Complete => Some(
            journal
                .finish(plan, &["seeded", "x"], |(x, seeded)| vec![seeded.to_string(), x.to_string()], |_| Ok(()))
                .unwrap(),
        ),
        Ending::Interrupted => None,
    }
}

fn sweep(folder: &Path, begin: Begin, plan: &Plan, threads: usize, most: usize) -> Option<Tally> {
    sweep_with(folder, begin, plan, threads, most, bistable)
}

fn bytes(folder: &Path) -> Vec<Vec<u8>> {
    assert_eq!(fs::read_dir(folder).unwrap().count(), FILES.len(), "nothing else is left");
    FILES.map(|name| fs::read(folder.join(name)).unwrap()).to_vec()
}

fn undisturbed(plan: &Plan) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    sweep(folder.path(), Begin::New, plan, 1, usize::MAX).unwrap();
    bytes(folder.path())
}

fn rows(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("sweep.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn rows_are_in_grid_order_and_say_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(&["/k=1,2", "/a=-1:1:3"], Seeding::Both);
    assert_eq!(sweep(folder.path(), Begin::New, &plan, 2, usize::MAX), Some(Tally { rows: 12, failed: 0 }));
    let text = fs::read_to_string(folder.path().join("sweep.csv")).unwrap();
    let heads: Vec<String> =
        text.lines().map(|line| line.splitn(5, ',').take(4).collect::<Vec<_>>().join(",")).collect();
    let mut expected = vec!["/k,/a,direction,seeded".to_owned()];
    for k in ["1.0", "2.0"] {
        for (a, up, down) in [("-1.0", false, true), ("0.0", true, true), ("1.0", true, false)] {
            expected.extend([format!("{k},{a},up,{up}"), format!("{k},{a},down,{down}")]);
        }
    }
    assert_eq!(heads, expected);
    let rows = rows(folder.path());
    assert_eq!(rows.len(), 12);
    assert_eq!(rows[5]["at"]["/a"], 1.0);
    assert_eq!(rows[5]["direction"], "down");
    let seal: Value = serde_json::from_slice(&fs::read(folder.path().join("sweep.json")).unwrap()).unwrap();
    assert_eq!((&seal["rows"], &seal["failed"], &seal["map"]), (&12.into(), &0.into(), &"bistable".into()));
    assert_eq!(seal["axes"][1]["count"], 3);
}

#[test]
fn the_two_directions_show_both_branches() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(&["/a=-1:1:41"], Seeding::Both);
    sweep(folder.path(), Begin::New, &plan, 2, usize::MAX).unwrap();
    let fold = 2f64.sqrt() / 3f64.sqrt() - 3f64.sqrt().acosh() / 3.0;
    let rows = rows(folder.path());
    for pair in rows.chunks(2) {
        let a = pair[0]["at"]["/a"].as_f64().unwrap();
        let [up, down] = [0, 1].map(|i| pair[i]["result"][0].as_f64().unwrap());
        if a.abs() < fold {
            assert!(up < -0.38 && down > 0.38, "a = {a}: {up}, {down}");
        } else {
            // The map contracts by less than 1/2 at the one fixed point that is left, and 400 times: to rounding.
            assert!((up - down).abs() < 8.0 * f64::EPSILON, "a = {a}: {up}, {down}");
        }
    }
}

#[test]
fn threads_do_not_enter() {
    for seeding in SEEDINGS {
        let plan = plan(&["/k=0:1:5", "/a=-0.7:0.7:7"], seeding);
        let expected = undisturbed(&plan);
        for threads in [0, 2, 4] {
            let folder = tempfile::tempdir().unwrap();
            sweep(folder.path(), Begin::New, &plan, threads, usize::MAX).unwrap();
            assert_eq!(bytes(folder.path()), expected, "{seeding:?}, {threads} threads");
        }
    }
}

#[test]
fn sweeps_side_by_side_share_the_threads_of_their_caller() {
    let plan = plan(&["/k=0:1:3", "/a=-0.7:0.7:5"], Seeding::Both);
    let expected = undisturbed(&plan);
    for threads in [1, 2] {
        let used = Mutex::new(HashSet::new());
        let one = |_| {
            let folder = tempfile::tempdir().unwrap();
            let mut journal = open(folder.path(), Begin::New, &plan).unwrap().unwrap();
            let point = |cell: &RowWork, seed: Option<&f64>| {
                used.lock().unwrap().insert(std::thread::current().id());
                bistable(cell, seed)
            };
            assert_eq!(run(&plan, &mut journal, point, Task::default()).unwrap(), Ending::Complete);
            journal
                .finish(&plan, &["seeded", "x"], |(x, seeded)| vec![seeded.to_string(), x.to_string()], |_| Ok(()))
                .unwrap();
            bytes(folder.path())
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let all: Vec<_> = pool.install(|| (0..4).into_par_iter().map(one).collect());
        assert!(all.iter().all(|bytes| *bytes == expected), "{threads} threads");
        assert!(used.into_inner().unwrap().len() <= threads);
    }
}

#[test]
fn a_sweep_broken_off_after_any_point_goes_on_to_the_same_bytes() {
    for seeding in SEEDINGS {
        let plan = plan(&["/k=1,2", "/a=-0.7:0.7:5"], seeding);
        let expected = undisturbed(&plan);
        for most in 0..plan.rows() {
            let folder = tempfile::tempdir().unwrap();
            assert_eq!(sweep(folder.path(), Begin::New, &plan, 1, most), None);
            assert!(!folder.path().join("sweep.csv").exists());
            assert_eq!(open(folder.path(), Begin::Resume, &plan).unwrap().unwrap().records().count(), most);
            // Broken off once more; with two threads the point that is running is kept too, and may be the last.
            if sweep(folder.path(), Begin::Resume, &plan, 2, 1).is_none() {
                sweep(folder.path(), Begin::Resume, &plan, 2, usize::MAX).unwrap();
            }
            assert_eq!(bytes(folder.path()), expected, "{seeding:?} after {most} points");
        }
    }
}

#[test]
fn points_that_are_kept_are_not_computed_again() {
    let plan = plan(&["/a=0:1:10"], Seeding::Up);
    let folder = tempfile::tempdir().unwrap();
    sweep(folder.path(), Begin::New, &plan, 1, 6);
    let again = Mutex::new(Vec::new());
    sweep_with(folder.path(), Begin::Resume, &plan, 1, usize::MAX, |cell, seed| {
        again.lock().unwrap().push(cell.row);
        bistable(cell, seed)
    });
    assert_eq!(*again.lock().unwrap(), [6, 7, 8, 9]);
}

#[test]
fn a_journal_torn_anywhere_in_its_last_line_goes_on_to_the_same_bytes() {
    let plan = plan(&["/a=-0.7:0.7:6"], Seeding::Both);
    let expected = undisturbed(&plan);
    // After no row the last line is the header.
    for most in [0, 5] {
        let folder = tempfile::tempdir().unwrap();
        sweep(folder.path(), Begin::New, &plan, 1, most);
        let whole = fs::read(folder.path().join("sweep.journal")).unwrap();
        let last = whole[..whole.len() - 1].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        for cut in last..=whole.len() {
            let torn = tempfile::tempdir().unwrap();
            fs::write(torn.path().join("sweep.journal"), &whole[..cut]).unwrap();
            sweep(torn.path(), Begin::Resume, &plan, 1, usize::MAX).unwrap();
            assert_eq!(bytes(torn.path()), expected, "cut at {cut} of {}", whole.len());
        }
    }
}

#[test]
fn a_sweep_killed_while_it_writes_its_files_is_finished_by_the_next() {
    let plan = plan(&["/a=0:1:4"], Seeding::Fresh);
    let folder = tempfile::tempdir().unwrap();
    let mut journal = open(folder.path(), Begin::New, &plan).unwrap().unwrap();
    assert_eq!(run(&plan, &mut journal, bistable, Task::default()).unwrap(), Ending::Complete);
    drop(journal);
    fs::write(folder.path().join("sweep.csv"), "whole").unwrap();
    fs::write(folder.path().join("sweep.jsonl.part"), "half a li").unwrap();
    sweep(folder.path(), Begin::Resume, &plan, 1, usize::MAX).unwrap();
    assert_eq!(bytes(folder.path()), undisturbed(&plan));
}

#[test]
fn another_sweep_is_not_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let up = plan(&["/a=0:1:4"], Seeding::Up);
    let down = plan(&["/a=0:1:5"], Seeding::Down);
    for most in [2, usize::MAX] {
        sweep(folder.path(), Begin::Resume, &up, 1, most);
        let SweepError::Mismatch { differences, .. } = open(folder.path(), Begin::Resume, &down).unwrap_err() else {
            panic!("a mismatch")
        };
        assert_eq!(differences.len(), 2, "{differences:?}");
        assert!(differences[0].starts_with("axes: [{\"count\":4,"), "{}", differences[0]);
        assert_eq!(differences[1], "seeding: \"up\" there, \"down\" here");
    }
    assert_eq!(bytes(folder.path()), undisturbed(&up), "nothing was changed");
}

#[test]
fn a_finished_sweep_has_nothing_to_resume() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(&["/a=0:1:4"], Seeding::Up);
    sweep(folder.path(), Begin::Resume, &plan, 1, usize::MAX).unwrap();
    assert!(open(folder.path(), Begin::Resume, &plan).unwrap().is_none());
    assert_eq!(bytes(folder.path()), undisturbed(&plan));
}

#[test]
fn a_folder_in_use_or_occupied_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(&["/a=0:1:4"], Seeding::Up);
    let first = open(folder.path(), Begin::New, &plan).unwrap().unwrap();
    for begin in [Begin::Resume, Begin::Replace] {
        assert!(
            matches!(open(folder.path(), begin, &plan), Err(SweepError::Output(OutputError::InUse(_)))),
            "{begin:?}"
        );
    }
    assert!(matches!(open(folder.path(), Begin::New, &plan), Err(SweepError::Unfinished(_))));
    drop(first);
    assert!(matches!(open(folder.path(), Begin::New, &plan), Err(SweepError::Unfinished(_))));
    sweep(folder.path(), Begin::Resume, &plan, 1, usize::MAX).unwrap();
    assert!(matches!(open(folder.path(), Begin::New, &plan), Err(SweepError::Output(OutputError::Occupied(_)))));
    // What is replaced is gone at once.
    drop(open(folder.path(), Begin::Replace, &plan).unwrap().unwrap());
    assert!(!folder.path().join("sweep.csv").exists());
}

/// A record that is damaged, or that stands for another row, costs its own row; a second copy costs none.
#[test]
fn damage_costs_the_row_that_it_hits() {
    let plan = plan(&["/a=0:1:5"], Seeding::Up);
    let broken_off = tempfile::tempdir().unwrap();
    sweep(broken_off.path(), Begin::New, &plan, 1, 4);
    let text = fs::read_to_string(broken_off.path().join("sweep.journal")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let (twice, other) = (format!("{text}{}\n", lines[1]), text.replacen("\n1 ", "\n4 ", 1));
    for (damaged, count, bad) in [(text.replacen("done", "dome", 1), 3, 1), (other, 3, 1), (twice, 4, 0)] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("sweep.journal"), &damaged).unwrap();
        let journal = open(folder.path(), Begin::Resume, &plan).unwrap().unwrap();
        assert_eq!((journal.records().count(), journal.records().damaged()), (count, bad));
        drop(journal);
        // The rows behind it stay: only what is missing is computed.
        let computed = AtomicUsize::new(0);
        let work = |cell: &RowWork, seed: Option<&f64>| {
            computed.fetch_add(1, Ordering::Relaxed);
            bistable(cell, seed)
        };
        sweep_with(folder.path(), Begin::Resume, &plan, 1, usize::MAX, work);
        assert_eq!(computed.into_inner(), 5 - count);
        assert_eq!(bytes(folder.path()), undisturbed(&plan));
    }
    // Without its header nothing can be told of the rows.
    let folder = tempfile::tempdir().unwrap();
    let damaged = text.replacen("bistable", "bistabla", 1);
    fs::write(folder.path().join("sweep.journal"), &damaged).unwrap();
    let error = open(folder.path(), Begin::Resume, &plan).unwrap_err();
    assert!(matches!(error, SweepError::Damaged { .. }), "{error}");
    assert_eq!(fs::read_to_string(folder.path().join("sweep.journal")).unwrap(), damaged, "nothing was changed");
}

#[test]
fn a_failed_point_is_a_row_and_the_next_starts_fresh() {
    let plan = plan(&["/a=0:4:5"], Seeding::Up);
    let folder = tempfile::tempdir().unwrap();
    let work = |cell: &RowWork, seed: Option<&f64>| match cell.row {
        1 => Err("no orbit, \"alas\"".to_owned()),
        // JSON has no infinity.
        3 => Ok(((f64::INFINITY, true), 0.0)),
        _ => Ok(((seed.map_or(0.0, |seed| seed + 1.0), seed.is_some()), cell.values[0])),
    };
    let tally = sweep_with(folder.path(), Begin::New, &plan, 1, usize::MAX, work);
    assert_eq!(tally, Some(Tally { rows: 5, failed: 2 }));
    let text = fs::read_to_string(folder.path().join("sweep.csv")).unwrap();
    let lines: Vec<&str> = text.lines().skip(1).collect();
    assert_eq!(lines[..3], ["0.0,up,false,0,", "1.0,up,,,\"no orbit, \"\"alas\"\"\"", "2.0,up,false,0,"]);
    assert!(lines[3].starts_with("3.0,up,,,\"a result with a number that is not finite"), "{}", lines[3]);
    assert_eq!(lines[4], "4.0,up,false,0,");
    assert_eq!(rows(folder.path())[1]["error"], "no orbit, \"alas\"");
    assert_eq!(rows(folder.path())[1]["result"], Value::Null);
}

#[test]
fn a_point_given_up_is_not_a_failed_one() {
    let plan = plan(&["/a=0:1:6"], Seeding::Up);
    let folder = tempfile::tempdir().unwrap();
    let mut journal = open(folder.path(), Begin::New, &plan).unwrap().unwrap();
    let interrupted = AtomicBool::new(false);
    let point = |cell: &RowWork, seed: Option<&f64>| {
        if cell.row == 3 {
            interrupted.store(true, Ordering::Relaxed);
            return Err("interrupted".to_owned());
        }
        bistable(cell, seed)
    };
    let told = AtomicUsize::new(0);
    let progress = |_| {
        told.fetch_add(1, Ordering::Relaxed);
    };
    assert_eq!(run(&plan, &mut journal, point, Task::new(&interrupted, &progress)).unwrap(), Ending::Interrupted);
    drop(journal);
    assert_eq!(told.into_inner(), 3);
    sweep(folder.path(), Begin::Resume, &plan, 1, usize::MAX).unwrap();
    assert_eq!(bytes(folder.path()), undisturbed(&plan));
}
