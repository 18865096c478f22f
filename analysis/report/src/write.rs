//! Writes the files of a report.

use crate::content::{Block, Figure, Numbers, Section, TableBlock, slug};
use crate::data::Data;
use crate::questions::{self, texture};
use crate::render::html::{self, Head};
use crate::render::number as set;
use crate::{Companions, ReportError};
use sastrugi_store::atomic::{self, Draft};
use sastrugi_store::release::Staging;
use std::collections::BTreeSet;
use std::fs::DirEntry;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Files of a report.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Names of the figures: each is `figures/<name>.svg` and `data/<name>.json`.
    pub figures: Vec<String>,
    /// Every file, relative to the report's folder, in the order in which they were written.
    pub files: Vec<PathBuf>,
    /// Bytes of all files.
    pub bytes: u64,
}

/// Writes the report of the release at `release` into the folder `out`: `index.html`, `figures/*.svg`, `data/*.json`.
/// The release need not be sealed. The folder is written completely or not at all; an existing report is replaced.
/// `progress` is called with a few words before each part.
///
/// # Errors
/// A file `out`, or a folder that contains anything but a report; a file of the release that exists but cannot be read; a file that
/// cannot be written; a file that is missing or not a regular file, although the manifest lists it. Parts that a release does not have are not
/// an error: the page leaves them out.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_report::{ReportError, render};
///
/// let folder = tempfile::tempdir()?;
/// std::fs::write(folder.path().join("study.toml"), "[study]\nname = \"snow\"\n")?;
/// let thesis = tempfile::tempdir()?;
/// std::fs::write(thesis.path().join("thesis.tex"), "mine")?;
///
/// let refused = render(folder.path(), thesis.path(), &|_| ()).unwrap_err();
/// assert!(matches!(refused, ReportError::Occupied { .. }) && refused.to_string().contains("thesis.tex"));
/// assert_eq!(std::fs::read_to_string(thesis.path().join("thesis.tex"))?, "mine");
/// # Ok(())
/// # }
/// ```
pub fn render(release: &Path, out: &Path, progress: &dyn Fn(&str)) -> Result<Summary, ReportError> {
    render_with(release, &Companions::default(), out, progress)
}

/// As [`render`], with sections that compare the release with another release and with logs.
///
/// # Errors
/// As [`render`]; a companion that is missing or unusable.
pub fn render_with(
    release: &Path,
    companions: &Companions,
    out: &Path,
    progress: &dyn Fn(&str),
) -> Result<Summary, ReportError> {
    progress("reading the tables");
    write(&Data::open_with(release, companions, texture::undrawn)?, out, progress)
}

/// Writes the report of data that are already read.
pub(crate) fn write(data: &Data, out: &Path, progress: &dyn Fn(&str)) -> Result<Summary, ReportError> {
    let out = &std::path::absolute(out).map_err(|source| ReportError::Write { path: out.to_owned(), source })?;
    check_place(out)?;
    let mut sections = questions::sections(data, progress)?;
    name_once(&mut sections);
    progress("writing");
    let staging = Staging::beside(out)?;
    let mut folder = Folder { draft: staging.path(), summary: Summary::default() };
    folder.put("index.html", &html::page(&head(data), &sections))?;
    for section in &sections {
        section.blocks.iter().try_for_each(|block| folder.put_block(block))?;
    }
    for name in ["figures", "data", "."].map(|name| staging.path().join(name)).iter().filter(|path| path.exists()) {
        atomic::sync_folder(name).map_err(|source| ReportError::Write { path: name.clone(), source })?;
    }
    let summary = folder.summary;
    staging.put_in_place(out)?;
    Ok(summary)
}

