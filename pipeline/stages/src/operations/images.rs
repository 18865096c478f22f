//! Renders a surface to image files. Shared by studies and verbs.

use crate::job::JobError;
use crate::operations::dem::input_error;
use sastrugi_imaging::{
    CameraPose, ImageDescription, RenderError, RenderParameters, Rendered, Rendering, Scene, display, render,
};
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::Kind;
use sastrugi_schemas::kind::schema_of;
use sastrugi_store::atomic::{self, Target};
use sastrugi_store::dem::{self, Crs, Values, WriteOptions};
use sastrugi_store::picture;
use std::path::Path;

/// The one kind of image.
pub fn kind() -> Kind {
    Kind {
        family: "image",
        kind: "image",
        summary: "image of a surface for a given sun and camera: albedo, 35 % Lambert and 65 % Lommel-Seeliger, cast shadows",
        source: "JPL synthetic terrain environment; McEwen (1991); camera and noise are our choice",
        parameters: schema_of::<RenderParameters>(),
    }
}

/// The surface to render.
pub struct Ground {
    /// Heights, m.
    pub heights: Grid,
    /// Albedo of the same cells.
    pub albedo: Option<Grid>,
    /// Coordinate system of the heights.
    pub crs: Crs,
    /// Its id or file.
    pub name: String,
    /// Id or file of the albedo map.
    pub albedo_name: Option<String>,
}

/// An image with its description.
pub struct Made {
    /// The image.
    pub rendering: Rendering,
    /// Contents of the JSON file next to it.
    pub description: ImageDescription,
    /// Brightness that is white in the PNG.
    pub png_white: f64,
}

/// Targets of the files of an image; those that are absent are not written.
pub struct Files<'a> {
    /// The image, GeoTIFF.
    pub tif: Option<Target<'a>>,
    /// Its description.
    pub json: Option<Target<'a>>,
    /// The picture.
    pub png: Option<Target<'a>>,
}

/// Reads a map next to the heights, if it exists.
///
/// # Errors
/// A file that exists but cannot be read.
pub fn map(path: &Path) -> Result<Option<Grid>, JobError> {
    path.is_file().then(|| dem::read(path).map(|read| read.grid).map_err(input_error)).transpose()
}

/// Renders an image; `file` is its name in the description.
///
/// # Errors
/// A camera that does not fit the surface or sees none of it, or an albedo map with different cells.
pub fn make(
    ground: &Ground,
    parameters: &RenderParameters,
    streams: &Streams,
    file: &str,
) -> Result<Made, RenderError> {
    let scene = Scene { heights: &ground.heights, albedo: ground.albedo.as_ref() };
    let rendering = render(&scene, parameters, streams)?;
    let g = &ground.heights.geometry;
    let rendered = Rendered {
        surface: ground.name.clone(),
        surface_shape: [g.rows, g.cols],
        surface_cell_m: g.cell,
        albedo_map: ground.albedo_name.clone(),
        albedo: parameters.albedo,
        samples: parameters.samples,
        shadows: parameters.shadows,
        noise_stream: (!parameters.noise.is_none()).then(|| streams.label()),
    };
    let description = ImageDescription {
        image: file.to_owned(),
        sun: parameters.sun,
        camera: rendering.pose,
        photometry: parameters.photometry,
        exposure: parameters.exposure,
        haze: parameters.haze,
        noise: parameters.noise,
        rendered: Some(rendered),
    };
    let png_white = display::white(&rendering.image());
    Ok(Made { rendering, description, png_white })
}

impl Made {
    /// Writes the files. An image taken from the nadir is a map and gets the coordinate system of the surface.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, files: Files<'_>, crs: &Crs, options: &WriteOptions) -> Result<(), JobError> {
        let image = self.rendering.image();
        if let Some(target) = files.tif {
            let crs = if self.rendering.pose.is_nadir() { crs.clone() } else { Crs::default() };
            let values = Values::Quantity { unit: "1".into(), description: "brightness (I/F)".into() };
            dem::write(target, &image, &crs, &WriteOptions { values, ..options.clone() }).map_err(JobError::io)?;
        }
        if let Some(target) = files.json {
            let mut text = serde_json::to_vec_pretty(&self.description).map_err(JobError::new)?;
            text.push(b'\n');
            atomic::write(target, &text).map_err(JobError::io)?;
        }
        if let Some(target) = files.png {
            picture::write_grey(target, &display::grey(&image, self.png_white)).map_err(JobError::io)?;
        }
        Ok(())
    }

    /// Rows and columns of the image.
    pub fn shape(&self) -> [usize; 2] {
        match self.rendering.pose {
            CameraPose::Parallel { rows, cols, .. } | CameraPose::Pinhole { rows, cols, .. } => [rows, cols],
        }
    }
}
