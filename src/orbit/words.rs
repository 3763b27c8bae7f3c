//! Words: the events of a motion in the order of time.
//!
//! A token is a kind, the number of a contact and its side: `c0+`. The kinds: `c` contact gained, `s` lost as the deflection is zero, `r`
//! lost as the force is zero, `a` gained again inside the zone, `x` left the zone, `i` impact, `z` comes to rest, `l` released from rest.
//! Tokens of one instant are sorted in brackets.

use std::{collections::BTreeMap, fmt::Write, mem::take, ops::ControlFlow};

use serde::{Deserialize, Serialize};

use crate::{
    engine::{JumpRecord, Observer, STALLED},
    event::EventRecord,
    hybrid::{ContactView, Instant, LaneEvent, LaneRecords, Watch},
    system::{ContactMode, Structure},
};

/// Returns the token of a contact that changes from `was` to `is`; `None` without an event of a token.
fn token(j: usize, was: ContactMode, is: ContactMode, is_rigid: bool) -> Option<String> {
    use ContactMode::{Back, BackDetached, Drive, DriveDetached, Separated};
    let side = if is == Separated { was.side() } else { is.side() };
    let kind = match (was, is) {
        (Separated, Drive | Back) if is_rigid => 'z',
        (Drive | Back, Separated) if is_rigid => 'l',
        _ if is_rigid => return None,
        (Separated, Drive | Back) => 'c',
        (Drive | Back, Separated) => 's',
        (Drive, DriveDetached) | (Back, BackDetached) => 'r',
        (DriveDetached, Drive) | (BackDetached, Back) => 'a',
        (DriveDetached | BackDetached, Separated) => 'x',
        _ => return None,
    };
    Some(write_token(kind, j, side))
}

fn write_token(kind: char, j: usize, side: f64) -> String {
    let mut token = String::with_capacity(4);
    token.push(kind);
    // A string takes any text.
    let _ = write!(token, "{j}");
    token.push(if side > 0.0 { '+' } else { '-' });
    token
}

/// Returns the smallest rotation of a word, by the order of its tokens (Booth 1980 does it in linear time; words are short).
#[must_use]
pub fn normal(tokens: &[String]) -> Vec<String> {
    let rotation = |start: &usize| tokens[*start..].iter().chain(&tokens[..*start]).cloned().collect::<Vec<_>>();
    (0..tokens.len()).map(|start| rotation(&start)).min().unwrap_or_default()
}

/// Returns the tokens as one text.
#[must_use]
pub fn text(tokens: &[String]) -> String {
    tokens.join(" ")
}

/// Returns the tokens of a word without brackets.
pub(crate) fn parts(word: &str) -> impl Iterator<Item = &str> {
    word.split(['[', ']', ' ']).filter(|part| !part.is_empty())
}

/// Returns the tokens in alphabetic order: rounding may decide on the order of events of one instant.
pub(crate) fn sorted<'a>(words: impl IntoIterator<Item = &'a String>) -> Vec<&'a str> {
    let mut parts: Vec<&str> = words.into_iter().flat_map(|word| parts(word)).collect();
    parts.sort_unstable();
    parts
}

/// Returns whether a token is that of a contact gained, an impact or a rest.
pub(crate) fn is_gained(token: &str) -> bool {
    token.starts_with(['c', 'i', 'z'])
}

/// Sequence of the words of cycles.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Sequence {
    /// Words that occurred, with their counts.
    words: Vec<(String, u64)>,
    /// Indices of the words, cycle by cycle.
    order: Vec<u32>,
}

/// Statistics of the words of cycles.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Statistics {
    /// Cycles read.
    pub cycles: u64,
    /// Mean number of contacts gained and impacts per cycle.
    pub contacts_per_cycle: f64,
    /// Number of different words of a cycle.
    pub different: usize,
    /// Most frequent words, with their shares.
    pub most_frequent: Vec<(String, f64)>,
    /// Entropy of the sequence, nats per cycle: uncertainty of a word if those of `memory` cycles before it are known. At most the sum of
    /// the positive exponents times the period (Ruelle 1978).
    pub entropy: f64,
    /// Number of words known before.
    pub memory: usize,
}

/// Maximum number of words named in a file.
const NAMED: usize = 12;