/// Refuses a file, and a folder that contains anything but a report.
fn check_place(out: &Path) -> Result<(), ReportError> {
    let occupied = |file: PathBuf| ReportError::Occupied { path: out.to_owned(), file: Some(file) };
    // The output path, or the folder that it should be in, is a file.
    let file = || out.ancestors().find(|path| path.exists()).unwrap_or(out).to_owned();
    for entry in entries(out)?.ok_or_else(|| ReportError::Occupied { path: file(), file: None })? {
        let name = entry.file_name();
        let ending = match name.to_str() {
            Some("index.html") if entry.path().is_file() => continue,
            Some("figures") => "svg",
            Some("data") => "json",
            _ => return Err(occupied(name.into())),
        };
        let inside = entries(&entry.path())?.ok_or_else(|| occupied(name.clone().into()))?;
        let foreign = inside.into_iter().find(|e| e.path().extension().is_none_or(|own| own != ending));
        if let Some(foreign) = foreign {
            return Err(occupied(Path::new(&name).join(foreign.file_name())));
        }
    }
    Ok(())
}

/// Entries of a folder, none if it does not exist; `None` if the path is that of a file, or leads through one.
fn entries(folder: &Path) -> Result<Option<Vec<DirEntry>>, ReportError> {
    match std::fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>) {
        Ok(entries) => Ok(Some(entries)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Some(Vec::new())),
        Err(e) if e.kind() == ErrorKind::NotADirectory => Ok(None),
        Err(source) => Err(ReportError::Write { path: folder.to_owned(), source }),
    }
}

/// The folder being written.
struct Folder<'a> {
    draft: &'a Path,
    summary: Summary,
}

impl Folder<'_> {
    fn put_block(&mut self, block: &Block) -> Result<(), ReportError> {
        match block {
            Block::Figures(figures) => figures.iter().try_for_each(|f| self.put_figure(f)),
            Block::Table(t) | Block::FoldedTable(t) => self.put_numbers(&t.id, &t.caption, &t.numbers),
            Block::Heading(_) | Block::Text(_) | Block::Result(_) | Block::Warning(_) | Block::Warnings { .. } => {
                Ok(())
            }
        }
    }

    fn put_figure(&mut self, figure: &Figure) -> Result<(), ReportError> {
        self.put(
            &format!("figures/{}.svg", figure.id),
            &figure.svg.finish(&figure.id, &figure.title, &figure.description),
        )?;
        self.summary.figures.push(figure.id.clone());
        self.put_numbers(&figure.id, &figure.title, &figure.numbers)
    }

    fn put_numbers(&mut self, id: &str, title: &str, numbers: &Numbers) -> Result<(), ReportError> {
        self.put(&format!("data/{id}.json"), &format!("{}\n", numbers.to_json(id, title)))
    }

    fn put(&mut self, name: &str, content: &str) -> Result<(), ReportError> {
        let failed = |source| ReportError::Write { path: self.draft.join(name), source };
        atomic::write(&Draft(self.draft).file(name), content.as_bytes()).map_err(failed)?;
        self.summary.files.push(name.into());
        self.summary.bytes += content.len() as u64;
        Ok(())
    }
}

/// Gives every figure and table a unique name that is valid as a file name.
fn name_once(sections: &mut [Section]) {
    let mut taken = BTreeSet::new();
    let mut rename = |id: &mut String| {
        let plain = Some(slug(id)).filter(|s| !s.is_empty()).unwrap_or_else(|| "unnamed".into());
        let numbered = |n: usize| if n == 1 { plain.clone() } else { format!("{plain}-{n}") };
        *id = (1..).map(numbered).find(|name| !taken.contains(name)).unwrap_or_default();
        taken.insert(id.clone());
    };
    for block in sections.iter_mut().flat_map(|s| &mut s.blocks) {
        match block {
            Block::Figures(figures) => figures.iter_mut().for_each(|f| rename(&mut f.id)),
            Block::Table(TableBlock { id, .. }) | Block::FoldedTable(TableBlock { id, .. }) => rename(id),
            Block::Heading(_) | Block::Text(_) | Block::Result(_) | Block::Warning(_) | Block::Warnings { .. } => {}
        }
    }
}

