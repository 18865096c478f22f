//! Further files that show a fit.

use crate::args::FitShown;
use crate::failure::Failure;
use sastrugi_report::{fit_png, fit_svg};
use sastrugi_schemas::fit::FitFile;
use sastrugi_stages::verbs::fit::write_bins;
use sastrugi_store::atomic;
use std::path::Path;

/// The requested files, with known extensions.
pub struct ShownFiles<'a> {
    plot: Option<&'a Path>,
    csv: Option<&'a Path>,
}

impl<'a> ShownFiles<'a> {
    /// Refuses unknown extensions.
    pub fn of(args: &'a FitShown) -> Result<Self, Failure> {
        let plot = args.plot.as_deref();
        let why = "a plot must be .svg or .png";
        plot.into_iter().try_for_each(|path| check_ending(path, &["svg", "png"], why))?;
        let csv = args.csv.as_deref();
        csv.into_iter()
            .try_for_each(|path| check_ending(path, &["csv"], "the file name after `--csv` must end in .csv"))?;
        Ok(Self { plot, csv })
    }

    /// All of them.
    pub fn files(&self) -> Vec<&'a Path> {
        self.plot.into_iter().chain(self.csv).collect()
    }

    /// Writes them.
    pub fn write(&self, fit: &FitFile) -> Result<(), Failure> {
        if let Some(path) = self.plot {
            let name = fit.source.as_ref().map_or("fit", |source| source.file.as_str());
            write(path, &plot(path, fit, name)?)?;
        }
        if let Some(path) = self.csv {
            write_bins(path, fit)?;
        }
        Ok(())
    }
}

/// Refuses a file whose extension is not listed.
pub fn check_ending(path: &Path, endings: &[&str], why: &str) -> Result<(), Failure> {
    if endings.iter().any(|ending| ends_in(path, ending)) {
        return Ok(());
    }
    Err(Failure::usage(format!("{}: {why}", path.display())))
}

/// The plot of a fit, in the format of the file's extension.
fn plot(path: &Path, fit: &FitFile, name: &str) -> Result<Vec<u8>, Failure> {
    if ends_in(path, "png") {
        return fit_png(fit, name).map_err(|e| Failure::failed(format!("{}: {e}", path.display())));
    }
    Ok(fit_svg(fit, name).into_bytes())
}

fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    atomic::write(path, bytes).map_err(|e| Failure::failed(format!("{}: {e}", path.display())))
}
