//! A table as a Parquet file. Rows are written in batches; memory is bounded by the batch and the row
//! group, which end early where texts are long: those of a record may be.

use std::io;
use std::sync::Arc;

use arrow_schema::{DataType, Field, FieldRef, Schema, TimeUnit};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use serde_arrow::ArrayBuilder;

use super::column::{ColumnInfo, Type, Value};
use super::files::{FileSummary, SummedFile};
use super::row::{Encoding, Object, RowFile};

/// Rows per batch.
const BATCH_ROWS: usize = 2048;
/// Bytes of texts after which a batch ends.
const BATCH_BYTES: usize = 16 << 20;
/// Rows per row group, the most held in memory.
const ROW_GROUP_ROWS: usize = 32 * 1024;
/// Encoded bytes of the largest row group, roughly.
const ROW_GROUP_BYTES: usize = 64 << 20;

/// A Parquet file being written.
pub(super) struct ParquetFile {
    writer: ArrowWriter<SummedFile>,
    columns: Vec<ColumnInfo>,
    batch: ArrayBuilder,
    rows: usize,
    bytes: usize,
}

impl ParquetFile {
    pub(super) fn new(file: SummedFile, columns: Vec<ColumnInfo>) -> io::Result<Self> {
        let fields: Vec<FieldRef> = columns
            .iter()
            .map(|column| Arc::new(Field::new(column.name, data_type(column.of), true)))
            .collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
            .set_max_row_group_bytes(Some(ROW_GROUP_BYTES))
            .build();
        let batch = ArrayBuilder::from_arrow(&fields).map_err(io::Error::other)?;
        let schema = Arc::new(Schema::new(fields));
        Ok(Self {
            writer: ArrowWriter::try_new(file, schema, Some(properties))?,
            columns,
            batch,
            rows: 0,
            bytes: 0,
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        let batch = self.batch.to_record_batch().map_err(io::Error::other)?;
        (self.rows, self.bytes) = (0, 0);
        Ok(self.writer.write(&batch)?)
    }
}

impl RowFile for ParquetFile {
    fn write(&mut self, row: &[Value]) -> io::Result<()> {
        let object = Object {
            columns: &self.columns,
            row,
            encoding: Encoding::Arrow,
        };
        self.batch.push(&object).map_err(io::Error::other)?;
        self.rows += 1;
        self.bytes += row.iter().map(text_bytes).sum::<usize>();
        if self.rows == BATCH_ROWS || self.bytes >= BATCH_BYTES {
            self.flush()?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<FileSummary> {
        if self.rows > 0 {
            self.flush()?;
        }
        self.writer.into_inner()?.finish()
    }
}

/// Bytes of a text; other values are short.
fn text_bytes(value: &Value) -> usize {
    match value {
        Value::Text(text) => text.len(),
        _ => 0,
    }
}

fn data_type(of: Type) -> DataType {
    match of {
        Type::Bool => DataType::Boolean,
        Type::Uint8 => DataType::UInt8,
        Type::Uint16 => DataType::UInt16,
        Type::Uint32 => DataType::UInt32,
        Type::Uint64 => DataType::UInt64,
        Type::Float32 => DataType::Float32,
        Type::Text => DataType::Utf8,
        Type::Binary => DataType::Binary,
        Type::Time => DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into())),
        Type::List(of) => DataType::List(Arc::new(Field::new_list_field(data_type(*of), true))),
        Type::Struct(fields) => DataType::Struct(
            fields
                .iter()
                .map(|(name, of)| Field::new(*name, data_type(*of), true))
                .collect(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_end_a_batch() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = SummedFile::create(folder.path(), "a.parquet").expect("a file");
        let column = ColumnInfo {
            name: "room_name",
            of: Type::Text,
            about: "",
        };
        let mut file = ParquetFile::new(file, vec![column]).expect("a table");
        let row = [Value::Text("a".repeat(BATCH_BYTES / 8))];
        for rows in (1..8).chain([0, 1]) {
            file.write(&row).expect("written");
            assert_eq!(file.rows, rows);
        }
        Box::new(file).finish().expect("complete");
    }
}
