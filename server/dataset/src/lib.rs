//! Datasets from records: typed tables of decisions, expressions, markers and samples as Parquet, CSV and JSON Lines
//! with a dataset card, or the columns of the reference implementation.

mod card;
mod chefshatgym;
mod column;
mod decisions;
mod export;
mod expressions;
mod files;
mod folder;
mod formats;
mod game;
mod gather;
mod markers;
mod parquet;
mod python;
mod row;
mod run;
mod samples;
mod sheet;

pub use column::{ColumnInfo, Type, markdown};
pub use export::{Export, Exported, Filter, Layout, Skipped};
pub use files::FileSummary;
pub use folder::FolderError;
pub use formats::Format;
pub use run::ExportError;

/// Version of the tables. Incremented when a column changes its meaning or type or is removed, not
/// when one is added at the end.
pub const TABLES_VERSION: u32 = 1;

/// The columns of the table of decisions.
pub fn decision_columns() -> Vec<ColumnInfo> {
    decisions::columns()
}

/// The columns of the table of expressions.
pub fn expression_columns() -> Vec<ColumnInfo> {
    expressions::columns()
}

/// The columns of the table of markers.
pub fn marker_columns() -> Vec<ColumnInfo> {
    markers::columns()
}

/// The columns of the table of samples.
pub fn sample_columns() -> Vec<ColumnInfo> {
    samples::columns()
}
