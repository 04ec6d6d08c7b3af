//! Small tables, printed as aligned text.

use std::fmt;

/// Column of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Title.
    pub title: &'static str,
    /// Unit, in brackets after the title; empty for none.
    pub unit: &'static str,
    /// Digits after the decimal point.
    pub decimals: usize,
}

impl Column {
    /// A column with this title, unit and number of digits.
    pub const fn new(title: &'static str, unit: &'static str, decimals: usize) -> Self {
        Column { title, unit, decimals }
    }
}

/// Entry of a table. Numbers that are not finite print as `inf`, `-inf` or `nan`.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text, aligned to the left of its column.
    Text(String),
    /// Whole number.
    Count(u64),
    /// Number with the column's digits.
    Number(f64),
    /// Missing value: `–`.
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

/// Rows under named columns.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Table {
        let mut table =
            Table::new([Column::new("model", "", 0), Column::new("PSNR", "dB", 2), Column::new("Gaussians", "", 0)]);
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
    fn short_and_long_rows_keep_the_shape() {
        let mut table = Table::new([Column::new("a", "s", 1)]);
        table.row([]);
        table.row([1.0.into(), 2.0.into()]);
        table.row([f64::NAN.into()]);
        assert_eq!(table.to_string(), "a [s]\n-----\n    –\n  1.0\n  nan\n");
        assert_eq!(Table::new([]).to_string(), "\n\n");
    }
}
