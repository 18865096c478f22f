//! Splits: assigns each terrain and everything on it to training, validation or test, with the same shares in every group.
//!
//! Terrains that share data form one unit and stay in the same split: terrains with common random draws (`pairing = "common"`, or
//! the same `seed`), and a texture and the heightfield it is added to. Units are drawn group by group; units with terrains of
//! several groups are drawn together with others of the same groups. The rank of a unit comes from its own random stream, so
//! adding terrains moves few others.

use crate::builder::{Heightfield, common};
use crate::job::ItemRef;
use crate::runner::graph::Graph;
use crate::study::{Study, StudyError};
use sastrugi_numeric::Streams;
use sastrugi_schemas::study::{Pairing, Shares};
use sastrugi_schemas::tables::CellType;
use sastrugi_schemas::{Cell, Table, counted};
use std::collections::{BTreeMap, BTreeSet};

/// Names of the splits, in the order of `[study] split`.
pub const PARTS: [&str; 3] = ["train", "validation", "test"];
/// Split of rows that belong to none.
pub const OTHER: &str = "other";
/// Column with the split of a row.
const COLUMN: &str = "split";
/// Column with the terrain of a row.
const TERRAIN: &str = "terrain_id";
/// First word of the random streams after the seed.
const STAGE: &str = "split";

/// Split of each terrain, by id; terrains without a split are absent.
pub type Splits = BTreeMap<String, String>;

/// Writes the split into a row that has the columns for terrain and `split`. Items are computed without it, so changing the
/// split recomputes nothing.
pub fn fill(table: &Table, cells: &mut [Cell], splits: &Splits) {
    let (Some(split), Some(terrain)) = (table.position(COLUMN), table.position(TERRAIN)) else { return };
    let part = match &cells[terrain] {
        Cell::Text(id) => splits.get(id).cloned(),
        _ => None,
    };
    cells[split] = part.to_cell();
}

/// Whether every file of a table contains rows of one split only: the study has splits, and the table a column for them.
fn is_split(table: &Table, splits: &Splits) -> bool {
    !splits.is_empty() && table.position(COLUMN).is_some() && table.position(TERRAIN).is_some()
}

/// File names of a table that has one file per split; empty if it has a single file or one per terrain.
pub fn files(table: &Table, splits: &Splits) -> Vec<&'static str> {
    let parted = is_split(table, splits) && table.file_per.is_none();
    PARTS.into_iter().chain([OTHER]).filter(|_| parted).collect()
}

/// Whether a row, whose split is filled in, belongs to the file of that name.
pub fn is_in_file(table: &Table, cells: &[Cell], file: &str) -> bool {
    match table.position(COLUMN).map(|split| &cells[split]) {
        Some(Cell::Text(part)) => part == file,
        _ => file == OTHER,
    }
}

/// The split of all rows in a table's file, by the file's name ([`OTHER`] for rows of no split); `None` if the file may mix
/// splits.
pub fn of_file(table: &Table, file: &str, splits: &Splits) -> Option<&'static str> {
    let part = match table.file_per {
        Some(TERRAIN) => splits.get(file).map(String::as_str),
        Some(_) => return None,
        None => Some(file),
    };
    let known = PARTS.into_iter().find(|known| Some(*known) == part);
    is_split(table, splits).then_some(known.unwrap_or(OTHER))
}

/// Terrains that stay in the same split.
struct Unit {
    terrains: Vec<String>,
    /// Those of them without a label, such as the base of others.
    unlabelled: Vec<String>,
    /// Labels of its terrains; empty when none has one.
    groups: BTreeSet<String>,
    /// Its rank in the draw.
    rank: u64,
}

