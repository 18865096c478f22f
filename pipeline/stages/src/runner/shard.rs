//! Shards: a run split into N parts on N machines, and the merge of the parts.
//!
//! An item belongs to shard `1 + (key modulo N)`. A shard computes its own items and all their parents, but keeps only its own
//! items.

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
/// Maximum number of parts of a run.
const PARTS_MAX: u32 = 100_000;

/// Part `index` of `count`, counted from 1.
///
/// ```
/// use sastrugi_stages::runner::shard::Part;
///
/// let part = Part::parse("2/3")?;
/// assert_eq!((part.index, part.count), (2, 3));
/// // Every key belongs to one of the three parts.
/// let key = "0123456789abcdef0123456789abcdef";
/// assert_eq!((1..=3).filter(|&index| Part { index, count: 3 }.owns(key)).count(), 1);
/// assert!(Part::parse("4/3").is_err());
/// # Ok::<(), sastrugi_stages::Error>(())
/// ```
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
            Some((index, count)) if (Self { index, count }).is_valid() => Ok(Self { index, count }),
            _ => Err(Error::Usage(format!("`--shard {text}`: expected I/N with 1 <= I <= N, such as 1/3"))),
        }
    }

    /// True if the numbers are in range.
    fn is_valid(self) -> bool {
        1 <= self.index && self.index <= self.count && self.count <= PARTS_MAX
    }

    /// True if a key belongs to this part.
    pub fn owns(self, key: &str) -> bool {
        self.owner(key) == Some(self.index)
    }

    /// Number of the part that owns a key, from 1.
    fn owner(self, key: &str) -> Option<u32> {
        let n = u64::from_str_radix(key.get(..15)?, 16).ok()?;
        Some((n % u64::from(self.count)) as u32 + 1)
    }
}

/// Description of a shard, stored in its folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Description {
    part: Part,
    program: String,
    study_sha256: String,
    /// Every item of the study with its key, in graph order; the same in all shards.
    items: Vec<(ItemRef, String)>,
    /// Own items without a result.
    failures: Vec<Failure>,
    /// Assignment of terrains to train, validation and test; the same in all shards.
    #[serde(default)]
    splits: Splits,
}

/// Every item of a study with its key, in graph order.
pub fn all_items(graph: &Graph) -> Vec<(ItemRef, String)> {
    (0..graph.len()).map(|p| (graph.node(p).item.clone(), graph.key(p).to_owned())).collect()
}

/// Writes the folder of a shard, completely or not at all.
///
/// # Errors
/// A folder that is neither empty nor a shard, or an I/O error.
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
    /// Checks that the part is valid and that all items stay inside the folder.
    fn check(&self) -> Result<(), String> {
        let Part { index, count } = self.part;
        if !self.part.is_valid() {
            return Err(format!(
                "part {index} of {count} is invalid; parts count from 1, and there are at most {PARTS_MAX}"
            ));
        }
        self.items.iter().try_for_each(|(item, _)| {
            let place = format!("{}/{}", item.stage, item.id);
            check_path(&place).map_err(|e| e.to_string())
        })
    }

    /// True if it is the same part of the same study with fewer failed items.
    fn holds_more_than(&self, other: &Self) -> bool {
        let same = self.study_sha256 == other.study_sha256 && self.part == other.part;
        same && self.failures.len() < other.failures.len()
    }
}

