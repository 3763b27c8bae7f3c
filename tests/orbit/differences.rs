//! The derivative of whole cycles against extrapolated differences of runs.

use flank::{
    Simulation,
    orbit::{Section, SectionMap},
};

/// `∂P/∂x_i` by central differences of six points, exact to the sixth order of the step.
fn difference(map: &SectionMap<'_>, start: &Section, cycles: u64, i: usize, step: f64) -> Option<Vec<f64>> {
    let image = |steps: f64| {
        let mut x = start.x.clone();
        x[i] += steps * step;
        map.follow(&Section { x, contacts: start.contacts.clone() }, cycles).ok().map(|end| end.x)
    };
    let mut sum = vec![0.0; start.x.len()];
    for (steps, weight) in [(1.0, 0.75), (2.0, -0.15), (3.0, 1.0 / 60.0)] {
        let (plus, minus) = (image(steps)?, image(-steps)?);
        for ((s, p), m) in sum.iter_mut().zip(&plus).zip(&minus) {
            *s += weight * (p - m) / step;
        }
    }
    Some(sum)
}

/// The largest difference of the derivative of `cycles` cycles after `before` ones to extrapolated differences of runs, relative to the
/// largest entry of its row, in the units of the state.
pub fn disagreement(simulation: &Simulation, before: u64, cycles: u64) -> (f64, String) {
    let map = SectionMap::new(simulation).unwrap();
    let mut start = map.start().unwrap();
    if before > 0 {
        start = map.follow(&start, before).unwrap();
    }
    let image = map.image(&start, cycles).unwrap();
    let n = simulation.structure.freedoms();
    let q = image.sizes[..n].iter().fold(0.0, |m: f64, s| m.max(*s));
    let v = image.sizes[n..2 * n].iter().fold(0.0, |m: f64, s| m.max(*s));
    let scale = |i: usize| if i < n { q } else if i < 2 * n { v } else { image.sizes[i] };
    let dim = start.x.len();
    let mut worst = 0.0f64;
    let largest = (0..dim)
        .flat_map(|r| (0..dim).map(move |c| (r, c)))
        .map(|(r, c)| (image.jacobian[(r, c)] * scale(c) / scale(r)).abs())
        .fold(0.0, f64::max);
    for i in 0..dim {
        // Of several steps that one whose differences are best, as words may change.
        let best = [1e-3, 2e-4, 3e-5, 4e-6, 5e-7]
            .iter()
            .filter_map(|step| difference(&map, &start, cycles, i, step * scale(i)))
            .map(|column| {
                (0..dim)
                    .map(|r| (column[r] - image.jacobian[(r, i)]).abs() * scale(i) / scale(r) / largest)
                    .fold(0.0, f64::max)
            })
            .fold(f64::INFINITY, f64::min);
        worst = worst.max(best);
    }
    (worst, image.word.join(" "))
}

#[test]
fn the_derivative_is_that_of_the_motion_on_every_example() {
    let mut failed = Vec::new();
    for (scene, before, cycles) in [
        ("W1a-ss", 5, 2),
        ("W1a-ds", 5, 2),
        ("W1b-ds", 5, 2),
        ("W1c-ds", 5, 2),
        ("W2a", 2, 1),
        ("W2b", 2, 1),
        ("W3", 1, 1),
        ("W3-sym", 1, 1),
        ("W4", 1, 1),
        ("W5a", 2, 1),
        ("W5b-p", 5, 2),
        ("kahraman-singh", 5, 2),
        ("spur-pair", 2, 1),
        ("reference-heavy", 1, 1),
        ("reference-light", 1, 1),
    ] {
        let simulation = Simulation::from_file(format!("examples/scenes/{scene}.json")).unwrap();
        let watch = std::time::Instant::now();
        if simulation.period().is_err() { println!("{scene}: no period"); continue; }
        let (worst, word) = disagreement(&simulation, before, cycles);
        println!("{scene:18} {worst:9.1e} {:6.2} s  {}", watch.elapsed().as_secs_f64(), &word[..word.len().min(70)]);
        if worst > 1e-8 {
            failed.push(scene);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}
