//! The graph of items: what depends on what, and the key of each.

use crate::job::{ItemRef, Job};
use crate::revision::revision;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One item of a study with all that decides its bytes.
pub struct Node {
    /// Its name.
    pub item: ItemRef,
    /// Items whose artifacts it reads; they stand before it in the graph.
    pub parents: Vec<ItemRef>,
    /// Files from outside.
    pub inputs: Vec<InputFile>,
    /// Words of its random streams, when it draws.
    pub stream: Option<String>,
    /// What it does.
    pub job: Box<dyn Job>,
}

/// A file from outside and the hash of its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// Where it is.
    pub path: PathBuf,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// What a key is made of; kept with every result, so that a plan can say why an item is stale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ingredients {
    /// The job's recipe.
    pub recipe: Value,
    /// How the job packs its result.
    #[serde(default)]
    pub packing: Value,
    /// Words of the random streams.
    pub stream: Option<String>,
    /// SHA-256 of the input files, in order.
    pub inputs: Vec<String>,
    /// Keys of the parents, however they are packed.
    pub parents: BTreeMap<String, String>,
    /// Revision of the code.
    pub revision: String,
}

/// All items of a study, parents before children. Ingredients are made anew when they are asked for: those of many items
/// would need far more memory than all else that is known of them.
#[derive(Default)]
pub struct Graph {
    nodes: Vec<Node>,
    keys: Vec<String>,
    /// Keys of what results hold, where they are packed in another way than the usual one.
    unpacked_keys: BTreeMap<usize, String>,
    index: BTreeMap<ItemRef, usize>,
}

impl Graph {
    /// Adds an item; its parents must be there. False when the name is taken or a parent is missing.
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

    /// True without items.
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

    /// What the key at a position is made of.
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

    /// Key of what the result of the item at a position holds, however it is packed.
    fn unpacked_key(&self, position: usize) -> &str {
        self.unpacked_keys.get(&position).unwrap_or(&self.keys[position])
    }

    /// Positions of the parents of the item at a position.
    pub fn parents(&self, position: usize) -> impl Iterator<Item = usize> {
        self.nodes[position].parents.iter().filter_map(|p| self.find(p))
    }

    /// The chosen items and all that they need, parents before children.
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
