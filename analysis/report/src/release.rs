//! Reading of an assembled release, sealed or not. This is the only file that reads through `sastrugi-store`.

use crate::data::{Against, Artifact, Data, Files, Study};
use crate::{Companions, ReportError};
use sastrugi_numeric::Grid;
use sastrugi_schemas::Record;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::manifest::{self, Manifest};
use sastrugi_schemas::study::{HypothesisItem, RoughnessSection};
use sastrugi_schemas::tables::{FormationSampleRow, LogRow, RoutePointRow, RoverSampleRow, SampleRow, in_order};
use sastrugi_store::release::{MANIFEST, SHARD, TABLES};
use sastrugi_store::{dem, digest, parquet};
use std::fmt::Display;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Folders with data, so that the counts on the page are the same before and after sealing.
const DATA_FOLDERS: [&str; 10] =
    ["classes", "dem", "fit", "image", "mcap", "photoclinometry", "route", TABLES, "terrain", "texture"];
const STUDY: &str = "study.toml";

impl Data {
    /// Reads the tables of a release.
    ///
    /// # Errors
    /// [`ReportError::NotARelease`] for a folder that is not a release, [`ReportError::Shard`] for a shard of one; a file that exists but
    /// cannot be read.
    pub fn open(folder: &Path) -> Result<Self, ReportError> {
        let release = Release { folder: folder.to_owned() };
        if folder.join(SHARD).is_file() {
            return Err(ReportError::Shard { path: folder.to_owned() });
        }
        if !folder.join(STUDY).is_file() && !folder.join(TABLES).is_dir() {
            return Err(ReportError::NotARelease { path: folder.to_owned() });
        }
        let toml = release.text(STUDY)?.unwrap_or_default();
        let manifest = manifest_in(folder)?;
        let contents = manifest.iter().flat_map(|m| &m.artifacts).filter_map(content).collect();
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
            routes: release.rows()?,
            images: release.rows()?,
            photoclinometry: release.rows()?,
            photoclinometry_bands: release.rows()?,
            formations: release.rows()?,
            formation_events: release.rows()?,
            rovers: release.rows()?,
            rover_effects: release.rows()?,
            parameters: release.rows()?,
            contents,
            against: None,
            logs: None,
            files: Box::new(release),
        })
    }
}

impl Data {
    /// Reads a release and what it is compared with.
    ///
    /// # Errors
    /// As [`Self::open`], for either release; a file that is not a table of logs.
    pub fn open_with(folder: &Path, companions: &Companions) -> Result<Self, ReportError> {
        let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let other = |path: &PathBuf| -> Result<Against, ReportError> {
            let data = Self::open(path).map_err(|e| e.of_other(path))?;
            Ok(Against { name: name(path), data: Box::new(data) })
        };
        let logs = |path: &PathBuf| {
            parquet::read_table::<LogRow>(path).map_err(|e| ReportError::Logs { reason: e.to_string() })
        };
        let mut data = Self::open(folder)?;
        data.against = companions.against.as_ref().map(other).transpose()?;
        if !companions.logs.is_empty() {
            data.logs = Some(companions.logs.iter().map(logs).collect::<Result<Vec<_>, _>>()?.concat());
        }
        Ok(data)
    }
}

/// The manifest, checked; `None` before a release is sealed.
fn manifest_in(folder: &Path) -> Result<Option<Manifest>, ReportError> {
    if !folder.join(MANIFEST).is_file() {
        return Ok(None);
    }
    let sealed = sastrugi_store::release::Release::open(folder).map_err(|e| read_error(MANIFEST, e))?;
    Ok(Some(sealed.manifest().clone()))
}

/// Path and content hash of a file; `None` if its content is not hashed.
fn content(artifact: &manifest::Artifact) -> Option<(String, String)> {
    Some((artifact.path.clone(), artifact.origin.content_sha256.clone()?))
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
        self.rows_of(terrain_id)
    }

    fn route_points(&self) -> Result<Vec<RoutePointRow>, ReportError> {
        self.rows()
    }

    fn formation_samples(&self, terrain_id: &str) -> Result<Vec<FormationSampleRow>, ReportError> {
        self.rows_of(terrain_id)
    }

    fn rover_samples(&self, terrain_id: &str) -> Result<Vec<RoverSampleRow>, ReportError> {
        self.rows_of(terrain_id)
    }

    fn fit(&self, path: &str) -> Result<Option<FitFile>, ReportError> {
        self.json(path)
    }
}

impl Release {
    /// Reads a file if it exists. A path that leads out of the release counts as missing.
    fn read<T, E: Display>(&self, path: &str, read: impl Fn(&Path) -> Result<T, E>) -> Result<Option<T>, ReportError> {
        let inside = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        let file = self.folder.join(path);
        if !inside || !file.is_file() {
            return Ok(None);
        }
        read(&file).map(Some).map_err(|e| read_error(path, e))
    }

