//! Parquet columns are read by their logical types, or refused.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{DoubleType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use tautline_recordings::read::{ReadError, ReadOptions};

use crate::recording::{Whole, assert_refused};

/// Cells of a column.
enum Cells {
    Real([f64; 2]),
    Int([i32; 2]),
    Long([i64; 2]),
}

use Cells::{Int, Long, Real};

fn write(path: &Path, columns: &[(&str, Cells)], packed: Compression) {
    let fields: Vec<_> = columns.iter().map(|(column, _)| format!("required {column};")).collect();
    let schema = parse_message_type(&format!("message samples {{ {} }}", fields.join(" "))).expect("a schema");
    let properties = WriterProperties::builder().set_compression(packed).build();
    let file = File::create(path).expect("a file");
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).expect("a writer");
    let mut group = writer.next_row_group().expect("a group");
    for (_, cells) in columns {
        let mut column = group.next_column().expect("no error").expect("a column");
        match cells {
            Real(cells) => column.typed::<DoubleType>().write_batch(cells, None, None),
            Int(cells) => column.typed::<Int32Type>().write_batch(cells, None, None),
            Long(cells) => column.typed::<Int64Type>().write_batch(cells, None, None),
        }
        .expect("written");
        column.close().expect("closed");
    }
    group.close().expect("closed");
    writer.close().expect("closed");
}

/// Reads two rows with this time, vehicle and x.
fn read(time: (&str, Cells), id: (&str, Cells), x: (&str, Cells)) -> Result<Whole, ReadError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.parquet");
    let zero = || Real([0.0, 0.0]);
    write(&path, &[time, id, x, ("double y", zero()), ("double z", zero())], Compression::UNCOMPRESSED);
    Whole::read(&path, &ReadOptions::default())
}

fn seconds() -> (&'static str, Cells) {
    ("double t_s", Real([0.0, 1.0]))
}

#[test]
fn unsigned_integers_are_read_unsigned() {
    let x = || ("double x", Real([1.0, 2.0]));
    let wide = ("int64 id (INTEGER(64,false))", Long([-1, -1]));
    assert_eq!(read(seconds(), wide, x()).expect("read").vehicles, ["18446744073709551615"]);
    let narrow = ("int32 id (INTEGER(32,false))", Int([-1, 7]));
    assert_eq!(read(seconds(), narrow, x()).expect("read").vehicles, ["7", "4294967295"]);
    let signed = ("int32 id (INTEGER(32,true))", Int([-1, -1]));
    assert_eq!(read(seconds(), signed, x()).expect("read").vehicles, ["-1"]);
    // Milliseconds across 2^31, where signed values would decrease.
    let time = ("int32 t_ms (INTEGER(32,false))", Int([i32::MAX, i32::MIN]));
    let found = read(time, ("int64 id", Long([1, 1])), x()).expect("read");
    let times: Vec<_> = found.samples().iter().map(|sample| sample.0).collect();
    assert!((times[1] - times[0] - 1e-3).abs() < 1e-9, "{times:?}");
}

#[test]
fn decimals_dates_and_times_of_day_are_refused() {
    let id = || ("int64 id", Long([1, 1]));
    for column in [
        ("int32 x (DECIMAL(9,2))", Int([50, 51])),
        ("int64 x (DECIMAL(9,2))", Long([50, 51])),
        ("int32 x (DATE)", Int([50, 51])),
        ("int32 x (TIME(MILLIS,true))", Int([50, 51])),
    ] {
        let name = column.0;
        assert_refused(&read(seconds(), id(), column).expect_err(name), "recording/element-type", "");
    }
    assert!(read(seconds(), id(), ("int32 x", Int([50, 51]))).is_ok());
    let day = ("int64 t (TIME(MICROS,true))", Long([0, 1]));
    assert!(read(day, id(), ("double x", Real([1.0, 2.0]))).is_err());
}

#[test]
fn unsupported_codec_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.parquet");
    let columns = [seconds(), ("int64 id", Long([1, 1])), ("double x", Real([0.0; 2])), ("double y", Real([0.0; 2]))];
    write(&path, &columns, Compression::UNCOMPRESSED);
    let whole = fs::read(&path).expect("read");
    assert!(Whole::read(&path, &ReadOptions::default()).is_ok());
    // The codec of a column follows its path in the footer: UNCOMPRESSED is 0, BROTLI 4.
    let mut packed = whole.clone();
    let names: Vec<_> = memmem(&whole, b"\x18\x03t_s").collect();
    let codec = names.last().expect("a column") + b"\x18\x03t_s".len();
    let codec = (codec..codec + 4).find(|&at| packed[at - 1] == 0x15 && packed[at] == 0).expect("a codec");
    packed[codec] = 8;
    fs::write(&path, packed).expect("written");
    let refused = Whole::read(&path, &ReadOptions::default()).expect_err("refused");
    assert_refused(&refused, "recording/unsupported-compression", "");
    assert!(refused.to_string().ends_with("column `t_s` is packed by brotli, which is not supported"), "{refused}");
}

/// Returns the offsets of a byte string.
fn memmem<'a>(text: &'a [u8], part: &'a [u8]) -> impl Iterator<Item = usize> + 'a {
    text.windows(part.len()).enumerate().filter(move |(_, window)| *window == part).map(|(at, _)| at)
}
