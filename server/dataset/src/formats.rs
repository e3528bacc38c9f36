//! The files of a table: CSV, with lists and structs as JSON, JSON Lines, and Parquet (in
//! `parquet`).

use std::io::{self, Write as _};
use std::path::Path;

use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

use super::column::{Column, ColumnInfo, Type, Value};
use super::files::{FileSummary, SummedFile};
use super::parquet::ParquetFile;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// Apache Parquet, compressed with zstd.
    Parquet,
    /// JSON Lines: one object per line.
    Jsonl,
    /// Comma-separated values with a header.
    Csv,
}

impl Format {
    /// All formats, the preferred one first.
    pub const ALL: [Format; 3] = [Format::Parquet, Format::Jsonl, Format::Csv];

    /// Its name and file extension.
    pub const fn name(self) -> &'static str {
        match self {
            Format::Parquet => "parquet",
            Format::Jsonl => "jsonl",
            Format::Csv => "csv",
        }
    }

    /// The format with this name.
    pub fn from_name(name: &str) -> Option<Format> {
        Format::ALL.into_iter().find(|format| format.name() == name)
    }
}

/// A file of rows.
pub(super) trait RowFile {
    /// Adds a row, one value per column.
    fn write(&mut self, row: &[Value]) -> io::Result<()>;
    /// Completes the file.
    fn finish(self: Box<Self>) -> io::Result<FileSummary>;
}

/// A table being written in several formats.
pub(super) struct Table<R: 'static> {
    columns: &'static [Column<R>],
    files: Vec<Box<dyn RowFile>>,
}

impl<R> Table<R> {
    /// Creates the files in `folder`.
    pub(super) fn create(
        folder: &Path,
        name: &str,
        columns: &'static [Column<R>],
        formats: &[Format],
    ) -> io::Result<Self> {
        let infos: Vec<ColumnInfo> = columns.iter().map(Column::info).collect();
        let files = formats
            .iter()
            .map(|format| {
                let file = SummedFile::create(folder, &file_name(name, *format))?;
                Ok(match format {
                    Format::Parquet => {
                        Box::new(ParquetFile::new(file, infos.clone())?) as Box<dyn RowFile>
                    }
                    Format::Jsonl => Box::new(JsonlFile::new(file, infos.clone())),
                    Format::Csv => Box::new(CsvFile::new(file, infos.clone())?),
                })
            })
            .collect::<io::Result<_>>()?;
        Ok(Self { columns, files })
    }

    pub(super) fn write(&mut self, rows: &[R]) -> io::Result<()> {
        for row in rows {
            let cells: Vec<Value> = self
                .columns
                .iter()
                .map(|column| (column.value)(row))
                .collect();
            for file in &mut self.files {
                file.write(&cells)?;
            }
        }
        Ok(())
    }

    pub(super) fn finish(self) -> io::Result<Vec<FileSummary>> {
        self.files.into_iter().map(RowFile::finish).collect()
    }
}

/// The name of a table's file.
pub(super) fn file_name(table: &str, format: Format) -> String {
    format!("{table}.{}", format.name())
}

struct JsonlFile {
    file: SummedFile,
    columns: Vec<ColumnInfo>,
}

impl JsonlFile {
    fn new(file: SummedFile, columns: Vec<ColumnInfo>) -> Self {
        Self { file, columns }
    }
}

impl RowFile for JsonlFile {
    fn write(&mut self, row: &[Value]) -> io::Result<()> {
        let object = Object {
            columns: &self.columns,
            row,
            encoding: Encoding::Text,
        };
        serde_json::to_writer(&mut self.file, &object)?;
        self.file.write_all(b"\n")
    }

    fn finish(self: Box<Self>) -> io::Result<FileSummary> {
        self.file.finish()
    }
}

struct CsvFile {
    file: csv::Writer<SummedFile>,
    columns: Vec<ColumnInfo>,
}

impl CsvFile {
    fn new(file: SummedFile, columns: Vec<ColumnInfo>) -> io::Result<Self> {
        let mut file = csv::Writer::from_writer(file);
        file.write_record(columns.iter().map(|column| column.name))?;
        Ok(Self { file, columns })
    }
}

impl RowFile for CsvFile {
    fn write(&mut self, row: &[Value]) -> io::Result<()> {
        for (column, value) in self.columns.iter().zip(row) {
            let cell = Cell {
                of: column.of,
                value,
                encoding: Encoding::Text,
            };
            match value {
                Value::Null => self.file.write_field("")?,
                Value::Text(text) => self.file.write_field(text)?,
                Value::Binary(_) | Value::Time(_) => {
                    // As in JSON, without the quotes.
                    let json = serde_json::to_string(&cell)?;
                    self.file.write_field(json.trim_matches('"'))?;
                }
                _ => self.file.write_field(serde_json::to_vec(&cell)?)?,
            }
        }
        Ok(self.file.write_record(None::<&[u8]>)?)
    }

    fn finish(self: Box<Self>) -> io::Result<FileSummary> {
        self.file
            .into_inner()
            .map_err(csv::IntoInnerError::into_error)?
            .finish()
    }
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
struct Cell<'a> {
    of: Type,
    value: &'a Value,
    encoding: Encoding,
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
