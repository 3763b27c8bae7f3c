//! Flank's derivative of whole cycles against extrapolated differences of the oracle: with the start, and with numbers of the train.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of tests are not recognised as tests

use std::collections::{BTreeMap, BTreeSet};

use flank::{
    Simulation,
    orbit::{Image, SectionMap},
    scene::Scene,
    simulation::Parameter,
    system::Spec,
};
use serde_json::Value;

use super::{
    model::{Model, Tweak},
    scenes::derivatives::{DRIVES, laws, scene},
    sequence::{Event, Kind, follow},
    state::State,
    wide::{Wide, near, size, turn, wide},
};

/// Step of differences, relative to the size of what is moved. A difference is off by 1e-18 of the third derivative, and their
/// extrapolation by the square of that; 32 digits lose nine to the step.
const STEP: f64 = 1e-9;
/// Largest distance of the two differences that are extrapolated, relative to the derivative.
const RESOLVED: f64 = 1e-10;
/// Size in the scales of the motion that smaller derivatives are compared with.
const LEAST: f64 = 1e-2;
/// Largest error with the start: the states of the runs are off by some 1e-16 of their size, and the derivative of the most unstable of
/// these motions (many impacts in turn) changes by 2e4 times that.
const BY_START: f64 = 1e-11;
/// Largest error with a number: differences of trains are exact to 1e-11 of the rates, and the motion amplifies that a little.
const BY_NUMBER: f64 = 2e-11;
/// Kinds of events that are crossed, columns, pairs of a scene and a number, and kinds of numbers.
const EVENTS: &str = "acilrsxz";
const COLUMNS: usize = 570;
const PAIRS: usize = 1986;
const NUMBERS: usize = 29;

/// A motion of both, and its derivative by Flank.
struct Case {
    simulation: Simulation,
    /// The train as it is written, before the dampers of gaps become part of its matrices.
    spec: Spec,
    x: Vec<f64>,
    cycles: u64,
    image: Image,
    /// Sizes of the components along the motion.
    scales: Vec<f64>,
    /// Events of each contact in the oracle's motion.
    events: Vec<Vec<Kind>>,
}

/// Kinds of the events of each contact. Leaves out the impacts of a contact that comes to rest: Flank's word has one token for them.
fn by_contact(count: usize, events: impl Iterator<Item = (usize, Kind)>) -> Vec<Vec<Kind>> {
    let mut of = vec![Vec::new(); count];
    events.for_each(|(j, kind)| of[j].push(kind));
    for kinds in of.iter_mut().filter(|kinds| kinds.contains(&Kind::Stick)) {
        kinds.retain(|kind| *kind != Kind::Impact);
    }
    of
}

/// The contact and the kind of a token such as `c0+`.
fn read(token: &str) -> (usize, Kind) {
    let (letter, rest) = token.split_at(1);
    let (contact, side) = rest.split_at(rest.len() - 1);
    let kind = match (letter, side) {
        ("c" | "a", "+") => Kind::DriveContact,
        ("c" | "a", _) => Kind::BackContact,
        ("s" | "r", _) => Kind::Separation,
        ("x", _) => Kind::Clear,
        ("i", _) => Kind::Impact,
        ("z", _) => Kind::Stick,
        ("l", _) => Kind::Release,
        _ => panic!("{token} is no event"),
    };
    (contact.parse().unwrap(), kind)
}

/// The tokens of a word.
fn tokens(word: &[String]) -> impl Iterator<Item = &str> {
    word.iter().flat_map(|part| part.split([' ', '[', ']'])).filter(|token| !token.is_empty())
}

/// Sizes along a motion: of all displacements, of all velocities, of each latched speed.
fn scales(simulation: &Simulation, image: &Image) -> Vec<f64> {
    let (n, sizes) = (simulation.structure.freedoms(), &image.sizes);
    let largest = |part: &[f64]| part.iter().fold(0.0, |m: f64, s| m.max(*s));
    let of = |i: usize| match i / n {
        0 => largest(&sizes[..n]),
        1 => largest(&sizes[n..2 * n]),
        _ => sizes[i],
    };
    (0..sizes.len()).map(of).collect()
}

