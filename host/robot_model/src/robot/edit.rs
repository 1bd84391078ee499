//! Changes of a description file that leave its comments where they are.

use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// The tables of an array, however it is written.
pub fn each<'d>(file: &'d mut DocumentMut, key: &str) -> Box<dyn Iterator<Item = &'d mut dyn TableLike> + 'd> {
    match file.get_mut(key) {
        Some(Item::ArrayOfTables(tables)) => {
            Box::new(tables.iter_mut().map(|table: &mut Table| table as &mut dyn TableLike))
        }
        Some(Item::Value(Value::Array(tables))) => {
            let inline = tables.iter_mut().filter_map(Value::as_inline_table_mut);
            Box::new(inline.map(|table| table as &mut dyn TableLike))
        }
        _ => Box::new(std::iter::empty()),
    }
}

/// Whether a table has this text under the key.
pub fn is(table: &dyn TableLike, key: &str, value: &str) -> bool {
    table.get(key).and_then(Item::as_str) == Some(value)
}

/// Puts a value where an estimate starts; what a simulated robot has beside it is no more.
pub fn start(item: &mut Item, value: Value) {
    let Some(table) = item.as_table_like_mut() else { return };
    table.remove("simulated");
    if let Some(start) = table.get_mut("start") {
        replace(start, value);
    }
}

/// Another value with the spaces and comments around the old one.
pub fn replace(item: &mut Item, mut value: Value) {
    if let Some(old) = item.as_value() {
        *value.decor_mut() = old.decor().clone();
    }
    *item = Item::Value(value);
}

/// A vector, as a file has it.
pub fn vector(values: [f64; 3]) -> Value {
    Value::Array(values.into_iter().collect())
}
