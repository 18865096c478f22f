//! The graph of items: their dependencies and keys.

use crate::job::{ItemRef, Job};
use crate::revision::revision;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One item of a study with everything that determines its bytes.
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
    nodes: Vec<Node>,
    keys: Vec<String>,
    /// Keys that ignore the packing, for items that do not use the default packing.
    unpacked_keys: BTreeMap<usize, String>,
    index: BTreeMap<ItemRef, usize>,
}

impl Graph {
    /// Adds an item after its parents. Returns false if the name is taken or a parent is missing.
    #[must_use]
    pub fn add(&mut self, node: Node) -> bool {
        if self.index.contains_key(&node.item) {
            return false;
        }
        if !node.parents.iter().all(|parent| self.index.contains_key(parent)) {
            return false;
        }
        let ingredients = self.ingredients_of(&node);
        self.keys.push(key(&node.item, &ingredients));
        if !ingredients.packing.is_null() {
            let unpacked = Ingredients { packing: Value::Null, ..ingredients };
            self.unpacked_keys.insert(self.nodes.len(), key(&node.item, &unpacked));
        }
        self.index.insert(node.item.clone(), self.nodes.len());
        self.nodes.push(node);
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
        self.index.get(item).copied()
    }

    /// The item at a position.
    pub fn node(&self, position: usize) -> &Node {
        &self.nodes[position]
    }

    /// All items, parents before children.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Key of the item at a position: 32 hexadecimal digits.
    pub fn key(&self, position: usize) -> &str {
        &self.keys[position]
    }

    /// The ingredients of the key at a position.
    pub fn ingredients(&self, position: usize) -> Ingredients {
        self.ingredients_of(&self.nodes[position])
    }

    fn ingredients_of(&self, node: &Node) -> Ingredients {
        let parents =
            node.parents.iter().filter_map(|p| Some((p.to_string(), self.unpacked_key(self.find(p)?).to_owned())));
        Ingredients {
            recipe: node.job.recipe(),
            packing: node.job.packing(),
            stream: node.stream.clone(),
            inputs: node.inputs.iter().map(|i| i.sha256.clone()).collect(),
            parents: parents.collect(),
            revision: revision(node.job.rooms()),
        }
    }

    /// Key of the item at a position, independent of its packing.
    fn unpacked_key(&self, position: usize) -> &str {
        self.unpacked_keys.get(&position).unwrap_or(&self.keys[position])
    }

    /// Positions of the parents of the item at a position.
    pub fn parents(&self, position: usize) -> impl Iterator<Item = usize> {
        self.nodes[position].parents.iter().filter_map(|p| self.find(p))
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

fn key(item: &ItemRef, ingredients: &Ingredients) -> String {
    let mut hasher = blake3::Hasher::new_derive_key("sastrugi 2026-11 item keys v3");
    let Ingredients { recipe, packing, stream, inputs, parents, revision } = ingredients;
    // Maps keep a fixed order (struct fields, BTreeMap, parameters as the kernels print them), so the text is canonical.
    hasher.update(recipe.to_string().as_bytes());
    hasher.update(serde_json::json!([item, packing, stream, inputs, parents, revision]).to_string().as_bytes());
    hasher.finalize().to_hex()[..32].to_owned()
}
