//! Reading of an assembled release, sealed or not. This is the only file that reads through `sastrugi-store`.

use crate::data::{Against, Data, Files, Mission, Names, Start, Stored, Study, Undrawn, is_judged, without_curves};
use crate::{Companions, ReportError};
use sastrugi_numeric::Grid;
use sastrugi_schemas::Record;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::manifest::Manifest;
use sastrugi_schemas::study::{HypothesisItem, RoughnessSection};
use sastrugi_schemas::tables::{
    FormationSampleRow, HeightDistributionRow, LogRow, ProfilePsdRow, PsdRow, RoutePointRow, RoverRow, RoverSampleRow,
    SampleRow, StructureRow, TerrainRow, in_order,
};
use sastrugi_store::release::{MANIFEST, SHARD, STUDY, TABLES};
use sastrugi_store::{dem, digest, parquet};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::fs;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

/// Folders with data, so that the counts on the page are the same before and after sealing.
const DATA_FOLDERS: [&str; 10] =
    ["classes", "dem", "fit", "image", "mcap", "photoclinometry", "route", TABLES, "terrain", "texture"];
/// The one of these whose files are only counted.
const RECORDINGS: &str = "mcap";

impl Data {
    /// Reads the tables of a release; `undrawn` names the surfaces whose curves are left out.
    ///
    /// # Errors
    /// [`ReportError::NotARelease`] for a folder that is not a release, [`ReportError::Shard`] for a shard of one; a file that exists but
    /// cannot be read; a file that the manifest lists and the report reads, but which is missing or not a regular file.
    pub fn open(folder: &Path, undrawn: Undrawn) -> Result<Self, ReportError> {
        let release = Release::at(folder)?;
        let mut data = release.tables()?;
        release.read_curves(&mut data, undrawn)?;
        Ok(data)
    }
}

impl Data {
    /// Reads a release and what it is compared with.
    ///
    /// # Errors
    /// As [`Self::open`], for either release; a file that is not a table of logs.
    pub fn open_with(folder: &Path, companions: &Companions, undrawn: Undrawn) -> Result<Self, ReportError> {
        let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let other = |path: &PathBuf| -> Result<Against, ReportError> {
            let data = Self::open(path, undrawn).map_err(|e| e.of_other(path))?;
            Ok(Against { name: name(path), data: Box::new(data) })
        };
        let logs = |path: &PathBuf| {
            parquet::read_table::<LogRow>(path).map_err(|e| ReportError::Logs { reason: e.to_string() })
        };
        let mut data = Self::open(folder, undrawn)?;
        data.against = companions.against.as_ref().map(other).transpose()?;
        if !companions.logs.is_empty() {
            data.logs = Some(companions.logs.iter().map(logs).collect::<Result<Vec<_>, _>>()?.concat());
        }
        Ok(data)
    }
}

