//! Shards: one run in N parts on N machines, and joining them again.
//!
//! An item belongs to shard `1 + (key modulo N)`. A shard computes the parents that its items need, whether they are its
//! own or not, and keeps its own items only.

use super::assemble::{DestinationLock, fewer_items};
use super::cache::{Cache, Record, StoredFile, load_record};
use super::execute::Failure;
use super::graph::Graph;
use crate::error::Error;
use crate::job::ItemRef;
use crate::loaded::Loaded;
use crate::splits::Splits;
use sastrugi_store::release::{Staging, check_path};
use sastrugi_store::{atomic, digest};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

const DESCRIPTION: &str = sastrugi_store::release::SHARD;
const STUDY: &str = "study.toml";
/// Most parts of a run.
const PARTS_MAX: u32 = 100_000;

/// Part `index` of `count`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// This part.
    pub index: u32,
    /// Number of parts.
    pub count: u32,
}

impl Part {
    /// Reads `I/N`.
    ///
    /// # Errors
    /// Anything but 1 <= I <= N <= 100 000.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, count)) if (Self { index, count }).is_one() => Ok(Self { index, count }),
            _ => Err(Error::Usage(format!("`--shard {text}`: it takes I/N with 1 <= I <= N, as 1/3"))),
        }
    }

    /// True for a part that there can be.
    fn is_one(self) -> bool {
        1 <= self.index && self.index <= self.count && self.count <= PARTS_MAX
    }

    /// True for a key of this part.
    pub fn owns(self, key: &str) -> bool {
        self.owner(key) == Some(self.index)
    }

    /// The part, of as many as there are, that a key belongs to.
    fn owner(self, key: &str) -> Option<u32> {
        let n = u64::from_str_radix(key.get(..15)?, 16).ok()?;
        Some((n % u64::from(self.count)) as u32 + 1)
    }
}

/// What a shard's folder says of itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Description {
    part: Part,
    program: String,
    study_sha256: String,
    /// Every item of the study with its key, in graph order; the same in all shards.
    items: Vec<(ItemRef, String)>,
    /// Own items without a result.
    failures: Vec<Failure>,
    /// Which terrains are for training, validation and test; the same in all shards.
    #[serde(default)]
    splits: Splits,
}

/// Every item of a study with its key, in graph order.
pub fn all_items(graph: &Graph) -> Vec<(ItemRef, String)> {
    (0..graph.len()).map(|p| (graph.node(p).item.clone(), graph.key(p).to_owned())).collect()
}

/// Writes a shard's folder: whole or not at all.
///
/// # Errors
/// A folder that is not empty and no shard, or a file system that refuses.
pub fn write(
    target: &Path,
    loaded: &Loaded,
    cache: &Cache,
    part: Part,
    failures: &[Failure],
    replace: bool,
) -> Result<(), Error> {
    let (graph, study) = (&loaded.graph, loaded.released.as_str());
    let replaced = occupant(target)?;
    let _lock = DestinationLock::take(target)?;
    let staging = Staging::beside(target)?;
    let own: Vec<usize> = (0..graph.len()).filter(|&p| part.owns(graph.key(p))).collect();
    for &position in &own {
        let (item, key) = (&graph.node(position).item, graph.key(position));
        if let Some(record) = cache.load(item, key) {
            copy_result(&record, &cache.result_folder(item, key), &item_folder(staging.path(), item))?;
        }
    }
    let owned = |f: &&Failure| graph.find(&f.item).is_some_and(|p| own.contains(&p));
    let description = Description {
        part,
        program: sastrugi_store::PROGRAM.to_owned(),
        study_sha256: sastrugi_store::digest::of_text(study),
        items: all_items(graph),
        failures: failures.iter().filter(owned).cloned().collect(),
        splits: loaded.splits.clone(),
    };
    if let Some(before) = replaced.filter(|before| !replace && before.holds_more_than(&description)) {
        return Err(fewer_items(target, before.failures.len(), description.failures.len()));
    }
    let text = serde_json::to_vec_pretty(&description).map_err(Error::failed)?;
    for (name, bytes) in [(STUDY, study.as_bytes()), (DESCRIPTION, &text)] {
        let path = staging.path().join(name);
        atomic::write(&path, bytes).map_err(|e| Error::at(&path, e))?;
    }
    staging.put_in_place(target).map_err(Error::from)
}

impl Description {
    /// Whether it can be believed: its part is one, and its items lie in its folder.
    fn check(&self) -> Result<(), String> {
        let Part { index, count } = self.part;
        if !self.part.is_one() {
            return Err(format!(
                "it is part {index} of {count}; a part is 1 to the number of parts, {PARTS_MAX} at most"
            ));
        }
        self.items.iter().try_for_each(|(item, _)| {
            let place = format!("{}/{}", item.stage, item.id);
            check_path(&place).map_err(|e| e.to_string())
        })
    }

    /// Whether it is of the same part of the same study, with fewer failed items.
    fn holds_more_than(&self, other: &Self) -> bool {
        let same = self.study_sha256 == other.study_sha256 && self.part == other.part;
        same && self.failures.len() < other.failures.len()
    }
}

/// The shard that is there already.
fn occupant(target: &Path) -> Result<Option<Description>, Error> {
    if fs::read_dir(target).is_ok_and(|mut d| d.next().is_some()) {
        let refused =
            || format!("{}: not a sastrugi shard, and not empty; choose another folder with -o", target.display());
        return read(target).map(Some).map_err(|_| Error::Usage(refused()));
    }
    Ok(None)
}

