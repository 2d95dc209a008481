//! Reads ROS 2 bags: a folder with `metadata.yaml` and consecutive MCAP files, optionally packed by zstd.

use std::collections::BTreeSet;
use std::fs;
use std::fs::File;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::super::options::ReadOptions;
use super::super::order::Recording;
use super::super::recognition::{BAG, BAG_INDEX, BAG_INDEX_LIMIT_BYTES, bag_index};
use super::super::source::{Source, ZSTD_MAGIC};
use super::foreign;
use super::split::SplitFiles;

const REINDEX: &str = "copy the whole folder again, or rewrite metadata.yaml with `ros2 bag reindex`";

#[derive(Deserialize)]
struct Metadata {
    #[serde(rename = "rosbag2_bagfile_information")]
    bag: Bag,
}

#[derive(Deserialize)]
struct Bag {
    storage_identifier: String,
    relative_file_paths: Vec<String>,
    #[serde(default)]
    message_count: u64,
    #[serde(default)]
    compression_mode: Option<String>,
    #[serde(default)]
    compression_format: Option<String>,
}

/// Opens a bag.
pub(in crate::read) fn open(folder: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    let metadata = folder.join(BAG_INDEX);
    let bag = read(folder).map_err(|error| error.of(&metadata))?;
    let files = files_of(&bag, folder).map_err(|fault| ReadError::new(&metadata, fault))?;
    refuse_others(folder, &files)?;
    let packed = |path: &PathBuf| {
        let mut source = Source::file(path);
        if path.exists() && !path.is_file() {
            let fault =
                Fault::content(ContentKind::BagIndex, "the bag lists this file, but it is not a regular file", REINDEX);
            return Err(ReadError::new(path, fault));
        }
        let (mut begin, mut bytes) =
            (File::open(path).map_err(|error| ReadError::new(path, missing(error)))?, Vec::new());
        begin
            .by_ref()
            .take(ZSTD_MAGIC.len() as u64)
            .read_to_end(&mut bytes)
            .map_err(|error| ReadError::new(path, error.into()))?;
        source.zstd = bytes == ZSTD_MAGIC;
        Ok(source)
    };
    let files = files.iter().map(packed).collect::<Result<_, ReadError>>()?;
    foreign::open(&Source::file(folder), SplitFiles::new(files, bag.message_count, options), options)
}

fn read(folder: &Path) -> Result<Bag, ReadError> {
    let bytes = bag_index(folder)?;
    if bytes.len() as u64 > BAG_INDEX_LIMIT_BYTES {
        return refuse(ContentKind::BagIndex, format!("it is longer than {BAG_INDEX_LIMIT_BYTES} bytes"), REINDEX);
    }
    let text = std::str::from_utf8(&bytes).map_err(|_| Fault::not_utf8())?;
    let metadata: Metadata = serde_saphyr::from_str(text).map_err(|error| {
        let place = error.location().map(|location| Place::Line(location.line()));
        let message = error.to_string();
        let problem = format!("it is not the index of a ROS 2 bag: {}", message.lines().next().unwrap_or_default());
        ReadError { place, ..Fault::content(ContentKind::BagIndex, problem, REINDEX).into() }
    })?;
    Ok(metadata.bag)
}

fn missing(error: std::io::Error) -> Fault {
    if error.kind() == std::io::ErrorKind::NotFound {
        return Fault::content(ContentKind::BagIndex, "the bag lists this file, but it is missing", REINDEX);
    }
    error.into()
}

/// Returns the files that a bag lists, in order.
fn files_of(bag: &Bag, folder: &Path) -> Result<Vec<PathBuf>, Fault> {
    if bag.storage_identifier != "mcap" {
        let problem = format!("the storage of the bag is {}, which is not supported", quoted(&bag.storage_identifier));
        return refuse(ContentKind::UnsupportedFormat, problem, BAG);
    }
    let mode = bag.compression_mode.as_deref().unwrap_or_default().to_uppercase();
    let format = bag.compression_format.as_deref().unwrap_or_default();
    if mode == "MESSAGE" || !(format.is_empty() || format == "zstd") {
        let problem =
            format!("the bag is packed by {} in mode {}, which is not supported", quoted(format), quoted(&mode));
        let remedy = "rewrite it with `ros2 bag convert`, uncompressed or with compression mode `file`";
        return refuse(ContentKind::UnsupportedCompression, problem, remedy);
    }
    if bag.relative_file_paths.is_empty() {
        return refuse(ContentKind::BagIndex, "the bag lists no files", REINDEX);
    }
    let (mut files, mut known) = (Vec::new(), BTreeSet::new());
    for listed in &bag.relative_file_paths {
        let path = Path::new(listed);
        let odd = |part| !matches!(part, Component::Normal(_) | Component::CurDir);
        // Bags up to version 3 prefix the paths with their own name.
        let name = path.file_name().filter(|_| !path.components().any(odd));
        let Some(name) = name else {
            let problem = format!("the bag lists {}, which is not a file in its folder", quoted(listed));
            return refuse(ContentKind::BagIndex, problem, REINDEX);
        };
        let file = folder.join(name);
        if !known.insert(file.clone()) {
            return refuse(ContentKind::BagIndex, format!("the bag lists {} twice", quoted(listed)), REINDEX);
        }
        files.push(file);
    }
    Ok(files)
}

/// Refuses files in the folder that the bag does not list, because they may belong to it.
fn refuse_others(folder: &Path, files: &[PathBuf]) -> Result<(), ReadError> {
    let (listed, mut others): (BTreeSet<_>, Vec<_>) = (files.iter().collect(), Vec::new());
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_part = [".mcap", ".mcap.zstd", ".db3"].iter().any(|end| name.ends_with(end));
        if is_part && !name.starts_with('.') && !listed.contains(&path) {
            others.push(name);
        }
    }
    others.sort();
    match others.first() {
        None => Ok(()),
        Some(other) => {
            let problem = format!("{other} is in the folder of the bag, but the bag does not list it");
            let remedy =
                "remove the file if it does not belong to the bag, else rewrite metadata.yaml with `ros2 bag reindex`";
            refuse(ContentKind::BagIndex, problem, remedy)
        }
    }
}