/// True for the files that the report reads, now or when a figure needs them.
fn is_read(path: &str) -> bool {
    let folder = path.split_once('/').map_or("", |(folder, _)| folder);
    path == STUDY || (folder != RECORDINGS && DATA_FOLDERS.contains(&folder))
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

    fn samples(&self, terrain_id: &str, missions: &BTreeSet<&str>) -> Result<Vec<SampleRow>, ReportError> {
        let mut samples = Vec::new();
        let path = format!("{TABLES}/{}/part-{terrain_id}.parquet", SampleRow::TABLE.name);
        self.for_each_row(&path, |row: SampleRow| {
            if missions.contains(row.mission_id.as_str()) {
                samples.push(row);
            }
        })?;
        Ok(samples)
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
    /// The release in a folder, refused if it is none or a shard of one.
    fn at(folder: &Path) -> Result<Self, ReportError> {
        if folder.join(SHARD).is_file() {
            return Err(ReportError::Shard { path: folder.to_owned() });
        }
        if !folder.join(STUDY).is_file() && !folder.join(TABLES).is_dir() {
            return Err(ReportError::NotARelease { path: folder.to_owned() });
        }
        Ok(Self { folder: folder.to_owned() })
    }

    /// All that the report keeps in memory but the curves.
    fn tables(&self) -> Result<Data, ReportError> {
        let toml = self.text(STUDY)?.unwrap_or_default();
        let study = study(&toml).map_err(|e| read_error(STUDY, e))?;
        let rovers: Vec<RoverRow> = self.rows()?;
        let terrains = self.terrains(!rovers.is_empty())?;
        let (contents, manifest) = self.contents(&terrains)?;
        let (version, failed) =
            manifest.map_or_else(|| (env!("CARGO_PKG_VERSION").into(), Vec::new()), |m| (m.version, m.failed));
        Ok(Data {
            study_sha256: digest::of_text(&toml),
            version: format!("sastrugi {version}"),
            stored: self.stored()?,
            failed,
            fits: self.rows()?,
            covariance: self.rows()?,
            candidates: self.rows()?,
            candidate_curves: self.rows()?,
            likelihood_profile: self.rows()?,
            surfaces: self.rows()?,
            structure: Vec::new(),
            profile_psd: Vec::new(),
            psd: Vec::new(),
            heights: Vec::new(),
            scoreboard: self.rows()?,
            scoreboard_covariance: self.rows()?,
            missions: self.missions()?,
            replicates: self.starts()?,
            routes: self.rows()?,
            images: self.rows()?,
            photoclinometry: self.rows()?,
            photoclinometry_bands: self.rows()?,
            formations: self.rows()?,
            formation_events: self.rows()?,
            rovers,
            rover_effects: self.rows()?,
            parameters: self.rows()?,
            contents,
            against: None,
            logs: None,
            files: Box::new(Self { folder: self.folder.clone() }),
            without_curves: without_curves(study.seed, &terrains),
            study,
            terrains,
        })
    }

    /// Reads the curves that are drawn. Which textures these are depends on the answers on them, so the structure functions behind the answers are
    /// read first, and again with the others: they are few, and so no curve is held for a texture that turns out not to be drawn.
    fn read_curves(&self, data: &mut Data, undrawn: Undrawn) -> Result<(), ReportError> {
        let sites: BTreeSet<&str> = data.fits.iter().map(|fit| fit.fit_id.as_str()).collect();
        let is_compared =
            |row: &StructureRow| is_judged(row) || (row.direction == "all" && sites.contains(row.surface_id.as_str()));
        data.structure = self.rows_where(is_compared)?;
        let undrawn = undrawn(data);
        data.without_curves.extend(undrawn);
        let is_kept = |surface_id: &str| !data.without_curves.contains(surface_id);
        data.structure = Vec::new();
        data.structure = self.rows_where(|row: &StructureRow| is_compared(row) || is_kept(&row.surface_id))?;
        data.profile_psd = self.rows_where(|row: &ProfilePsdRow| is_kept(&row.surface_id))?;
        data.psd = self.rows_where(|row: &PsdRow| is_kept(&row.surface_id))?;
        data.heights = self.rows_where(|row: &HeightDistributionRow| is_kept(&row.surface_id))?;
        Ok(())
    }

    /// Content hashes of the heightfields by path, and the manifest, checked, without its list of files; nothing before a release is
    /// sealed. The files that a manifest lists and the report reads must be there: without one, the page would leave something out in
    /// silence.
    fn contents(&self, terrains: &[TerrainRow]) -> Result<(BTreeMap<String, String>, Option<Manifest>), ReportError> {
        let mut contents = BTreeMap::new();
        if fs::symlink_metadata(self.folder.join(MANIFEST)).is_err() {
            return Ok((contents, None));
        }
        let paths: BTreeSet<&str> = terrains.iter().map(|terrain| terrain.path.as_str()).collect();
        let mut there = Ok(());
        let manifest = sastrugi_store::release::for_each_artifact(&self.folder, |artifact| {
            if there.is_ok() && is_read(&artifact.path) {
                there = self.check_listed(&artifact.path);
            }
            if let Some(content) = artifact.origin.content_sha256.filter(|_| paths.contains(artifact.path.as_str())) {
                contents.insert(artifact.path, content);
            }
        });
        let manifest = manifest.map_err(|e| read_error(MANIFEST, e))?;
        there.map(|()| (contents, Some(manifest)))
    }

    /// Refuses a file that the manifest lists, but which is missing or not a regular file.
    fn check_listed(&self, path: &str) -> Result<(), ReportError> {
        let fault = match fs::metadata(self.folder.join(path)) {
            Ok(found) if found.is_file() => return Ok(()),
            Ok(_) => "not a regular file",
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => "missing",
            Err(e) => return Err(read_error(path, e)),
        };
        Err(read_error(path, format!("{fault}, although {MANIFEST} lists it; `sastrugi verify` finds all such files")))
    }

    /// Reads a file if it exists. A folder, and a path that leads out of the release, count as missing; a pipe or a device is refused.
    fn read<T, E: Display>(
        &self,
        path: &str,
        read: impl FnOnce(&Path) -> Result<T, E>,
    ) -> Result<Option<T>, ReportError> {
        let inside = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
        let file = self.folder.join(path);
        if !inside || !file.exists() || file.is_dir() {
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
        self.rows_where(|_: &R| true)
    }

    /// The rows of a table that meet a condition, sorted by key.
    fn rows_where<R: Record>(&self, is_wanted: impl Fn(&R) -> bool) -> Result<Vec<R>, ReportError> {
        let (rows, is_sorted) = self.rows_as_stored(|row: R| is_wanted(&row).then_some(row))?;
        Ok(if is_sorted { rows } else { in_order(rows) })
    }

    /// What `f` makes of the rows of a table, file by file, and whether that is in the order of their keys.
    fn rows_as_stored<R: Record, T>(&self, mut f: impl FnMut(R) -> Option<T>) -> Result<(Vec<T>, bool), ReportError> {
        let mut rows = Vec::new();
        let mut files = 0;
        self.for_each_file(&format!("{TABLES}/{}", R::TABLE.name), &mut |path| {
            files += 1;
            self.for_each_row(path, |row: R| rows.extend(f(row)))
        })?;
        rows.shrink_to_fit();
        Ok((rows, files < 2))
    }

    /// Calls `f` with every row of a file, if it exists.
    fn for_each_row<R: Record>(&self, path: &str, f: impl FnMut(R)) -> Result<(), ReportError> {
        self.read(path, |file| parquet::for_each_row(file, f)).map(|_| ())
    }

    /// All heightfields, sorted by id. Parameters of generated ones, 1 to 2 kB each, are read only for the worlds of rovers.
    fn terrains(&self, with_parameters: bool) -> Result<Vec<TerrainRow>, ReportError> {
        let (rows, is_sorted) = self.rows_as_stored(|mut row: TerrainRow| {
            if !with_parameters && row.stage == "terrain" {
                row.params = String::new();
            }
            Some(row)
        })?;
        Ok(if is_sorted { rows } else { in_order(rows) })
    }

    /// All missions, sorted by terrain and id, with shared names.
    fn missions(&self) -> Result<Vec<Mission>, ReportError> {
        let mut names = Names::default();
        let (mut missions, is_sorted) = self.rows_as_stored(|mut mission: Mission| {
            mission.share(&mut names);
            Some(mission)
        })?;
        if !is_sorted {
            missions.sort_by(|a, b| (&a.terrain_id, &a.mission_id).cmp(&(&b.terrain_id, &b.mission_id)));
        }
        Ok(missions)
    }

    /// All starts of missions with several starts, sorted by terrain, mission and number, with shared names.
    fn starts(&self) -> Result<Vec<Start>, ReportError> {
        let mut names = Names::default();
        let (mut starts, is_sorted) = self.rows_as_stored(|mut start: Start| {
            start.share(&mut names);
            Some(start)
        })?;
        if !is_sorted {
            let key = |s: &Start| (s.terrain_id.clone(), s.mission_id.clone(), s.replicate);
            starts.sort_by_cached_key(key);
        }
        Ok(starts)
    }

    /// Number and size of the data files.
    fn stored(&self) -> Result<Stored, ReportError> {
        let mut stored = Stored::default();
        for folder in DATA_FOLDERS {
            self.for_each_file(folder, &mut |path| {
                let bytes = fs::metadata(self.folder.join(path)).map_err(|e| read_error(path, e))?.len();
                stored.add(path, bytes);
                Ok(())
            })?;
        }
        Ok(stored)
    }

    /// Calls `f` with the path of each file below a folder, in order; never if there is no such folder.
    fn for_each_file(
        &self,
        folder: &str,
        f: &mut dyn FnMut(&str) -> Result<(), ReportError>,
    ) -> Result<(), ReportError> {
        let full = self.folder.join(folder);
        if !full.is_dir() {
            return Ok(());
        }
        let failed = |e| read_error(folder, e);
        let mut entries = fs::read_dir(full).map_err(failed)?.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        entries.sort_by_key(fs::DirEntry::file_name);
        entries.into_iter().try_for_each(|entry| {
            let path = format!("{folder}/{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() { self.for_each_file(&path, f) } else { f(&path) }
        })
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
        version: text("version"),
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
