//! Events of a run, kept as columns.

use std::{collections::HashMap, sync::Arc};

use arrow_array::{ArrayRef, DictionaryArray, Float64Array, Int64Array, RecordBatch, StringArray, types::Int16Type};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use numpy::ToPyArray;
use pyo3::{prelude::*, types::PyCapsule};
use pyo3_arrow::ffi::{ArrayIterator, to_stream_pycapsule};

use flank::{
    analysis::EventRow,
    simulation::{EVENT_COLUMNS, EventCell},
};

/// Values of one column.
#[derive(Debug)]
enum Values {
    Whole(Vec<i64>),
    /// Absent numbers are NaN.
    Numbers(Vec<f64>),
    /// Places in a list of words.
    Words {
        places: Vec<i16>,
        words: Vec<String>,
        known: HashMap<String, i16>,
    },
}

impl Values {
    fn push(&mut self, cell: EventCell<'_>) {
        match (self, cell) {
            (Self::Whole(values), EventCell::Whole(value)) => values.push(value),
            (Self::Numbers(values), EventCell::Number(value)) => values.push(value.unwrap_or(f64::NAN)),
            (Self::Numbers(values), EventCell::Decimal(_, value)) => values.push(value),
            (Self::Words { places, words, known }, EventCell::Word(word)) => {
                let place = known.get(&*word).copied().unwrap_or_else(|| {
                    // Exact: names of contacts, kinds and modes.
                    let place = words.len() as i16;
                    words.push(word.to_string());
                    known.insert(word.into_owned(), place);
                    place
                });
                places.push(place);
            }
            (values, cell) => unreachable!("a column of {values:?} has no {cell:?}"),
        }
    }

    /// Returns an empty column for cells like this one.
    fn like(cell: &EventCell<'_>) -> Self {
        match cell {
            EventCell::Whole(_) => Self::Whole(Vec::new()),
            EventCell::Number(_) | EventCell::Decimal(..) => Self::Numbers(Vec::new()),
            EventCell::Word(_) => Self::Words { places: Vec::new(), words: Vec::new(), known: HashMap::new() },
        }
    }
}

/// Collector of the rows of a run.
#[derive(Debug, Default)]
pub struct Collector {
    columns: Vec<Values>,
    /// All digits of the times, in the order of the rows.
    exact: Vec<String>,
}

impl Collector {
    /// Adds a row: a line for each of its contacts.
    pub fn take(&mut self, row: &EventRow) {
        for contact in &row.contacts {
            let cells = EVENT_COLUMNS.iter().map(|column| column.cell(row, contact));
            if self.columns.is_empty() {
                self.columns = cells.clone().map(|cell| Values::like(&cell)).collect();
            }
            self.columns.iter_mut().zip(cells).for_each(|(values, cell)| values.push(cell));
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
                    let absent = values.iter().map(|value| !value.is_nan()).collect::<Vec<bool>>();
                    Arc::new(Float64Array::new(values.into(), Some(absent.into())))
                }
                Values::Words { places, words, .. } => {
                    Arc::new(DictionaryArray::<Int16Type>::try_new(places.into(), Arc::new(StringArray::from(words)))?)
                }
            })
        });
        let arrays = arrays.collect::<Result<Vec<_>, _>>()?;
        if arrays.is_empty() {
            let fields: Vec<Field> = names.map(|name| Field::new(name, DataType::Float64, true)).collect();
            return Ok(Self { table: RecordBatch::new_empty(Arc::new(Schema::new(fields))), exact });
        }
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
