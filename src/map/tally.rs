//! Counts of the cells of a table by kind, and the cells of its picture.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::cell::Impacts;

/// Maximum number of points of a picture along an axis; of more cells every second, third … is shown.
const MOST_POINTS: usize = 1200;

/// Returns the steps between the cells that a picture shows, along each axis.
pub(super) fn shown_steps(counts: [usize; 2]) -> [usize; 2] {
    counts.map(|count| count.div_ceil(MOST_POINTS))
}

/// A class of cells in the picture: the kind, and the period of a periodic motion.
pub type Class = (String, Option<u64>);

/// One cell in the picture.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PictureCell {
    /// Index of its class.
    pub class: usize,
    /// Largest exponent, 1/s.
    pub exponent: Option<f64>,
    /// Largest value of the first measure over all contacts.
    pub measure: Option<f64>,
    /// Flanks that are struck: index in [`Impacts::ALL`], or the length of that array if unknown.
    pub impacts: usize,
}

/// Counts of cells, and those that a picture shows.
#[derive(Clone, Debug)]
pub struct Tally {
    counts: [usize; 2],
    /// Columns of the first measure of each contact.
    measures: Vec<usize>,
    /// Column of the impacts.
    struck: usize,
    /// Steps between shown cells, along each axis.
    steps: [usize; 2],
    seen: usize,
    /// Classes that occur, with index and number of cells.
    classes: BTreeMap<Class, (usize, u64)>,
    /// Numbers of cells by the flanks that are struck, then of unknown ones.
    impacts: [u64; 4],
    /// Cells shown, the second axis fastest.
    shown: Vec<PictureCell>,
}

impl Tally {
    pub(super) fn new(counts: [usize; 2], measures: Vec<usize>, struck: usize) -> Self {
        let (steps, classes, shown) = (shown_steps(counts), BTreeMap::new(), Vec::new());
        Self { counts, measures, struck, steps, seen: 0, classes, impacts: [0; 4], shown }
    }

    /// Adds the next row.
    pub(super) fn add(&mut self, row: &str) {
        let fields: Vec<&str> = row.splitn(self.struck + 2, ',').collect();
        let field = |i: usize| fields.get(i).copied().unwrap_or_default();
        let class = (field(2).to_owned(), field(3).parse().ok());
        let number = self.classes.len();
        let (number, count) = self.classes.entry(class).or_insert((number, 0));
        *count += 1;
        let all = Impacts::ALL;
        let impacts = all.iter().position(|impacts| impacts.word() == field(self.struck)).unwrap_or(all.len());
        self.impacts[impacts] += 1;
        let at = [self.seen / self.counts[1], self.seen % self.counts[1]];
        if at[0].is_multiple_of(self.steps[0]) && at[1].is_multiple_of(self.steps[1]) {
            let value = |i: usize| field(i).parse::<f64>().ok();
            let measure = self.measures.iter().filter_map(|i| value(*i)).reduce(f64::max);
            self.shown.push(PictureCell { class: *number, exponent: value(5), measure, impacts });
        }
        self.seen += 1;
    }

    /// Returns the number of shown cells along each axis.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [0, 1].map(|i| self.counts[i].div_ceil(self.steps[i]))
    }

    /// Returns the shown cells, the second axis fastest.
    #[must_use]
    pub fn shown(&self) -> &[PictureCell] {
        &self.shown
    }

    /// Returns the classes with their indices and counts.
    pub fn classes(&self) -> impl Iterator<Item = (&Class, usize, u64)> {
        self.classes.iter().map(|(class, (number, count))| (class, *number, *count))
    }

    /// Returns the numbers of cells by the flanks that are struck, in the order of [`Impacts::ALL`], then of unknown ones.
    #[must_use]
    pub fn impacts(&self) -> [u64; 4] {
        self.impacts
    }

    /// Returns the number of cells of each kind, the most frequent first.
    #[must_use]
    pub fn kinds(&self) -> Vec<(&str, u64)> {
        let mut kinds: BTreeMap<&str, u64> = BTreeMap::new();
        self.classes.iter().for_each(|((kind, _), (_, count))| *kinds.entry(kind).or_default() += count);
        let mut kinds: Vec<_> = kinds.into_iter().collect();
        kinds.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
        kinds
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.seen
    }

    /// Returns the number of cells that failed.
    #[must_use]
    pub fn failed(&self) -> u64 {
        self.kinds().iter().filter(|(kind, _)| *kind == "failed").map(|(_, count)| count).sum()
    }

    /// Returns as JSON: cells, those of each kind, periods.
    pub(super) fn found(&self) -> Value {
        let kinds: serde_json::Map<String, Value> =
            self.kinds().into_iter().map(|(kind, count)| (kind.to_owned(), count.into())).collect();
        let periods: serde_json::Map<String, Value> = self
            .classes
            .iter()
            .filter_map(|((_, period), (_, count))| Some((period.as_ref()?.to_string(), (*count).into())))
            .collect();
        let names = Impacts::ALL.map(Impacts::word).into_iter().chain(["not known"]);
        let impacts: serde_json::Map<String, Value> =
            names.zip(self.impacts).map(|(name, count)| (name.to_owned(), count.into())).collect();
        json!({ "cells": self.seen, "kinds": kinds, "periods_cycles": periods, "impacts": impacts })
    }
}
