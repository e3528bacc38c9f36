//! A row on its way to a file: the interface of the files, and rows as values of serde.

use std::io;

use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

use super::column::{ColumnInfo, Type, Value};
use super::files::FileSummary;

/// A file of rows.
pub(super) trait RowFile {
    /// Adds a row, one value per column.
    fn write(&mut self, row: &[Value]) -> io::Result<()>;
    /// Completes the file.
    fn finish(self: Box<Self>) -> io::Result<FileSummary>;
}

/// A row as an object.
pub(super) struct Object<'a> {
    pub(super) columns: &'a [ColumnInfo],
    pub(super) row: &'a [Value],
    pub(super) encoding: Encoding,
}

/// How binary values and times are serialized.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// As hexadecimal and RFC 3339, for JSON and CSV.
    Text,
    /// As bytes and microseconds, for Arrow.
    Arrow,
}

impl Serialize for Object<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.row.len()))?;
        for (column, value) in self.columns.iter().zip(self.row) {
            let cell = Cell {
                of: column.of,
                value,
                encoding: self.encoding,
            };
            map.serialize_entry(column.name, &cell)?;
        }
        map.end()
    }
}

/// A value with its type, which has the names of struct fields.
pub(super) struct Cell<'a> {
    pub(super) of: Type,
    pub(super) value: &'a Value,
    pub(super) encoding: Encoding,
}

impl Serialize for Cell<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let encoding = self.encoding;
        match (self.value, self.of) {
            (Value::Binary(value), _) if encoding == Encoding::Arrow => {
                serializer.serialize_bytes(value)
            }
            (Value::Time(value), _) if encoding == Encoding::Arrow => {
                serializer.serialize_i64(*value)
            }
            (Value::Bool(value), _) => serializer.serialize_bool(*value),
            (Value::Uint(value), _) => serializer.serialize_u64(*value),
            (Value::Float(value), _) => serializer.serialize_f32(*value),
            (Value::Text(value), _) => serializer.serialize_str(value),
            (Value::Binary(value), _) => serializer.serialize_str(&hex::encode(value)),
            (Value::Time(value), _) => timestamp(*value).serialize(serializer),
            (Value::List(values), Type::List(of)) => {
                let mut list = serializer.serialize_seq(Some(values.len()))?;
                for value in values {
                    list.serialize_element(&Cell {
                        of: *of,
                        value,
                        encoding,
                    })?;
                }
                list.end()
            }
            (Value::Struct(values), Type::Struct(fields)) => {
                let mut map = serializer.serialize_map(Some(values.len()))?;
                for ((name, of), value) in fields.iter().zip(values) {
                    map.serialize_entry(
                        name,
                        &Cell {
                            of: *of,
                            value,
                            encoding,
                        },
                    )?;
                }
                map.end()
            }
            (Value::Null | Value::List(_) | Value::Struct(_), _) => serializer.serialize_none(),
        }
    }
}

fn timestamp(microseconds: i64) -> chefshat_proto::Timestamp {
    chefshat_proto::Timestamp {
        seconds: microseconds.div_euclid(1_000_000),
        nanos: i32::try_from(microseconds.rem_euclid(1_000_000) * 1000)
            .expect("less than a second in nanoseconds"),
    }
}