impl Case {
    fn new(value: &Value, cycles: u64) -> Result<Self, String> {
        let scene = Scene::from_value(value.clone(), "derivative").map_err(|e| e.to_string())?;
        let spec = scene.built().spec.clone();
        let simulation = Simulation::from_scene(&scene).map_err(|e| e.to_string())?;
        let map = SectionMap::new(&simulation).unwrap();
        let start = map.start().unwrap();
        let image = map.image(&start, cycles).unwrap();
        let scales = scales(&simulation, &image);
        let mut case = Self { x: start.x.clone(), cycles, image, scales, events: Vec::new(), simulation, spec };
        case.events = case.end(Tweak::NONE, &case.start(None))?.1;
        assert_eq!(case.events, by_contact(case.events.len(), tokens(&case.image.word).map(read)));
        Ok(case)
    }

    /// The start with a component moved.
    fn start(&self, moved: Option<(usize, f64)>) -> Vec<Wide> {
        let mut x: Vec<Wide> = self.x.iter().map(|x| wide(*x)).collect();
        if let Some((i, off)) = moved {
            x[i] = x[i] + wide(off);
        }
        x
    }

    /// Runs the oracle from `x` over the cycles: the state in Flank's order, and the events.
    fn end(&self, tweak: Tweak, x: &[Wide]) -> Result<(Vec<Wide>, Vec<Vec<Kind>>), String> {
        let structure = &self.simulation.structure;
        let m = Model::new(&self.spec, tweak);
        // The oracle has one for each contact, and behind them one for each back flank that differs.
        let own = m.contacts.len() - m.back_of.len();
        let place = |(j, side): (usize, f64)| match m.back_of.iter().position(|of| *of == j) {
            Some(back) if side < 0.0 => own + back,
            _ => j,
        };
        let latches = || structure.latched().map(place).zip(2 * m.n..);
        let mut start = State::start(&m, wide(0.0), x[..m.n].to_vec(), x[m.n..2 * m.n].to_vec());
        latches().for_each(|(j, i)| start.latches[j] = x[i]);
        let omega = wide(self.simulation.clock().omega()) * (wide(1.0) + wide(tweak.faster));
        let (end, events) = follow(&m, start, turn() * wide(self.cycles as f64) / omega)?;
        let mut x = [end.q, end.v].concat();
        x.resize(self.x.len(), wide(0.0));
        latches().for_each(|(j, i)| x[i] = end.latches[j]);
        let told = |e: &Event| (e.contact, e.kind);
        Ok((x, by_contact(m.contacts.len(), events.iter().map(told))))
    }

    /// The derivative by extrapolated differences of the oracle; `weights` bring its components to the size of one.
    fn difference(
        &self,
        step: f64,
        weights: &[f64],
        moved: impl Fn(f64) -> (Tweak, Vec<Wide>),
    ) -> Result<Vec<f64>, String> {
        let at = |off: f64| -> Result<Vec<Wide>, String> {
            let (tweak, x) = moved(off);
            let (end, events) = self.end(tweak, &x)?;
            if events == self.events { Ok(end) } else { Err("a neighbour has another word".into()) }
        };
        let central = |step: f64| -> Result<Vec<Wide>, String> {
            let (above, below) = (at(step)?, at(-step)?);
            Ok(above.iter().zip(&below).map(|(a, b)| (*a - *b) / wide(2.0 * step)).collect())
        };
        let (coarse, fine) = (central(step)?, central(0.5 * step)?);
        let change: Vec<Wide> = fine.iter().zip(&coarse).map(|(f, c)| *f - *c).collect();
        let off = change.iter().zip(weights).map(|(c, w)| size(*c) * w).fold(0.0, f64::max);
        if off > RESOLVED {
            return Err(format!("differences are {off:e} apart"));
        }
        Ok(fine.iter().zip(&change).map(|(f, c)| near(*f + *c / wide(3.0))).collect())
    }