/// The shard that already exists at the target.
fn occupant(target: &Path) -> Result<Option<Description>, Error> {
    if fs::read_dir(target).is_ok_and(|mut d| d.next().is_some()) {
        let refused =
            || format!("{} is neither empty nor a sastrugi shard; choose another folder with -o", target.display());
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

/// Merged shards: the study, and the folder of each result.
pub struct Joined {
    /// Text of the study.
    pub study: String,
    /// Folders of the results, parents before children.
    pub results: Vec<PathBuf>,
    /// Items without a result.
    pub failures: Vec<Failure>,
    /// Assignment of terrains to train, validation and test.
    pub splits: Splits,
}

/// Merges the shards of one study.
///
/// # Errors
/// Folders that are not shards; shards of different studies or programs; missing, repeated or incomplete shards. All are listed.
pub fn join(folders: &[PathBuf]) -> Result<Joined, Error> {
    let shards = folders.iter().map(|f| read(f)).collect::<Result<Vec<_>, Error>>()?;
    check_set(folders, &shards)?;
    let Some(first) = shards.first() else { return Err(Error::Usage("no shards given".to_owned())) };
    let study = sastrugi_store::file::read_text(&folders[0].join(STUDY))
        .map_err(|e| Error::Input(format!("{}: {e}", folders[0].display())))?;
    if sastrugi_store::digest::of_text(&study) != first.study_sha256 {
        return Err(Error::Input(format!(
            "{}: study.toml was changed after the shard was written",
            folders[0].display()
        )));
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

/// True if every file still has its recorded hash.
fn is_intact(record: &Record, folder: &Path) -> bool {
    let same =
        |f: &StoredFile| digest::of_file(&folder.join(&f.product.file)).is_ok_and(|(_, sha256)| sha256 == f.sha256);
    record.files.iter().all(same)
}

fn read(folder: &Path) -> Result<Description, Error> {
    let path = folder.join(DESCRIPTION);
    let bytes = sastrugi_store::file::read(&path)
        .map_err(|_| Error::Input(format!("{} is not a shard: it has no {DESCRIPTION}", folder.display())))?;
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
                "{name} is from another study, or another revision of the program, than {}",
                folders[0].display()
            ));
        } else if shard.program != first.program || shard.part.count != first.part.count {
            problems.push(format!(
                "{name} is one of {} shards by {}; expected one of {} by {}",
                shard.part.count, shard.program, first.part.count, first.program
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
        assert_eq!(Part::parse("100000/100000").unwrap(), Part { index: 100_000, count: 100_000 });
        for wrong in ["0/3", "4/3", "3", "a/b", "1/0", "-1/2", "1/100001", "1/2/3", ""] {
            let error = Part::parse(wrong).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{wrong}");
            let expected = format!("`--shard {wrong}`: expected I/N with 1 <= I <= N, such as 1/3");
            assert_eq!(error.to_string(), expected);
        }
    }

    /// The owner is the remainder of the first 15 digits, so it does not depend on the rest of the key: 0xa = 10 = 7 + 3.
    #[test]
    fn val_owners_of_keys() {
        let owner = |key: &str, count: u32| Part { index: 1, count }.owner(key);
        assert_eq!(owner("00000000000000a00000000000000000", 7), Some(4));
        assert_eq!(owner("00000000000000affffffffffffffff0", 7), Some(4));
        assert_eq!(owner("fffffffffffffff00000000000000000", 1), Some(1));
        assert_eq!((owner("00000000000000", 7), owner("no key, but long enough", 7)), (None, None));
    }

    /// Among 700 keys, each of seven parts owns some, and every key has one owner.
    #[test]
    fn prop_every_key_has_one_owner() {
        let mut owned = [0; 7];
        for n in 1..=700_u64 {
            let key = format!("{:032x}", u128::from(n.wrapping_mul(0x9e37_79b9_7f4a_7c15)) << 64);
            let owners: Vec<u32> = (1..=7).filter(|&index| Part { index, count: 7 }.owns(&key)).collect();
            assert_eq!(owners.len(), 1, "{key}");
            owned[owners[0] as usize - 1] += 1;
        }
        assert!(owned.iter().all(|count| *count > 0), "{owned:?}");
    }

    fn description(index: u32, count: u32) -> Description {
        Description {
            part: Part { index, count },
            program: "sastrugi".to_owned(),
            study_sha256: "ab".to_owned(),
            items: vec![(ItemRef::new("terrain", "a"), "0".repeat(32))],
            failures: Vec::new(),
            splits: Splits::new(),
        }
    }

    fn failure() -> Failure {
        Failure {
            item: ItemRef::new("terrain", "a"),
            message: "failed".to_owned(),
            unusable_input: false,
            skipped_for: None,
            parameters: serde_json::Value::Null,
        }
    }

    /// All parts of one study by one program, in any order.
    #[test]
    fn val_only_complete_sets_are_merged() {
        let folders = ["one", "two", "three"].map(PathBuf::from);
        let check = |shards: &[Description]| {
            check_set(&folders[..shards.len()], shards).map_err(|e| e.to_string()).err().unwrap_or_default()
        };
        assert_eq!(check(&[description(3, 3), description(1, 3), description(2, 3)]), "");
        assert_eq!(check(&[description(1, 3), description(3, 3)]), "shard 2 of 3 is missing");
        assert_eq!(check(&[description(1, 3)]), "shard 2, 3 of 3 is missing");
        assert_eq!(check(&[description(1, 2), description(1, 2)]), "two and one are both shard 1");
        let counted = "two is one of 3 shards by sastrugi; expected one of 2 by sastrugi";
        assert_eq!(check(&[description(1, 2), description(2, 3)]), counted);
        let other = Description { study_sha256: "cd".to_owned(), ..description(2, 2) };
        let items = Description { items: Vec::new(), ..description(2, 2) };
        for stranger in [other, items] {
            let error = check(&[description(1, 2), stranger]);
            assert_eq!(error, "two is from another study, or another revision of the program, than one");
        }
    }

    /// Descriptions come from outside: they must not name places beyond the folder of the shard.
    #[test]
    fn val_hostile_descriptions_are_refused() {
        assert_eq!(description(2, 3).check(), Ok(()));
        for (index, count) in [(0, 3), (4, 3), (1, 100_001)] {
            let error = description(index, count).check().unwrap_err();
            assert!(error.starts_with(&format!("part {index} of {count} is invalid")), "{error}");
        }
        for id in ["../a", "a/../../b", "", ".hidden"] {
            let items = vec![(ItemRef::new("terrain", id), "0".repeat(32))];
            assert!(Description { items, ..description(1, 1) }.check().is_err(), "{id}");
        }
    }

    /// A shard is not replaced by the same one with more failed items.
    #[test]
    fn val_a_shard_that_holds_more() {
        let (complete, lacking) = (description(1, 2), Description { failures: vec![failure()], ..description(1, 2) });
        assert!(complete.holds_more_than(&lacking));
        assert!(!lacking.holds_more_than(&complete) && !complete.holds_more_than(&complete));
        let other = Description { study_sha256: "cd".to_owned(), ..description(1, 2) };
        assert!(!other.holds_more_than(&lacking) && !description(2, 2).holds_more_than(&lacking));
    }
}
