//! `frames.csv`: time, temperature and further quantities of every frame.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use depthcal_model::{MOST_QUANTITIES, Quantities, Quantity};
use serde::{Deserialize, Serialize};

use super::error::DatasetError;

/// The row of a frame in the dataset's table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FrameMetadata {
    /// Time of the capture, s, from an origin common to all frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timestamp_s: Option<f64>,
    /// Temperature of the camera, °C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// The text of further columns by name; empty cells are left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub other: BTreeMap<String, String>,
    /// Further columns that are no quantities, although their names end in a unit.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub no_quantities: BTreeSet<String>,
}

impl FrameMetadata {
    /// The value of a further column when it is a finite number.
    pub fn number(&self, column: &str) -> Option<f64> {
        self.other.get(column)?.parse().ok().filter(|number: &f64| number.is_finite())
    }

    /// The values of the further columns whose names end in a unit, such as `exposure_ms`.
    pub fn quantities(&self) -> Quantities {
        let columns = self.other.keys().filter(|column| !self.no_quantities.contains(*column));
        Quantities::new(columns.filter_map(|column| Some((Quantity::named(column)?, self.number(column)?))))
    }
}

/// A row of the table.
pub(crate) struct Row {
    /// Line in the table, from 1.
    pub line: u64,
    pub frame: String,
    /// The files that it names, by their columns.
    pub files: BTreeMap<String, String>,
    pub metadata: FrameMetadata,
}

/// The rows of a table.
pub(crate) struct FrameTable {
    pub rows: Vec<Row>,
    /// Its columns of files.
    pub files: BTreeSet<String>,
}

/// Reads a table with the columns `frame` (required), `timestamp_s`, `temperature_c`, those of `files`, which name files, and any
/// others.
pub(crate) fn read(path: &Path, files: &[String]) -> Result<FrameTable, DatasetError> {
    let file = File::open(path).map_err(|error| DatasetError::Read { path: path.to_owned(), error })?;
    parse(path, io::BufReader::new(file), files)
}

fn parse(path: &Path, reader: impl io::Read, files: &[String]) -> Result<FrameTable, DatasetError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(reader);
    let head = reader.headers().map_err(|error| csv_error(path, error))?.clone();
    let fault = |problem: String| DatasetError::Table { path: path.to_owned(), line: 1, problem };
    let mut seen = BTreeSet::new();
    for name in &head {
        if !seen.insert(name) {
            return Err(fault(format!("there are two columns `{name}`: rename or remove one")));
        }
    }
    let Some(frame_column) = head.iter().position(|name| name == "frame") else {
        // The only column is the whole line where another separator is used.
        let separators = [(';', "semicolons"), ('\t', "tabs")];
        let other = separators
            .into_iter()
            .find(|(separator, _)| head.len() == 1 && head[0].split(*separator).any(|name| name.trim() == "frame"));
        let problem = match other {
            Some((_, name)) => {
                format!("the columns are separated by {name}: write commas instead, and points in decimal numbers")
            }
            None => "there is no column `frame`: start the table with a line such as frame,timestamp_s,temperature_c"
                .to_owned(),
        };
        return Err(fault(problem));
    };

    let mut rows: Vec<Row> = Vec::new();
    let mut names: BTreeSet<String> = BTreeSet::new();
    for record in reader.records() {
        let record = record.map_err(|error| csv_error(path, error))?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut row = Row { line, frame: String::new(), files: BTreeMap::new(), metadata: FrameMetadata::default() };
        for (i, (column, cell)) in head.iter().zip(&record).enumerate() {
            let number = || finite(cell).ok_or_else(|| cell_error(path, line, column, cell));
            match column {
                _ if i == frame_column => row.frame = cell.to_owned(),
                _ if cell.is_empty() => {}
                _ if files.iter().any(|name| name == column) => {
                    drop(row.files.insert(column.to_owned(), cell.to_owned()))
                }
                "timestamp_s" => row.metadata.timestamp_s = Some(number()?),
                "temperature_c" => row.metadata.temperature_c = Some(number()?),
                _ => drop(row.metadata.other.insert(column.to_owned(), cell.to_owned())),
            }
        }
        let problem = if row.frame.is_empty() {
            "the column `frame` is empty: give the file stem of the frame".into()
        } else if !names.insert(row.frame.clone()) {
            format!("there are two rows for the frame \"{}\": remove one", row.frame)
        } else {
            rows.push(row);
            continue;
        };
        return Err(DatasetError::Table { path: path.to_owned(), line, problem });
    }
    for hint in hints(&head, &rows) {
        tracing::warn!("{}: {hint}", path.display());
    }
    let no_quantities = no_quantities(path, &rows)?;
    rows.iter_mut().for_each(|row| row.metadata.no_quantities.clone_from(&no_quantities));
    let files = head.iter().filter(|column| files.iter().any(|name| name == column)).map(str::to_owned).collect();
    Ok(FrameTable { rows, files })
}