    /// Errors of the columns of the start, relative to the largest entry in the scales of the motion.
    fn columns(&self) -> Result<Vec<f64>, String> {
        let (scales, jacobian, dim) = (&self.scales, &self.image.jacobian, self.x.len());
        // The largest of differences passes over what is no number.
        assert!(jacobian.iter().all(|entry| entry.is_finite()));
        let entry = |r: usize, i: usize| (jacobian[(r, i)] * scales[i] / scales[r]).abs();
        let largest = (0..dim * dim).map(|at| entry(at / dim, at % dim)).fold(0.0, f64::max);
        let column = |i: usize| -> Result<f64, String> {
            let weights: Vec<f64> = scales.iter().map(|s| scales[i] / s / largest.max(LEAST)).collect();
            let start = |off: f64| (Tweak::NONE, self.start(Some((i, off))));
            let exact = self.difference(STEP * scales[i], &weights, start)?;
            Ok((0..dim).map(|r| (exact[r] - jacobian[(r, i)]).abs() * weights[r]).fold(0.0, f64::max))
        };
        (0..dim).map(column).collect()
    }

    /// Error of the derivative with a number, relative to its largest entry in the scales of the motion.
    fn by_number(&self, pointers: &[String]) -> Result<f64, String> {
        let pointers: Vec<&str> = pointers.iter().map(String::as_str).collect();
        let parameter = Parameter::new(self.simulation.resolved(), &pointers)?;
        let variation = self.simulation.variation_by(&parameter).map_err(|e| e.to_string())?;
        let map = SectionMap::new(&self.simulation).unwrap();
        let image = map.image_by(&map.start().unwrap(), self.cycles, &[variation]).unwrap();
        let (value, column) = (parameter.value(), image.by_number.column(0));
        assert!(column.iter().all(|entry| entry.is_finite()));
        let largest = column.iter().zip(&self.scales).map(|(c, s)| c.abs() / s).fold(0.0, f64::max);
        let weights: Vec<f64> = self.scales.iter().map(|s| 1.0 / s / largest.max(LEAST / value.abs())).collect();
        let is_frequency = pointers[0].contains("frequency");
        let moved = |off: f64| {
            let tweak = if is_frequency {
                Tweak { faster: off / value, ..Tweak::NONE }
            } else {
                Tweak { moved: [value, off], ..Tweak::NONE }
            };
            (tweak, self.start(None))
        };
        let exact = self.difference(STEP * value.abs(), &weights, moved)?;
        Ok(exact.iter().zip(column.iter()).zip(&weights).map(|((e, c), w)| (e - c).abs() * w).fold(0.0, f64::max))
    }
}

/// Numbers of a train, each with those that move with it: entries of symmetric matrices, and all frequencies.
fn numbers(simulation: &Simulation) -> Vec<Vec<String>> {
    let (mut all, mut clock) = (Vec::new(), Vec::new());
    pointers(&simulation.resolved()["train"], "/train", &mut all);
    let is_clock = |p: &str| p.contains("frequency") || p.contains("period_s");
    clock.extend(all.extract_if(.., |p| is_clock(p)));
    clock.sort_by_key(|p| p.contains("period_s"));
    clock.push("/run/period_s".into());
    let is_symmetric =
        |p: &str| ["/mass_kg", "/damping_n", "/stiffness_n"].iter().any(|m| p.starts_with(&format!("/train{m}")));
    let pair = |p: String| {
        if !is_symmetric(&p) || !p.ends_with("/0/1") {
            return vec![p];
        }
        let other = p.replace("/0/1", "/1/0");
        vec![p, other]
    };
    let is_second = |p: &str| is_symmetric(p) && p.ends_with("/1/0");
    all.into_iter().filter(|p| !is_second(p)).map(pair).chain([clock]).collect()
}

/// All numbers but zeros, and those of a trapezoid, whose slopes the oracle takes from the train.
fn pointers(value: &Value, at: &str, all: &mut Vec<String>) {
    match value {
        Value::Object(object) if object.get("kind").is_some_and(|kind| kind == "trapezoidal") => {
            all.extend(["period_s", "origin_s"].map(|key| format!("{at}/{key}")));
        }
        // Slopes and phases of loads the oracle takes from the train as well.
        Value::Object(object) if object.contains_key("through") => {
            pointers(&object["vector_n"], &format!("{at}/vector_n"), all);
            all.push(format!("{at}/period_s"));
            if object["through"] == "steps" {
                let count = object["points"].as_array().map_or(0, Vec::len);
                all.extend((0..count).map(|i| format!("{at}/points/{i}/1")));
            }
        }
        Value::Object(object) => object.iter().for_each(|(key, value)| pointers(value, &format!("{at}/{key}"), all)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, value)| pointers(value, &format!("{at}/{i}"), all))
        }
        // The speed that is latched at the start belongs to the start.
        Value::Number(_) if at.ends_with("initial_speed_m_per_s") => {}
        Value::Number(number) if number.as_f64() != Some(0.0) => all.push(at.to_owned()),
        _ => {}
    }
}

