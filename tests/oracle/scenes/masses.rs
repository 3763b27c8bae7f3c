//! Classes A, J and V: one mass on walls, chains of masses, ill-conditioned mass matrices.

use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

use super::{
    laws::{EXPONENTS, by_speed, power, restitution, rigid, soft},
    random::{Random, round, scene},
};

/// Rest and release, one or two freedoms, loads of several cosines.
pub fn rest_and_release(r: &mut Random) -> Value {
    if r.chance(0.6) { wall(r) } else { chain(r, 2, &mut |r| rigid(restitution(r))) }
}

/// Walls, chains and stages whose rigid contacts return by their speed.
pub fn restitution_by_speed(r: &mut Random) -> Value {
    let mut scene = match r.below(3) {
        0 => super::stages::rigid_stages(r),
        _ => rest_and_release(r),
    };
    replace(&mut scene, r);
    scene
}

fn replace(value: &mut Value, r: &mut Random) {
    match value {
        Value::Object(object) => {
            for (key, item) in object.iter_mut() {
                if key == "restitution" && item.is_number() {
                    *item = by_speed(r);
                } else {
                    replace(item, r);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| replace(item, r)),
        _ => {}
    }
}

fn harmonics(r: &mut Random, most: usize) -> (Vec<Value>, f64) {
    let (base, count) = (r.pick(&[0.5, 1.0]), 1 + r.below(most));
    let mut sum = 0.0;
    let mut orders = vec![];
    let list = (0..count)
        .map(|i| {
            let amplitude = r.of(0.2, 1.0);
            sum += amplitude;
            let order = if i == 0 { 1 } else { 2 + r.below(9) };
            orders.push(order);
            json!({ "amplitude_n": amplitude, "frequency_rad_per_s": base * order as f64, "phase_rad": r.phase() })
        })
        .collect();
    (list, sum)
}

fn wall(r: &mut Random) -> Value {
    let (list, sum) = harmonics(r, 4);
    let side = r.pick(&["above", "below", "both"]);
    let press = if side == "below" { -1.0 } else { 1.0 };
    let wall = match side {
        "both" => json!({ "side": side, "half_gap_m": 0.5 }),
        _ => json!({ "side": side, "position_m": 0.0 }),
    };
    let mut train = json!({
        "kind": "wall", "mass_kg": r.of(0.5, 3.0), "load_n": round(press * sum * r.of(0.1, 1.1)),
        "load_harmonics": list, "wall": wall, "law": rigid(restitution(r)),
    });
    if r.chance(0.3) {
        train["stiffness_n_per_m"] = json!(r.of(0.2, 4.0));
    }
    if r.chance(0.4) {
        train["damping_n_s_per_m"] = json!(r.of(0.05, 0.5));
    }
    let touching = if side == "both" { 0.5 } else { 0.0 };
    let initial = match r.below(3) {
        0 => json!({ "q": [touching], "v": [0.0] }),
        1 => json!({ "q": [round(touching - press * r.of(0.01, 0.8))], "v": [r.of(-0.5, 0.5)] }),
        _ => json!({ "q": [touching], "v": [round(-press * r.of(0.05, 1.0))] }),
    };
    scene(train, initial, 50.0)
}

/// A chain of masses between springs, each with a stop, or with contacts between neighbours.
fn chain(r: &mut Random, n: usize, law: &mut dyn FnMut(&mut Random) -> Value) -> Value {
    let links: Vec<f64> = (0..=n).map(|_| r.of(0.3, 4.0)).collect();
    let (a, b) = (r.of(0.0, 0.1), r.of(0.0, 0.05));
    let matrix = |diagonal: &dyn Fn(usize) -> f64, link: f64| -> Vec<Vec<f64>> {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => round(diagonal(i)),
            1 => round(-link * links[i.max(j)]),
            _ => 0.0,
        };
        (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
    };
    let masses: Vec<f64> = (0..n).map(|_| r.of(0.5, 2.0)).collect();
    let stiffness = matrix(&|i| links[i] + links[i + 1], 1.0);
    let damping = matrix(&|i| a * masses[i] + b * (links[i] + links[i + 1]), b);
    let base = r.pick(&[0.5, 1.0]);
    let loads: Vec<Value> = (0..1 + r.below(3))
        .map(|_| {
            let at = r.below(n);
            let vector: Vec<f64> = (0..n).map(|i| if i == at { r.of(0.3, 1.5) } else { 0.0 }).collect();
            let order = (1 + r.below(8)) as f64;
            json!({ "vector_n": vector, "frequency_rad_per_s": base * order, "phase_rad": r.phase() })
        })
        .collect();
    let gaps: Vec<f64> = (0..n).map(|_| r.of(0.05, 0.6)).collect();
    let contacts: Vec<Value> = (0..n)
        .map(|i| {
            let between = i > 0 && r.chance(0.3);
            let direction: Vec<f64> = (0..n)
                .map(|j| {
                    if j == i {
                        1.0
                    } else if between && j + 1 == i {
                        -1.0
                    } else {
                        0.0
                    }
                })
                .collect();
            let law = law(r);
            let flanks = if r.chance(0.3) { "both" } else { "drive" };
            let mut contact = json!({
                "name": format!("stop {}", i + 1), "direction": direction, "half_backlash_m": gaps[i],
                "flanks": flanks, "law": law,
            });
            if contact["law"]["kind"] != "rigid" {
                contact["stiffness"] = json!(r.log(50.0, 1000.0));
            }
            contact
        })
        .collect();
    let train = json!({
        "kind": "matrices", "mass_kg": masses, "stiffness_n_per_m": stiffness, "damping_n_s_per_m": damping,
        "load_n": (0..n).map(|_| r.of(-0.3, 2.0)).collect::<Vec<_>>(), "load_harmonics": loads, "contacts": contacts,
    });
    let v: Vec<f64> = (0..n).map(|_| r.of(-0.8, 0.8)).collect();
    let initial = if r.chance(0.5) { json!("rest") } else { json!({ "q": vec![0.0; n], "v": v }) };
    scene(train, initial, 40.0)
}

/// Mixed laws: rest beside impacts, accumulation beside a power law.
pub fn mixed(r: &mut Random) -> Value {
    let n = 2 + r.below(2);
    let mut count = r.below(3);
    chain(r, n, &mut |r| {
        count += 1;
        match count % 4 {
            0 => rigid(0.0),
            1 => rigid(r.of(0.2, 0.8)),
            2 => power(r, &EXPONENTS[..6]),
            _ => soft(r, 2.0),
        }
    })
}

/// Power laws on a wall.
pub fn power_wall(r: &mut Random) -> Value {
    let (list, sum) = harmonics(r, 2);
    let train = json!({
        "kind": "wall", "mass_kg": r.of(0.5, 2.0), "load_n": round(sum * r.of(0.1, 1.2)), "load_harmonics": list,
        "stiffness_n_per_m": r.of(0.0, 2.0), "damping_n_s_per_m": r.of(0.0, 0.2),
        "wall": { "side": "above", "position_m": 0.0 }, "law": power(r, &EXPONENTS), "contact_stiffness": r.log(30.0, 3000.0),
    });
    let initial = json!({ "q": [-r.of(0.01, 0.8)], "v": [r.of(-0.4, 0.4)] });
    scene(train, initial, 40.0)
}

/// A mass matrix of condition 1e2 to 1e10, `M = Qᵀ Λ Q`, with springs, dampers and loads in proportion to it: the motion is of order one in
/// every direction.
pub fn ill_conditioned(r: &mut Random) -> Value {
    let n = 2 + r.below(3);
    let lightest = 1.0 / r.log(1e2, 1e10);
    let mut q = DMatrix::<f64>::identity(n, n);
    for i in 0..n {
        for j in 0..i {
            let (sine, cosine) = r.of(0.0, std::f64::consts::TAU).sin_cos();
            let mut turn = DMatrix::identity(n, n);
            (turn[(i, i)], turn[(j, j)], turn[(i, j)], turn[(j, i)]) = (cosine, cosine, sine, -sine);
            q *= turn;
        }
    }
    let masses: Vec<f64> = (0..n)
        .map(|i| match i {
            0 => 1.0,
            1 => lightest,
            _ => r.log(lightest, 1.0),
        })
        .collect();
    let mass = q.transpose() * DMatrix::from_diagonal(&DVector::from_column_slice(&masses)) * &q;
    let mass = DMatrix::from_fn(n, n, |i, j| mass[(i.min(j), i.max(j))]);
    let rows = |by: f64| -> Vec<Vec<f64>> { mass.row_iter().map(|row| row.iter().map(|m| by * m).collect()).collect() };
    let push = |a: &[f64]| -> Vec<f64> { (&mass * DVector::from_column_slice(a)).iter().copied().collect() };
    let base = r.pick(&[0.5, 1.0]);
    let constant: Vec<f64> = (0..n).map(|_| r.of(-0.3, 1.5)).collect();
    let loads: Vec<Value> = (0..1 + r.below(2))
        .map(|_| {
            let a: Vec<f64> = (0..n).map(|_| r.of(0.2, 1.5)).collect();
            let order = (1 + r.below(5)) as f64;
            json!({ "vector_n": push(&a), "frequency_rad_per_s": base * order, "phase_rad": r.phase() })
        })
        .collect();
    let contacts: Vec<Value> = (0..1 + r.below(n))
        .map(|i| {
            let direction: Vec<f64> = (0..n).map(|_| r.of(-1.0, 1.0)).collect();
            let g = q.clone() * DVector::from_column_slice(&direction);
            let felt = g.iter().zip(&masses).map(|(g, m)| g * g / m).sum::<f64>().recip();
            let is_rigid = r.chance(0.6);
            let law = if is_rigid { rigid(restitution(r)) } else { json!({ "kind": "kelvin-voigt", "release": "deflection" }) };
            let mut contact = json!({
                "name": format!("stop {}", i + 1), "direction": direction, "half_backlash_m": r.of(0.05, 0.6), "flanks": "drive",
                "law": law,
            });
            if !is_rigid {
                contact["stiffness"] = json!(felt * r.log(20.0, 500.0));
            }
            contact
        })
        .collect();
    let (stiffness, damping) = (r.of(0.3, 3.0), r.of(0.02, 0.2));
    let train = json!({
        "kind": "matrices", "mass_kg": rows(1.0), "stiffness_n_per_m": rows(stiffness), "damping_n_s_per_m": rows(damping),
        "load_n": push(&constant), "load_harmonics": loads, "contacts": contacts,
    });
    scene(train, json!("rest"), 30.0)
}