/// Draws the split of every terrain, if the study has splits. If some terrains have a group, terrains without one are left out,
/// unless they belong to the unit of a terrain with a group.
///
/// # Errors
/// A group with too few terrains.
pub fn draw(study: &Study, fields: &BTreeMap<String, Heightfield>, graph: &Graph) -> Result<Splits, StudyError> {
    let Some(shares) = study.head.split.map(Shares::by_part) else { return Ok(Splits::new()) };
    let mut strata: BTreeMap<BTreeSet<String>, Vec<Unit>> = BTreeMap::new();
    for unit in units(study, fields, graph) {
        strata.entry(unit.groups.clone()).or_default().push(unit);
    }
    if strata.len() > 1 {
        strata.remove(&BTreeSet::new());
    }
    let mut splits = Splits::new();
    for (groups, mut units) in strata {
        let counts = counts(units.len(), &shares).ok_or_else(|| too_few(study, &groups, &units, &shares))?;
        units.sort_by(|a, b| (a.rank, &a.terrains).cmp(&(b.rank, &b.terrains)));
        let parts = PARTS.into_iter().zip(counts).flat_map(|(part, count)| std::iter::repeat_n(part, count));
        for (unit, part) in units.into_iter().zip(parts) {
            splits.extend(unit.terrains.into_iter().map(|id| (id, part.to_owned())));
        }
    }
    Ok(splits)
}

fn too_few(study: &Study, groups: &BTreeSet<String>, units: &[Unit], shares: &[f64; 3]) -> StudyError {
    let names: Vec<String> = groups.iter().map(|group| format!("\"{group}\"")).collect();
    let of = if names.is_empty() { "the study".to_owned() } else { format!("group {}", names.join(" with ")) };
    let parts = shares.iter().filter(|share| **share > 0.0).count();
    // In a group, terrains without a label only tie others together.
    let is_counted = |unit: &Unit, id: &String| groups.is_empty() || !unit.unlabelled.contains(id);
    let own = |unit: &Unit| unit.terrains.iter().filter(|id| is_counted(unit, id)).cloned().collect::<Vec<String>>();
    let terrains = units.iter().map(|unit| own(unit).len()).sum::<usize>();
    let tied = match units.iter().max_by_key(|unit| own(unit).len()) {
        Some(unit) if terrains > units.len() => format!(
            " in {} ({} belong together: {})",
            counted(units.len(), "independent set"),
            own(unit).join(", "),
            match &unit.unlabelled[..] {
                ties @ [_, ..] if !groups.is_empty() => format!("tied together through {}", ties.join(", ")),
                _ => "one is made from the other or they share random draws".to_owned(),
            }
        ),
        _ => String::new(),
    };
    let message = format!(
        "too few terrains for the {parts} splits of `split`: {of} has {}{tied}; each split needs at least one",
        counted(terrains, "terrain")
    );
    let span = study.span_of(&["study".to_owned(), "split".to_owned()]);
    let help = (!groups.is_empty()).then(|| "terrains without a `group` are left out of the splits".to_owned());
    StudyError::at(span, message).with_help(help)
}

/// Number of the `count` units in each split: shares rounded by largest remainder, at least one for each share above 0.
/// `None` if there are too few.
fn counts(count: usize, shares: &[f64; 3]) -> Option<[usize; 3]> {
    let wanted = shares.map(|share| share * count as f64);
    let mut counts = wanted.map(|w| w.floor() as usize);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| wanted[b].fract().total_cmp(&wanted[a].fract()));
    let left = count.checked_sub(counts.iter().sum())?;
    order.into_iter().filter(|&k| shares[k] > 0.0).take(left).for_each(|k| counts[k] += 1);
    for k in 0..3 {
        if shares[k] > 0.0 && counts[k] == 0 {
            let largest = (0..3).max_by_key(|&k| (counts[k], std::cmp::Reverse(k)))?;
            counts[largest] = counts[largest].checked_sub(1).filter(|&rest| rest > 0)?;
            counts[k] = 1;
        }
    }
    Some(counts)
}

