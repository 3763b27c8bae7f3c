//! Files of measured points, which are copied into a scene as it is read. The scene then contains `points`: it no longer needs the file,
//! and its hash covers the content of the file.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::fault::{Fault, below};
use crate::output::read_file;

/// Maximum number of bytes of a table.
const MOST_BYTES: u64 = 16 << 20;
/// Maximum number of faults of one table that are listed.
const SHOWN: usize = 20;
/// Maximum number of characters of a cell in a message.
const CELL: usize = 40;

/// Replaces `table`, the path of a file below `folder`, by `points` wherever a curve names one.
pub(super) fn load(value: &mut Value, folder: &Path, pointer: &str, faults: &mut Vec<Fault>) {
    match value {
        Value::Array(items) => {
            for (i, item) in items.iter_mut().enumerate() {
                load(item, folder, &below(pointer, &i.to_string()), faults);
            }
        }
        Value::Object(object) => {
            // Both keys are one too many, which the shape reports.
            if object.get("table").is_some_and(Value::is_string) && !object.contains_key("points") {
                fill(object, folder, pointer, faults);
            }
            for (key, item) in object.iter_mut() {
                load(item, folder, &below(pointer, key), faults);
            }
        }
        _ => {}
    }
}

fn fill(object: &mut Map<String, Value>, folder: &Path, pointer: &str, faults: &mut Vec<Fault>) {
    let name = object.remove("table").and_then(|name| name.as_str().map(String::from)).unwrap_or_default();
    let columns = object.remove("columns");
    let place = below(pointer, "table");
    let read = read_file(&folder.join(&name), MOST_BYTES).map_err(|error| error.to_string());
    let text = read.and_then(|bytes| String::from_utf8(bytes).map_err(|error| error.to_string()));
    let mut own = Vec::new();
    let points = match text {
        Err(why) => {
            let fault = Fault::new(&place, format!("{name}: {why}"), "a CSV file that can be read");
            own.push(fault.remedy("write its path, relative to the scene"));
            Vec::new()
        }
        Ok(text) => {
            let table = Table::new(&text);
            let columns = table.columns(columns.as_ref(), &below(pointer, "columns"), &mut own).unwrap_or([0, 1]);
            for (key, column) in ["place", "unit"].into_iter().zip(columns) {
                if let Some(unit) = table.unit(column).filter(|_| !object.contains_key(key)) {
                    object.insert(key.to_owned(), unit.into());
                }
            }
            table.points(columns, (&name, &place), &mut own)
        }
    };
    let found = own.len();
    if found > SHOWN {
        own.truncate(SHOWN);
        let fault = Fault::new(&place, format!("{} more faults in {name}", found - SHOWN), "a table of numbers");
        own.push(fault.remedy("mend those first"));
    } else if found == 0 && points.len() < 2 {
        let fault = Fault::new(&place, format!("{} lines with numbers in {name}", points.len()), "two lines at least");
        own.push(fault.remedy("write one line for each point: place, value"));
    }
    // The rest of the scene is checked too: points are needed here.
    let points = if own.is_empty() { points } else { vec![json!([0.0, 1.0]), json!([0.5, 1.0])] };
    object.insert("points".to_owned(), points.into());
    faults.extend(own);
}

/// Rows of a file with their lines, and the head, if it has one.
struct Table {
    head: Vec<String>,
    rows: Vec<(u64, Vec<String>)>,
    /// True if numbers have decimal commas, as in files with semicolons.
    has_commas: bool,
}

impl Table {
    fn new(text: &str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or_default();
        let delimiter = [';', '\t', ','].into_iter().find(|sign| first.contains(*sign)).unwrap_or(' ');
        let mut reader = csv::ReaderBuilder::new();
        reader.delimiter(delimiter as u8).has_headers(false).flexible(true).comment(Some(b'#')).trim(csv::Trim::All);
        // Any bytes are records of CSV: every text can be read.
        let records = reader.from_reader(text.as_bytes()).into_records().flatten();
        let mut rows: Vec<(u64, Vec<String>)> = records
            .map(|record| (record.position().map_or(0, csv::Position::line), record.iter().map(String::from).collect()))
            .collect();
        let mut table = Self { head: Vec::new(), rows: Vec::new(), has_commas: delimiter == ';' };
        let is_head = rows.first().is_some_and(|(_, cells)| cells.iter().all(|cell| table.number(cell).is_none()));
        if is_head {
            table.head = rows.remove(0).1;
        }
        table.rows = rows;
        table
    }

    fn number(&self, cell: &str) -> Option<f64> {
        let text = if self.has_commas { cell.replace(',', ".") } else { cell.to_owned() };
        text.parse().ok()
    }

    /// Returns the indices of the columns of place and value, from 0.
    fn columns(&self, asked: Option<&Value>, pointer: &str, faults: &mut Vec<Fault>) -> Option<[usize; 2]> {
        let Some(asked) = asked.and_then(Value::as_array).filter(|asked| asked.len() == 2) else { return Some([0, 1]) };
        let names: Vec<&str> = self.head.iter().map(|cell| split(cell).0).collect();
        let mut found = asked.iter().enumerate().map(|(i, column)| {
            let by_name = column.as_str().map(|name| names.iter().position(|own| *own == name));
            let by_number = column.as_u64().and_then(|number| (number as usize).checked_sub(1));
            let place = by_name.unwrap_or(by_number);
            if place.is_none() {
                let allowed =
                    if names.is_empty() { "a number: the file has no head".to_owned() } else { names.join(", ") };
                let fault = Fault::new(&below(pointer, &i.to_string()), column.to_string(), allowed);
                faults.push(fault.remedy("name a column of the file, or count from 1"));
            }
            place
        });
        let [one, two] = [found.next().flatten(), found.next().flatten()];
        Some([one?, two?])
    }

    /// Returns the numbers of two columns.
    fn points(&self, columns: [usize; 2], (name, place): (&str, &str), faults: &mut Vec<Fault>) -> Vec<Value> {
        let mut points = Vec::new();
        for (line, cells) in &self.rows {
            let numbers = columns.map(|column| {
                let cell = cells.get(column).map_or("", String::as_str);
                let number = self.number(cell).filter(|number| number.is_finite());
                if number.is_none() {
                    let shown: String = cell.chars().take(CELL).collect();
                    let found = format!("{name}, line {line}, column {}: {shown:?}", column + 1);
                    faults
                        .push(Fault::new(place, found, "a finite number").remedy("write a number, or remove the line"));
                }
                number
            });
            if let [Some(x), Some(y)] = numbers {
                points.push(json!([x, y]));
            }
        }
        points
    }

    /// Returns the unit in the head of a column, in the form of a scene: `stiffness [N/µm]` or `stiffness (N/um)`.
    fn unit(&self, column: usize) -> Option<String> {
        let unit = split(self.head.get(column)?).1?;
        let plain = unit.replace(['µ', 'μ'], "u").replace('°', "deg");
        Some(if matches!(&*plain, "-" | "1" | "T") { "period".to_owned() } else { plain })
    }
}

/// Returns name and unit in the head of a column.
fn split(cell: &str) -> (&str, Option<&str>) {
    let ends = [('[', ']'), ('(', ')')];
    let cut = ends.into_iter().find_map(|(open, close)| cell.strip_suffix(close)?.split_once(open));
    cut.map_or((cell, None), |(name, unit)| (name.trim(), Some(unit.trim())))
}
