//! Tables in `docs/` that a command measures, writes and checks.

use std::fs;

use crate::Outcome;
use crate::command::root;

/// A table in a document, between the comments `<!-- NAME -->` and `<!-- end of NAME -->`.
pub struct Table {
    /// Path from the root of the workspace.
    pub file: &'static str,
    pub name: &'static str,
}

impl Table {
    /// What is between the comments.
    pub fn read(&self) -> Result<String, String> {
        let document = self.document()?;
        let (_, table, _) = self.cut(&document)?;
        Ok(table.to_owned())
    }

    /// Replaces it.
    pub fn write(&self, table: &str) -> Outcome {
        let document = self.document()?;
        let (before, _, after) = self.cut(&document)?;
        let file = root().join(self.file);
        fs::write(&file, format!("{before}{table}{after}")).map_err(|error| format!("{}: {error}", self.file))
    }

    fn document(&self) -> Result<String, String> {
        fs::read_to_string(root().join(self.file)).map_err(|error| format!("{}: {error}", self.file))
    }

    fn cut<'d>(&self, document: &'d str) -> Result<(&'d str, &'d str, &'d str), String> {
        let find = |comment: String| {
            let at = document.find(&comment).map(|at| (at, at + comment.len()));
            at.ok_or_else(|| format!("{} has no line {comment}", self.file))
        };
        let (_, start) = find(format!("<!-- {} -->\n", self.name))?;
        let (end, _) = find(format!("<!-- end of {} -->", self.name))?;
        match (document.get(..start), document.get(start..end), document.get(end..)) {
            (Some(before), Some(table), Some(after)) => Ok((before, table, after)),
            _ => Err(format!("{}: the table '{}' ends before it starts", self.file, self.name)),
        }
    }
}

/// The cells of a row whose first cell is `name`, in a table in Markdown.
pub fn row<'t>(table: &'t str, name: &str) -> Option<Vec<&'t str>> {
    table.lines().find_map(|line| {
        let line = line.trim().strip_prefix('|')?.strip_suffix('|')?;
        let mut cells = line.split('|').map(str::trim);
        (cells.next()? == name).then(|| cells.collect())
    })
}

/// A number with commas between the thousands.
pub fn figure(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (at, digit) in digits.chars().enumerate() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// What [`figure`] has written.
pub fn value(figure: &str) -> Option<u64> {
    figure.replace(',', "").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: Table = Table { file: "x.md", name: "size" };
    const DOCUMENT: &str = "text\n<!-- size -->\n| a | 1 |\n| bc | 2,000 |\n<!-- end of size -->\nmore\n";

    #[test]
    fn a_table_is_cut_out_and_its_rows_are_found() {
        let (before, table, after) = TABLE.cut(DOCUMENT).expect("a table");
        assert_eq!(format!("{before}{table}{after}"), DOCUMENT);
        assert_eq!(row(table, "bc"), Some(vec!["2,000"]));
        assert_eq!(row(table, "b"), None);
        assert!(TABLE.cut("<!-- size -->\n").is_err());
        assert!(TABLE.cut("<!-- end of size --><!-- size -->\n").is_err());
    }

    #[test]
    fn figures_are_read_as_they_are_written() {
        for (number, text) in [(0, "0"), (999, "999"), (1000, "1,000"), (1_234_567, "1,234,567")] {
            assert_eq!(figure(number), text);
            assert_eq!(value(text), Some(number));
        }
    }
}
