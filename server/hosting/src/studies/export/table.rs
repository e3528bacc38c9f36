//! Tables of the exported data. A column is one value: its name, what it means, what its cells hold
//! and how they are read from a row. So the files, `codebook.csv` and `datapackage.json` agree.

use chefshat_record::sheet;
use serde_json::{Value, json};

/// What the cells of a column hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    /// Any text.
    Text,
    /// An integer, in this unit; empty for a count or a number of something.
    Integer(&'static str),
    /// `true` or `false`.
    Boolean,
    /// One of these codes, or several separated by spaces.
    Codes { codes: Vec<Code>, several: bool },
}

impl Kind {
    /// One of these codes.
    pub(super) fn one_of(codes: impl IntoIterator<Item = Code>) -> Self {
        Self::Codes {
            codes: codes.into_iter().collect(),
            several: false,
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Text => "string",
            Self::Integer(_) => "integer",
            Self::Boolean => "boolean",
            Self::Codes { several: false, .. } => "code",
            Self::Codes { several: true, .. } => "codes",
        }
    }

    /// Whether a cell that is not empty is one of this kind.
    fn has(&self, cell: &str) -> bool {
        match self {
            Self::Text => true,
            Self::Integer(_) => cell.parse::<i128>().is_ok(),
            Self::Boolean => matches!(cell, "true" | "false"),
            Self::Codes { codes, several } => {
                let is_code = |word: &str| codes.iter().any(|code| code.code == word);
                match several {
                    false => is_code(cell),
                    true => cell.split(' ').all(is_code),
                }
            }
        }
    }
}

/// A code of a column and what it means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Code {
    pub(super) code: String,
    /// Empty: the code says it.
    pub(super) label: String,
}

impl Code {
    pub(super) fn new(code: impl Into<String>, label: impl Into<String>) -> Self {
        let (code, label) = (code.into(), label.into());
        Self { code, label }
    }
}

/// What a column is.
#[derive(Debug, Clone)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) meaning: &'static str,
    pub(super) kind: Kind,
    /// When a cell is empty; `None`: never.
    pub(super) missing: Option<&'static str>,
}

impl Column {
    /// Whether this can be one of its cells.
    fn has(&self, cell: &str) -> bool {
        match cell.is_empty() {
            true => self.missing.is_some(),
            false => self.kind.has(cell),
        }
    }

    /// The unit of its cells, or empty.
    pub(super) fn unit(&self) -> &'static str {
        match self.kind {
            Kind::Integer(unit) => unit,
            _ => "",
        }
    }

    /// The name of its kind.
    pub(super) fn kind(&self) -> &'static str {
        self.kind.name()
    }

    /// Its codes, each with what it means.
    pub(super) fn codes(&self) -> String {
        let Kind::Codes { codes, .. } = &self.kind else {
            return String::new();
        };
        let codes = codes
            .iter()
            .map(|Code { code, label }| match label.is_empty() {
                true => code.clone(),
                false => format!("{code} = {label}"),
            });
        codes.collect::<Vec<_>>().join("; ")
    }

    /// The column as a field of a Table Schema.
    fn field(&self) -> Value {
        let mut constraints = json!({"required": self.missing.is_none()});
        let mut field = json!({"name": self.name, "description": self.meaning});
        let kind = match &self.kind {
            Kind::Codes {
                codes,
                several: false,
            } => {
                let categories = codes.iter().map(|Code { code, label }| {
                    let label = if label.is_empty() { code } else { label };
                    json!({"value": sheet::cell(code), "label": label})
                });
                field["categories"] = categories.collect();
                constraints["enum"] = codes
                    .iter()
                    .map(|it| json!(sheet::cell(&it.code)))
                    .collect();
                "string"
            }
            Kind::Codes { .. } => "string",
            kind => kind.name(),
        };
        field["type"] = json!(kind);
        if !self.unit().is_empty() {
            field["unit"] = json!(self.unit());
        }
        if let Some(missing) = self.missing {
            field["empty"] = json!(missing);
        }
        field["constraints"] = constraints;
        field
    }
}

/// What a table is, without its rows.
#[derive(Debug, Clone)]
pub(super) struct Sheet {
    /// Name of its file.
    pub(super) file: &'static str,
    /// What its rows are.
    pub(super) rows: &'static str,
    /// The columns that identify a row; empty if none do.
    pub(super) key: &'static [&'static str],
    pub(super) columns: Vec<Column>,
}

