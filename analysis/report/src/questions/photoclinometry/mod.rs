//! How accurate heights from images are: every recovered surface compared with the true one, by wavelength, by covariance, cell by cell, and
//! along the settings that a study sweeps.

mod bands;
mod covariances;
mod maps;
mod surfaces;
mod sweeps;
mod tables;
mod verdict;

use super::Question;
use crate::ReportError;
use crate::content::{Block, Figure};
use crate::data::Data;
use crate::render::number as set;
use covariances::Pair;
use surfaces::{Surface, all, chosen};

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "photoclinometry",
    name: "Heights from images",
    title: "How accurate are heights recovered from images?",
    answer,
};

/// Surfaces that have sentences, curves and maps; the tables list all.
const CHOSEN_MAX: usize = 6;

const CEILINGS: &str = "A ceiling is the value that the true surface itself reaches after averaging over the cells of the map; no inversion on \
these cells can be expected to do better. The correlation is that of the shaded surfaces at albedo 1. The slope error is the RMS length of the \
difference of the two gradients, at the truth's own cells. Height errors are computed after subtracting their mean, or the plane through them.";
const BY_WAVELENGTH: &str = "Octaves of wavelength, from two cells upwards. The plane is subtracted from both surfaces, the true one is averaged \
over the cells, and a Hann window is applied. Points lie at the geometric mean of an octave's ends. The squared coherence is 1 where the \
recovered waves are in phase with the true ones at a constant ratio; the RMS compares their amplitudes.";

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let surfaces = all(data);
    if surfaces.is_empty() {
        return Ok(Vec::new());
    }
    let chosen = chosen(&surfaces);
    let drawn = &chosen[..chosen.len().min(CHOSEN_MAX)];
    let pairs = covariances::pairs(data, &surfaces);
    let quoted = best(&surfaces).filter(|best| surfaces.len() == 1 || best.compared());
    let others: Vec<&Surface> =
        drawn.iter().copied().filter(|s| quoted.is_none_or(|quoted| quoted.id() != s.id())).collect();
    let mut blocks = vec![Block::Result(in_words(surfaces.len(), quoted, &pairs))];
    blocks.extend(verdict::paragraphs(&others, &pairs).into_iter().map(Block::Text));
    blocks.extend(left_out(&surfaces, drawn).map(Block::Text));
    blocks.extend(verdict::warnings(&surfaces).into_iter().map(Block::Warning));
    blocks.extend([Block::Text(CEILINGS.into()), Block::Table(tables::errors(&surfaces))]);
    let by_wavelength = bands::figures(&surfaces, drawn);
    if !by_wavelength.is_empty() {
        blocks.extend([
            Block::Heading("By wavelength".into()),
            Block::Text(BY_WAVELENGTH.into()),
            Block::Figures(by_wavelength),
        ]);
    }
    blocks.extend(covariances::blocks(data, &pairs));
    for surface in drawn {
        let maps = maps::figures(data, surface)?;
        if !maps.is_empty() {
            blocks.extend([Block::Heading(format!("Surface {}", surface.id())), Block::Figures(maps)]);
        }
    }
    blocks.extend(sweeps::blocks(&surfaces));
    blocks.push(Block::FoldedTable(tables::inversions(&surfaces)));
    blocks.push(Block::FoldedTable(tables::bands(data)));
    Ok(blocks)
}

/// The surface with the smallest slope error, or the first where none is compared with a true one.
fn best<'a, 'b>(surfaces: &'b [Surface<'a>]) -> Option<&'b Surface<'a>> {
    let compared = surfaces.iter().filter(|s| s.compared());
    compared.min_by(|a, b| a.row.slope_error_rms.total_cmp(&b.row.slope_error_rms)).or(surfaces.first())
}

/// How many surfaces were recovered, and how well the best; without it, none is compared with a true one.
fn in_words(surfaces: usize, best: Option<&Surface>, pairs: &[Pair]) -> String {
    let recovered = set::counted(surfaces, "surface");
    let sentence = best.map(|best| verdict::paragraphs(&[best], pairs).join(" "));
    match (surfaces, sentence) {
        (1, Some(sentence)) => format!("{recovered} was recovered from images. {sentence}"),
        (_, Some(sentence)) => {
            format!("{recovered} were recovered from images. The one with the smallest slope error is {sentence}")
        }
        (_, None) => format!("{recovered} were recovered from images, without a true surface to compare with."),
    }
}

/// The best surface beside the true one; empty if the release has neither.
pub(super) fn picture(data: &Data) -> Result<Vec<Figure>, ReportError> {
    best(&all(data)).map_or(Ok(Vec::new()), |surface| maps::both(data, surface))
}

/// How the drawn surfaces were chosen; `None` when all are drawn.
fn left_out(surfaces: &[Surface], drawn: &[&Surface]) -> Option<String> {
    (drawn.len() < surfaces.len()).then(|| {
        format!(
            "The figures show {} of {}: for each item of the study, those with the smallest and the largest slope error, at most {CHOSEN_MAX} in \
             all. The tables list all.",
            set::count(drawn.len()),
            set::counted(surfaces.len(), "recovered surface")
        )
    })
}
