//! Reader of a resolved scene: a value of checked shape, with its place.

use std::cell::RefCell;

use nalgebra::DMatrix;
use serde_json::Value;

use super::mesh::ToothMesh;
use super::{
    fault::{Fault, Warning, below, show},
    shape::Units,
};
use crate::{hybrid::Wide, train::Drawing};

/// Findings of the reader beyond the shapes: conditions across keys.
#[derive(Debug, Default)]
pub(super) struct Findings {
    faults: RefCell<Vec<Fault>>,
    /// Faults of the start with this train, which matter only if the start is used.
    pub start_faults: RefCell<Vec<Fault>>,
    warnings: RefCell<Vec<Warning>>,
    /// Remarks that are no warnings.
    pub remarks: RefCell<Vec<Warning>>,
    /// Meshes whose teeth are given.
    pub meshes: RefCell<Vec<ToothMesh>>,
    /// Train in the form of a picture.
    pub drawing: RefCell<Option<Drawing>>,
    /// Mean speeds of shafts and loose gears, rad/s, by name.
    pub speeds: RefCell<Vec<(String, f64)>>,
}

impl Findings {
    pub fn into_parts(self) -> (Vec<Fault>, Vec<Warning>) {
        (self.faults.into_inner(), self.warnings.into_inner())
    }
}

/// Place in a resolved scene.
///
/// Its accessors do not fail: the shape has been checked before, and optional keys have separate accessors. A wrong shape would return a
/// substitute (NaN, nothing), which is refused later.
#[derive(Clone, Debug)]
pub(super) struct Node<'a> {
    value: &'a Value,
    pointer: String,
    findings: &'a Findings,
    /// Units of the keys below.
    pub units: Units,
}

impl<'a> Node<'a> {
    pub fn root(value: &'a Value, findings: &'a Findings, units: Units) -> Self {
        Self { value, pointer: String::new(), findings, units }
    }

