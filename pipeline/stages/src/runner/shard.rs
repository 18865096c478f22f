//! Shards: a run split into N parts on N machines, and the merge of the parts.
//!
//! An item belongs to shard `1 + (key modulo N)`. A shard computes its own items and all their parents, but keeps only its own
//! items. Its description lists them with their places in the study, and has the hash of the list of all items. The lists of N shards together
//! are that list, and take no more space.

use super::assemble::{DestinationLock, fewer_items};
use super::cache::{Cache, Record, StoredFile, copy_result, load_record};
use super::damage::{Changed, and_others};
use super::execute::Failure;
use super::graph::Graph;
use crate::error::Error;
use crate::job::ItemRef;
use crate::loaded::Loaded;
use crate::splits::Splits;
use crate::studies::head_of;
use crate::study::Study;
use sastrugi_store::atomic::{self, AtomicFile};
use sastrugi_store::digest::{self, ContentHash};
use sastrugi_store::release::{Staging, check_path};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, ErrorKind};
use std::path::{Path, PathBuf};

const DESCRIPTION: &str = sastrugi_store::release::SHARD;
const STUDY: &str = "study.toml";
/// Maximum number of items that one message names.
const ITEMS_NAMED: usize = 5;
/// Maximum number of parts of a run.
pub const PARTS_MAX: u32 = 10_000;
/// The part with what all have in common.
const FIRST: u32 = 1;

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
    /// Anything but 1 <= I <= N <= 10 000.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, count)) if (Self { index, count }).is_valid() => Ok(Self { index, count }),
            _ => Err(Error::Usage(format!(
                "`--shard {text}`: expected I/N with 1 <= I <= N <= {PARTS_MAX}, such as 1/3"
            ))),
        }
    }

    /// True if the numbers are in range.
    fn is_valid(self) -> bool {
        1 <= self.index && self.index <= self.count && self.count <= PARTS_MAX
    }

    /// True if a key belongs to this part.
    pub fn owns(self, key: &str) -> bool {
        owner(key, self.count) == Some(self.index)
    }
}

/// Number of the part that owns a key, 1 to `count`.
pub fn owner(key: &str, count: u32) -> Option<u32> {
    let n = u64::from_str_radix(key.get(..15)?, 16).ok()?;
    Some((n % u64::from(count)) as u32 + 1)
}

/// Description of a shard, stored in its folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Description {
    part: Part,
    program: String,
    study_sha256: String,
    /// All items of the study; the same in all shards.
    study_items: StudyItems,
    /// Own items, in graph order.
    items: Vec<OwnItem>,
    /// Own items without a result.
    failures: Vec<Failure>,
    /// Assignment of terrains to train, validation and test; only in the first shard.
    #[serde(default)]
    splits: Splits,
}

/// All items of a study, as a number and a hash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct StudyItems {
    number: u64,
    /// SHA-256 of stages, ids and keys, in graph order.
    sha256: String,
}

impl StudyItems {
    fn of<'a>(items: impl Iterator<Item = (&'a ItemRef, &'a str)>) -> Self {
        let (mut number, mut hash) = (0, ContentHash::new("items"));
        for (item, key) in items {
            [item.stage.as_str(), &item.id, key].into_iter().for_each(|text| hash.text(text));
            number += 1;
        }
        Self { number, sha256: hash.finish() }
    }
}

/// An item of a shard.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct OwnItem {
    /// Place among all items of the study, in graph order.
    position: usize,
    item: ItemRef,
    key: String,
}

impl OwnItem {
    fn at(graph: &Graph, position: usize) -> Self {
        Self { position, item: graph.node(position).item.clone(), key: graph.key(position).to_owned() }
    }
}

