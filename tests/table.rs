//! The tables that the program writes.

use std::{collections::HashMap, path::Path};

/// A row by the names of its columns.
pub type Row = HashMap<String, String>;

/// The rows of a table.
///
/// # Panics
/// When it cannot be read.
pub fn rows(path: &Path) -> Vec<Row> {
    let place = path.display();
    let mut reader = csv::Reader::from_path(path).unwrap_or_else(|error| panic!("{place}: {error}"));
    reader.deserialize().map(|row| row.unwrap_or_else(|error| panic!("{place}: {error}"))).collect()
}

/// A number in a row; `None` where the field is empty.
///
/// # Panics
/// When there is no such column or it holds something else.
pub fn number(row: &Row, column: &str) -> Option<f64> {
    let text = row.get(column).unwrap_or_else(|| panic!("no column {column}"));
    (!text.is_empty()).then(|| text.parse().unwrap_or_else(|error| panic!("{column}: {text}: {error}")))
}