    fn text(&self, path: &str) -> Result<Option<String>, ReportError> {
        self.read(path, sastrugi_store::file::read_text)
    }

    fn json<T: serde::de::DeserializeOwned>(&self, path: &str) -> Result<Option<T>, ReportError> {
        let parse = |text: String| serde_json::from_str(&text).map_err(|e| read_error(path, e));
        self.text(path)?.map(parse).transpose()
    }

    /// Rows of a terrain, in a table with one file per terrain; empty if the release does not have the file.
    fn rows_of<R: Record>(&self, terrain_id: &str) -> Result<Vec<R>, ReportError> {
        let path = format!("{TABLES}/{}/part-{terrain_id}.parquet", R::TABLE.name);
        Ok(self.read(&path, parquet::read_table)?.unwrap_or_default())
    }

    /// All rows of a table, sorted by key; empty if the release does not have it.
    fn rows<R: Record>(&self) -> Result<Vec<R>, ReportError> {
        let mut rows = Vec::new();
        let files = self.files_below(&format!("{TABLES}/{}", R::TABLE.name))?;
        for path in &files {
            rows.extend(self.read(path, parquet::read_table::<R>)?.unwrap_or_default());
        }
        Ok(if files.len() > 1 { in_order(rows) } else { rows })
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

    /// Paths of the files below a folder, in order; empty if there is no such folder.
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

/// `[study]`, `[roughness]` and the hypotheses of a study file; keys that it lacks are empty.
fn study(toml: &str) -> Result<Study, String> {
    let document: toml_edit::DocumentMut = toml.parse().map_err(|e: toml_edit::TomlError| e.to_string())?;
    let item = |key: &str| document.get("study").and_then(|s| s.get(key));
    let text = |key: &str| item(key).and_then(|v| v.as_str()).unwrap_or_default().to_owned();
    Ok(Study {
        name: text("name"),
        title: text("title"),
        description: text("description"),
        seed: item("seed").and_then(|v| v.as_integer()).and_then(|n| u64::try_from(n).ok()).unwrap_or_default(),
        date: text("date"),
        license: text("license"),
        creators: item("creators").map(creators).unwrap_or_default(),
        hypotheses: hypotheses(&document)?,
        roughness: roughness(&document)?,
    })
}

/// Names of creators, which are strings or tables.
fn creators(item: &toml_edit::Item) -> Vec<String> {
    let name = |value: &toml_edit::Value| {
        let named = value.as_inline_table().and_then(|table| table.get("name"));
        named.unwrap_or(value).as_str().map(str::to_owned)
    };
    let values = item.as_array().into_iter().flatten().filter_map(name);
    let tables = item.as_array_of_tables().into_iter().flatten();
    values.chain(tables.filter_map(|table| Some(table.get("name")?.as_str()?.to_owned()))).collect()
}

/// `[roughness]` of a study file; keys that it lacks have their defaults.
fn roughness(document: &toml_edit::DocumentMut) -> Result<RoughnessSection, String> {
    let table = document.get("roughness").and_then(|item| item.as_table_like());
    let stated = table.into_iter().flat_map(|table| table.iter());
    let values = stated.filter_map(|(key, item)| Some((key.to_owned(), json(item.as_value()?))));
    serde_json::from_value(values.collect()).map_err(|e| format!("[roughness]: {e}"))
}

/// `[[hypothesis]]` of a study file.
fn hypotheses(document: &toml_edit::DocumentMut) -> Result<Vec<HypothesisItem>, String> {
    let tables = document.get("hypothesis").and_then(|h| h.as_array_of_tables()).into_iter().flatten();
    let item = |table: &toml_edit::Table| {
        let values = table.iter().filter_map(|(key, item)| Some((key.to_owned(), json(item.as_value()?))));
        let item: HypothesisItem =
            serde_json::from_value(values.collect()).map_err(|e| format!("[[hypothesis]]: {e}"))?;
        item.check().map_err(|e| format!("[[hypothesis]] \"{}\": {e}", item.id))?;
        Ok(item)
    };
    tables.map(item).collect()
}

/// A value of a hypothesis: string, number, or list of these.
fn json(value: &toml_edit::Value) -> serde_json::Value {
    match value {
        toml_edit::Value::String(v) => v.value().as_str().into(),
        toml_edit::Value::Integer(v) => (*v.value()).into(),
        toml_edit::Value::Float(v) => (*v.value()).into(),
        toml_edit::Value::Array(v) => v.iter().map(json).collect(),
        _ => serde_json::Value::Null,
    }
}
