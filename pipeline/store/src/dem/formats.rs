//! Table of formats: how each is recognised, read and written. It imports the formats; none imports it.

use super::blocks::BlockReader;
use super::crs::Crs;
use super::points::{self, GridSettings};
use super::raster::{Claimed, Dem, DemError, Format, ReadOptions, Refusal, WriteOptions};
use super::{ascii, geotiff, hgt, mesh, npy, png, tiff_writer};
use sastrugi_numeric::Grid;
use std::fs::File;
use std::path::Path;

/// File name endings that [`super::write()`] supports.
pub const WRITTEN_ENDINGS: &str = ".tif, .asc, .hgt, .png, .npy, .obj, .glb and .usda";
/// Formats that can be read.
pub(super) const READ_FORMATS: &str = "GeoTIFF, ESRI ASCII, .hgt, .npy, greyscale .png, .las and .laz";

type GridPoints = fn(&Path, File, &ReadOptions, &GridSettings) -> Result<Dem, DemError>;
type Stream = fn(&Path, &ReadOptions) -> Result<Dem, DemError>;
type Parse = fn(&Path, Vec<u8>, &ReadOptions) -> Result<Dem, Refusal>;
type Open = fn(&Path, &ReadOptions) -> Result<BlockReader, DemError>;
type Claim = fn(&Path, File, &ReadOptions) -> Option<Claimed>;
type Render = fn(&Path, &Grid, &Crs, &WriteOptions) -> Result<(Vec<u8>, Vec<String>), Refusal>;

/// Capabilities of a format.
pub(super) struct Codec {
    pub format: Format,
    /// Name in tables.
    name: &'static str,
    /// Endings of file names, in lower case.
    endings: &'static [&'static str],
    /// True for the first bytes of such a file.
    starts: fn(&[u8]) -> bool,
    /// Grids the points of an open file, at any position.
    pub grid: Option<GridPoints>,
    /// Reads a raster without loading the whole file.
    pub stream: Option<Stream>,
    /// Reads a raster from all of its bytes.
    pub parse: Option<Parse>,
    /// Opens a raster whose rows are decoded on demand.
    pub open: Option<Open>,
    /// Size according to the header; takes the open file, positioned after its first bytes.
    pub claimed: Option<Claim>,
    /// The bytes of a file, and notes on what is lost.
    pub render: Option<Render>,
    /// Defined in metres.
    in_metres: bool,
    /// A mesh, which may be decimated.
    mesh: bool,
}

