//! The output folder.

use std::{
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use crate::error::Failure;

/// A file that is being written; says its path when writing fails.
#[derive(Debug)]
pub struct WriteFile {
    path: PathBuf,
    file: BufWriter<File>,
}

impl WriteFile {
    /// Makes the file, or empties it.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn create(path: PathBuf) -> Result<Self, Failure> {
        match File::create(&path) {
            Ok(file) => Ok(Self { path, file: BufWriter::new(file) }),
            Err(error) => Err(Failure::cannot_write(&path, &error)),
        }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Write for WriteFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// The folder that `--out` names.
#[derive(Clone, Debug)]
pub struct OutputFolder {
    path: PathBuf,
}

impl OutputFolder {
    /// Makes the folder and tries whether it can be written, so that a run does not fail after its work.
    ///
    /// # Errors
    /// When it cannot.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        fs::create_dir_all(path).map_err(|error| Failure::cannot_write(path, &error))?;
        let probe = path.join(".fencepost-probe");
        File::create(&probe).map_err(|error| Failure::cannot_write(path, &error))?;
        fs::remove_file(&probe).map_err(|error| Failure::cannot_write(path, &error))?;
        Ok(Self { path: path.to_path_buf() })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Starts a file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn create(&self, name: &str) -> Result<WriteFile, Failure> {
        WriteFile::create(self.path.join(name))
    }

    /// Writes a whole file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        let path = self.path.join(name);
        fs::write(&path, bytes).map_err(|error| Failure::cannot_write(&path, &error))
    }

    /// Makes a folder of pictures and takes the numbered pictures of an earlier run away, so that no picture there belongs
    /// to another run. Other files stay.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn picture_folder(&self, name: &str) -> Result<(), Failure> {
        let path = self.path.join(name);
        let cannot = |error: io::Error| Failure::cannot_write(&path, &error);
        fs::create_dir_all(&path).map_err(cannot)?;
        for entry in fs::read_dir(&path).map_err(cannot)? {
            let entry = entry.map_err(cannot)?;
            if entry.file_name().to_str().is_some_and(is_numbered_picture) {
                fs::remove_file(entry.path()).map_err(cannot)?;
            }
        }
        Ok(())
    }

    /// Writes picture `number` of a folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn picture(&self, folder: &str, number: u32, png: &[u8]) -> Result<(), Failure> {
        self.write(&format!("{folder}/{number:06}.png"), png)
    }
}

fn is_numbered_picture(name: &str) -> bool {
    name.strip_suffix(".png").is_some_and(|stem| stem.len() >= 6 && stem.bytes().all(|b| b.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_an_earlier_run_go_and_other_files_stay() {
        let folder = tempfile::tempdir().unwrap();
        let out = OutputFolder::open(&folder.path().join("a/b")).unwrap();
        out.picture_folder("map").unwrap();
        out.picture("map", 7, b"old").unwrap();
        out.write("map/notes.png", b"mine").unwrap();
        out.picture_folder("map").unwrap();
        let left: Vec<_> = fs::read_dir(out.path().join("map")).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["notes.png"]);
    }

    #[test]
    fn a_file_in_the_way_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, b"").unwrap();
        for path in [file.clone(), file.join("below")] {
            let failure = OutputFolder::open(&path).unwrap_err();
            assert_eq!(failure.kind.exit_status(), 1);
            assert!(failure.to_string().contains("cannot write"), "{failure}");
            assert!(failure.to_string().contains("file"), "{failure}");
        }
    }
}
