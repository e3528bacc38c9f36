//! Records as datasets: two typed tables, one row for each decision and one for each expression, as Parquet, CSV and JSON Lines with a
//! dataset card; or the columns of the older reference implementation. Reading command lines and showing progress is the server's.

mod card;
mod chefshatgym;
mod column;
mod decisions;
mod earlier;
mod export;
mod expressions;
mod files;
mod folder;
mod formats;
mod game;
mod gather;
mod parquet;
mod python;
mod sheet;

pub use column::{ColumnInfo, Type, markdown};
pub use export::{Export, ExportError, Exported, Filter, Layout, LeftOut};
pub use files::FileSummary;
pub use folder::FolderError;
pub use formats::Format;

/// Version of the tables' columns. It grows when a column changes its meaning or type, or goes; new columns at the end do not change it.
pub const TABLES_VERSION: u32 = 1;

/// Names, types and descriptions of the columns of the table of decisions.
pub fn decision_columns() -> Vec<ColumnInfo> {
    decisions::columns()
}

/// Names, types and descriptions of the columns of the table of expressions.
pub fn expression_columns() -> Vec<ColumnInfo> {
    expressions::columns()
}
