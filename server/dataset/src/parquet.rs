//! A table as a Parquet file. Rows are written in batches; memory is bounded by the row group.

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
/// Rows per row group, the most held in memory.
const ROW_GROUP_ROWS: usize = 32 * 1024;

/// A Parquet file being written.
pub(super) struct ParquetFile {
    writer: ArrowWriter<SummedFile>,
    columns: Vec<ColumnInfo>,
    batch: ArrayBuilder,
    rows: usize,
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
            .build();
        let batch = ArrayBuilder::from_arrow(&fields).map_err(io::Error::other)?;
        let schema = Arc::new(Schema::new(fields));
        Ok(Self {
            writer: ArrowWriter::try_new(file, schema, Some(properties))?,
            columns,
            batch,
            rows: 0,
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        let batch = self.batch.to_record_batch().map_err(io::Error::other)?;
        self.rows = 0;
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
        if self.rows == BATCH_ROWS {
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