impl Sheet {
    /// The sheet as a resource of a Data Package.
    fn resource(&self) -> Value {
        let fields: Vec<Value> = self.columns.iter().map(Column::field).collect();
        let mut schema = json!({"fields": fields, "missingValues": [""]});
        if !self.key.is_empty() {
            schema["primaryKey"] = json!(self.key);
        }
        json!({
            "name": self.file.trim_end_matches(".csv"),
            "type": "table",
            "path": self.file,
            "description": self.rows,
            "format": "csv",
            "mediatype": "text/csv",
            "encoding": "utf-8",
            "schema": schema,
        })
    }
}

/// The descriptor of these tables as a Data Package, version 2
/// (<https://datapackage.org/standard/data-package/>).
pub(super) fn descriptor(name: &str, title: &str, sheets: &[Sheet]) -> Value {
    json!({
        "$schema": "https://datapackage.org/profiles/2.0/datapackage.json",
        "name": name,
        "title": title,
        "resources": sheets.iter().map(Sheet::resource).collect::<Vec<_>>(),
    })
}

type Cell<R> = Box<dyn Fn(&R) -> String + Send + Sync>;

/// A table whose rows are made of values of the type `R`.
pub(super) struct Table<R> {
    sheet: Sheet,
    /// As many as columns.
    cells: Vec<Cell<R>>,
}

impl<R> Table<R> {
    pub(super) fn new(
        file: &'static str,
        rows: &'static str,
        key: &'static [&'static str],
    ) -> Self {
        let columns = Vec::new();
        Self {
            sheet: Sheet {
                file,
                rows,
                key,
                columns,
            },
            cells: Vec::new(),
        }
    }

    /// Adds a column whose cells are never empty.
    pub(super) fn with(
        mut self,
        name: impl Into<String>,
        kind: Kind,
        meaning: &'static str,
        cell: impl Fn(&R) -> String + Send + Sync + 'static,
    ) -> Self {
        self.sheet.columns.push(Column {
            name: name.into(),
            meaning,
            kind,
            missing: None,
        });
        self.cells.push(Box::new(cell));
        self
    }

    /// Says when cells of the column added last are empty.
    pub(super) fn empty(mut self, when: &'static str) -> Self {
        let last = self.sheet.columns.last_mut();
        last.expect("a column was added").missing = Some(when);
        self
    }

    pub(super) fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    pub(super) fn into_sheet(self) -> Sheet {
        self.sheet
    }

    /// The cells of its first line.
    pub(super) fn header(&self) -> impl Iterator<Item = &str> {
        self.sheet.columns.iter().map(|column| column.name.as_str())
    }

    /// The cells of a row.
    pub(super) fn cells(&self, row: &R) -> impl Iterator<Item = String> {
        let columns = self.sheet.columns.iter().zip(&self.cells);
        columns.map(|(column, cell)| {
            let cell = cell(row);
            let (name, file) = (&column.name, self.sheet.file);
            debug_assert!(
                column.has(&cell),
                "{cell:?} is not a valid {name} of {file}"
            );
            cell
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(kind: Kind, missing: Option<&'static str>) -> Column {
        Column {
            name: "column".to_owned(),
            meaning: "what it means",
            kind,
            missing,
        }
    }

    #[test]
    fn a_column_has_cells_of_its_kind_alone() {
        let codes = || vec![Code::new("a", "the first"), Code::new("-b", "")];
        let several = Kind::Codes {
            codes: codes(),
            several: true,
        };
        for (kind, cells, others) in [
            (Kind::Text, vec!["word", "3"], vec![]),
            (Kind::Integer("ms"), vec!["3", "-3"], vec!["3.5", "three"]),
            (Kind::Boolean, vec!["true", "false"], vec!["1", "True"]),
            (Kind::one_of(codes()), vec!["a", "-b"], vec!["a -b", "c"]),
            (several, vec!["a", "a -b"], vec!["a c", "a  a"]),
        ] {
            let required = column(kind, None);
            let has = |cell: &&str| required.has(cell);
            assert!(cells.iter().all(has), "{required:?}");
            assert!(!others.iter().any(has), "{required:?}");
            assert!(!required.has(""));
            assert!(column(required.kind, Some("sometimes")).has(""));
        }
    }

    #[test]
    fn a_descriptor_has_codes_as_they_stand_in_cells() {
        let codes = [Code::new("a", "the first"), Code::new("-b", "")];
        let column = column(Kind::one_of(codes), Some("sometimes"));
        assert_eq!(column.codes(), "a = the first; -b");
        let field = column.field();
        assert_eq!(field["constraints"]["enum"], json!(["a", "'-b"]));
        assert_eq!(field["constraints"]["required"], json!(false));
        let categories =
            json!([{"value": "a", "label": "the first"}, {"value": "'-b", "label": "-b"}]);
        assert_eq!(field["categories"], categories);
    }
}