impl Sequence {
    /// Adds the word of a cycle. Contacts lost by force and gained again inside the zone of a flank are left out: they are one contact.
    pub fn add(&mut self, tokens: &[String]) {
        let told = |token: &String| {
            let told: Vec<&str> = parts(token).filter(|token| !token.starts_with(['a', 'x'])).collect();
            if told.len() > 1 { format!("[{}]", told.join(" ")) } else { told.concat() }
        };
        let word = tokens.iter().map(told).filter(|token| !token.is_empty()).collect::<Vec<_>>().join(" ");
        let place = self.words.iter().position(|(known, _)| *known == word).unwrap_or_else(|| {
            self.words.push((word, 0));
            self.words.len() - 1
        });
        self.words[place].1 += 1;
        self.order.push(place as u32);
    }

    /// Returns the entropy of the blocks of `length` words, nats, with the bias correction of Miller and Madow; and how many blocks differ.
    fn block_entropy(&self, length: usize) -> (f64, usize) {
        let mut counts: BTreeMap<&[u32], u64> = BTreeMap::new();
        self.order.windows(length).for_each(|block| *counts.entry(block).or_default() += 1);
        let total: u64 = counts.values().sum();
        let entropy: f64 = counts.values().map(|n| *n as f64 / total as f64).map(|p| -p * libm::log(p)).sum();
        (entropy + (counts.len() as f64 - 1.0) / (2.0 * total as f64), counts.len())
    }

    /// Returns the statistics of the sequence. Blocks are as long as a tenth of the cycles allows for their number.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        let (mut memory, mut entropy, mut before) = (0, 0.0, 0.0);
        for length in 1..self.order.len() {
            let (block, different) = self.block_entropy(length);
            if length > 1 && (different * 10 > self.order.len() || length > LONGEST_BLOCK) {
                break;
            }
            (memory, entropy, before) = (length - 1, block - before, block);
        }
        let cycles = self.order.len() as u64;
        let mut frequent = self.words.clone();
        frequent.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        let contacts = |word: &str| parts(word).filter(|token| is_gained(token)).count();
        let all: u64 = self.words.iter().map(|(word, count)| contacts(word) as u64 * count).sum();
        Statistics {
            cycles,
            contacts_per_cycle: all as f64 / cycles.max(1) as f64,
            different: self.words.len(),
            most_frequent: frequent.into_iter().take(NAMED).map(|(w, n)| (w, n as f64 / cycles as f64)).collect(),
            entropy: entropy.max(0.0),
            memory,
        }
    }
}

/// Longest block, words.
const LONGEST_BLOCK: usize = 12;

/// Event of one contact.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Letter {
    /// Its token.
    pub token: String,
    /// Index of the contact.
    pub contact: usize,
    /// Instant of the event.
    pub at: Instant,
    /// Rate of the contact's deflection before the event, m/s.
    pub rate: f64,
    /// Number of the event: letters of one event stand in brackets.
    event: usize,
    /// True if it ends a sequence of impacts.
    ends: bool,
}

/// Returns the tokens of a jump, one for each contact that it changes, with the index of the contact.
pub(crate) fn letters<'a>(
    structure: &'a Structure,
    jumped: &'a JumpRecord<'a>,
) -> impl Iterator<Item = (usize, String)> {
    structure.contacts().iter().enumerate().filter_map(|(j, c)| {
        let (was, is) = (structure.contact_mode(j, &jumped.from.mode), structure.contact_mode(j, &jumped.to.mode));
        let is_rigid = c.spec.law.is_rigid();
        let told = token(j, was, is, is_rigid).or_else(|| {
            let struck = jumped.to.struck.iter().map(|id| structure.watch(id)).find(|(k, _)| *k == j);
            let (_, watch) = struck.filter(|_| is_rigid && was == ContactMode::Separated)?;
            Some(write_token('i', j, if watch == Watch::DriveFlank { 1.0 } else { -1.0 }))
        });
        told.map(|token| (j, token))
    })
}

/// Returns the tokens of letters: those of one event in brackets.
fn spell(letters: Vec<Letter>) -> Vec<String> {
    let (mut tokens, mut letters) = (Vec::with_capacity(letters.len()), letters.into_iter().peekable());
    while let Some(Letter { mut token, event, .. }) = letters.next() {
        let mut is_single = true;
        while let Some(next) = letters.next_if(|letter| letter.event == event) {
            token = format!("{token} {}", next.token);
            is_single = false;
        }
        tokens.push(if is_single { token } else { format!("[{token}]") });
    }
    tokens
}

