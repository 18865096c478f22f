//! Verbs, one module per group: arguments in; a printed result and an exit code out.

mod analyze;
mod cache;
mod compare;
mod coregister;
mod files;
mod fits;
mod generate;
mod init;
mod lerobot;
mod lists;
mod navigate;
mod photoclinometry;
mod plan;
mod render;
mod rover;
pub mod serve;
mod shown;
mod study;

use crate::Verdict;
use crate::args::{self, Arguments, Compress, Verb, Writing};
use crate::failure::Failure;
use sastrugi_stages::Error;
use sastrugi_stages::remote::{check_file, check_local};
use sastrugi_stages::verbs::{Reading, numbers};
use sastrugi_store::atomic;
use sastrugi_store::dem::points::GridSettings;
use sastrugi_store::dem::{Compression, Format, WriteOptions};
use std::path::Path;

/// Runs the verb.
pub fn dispatch(arguments: &Arguments) -> Verdict {
    let common = &arguments.common;
    // Before any work, which a wrong output would waste.
    for output in arguments.verb.outputs() {
        let check = if arguments.verb.is_folder(output) { check_local } else { check_file };
        check(output)?;
    }
    arguments.verb.output_file().into_iter().for_each(atomic::clear_leftovers);
    match &arguments.verb {
        Verb::Init(args) => init::init(args, common),
        Verb::Run(args) => study::run(args, common),
        Verb::Plan(args) => plan::plan(args, common),
        Verb::Merge(args) => study::merge(args, common),
        Verb::Cache(args) => cache::cache(args, common),
        Verb::Verify(args) => study::verify(args, common),
        Verb::Report(args) => study::report(args, common),
        Verb::Pack(args) => study::pack(args, common),
        Verb::Traverse(args) => study::traverse(args, common),
        Verb::Navigate(args) => navigate::navigate(args, common),
        Verb::Rover(args) => rover::rover(args, common),
        Verb::Terrain(args) => generate::terrain(args, common),
        Verb::Fit(args) => generate::fit(args, common),
        Verb::Coregister(args) => coregister::coregister(args, common),
        Verb::Texture(args) => generate::texture(args, common),
        Verb::Roughness(args) => generate::roughness(args, common),
        Verb::Analyze(args) => analyze::analyze(args, common),
        Verb::Compare(args) => compare::compare(args, common),
        Verb::Convert(args) => files::convert(args, common),
        Verb::Hillshade(args) => files::hillshade(args, common),
        Verb::Photoclinometry(args) => photoclinometry::photoclinometry(args, common),
        Verb::Render(args) => render::render(args, common),
        Verb::Info(args) => files::info(args, common),
        Verb::Kinds(args) => lists::kinds(args, common),
        Verb::Schema(args) => lists::schema(args, common),
        Verb::Serve(args) => serve::serve(args, common),
        Verb::Completions(args) => lists::completions(args, &arguments.common),
        Verb::Licences => lists::licences(&arguments.common),
    }
}

/// Starts the thread pool of the kernels.
pub fn start_threads(threads: Option<u16>) -> Result<(), Failure> {
    let threads = usize::from(threads.unwrap_or(0));
    let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    started.map_err(|e| Failure(Error::Retry(format!("threads cannot be started: {e}; try fewer `--threads`"))))
}

/// How a DEM is written to `output`.
fn options(writing: &Writing, output: &Path) -> Result<WriteOptions, Failure> {
    if writing.cog && Format::of_name(output) != Some(Format::GeoTiff) {
        return Err(Failure::usage(format!("{}: --cog requires a GeoTIFF (.tif)", output.display())));
    }
    let compression = match writing.compress {
        Compress::None => Compression::None,
        Compress::Deflate => Compression::Deflate,
        Compress::Zstd => Compression::Zstd,
    };
    Ok(WriteOptions { compression, cloud_optimised: writing.cog, ..WriteOptions::default() })
}

/// How a DEM is read.
fn reading(args: &args::Reading) -> Result<Reading, Failure> {
    let (statistic, fill_cells, ground_only) = (args.statistic, args.fill, args.ground);
    let gridding = GridSettings { statistic, fill_cells, ground_only, ..GridSettings::default() };
    Ok(Reading { cell_m: cell(args.cell.as_deref())?, gridding, ..Reading::default() })
}

/// `--cell M` or `--cell X,Y`.
fn cell(text: Option<&str>) -> Result<Option<[f64; 2]>, Failure> {
    let Some(text) = text else { return Ok(None) };
    let cell = match numbers::<1>("--cell", text) {
        Ok([side]) => [side; 2],
        Err(_) => numbers::<2>("--cell", text).map_err(|_| {
            Failure::usage(format!("`--cell {text}`: expected one number, or two separated by a comma, in m"))
        })?,
    };
    if cell.iter().all(|c| *c > 0.0) {
        return Ok(Some(cell));
    }
    Err(Failure::usage(format!("`--cell {text}`: cell size must be above 0")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_cell_sizes() {
        let read = |text: &str| cell(Some(text)).map_err(|failure| failure.0.to_string());
        assert_eq!(cell(None).ok(), Some(None));
        assert_eq!(read("0.5"), Ok(Some([0.5, 0.5])));
        assert_eq!(read("0.5,2"), Ok(Some([0.5, 2.0])));
        for text in ["0", "-1", "1,0"] {
            assert_eq!(read(text), Err(format!("`--cell {text}`: cell size must be above 0")));
        }
        for text in ["", "a", "1,2,3", "nan"] {
            assert_eq!(
                read(text),
                Err(format!("`--cell {text}`: expected one number, or two separated by a comma, in m"))
            );
        }
    }

    /// What cannot be an overview is refused before anything is read.
    #[test]
    fn val_cloud_optimised_files_are_geotiffs() {
        let writing = |compress| Writing { compress, cog: true };
        let good = options(&writing(Compress::Zstd), Path::new("a.tif")).ok().unwrap();
        assert!(good.cloud_optimised && good.compression == Compression::Zstd);
        let refused = options(&writing(Compress::None), Path::new("a.asc")).err().unwrap();
        assert!(refused.0.to_string().contains("--cog requires a GeoTIFF"), "{}", refused.0);
    }
}