impl Codec {
    /// An entry without capabilities.
    const fn new(format: Format, name: &'static str, endings: &'static [&'static str]) -> Self {
        Self {
            format,
            name,
            endings,
            starts: |_| false,
            grid: None,
            stream: None,
            parse: None,
            open: None,
            claimed: None,
            render: None,
            in_metres: false,
            mesh: false,
        }
    }
}

/// One entry for each format. No two formats match the same first bytes.
static CODECS: [Codec; 9] = [
    Codec {
        starts: geotiff::looks_like,
        stream: Some(geotiff::read),
        parse: Some(|_, bytes, options| geotiff::parse(bytes, options)),
        open: Some(BlockReader::of_geotiff),
        claimed: Some(|path, _, options| geotiff::claimed(path, options)),
        render: Some(|_, grid, crs, options| Ok((tiff_writer::heights(grid, crs, options)?, vec![]))),
        ..Codec::new(Format::GeoTiff, "geotiff", &["tif", "tiff"])
    },
    Codec {
        starts: ascii::looks_like,
        parse: Some(|path, bytes, _| ascii::parse(path, &bytes)),
        claimed: Some(|path, _, _| ascii::claimed(path)),
        render: Some(|_, grid, crs, _| ascii::render(grid, crs)),
        ..Codec::new(Format::EsriAscii, "esri_ascii", &["asc"])
    },
    Codec {
        parse: Some(|path, bytes, _| hgt::parse(path, &bytes)),
        claimed: Some(|path, file, _| hgt::claimed(path, &file)),
        render: Some(|path, grid, crs, _| hgt::render(path, grid, crs)),
        ..Codec::new(Format::Hgt, "hgt", &["hgt"])
    },
    Codec {
        starts: npy::looks_like,
        parse: Some(|_, bytes, options| npy::parse(&bytes, options)),
        claimed: Some(|path, _, options| npy::claimed(path, options)),
        render: Some(|_, grid, _, _| Ok(npy::render(grid))),
        ..Codec::new(Format::Npy, "npy", &["npy"])
    },
    Codec {
        starts: png::looks_like,
        parse: Some(|_, bytes, options| png::parse(&bytes, options)),
        claimed: Some(|_, file, options| png::claimed(file, options)),
        render: Some(|_, grid, _, options| png::render(grid, &options.values)),
        ..Codec::new(Format::Png, "png", &["png"])
    },
    Codec {
        render: Some(|_, grid, crs, options| {
            let decimation = options.decimation.as_ref();
            Ok((mesh::obj(grid, decimation)?, mesh::with_decimation(crs.loss_notes(), decimation)))
        }),
        in_metres: true,
        mesh: true,
        ..Codec::new(Format::Obj, "obj", &["obj"])
    },
    Codec {
        render: Some(|_, grid, crs, options| {
            let decimation = options.decimation.as_ref();
            Ok((mesh::glb(grid, decimation)?, mesh::with_decimation(mesh::local_notes(grid, crs), decimation)))
        }),
        in_metres: true,
        mesh: true,
        ..Codec::new(Format::Glb, "glb", &["glb"])
    },
    Codec {
        render: Some(|_, grid, crs, options| {
            let decimation = options.decimation.as_ref();
            Ok((mesh::usda(grid, decimation)?, mesh::with_decimation(mesh::local_notes(grid, crs), decimation)))
        }),
        in_metres: true,
        mesh: true,
        ..Codec::new(Format::Usda, "usda", &["usda"])
    },
    Codec {
        starts: points::looks_like,
        grid: Some(points::read_dem),
        // A point cloud by name only.
        parse: Some(|_, _, _| Err(Refusal::new("not a point cloud: LAS and LAZ files start with \"LASF\""))),
        claimed: Some(|_, file, options| points::claimed(file, options.cell_m.map(|[x, y]| x.min(y)))),
        ..Codec::new(Format::Las, "las", &["las", "laz"])
    },
];

/// The format identified by the first bytes of a file.
pub(super) fn of_start(bytes: &[u8]) -> Option<&'static Codec> {
    CODECS.iter().find(|codec| (codec.starts)(bytes))
}

/// The format of a file of which only the first bytes are known: by those bytes, or by its name for a format without a signature, or with
/// blanks before the first word.
pub(super) fn of_header(path: &Path, bytes: &[u8]) -> Option<&'static Codec> {
    let by_name = |codec: &&Codec| matches!(codec.format, Format::EsriAscii | Format::Hgt);
    of_start(bytes).or_else(|| of_name(path).filter(by_name))
}

/// The format of a raster: by its first bytes, or by its name if those are not recognised or indicate a point cloud.
pub(super) fn of_raster(path: &Path, bytes: &[u8]) -> Option<&'static Codec> {
    of_start(bytes).filter(|codec| codec.grid.is_none()).or_else(|| of_name(path))
}

/// The format with the ending of a file name.
pub(super) fn of_name(path: &Path) -> Option<&'static Codec> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    CODECS.iter().find(|codec| codec.endings.contains(&ending.as_str()))
}

impl Format {
    fn codec(self) -> &'static Codec {
        CODECS.iter().find(|codec| codec.format == self).expect("every format is in the table")
    }

    /// Name in tables.
    pub fn name(self) -> &'static str {
        self.codec().name
    }

    /// The format with the ending of a file name.
    pub fn of_name(path: &Path) -> Option<Self> {
        of_name(path).map(|codec| codec.format)
    }

    /// True for formats defined in metres, for which a raster in degrees is converted before writing.
    pub fn in_metres(self) -> bool {
        self.codec().in_metres
    }

    /// True for meshes, which may be decimated.
    pub fn is_mesh(self) -> bool {
        self.codec().mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn val_the_listed_endings_are_those_of_the_table() {
        let words = WRITTEN_ENDINGS.replace(" and ", ", ");
        let named: BTreeSet<&str> = words.split(", ").map(|ending| ending.trim_start_matches('.')).collect();
        let written = CODECS.iter().filter(|codec| codec.render.is_some()).map(|codec| codec.endings[0]);
        assert_eq!(named, written.collect());
    }
}
