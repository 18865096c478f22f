//! Reading of an assembled release, sealed or not: the only file that calls `sastrugi-store` for reading.

use crate::ReportError;
use crate::data::{Artifact, Data, Files, Study};
use sastrugi_numeric::Grid;
use sastrugi_schemas::Record;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::manifest::Manifest;
use sastrugi_schemas::tables::SampleRow;
use sastrugi_store::release::{MANIFEST, TABLES};
use sastrugi_store::{dem, digest, parquet};
use std::fmt::Display;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Folders that hold data: what a page counts is the same before and after sealing.
const DATA_FOLDERS: [&str; 7] = ["classes", "dem", "fit", "mcap", TABLES, "terrain", "texture"];
const STUDY: &str = "study.toml";

impl Data {
    /// Reads the tables of a release.
    ///
    /// # Errors
    /// [`ReportError::NotARelease`] for a folder that is none; a file that is there but cannot be read.
    pub fn open(folder: &Path) -> Result<Self, ReportError> {
        let release = Release { folder: folder.to_owned() };
        if !folder.join(STUDY).is_file() && !folder.join(TABLES).is_dir() {
            return Err(ReportError::NotARelease { path: folder.to_owned() });
        }
        let toml = release.text(STUDY)?.unwrap_or_default();
        let manifest: Option<Manifest> = release.json(MANIFEST)?;
        let (version, failed) =
            manifest.map_or_else(|| (env!("CARGO_PKG_VERSION").into(), Vec::new()), |m| (m.version, m.failed));
        Ok(Self {
            study: study(&toml).map_err(|e| read_error(STUDY, e))?,
            study_sha256: digest::of_text(&toml),
            version: format!("sastrugi {version}"),
            artifacts: release.artifacts()?,
            failed,
            terrains: release.rows()?,
            fits: release.rows()?,
            covariance: release.rows()?,
            candidates: release.rows()?,
            candidate_curves: release.rows()?,
            likelihood_profile: release.rows()?,
            surfaces: release.rows()?,
            structure: release.rows()?,
            profile_psd: release.rows()?,
            psd: release.rows()?,
            heights: release.rows()?,
            scoreboard: release.rows()?,
            scoreboard_covariance: release.rows()?,
            missions: release.rows()?,
            replicates: release.rows()?,
            parameters: release.rows()?,
            files: Box::new(release),
        })
    }
}

/// A release folder.
struct Release {
    folder: PathBuf,
}

impl Files for Release {
    fn grid(&self, path: &str) -> Result<Option<Grid>, ReportError> {
        self.read(path, |file| dem::read(file).map(|d| d.grid))
    }

    fn classes(&self, path: &str) -> Result<Option<Grid<u8>>, ReportError> {
        self.read(path, dem::read_classes)
    }

    fn samples(&self, terrain_id: &str) -> Result<Vec<SampleRow>, ReportError> {
        let path = format!("{TABLES}/{}/part-{terrain_id}.parquet", SampleRow::TABLE.name);
        Ok(self.read(&path, parquet::read_table)?.unwrap_or_default())
    }

    fn fit(&self, path: &str) -> Result<Option<FitFile>, ReportError> {
        self.json(path)
    }
}

impl Release {
    /// Reads a file if it is there. A path that would leave the release is no file of it.
    fn read<T, E: Display>(&self, path: &str, read: impl Fn(&Path) -> Result<T, E>) -> Result<Option<T>, ReportError> {
        let inside = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        let file = self.folder.join(path);
        if !inside || !file.is_file() {
            return Ok(None);
        }
        read(&file).map(Some).map_err(|e| read_error(path, e))
    }

    fn text(&self, path: &str) -> Result<Option<String>, ReportError> {
        self.read(path, |file| fs::read_to_string(file))
    }

    fn json<T: serde::de::DeserializeOwned>(&self, path: &str) -> Result<Option<T>, ReportError> {
        let parse = |text: String| serde_json::from_str(&text).map_err(|e| read_error(path, e));
        self.text(path)?.map(parse).transpose()
    }

    /// All rows of a table; none when the release does not have it.
    fn rows<R: Record>(&self) -> Result<Vec<R>, ReportError> {
        let mut rows = Vec::new();
        for path in self.files_below(&format!("{TABLES}/{}", R::TABLE.name))? {
            rows.extend(self.read(&path, parquet::read_table::<R>)?.unwrap_or_default());
        }
        Ok(rows)
    }

    fn artifacts(&self) -> Result<Vec<Artifact>, ReportError> {
        let mut artifacts = Vec::new();
        for folder in DATA_FOLDERS {
            for path in self.files_below(folder)? {
                let bytes = fs::metadata(self.folder.join(&path)).map_err(|e| read_error(&path, e))?.len();
                artifacts.push(Artifact { path, bytes });
            }
        }
        Ok(artifacts)
    }

    /// Paths of the files below a folder, in order; none when there is no such folder.
    fn files_below(&self, folder: &str) -> Result<Vec<String>, ReportError> {
        let full = self.folder.join(folder);
        if !full.is_dir() {
            return Ok(Vec::new());
        }
        let failed = |e| read_error(folder, e);
        let mut entries = fs::read_dir(full).map_err(failed)?.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        entries.sort_by_key(fs::DirEntry::file_name);
        let mut files = Vec::new();
        for entry in entries {
            let path = format!("{folder}/{}", entry.file_name().to_string_lossy());
            match entry.path().is_dir() {
                true => files.extend(self.files_below(&path)?),
                false => files.push(path),
            }
        }
        Ok(files)
    }
}

fn read_error(path: &str, error: impl Display) -> ReportError {
    ReportError::Read { path: path.to_owned(), reason: error.to_string() }
}

/// `[study]` of a study file; what it does not say is empty.
fn study(toml: &str) -> Result<Study, toml_edit::TomlError> {
    let document: toml_edit::DocumentMut = toml.parse()?;
    let item = |key: &str| document.get("study").and_then(|s| s.get(key));
    let text = |key: &str| item(key).and_then(|v| v.as_str()).unwrap_or_default().to_owned();
    let list = |key: &str| {
        item(key).and_then(|v| v.as_array()).map(|a| a.iter().filter_map(|v| v.as_str()).map(str::to_owned).collect())
    };
    Ok(Study {
        name: text("name"),
        title: text("title"),
        description: text("description"),
        seed: item("seed").and_then(|v| v.as_integer()).and_then(|n| u64::try_from(n).ok()).unwrap_or_default(),
        date: text("date"),
        license: text("license"),
        creators: list("creators").unwrap_or_default(),
    })
}