/// Names that tables of other programs have for the time and the temperature of a frame.
const TIMES: [&str; 7] = ["timestamp", "time", "time_s", "timestamp_ms", "timestamp_us", "timestamp_ns", "time_ms"];
const TEMPERATURES: [&str; 4] = ["temperature", "temp", "temp_c", "temperature_k"];
/// Time between frames, s, beyond which it is hardly in seconds.
const LONG_S: f64 = 1000.0;

/// Columns that seem to be the time or the temperature under another name, and times that seem to be in another unit.
fn hints(head: &csv::StringRecord, rows: &[Row]) -> Vec<String> {
    let alike = |wanted: &str, names: &[&str]| {
        let column = head.iter().find(|column| names.contains(&column.to_lowercase().as_str()))?;
        let has_numbers = rows.iter().any(|row| row.metadata.number(column).is_some());
        let is_missing = head.iter().all(|column| column != wanted);
        (is_missing && has_numbers).then(|| column.to_owned())
    };
    let mut hints = Vec::new();
    if let Some(name) = alike("timestamp_s", &TIMES) {
        hints.push(format!("`{name}` is not taken for the time of a frame: name the column timestamp_s, in seconds"));
    }
    if let Some(name) = alike("temperature_c", &TEMPERATURES) {
        hints.push(format!("`{name}` is not taken for a temperature: name the column temperature_c, in °C"));
    }
    let mut times: Vec<f64> = rows.iter().filter_map(|row| row.metadata.timestamp_s).collect();
    times.sort_by(f64::total_cmp);
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    if let Some(step) = steps.get(steps.len() / 2).filter(|step| **step > LONG_S) {
        hints.push(format!(
            "by `timestamp_s` a frame was taken every {step:.0} s: it has to be in seconds; divide milliseconds by 1000, nanoseconds by 10⁹"
        ));
    }
    hints
}

/// Least range of a quantity, as a share of its values.
const FINEST: f64 = 1e-5;

