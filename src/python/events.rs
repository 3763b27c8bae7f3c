//! Events of a run, kept as columns.

use std::{borrow::Cow, collections::HashMap, sync::Arc};

use arrow_array::{ArrayRef, DictionaryArray, Float64Array, Int64Array, RecordBatch, StringArray, types::Int16Type};
use arrow_schema::{ArrowError, Field};
use numpy::ToPyArray;
use pyo3::{prelude::*, types::PyCapsule};
use pyo3_arrow::ffi::{ArrayIterator, to_stream_pycapsule};

use flank::{
    analysis::EventRow,
    simulation::{EVENT_COLUMNS, EventColumn, EventValues},
};

/// Values of one column.
#[derive(Debug)]
enum Values {
    Whole(Vec<i64>),
    /// Absent numbers are NaN.
    Numbers(Vec<f64>),
    Words(Words),
}

/// Places in a list of words.
#[derive(Debug, Default)]
struct Words {
    places: Vec<i16>,
    words: Vec<String>,
    known: HashMap<String, i16>,
}

impl Words {
    fn push(&mut self, word: Cow<'_, str>) {
        let place = self.known.get(&*word).copied().unwrap_or_else(|| {
            // Exact: names of contacts, kinds and modes.
            let place = self.words.len() as i16;
            self.words.push(word.to_string());
            self.known.insert(word.into_owned(), place);
            place
        });
        self.places.push(place);
    }
}

/// Collector of the rows of a run.
#[derive(Debug)]
pub struct Collector {
    columns: Vec<Values>,
    /// All digits of the times, in the order of the rows.
    exact: Vec<String>,
}

impl Default for Collector {
    fn default() -> Self {
        let empty = |column: &EventColumn| match column.values() {
            EventValues::Whole(_) => Values::Whole(Vec::new()),
            EventValues::Word(_) => Values::Words(Words::default()),
            _ => Values::Numbers(Vec::new()),
        };
        Self { columns: EVENT_COLUMNS.iter().map(empty).collect(), exact: Vec::new() }
    }
}

impl Collector {
    /// Adds a row: a line for each of its contacts.
    pub fn take(&mut self, row: &EventRow) {
        for contact in &row.contacts {
            for (values, column) in self.columns.iter_mut().zip(&EVENT_COLUMNS) {
                match (values, column.values()) {
                    (Values::Whole(values), EventValues::Whole(value)) => values.push(value(row)),
                    (Values::Words(words), EventValues::Word(word)) => words.push(word(contact)),
                    (Values::Numbers(values), EventValues::Instant(value)) => values.push(value(row)),
                    (Values::Numbers(values), EventValues::Decimal(value)) => values.push(value(row).1),
                    (Values::Numbers(values), EventValues::Contact(value)) => {
                        values.push(value(contact).unwrap_or(f64::NAN));
                    }
                    _ => unreachable!("a column keeps the kind of its values"),
                }
            }
            self.exact.push(row.t.clone());
        }
    }
}

/// Events of a run as columns, one row for each contact of each instant.
#[pyclass(frozen, module = "flank._flank")]
pub struct Events {
    table: RecordBatch,
    exact: Vec<String>,
}

impl Events {
    pub fn new(collected: Collector, is_dimensionless: bool) -> Result<Self, ArrowError> {
        let Collector { columns, exact } = collected;
        let names = EVENT_COLUMNS.iter().map(|column| column.name(is_dimensionless));
        let arrays = columns.into_iter().map(|values| -> Result<ArrayRef, ArrowError> {
            Ok(match values {
                Values::Whole(values) => Arc::new(Int64Array::from(values)),
                Values::Numbers(values) => {
                    let present = values.iter().map(|value| !value.is_nan()).collect::<Vec<bool>>();
                    Arc::new(Float64Array::new(values.into(), Some(present.into())))
                }
                Values::Words(Words { places, words, .. }) => {
                    Arc::new(DictionaryArray::<Int16Type>::try_new(places.into(), Arc::new(StringArray::from(words)))?)
                }
            })
        });
        let arrays = arrays.collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            table: RecordBatch::try_from_iter_with_nullable(names.zip(arrays).map(|(n, a)| (n, a, true)))?,
            exact,
        })
    }
}

#[pymethods]
impl Events {
    fn __len__(&self) -> usize {
        self.table.num_rows()
    }

    /// Names of the columns.
    fn names(&self) -> Vec<String> {
        self.table.schema_ref().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// Returns a column: an array, absent numbers as NaN, and the words that its values count, if it has words.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<(Bound<'py, PyAny>, Option<Vec<String>>)> {
        let column = self.table.column_by_name(name);
        let column = column.ok_or_else(|| pyo3::exceptions::PyKeyError::new_err(name.to_owned()))?.as_any();
        if let Some(whole) = column.downcast_ref::<Int64Array>() {
            return Ok((whole.values().to_pyarray(py).into_any(), None));
        }
        if let Some(numbers) = column.downcast_ref::<Float64Array>() {
            return Ok((numbers.values().to_pyarray(py).into_any(), None));
        }
        let words = column.downcast_ref::<DictionaryArray<Int16Type>>();
        let words = words.ok_or_else(|| pyo3::exceptions::PyKeyError::new_err(name.to_owned()))?;
        let list = words.values().as_any().downcast_ref::<StringArray>();
        let list = list.into_iter().flatten().flatten().map(str::to_owned).collect();
        Ok((words.keys().values().to_pyarray(py).into_any(), Some(list)))
    }

    /// Times in all digits, s, as text.
    fn exact_times(&self) -> Vec<String> {
        self.exact.clone()
    }

    /// Returns the columns as an Arrow stream, without copies.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyCapsule>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let table: ArrayRef = Arc::new(arrow_array::StructArray::from(self.table.clone()));
        let field = Field::new("", table.data_type().clone(), false);
        let reader = Box::new(ArrayIterator::new([Ok(table)], Arc::new(field)));
        Ok(to_stream_pycapsule(py, reader, requested_schema)?)
    }
}