/// Groups terrains that share data into units.
fn units(study: &Study, fields: &BTreeMap<String, Heightfield>, graph: &Graph) -> Vec<Unit> {
    let mut sets = DisjointSets::default();
    let makers: BTreeMap<&ItemRef, &str> = fields.iter().map(|(id, field)| (&field.item, id.as_str())).collect();
    for (id, field) in fields {
        sets.root(id);
        let parents = graph.find(&field.item).into_iter().flat_map(|p| graph.parents(p));
        parents.filter_map(|parent| makers.get(&graph.node(parent).item)).for_each(|parent| sets.join(id, parent));
        if let Some(word) = shared_draw(study, field) {
            sets.join(id, &word);
        }
        // Explicit seeds may give the same stream twice. `~` sorts after all ids, so none of these words represents a unit.
        let stream = graph.find(&field.item).and_then(|p| graph.node(p).stream.clone());
        if let Some(stream) = stream {
            sets.join(id, &format!("~{stream}"));
        }
    }
    let mut units: BTreeMap<String, Unit> = BTreeMap::new();
    for (id, field) in fields {
        let root = sets.root(id);
        let rank = || Streams::for_item(study.head.seed, STAGE, root.trim_start()).stream("rank").bits();
        let unit = units.entry(root.clone()).or_insert_with(|| Unit {
            terrains: Vec::new(),
            unlabelled: Vec::new(),
            groups: BTreeSet::new(),
            rank: rank(),
        });
        unit.terrains.push(id.clone());
        unit.unlabelled.extend((!field.is_grouped).then(|| id.clone()));
        unit.groups.extend(field.group.clone().filter(|_| field.is_grouped));
    }
    units.into_values().collect()
}

/// Name of the draws that a heightfield shares with others.
fn shared_draw(study: &Study, field: &Heightfield) -> Option<String> {
    // Ids contain no blank, so they differ from this word, which sorts before all of them.
    field.replicate.filter(|_| study.head.pairing == Pairing::Common).map(|k| format!(" {}", common(k)))
}

/// Disjoint sets of names, each represented by its first name in order.
#[derive(Default)]
struct DisjointSets(BTreeMap<String, String>);

impl DisjointSets {
    fn root(&mut self, name: &str) -> String {
        let mut at = name.to_owned();
        loop {
            let above = self.0.entry(at.clone()).or_insert_with(|| at.clone()).clone();
            if above == at {
                return at;
            }
            at = above;
        }
    }

