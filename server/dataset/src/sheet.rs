//! The CSV file of a game in the columns of the reference implementation.

use std::io;

use chefshat_record::sheet;

use super::files::{FileSummary, SummedFile};

/// Name of the file.
pub(super) const FILE_NAME: &str = "Dataset.pkl.csv";

type Cell = fn(&Row) -> &str;

/// The columns in order.
const COLUMNS: [(&str, Cell); 15] = [
    ("Match", |row| &row.shift),
    ("Round", |row| &row.pizza),
    ("Agent_Names", |row| &row.names),
    ("Source", |row| &row.source),
    ("Action_Type", |row| row.action),
    ("Action_Description", |row| &row.description),
    ("Player_Finished", |row| row.finished),
    ("Player_Hands", |row| &row.hands),
    ("Board_Before", |row| &row.board_before),
    ("Board_After", |row| &row.board_after),
    ("Possible_Actions", |row| &row.possible),
    ("Current_Roles", |row| &row.roles),
    ("Match_Score", |row| &row.shift_score),
    ("Game_Score", |row| &row.game_score),
    ("Game_Performance_Score", |row| &row.performance),
];

/// A row; an empty cell is the reference's NaN.
#[derive(Default)]
pub(super) struct Row {
    pub(super) shift: String,
    pub(super) pizza: String,
    pub(super) names: String,
    pub(super) source: String,
    pub(super) action: &'static str,
    pub(super) description: String,
    pub(super) finished: &'static str,
    pub(super) hands: String,
    pub(super) board_before: String,
    pub(super) board_after: String,
    pub(super) possible: String,
    pub(super) roles: String,
    pub(super) shift_score: String,
    pub(super) game_score: String,
    pub(super) performance: String,
}

/// The rows of one game.
pub(super) struct Sheet {
    pub(super) rows: Vec<Row>,
    /// The number of decisions in the game, of all kinds.
    pub(super) decisions: u64,
}

impl Sheet {
    /// Writes the file.
    pub(super) fn write(&self, file: SummedFile) -> io::Result<FileSummary> {
        let mut csv = csv::Writer::from_writer(file);
        csv.write_record(COLUMNS.map(|(name, _)| name))?;
        for row in &self.rows {
            csv.write_record(COLUMNS.map(|(_, text)| sheet::cell(text(row)).into_owned()))?;
        }
        csv.into_inner()
            .map_err(csv::IntoInnerError::into_error)?
            .finish()
    }
}
