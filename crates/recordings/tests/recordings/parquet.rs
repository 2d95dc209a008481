//! Parquet columns are read by their logical types, or refused.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, GzipLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use tautline_recordings::read::{ReadError, ReadOptions};

use crate::recording::{Whole, assert_refused};

/// Cells of a column.
enum Cells {
    Real([f64; 2]),
    Int([i32; 2]),
    Long([i64; 2]),
    Text([&'static str; 2]),
}

use Cells::{Int, Long, Real, Text};

fn write(path: &Path, columns: &[(&str, Cells)], packed: Compression) {
    write_with(path, columns, WriterProperties::builder().set_compression(packed).build());
}

fn write_with(path: &Path, columns: &[(&str, Cells)], properties: WriterProperties) {
    let fields: Vec<_> = columns.iter().map(|(column, _)| format!("required {column};")).collect();
    let schema = parse_message_type(&format!("message samples {{ {} }}", fields.join(" "))).expect("a schema");
    let file = File::create(path).expect("a file");
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).expect("a writer");
    let mut group = writer.next_row_group().expect("a group");
    for (_, cells) in columns {
        let mut column = group.next_column().expect("no error").expect("a column");
        match cells {
            Real(cells) => column.typed::<DoubleType>().write_batch(cells, None, None),
            Int(cells) => column.typed::<Int32Type>().write_batch(cells, None, None),
            Long(cells) => column.typed::<Int64Type>().write_batch(cells, None, None),
            Text(cells) => column.typed::<ByteArrayType>().write_batch(&cells.map(ByteArray::from), None, None),
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

#[test]
fn text_in_delta_encodings_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.parquet");
    let zero = || Real([0.0, 0.0]);
    let columns = [
        seconds(),
        ("binary id (UTF8)", Text(["a", "a"])),
        ("double x", zero()),
        ("double y", zero()),
        ("double z", zero()),
    ];
    for (encoding, readable) in
        [(Encoding::PLAIN, true), (Encoding::DELTA_BYTE_ARRAY, false), (Encoding::DELTA_LENGTH_BYTE_ARRAY, false)]
    {
        let properties = WriterProperties::builder().set_dictionary_enabled(false);
        write_with(&path, &columns, properties.set_column_encoding("id".into(), encoding).build());
        match Whole::read(&path, &ReadOptions::default()) {
            Ok(_) => assert!(readable, "{encoding}"),
            Err(refused) => {
                assert!(!readable, "{encoding}: {refused}");
                assert_refused(&refused, "recording/unsupported-compression", "");
            }
        }
    }
}

/// Returns the bytes of a file with two rows, and its pages of `z`, the last column.
fn packed_flight(packed: Compression) -> (Vec<u8>, std::ops::Range<usize>) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.parquet");
    let zero = || Real([0.0, 0.0]);
    let columns =
        [seconds(), ("int64 id", Long([1, 1])), ("double x", zero()), ("double y", zero()), ("double z", zero())];
    write(&path, &columns, packed);
    assert!(Whole::read(&path, &ReadOptions::default()).is_ok());
    let reader = SerializedFileReader::new(File::open(&path).expect("opened")).expect("read");
    let (start, length) = reader.metadata().row_group(0).column(4).byte_range();
    let at = |byte: u64| usize::try_from(byte).expect("short");
    (fs::read(&path).expect("read"), at(start)..at(start + length))
}

/// Reads these bytes as a file and returns the text of the error, which has this code.
fn refusal(bytes: &[u8], code: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.parquet");
    fs::write(&path, bytes).expect("written");
    let refused = Whole::read(&path, &ReadOptions::default()).expect_err("refused");
    assert_eq!(refused.code(), code, "{refused}");
    refused.to_string()
}

/// A number of 2^31 - 1 as a signed varint.
const HUGE: [u8; 5] = [0xfe, 0xff, 0xff, 0xff, 0x0f];

#[test]
fn claimed_page_sizes_are_checked_before_memory_is_allocated() {
    let (bytes, pages) = packed_flight(Compression::SNAPPY);
    let page = &bytes[pages.clone()];
    // A dictionary page begins with its type 2, its unpacked size 8, its packed size, and the number of values, 1.
    let [0x15, 0x04, 0x15, 0x10, 0x15, _, 0x4c, 0x15, 0x02, ..] = page else { panic!("{page:x?}") };
    for (at, code, text) in [
        (8, "recording/damaged", "a dictionary claims 2147483647 values in 8 bytes"),
        (3, "recording/grows-too-large", "it unpacks to more than 214748"),
    ] {
        let (head, tail) = (&bytes[..pages.start + at], &bytes[pages.start + at + 1..]);
        let found = refusal(&[head, &HUGE, tail].concat(), code);
        assert!(found.contains(text), "{found}");
    }
    // A header with two sizes: another reader could take the other one.
    let repeated = [&bytes[..pages.start + 4], &[0x05, 0x04, 0x10], &bytes[pages.start + 4..]].concat();
    let found = refusal(&repeated, "recording/damaged");
    assert!(found.contains("a field is out of order"), "{found}");
}

#[test]
fn claims_of_a_footer_are_checked_before_memory_is_allocated() {
    let file = |footer: &[u8]| {
        let length = u32::try_from(footer.len()).expect("short").to_le_bytes();
        [b"PAR1", footer, &length, b"PAR1"].concat()
    };
    // Version 1, then a list of schema elements, which are groups with a name and a number of columns.
    let schema = |count: &[u8], group: &[u8]| [&[0x15, 0x02, 0x19, 0xfc], count, group].concat();
    let group = |columns: &[u8]| [&[0x48, 0x01, b's', 0x15], columns, &[0x00]].concat();
    for footer in [
        schema(&[0x01], &group(&HUGE)),
        // 100,000 groups in each other.
        schema(&[0xa0, 0x8d, 0x06], &group(&[0x02]).repeat(100_000)),
    ] {
        let found = refusal(&file(&[&footer[..], &[0x00]].concat()), "recording/damaged");
        assert!(found.contains("its schema nests too deep, or claims more columns"), "{found}");
    }
    // A list of 2^31 - 1 truth values, which take no bytes.
    let lists = [&[0x15, 0x02, 0xe9, 0xf1][..], &[0xff, 0xff, 0xff, 0xff, 0x07], &[0x00]].concat();
    let found = refusal(&file(&lists), "recording/damaged");
    assert!(found.contains("a list is longer than the rest of the file"), "{found}");
}

#[test]
fn pages_that_unpack_to_more_than_they_claim_are_refused() {
    // The library would unpack the whole page before it compares the sizes.
    let (mut bytes, pages) = packed_flight(Compression::GZIP(GzipLevel::default()));
    let [0x15, 0x04, 0x15, claimed @ 0x10, ..] = &mut bytes[pages] else { panic!("no dictionary page of 8 bytes") };
    *claimed = 0x0e;
    let found = refusal(&bytes, "recording/damaged");
    assert!(found.contains("a page unpacks to more bytes than its header states"), "{found}");
}

/// Returns the bytes of a flight whose footer has another number of rows, for the file or for its group.
fn with_rows(of_file: u8, of_group: u8) -> Vec<u8> {
    let (mut bytes, _) = packed_flight(Compression::UNCOMPRESSED);
    let end = bytes.len() - 8;
    let footer = bytes.len() - 8 - u32::from_le_bytes(bytes[end..end + 4].try_into().expect("four")) as usize;
    // After the schema, the footer has the rows of the file and a list of one group. The group ends with its rows.
    let of_rows: Vec<_> = (footer..end).filter(|&at| bytes[at..].starts_with(&[0x16, 0x04, 0x19, 0x1c])).collect();
    let [at] = of_rows[..] else { panic!("{of_rows:?}") };
    bytes[at + 1] = 2 * of_file;
    let group: Vec<_> = (at + 4..end - 1).filter(|&at| bytes[at..].starts_with(&[0x16, 0x04, 0x26])).collect();
    let Some(&at) = group.last() else { panic!("no rows of a group") };
    bytes[at + 1] = 2 * of_group;
    bytes
}

#[test]
fn rows_that_a_footer_hides_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("flight.parquet");
    fs::write(&path, with_rows(2, 2)).expect("written");
    assert_eq!(Whole::read(&path, &ReadOptions::default()).expect("read").items.len(), 2);
    let hidden = refusal(&with_rows(1, 1), "recording/damaged");
    assert!(hidden.contains("has more cells than its group has rows"), "{hidden}");
    let other = refusal(&with_rows(2, 1), "recording/damaged");
    assert!(other.contains("its number of rows is not the sum over its row groups"), "{other}");
}
