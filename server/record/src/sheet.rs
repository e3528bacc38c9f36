//! Cells of CSV files that people open in spreadsheets. Every writer of CSV passes its texts through
//! [`cell`].

use std::borrow::Cow;

/// What makes a spreadsheet read a text as a formula. It drops blank characters at the start first.
const FORMULA: [char; 7] = ['=', '+', '-', '@', '\t', '\r', '\n'];

/// The text of a cell. One that a spreadsheet would execute gets a leading apostrophe.
pub fn cell(text: &str) -> Cow<'_, str> {
    match text.starts_with(FORMULA) && text.parse::<f64>().is_err() {
        true => Cow::Owned(format!("'{text}")),
        false => Cow::Borrowed(text),
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;

    #[test]
    fn no_cell_is_a_formula() {
        for (text, expected) in [
            ("plain", "plain"),
            ("", ""),
            ("-3", "-3"),
            ("-0.5e3", "-0.5e3"),
            ("=1+2", "'=1+2"),
            ("-cmd", "'-cmd"),
            ("+1 2", "'+1 2"),
            ("@a,b", "'@a,b"),
            ("\t=1+2", "'\t=1+2"),
            ("\r=1+2", "'\r=1+2"),
            ("\n=1+2", "'\n=1+2"),
        ] {
            assert_eq!(cell(text), expected, "{text:?}");
        }
    }

    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                sources(&path, found);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                found.push(path);
            }
        }
    }

    #[test]
    fn every_writer_of_csv_uses_it() {
        let mut files = Vec::new();
        sources(
            &Path::new(env!("CARGO_MANIFEST_DIR")).join(".."),
            &mut files,
        );
        let (mut writers, mut unsafe_ones) = (0, Vec::new());
        for path in files {
            let text = std::fs::read_to_string(&path).expect("a source");
            let program = text.split("#[cfg(test)]").next().unwrap_or_default();
            let writes = ["csv::Writer", "WriterBuilder"]
                .into_iter()
                .any(|word| program.contains(word));
            if writes && !path.components().any(|part| part.as_os_str() == "tests") {
                writers += 1;
                if !program.contains("sheet::cell") {
                    unsafe_ones.push(path);
                }
            }
        }
        assert!(writers >= 5, "the writers are found: {writers}");
        assert!(unsafe_ones.is_empty(), "{unsafe_ones:?}");
    }
}
