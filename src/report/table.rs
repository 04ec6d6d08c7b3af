//! Small tables, printed as aligned text or serialized as an array of objects.

use std::fmt;

use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

/// Column of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Key in JSON: words in snake_case.
    pub key: &'static str,
    /// Title in text.
    pub title: &'static str,
    /// Unit, in brackets after the title; empty for none.
    pub unit: &'static str,
    /// Digits after the decimal point in text; JSON has all digits.
    pub decimals: usize,
}

/// Entry of a table. Numbers that are not finite print as `inf`, `-inf` or `nan` and are `null` in JSON.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text, aligned to the left of its column.
    Text(String),
    /// Whole number.
    Count(u64),
    /// Number with the column's digits.
    Number(f64),
    /// Missing value: `–` in text, `null` in JSON.
    Absent,
}

impl From<&str> for Cell {
    fn from(v: &str) -> Self {
        Cell::Text(v.to_owned())
    }
}

impl From<String> for Cell {
    fn from(v: String) -> Self {
        Cell::Text(v)
    }
}

impl From<u64> for Cell {
    fn from(v: u64) -> Self {
        Cell::Count(v)
    }
}

impl From<f64> for Cell {
    fn from(v: f64) -> Self {
        Cell::Number(v)
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(v: Option<T>) -> Self {
        v.map_or(Cell::Absent, Into::into)
    }
}

/// Rows under named columns. `Display` gives the text, `Serialize` an array with one object per row.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// Creates a table without rows.
    pub fn new(columns: impl Into<Vec<Column>>) -> Self {
        Table { columns: columns.into(), rows: vec![] }
    }

    /// Adds a row. Missing cells are absent; cells beyond the last column are dropped.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) -> &mut Self {
        let cells = cells.into_iter().chain(std::iter::repeat(Cell::Absent));
        self.rows.push(cells.take(self.columns.len()).collect());
        self
    }
}

impl Cell {
    fn text(&self, decimals: usize) -> String {
        match self {
            // A line break would break the table.
            Cell::Text(text) => text.replace(char::is_control, " "),
            Cell::Count(count) => count.to_string(),
            Cell::Number(v) if v.is_nan() => "nan".to_owned(),
            Cell::Number(v) => format!("{v:.decimals$}"),
            Cell::Absent => "–".to_owned(),
        }
    }
}

impl fmt::Display for Table {
    /// Writes a title line with units in brackets, a rule, and the rows. Columns are two spaces apart; text
    /// is aligned to the left, numbers to the right.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let header = self.columns.iter().map(|c| match c.unit {
            "" => c.title.to_owned(),
            unit => format!("{} [{unit}]", c.title),
        });
        let mut lines: Vec<Vec<String>> = vec![header.collect()];
        for row in &self.rows {
            lines.push(row.iter().zip(&self.columns).map(|(cell, c)| cell.text(c.decimals)).collect());
        }
        let width = |i: usize| lines.iter().map(|line| line[i].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let is_text = |i: usize| self.rows.iter().any(|row| matches!(row[i], Cell::Text(_)));
        let left: Vec<bool> = (0..self.columns.len()).map(is_text).collect();
        for (n, line) in lines.iter().enumerate() {
            let cells = line.iter().zip(&widths).zip(&left).map(|((cell, &width), left)| {
                if *left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
            });
            writeln!(f, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
            if n == 0 {
                let rule: Vec<String> = widths.iter().map(|w| "-".repeat(*w)).collect();
                writeln!(f, "{}", rule.join("  "))?;
            }
        }
        Ok(())
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Cell::Text(text) => serializer.serialize_str(text),
            Cell::Count(count) => serializer.serialize_u64(*count),
            Cell::Number(v) if v.is_finite() => serializer.serialize_f64(*v),
            Cell::Number(_) | Cell::Absent => serializer.serialize_none(),
        }
    }
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Row<'a>(&'a [Column], &'a [Cell]);
        impl Serialize for Row<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let mut map = serializer.serialize_map(Some(self.0.len()))?;
                for (column, cell) in self.0.iter().zip(self.1) {
                    map.serialize_entry(column.key, cell)?;
                }
                map.end()
            }
        }
        let mut rows = serializer.serialize_seq(Some(self.rows.len()))?;
        for row in &self.rows {
            rows.serialize_element(&Row(&self.columns, row))?;
        }
        rows.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Table {
        let mut table = Table::new([
            Column { key: "model", title: "model", unit: "", decimals: 0 },
            Column { key: "psnr_db", title: "PSNR", unit: "dB", decimals: 2 },
            Column { key: "gaussians", title: "Gaussians", unit: "", decimals: 0 },
        ]);
        table.row(["base".into(), 26.125.into(), 4000u64.into()]);
        table.row(["augmented".into(), f64::INFINITY.into(), None::<u64>.into()]);
        table
    }

    #[test]
    fn text_is_aligned_with_units_in_the_header() {
        let expected = "\
model      PSNR [dB]  Gaussians
---------  ---------  ---------
base           26.12       4000
augmented        inf          –
";
        assert_eq!(example().to_string(), expected);
    }

    #[test]
    fn json_is_one_object_per_row() {
        let expected = r#"[{"model":"base","psnr_db":26.125,"gaussians":4000},{"model":"augmented","psnr_db":null,"gaussians":null}]"#;
        assert_eq!(serde_json::to_string(&example()).unwrap(), expected);
    }

    #[test]
    fn short_and_long_rows_keep_the_shape() {
        let mut table = Table::new([Column { key: "a", title: "a", unit: "s", decimals: 1 }]);
        table.row([]);
        table.row([1.0.into(), 2.0.into()]);
        table.row([f64::NAN.into()]);
        assert_eq!(table.to_string(), "a [s]\n-----\n    –\n  1.0\n  nan\n");
        assert_eq!(Table::new([]).to_string(), "\n\n");
    }
}