/// Writes the folder of a shard, completely or not at all.
///
/// # Errors
/// As [`check_destination`]; the same shard with fewer failed items, unless it may be replaced; results that changed, which are removed; an
/// I/O error.
pub fn write(
    target: &Path,
    loaded: &Loaded,
    cache: &Cache,
    part: Part,
    failures: &[Failure],
    replace: bool,
) -> Result<(), Error> {
    let (graph, study) = (&loaded.graph, loaded.released.as_str());
    let _lock = DestinationLock::take(target)?;
    let replaced = occupant(target)?;
    check_occupant(replaced.as_ref(), &loaded.study, target, part, replace)?;
    let staging = Staging::beside(target)?;
    let changed = Changed::default();
    let own = (0..graph.len()).filter(|&position| part.owns(graph.key(position)));
    let items: Vec<OwnItem> = own.map(|position| OwnItem::at(graph, position)).collect();
    for OwnItem { item, key, .. } in &items {
        if let Some(record) = cache.load(item, key) {
            let to = item_folder(staging.path(), item);
            fs::create_dir_all(&to).map_err(|e| Error::at(&to, e))?;
            copy_result(&record, &cache.result_folder(item, key), &to, &changed)?;
        }
    }
    changed.remove()?;
    let owned = |f: &&Failure| graph.find(&f.item).is_some_and(|p| part.owns(graph.key(p)));
    let description = Description {
        part,
        program: sastrugi_store::PROGRAM.to_owned(),
        study_sha256: sastrugi_store::digest::of_text(study),
        study_items: StudyItems::of((0..graph.len()).map(|p| (&graph.node(p).item, graph.key(p)))),
        items,
        failures: failures.iter().filter(owned).cloned().collect(),
        splits: if part.index == FIRST { loaded.splits.clone() } else { Splits::new() },
    };
    if let Some(before) = replaced.filter(|before| !replace && before.holds_more_than(&description)) {
        return Err(fewer_items(target, before.failures.len(), description.failures.len()));
    }
    let [of_study, of_description] = [STUDY, DESCRIPTION].map(|name| staging.path().join(name));
    atomic::write(&of_study, study.as_bytes()).map_err(|e| Error::at(&of_study, e))?;
    description.write(&of_description).map_err(|e| Error::at(&of_description, e))?;
    staging.put_in_place(target).map_err(Error::from)
}

impl Description {
    /// Writes the description piece by piece: it may list very many items.
    fn write(&self, path: &Path) -> io::Result<()> {
        let mut file = AtomicFile::create(path)?;
        serde_json::to_writer_pretty(&mut file, self)?;
        file.commit()
    }

    /// Checks that the shard is valid, and that all items belong to it and stay inside the folder.
    fn check(&self) -> Result<(), String> {
        let Part { index, count } = self.part;
        if !self.part.is_valid() {
            return Err(format!(
                "shard {index} of {count} is invalid; shards count from 1, and there are at most {PARTS_MAX}"
            ));
        }
        self.items.iter().try_for_each(|OwnItem { item, key, .. }| {
            check_path(&item.to_string()).map_err(|e| e.to_string())?;
            if self.part.owns(key) {
                Ok(())
            } else {
                Err(format!("{item} does not belong to shard {index} of {count}"))
            }
        })
    }

    /// True if it is the same shard of the same study with fewer failed items.
    fn holds_more_than(&self, other: &Self) -> bool {
        let same = self.study_sha256 == other.study_sha256 && self.part == other.part;
        same && self.failures.len() < other.failures.len()
    }
}

/// Refuses a destination that is neither empty nor a shard, or, unless it may be replaced, another shard or a shard of another study.
///
/// # Errors
/// Such a destination.
pub fn check_destination(study: &Study, target: &Path, part: Part, replace: bool) -> Result<(), Error> {
    check_occupant(occupant(target)?.as_ref(), study, target, part, replace)
}

