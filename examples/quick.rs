use flank::{
    engine::*,
    event::*,
    gear::{contact::*, *},
    hybrid::*,
    integrate::*,
    train::*,
};
use nalgebra::DMatrix;
use serde_json::{Value, json};
use std::ops::ControlFlow;
fn vecf(v: &Value) -> Vec<f64> {
    v.as_array().map(|a| a.iter().map(|x| x.as_f64().unwrap()).collect()).unwrap_or_default()
}
fn mat(v: &Value, n: usize) -> DMatrix<f64> {
    if v.is_null() {
        return DMatrix::zeros(n, n);
    }
    let a = v.as_array().unwrap();
    if a[0].is_array() {
        DMatrix::from_fn(n, n, |i, j| a[i][j].as_f64().unwrap())
    } else {
        DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vecf(v)))
    }
}
struct Log<'a> {
    s: &'a Structure,
    rows: Vec<Value>,
    rigid: bool,
}
impl Observer for Log<'_> {
    fn event(&mut self, r: &EventRecord) -> ControlFlow<()> {
        if r.graze || r.start {
            return ControlFlow::Continue(());
        }
        let t = self.s.clock().time(r.at);
        let ts = format!("{:.17e}", t.hi);
        let _ = ts;
        let tstr = dd(t);
        for j in 0..self.s.contacts().len() {
            let (a, b) = (contact_mode(r.from, j), contact_mode(r.to, j));
            let fired = r.fired.iter().any(|g| guard_of(g).0 == j);
            if !fired {
                continue;
            }
            let mut push = |kind: &str| {
                self.rows.push(json!({"t":tstr,"kind":kind,"mesh":j,"velocity":self.s.deflection(j,r.at,&r.x_minus).1}))
            };
            if self.rigid {
                if r.accumulation.is_some() {
                    push("stick")
                } else if a.is_closed() && !b.is_closed() {
                    push("release")
                } else if b.is_closed() {
                    push("impact");
                    push("stick")
                } else {
                    push("impact")
                }
            } else if a.is_closed() != b.is_closed() {
                push(if b == ContactMode::Drive {
                    "drive_contact"
                } else if b == ContactMode::Back {
                    "back_contact"
                } else {
                    "separation"
                })
            }
        }
        ControlFlow::Continue(())
    }
}
fn dd(t: Wide) -> String {
    // decimal with 30 digits via integer arithmetic
    // split hi into integer+fraction
    let neg = t.hi < 0.0;
    let (mut h, mut l) = (t.hi.abs(), if neg { -t.lo } else { t.lo });
    let ip = h.floor();
    h -= ip;
    let mut s = format!("{}{}.", if neg { "-" } else { "" }, ip as i64);
    let f = Wide::sum(h, l);
    h = f.hi;
    l = f.lo;
    if h < 0.0 {
        return format!("{:.20}", t.hi);
    }
    for _ in 0..24 {
        let w = Wide { hi: h, lo: l } * 10.0;
        let mut d = w.hi.floor();
        let mut r = w - Wide::from(d);
        if r.hi < 0.0 {
            d -= 1.0;
            r = w - Wide::from(d);
        }
        s.push_str(&format!("{}", d as i64));
        h = r.hi;
        l = r.lo;
    }
    s
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let c: Value = serde_json::from_str(&std::fs::read_to_string(&a[1]).unwrap()).unwrap();
    let p = &c["parameters"];
    let hz = p.get("K").is_some_and(|k| k.is_number());
    let harm = |v: &Value, scale: f64| -> Vec<Harmonic> {
        v.as_array()
            .map(|a| {
                a.iter()
                    .map(|h| Harmonic {
                        amplitude: scale * h[0].as_f64().unwrap(),
                        omega: h[1].as_f64().unwrap(),
                        phase: h[2].as_f64().unwrap(),
                    })
                    .collect()
            })
            .unwrap_or_default()
    };
    let mut rigid = false;
    let spec = if hz {
        let m = p["m"].as_f64().unwrap();
        Spec {
            freedoms: vec!["x".into()],
            mass: DMatrix::from_element(1, 1, m),
            damping: DMatrix::from_element(1, 1, p["c"].as_f64().unwrap()),
            stiffness: DMatrix::zeros(1, 1),
            load: vec![p["F0"].as_f64().unwrap()],
            load_harmonics: p["harm"]
                .as_array()
                .unwrap()
                .iter()
                .map(|h| LoadHarmonic {
                    vector: vec![h[0].as_f64().unwrap()],
                    omega: h[1].as_f64().unwrap(),
                    phase: h[2].as_f64().unwrap(),
                })
                .collect(),
            contacts: vec![ContactSpec {
                name: "m".into(),
                direction: vec![1.0],
                error: vec![],
                error_offset: 0.0,
                half_backlash: p["b"].as_f64().unwrap(),
                flanks: Flanks::Both,
                stiffness: Stiffness::Constant(p["K"].as_f64().unwrap()),
                law: Law::Power(PowerLaw {
                    exponent: Ratio { p: 3, q: 2 },
                    hysteresis: p["mu"].as_f64().unwrap(),
                    speed_floor: 1e-12,
                    initial_speed: 1e-2,
                }),
            }],
            omega: None,
        }
    } else {
        let n = vecf(&p["M"]).len();
        let contacts = if let Some(ms) = p.get("meshes") {
            ms.as_array()
                .unwrap()
                .iter()
                .map(|m| {
                    let k0 = m["k0"].as_f64().unwrap();
                    let l = Linear { damping: m["c"].as_f64().unwrap_or(0.0) };
                    let st = if let Some(r) = m.get("rect") {
                        let e = r["eps"].as_f64().unwrap();
                        if let Some(ts) = r.get("times") {
                            let sg = r["sign0"].as_f64().unwrap();
                            Stiffness::Switched { times: vecf(ts), levels: [k0 * (1.0 + sg * e), k0 * (1.0 - sg * e)] }
                        } else {
                            Stiffness::rectangular(
                                k0 * (1.0 + e),
                                k0 * (1.0 - e),
                                r["T"].as_f64().unwrap(),
                                r["duty"].as_f64().unwrap(),
                                r["t0"].as_f64().unwrap(),
                            )
                        }
                    } else if m.get("harm").is_some_and(|h| !h.as_array().unwrap().is_empty()) {
                        Stiffness::Harmonic { mean: k0, harmonics: harm(&m["harm"], 1.0) }
                    } else {
                        Stiffness::Constant(k0)
                    };
                    ContactSpec {
                        name: "m".into(),
                        direction: vecf(&m["G"]),
                        error: harm(&m["err"], -1.0),
                        error_offset: 0.0,
                        half_backlash: m["b"].as_f64().unwrap(),
                        flanks: Flanks::Both,
                        stiffness: st,
                        law: Law::KelvinVoigt(
                            l,
                            if m["law"] == json!("force") { Release::Force } else { Release::Deflection },
                        ),
                    }
                })
                .collect()
        } else {
            rigid = true;
            p["contacts"]
                .as_array()
                .unwrap()
                .iter()
                .map(|m| ContactSpec {
                    name: "w".into(),
                    direction: vecf(&m["G"]).iter().map(|g| -g).collect(),
                    error: harm(&m["err"], 1.0),
                    error_offset: 0.0,
                    half_backlash: m["off"].as_f64().unwrap(),
                    flanks: Flanks::Drive,
                    stiffness: Stiffness::Constant(0.0),
                    law: Law::Rigid(Rigid { restitution: m["e"].as_f64().unwrap() }),
                })
                .collect()
        };
        Spec {
            freedoms: (0..n).map(|i| format!("q{i}")).collect(),
            mass: mat(&p["M"], n),
            damping: mat(&p["C"], n),
            stiffness: mat(&p["K"], n),
            load: vecf(&p["F0"]),
            load_harmonics: p["harm"]
                .as_array()
                .unwrap()
                .iter()
                .map(|h| LoadHarmonic {
                    vector: vecf(&h[0]),
                    omega: h[1].as_f64().unwrap(),
                    phase: h[2].as_f64().unwrap(),
                })
                .collect(),
            contacts,
            omega: None,
        }
    };
    let s = Structure::new(spec).unwrap();
    let at = s.clock().instant(c["initial_state"]["t"].as_f64().unwrap_or(0.0));
    let st = s.start(at, &vecf(&c["initial_state"]["q"]), &vecf(&c["initial_state"]["v"])).unwrap();
    let mut log = Log { s: &s, rows: vec![], rigid };
    let t0 = std::time::Instant::now();
    let mut e = Engine::new(&s, Box::new(Taylor::default()), Options::default(), State { at, x: st.x, jump: st.jump });
    let end = s.clock().instant(c["t_end"].as_f64().unwrap_or_else(|| c["t_end"].as_str().unwrap().parse().unwrap()));
    let o = if a.len() > 3 { e.run(end, &mut ()) } else { e.run(end, &mut log) };
    let el = t0.elapsed();
    if a.len() > 3 {
        eprintln!("{:?} {:?} {:?}", o, e.counters(), el);
    } else if o.is_err() {
        eprintln!("{o:?}");
    }
    let n = s.freedoms();
    let x = &e.state().x;
    std::fs::write(
        &a[2],
        serde_json::to_string(&json!({"events":log.rows,"final_state":{"q":x[..n],"v":x[n..2*n]}})).unwrap(),
    )
    .unwrap();
}