/// The columns whose names end in a unit, but which observations cannot carry: clocks, and those beyond the number that there may
/// be. The others have numbers, if any cell of them is one.
fn no_quantities(path: &Path, rows: &[Row]) -> Result<BTreeSet<String>, DatasetError> {
    let names: BTreeSet<&String> = rows.iter().flat_map(|row| row.metadata.other.keys()).collect();
    // A decimal comma is meant as a number, too.
    let is_meant = |cell: &String| finite(&cell.replace(',', ".")).is_some();
    let has_numbers = |name: &&String| rows.iter().any(|row| row.metadata.other.get(*name).is_some_and(is_meant));
    let quantities: Vec<&str> = names
        .into_iter()
        .filter(|name| Quantity::named(name).is_some())
        .filter(has_numbers)
        .map(String::as_str)
        .collect();
    for (name, row) in quantities.iter().flat_map(|name| rows.iter().map(move |row| (*name, row))) {
        if let Some(cell) = row.metadata.other.get(name).filter(|cell| finite(cell).is_none()) {
            return Err(cell_error(path, row.line, name, cell));
        }
    }
    let file = path.display();
    let mut left_out = BTreeSet::new();
    let (mut carried, mut has_more): (Vec<&str>, _) = (Vec::new(), false);
    let count = quantities.len();
    for name in quantities {
        let values = || rows.iter().filter_map(|row| row.metadata.number(name));
        let [low, high] = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
        if high > low && high - low < FINEST * low.abs().max(high.abs()) {
            tracing::warn!(
                "{file}: `{name}` takes part in nothing: its values differ by less than a hundred thousandth of themselves; subtract a \
                 number from all of them where depth may depend on it"
            );
            left_out.insert(name.to_owned());
        } else if high > low && carried.len() < MOST_QUANTITIES {
            carried.push(name);
        } else if count > MOST_QUANTITIES {
            has_more |= high > low;
            left_out.insert(name.to_owned());
        }
    }
    if has_more {
        tracing::warn!(
            "{file}: of the columns whose names end in a unit only {} are quantities that depth may depend on; leave the unit away from \
             the names of those that it does not depend on",
            carried.join(", ")
        );
    }
    Ok(left_out)
}

fn finite(cell: &str) -> Option<f64> {
    cell.parse().ok().filter(|number: &f64| number.is_finite())
}

fn cell_error(path: &Path, line: u64, column: &str, value: &str) -> DatasetError {
    DatasetError::Cell { path: path.to_owned(), line, column: column.to_owned(), value: value.to_owned() }
}

