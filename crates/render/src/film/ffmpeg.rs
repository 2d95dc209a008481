//! H.264 in MP4 by `ffmpeg` on PATH.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};

use super::encoder::{self, FilmEncoder};
use crate::error::RenderError;
use crate::picture::Picture;

/// Films that this process began: a part of the names of their temporary files.
static BEGUN: AtomicU64 = AtomicU64::new(0);

/// Pictures go to the standard input of `ffmpeg`. It writes a temporary file, since an MP4 file begins with a table of what
/// follows; the film is copied from there.
pub(super) struct Ffmpeg<W> {
    out: W,
    child: Child,
    file: PathBuf,
}

/// Looks for `ffmpeg`.
pub(super) fn check() -> Result<(), RenderError> {
    let mut command = Command::new("ffmpeg");
    command.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match command.status() {
        Ok(_) => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(RenderError::NoFfmpeg),
        Err(error) => Err(failed(error)),
    }
}

fn failed(error: impl std::fmt::Display) -> RenderError {
    encoder::failed("MP4", error)
}

impl<W: Write> Ffmpeg<W> {
    pub(super) fn new(out: W, size_px: [u32; 2], fps: u32) -> Result<Self, RenderError> {
        Self::start("ffmpeg".as_ref(), out, size_px, fps)
    }

    fn start(program: &Path, out: W, [width, height]: [u32; 2], fps: u32) -> Result<Self, RenderError> {
        let number = BEGUN.fetch_add(1, Ordering::Relaxed);
        let file = std::env::temp_dir().join(format!("tautline-{}-{number}.mp4", std::process::id()));
        let mut command = Command::new(program);
        command
            .args(["-nostdin", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"])
            .args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "pipe:0"])
            .args(["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"])
            .arg(&file)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let child = command.spawn().map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => RenderError::NoFfmpeg,
            _ => failed(error),
        })?;
        Ok(Self { out, child, file })
    }

    /// The error that ffmpeg printed, or the one that writing to it met.
    fn complaint(&mut self, met: &dyn std::fmt::Display) -> RenderError {
        drop(self.child.stdin.take());
        let printed = self.child.stderr.take().and_then(|stderr| io::read_to_string(stderr).ok()).unwrap_or_default();
        match printed.lines().next_back() {
            Some(line) => failed(line),
            None => failed(met),
        }
    }
}

impl<W: Write + Send> FilmEncoder for Ffmpeg<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        let Some(input) = &mut self.child.stdin else { return Err(failed("it has ended")) };
        let written = pictures.iter().try_for_each(|picture| input.write_all(&picture.rgba));
        written.map_err(|error| self.complaint(&error))
    }

    fn finish(mut self: Box<Self>) -> Result<(), RenderError> {
        drop(self.child.stdin.take());
        let status = self.child.wait().map_err(failed)?;
        if !status.success() {
            return Err(self.complaint(&status));
        }
        io::copy(&mut fs::File::open(&self.file)?, &mut self.out)?;
        Ok(())
    }
}

impl<W> Drop for Ffmpeg<W> {
    /// Ends ffmpeg where it still runs, and removes its file.
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = fs::remove_file(&self.file);
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    /// A program in the place of ffmpeg.
    fn script(folder: &Path, text: &str) -> PathBuf {
        let path = folder.join("ffmpeg");
        fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("a program");
        path
    }

    fn film(program: &Path, out: &mut Vec<u8>) -> Result<(), RenderError> {
        let mut film = Ffmpeg::start(program, out, [2, 4], 25)?;
        let pictures = [1, 2].map(|k| Picture { size_px: [2, 4], rgba: vec![k; 32] });
        film.add(&pictures)?;
        Box::new(film).finish()
    }

    #[test]
    fn ffmpeg_gets_every_picture_and_its_file_is_copied_and_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let list = folder.path().join("arguments");
        let program =
            script(folder.path(), &format!("echo \"$@\" > {}; for last; do :; done; cat > \"$last\"", list.display()));
        let mut out = Vec::new();
        film(&program, &mut out).expect("a film");
        assert_eq!(out, [vec![1; 32], vec![2; 32]].concat());
        let arguments = fs::read_to_string(list).expect("arguments");
        assert!(arguments.contains("-pix_fmt rgba -s 2x4 -r 25 -i pipe:0"), "{arguments}");
        let written = arguments.split_whitespace().next_back().expect("a file");
        assert!(!Path::new(written).exists(), "{written}");
    }

    #[test]
    fn an_ffmpeg_that_fails_is_an_error_in_its_words_and_none_is_one_with_a_remedy() {
        let folder = tempfile::tempdir().expect("a folder");
        let program = script(folder.path(), "cat > /dev/null; echo no such encoder >&2; exit 1");
        let failed = film(&program, &mut Vec::new()).expect_err("it failed");
        assert_eq!(failed.to_string(), "the MP4 encoder failed: no such encoder");
        let none = film(&folder.path().join("none"), &mut Vec::new()).expect_err("there is none");
        assert!(
            matches!(none, RenderError::NoFfmpeg) && none.help().is_some_and(|help| help.contains("install ffmpeg"))
        );
    }
}