    /// Returns the value under a key; `null` if there is none.
    pub fn at(&self, key: &str) -> Node<'a> {
        self.child(key, self.value.get(key).unwrap_or(&Value::Null))
    }

    /// Returns the value under a key with a unit.
    pub fn at_unit(&self, stem: &str, unit: &str) -> Node<'a> {
        self.at(&self.units.key(stem, unit))
    }

    fn child(&self, key: &str, value: &'a Value) -> Node<'a> {
        Node { value, pointer: below(&self.pointer, key), findings: self.findings, units: self.units }
    }

    pub fn written(self) -> Option<Node<'a>> {
        if self.value.is_null() { None } else { Some(self) }
    }

    pub fn number(&self) -> f64 {
        self.value.as_f64().unwrap_or(f64::NAN)
    }

    /// Returns a number, or one written as text with more digits than a double has.
    pub fn wide(&self) -> Wide {
        Wide::parse(self.text()).unwrap_or_else(|| self.number().into())
    }

    pub fn whole(&self) -> u64 {
        self.value.as_u64().unwrap_or(0)
    }

    pub fn flag(&self) -> bool {
        self.value.as_bool().unwrap_or(false)
    }

    pub fn text(&self) -> &'a str {
        self.value.as_str().unwrap_or("")
    }

    pub fn is_text(&self) -> bool {
        self.value.is_string()
    }

    pub fn is_number(&self) -> bool {
        self.value.is_number()
    }

    pub fn is_list(&self) -> bool {
        self.value.is_array()
    }

    /// Returns the items of a list; none if there is no list.
    pub fn items(&self) -> Vec<Node<'a>> {
        let items = self.value.as_array().map_or(&[][..], Vec::as_slice);
        items.iter().enumerate().map(|(i, item)| self.child(&i.to_string(), item)).collect()
    }

    /// Returns the entries of an object whose keys are names by the user.
    pub fn entries(&self) -> Vec<(&'a str, Node<'a>)> {
        self.value
            .as_object()
            .map(|map| map.iter().map(|(key, value)| (key.as_str(), self.child(key, value))).collect())
            .unwrap_or_default()
    }

    pub fn numbers(&self) -> Vec<f64> {
        self.items().iter().map(Node::number).collect()
    }

    /// Returns a list of `n` numbers; zeros if missing.
    pub fn vector(&self, n: usize) -> Vec<f64> {
        let Some(node) = self.clone().written() else { return vec![0.0; n] };
        let numbers = node.numbers();
        if numbers.len() != n {
            self.refuse(format!("a list of {n} numbers, one per freedom"), "write one number per freedom");
            return vec![0.0; n];
        }
        numbers
    }

    /// Returns an `n × n` matrix, given as rows or as its diagonal; zero if missing.
    pub fn matrix(&self, n: usize) -> DMatrix<f64> {
        let items = self.items();
        if self.clone().written().is_none() {
            return DMatrix::zeros(n, n);
        }
        if items.len() != n {
            let allowed = format!("{n} rows of {n} numbers, or a diagonal of {n} numbers");
            self.refuse(allowed, "write one row, or one diagonal entry, per freedom");
            return DMatrix::zeros(n, n);
        }
        if items.iter().all(|item| item.is_number()) {
            return DMatrix::from_diagonal(&self.numbers().into());
        }
        let rows: Vec<f64> = items.iter().flat_map(|row| row.vector(n)).collect();
        DMatrix::from_row_slice(n, n, &rows)
    }

    /// Returns whether a fault was found anywhere so far.
    pub fn has_faults(&self) -> bool {
        !self.findings.faults.borrow().is_empty()
    }

    /// Adds the fault that the value here is not allowed.
    pub fn refuse(&self, allowed: impl Into<String>, remedy: impl Into<String>) {
        let found = if self.value.is_null() { "nothing: the key is missing".to_owned() } else { show(self.value) };
        self.fault(found, allowed, remedy);
    }

    /// Adds a fault found here, in words.
    pub fn fault(&self, found: impl Into<String>, allowed: impl Into<String>, remedy: impl Into<String>) {
        // Planets share one mesh: a fault of it is one.
        let (fault, mut faults) =
            (Fault::new(&self.pointer, found, allowed).remedy(remedy), self.findings.faults.borrow_mut());
        if !faults.contains(&fault) {
            faults.push(fault);
        }
    }

    /// Returns whether a fault with this range is noted here.
    pub fn has_fault(&self, allowed: &str) -> bool {
        self.findings.faults.borrow().iter().any(|fault| fault.pointer == self.pointer && fault.allowed == allowed)
    }

    /// Adds a fault of the start with this train.
    pub fn start_fault(&self, found: impl Into<String>, allowed: impl Into<String>, remedy: impl Into<String>) {
        self.findings.start_faults.borrow_mut().push(Fault::new(&self.pointer, found, allowed).remedy(remedy));
    }

    pub fn meshes(&self, meshes: Vec<ToothMesh>) {
        self.findings.meshes.replace(meshes);
    }

    pub fn drawing(&self, drawing: Drawing) {
        self.findings.drawing.replace(Some(drawing));
    }

    pub fn turns(&self, name: &str, speed: f64) {
        self.findings.speeds.borrow_mut().push((name.to_owned(), speed));
    }

    pub fn remark(&self, message: impl Into<String>) {
        let remark = Warning { pointer: self.pointer.clone(), message: message.into() };
        let mut remarks = self.findings.remarks.borrow_mut();
        // Planets share one mesh.
        if !remarks.contains(&remark) {
            remarks.push(remark);
        }
    }

    pub fn warn(&self, message: impl Into<String>) {
        let warning = Warning { pointer: self.pointer.clone(), message: message.into() };
        let mut warnings = self.findings.warnings.borrow_mut();
        // One line for each cause: a common value of two meshes is reported once, with both places.
        match warnings.iter_mut().find(|other| other.message == warning.message) {
            Some(other) if other.pointer.split(", ").any(|place| place == warning.pointer) => {}
            Some(other) => other.pointer = format!("{}, {}", other.pointer, warning.pointer),
            None => warnings.push(warning),
        }
    }
}