fn csv_error(path: &Path, error: csv::Error) -> DatasetError {
    let path: PathBuf = path.to_owned();
    let line = error.position().map_or(1, csv::Position::line);
    match error.into_kind() {
        csv::ErrorKind::Io(error) => DatasetError::Read { path, error },
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            let problem =
                format!("this row has {len} cells, the first line {expected_len}: write as many, empty or not");
            DatasetError::Table { path, line, problem }
        }
        csv::ErrorKind::Utf8 { .. } => {
            DatasetError::Table { path, line, problem: "this is not UTF-8 text: save the table as UTF-8".into() }
        }
        other => DatasetError::Table { path, line, problem: format!("this is not CSV: {other:?}") },
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn table(text: &str) -> Result<Vec<Row>, DatasetError> {
        parse(Path::new("set/frames.csv"), text.as_bytes(), &[]).map(|table| table.rows)
    }

    fn complaint(text: &str) -> String {
        table(text).err().unwrap().to_string()
    }

    #[test]
    fn columns_that_seem_to_be_times_and_temperatures_are_told() {
        let hints_of = |text: &str| {
            let mut reader = csv::Reader::from_reader(text.as_bytes());
            let rows = parse(Path::new("set/frames.csv"), text.as_bytes(), &[]).unwrap().rows;
            hints(reader.headers().unwrap(), &rows)
        };
        let told = hints_of("frame,Time,temp\n1,0.5,20\n2,1.5,21\n");
        assert!(told.len() == 2 && told[0].contains("timestamp_s") && told[1].contains("temperature_c"), "{told:?}");
        let told = hints_of("frame,timestamp_s\n1,1000\n2,3500\n3,6000\n");
        assert!(told.len() == 1 && told[0].contains("every 2500 s"), "{told:?}");
        assert!(hints_of("frame,timestamp_s,temperature_c,time\n1,1,20,5\n2,31,21,6\n").is_empty());
        assert!(hints_of("frame,time\n1,noon\n2,evening\n").is_empty());
    }

    #[test]
    fn reads_known_and_further_columns() {
        let text = "frame,timestamp_s,temperature_c,gain,note\n0001, 0.5 ,31,2.5,\"a, b\"\n0002,,,,\n";
        let rows = table(text).unwrap();
        assert_eq!(rows.len(), 2);
        let first = &rows[0].metadata;
        assert_eq!((rows[0].frame.as_str(), first.timestamp_s, first.temperature_c), ("0001", Some(0.5), Some(31.0)));
        assert_eq!((first.number("gain"), first.number("note")), (Some(2.5), None));
        assert_eq!(first.other["note"], "a, b");
        assert_eq!(rows[1].metadata, FrameMetadata::default());
    }

    #[test]
    fn columns_whose_names_end_in_a_unit_are_quantities() {
        let rows = table("frame,exposure_ms,gain,side_a,note_1\n1,8.5,2,left,\n2,,3,right,\n").unwrap();
        let exposure = Quantity::named("exposure_ms").unwrap();
        assert_eq!(rows[0].metadata.quantities().iter().collect::<Vec<_>>(), [(exposure, 8.5)]);
        assert_eq!(rows[1].metadata.quantities(), Quantities::NONE);
        let message = complaint("frame,exposure_ms\n1,\"8,5\"\n2,\"9,5\"\n");
        assert!(message.contains("line 2") || message.contains(":2"), "{message}");
        assert!(message.contains("exposure_ms") && message.contains("8,5"), "{message}");
        let message = complaint("frame,exposure_ms\n1,8.5\n2,auto\n");
        assert!(message.contains(":3") && message.contains("exposure_ms") && message.contains("auto"), "{message}");
    }

    /// A recorder's clock and a table of poses are no reason to refuse a capture.
    #[test]
    fn columns_that_observations_cannot_carry_are_left_out() {
        let rows = table("frame,clock_s,gain_1\n1,1700000000.0,1\n2,1700000009.5,2\n").unwrap();
        let names = |row: &Row| row.metadata.quantities().iter().map(|(q, _)| q.name()).collect::<Vec<_>>();
        assert_eq!(names(&rows[1]), ["gain_1"]);
        assert_eq!(rows[1].metadata.other["clock_s"], "1700000009.5");
        let many: Vec<String> = (1..=9).map(|i| format!("q{i}_v")).collect();
        let rows = table(&format!("frame,{}\n1{}\n2{}\n", many.join(","), ",1".repeat(9), ",2".repeat(9))).unwrap();
        assert_eq!(names(&rows[0]), ["q1_v", "q2_v", "q3_v", "q4_v", "q5_v", "q6_v"]);
    }

    #[test]
    fn other_separators_are_named() {
        assert!(complaint("frame;timestamp_s\n0001;0,5\n").contains("semicolons"));
        assert!(complaint("timestamp_s\tframe\n0.5\t0001\n").contains("tabs"));
        assert!(!complaint("time;name\n0.5;0001\n").contains("semicolons"));
    }

    #[test]
    fn a_cell_that_is_no_number_has_line_and_column() {
        for value in ["warm", "nan", "inf", "1,5"] {
            let message = complaint(&format!("frame,temperature_c\n0001,20\n0002,\"{value}\"\n"));
            assert!(message.contains("set/frames.csv:3") && message.contains("temperature_c"), "{message}");
            assert!(message.contains(value), "{message}");
        }
    }

    #[test]
    fn other_faults_are_named() {
        assert!(complaint("").contains("`frame`"));
        assert!(complaint("name,timestamp_s\n1,2\n").contains("`frame`"));
        assert!(complaint("frame,a,a\n").contains("two columns"));
        assert!(complaint("frame,timestamp_s\n0001\n").contains(":2: this row has 1 cells"));
        assert!(complaint("frame,timestamp_s\n0001,1\n0001,2\n").contains(":3: there are two rows"));
        assert!(complaint("frame,timestamp_s\n,1\n").contains(":2"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_no_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse(Path::new("frames.csv"), bytes.as_slice(), &[]);
            let mut table = b"frame,timestamp_s\n".to_vec();
            table.extend(bytes);
            let _ = parse(Path::new("frames.csv"), table.as_slice(), &[]);
        }
    }
}
