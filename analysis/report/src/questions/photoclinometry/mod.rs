//! What images tell of the heights: every surface recovered from images beside the true one, by wavelength, by covariance, cell by cell, and with the
//! errors that a study sweeps.

mod bands;
mod covariances;
mod maps;
mod surfaces;
mod sweeps;
mod tables;
mod verdict;

use super::Question;
use crate::ReportError;
use crate::content::Block;
use crate::data::Data;
use crate::render::number as set;
use surfaces::{Surface, all, chosen};

/// Registry entry.
pub const QUESTION: Question = Question {
    id: "photoclinometry",
    name: "Heights from images",
    title: "What do images tell of the heights?",
    answer,
};

/// Surfaces of which sentences, curves and maps are made; all are in the tables.
const CHOSEN_MAX: usize = 6;

const CEILINGS: &str = "A ceiling is what the true surface itself reaches once it is averaged over the cells of the map: no inversion on these cells can be \
expected to do better. The correlation is that of the shaded surfaces at albedo 1, the slope error the rms length of the difference of both gradients, at the truth's own cells. \
Heights are less their mean, or less the plane through their errors.";
const BY_WAVELENGTH: &str = "Octaves of wavelength, from two cells upwards: both surfaces less their planes, the true one averaged over the cells, under a Hann window. Points lie at the \
geometric middle of an octave. The squared coherence is 1 where the recovered waves lie on the true ones and have one factor to them; amplitudes are what the rms says.";

fn answer(data: &Data) -> Result<Vec<Block>, ReportError> {
    let surfaces = all(data);
    if surfaces.is_empty() {
        return Ok(Vec::new());
    }
    let chosen = chosen(&surfaces);
    let drawn = &chosen[..chosen.len().min(CHOSEN_MAX)];
    let pairs = covariances::pairs(data, &surfaces);
    let mut blocks: Vec<Block> = verdict::paragraphs(drawn, &pairs).into_iter().map(Block::Text).collect();
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

/// How surfaces were chosen to be drawn; `None` when all are.
fn left_out(surfaces: &[Surface], drawn: &[&Surface]) -> Option<String> {
    (drawn.len() < surfaces.len()).then(|| {
        format!(
            "Drawn are {} of {}: of each item of the study the one with the least and the one with the greatest slope error, {CHOSEN_MAX} at most. \
             The tables hold all.",
            set::count(drawn.len()),
            set::counted(surfaces.len(), "recovered surface")
        )
    })
}