fn head(data: &Data) -> Head {
    let study = &data.study;
    let title = if study.title.is_empty() { &study.name } else { &study.title };
    let facts = [
        ("study", study.name.clone()),
        ("version", study.version.clone()),
        ("date", study.date.clone()),
        ("seed", study.seed.to_string()),
        ("licence", study.license.clone()),
        ("creators", study.creators.join(", ")),
        ("program", data.version.clone()),
        ("SHA-256 of the study", data.study_sha256.clone()),
    ];
    let known = facts.into_iter().filter(|(_, value)| !value.is_empty());
    Head {
        title: title.clone(),
        description: study.description.clone(),
        facts: known.map(|(name, value)| (name.to_owned(), value)).collect(),
        numbers: key_numbers(data),
    }
}

/// Counts of what the release has; kinds that it lacks are left out. Only data files are counted: the report is not part of its own
/// counts, and documents are added when the release is sealed.
fn key_numbers(data: &Data) -> Vec<(String, String)> {
    let stage = |name: &str| data.of_stage(name).count();
    let counts = [
        (stage("terrain"), "terrain"),
        (stage("dem"), "measured DEM"),
        (data.fits.len(), "covariance fit"),
        (stage("texture"), "texture"),
        (data.routes.len(), "route"),
        (data.formations.len(), "team run"),
        (data.missions.len(), "mission"),
        (data.rovers.len(), "rover"),
        (data.stored.recordings, "MCAP recording"),
        (data.stored.files, "data file"),
    ];
    let plural = |n: usize, what: &str| if n == 1 { what.to_owned() } else { format!("{what}s") };
    let named = |(n, what): (usize, &str)| (set::count(n), plural(n, what));
    let mut numbers: Vec<(String, String)> = counts.into_iter().filter(|(n, _)| *n > 0).map(named).collect();
    if data.stored.bytes > 0 {
        numbers.push((set::bytes(data.stored.bytes), "of data".into()));
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that are equal, or empty once they are valid as file names, are numbered over all sections.
    #[test]
    fn val_names_are_unique_and_valid() {
        let table = |id: &&str| {
            let numbers = Numbers::new("", &[]);
            Block::FoldedTable(TableBlock { id: (*id).to_owned(), caption: String::new(), numbers })
        };
        let section = |ids: &[&str]| {
            let blocks = ids.iter().map(table).chain([Block::Text("a".into())]).collect();
            Section { id: "section", name: "", title: "", blocks }
        };
        let mut sections = [section(&["a", "A", "a-2"]), section(&["a", "../", "??"])];
        name_once(&mut sections);
        let name = |block: &Block| match block {
            Block::FoldedTable(table) => Some(table.id.clone()),
            _ => None,
        };
        let names: Vec<String> = sections.iter().flat_map(|section| &section.blocks).filter_map(name).collect();
        assert_eq!(names, ["a", "a-2", "a-2-2", "a-3", "unnamed", "unnamed-2"]);
    }

    /// Counts at the head of the page; kinds that the release lacks are left out.
    #[test]
    fn val_the_head_counts_what_there_is() {
        let mut data = crate::tests::made_up::empty();
        assert!(key_numbers(&data).is_empty());
        let full = crate::tests::made_up::full(1, 24);
        data.missions = full.missions[..2].to_vec();
        data.fits = full.fits[..1].to_vec();
        data.rovers = full.rovers[..3].to_vec();
        data.stored.add("mcap/a/b.mcap", 1_000_000);
        data.stored.add("fit/a.json", 234_000);
        let counts: Vec<String> = key_numbers(&data).into_iter().map(|(n, what)| format!("{n} {what}")).collect();
        assert_eq!(
            counts,
            ["1 covariance fit", "2 missions", "3 rovers", "1 MCAP recording", "2 data files", "1.23 MB of data"]
        );
    }
}
