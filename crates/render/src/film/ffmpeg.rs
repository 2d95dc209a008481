//! H.264 in MP4 by an external `ffmpeg`.

use std::env;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use tempfile::TempDir;

use super::FilmEncoder;
use crate::error::RenderError;
use crate::picture::Picture;

/// Encoder that pipes pictures to `ffmpeg`. An MP4 file begins with a table of its content, so `ffmpeg` writes a
/// temporary file, which is copied at the end.
pub(super) struct Ffmpeg<W> {
    out: W,
    child: Child,
    /// Temporary folder with the film and the error output of `ffmpeg`.
    folder: TempDir,
}

/// Checks that `ffmpeg` is on PATH.
pub(super) fn check() -> Result<(), RenderError> {
    let name = format!("ffmpeg{}", env::consts::EXE_SUFFIX);
    let path = env::var_os("PATH").unwrap_or_default();
    let is_found = env::split_paths(&path).any(|folder| folder.join(&name).is_file());
    if is_found { Ok(()) } else { Err(RenderError::NoFfmpeg) }
}

fn failed(error: impl std::fmt::Display) -> RenderError {
    super::failed("MP4", error)
}

impl<W: Write> Ffmpeg<W> {
    pub(super) fn new(out: W, size_px: [u32; 2], fps: u32) -> Result<Self, RenderError> {
        Self::start("ffmpeg".as_ref(), out, size_px, fps)
    }

    fn start(program: &Path, out: W, [width, height]: [u32; 2], fps: u32) -> Result<Self, RenderError> {
        let folder = tempfile::tempdir()?;
        let printed = File::create(folder.path().join("printed"))?;
        let mut command = Command::new(program);
        command
            .args(["-nostdin", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"])
            .args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "pipe:0"])
            .args(["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"])
            .arg(folder.path().join("film.mp4"))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(printed);
        let child = command.spawn().map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => RenderError::NoFfmpeg,
            _ => failed(format!("cannot start ffmpeg: {error}")),
        })?;
        Ok(Self { out, child, folder })
    }

    fn film(&self) -> PathBuf {
        self.folder.path().join("film.mp4")
    }

    /// Returns the last line of ffmpeg's error output as an error, or `other` if there is no output.
    fn ffmpeg_error(&mut self, other: &dyn std::fmt::Display) -> RenderError {
        self.stop();
        let printed = fs::read(self.folder.path().join("printed")).unwrap_or_default();
        let printed = String::from_utf8_lossy(&printed);
        match printed.lines().rfind(|line| !line.trim().is_empty()) {
            Some(line) => failed(line),
            None => failed(other),
        }
    }

    /// Stops ffmpeg if it still runs.
    fn stop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl<W: Write + Send> FilmEncoder for Ffmpeg<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        let Some(input) = &mut self.child.stdin else { return Err(failed("ffmpeg has ended")) };
        let written = pictures.iter().try_for_each(|picture| input.write_all(&picture.rgba));
        written.map_err(|error| self.ffmpeg_error(&format!("ffmpeg takes no more pictures: {error}")))
    }

    fn finish(mut self: Box<Self>) -> Result<(), RenderError> {
        drop(self.child.stdin.take());
        let status = self.child.wait().map_err(failed)?;
        if !status.success() {
            return Err(self.ffmpeg_error(&status));
        }
        match File::open(self.film()) {
            Ok(mut film) if film.metadata()?.len() > 0 => io::copy(&mut film, &mut self.out)?,
            _ => return Err(self.ffmpeg_error(&"ffmpeg wrote no film")),
        };
        Ok(())
    }
}

impl<W> Drop for Ffmpeg<W> {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    /// Writes a script that replaces ffmpeg.
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
    fn ffmpeg_gets_every_picture_and_its_file_is_copied() {
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
    fn a_failing_or_missing_ffmpeg_is_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let program = script(folder.path(), "cat > /dev/null; echo no such encoder >&2; exit 1");
        let failed = film(&program, &mut Vec::new()).expect_err("it failed");
        assert_eq!(failed.to_string(), "the MP4 encoder failed: no such encoder");
        for (text, expected) in [
            ("yes error | head -c 300000 >&2; cat > /dev/null; exit 1", "error"),
            ("exec 0<&-; sleep 60; exit 1", "ffmpeg takes no more pictures"),
            ("cat > /dev/null; for last; do :; done; : > \"$last\"", "ffmpeg wrote no film"),
            ("cat > /dev/null", "ffmpeg wrote no film"),
        ] {
            let mut film = Ffmpeg::start(&script(folder.path(), text), Vec::new(), [2, 4], 25).expect("it starts");
            // More than a pipe holds, so that a closed input is noticed.
            let added = film.add(&[Picture { size_px: [2, 4], rgba: vec![3; 1 << 20] }]);
            let failed = added.and_then(|()| Box::new(film).finish()).expect_err(text).to_string();
            assert!(failed.contains(expected), "{text}: {failed}");
        }
        let none = film(&folder.path().join("none"), &mut Vec::new()).expect_err("there is none");
        assert!(
            matches!(none, RenderError::NoFfmpeg) && none.help().is_some_and(|help| help.contains("install ffmpeg"))
        );
    }
}
