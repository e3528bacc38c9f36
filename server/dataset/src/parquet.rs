//! A table as a Parquet file: the columns' types as an Arrow schema, rows gathered into batches. Memory is bounded by the row group.

use std::io;
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_array::builder::{
    ArrayBuilder, BinaryBuilder, BooleanBuilder, Float32Builder, ListBuilder, StringBuilder,
    StructBuilder, TimestampMicrosecondBuilder, UInt8Builder, UInt16Builder, UInt32Builder,
    UInt64Builder, make_builder,
};
use arrow_schema::{DataType, Field, Fields, Schema, SchemaRef, TimeUnit};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;

use super::column::{ColumnInfo, Type, Value};
use super::files::{FileSummary, SummedFile};
use super::formats::RowFile;

/// Rows that are handed on at a time.
const BATCH_ROWS: usize = 2048;
/// Rows of a row group: what is held in memory at most.
const ROW_GROUP_ROWS: usize = 32 * 1024;

/// A Parquet file that takes rows.
pub(super) struct ParquetFile {
    writer: ArrowWriter<SummedFile>,
    schema: SchemaRef,
    columns: Vec<(Type, Box<dyn ArrayBuilder>)>,
    rows: usize,
}

impl ParquetFile {
    pub(super) fn new(file: SummedFile, columns: &[ColumnInfo]) -> io::Result<Self> {
        let fields: Fields = columns
            .iter()
            .map(|column| Field::new(column.name, data_type(column.of), true))
            .collect();
        let schema = Arc::new(Schema::new(fields));
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
            .build();
        Ok(Self {
            writer: ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties))?,
            columns: columns
                .iter()
                .map(|column| (column.of, make_builder(&data_type(column.of), BATCH_ROWS)))
                .collect(),
            schema,
            rows: 0,
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        let arrays = self
            .columns
            .iter_mut()
            .map(|(_, builder)| builder.finish())
            .collect();
        let batch =
            RecordBatch::try_new(Arc::clone(&self.schema), arrays).map_err(io::Error::other)?;
        self.rows = 0;
        Ok(self.writer.write(&batch)?)
    }
}

impl RowFile for ParquetFile {
    fn write(&mut self, row: &[Value]) -> io::Result<()> {
        for ((of, builder), value) in self.columns.iter_mut().zip(row) {
            append(builder.as_mut(), *of, value);
        }
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

fn append(builder: &mut dyn ArrayBuilder, of: Type, value: &Value) {
    match of {
        Type::Bool => {
            let value = match value {
                Value::Bool(value) => Some(*value),
                _ => None,
            };
            of_kind::<BooleanBuilder>(builder).append_option(value);
        }
        Type::Uint8 => of_kind::<UInt8Builder>(builder).append_option(small(value)),
        Type::Uint16 => of_kind::<UInt16Builder>(builder).append_option(small(value)),
        Type::Uint32 => of_kind::<UInt32Builder>(builder).append_option(small(value)),
        Type::Uint64 => of_kind::<UInt64Builder>(builder).append_option(small(value)),
        Type::Float32 => {
            let value = match value {
                Value::Float(value) => Some(*value),
                _ => None,
            };
            of_kind::<Float32Builder>(builder).append_option(value);
        }
        Type::Text => {
            let value = match value {
                Value::Text(value) => Some(value),
                _ => None,
            };
            of_kind::<StringBuilder>(builder).append_option(value);
        }
        Type::Binary => {
            let value = match value {
                Value::Binary(value) => Some(value),
                _ => None,
            };
            of_kind::<BinaryBuilder>(builder).append_option(value);
        }
        Type::Time => {
            let value = match value {
                Value::Time(value) => Some(*value),
                _ => None,
            };
            of_kind::<TimestampMicrosecondBuilder>(builder).append_option(value);
        }
        Type::List(of) => {
            let builder = of_kind::<ListBuilder<Box<dyn ArrayBuilder>>>(builder);
            if let Value::List(values) = value {
                for value in values {
                    append(builder.values().as_mut(), *of, value);
                }
            }
            builder.append(matches!(value, Value::List(_)));
        }
        Type::Struct(fields) => {
            let builder = of_kind::<StructBuilder>(builder);
            let values: &[Value] = match value {
                Value::Struct(values) => values,
                _ => &[],
            };
            for (index, field) in builder.field_builders_mut().iter_mut().enumerate() {
                let value = values.get(index).unwrap_or(&Value::Null);
                append(field.as_mut(), fields[index].1, value);
            }
            builder.append(matches!(value, Value::Struct(_)));
        }
    }
}

/// The builder as the kind that its type has.
fn of_kind<B: ArrayBuilder>(builder: &mut dyn ArrayBuilder) -> &mut B {
    builder
        .as_any_mut()
        .downcast_mut()
        .expect("a builder is made for its column's type")
}

/// An integer in the width of its column; null if it has none, which no table's column allows to happen.
fn small<T: TryFrom<u64>>(value: &Value) -> Option<T> {
    match value {
        Value::Uint(value) => T::try_from(*value).ok(),
        _ => None,
    }
}
