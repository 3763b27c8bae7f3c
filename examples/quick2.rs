//! quick
use flank::{
    analysis::*,
    engine::*,
    hybrid::*,
    integrate::*,
    train::{planetary::presets, *},
};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let rpm: f64 = a[1].parse().unwrap();
    let load: f64 = a[2].parse().unwrap();
    let full = a.get(3).is_some_and(|s| s == "full");
    let p = presets::reference_light(rpm, load).unwrap();
    let spec = p.assemble(if full { &Freedoms::Full } else { &Freedoms::InPhase }).unwrap();
    let s = Structure::new(spec).unwrap();
    let n = s.freedoms();
    let at = s.clock().instant(0.0);
    let st = s.start(at, &vec![0.0; n], &vec![0.0; n]).unwrap();
    let discard = if rpm <= 100.0 { 5 } else { 80 };
    let cycles = 20;
    struct G<'a>(&'a Structure);
    impl Observer for G<'_> {
        fn event(&mut self, r: &flank::event::EventRecord) -> std::ops::ControlFlow<()> {
            let t = self.0.clock().time(r.at).value();
            if std::env::var("GZ").is_ok() {
                println!(
                    "{} t={t:.17e} fired={:?} from={} to={} jumps={} cond={:?}",
                    if r.graze { "GRAZE" } else { "event" },
                    r.fired.iter().map(|g| g.0).collect::<Vec<_>>(),
                    r.from.0,
                    r.to.0,
                    r.jumps,
                    r.conditioning
                );
            }
            std::ops::ControlFlow::Continue(())
        }
    }
    let mut contacts = Contacts::new(&s, Some(s.clock().at(discard, 0.0)));
    let t0 = std::time::Instant::now();
    let mut e = Engine::new(&s, Box::new(Taylor::default()), Options::default(), State { at, x: st.x, jump: st.jump });
    let o = e.run(s.clock().at(discard + cycles, 0.0), &mut (&mut contacts, G(&s)));
    println!("{o:?} {:?} {:?}", e.counters(), t0.elapsed());
    for j in 0..s.contacts().len() {
        println!("{} {}", s.contacts()[j].spec.name, serde_json::to_string(&contacts.report(j)).unwrap());
    }
}