fn item_folder(shard: &Path, item: &ItemRef) -> PathBuf {
    shard.join("items").join(&item.stage).join(&item.id)
}

fn copy_result(record: &Record, from: &Path, to: &Path) -> Result<(), Error> {
    fs::create_dir_all(to).map_err(|e| Error::at(to, e))?;
    let names = record.files.iter().map(|f| f.product.file.as_str()).chain(["record.json"]);
    for name in names {
        let target = to.join(name);
        fs::copy(from.join(name), &target)
            .and_then(|_| File::open(&target)?.sync_all())
            .map_err(|e| Error::at(&target, e))?;
    }
    Ok(())
}

/// Shards joined: the study, and where each item's result is.
pub struct Joined {
    /// The study's text.
    pub study: String,
    /// Folders of the results, parents before children.
    pub results: Vec<PathBuf>,
    /// Items without a result.
    pub failures: Vec<Failure>,
    /// Which terrains are for training, validation and test.
    pub splits: Splits,
}

/// Joins the shards of one study.
///
/// # Errors
/// Folders that are no shards, shards of different studies or programs, missing, repeated or incomplete ones, all listed.
pub fn join(folders: &[PathBuf]) -> Result<Joined, Error> {
    let shards = folders.iter().map(|f| read(f)).collect::<Result<Vec<_>, Error>>()?;
    check_set(folders, &shards)?;
    let Some(first) = shards.first() else { return Err(Error::Usage("no shards are named".to_owned())) };
    let study = sastrugi_store::file::read_text(&folders[0].join(STUDY))
        .map_err(|e| Error::Input(format!("{}: {e}", folders[0].display())))?;
    if sastrugi_store::digest::of_text(&study) != first.study_sha256 {
        return Err(Error::Input(format!("{}: its study.toml was changed", folders[0].display())));
    }
    let failures: BTreeMap<ItemRef, Failure> =
        shards.iter().flat_map(|s| &s.failures).map(|f| (f.item.clone(), f.clone())).collect();
    let by_part: BTreeMap<u32, &PathBuf> = shards.iter().map(|s| s.part.index).zip(folders).collect();
    let mut results = Vec::new();
    for (item, key) in &first.items {
        let owner = first.part.owner(key);
        let folder = owner.and_then(|o| by_part.get(&o)).map(|f| item_folder(f, item));
        let result = folder.filter(|f| load_record(f).is_some_and(|r| r.key == *key && is_intact(&r, f)));
        if result.is_none() && !failures.contains_key(item) {
            return Err(Error::Input(format!("{item} is missing or damaged in its shard; run that shard again")));
        }
        results.extend(result);
    }
    Ok(Joined { study, results, failures: failures.into_values().collect(), splits: first.splits.clone() })
}

/// True when every file has the bytes that it was made with.
fn is_intact(record: &Record, folder: &Path) -> bool {
    let same =
        |f: &StoredFile| digest::of_file(&folder.join(&f.product.file)).is_ok_and(|(_, sha256)| sha256 == f.sha256);
    record.files.iter().all(same)
}

fn read(folder: &Path) -> Result<Description, Error> {
    let path = folder.join(DESCRIPTION);
    let bytes = sastrugi_store::file::read(&path)
        .map_err(|_| Error::Input(format!("{}: no shard (it has no {DESCRIPTION})", folder.display())))?;
    let description: Description =
        serde_json::from_slice(&bytes).map_err(|e| Error::Input(format!("{}: {e}", path.display())))?;
    description.check().map_err(|reason| Error::Input(format!("{}: {reason}", path.display())))?;
    Ok(description)
}

fn check_set(folders: &[PathBuf], shards: &[Description]) -> Result<(), Error> {
    let Some(first) = shards.first() else { return Ok(()) };
    let mut problems = Vec::new();
    let mut seen: BTreeMap<u32, &PathBuf> = BTreeMap::new();
    for (shard, folder) in shards.iter().zip(folders) {
        let name = folder.display();
        if shard.study_sha256 != first.study_sha256 || shard.items != first.items {
            problems.push(format!(
                "{name} is of another study (or another revision of the program) than {}",
                folders[0].display()
            ));
        } else if shard.program != first.program || shard.part.count != first.part.count {
            problems.push(format!(
                "{name} is one of {} shards by {}, not of {}",
                shard.part.count, shard.program, first.part.count
            ));
        } else if let Some(other) = seen.insert(shard.part.index, folder) {
            problems.push(format!("{name} and {} are both shard {}", other.display(), shard.part.index));
        }
    }
    let missing: Vec<String> =
        (1..=first.part.count).filter(|i| !seen.contains_key(i)).map(|i| i.to_string()).collect();
    if problems.is_empty() && !missing.is_empty() {
        problems.push(format!("shard {} of {} is missing", missing.join(", "), first.part.count));
    }
    if problems.is_empty() { Ok(()) } else { Err(Error::Input(problems.join("; "))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_parts() {
        assert_eq!(Part::parse("2/3").unwrap(), Part { index: 2, count: 3 });
        for wrong in ["0/3", "4/3", "3", "a/b", "1/0", "-1/2", "1/100001"] {
            assert!(Part::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn prop_every_key_has_one_owner() {
        for n in 1..50u64 {
            let key = format!("{:032x}", u128::from(n * 0x9e37_79b9_7f4a_7c15) << 64);
            let owners = (1..=7).filter(|&index| Part { index, count: 7 }.owns(&key)).count();
            assert_eq!(owners, 1);
        }
    }
}