/// The kind of a number: its pointer without the places in lists.
fn kind_of(pointer: &str) -> String {
    if pointer.contains("frequency") {
        return "frequency".into();
    }
    pointer.split('/').skip(2).filter(|key| key.parse::<usize>().is_err()).collect::<Vec<_>>().join("/")
}

/// Largest errors of kinds of events and numbers, and how many there were.
#[derive(Default)]
struct Table(BTreeMap<String, (f64, usize)>);

impl Table {
    fn add(&mut self, kind: &str, error: f64) {
        let (worst, count) = self.0.entry(kind.to_owned()).or_default();
        *worst = worst.max(error);
        *count += 1;
    }

    /// The kinds. Fails where an error is larger than `allowed`.
    fn kinds(&self, allowed: f64) -> Vec<&str> {
        self.0.iter().for_each(|(kind, (worst, count))| println!("{kind:40} {worst:8.1e} {count:5}"));
        let failed: Vec<_> = self.0.iter().filter(|(_, (worst, _))| worst.is_nan() || *worst > allowed).collect();
        assert!(failed.is_empty(), "{failed:?}");
        self.0.keys().map(String::as_str).collect()
    }
}

/// All laws under each forcing.
fn cases(is_taken: impl Fn(&str, usize) -> bool) -> Vec<(String, Case)> {
    let mut cases = Vec::new();
    for (name, contacts) in laws() {
        for (_, drive) in DRIVES.iter().enumerate().filter(|(i, _)| is_taken(name, *i)) {
            let label = format!("{name} at {}", drive.omega);
            let case = Case::new(&scene(&contacts, drive), drive.cycles).unwrap_or_else(|e| panic!("{label}: {e}"));
            cases.push((label, case));
        }
    }
    cases
}

/// Kinds of events that a case goes through.
fn letters(case: &Case) -> BTreeSet<&str> {
    tokens(&case.image.word).map(|token| &token[..1]).collect()
}

#[test]
fn the_derivative_with_the_start_is_that_of_the_oracle() {
    let (mut events, mut columns) = (Table::default(), 0);
    for (label, case) in cases(|_, _| true) {
        let errors = case.columns().unwrap_or_else(|e| panic!("{label}: {e}"));
        columns += errors.len();
        let worst = errors.into_iter().fold(0.0, f64::max);
        assert!(worst <= BY_START, "{label}: {worst:e}, {:?}", case.image.word);
        letters(&case).into_iter().for_each(|letter| events.add(letter, worst));
    }
    assert_eq!(events.kinds(BY_START).concat(), EVENTS);
    println!("{columns} columns");
    assert_eq!(columns, COLUMNS);
}

#[test]
fn the_derivative_with_numbers_is_that_of_the_oracle() {
    let (mut table, mut events, mut pairs) = (Table::default(), Table::default(), 0);
    // The oracle takes most of its time for power laws, and for the slow forcing, which is needed for rest.
    let is_taken = |name: &str, drive: usize| match drive {
        0 => true,
        2 => ["rigid", "lands and is released", "bounces to rest"].contains(&name),
        4 => !name.contains("power") || name == "power 3/2, hysteresis",
        _ => !name.contains("power"),
    };
    for (label, case) in cases(is_taken) {
        for number in numbers(&case.simulation) {
            let error = case.by_number(&number).unwrap_or_else(|e| panic!("{label}, {number:?}: {e}"));
            assert!(error <= BY_NUMBER, "{label}, {number:?}: {error:e}, {:?}", case.image.word);
            table.add(&kind_of(&number[0]), error);
            letters(&case).into_iter().for_each(|letter| events.add(letter, error));
            pairs += 1;
        }
    }
    assert_eq!(table.kinds(BY_NUMBER).len(), NUMBERS);
    assert_eq!(events.kinds(BY_NUMBER).concat(), EVENTS);
    println!("{pairs} pairs of a scene and a number");
    assert_eq!(pairs, PAIRS);
}