    fn join(&mut self, a: &str, b: &str) {
        let (a, b) = (self.root(a), self.root(b));
        let (first, second) = if a <= b { (a, b) } else { (b, a) };
        self.0.insert(second, first);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loaded::load_text;
    use std::path::Path;

    const HEAD: &str = "[study]\nname = \"x\"\nseed = 3\ndate = \"2026-01-01\"\n";

    fn terrain(id: &str, group: &str, count: u32) -> String {
        let group = if group.is_empty() { String::new() } else { format!("group = \"{group}\"\n") };
        format!("[[terrain]]\nid = \"{id}\"\nkind = \"multifractal\"\nsize_px = [64, 64]\ncount = {count}\n{group}")
    }

    fn splits(text: &str) -> Result<Splits, String> {
        load_text(text, "study", Path::new("")).map(|loaded| loaded.splits).map_err(|e| e.to_string())
    }

    fn number(splits: &Splits, start: &str) -> [usize; 3] {
        PARTS.map(|part| splits.iter().filter(|(id, p)| id.starts_with(start) && *p == part).count())
    }

    #[test]
    fn val_every_group_has_the_shares() {
        let text = format!(
            "{HEAD}split = [0.7, 0.15, 0.15]\n{}{}{}",
            terrain("a", "a", 20),
            terrain("b", "b", 7),
            terrain("c", "", 2)
        );
        let drawn = splits(&text).unwrap();
        assert_eq!((number(&drawn, "a"), number(&drawn, "b"), number(&drawn, "c")), ([14, 3, 3], [5, 1, 1], [0, 0, 0]));
        assert_eq!(splits(&text).unwrap(), drawn);
        assert_ne!(splits(&text.replace("seed = 3", "seed = 4")).unwrap(), drawn);
        assert!(splits(&text.replace("split", "# split")).unwrap().is_empty());
    }

    #[test]
    fn val_without_groups_all_terrains_are_one_group() {
        let text = format!("{HEAD}split = [0.5, 0.0, 0.5]\n{}", terrain("a", "", 4));
        assert_eq!(number(&splits(&text).unwrap(), "a"), [2, 0, 2]);
    }

    #[test]
    fn val_paired_terrains_and_textures_on_them_stay_together() {
        let texture = "[[texture]]\nid = \"t\"\nfit = { model = \"exponential\", sigma_m = 0.01, range_m = 0.3 }\nonto = \"c\"\ngroup = \"a\"\nsize_m = [3.2, 3.2]\ncell_m = 0.05\n";
        let own = "[[terrain]]\nid = \"c\"\nkind = \"multifractal\"\nsize_px = [64, 64]\n";
        let text = format!("{HEAD}split = [0.6, 0.2, 0.2]\n{}{own}{texture}", terrain("a", "a", 10));
        let drawn = splits(&text).unwrap();
        assert_eq!(drawn["t"], drawn["c"]);
        let paired = HEAD.to_owned() + "pairing = \"common\"\n";
        let text = format!("{paired}split = [0.6, 0.2, 0.2]\n{}{}", terrain("a", "a", 10), terrain("b", "b", 10));
        let drawn = splits(&text).unwrap();
        assert!((1..=10).all(|k| drawn[&format!("a-{k:04}")] == drawn[&format!("b-{k:04}")]));
        assert_eq!(number(&drawn, "a"), [6, 2, 2]);
    }

    /// Replicate k of a texture is added to replicate k of a terrain that has as many, and stays with it: four independent sets.
    #[test]
    fn val_replicates_of_a_texture_have_bases_of_their_own() {
        let texture = "[[texture]]\nid = \"t\"\nfit = { model = \"exponential\", sigma_m = 0.01, range_m = 0.3 }\nonto = \"h\"\ngroup = \"a\"\ncount = 4\nsize_m = [3.2, 3.2]\ncell_m = 0.05\n";
        let text = format!("{HEAD}split = [0.5, 0.25, 0.25]\n{}{texture}", terrain("h", "", 4));
        let loaded = load_text(&text, "study", Path::new("")).map_err(|e| e.to_string()).unwrap();
        for k in 1..=4 {
            let [base, own] = ["h", "t"].map(|id| format!("{id}-{k:04}"));
            assert_eq!(loaded.splits[&base], loaded.splits[&own], "{base}");
            let field = &loaded.heightfields[&own];
            assert_eq!(field.parameters["onto"], base.as_str());
            let position = loaded.graph.find(&field.item).unwrap();
            let parents: Vec<&ItemRef> = loaded.graph.parents(position).map(|p| &loaded.graph.node(p).item).collect();
            assert_eq!(parents, [&loaded.heightfields[&base].item]);
        }
        assert_eq!(number(&loaded.splits, "t"), [2, 1, 1]);
    }

    /// Replicate k of a seed draws as seed + k - 1 does; equal heights are never in two splits.
    #[test]
    fn val_terrains_of_one_seed_stay_together() {
        let seeded = |id: &str, seed: u32| terrain(id, "a", 8).replace("count", &format!("seed = {seed}\ncount"));
        let drawn = splits(&format!("{HEAD}split = [0.5, 0.0, 0.5]\n{}{}", seeded("a", 7), seeded("b", 10))).unwrap();
        assert!((4..=8).all(|k| drawn[&format!("a-{k:04}")] == drawn[&format!("b-{:04}", k - 3)]));
        assert!(number(&drawn, "").iter().sum::<usize>() == 16);
    }

    #[test]
    fn val_too_few_terrains_are_refused() {
        let text = format!("{HEAD}split = [0.7, 0.15, 0.15]\n{}{}", terrain("a", "a", 20), terrain("b", "b", 2));
        let error = splits(&text).unwrap_err();
        assert!(error.contains("group \"b\" has 2 terrains") && error.contains("3 splits"), "{error}");
        let onto = "[[texture]]\nid = \"t\"\nfit = { model = \"exponential\", sigma_m = 0.03, range_m = 0.5 }\nonto = \"a-0001\"\ngroup = \"a\"\n\
            size_m = [3.2, 3.2]\ncell_m = 0.05\n";
        let error = splits(&format!("{HEAD}split = [0.7, 0.15, 0.15]\n{}{onto}", terrain("a", "a", 2))).unwrap_err();
        assert!(error.contains("3 terrains in 2 independent sets (a-0001, t belong together"), "{error}");
        // A base without a group is not one of the terrains, but ties those on it together.
        let on_base = |id: &str| onto.replace("\"t\"", &format!("\"{id}\"")).replace("\"a-0001\"", "\"base\"");
        let base = "[[terrain]]\nid = \"base\"\nkind = \"multifractal\"\nsize_px = [64, 64]\n";
        let on_bases = ["t1", "t2", "t3", "t4"].map(on_base).concat();
        let error = splits(&format!("{HEAD}split = [0.7, 0.15, 0.15]\n{base}{on_bases}")).unwrap_err();
        let said = "group \"a\" has 4 terrains in 1 independent set (t1, t2, t3, t4 belong together: tied together through base)";
        assert!(error.contains(said), "{error}");
        for (shares, words) in
            [("[0.5, 0.5, 0.5]", "add up to 1"), ("[1.2, -0.2, 0.0]", "0 to 1"), ("[1.0, 0.0, 0.0]", "two")]
        {
            let error = splits(&format!("{HEAD}split = {shares}\n{}", terrain("a", "a", 20))).unwrap_err();
            assert!(error.contains(words), "{shares}: {error}");
        }
    }

    #[test]
    fn val_two_shares_are_train_and_test() {
        let drawn = splits(&format!("{HEAD}split = [0.8, 0.2]\n{}", terrain("a", "a", 10))).unwrap();
        assert_eq!(number(&drawn, "a"), [8, 0, 2]);
        let error = splits(&format!("{HEAD}split = [1.0]\n{}", terrain("a", "a", 10))).unwrap_err();
        assert!(error.contains("two or three splits"), "{error}");
    }

    /// Tables of runs have one file per split, their samples one per terrain; other tables are not split.
    #[test]
    fn val_every_file_of_a_split_table_is_of_one_split() {
        use sastrugi_schemas::tables::by_name;
        let [missions, samples, psd] = ["missions", "samples", "psd"].map(|name| by_name(name).unwrap());
        let drawn: Splits = [("a".to_owned(), "test".to_owned())].into();
        assert_eq!(files(missions, &drawn), ["train", "validation", "test", "other"]);
        assert!(files(samples, &drawn).is_empty() && files(psd, &drawn).is_empty());
        assert!(files(missions, &Splits::new()).is_empty());
        let of = |table: &Table, file: &str| of_file(table, file, &drawn);
        assert_eq!((of(missions, "train"), of(missions, "other")), (Some("train"), Some("other")));
        assert_eq!((of(samples, "a"), of(samples, "b"), of(psd, "0000")), (Some("test"), Some("other"), None));
        assert_eq!(of_file(samples, "a", &Splits::new()), None);
    }

    #[test]
    fn prop_counts_add_up_and_leave_no_split_empty() {
        for count in 3..200 {
            for shares in [[0.7, 0.15, 0.15], [0.98, 0.01, 0.01], [1.0 / 3.0; 3], [0.9, 0.1, 0.0]] {
                let counts = counts(count, &shares).unwrap();
                assert_eq!(counts.iter().sum::<usize>(), count);
                for k in 0..3 {
                    assert_eq!(counts[k] > 0, shares[k] > 0.0, "{count} {shares:?}");
                    let near = (counts[k] as f64 - shares[k] * count as f64).abs();
                    assert!(near < 2.0, "{count} {shares:?}: {counts:?}");
                }
            }
        }
        assert_eq!((counts(2, &[0.7, 0.15, 0.15]), counts(0, &[0.5, 0.0, 0.5])), (None, None));
        // By hand: of 7, 1.5 and 1.5 the first of two equal remainders is rounded up; of 3.9, 0.04 and 0.04 the largest gives to the others.
        assert_eq!(counts(10, &[0.7, 0.15, 0.15]), Some([7, 2, 1]));
        assert_eq!(counts(4, &[0.98, 0.01, 0.01]), Some([2, 1, 1]));
    }
}