fn check_occupant(
    there: Option<&Description>,
    study: &Study,
    target: &Path,
    part: Part,
    replace: bool,
) -> Result<(), Error> {
    let Some(there) = there.filter(|_| !replace) else { return Ok(()) };
    let Part { index, count } = there.part;
    // A shard whose study is missing or damaged cannot be merged, and nothing but this run mends it.
    let other = head_of(target).ok().map(|head| head.name).filter(|name| *name != study.head.name);
    let what = match other {
        _ if there.part != part => format!("shard {index} of {count}"),
        Some(name) => format!("a shard of the study `{name}`"),
        None => return Ok(()),
    };
    let advice = "choose another folder with -o, or use --replace to replace it";
    Err(Error::Usage(format!("{} is {what}; {advice}", target.display())))
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

/// The shard that the folder of a result lies in.
fn shard_folder(result: &Path) -> PathBuf {
    result.ancestors().nth(3).unwrap_or(result).to_owned()
}

/// Merged shards: the study, and the folder of each result.
pub struct Joined {
    /// Text of the study.
    pub study: String,
    /// Folders of the results, parents before children.
    pub results: Vec<PathBuf>,
    /// Items without a result.
    pub failures: Vec<Failure>,
    /// Shard of each of them, by the item's name.
    pub failed_in: BTreeMap<String, u32>,
    /// Assignment of terrains to train, validation and test.
    pub splits: Splits,
}

/// Merges the shards of one study.
///
/// # Errors
/// Folders that are not shards; shards of different studies or programs; missing, repeated or incomplete shards. All are listed, with what to
/// run again. Nothing that is complete is computed again.
pub fn join(folders: &[PathBuf]) -> Result<Joined, Error> {
    let (mut shards, mut problems) = read_all(folders);
    let of_set = check_set(&shards);
    if let Some(one) = shards.first().filter(|_| !problems.is_empty() && of_set.is_empty()) {
        let it = if problems.len() == 1 { "it" } else { "them" };
        problems.push(format!("all {} shards are present without {it}; leave {it} out", one.shard.part.count));
    }
    problems.extend(of_set);
    if !problems.is_empty() {
        return Err(Error::Input(problems.join("; ")));
    }
    let items = all_items(&mut shards)?;
    let Some(Placed { folder, shard: first }) = shards.first() else {
        return Err(Error::Usage("no shards given".to_owned()));
    };
    let study = sastrugi_store::file::read_text(&folder.join(STUDY))
        .map_err(|e| Error::Input(format!("{}: {e}", folder.display())))?;
    if sastrugi_store::digest::of_text(&study) != first.study_sha256 {
        return Err(Error::Input(format!("{}: study.toml was changed after the shard was written", folder.display())));
    }
    let failures: BTreeMap<ItemRef, Failure> =
        shards.iter().flat_map(|p| &p.shard.failures).map(|f| (f.item.clone(), f.clone())).collect();
    let failed_in = shards.iter().map(|p| &p.shard);
    let failed_in = failed_in.flat_map(|s| s.failures.iter().map(|f| (f.item.to_string(), s.part.index)));
    let holder = shards.iter().find(|placed| placed.shard.part.index == FIRST);
    Ok(Joined {
        study,
        results: results(&shards, &items, &failures)?,
        failed_in: failed_in.collect(),
        splits: holder.map_or_else(Splits::new, |placed| placed.shard.splits.clone()),
        failures: failures.into_values().collect(),
    })
}

/// A shard and its folder.
struct Placed<'a> {
    folder: &'a PathBuf,
    shard: Description,
}

/// The shards, and why other folders are not shards.
fn read_all(folders: &[PathBuf]) -> (Vec<Placed<'_>>, Vec<String>) {
    let (mut shards, mut problems) = (Vec::new(), Vec::new());
    for folder in folders {
        match read(folder) {
            Ok(shard) => shards.push(Placed { folder, shard }),
            Err(e) => problems.push(e.to_string()),
        }
    }
    (shards, problems)
}

