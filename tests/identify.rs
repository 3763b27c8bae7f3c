#![allow(clippy::unwrap_used)]
use flank::{
    scene::Scene,
    study::identify::{Identification, identify},
};

fn stage(preset: &str, torque: f64) -> Scene {
    let text = format!(
        r#"{{ "flank": 1, "train": {{ "kind": "planetary", "preset": "{preset}", "load": {{ "output_torque_nm": {torque:?} }} }}, "run": {{ "t_end_s": 1 }} }}"#
    );
    Scene::from_json(&text, preset).unwrap()
}
fn ask(scene: &Scene, vary: &[&str], targets: &[&str]) -> Identification {
    let p: Vec<_> = vary.iter().map(|t| t.parse().unwrap()).collect();
    let t: Vec<_> = targets.iter().map(|t| t.parse().unwrap()).collect();
    identify(scene, &p, &t).unwrap_or_else(|e| panic!("{e}"))
}
const KP: &str = "/train/planet/translation/stiffness_n_per_m";
fn show(f: &Identification) {
    for p in &f.parameters {
        println!("{} own {:e} found {:e} se {:?} {:?}", p.pointers[0], p.own, p.found, p.standard_error, p.at_bound);
    }
    for t in &f.targets {
        println!("{} {} got {} r {:?}", t.quantity, t.wanted, t.got, t.matched);
    }
    println!("chi2 {} conv {} sol {} poorer {}", f.chi_square, f.converged, f.solutions.len(), f.poorer);
    println!("{}\n sv {:?}", f.uniqueness, f.uniqueness.singular_values);
    for s in &f.solutions {
        println!("{:?} {}", s.values, s.chi_square);
    }
}
#[test]
fn explore() {
    let heavy = stage("reference-heavy", 500.0);
    let t = std::time::Instant::now();
    show(&ask(&heavy, &[&format!("{KP}=1e7:1e9")], &["translational:2=889"]));
    println!("{:?}", t.elapsed());
    show(&ask(&heavy, &["/train/ring/translation/stiffness_n_per_m=1e8:1e10"], &["translational:3=1791"]));
    show(&ask(
        &heavy,
        &["/train/sun/rotation/stiffness_n_per_m=1e6:1e9", "/train/carrier/rotation/stiffness_n_per_m=1e7:1e11"],
        &["rotational:3=1046", "force:sun-planet 1=774"],
    ));
    println!("{:?}", t.elapsed());
    show(&ask(
        &heavy,
        &[
            "/train/sun/rotation/stiffness_n_per_m=1e6:1e9",
            "/train/carrier/rotation/stiffness_n_per_m=1e7:1e11",
            "/train/carrier/rotary_mass_kg=1:100",
        ],
        &["rotational:3=1046", "force:sun-planet 1=774"],
    ));
    println!("{:?}", t.elapsed());
    let exact = stage("exact-frequencies", 500.0);
    show(&ask(
        &exact,
        &[
            "/train/sun_mesh/stiffness,/train/ring_mesh/stiffness=1e8:1e9",
            &format!("{KP}=1e7:1e9"),
            "/train/ring/translation/stiffness_n_per_m=1e8:1e10",
        ],
        &["translational:1=412", "translational:2=889", "translational:3=1791"],
    ));
    println!("{:?}", t.elapsed());
    show(&ask(
        &exact,
        &["/train/sun/rotation/stiffness_n_per_m=1e6:1e9", "/train/ring/rotation/stiffness_n_per_m=1e7:1e11"],
        &["rotational:2=919", "rotational:3=1046"],
    ));
    println!("{:?}", t.elapsed());
    show(&ask(
        &heavy,
        &[
            "/train/sun_mesh/stiffness=1e8:1e9",
            "/train/ring_mesh/stiffness=1e8:1e9",
            &format!("{KP}=1e7:1e9"),
            "/train/sun/translation/stiffness_n_per_m=1e4:1e9",
            "/train/ring/translation/stiffness_n_per_m=1e8:1e10",
            "/train/sun/rotation/stiffness_n_per_m=1e6:1e9",
            "/train/ring/rotation/stiffness_n_per_m=1e7:1e11",
            "/train/carrier/rotation/stiffness_n_per_m=1e7:1e11",
            "/train/carrier/rotary_mass_kg=1:100",
        ],
        &[
            "translational:1=412",
            "translational:2=889",
            "translational:3=1791",
            "rotational:2=919",
            "rotational:3=1046",
            "force:sun-planet 1=774",
        ],
    ));
    println!("{:?}", t.elapsed());
}
#[test]
fn timing() {
    let heavy = stage("reference-heavy", 500.0);
    let n = 300;
    let t = std::time::Instant::now();
    for i in 0..n {
        std::hint::black_box(heavy.with(KP, (1e8 + i as f64).into()).unwrap());
    }
    println!("with {:?}", t.elapsed() / n);
    let t = std::time::Instant::now();
    for _ in 0..n {
        std::hint::black_box(heavy.build().unwrap());
    }
    println!("build {:?}", t.elapsed() / n);
    let spec = heavy.build().unwrap().spec;
    let t = std::time::Instant::now();
    for _ in 0..n {
        std::hint::black_box(flank::train::equilibrium(&spec).unwrap());
    }
    println!("eq {:?}", t.elapsed() / n);
    let t = std::time::Instant::now();
    for _ in 0..n {
        std::hint::black_box(
            flank::train::planetary::families(&spec, &flank::train::bonded_stiffness(&spec, None)).unwrap(),
        );
    }
    println!("fam {:?}", t.elapsed() / n);
}
#[test]
fn six() {
    let heavy = stage("reference-heavy", 500.0);
    let t = std::time::Instant::now();
    show(&ask(
        &heavy,
        &[
            &format!("{KP}=1e7:1e9"),
            "/train/sun/translation/stiffness_n_per_m=1e4:1e9",
            "/train/ring/translation/stiffness_n_per_m=1e8:1e10",
            "/train/sun/rotation/stiffness_n_per_m=1e6:1e9",
            "/train/carrier/rotation/stiffness_n_per_m=1e7:1e11",
            "/train/carrier/rotary_mass_kg=1:100",
        ],
        &[
            "translational:1=412",
            "translational:2=889",
            "translational:3=1791",
            "rotational:2=919",
            "rotational:3=1046",
            "force:sun-planet 1=774",
        ],
    ));
    println!("{:?}", t.elapsed());
}
