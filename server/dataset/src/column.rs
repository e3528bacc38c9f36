//! Typed columns with descriptions, and the values of their cells. The columns in `decisions` and
//! `expressions` define the schema of the files, the dataset card and the documentation.

use std::fmt;

/// The type of a column, list element or struct field. All are nullable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// True or false.
    Bool,
    /// An integer 0..=255.
    Uint8,
    /// An integer of 16 bits.
    Uint16,
    /// An integer of 32 bits.
    Uint32,
    /// An integer of 64 bits.
    Uint64,
    /// A 32-bit float.
    Float32,
    /// UTF-8 text.
    Text,
    /// Bytes; in CSV and JSON Lines as lower-case hexadecimal digits.
    Binary,
    /// A time, microseconds since the Unix epoch in UTC; in CSV and JSON Lines as RFC 3339.
    Time,
    /// Any number of elements.
    List(&'static Type),
    /// Named fields.
    Struct(&'static [(&'static str, Type)]),
}

impl fmt::Display for Type {
    /// Arrow's name, as in the documentation: `list<uint8>`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Type::Bool => f.write_str("bool"),
            Type::Uint8 => f.write_str("uint8"),
            Type::Uint16 => f.write_str("uint16"),
            Type::Uint32 => f.write_str("uint32"),
            Type::Uint64 => f.write_str("uint64"),
            Type::Float32 => f.write_str("float"),
            Type::Text => f.write_str("string"),
            Type::Binary => f.write_str("binary"),
            Type::Time => f.write_str("timestamp[us, UTC]"),
            Type::List(of) => write!(f, "list<{of}>"),
            Type::Struct(fields) => {
                f.write_str("struct<")?;
                for (index, (name, of)) in fields.iter().enumerate() {
                    let comma = if index == 0 { "" } else { ", " };
                    write!(f, "{comma}{name}: {of}")?;
                }
                f.write_str(">")
            }
        }
    }
}

/// The value of a cell, according to the [`Type`] of its column; integers of every width are
/// `Uint`.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// Unknown or absent.
    Null,
    /// True or false.
    Bool(bool),
    /// An integer.
    Uint(u64),
    /// A float.
    Float(f32),
    /// Text.
    Text(String),
    /// Bytes.
    Binary(Vec<u8>),
    /// Microseconds since the Unix epoch.
    Time(i64),
    /// Elements.
    List(Vec<Value>),
    /// The fields, in the order of the type.
    Struct(Vec<Value>),
}

impl From<bool> for Value {
    fn from(value: bool) -> Self {
        Value::Bool(value)
    }
}

impl From<f32> for Value {
    fn from(value: f32) -> Self {
        Value::Float(value)
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Value::Text(value.to_owned())
    }
}

impl From<&String> for Value {
    fn from(value: &String) -> Self {
        Value::Text(value.clone())
    }
}

impl From<u8> for Value {
    fn from(value: u8) -> Self {
        Value::Uint(value.into())
    }
}

impl From<u16> for Value {
    fn from(value: u16) -> Self {
        Value::Uint(value.into())
    }
}

impl From<u32> for Value {
    fn from(value: u32) -> Self {
        Value::Uint(value.into())
    }
}

impl From<u64> for Value {
    fn from(value: u64) -> Self {
        Value::Uint(value)
    }
}

impl<T: Into<Value>> From<Option<T>> for Value {
    fn from(value: Option<T>) -> Self {
        value.map_or(Value::Null, Into::into)
    }
}

impl<T: Copy + Into<Value>> From<&[T]> for Value {
    fn from(values: &[T]) -> Self {
        Value::List(values.iter().map(|value| (*value).into()).collect())
    }
}

impl<T: Copy + Into<Value>> From<&Vec<T>> for Value {
    fn from(values: &Vec<T>) -> Self {
        values.as_slice().into()
    }
}

/// A column of a table of rows `R`.
#[derive(Debug)]
pub(super) struct Column<R> {
    /// The name.
    pub(super) name: &'static str,
    /// Its type.
    pub(super) of: Type,
    /// A description: one sentence with units, and when it is null.
    pub(super) about: &'static str,
    /// Its value in a row.
    pub(super) value: fn(&R) -> Value,
}

/// Name, type and description of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnInfo {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub of: Type,
    /// The description.
    pub about: &'static str,
}

impl<R> Column<R> {
    pub(super) const fn new(
        name: &'static str,
        of: Type,
        about: &'static str,
        value: fn(&R) -> Value,
    ) -> Self {
        Self {
            name,
            of,
            about,
            value,
        }
    }

    /// Name, type and description.
    pub(super) fn info(&self) -> ColumnInfo {
        ColumnInfo {
            name: self.name,
            of: self.of,
            about: self.about,
        }
    }
}

/// The columns as a Markdown table, for the dataset card and the documentation.
pub fn markdown(columns: &[ColumnInfo]) -> String {
    let mut text = String::from("| column | type | content |\n|---|---|---|\n");
    for ColumnInfo { name, of, about } in columns {
        text.push_str(&format!("| `{name}` | `{of}` | {about} |\n"));
    }
    text
}
