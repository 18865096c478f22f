//! The manifest of a release with very many files, read without holding the list of them.

use super::{MANIFEST, ReleaseError, check_head, check_listed, unread};
use sastrugi_schemas::manifest::{Artifact, FailedItem, Manifest};
use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Calls `f` with every file that the manifest of a release lists, and returns the manifest without them. Memory is bounded by one entry.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_schemas::manifest::Origin;
/// use sastrugi_store::release::{Head, ReleaseBuilder, for_each_artifact};
///
/// let folder = tempfile::tempdir()?;
/// let dest = folder.path().join("release");
/// let [study_sha256, version, license] = ["", "1.0.0", "CC0-1.0"].map(str::to_owned);
/// let mut builder = ReleaseBuilder::beside(&dest, Head { name: "snow".to_owned(), study_sha256, seed: 7, version, license })?;
/// builder.write_text("README.md", "Snow.", Origin::default())?;
/// builder.seal(&dest)?;
///
/// let mut paths = Vec::new();
/// let manifest = for_each_artifact(&dest, |artifact| paths.push(artifact.path))?;
/// assert_eq!((manifest.seed, paths), (7, vec!["README.md".to_owned()]));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`ReleaseError::NotARelease`] if the folder has no manifest of this format, or if it lists an invalid path, a path twice, or paths out of
/// order.
pub fn for_each_artifact(folder: &Path, f: impl FnMut(Artifact)) -> Result<Manifest, ReleaseError> {
    let path = folder.join(MANIFEST);
    let file = crate::file::open(&path).map_err(unread(folder, &path))?;
    let manifest = read(file, f).map_err(|e| format!("{MANIFEST} cannot be parsed: {e}"));
    let checked = manifest.and_then(|manifest| check_head(&manifest).map(|()| manifest));
    checked.map_err(|reason| ReleaseError::not_a_release(folder, reason))
}

fn read(file: File, f: impl FnMut(Artifact)) -> Result<Manifest, serde_json::Error> {
    let mut json = serde_json::Deserializer::from_reader(BufReader::with_capacity(1 << 16, file));
    let mut failed = Vec::new();
    let keys = json.deserialize_map(Parts { f, failed: &mut failed })?;
    json.end()?;
    let manifest: Manifest = serde_json::from_value(Value::Object(keys))?;
    Ok(Manifest { failed, ..manifest })
}

/// Visitor of a manifest's keys: files are passed to the function, failed items, of which there may be many, are added to their list.
struct Parts<'a, F> {
    f: F,
    failed: &'a mut Vec<FailedItem>,
}

impl<'de, F: FnMut(Artifact)> Visitor<'de> for Parts<'_, F> {
    type Value = Map<String, Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a manifest")
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut rest = Map::new();
        while let Some(key) = map.next_key::<String>()? {
            if rest.contains_key(&key) {
                return Err(A::Error::custom(format!("duplicate field `{key}`")));
            }
            let value = match key.as_str() {
                "artifacts" => {
                    map.next_value_seed(Files(&mut self.f))?;
                    Value::Array(Vec::new())
                }
                "failed" => {
                    *self.failed = map.next_value()?;
                    Value::Array(Vec::new())
                }
                _ => map.next_value()?,
            };
            rest.insert(key, value);
        }
        Ok(rest)
    }
}

/// The list of files.
struct Files<'f, F>(&'f mut F);

impl<'de, F: FnMut(Artifact)> DeserializeSeed<'de> for Files<'_, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, list: D) -> Result<(), D::Error> {
        list.deserialize_seq(self)
    }
}

impl<'de, F: FnMut(Artifact)> Visitor<'de> for Files<'_, F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of files")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let mut before = String::new();
        while let Some(artifact) = list.next_element::<Artifact>()? {
            check_listed(&artifact.path, &before).map_err(|reason| A::Error::custom(format!("it {reason}")))?;
            before.clone_from(&artifact.path);
            (self.0)(artifact);
        }
        Ok(())
    }
}
