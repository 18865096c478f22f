//! Loading of studies: reading, checking, and building the graph of items.

use crate::builder::{BuildError, Builder, Heightfield, InputPlace, Origin};
use crate::documents;
use crate::error::{Error, of_build};
use crate::hypotheses;
use crate::registry::{self, SECTIONS};
use crate::runner::graph::Graph;
use crate::splits::{self, Splits};
use crate::study::{Study, StudyError};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// A study with its graph.
pub struct Loaded {
    /// The study.
    pub study: Study,
    /// Its items.
    pub graph: Graph,
    /// The study's text as released: input files are given by their path in the release.
    pub released: String,
    /// Split (training, validation or test) of each terrain.
    pub splits: Splits,
    /// The table that each id comes from.
    pub origins: BTreeMap<String, Origin>,
    /// Warnings: what is allowed but makes no sense, one sentence each.
    pub doubts: Vec<String>,
    /// Its heightfields by id.
    pub(crate) heightfields: BTreeMap<String, Heightfield>,
}

/// Reads a study file.
///
/// # Errors
/// A missing file, an invalid study, or a missing input file.
pub fn load(path: &Path) -> Result<Loaded, Error> {
    let text = read(path)?;
    load_text(&text, &path.display().to_string(), path.parent().unwrap_or(Path::new("")))
}

/// The text of a study file.
///
/// # Errors
/// A missing file, or one that is not text.
pub fn read(path: &Path) -> Result<String, Error> {
    let text = sastrugi_store::file::read(path).map_err(|e| Error::unreadable(path, &e))?;
    String::from_utf8(text).map_err(|_| Error::Usage(format!("{}: the study is not UTF-8 text", path.display())))
}

/// Reads a study from text; relative paths start from `folder`. `name` stands for the file in messages.
///
/// # Errors
/// As [`load`].
///
/// # Examples
/// All errors are reported at once, each with its place in the text.
///
/// ```
/// use sastrugi_stages::Error;
/// use sastrugi_stages::loaded::load_text;
/// use std::path::Path;
///
/// let text = r#"
/// [study]
/// name = "x"
/// sead = 1
/// date = "2026-01-01"
///
/// [[terrain]]
/// id = "hill"
/// kind = "multifractal"
/// cell_m = -0.1
/// "#;
/// let Err(Error::Study { refusals, .. }) = load_text(text, "study.toml", Path::new("")) else {
///     panic!("the study has errors")
/// };
/// let [seed, cell] = refusals.0.as_slice() else { panic!("{refusals}") };
/// assert_eq!(seed.message, "unknown key `sead` in study");
/// assert_eq!(seed.help.as_deref(), Some("did you mean `seed`?"));
/// assert!(cell.message.starts_with("terrain \"hill\": `cell_m`"));
/// assert_eq!(cell.span.clone().map(|span| &text[span]), Some("-0.1"));
/// ```
pub fn load_text(text: &str, name: &str, folder: &Path) -> Result<Loaded, Error> {
    let refused = |error: BuildError| of_build(name, text, error);
    let (study, errors) = Study::read(text, folder, &registry::section_names()).map_err(|e| refused(e.into()))?;
    let plan = build(&study, errors).map_err(refused)?;
    if plan.graph.is_empty() {
        return Err(Error::Usage(format!(
            "{name}: the study has no items; add a table such as [[terrain]] or [[dem]]"
        )));
    }
    let released = released_text(text, &study, &plan);
    Ok(Loaded {
        study,
        graph: plan.graph,
        released,
        splits: plan.splits,
        origins: plan.origins,
        doubts: plan.doubts,
        heightfields: plan.heightfields,
    })
}

/// The study with input files replaced by their paths in the release; all other bytes are unchanged.
fn released_text(text: &str, study: &Study, plan: &Plan) -> String {
    let mut places: Vec<(Range<usize>, String)> = Vec::new();
    for place in &plan.inputs {
        if let Some(span) = study.span_of(&place.key) {
            places.push((span, toml_edit::Value::from(place.release_path.as_str()).to_string()));
        }
    }
    // From the end, so that earlier positions stay valid.
    places.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    places.into_iter().fold(text.to_owned(), |mut text, (span, path)| {
        text.replace_range(span, &path);
        text
    })
}

/// A study's items.
struct Plan {
    /// The graph.
    graph: Graph,
    /// Paths of input files in the release.
    inputs: Vec<InputPlace>,
    /// Split (training, validation or test) of each terrain.
    splits: Splits,
    /// The table that each id comes from.
    origins: BTreeMap<String, Origin>,
    /// Warnings: what is allowed but makes no sense.
    doubts: Vec<String>,
    /// Heightfields by id.
    heightfields: BTreeMap<String, Heightfield>,
}

/// Builds the graph of a study. Input files are hashed but not parsed.
///
/// # Errors
/// All errors in the study, including `errors`, or input files that cannot be read.
fn build(study: &Study, errors: Vec<StudyError>) -> Result<Plan, BuildError> {
    let mut builder = Builder::new(study, errors);
    builder.limit(&registry::section_names());
    for section in &SECTIONS {
        if builder.is_full() {
            break;
        }
        if let Err(error) = (section.add)(&mut builder) {
            builder.refuse(error);
        }
    }
    builder.check()?;
    let splits = splits::draw(study, &builder.heightfields, &builder.graph)?;
    let origins = builder.take_origins();
    let mut doubts: Vec<String> = documents::license_warning(&study.head.license).into_iter().collect();
    doubts.append(&mut builder.doubts);
    doubts.extend(hypotheses::doubts(&builder));
    let Builder { graph, inputs, heightfields, .. } = builder;
    Ok(Plan { graph, inputs, splits, origins, doubts, heightfields })
}