/// Observer that spells the motion.
#[derive(Debug)]
pub(crate) struct WordObserver<'s> {
    structure: &'s Structure,
    /// Letters of the present event.
    open: Vec<Letter>,
    events: usize,
    /// The letters of all events.
    pub letters: Vec<Letter>,
    /// Largest absolute value so far of each component of the state.
    pub sizes: Vec<f64>,
    /// Events of a lane that are not letters yet.
    passed: Vec<LaneEvent>,
}

impl<'s> WordObserver<'s> {
    pub fn new(structure: &'s Structure, x: &[f64]) -> Self {
        let sizes = x.iter().map(|x| x.abs()).collect();
        Self { structure, open: Vec::new(), events: 0, letters: Vec::new(), sizes, passed: Vec::new() }
    }

    /// Updates the sizes by those of a state.
    pub fn meet(&mut self, x: &[f64]) {
        self.sizes.iter_mut().zip(x).for_each(|(size, x)| *size = size.max(x.abs()));
    }

    /// Returns the tokens since the last call, and clears them.
    pub fn take(&mut self) -> Vec<String> {
        self.close();
        spell(take(&mut self.letters))
    }

    /// Returns the tokens of a motion that repeats. If a contact first comes to rest, the impacts before that at the end of the word are a part
    /// of its token.
    pub fn into_word(mut self) -> Vec<String> {
        self.close();
        let mut letters = self.letters;
        for contact in 0..self.structure.contacts().len() {
            let Some(first) = letters.iter().find(|letter| letter.contact == contact) else { continue };
            let Some(end) = first.token.strip_prefix('z').filter(|_| first.ends) else { continue };
            let (impact, mut speed) = (format!("i{end}"), 0.0);
            while let Some(last) = letters.iter().rposition(|letter| letter.contact == contact) {
                let Letter { token, rate, .. } = &letters[last];
                if *token != impact || rate.abs() < STALLED * speed {
                    break;
                }
                speed = rate.abs();
                letters.remove(last);
            }
        }
        spell(letters)
    }

    /// Adds the letters of the present event, and of those that a lane has passed, to the letters of all events.
    pub fn close(&mut self) {
        self.open.sort_by(|a, b| a.token.cmp(&b.token));
        self.events += 1;
        self.letters.append(&mut self.open);
        for LaneEvent { at, contact, was, is, rate } in self.passed.drain(..) {
            if let Some(token) = token(contact, was, is, false) {
                self.letters.push(Letter { token, contact, at, rate, event: self.events, ends: false });
                self.events += 1;
            }
        }
    }
}

impl Observer for WordObserver<'_> {
    fn wants_steps(&self, _: &crate::hybrid::Mode, _: crate::hybrid::Instant) -> bool {
        false
    }

    fn wants_jumps(&self) -> bool {
        true
    }

    fn records(&mut self) -> Option<LaneRecords<'_>> {
        let (events, sizes) = (Some(&mut self.passed), Some(&mut self.sizes[..]));
        Some(LaneRecords { events, sizes, ..LaneRecords::default() })
    }

    fn jump(&mut self, jumped: &JumpRecord<'_>) {
        if !self.passed.is_empty() {
            self.close();
        }
        self.meet(jumped.x_minus);
        self.meet(jumped.x_plus);
        for (contact, token) in letters(self.structure, jumped) {
            // A token ends with the side of its flank.
            let side = if token.ends_with('-') { -1.0 } else { 1.0 };
            let (_, rate) = ContactView::deflection(self.structure, contact, side, jumped.at, jumped.x_minus);
            self.open.push(Letter { token, contact, at: jumped.at, rate, event: self.events, ends: false });
        }
    }

    fn event(&mut self, record: &EventRecord) -> ControlFlow<()> {
        if record.start {
            // A decision about the first mode, and no event.
            self.open.clear();
        }
        if let Some(accumulation) = record.accumulation {
            // The impacts of the sequence, the last ones of their contact, become one token: that of its end.
            for (contact, watch) in record.fired.iter().map(|id| self.structure.watch(id)) {
                self.open.iter_mut().filter(|letter| letter.contact == contact).for_each(|letter| letter.ends = true);
                let impact = write_token('i', contact, watch.side());
                for _ in 0..accumulation.resolved {
                    let last = self.letters.iter().rposition(|letter| letter.contact == contact);
                    let Some(last) = last.filter(|last| self.letters[*last].token == impact) else { break };
                    self.letters.remove(last);
                }
            }
        }
        self.close();
        ControlFlow::Continue(())
    }
}