/// All items of the study in graph order, from the lists of a complete set of shards, which are emptied.
///
/// # Errors
/// Lists that do not have each item of the study exactly once.
fn all_items(shards: &mut [Placed<'_>]) -> Result<Vec<OwnItem>, Error> {
    let mut items: Vec<OwnItem> =
        shards.iter_mut().flat_map(|placed| std::mem::take(&mut placed.shard.items)).collect();
    items.sort_by_key(|own| own.position);
    let is_complete = items.iter().enumerate().all(|(place, own)| own.position == place);
    let found = StudyItems::of(items.iter().map(|own| (&own.item, own.key.as_str())));
    match shards.first() {
        Some(first) if !is_complete || found != first.shard.study_items => {
            let count = first.shard.part.count;
            let numbers: Vec<u32> = (1..=count).collect();
            let advice = mend(&numbers, count);
            Err(Error::Input(format!("the shards do not list each item of the study exactly once; {advice}")))
        }
        _ => Ok(items),
    }
}

/// The folders of all results, parents before children. Their files are on disk.
fn results(
    shards: &[Placed<'_>],
    items: &[OwnItem],
    failures: &BTreeMap<ItemRef, Failure>,
) -> Result<Vec<PathBuf>, Error> {
    let by_part: BTreeMap<u32, &PathBuf> = shards.iter().map(|p| (p.shard.part.index, p.folder)).collect();
    let Some(Placed { shard: first, .. }) = shards.first() else { return Ok(Vec::new()) };
    let mut results = Vec::new();
    let mut missing: BTreeMap<u32, Vec<&ItemRef>> = BTreeMap::new();
    for OwnItem { item, key, .. } in items {
        let part = owner(key, first.part.count).unwrap_or(1);
        let Some(folder) = by_part.get(&part).map(|folder| item_folder(folder, item)) else { continue };
        if let Some(record) = load_record(&folder).filter(|r| r.key == *key && is_intact(r, &folder)) {
            flush(&record, &folder)?;
            results.push(folder);
        } else if !failures.contains_key(item) {
            missing.entry(part).or_default().push(item);
        }
    }
    let problem = |(part, items): (&u32, &Vec<&ItemRef>)| {
        let folder = by_part.get(part).map_or_else(String::new, |folder| folder.display().to_string());
        let names: Vec<String> = items.iter().take(ITEMS_NAMED).map(ToString::to_string).collect();
        let more =
            if items.len() > ITEMS_NAMED { format!(" and {} more", items.len() - ITEMS_NAMED) } else { String::new() };
        format!(
            "shard {part} ({folder}): {}{more} missing or damaged; {}",
            names.join(", "),
            mend(&[*part], first.part.count)
        )
    };
    let problems: Vec<String> = missing.iter().map(problem).collect();
    if problems.is_empty() { Ok(results) } else { Err(Error::Input(problems.join("; "))) }
}

/// Refuses results of shards that changed while they were merged. They stay in place, since a shard is replaced as a whole.
///
/// # Errors
/// Any such result; each shard is named with its first one and what to run again.
pub fn refuse_changed(changed: Changed) -> Result<(), Error> {
    let mut shards: BTreeMap<PathBuf, Vec<String>> = BTreeMap::new();
    for (result, what) in changed.into_found() {
        shards.entry(shard_folder(&result)).or_default().push(what);
    }
    let mut problems = Vec::new();
    for (folder, results) in &shards {
        let Part { index, count } = read(folder)?.part;
        problems.push(format!(
            "shard {index} ({}): {} was changed while it was merged{}; {}",
            folder.display(),
            results.first().map_or("", String::as_str),
            and_others(results.len()),
            mend(&[index], count)
        ));
    }
    if problems.is_empty() { Ok(()) } else { Err(Error::Input(problems.join("; "))) }
}

/// What to do about missing or damaged shards.
fn mend(numbers: &[u32], count: u32) -> String {
    let shards = match numbers {
        [one] => format!("`--shard {one}/{count}`"),
        several => format!("`--shard I/{count}` for I = {}", ranges(several)),
    };
    format!("run the study again with {shards}, then merge again; complete items are not recomputed")
}

/// Sorted numbers as a list of ranges, such as `2,5-7`: the form that Slurm's `--array` takes.
fn ranges(numbers: &[u32]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let text = |run: &[u32]| match run {
        [first, .., last] => format!("{first}-{last}"),
        other => other.iter().map(u32::to_string).collect(),
    };
    runs.map(text).collect::<Vec<String>>().join(",")
}

/// True if every file still has its recorded hash.
fn is_intact(record: &Record, folder: &Path) -> bool {
    let same =
        |f: &StoredFile| digest::of_file(&folder.join(&f.product.file)).is_ok_and(|(_, sha256)| sha256 == f.sha256);
    record.files.iter().all(same)
}

/// Flushes the files that go into the release to disk: the release links to them, a link flushes nothing, and neither do the programs with
/// which users copy shards. Files that are on disk cost nothing.
fn flush(record: &Record, folder: &Path) -> Result<(), Error> {
    let released = record.files.iter().filter(|file| file.product.release_path.is_some());
    released.map(|file| folder.join(&file.product.file)).try_for_each(|path| {
        match File::open(&path).and_then(|file| file.sync_all()) {
            // What a read-only file system answers, if anything.
            Err(e) if matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::ReadOnlyFilesystem) => Ok(()),
            flushed => flushed.map_err(|e| Error::at(&path, e)),
        }
    })
}

fn read(folder: &Path) -> Result<Description, Error> {
    let path = folder.join(DESCRIPTION);
    let file = sastrugi_store::file::open(&path)
        .map_err(|_| Error::Input(format!("{} is not a shard: it has no {DESCRIPTION}", folder.display())))?;
    let description: Description = serde_json::from_reader(BufReader::with_capacity(1 << 16, file))
        .map_err(|e| Error::Input(format!("{}: {e}", path.display())))?;
    description.check().map_err(|reason| Error::Input(format!("{}: {reason}", path.display())))?;
    Ok(description)
}

/// Why shards do not form one complete study.
fn check_set(shards: &[Placed<'_>]) -> Vec<String> {
    let Some(Placed { folder: first_folder, shard: first }) = shards.first() else { return Vec::new() };
    let mut problems = Vec::new();
    let mut seen: BTreeMap<u32, &PathBuf> = BTreeMap::new();
    for Placed { folder, shard } in shards {
        let name = folder.display();
        if shard.study_sha256 != first.study_sha256 || shard.study_items != first.study_items {
            problems.push(format!(
                "{name} is from another study, or another revision of the program, than {}",
                first_folder.display()
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
    let count = first.part.count;
    let missing: Vec<u32> = (1..=count).filter(|i| !seen.contains_key(i)).collect();
    if problems.is_empty() && !missing.is_empty() {
        let are = if missing.len() == 1 { ("shard", "is") } else { ("shards", "are") };
        problems.push(format!(
            "{} {} of {count} {} missing; {}",
            are.0,
            ranges(&missing),
            are.1,
            mend(&missing, count)
        ));
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_parts() {
        assert_eq!(Part::parse("2/3").unwrap(), Part { index: 2, count: 3 });
        assert_eq!(Part::parse("10000/10000").unwrap(), Part { index: 10_000, count: 10_000 });
        for wrong in ["0/3", "4/3", "3", "a/b", "1/0", "-1/2", "1/10001", "1/2/3", ""] {
            let error = Part::parse(wrong).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{wrong}");
            let expected = format!("`--shard {wrong}`: expected I/N with 1 <= I <= N <= 10000, such as 1/3");
            assert_eq!(error.to_string(), expected);
        }
    }

    /// The owner is the remainder of the first 15 digits, so it does not depend on the rest of the key: 0xa = 10 = 7 + 3.
    #[test]
    fn val_owners_of_keys() {
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

    /// An item of the given part.
    fn own(index: u32, id: &str) -> OwnItem {
        let key = format!("{:015x}{}", index - 1, "0".repeat(17));
        OwnItem { position: index as usize - 1, item: ItemRef::new("terrain", id), key }
    }

    /// A shard with one item, `a` in the first and so on.
    fn description(index: u32, count: u32) -> Description {
        let id = |index: u32| char::from(b'a' + (index as u8 - 1)).to_string();
        let all: Vec<OwnItem> = (1..=count.clamp(1, 26)).map(|index| own(index, &id(index))).collect();
        Description {
            part: Part { index, count },
            program: "sastrugi".to_owned(),
            study_sha256: "ab".to_owned(),
            study_items: StudyItems::of(all.iter().map(|own| (&own.item, own.key.as_str()))),
            items: all.into_iter().filter(|own| own.position + 1 == index as usize).collect(),
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
            parameters: None,
        }
    }

    /// All parts of one study by one program, in any order.
    #[test]
    fn val_only_complete_sets_are_merged() {
        let folders = ["one", "two", "three"].map(PathBuf::from);
        let check = |shards: &[Description]| {
            let placed = folders.iter().zip(shards.iter().cloned());
            let placed: Vec<Placed<'_>> = placed.map(|(folder, shard)| Placed { folder, shard }).collect();
            check_set(&placed).join("; ")
        };
        assert_eq!(check(&[description(3, 3), description(1, 3), description(2, 3)]), "");
        assert_eq!(
            check(&[description(1, 3), description(3, 3)]),
            format!("shard 2 of 3 is missing; {}", mend(&[2], 3))
        );
        assert_eq!(check(&[description(1, 3)]), format!("shards 2-3 of 3 are missing; {}", mend(&[2, 3], 3)));
        assert_eq!(check(&[description(1, 2), description(1, 2)]), "two and one are both shard 1");
        let counted = "two is one of 3 shards by sastrugi; expected one of 2 by sastrugi";
        let of_three = Description { study_items: description(1, 2).study_items, ..description(2, 3) };
        assert_eq!(check(&[description(1, 2), of_three]), counted);
        let other = Description { study_sha256: "cd".to_owned(), ..description(2, 2) };
        let items = Description { study_items: description(2, 3).study_items, ..description(2, 2) };
        for stranger in [other, items] {
            let error = check(&[description(1, 2), stranger]);
            assert_eq!(error, "two is from another study, or another revision of the program, than one");
        }
    }

    /// The lists of a complete set, in any order, are the list of the study. A set that lacks an item, has a foreign one, or has one twice is
    /// refused.
    #[test]
    fn val_the_lists_of_shards_are_one_list() {
        let folder = PathBuf::from("shard");
        let all = |shards: Vec<Description>| {
            let mut placed: Vec<Placed<'_>> =
                shards.into_iter().map(|shard| Placed { folder: &folder, shard }).collect();
            let items = all_items(&mut placed);
            assert!(items.is_err() || placed.iter().all(|placed| placed.shard.items.is_empty()));
            items.map(|items| items.into_iter().map(|own| own.item.id).collect::<String>())
        };
        assert_eq!(all(vec![description(3, 3), description(1, 3), description(2, 3)]).unwrap(), "abc");
        let changed = |items: Vec<OwnItem>| {
            let error = all(vec![description(1, 3), Description { items, ..description(2, 3) }, description(3, 3)]);
            let expected =
                format!("the shards do not list each item of the study exactly once; {}", mend(&[1, 2, 3], 3));
            assert_eq!(error.unwrap_err().to_string(), expected);
        };
        changed(Vec::new());
        changed(vec![own(2, "x")]);
        changed(vec![own(2, "b"), own(2, "b")]);
        changed(vec![OwnItem { key: "1".repeat(32), ..own(2, "b") }]);
    }

    /// The numbers of shards to run again can be given to Slurm as they are.
    #[test]
    fn val_ranges_of_shards() {
        let check = |numbers: &[u32], expected: &str| assert_eq!(ranges(numbers), expected);
        check(&[2], "2");
        check(&[2, 3], "2-3");
        check(&[1, 3, 5], "1,3,5");
        check(&[1, 2, 3, 7, 9, 10], "1-3,7,9-10");
        check(&[], "");
        let advice = "then merge again; complete items are not recomputed";
        assert_eq!(mend(&[2], 3), format!("run the study again with `--shard 2/3`, {advice}"));
        assert_eq!(mend(&[2, 3], 8), format!("run the study again with `--shard I/8` for I = 2-3, {advice}"));
    }

    /// Descriptions come from outside: they must not name places beyond the folder of the shard.
    #[test]
    fn val_hostile_descriptions_are_refused() {
        assert_eq!(description(2, 3).check(), Ok(()));
        for (index, count) in [(0, 3), (4, 3), (1, 10_001)] {
            let error = description(index, count).check().unwrap_err();
            assert!(error.starts_with(&format!("shard {index} of {count} is invalid")), "{error}");
        }
        for id in ["../a", "a/../../b", "", ".hidden"] {
            let items = vec![own(1, id)];
            assert!(Description { items, ..description(1, 1) }.check().is_err(), "{id}");
        }
        let error = Description { items: vec![own(1, "a")], ..description(2, 3) }.check().unwrap_err();
        assert_eq!(error, "terrain/a does not belong to shard 2 of 3");
    }

    /// Results that change while they are merged stay where they are; each shard is named with what to run again.
    #[test]
    fn val_shards_that_change_late_are_named() {
        let area = tempfile::tempdir().unwrap();
        let folder = |index: u32| area.path().join(format!("part-{index}"));
        let changed = Changed::default();
        for (index, id) in [(1, "a"), (3, "b"), (3, "c")] {
            let item = ItemRef::new("fit", id);
            let result = item_folder(&folder(index), &item);
            fs::create_dir_all(&result).unwrap();
            description(index, 3).write(&folder(index).join(DESCRIPTION)).unwrap();
            changed.note(&result, &item, "x.tif");
        }
        let error = refuse_changed(changed).unwrap_err();
        let problem = |index: u32, what: &str| {
            let place = folder(index).display().to_string();
            format!("shard {index} ({place}): fit/{what}; {}", mend(&[index], 3))
        };
        let first = problem(1, "a: x.tif was changed while it was merged");
        let second = problem(3, "b: x.tif was changed while it was merged, and so was 1 other result");
        assert_eq!(error.to_string(), format!("{first}; {second}"));
        assert!(matches!(error, Error::Input(_)) && item_folder(&folder(1), &ItemRef::new("fit", "a")).is_dir());
        refuse_changed(Changed::default()).unwrap();
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
