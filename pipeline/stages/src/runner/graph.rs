//! The graph of items: their dependencies and keys.
//!
//! Besides its name and its job, an item takes less than 200 bytes here, because a study may have a million: keys are 32 bytes inline, parents
//! are positions, and the index holds hashes of names.

use super::cache::KEY_DIGITS;
use crate::job::{ItemRef, Job};
use crate::revision::revision;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

/// One item of a study with everything that determines its bytes, before it has a place in the graph.
pub struct Node {
    /// Its name.
    pub item: ItemRef,
    /// Items whose artifacts it reads; they come before it in the graph.
    pub parents: Vec<ItemRef>,
    /// Files from outside.
    pub inputs: Vec<InputFile>,
    /// Label of its random streams, if it draws random numbers.
    pub stream: Option<String>,
    /// The computation.
    pub job: Box<dyn Job>,
}

/// An item in the graph.
pub struct Placed {
    /// Its name.
    pub item: ItemRef,
    /// Files from outside.
    pub inputs: Vec<InputFile>,
    /// Label of its random streams, if it draws random numbers.
    pub stream: Option<String>,
    /// The computation.
    pub job: Box<dyn Job>,
    /// Positions of the items whose artifacts it reads.
    parents: Box<[u32]>,
}

/// A file from outside and the hash of its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// Its path.
    pub path: PathBuf,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// The inputs of a key; stored with every result, so that a plan can state why an item is stale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ingredients {
    /// The job's recipe.
    pub recipe: Value,
    /// How the job packs its result.
    #[serde(default)]
    pub packing: Value,
    /// Label of the random streams.
    pub stream: Option<String>,
    /// SHA-256 of the input files, in order.
    pub inputs: Vec<String>,
    /// Keys of the parents, independent of their packing.
    pub parents: BTreeMap<String, String>,
    /// Revision of the code.
    pub revision: String,
}

/// All items of a study, parents before children. Ingredients are recomputed on every request, because storing those of many items
/// would take far more memory than the rest of the graph.
#[derive(Default)]
pub struct Graph {
    nodes: Vec<Placed>,
    keys: Vec<Key>,
    /// Keys that ignore the packing, for items that do not use the default packing.
    unpacked_keys: BTreeMap<usize, Key>,
    /// Position of each item by the hash of its name.
    index: HashMap<[u8; 16], u32>,
}

/// The hexadecimal digits of a key.
type Key = [u8; KEY_DIGITS];

fn text(key: &Key) -> &str {
    std::str::from_utf8(key).unwrap_or_default()
}

impl Graph {
    /// Adds an item after its parents. Returns false if the name is taken or a parent is missing.
    #[must_use]
    pub fn add(&mut self, node: Node) -> bool {
        let Node { item, parents, inputs, stream, job } = node;
        let place = |item: &ItemRef| self.index.get(&hashed(item)).copied();
        let parents = parents.iter().map(place).collect::<Option<Box<[u32]>>>();
        let (Some(parents), None, Ok(position)) = (parents, place(&item), u32::try_from(self.nodes.len())) else {
            return false;
        };
        let placed = Placed { item, inputs, stream, job, parents };
        let ingredients = self.ingredients_without_recipe(&placed);
        let recipe = placed.job.recipe_text();
        self.keys.push(key(&placed.item, &recipe, &ingredients));
        if !ingredients.packing.is_null() {
            let unpacked = Ingredients { packing: Value::Null, ..ingredients };
            self.unpacked_keys.insert(self.nodes.len(), key(&placed.item, &recipe, &unpacked));
        }
        self.index.insert(hashed(&placed.item), position);
        self.nodes.push(placed);
        true
    }

    /// Number of items.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True if there are no items.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Position of an item.
    pub fn find(&self, item: &ItemRef) -> Option<usize> {
        self.index.get(&hashed(item)).map(|position| *position as usize)
    }

    /// The item at a position.
    pub fn node(&self, position: usize) -> &Placed {
        &self.nodes[position]
    }

    /// All items, parents before children.
    pub fn nodes(&self) -> &[Placed] {
        &self.nodes
    }

    /// Key of the item at a position: 32 hexadecimal digits.
    pub fn key(&self, position: usize) -> &str {
        text(&self.keys[position])
    }

    /// The ingredients of the key at a position.
    pub fn ingredients(&self, position: usize) -> Ingredients {
        let node = &self.nodes[position];
        Ingredients { recipe: node.job.recipe(), ..self.ingredients_without_recipe(node) }
    }

    fn ingredients_without_recipe(&self, node: &Placed) -> Ingredients {
        let parent = |p: &u32| (self.nodes[*p as usize].item.to_string(), self.unpacked_key(*p as usize).to_owned());
        let parents = node.parents.iter().map(parent);
        Ingredients {
            recipe: Value::Null,
            packing: node.job.packing(),
            stream: node.stream.clone(),
            inputs: node.inputs.iter().map(|i| i.sha256.clone()).collect(),
            parents: parents.collect(),
            revision: revision(node.job.rooms()),
        }
    }

    /// Key of the item at a position, independent of its packing.
    fn unpacked_key(&self, position: usize) -> &str {
        text(self.unpacked_keys.get(&position).unwrap_or(&self.keys[position]))
    }

    /// Positions of the parents of the item at a position.
    pub fn parents(&self, position: usize) -> impl Iterator<Item = usize> {
        self.nodes[position].parents.iter().map(|p| *p as usize)
    }

    /// The chosen items and all their ancestors, parents before children.
    pub fn closure(&self, chosen: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let mut needed = vec![false; self.len()];
        chosen.into_iter().for_each(|p| needed[p] = true);
        for position in (0..self.len()).rev().filter(|&p| needed[p]).collect::<Vec<_>>() {
            self.mark(position, &mut needed);
        }
        (0..self.len()).filter(|&p| needed[p]).collect()
    }

    fn mark(&self, position: usize, needed: &mut [bool]) {
        for parent in self.parents(position) {
            if !std::mem::replace(&mut needed[parent], true) {
                self.mark(parent, needed);
            }
        }
    }
}

/// Hash of a name; that two names of a study have the same is as unlikely as two equal keys.
fn hashed(item: &ItemRef) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(item.stage.as_bytes()).update(&[0]).update(item.id.as_bytes());
    let mut hash = [0; 16];
    hasher.finalize_xof().fill(&mut hash);
    hash
}

fn key(item: &ItemRef, recipe: &str, ingredients: &Ingredients) -> Key {
    let Ingredients { recipe: _, packing, stream, inputs, parents, revision } = ingredients;
    // Maps keep a fixed order (struct fields, BTreeMap, parameters as the kernels print them), so the text is canonical.
    let rest = serde_json::to_vec(&(item, packing, stream, inputs, parents, revision)).unwrap_or_default();
    let mut hasher = blake3::Hasher::new_derive_key("sastrugi 2026-11 item keys v3");
    hasher.update(recipe.as_bytes()).update(&rest);
    let digits = hasher.finalize().to_hex();
    let mut key = [b'0'; KEY_DIGITS];
    key.copy_from_slice(&digits.as_bytes()[..KEY_DIGITS]);
    key
}
