//! The files of a table: CSV, with lists and structs as JSON, JSON Lines, and Parquet (in
//! `parquet`).

use std::io::{self, Write as _};
use std::path::Path;

use chefshat_record::sheet;

use super::column::{Column, ColumnInfo, Value};
use super::files::{FileSummary, SummedFile};
use super::parquet::ParquetFile;
use super::row::{Cell, Encoding, Object, RowFile};

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
                Value::Text(text) => self.file.write_field(sheet::cell(text).as_bytes())?,
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
