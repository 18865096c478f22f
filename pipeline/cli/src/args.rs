//! The command line.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use sastrugi_schemas::study::Simulator;
use sastrugi_stages::starting::STARTING;
use sastrugi_store::dem::points::Statistic;
use std::path::{Path, PathBuf};

/// Rough-terrain datasets that can be reproduced bit for bit, and the statistics to compare them.
#[derive(Debug, Parser)]
#[command(name = "sastrugi", version, propagate_version = true, max_term_width = 100)]
#[command(
    after_help = "Exit codes: 0 done, 1 failed, 2 bad usage or study, 3 done but some items failed, 4 verification (or compare \
--fail-on-difference) found a difference, 65 input data missing or unusable, 75 interrupted or retryable.\n\nExample:\n  sastrugi run fixtures/studies/quickstart.toml -o release"
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
    /// Options of every verb.
    #[command(flatten)]
    pub common: Common,
}

/// Options of every verb.
#[derive(Debug, Args)]
pub struct Common {
    /// Threads to use; all cores when absent. Does not affect results.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Machine-readable result on stdout.
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress on stderr; errors always print.
    #[arg(long, global = true)]
    pub quiet: bool,
}

/// Verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Write a small commented study to start from, and the schema that lets editors check it.
    #[command(after_help = init_help())]
    Init(Init),
    /// Run a study to a release; goes on where an earlier run stopped.
    #[command(
        after_help = "Examples:\n  sastrugi run study.toml -o release\n  sastrugi run study.toml -o part1 --shard 1/3"
    )]
    Run(Run),
    /// Say what a run would do, how much it is, and why each stale item is stale.
    #[command(
        after_help = "Examples:\n  sastrugi plan study.toml -o release\n  sastrugi plan study.toml -o part1 --shard 1/3"
    )]
    Plan(Plan),
    /// Join shards to a release, equal byte by byte to an unsharded run.
    #[command(after_help = "Example:\n  sastrugi merge part1 part2 part3 -o release")]
    Merge(Merge),
    /// Check every checksum, schema and count of a release; recompute items on request.
    #[command(after_help = "Examples:\n  sastrugi verify release\n  sastrugi verify release --recompute 3")]
    Verify(Verify),
    /// Generate one terrain.
    #[command(after_help = "Examples:\n  sastrugi terrain multifractal --seed 7 -o rough.tif\n  \
        sastrugi terrain weierstrass_mandelbrot --set fractal_dimension=2.4 --set size_px='[512, 512]' -o wm.png")]
    Terrain(Terrain),
    /// Fit the covariance of a measured DEM.
    #[command(after_help = "Exit code 3: some of several DEMs could not be fitted; 1: none of them.\n\n\
        Examples:\n  sastrugi fit snow.tif --outer-scale 2 -o fit.json\n  \
        sastrugi fit snow.tif --outer-scale 2 --model auto --bootstrap 199 --plot fit.svg -o fit.json\n  \
        sastrugi fit snow.tif --outer-scale 2 --mask plot.geojson --exclude trees.geojson -o fit.json\n  \
        sastrugi fit scan.laz --cell 0.05 --statistic median --outer-scale 2 -o fit.json\n  \
        sastrugi fit march.tif april.tif may.tif --outer-scale 2 --table season.csv\n  \
        sastrugi fit snow_on.tif --minus snow_off.tif --outer-scale 2 --difference depth.tif -o depth.json")]
    Fit(Box<Fit>),
    /// Co-register DEM B to DEM A: shift, raise, tilt and their standard errors, NMAD before and after, and the difference.
    #[command(
        after_help = "The method is that of Nuth and Kääb (2011), with raise and tilt in the same equations. With --mask or --exclude\n\
        B is fitted to stable terrain, and the difference covers all of A. Exit code 0 also when co-registration gains\n\
        nothing or does not converge: the verdict says it.\n\n\
        Examples:\n  sastrugi coregister flight_1.tif flight_2.tif\n  \
        sastrugi coregister snow_on.tif snow_off.tif --mask road.geojson -o depth.tif"
    )]
    Coregister(Coregister),
    /// Synthesise a texture that matches a fit.
    #[command(
        after_help = "Examples:\n  sastrugi texture fit.json --size 20x20 --cell 0.1 --seed 1 -o texture.tif\n  \
        sastrugi texture fit.json --size 10x10 --cell 0.05 --onto terrain.tif --covariance surface -o textured.tif\n  \
        sastrugi texture fit.json --fill snow.tif -o without-holes.tif"
    )]
    Texture(Texture),
    /// Classify and describe the roughness of a DEM.
    #[command(
        after_help = "With a vehicle or a band: RMS of profiles in that band of wavelengths, power law of their density, class of\n\
        ISO 8608 and International Roughness Index.\n\
        With --wind or --wind-from: aerodynamic roughness length z0 for each direction.\n\n\
        Examples:\n  sastrugi roughness terrain.tif --classes classes.tif\n  \
        sastrugi roughness terrain.tif --vehicle wb=2.7,r=0.33 --rms-map rms.txt\n  \
        sastrugi roughness terrain.tif --band 0.3048:3.048 --detrend ma\n  \
        sastrugi roughness ice.tif --wind --outer-scale 2\n  \
        sastrugi roughness ice.tif --wind-from 225,240 --outer-scale 2"
    )]
    Roughness(Roughness),
    /// Drive missions over one DEM, to a release of their own.
    #[command(after_help = "Examples:\n  sastrugi traverse terrain.tif --vehicle husky_a200 --missions 5 -o drive\n  \
        sastrugi traverse bar.tif --set-missions length_m=2 --set-missions border_m=0.5 \\\n    \
        --set-roughness closing_radius_m=0 --replicates 8 -o drive")]
    Traverse(Traverse),
    /// Plan a route over one DEM, alone or with a team in formation that follows it: as GeoJSON, as a picture, or as a release with tables,
    /// recordings and report.
    #[command(
        after_help = "An output that ends in .geojson or .svg holds the route alone; any other is the folder of a release.\n\
        GeoJSON is written in the DEM's own coordinates.\n\n\
        Examples:\n  sastrugi navigate site.tif --start 12,30 --goal 240,180 -o route.svg\n  \
        sastrugi navigate site.tif --start 12,30 --goal 240,180 --vehicle husky_a200 --set cost=energy -o route.geojson\n  \
        sastrugi navigate site.tif --start 12,30 --goal 240,180 --obstacles buildings.geojson -o routes\n  \
        sastrugi navigate site.tif --start 12,30 --goal 240,180 --formation wedge --team members=6 --team spacing_m=5 -o team"
    )]
    Navigate(Navigate),
    /// Drive the rovers of a study, and find out which of their numbers matter most.
    #[command(
        after_help = "Runs the [[rover]] tables of a study with the terrains that they need, and nothing else; the release holds that study,\n\
        and `run` makes the same release of it. With --perturb the numbers of every navigator move along trajectories (elementary\n\
        effects: Morris, 1991), over worlds, starts and noise that stay. `sastrugi plan` on the released study says what it costs.\n\n\
        Examples:\n  sastrugi rover fixtures/studies/rover_design.toml -o design\n  \
        sastrugi rover fixtures/studies/rover_design.toml --perturb 10% --trajectories 4 -o perturbed"
    )]
    Rover(Rover),
    /// Take the traversal metrics from MCAP logs of any vehicle: ours, ROS 2 or Foxglove.
    #[command(
        after_help = "Reads Odometry, PoseStamped, TFMessage, Imu (ROS 2, CDR), PoseInFrame, Odometry, FrameTransforms \
        (Foxglove, protobuf) and our own messages.\nExit code 3: a log breaks off, or some of several could not be judged.\n\n\
        Examples:\n  sastrugi analyze drive.mcap\n  sastrugi analyze bags/*.mcap --group field -o field.parquet\n  \
        sastrugi analyze drive.mcap --topic /odometry/filtered --dem site.tif --offset 0,0,-12.5"
    )]
    Analyze(Analyze),
    /// Write the report of a release: one offline HTML page, figures as SVG, numbers as JSON.
    #[command(after_help = "Examples:\n  sastrugi report release -o release-report\n  \
        sastrugi report release --against release-before --logs field.parquet -o compared")]
    Report(Report),
    /// Put a release into one archive, whose bytes are the same wherever it is packed.
    #[command(
        after_help = "A damaged release is not packed: exit code 4.\n\nExample:\n  sastrugi pack release -o release.tar"
    )]
    Pack(Pack),
    /// Say whether two releases, two DEMs or two fits are statistically the same, or a texture like its site.
    #[command(after_help = "Answers per quantity: same (within the bounds), different, cannot tell.\n\n\
        Two releases: files by their hashes, then the figures of the tables missions and terrains, group by group, with\n\
        terrains as the units. `--fail-on-difference` ends with exit code 4 when a figure is different, or, for releases of\n\
        the same study by the same version, when a file is missing or any byte differs.\n\nExamples:\n  \
        sastrugi compare release other-release --margin 0.1\n  \
        sastrugi compare site.tif synthetic.tif --outer-scale 2\n  \
        sastrugi compare site.json synthetic.json --equivalence-sigma 0.05 --fail-on-difference")]
    Compare(Compare),
    /// Convert between DEM formats, by file name ending (.tif .asc .hgt .png .npy, meshes .obj .glb .usda), grid point clouds
    /// (.las .laz), or write what a simulator imports: a folder of a terrain, or the file of a vehicle (.xml of MuJoCo, .urdf).
    #[command(
        after_help = "With --for OUT is a folder: the heights, README.md with the steps, import.json with every number. Sizes that the\n\
        program does not take are resampled (bilinear, over the same ground), and the folder says by how much heights change;\n\
        with --crop the middle is cut out, and every height stays.\n\n\
        Examples:\n  sastrugi convert N44W072.hgt tile.tif\n  sastrugi convert scan.laz scan.tif --cell 0.05 --fill 2\n  \
        sastrugi convert terrain.tif terrain.glb\n  sastrugi convert terrain.tif unreal-terrain --for unreal\n  \
        sastrugi convert terrain.tif terrain.obj --max-error 0.01\n  sastrugi convert husky_a200 husky.xml\n  \
        sastrugi convert mine.toml mine.urdf --surface hard_soil"
    )]
    Convert(Convert),
    /// Draw a DEM: heights in colours, under a light from the north-west, as PNG.
    #[command(after_help = "Examples:\n  sastrugi hillshade terrain.tif -o terrain.png\n  \
        sastrugi hillshade site.tif --pixels 400 --exaggeration 5 -o site.png")]
    Hillshade(Hillshade),
    /// Render a DEM or a generated surface under sun and camera: albedo, shading, cast shadows.
    #[command(
        after_help = "Cameras: nadir (straight down on all of it), nadir:PIXEL_M, parallel:AZIMUTH,ELEVATION[,PIXEL_M] (parallel rays from\n\
        there), pinhole:X,Y,Z,TO_X,TO_Y,TO_Z[,FIELD_OF_VIEW_DEG] (z above the ground; `--set camera.above_ground=false`: heights).\n\
        The albedo is that of DEM.albedo.tif beside the DEM, or of the generator's map, where there is one; else 0.25.\n\
        A GeoTIFF holds the brightness (I/F), with sun and camera in a .json beside it; a PNG shows it in 8-bit grey.\n\n\
        Examples:\n  sastrugi render site.tif --sun 120,20 -o site-morning.tif\n  \
        sastrugi render planetary --set-surface size_m='[20, 20]' --seed 3 --sun 90,15 -o mars.png\n  \
        sastrugi render site.tif --camera parallel:200,40,0.5 --set noise.relative=0.01 -o oblique.tif\n  \
        sastrugi render planetary --set-surface size_m='[20, 20]' --seed 3 --camera pinhole:4,2,0.3,4,12,0 --size 960x540 -o rover.png"
    )]
    Render(Render),
    /// Recover heights and albedo from three or more registered images of one surface under different suns.
    #[command(
        after_help = "IMAGES.toml lists the JSON files beside the images that `render` writes, `images = [\"a.json\", ...]`, or describes\n\
        images with the same keys in [[image]]; `coarse` and `coarse_sigma_m` add a coarse DEM, `altimetry` measured points\n\
        (CSV: x, y, z, sigma), `truth` a surface to compare with, [settings] anything of `sastrugi kinds photoclinometry`. Beside\n\
        DEM.tif stand DEM.albedo.tif, standard deviations (.uncertainty.tif of heights, .slope-sigma.tif, .albedo-sigma.tif),\n\
        DEM.condition.tif, DEM.lit.tif (images that show a cell lit) and DEM.leaning.tif.\n\n\
        Examples:\n  sastrugi photoclinometry images.toml -o dem.tif\n  \
        sastrugi photoclinometry images.toml --set cell_m=2 --set free_exposure=true --set stereo='{}' -o dem.tif"
    )]
    Photoclinometry(Photoclinometry),
    /// Say what a file or a release is.
    #[command(after_help = "Example:\n  sastrugi info terrain.tif")]
    Info(Info),
    /// List every generator, fit, method, mission rule and vehicle with parameters, defaults and sources.
    #[command(after_help = "Examples:\n  sastrugi kinds\n  sastrugi kinds multifractal")]
    Kinds(Kinds),
    /// Print the JSON Schema of study files, or the columns of a table.
    #[command(
        after_help = "Examples:\n  sastrugi schema > study.schema.json\n  sastrugi schema --markdown\n  sastrugi schema missions\n  sastrugi schema /wheels"
    )]
    Schema(Schema),
    /// Print shell completions.
    #[command(
        after_help = "Example:\n  sastrugi completions bash > ~/.local/share/bash-completion/completions/sastrugi"
    )]
    Completions(Completions),
    /// Serve worlds and releases over HTTP: patches of terrain at any place and resolution, map tiles, and a map page.
    #[command(
        after_help = "A WORLD.toml is what `terrain` takes, of kind planetary or elaborate. A STUDY.toml serves all its planetary terrains; a RELEASE serves\n\
        its terrains with their maps, missions and rovers. With SASTRUGI_TOKEN set, requests must send that token.\n\n\
        Examples:\n  sastrugi serve fixtures/worlds/planet.toml\n  \
        sastrugi serve study.toml release --library tiles --library-bytes 10G --listen 127.0.0.1:9000\n  \
        curl 'http://127.0.0.1:8080/v1/collections/planet/patch?center=0,0&size=512,512&resolution_m=0.02' -o patch.tif"
    )]
    Serve(Serve),
}

impl Verb {
    /// The single file that the verb writes.
    pub fn output_file(&self) -> Option<&Path> {
        match self {
            Self::Terrain(args) => Some(&args.output),
            Self::Fit(args) => args.output.as_deref(),
            Self::Coregister(args) => args.output.as_deref(),
            Self::Texture(args) => Some(&args.output),
            Self::Convert(args) => Some(&args.output),
            Self::Hillshade(args) => Some(&args.output),
            Self::Render(args) => Some(&args.output),
            Self::Photoclinometry(args) => Some(&args.output),
            Self::Pack(args) => Some(&args.output),
            Self::Roughness(args) => args.classes.as_deref(),
            Self::Analyze(args) => args.output.as_deref(),
            _ => None,
        }
    }
}

/// Where results and work go, and how much memory may be used.
#[derive(Debug, Args)]
pub struct Place {
    /// Release folder.
    #[arg(short, long, value_name = "DIR", default_value = "release")]
    pub output: PathBuf,
    /// Work area; DIR.work beside the release when absent.
    #[arg(long, value_name = "DIR")]
    pub work: Option<PathBuf>,
}

/// `init`.
#[derive(Debug, Args)]
pub struct Init {
    /// What the study is for.
    #[arg(default_value = STARTING[0].name, value_parser = PossibleValuesParser::new(STARTING.map(|s| s.name)))]
    pub kind: String,
    /// Study file to write; it must not exist.
    #[arg(short, long, value_name = "FILE", default_value = "study.toml")]
    pub output: PathBuf,
}

fn init_help() -> String {
    let kinds: Vec<String> = STARTING.iter().map(|s| format!("  {:<16} {}", s.name, s.summary)).collect();
    format!("Kinds:\n{}\n\nExamples:\n  sastrugi init\n  sastrugi init texture -o snow.toml", kinds.join("\n"))
}

/// `run`.
#[derive(Debug, Args)]
pub struct Run {
    /// Study file.
    pub study: PathBuf,
    /// Where.
    #[command(flatten)]
    pub place: Place,
    /// Run one of N shards (I = 1..N) to a partial folder for `merge`.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Replace an existing release of this study even if it has fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Working memory of the items at once, GiB; an item that needs more is refused. When absent, 4, and larger items run alone.
    #[arg(long, value_name = "GIB", allow_negative_numbers = true)]
    pub memory: Option<f64>,
}

/// `plan`.
#[derive(Debug, Args)]
pub struct Plan {
    /// Study file.
    pub study: PathBuf,
    /// Where.
    #[command(flatten)]
    pub place: Place,
    /// Plan one of N shards (I = 1..N), with what its items need.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
}

/// `merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// Folders that `run --shard` wrote.
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// Release folder.
    #[arg(short, long, value_name = "DIR", default_value = "release")]
    pub output: PathBuf,
    /// Replace an existing release of this study even if it has fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
}

/// `verify`.
#[derive(Debug, Args)]
pub struct Verify {
    /// Release folder.
    pub release: PathBuf,
    /// Also compute all, or this many, of the items again and compare their bytes.
    #[arg(long, value_name = "all|K")]
    pub recompute: Option<String>,
}

/// Compression of a GeoTIFF.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum Compress {
    /// As they are.
    None,
    /// Deflate with predictor.
    #[default]
    Deflate,
    /// Zstandard with predictor.
    Zstd,
}

/// `terrain`.
#[derive(Debug, Args)]
pub struct Terrain {
    /// A generator (see `kinds`), or a TOML file with `kind` and its parameters.
    #[arg(value_name = "SPEC.toml|KIND")]
    pub spec: String,
    /// A parameter, `name=value`; the value is TOML, a bare word is text.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Seed of the random streams.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// DEM to write; the ending gives the format.
    #[arg(short, long, value_name = "DEM")]
    pub output: PathBuf,
    /// How the DEM is written.
    #[command(flatten)]
    pub writing: Writing,
}

/// How a DEM is read.
#[derive(Debug, Args)]
pub struct Reading {
    /// Cell size for files that carry none and for point clouds, m: one number, or east-west,north-south.
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub cell: Option<String>,
    /// Height of a cell of a point cloud (.las, .laz): the mean of its points, the median, the lowest, the highest, or
    /// the N-th percentile.
    #[arg(long, value_name = "mean|median|min|max|pN", default_value = "mean")]
    pub statistic: Statistic,
    /// Fill the gaps of a point cloud up to this many cells from its points.
    #[arg(long, value_name = "CELLS", default_value_t = 0)]
    pub fill: u32,
    /// Take only the ground points (class 2) of a point cloud.
    #[arg(long)]
    pub ground: bool,
}

/// Which cells of a DEM take part.
#[derive(Debug, Args)]
pub struct Masks {
    /// Take only the cells that this file marks: GeoJSON polygons in the DEM's coordinates, or a raster that is not 0
    /// there. Several times: the cells that all of them mark.
    #[arg(long, value_name = "FILE")]
    pub mask: Vec<PathBuf>,
    /// Leave out the cells that this file marks. May be given several times.
    #[arg(long, value_name = "FILE")]
    pub exclude: Vec<PathBuf>,
}

impl Masks {
    /// Every file, with `true` for those that exclude.
    pub fn all(&self) -> Vec<(PathBuf, bool)> {
        let of = |files: &[PathBuf], excludes: bool| files.iter().map(|f| (f.clone(), excludes)).collect::<Vec<_>>();
        [of(&self.mask, false), of(&self.exclude, true)].concat()
    }
}

/// `fit`.
#[derive(Debug, Args)]
pub struct Fit {
    /// Measured DEM, or several to fit with the same settings.
    #[arg(required = true, value_name = "DEM")]
    pub dems: Vec<PathBuf>,
    /// Fit file to write. Of several DEMs a folder, with a fit file named after each.
    #[arg(short, long, value_name = "FIT.json", required_unless_present = "table")]
    pub output: Option<PathBuf>,
    /// Table with one row for each DEM, .parquet or .csv: file, the columns of `schema fits` with intervals, and error,
    /// why a DEM could not be fitted.
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// Window of the moving average that separates background from texture, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub outer_scale: Option<f64>,
    /// `corrected` for detrending and trimming, or as in the `paper`.
    #[arg(long, value_name = "corrected|paper")]
    pub mode: Option<String>,
    /// Share of residuals trimmed on both sides together.
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub trim: Option<f64>,
    /// Covariance model, or several with commas, or `auto`: the best by AICc is taken. `empirical`: the measured covariance.
    #[arg(long, value_name = "MODEL,...")]
    pub model: Option<String>,
    /// Replicates of the bootstrap that gives intervals; 0 for none.
    #[arg(long, value_name = "N")]
    pub bootstrap: Option<u32>,
    /// Standard deviation of the DEM's white noise, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub noise_sigma: Option<f64>,
    /// Standard deviation of noise that neighbouring cells share (dense image matching), m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "correlated_noise_range")]
    pub correlated_noise_sigma: Option<f64>,
    /// Lag at which that noise has a correlation of 1/e, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "correlated_noise_sigma")]
    pub correlated_noise_range: Option<f64>,
    /// Part of the DEM that is smooth in reality (GeoJSON polygons or raster): its noise, white and correlated, is found there.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["noise_sigma", "correlated_noise_sigma", "minus"])]
    pub noise_reference: Option<PathBuf>,
    /// Standard deviation of the point spread that blurred the DEM, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub inner_scale: Option<f64>,
    /// Seed of the replicates' random streams.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Part of the DEM, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window: Option<String>,
    /// Which cells.
    #[command(flatten)]
    pub masks: Masks,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
    /// DEM that is co-registered to the first (shift, raise, tilt) and subtracted, as for snow depth. The co-registration is
    /// printed also when the difference cannot be fitted.
    #[arg(long, value_name = "DEM")]
    pub minus: Option<PathBuf>,
    /// Write the difference, before it is fitted.
    #[arg(long, value_name = "DEM", requires = "minus")]
    pub difference: Option<PathBuf>,
    /// Covariance at every lag as a GeoTIFF, whose coordinates are the lag in m.
    #[arg(long, value_name = "MAP.tif")]
    pub map: Option<PathBuf>,
    /// Write the background that the fit removes, as a DEM: the base for `texture --onto`.
    #[arg(long, value_name = "DEM")]
    pub background: Option<PathBuf>,
    /// Other files that show the fit.
    #[command(flatten)]
    pub shown: FitShown,
    /// Any other parameter of the fit (see `kinds fit`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
}

/// Files that show a fit.
#[derive(Debug, Args)]
pub struct FitShown {
    /// Plot of the fit (.svg or .png): covariance by lag and structure function, measured and model, and covariance by
    /// direction.
    #[arg(long, value_name = "FILE.svg|png")]
    pub plot: Option<PathBuf>,
    /// Bins of the covariance as flat CSV: kind (ring or direction), lag_m, azimuth_deg (clockwise from grid north),
    /// covariance_m2, pairs, model_m2 (as the estimator sees it), surface_model_m2 (rings only).
    #[arg(long, value_name = "FILE.csv")]
    pub csv: Option<PathBuf>,
    /// Maps of local roughness as GeoTIFFs, one cell for each block of the DEM, m: PREFIX.band-rms.tif, and, with the range
    /// held at the fit's, PREFIX.sigma.tif and PREFIX.sigma2-over-b.tif. Blocks with too few cells have no data.
    #[arg(long, value_name = "PREFIX")]
    pub local: Option<PathBuf>,
    /// Width of these blocks, m: at least two windows; four when absent.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "local")]
    pub local_block: Option<f64>,
}

/// `coregister`.
#[derive(Debug, Args)]
pub struct Coregister {
    /// DEM that stays.
    pub a: PathBuf,
    /// DEM that is moved; metric and in A's coordinate system, its cells and extent may differ.
    pub b: PathBuf,
    /// DEM to write with A less B as moved; the ending gives the format.
    #[arg(short, long, value_name = "DIFFERENCE.tif")]
    pub output: Option<PathBuf>,
    /// Part of A, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window: Option<String>,
    /// Stable terrain: B is fitted to these cells of A; the difference covers all.
    #[command(flatten)]
    pub masks: Masks,
    /// How the DEMs are read.
    #[command(flatten)]
    pub reading: Reading,
    /// How the difference is written.
    #[command(flatten)]
    pub writing: Writing,
}

/// `texture`.
#[derive(Debug, Args)]
pub struct Texture {
    /// Fit file; `model` and `parameters` are enough.
    pub fit: PathBuf,
    /// Size east-west by north-south, m.
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Cell size, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub cell: Option<f64>,
    /// Seed of the random streams.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Synthesis method.
    #[arg(long, value_name = "M", default_value = "fft_ma")]
    pub method: String,
    /// `unit` magnitude (exact covariance in each tile) or `gaussian`.
    #[arg(long, value_name = "unit|gaussian")]
    pub phase: Option<String>,
    /// Repeat the (periodic) texture, rows by columns.
    #[arg(long, value_name = "RxC")]
    pub tile: Option<String>,
    /// Base DEM to add the texture to.
    #[arg(long, value_name = "DEM")]
    pub onto: Option<PathBuf>,
    /// Covariance of the `surface`, or `residual`: what a background over the fit's window lacks of it. Default: `residual` with
    /// `--onto` (a measured background), else `surface`.
    #[arg(long, value_name = "surface|residual")]
    pub covariance: Option<String>,
    /// Factor on the heights of the texture, above 0: one number, or with `--onto` a raster of factors, 0 or above.
    #[arg(long, value_name = "FACTOR|RASTER")]
    pub amplitude: Option<String>,
    /// Fill the holes of this DEM with texture that fits what is around them; makes no other texture. `--cell` is for a DEM that
    /// states none.
    #[arg(long, value_name = "DEM", conflicts_with_all = ["onto", "size", "tile", "phase", "method", "covariance", "amplitude", "set"])]
    pub fill: Option<PathBuf>,
    /// Any other parameter of the method (see `kinds`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// DEM to write.
    #[arg(short, long, value_name = "DEM")]
    pub output: PathBuf,
    /// How the DEM is written.
    #[command(flatten)]
    pub writing: Writing,
}

/// `roughness`.
#[derive(Debug, Args)]
pub struct Roughness {
    /// DEM.
    pub dem: PathBuf,
    /// Write the class map (unclosed), as GeoTIFF.
    #[arg(long, value_name = "TIF")]
    pub classes: Option<PathBuf>,
    /// Any setting of `[roughness]` (see `schema`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Wavelengths from the tyre radius to twice the wheelbase: `wb=2.7,r=0.33` in m, a vehicle (see `kinds`), or a vehicle file.
    #[arg(long, value_name = "V", group = "bumps")]
    pub vehicle: Option<String>,
    /// Wavelengths from MIN to MAX, m.
    #[arg(long, value_name = "MIN:MAX", group = "bumps")]
    pub band: Option<String>,
    /// How the local mean is taken off: the band alone, less a moving average over its longest wavelength, or less a mean with
    /// exponential weights. Their figures are not comparable.
    #[arg(long, value_enum, default_value_t = Detrend::Band, requires = "bumps")]
    pub detrend: Detrend,
    /// Let cells pass that are too large for the shortest wave of the band.
    #[arg(long, requires = "bumps")]
    pub allow_coarse: bool,
    /// Write the RMS in windows of three longest wavelengths, as lines of text.
    #[arg(long, value_name = "TXT", requires = "bumps")]
    pub rms_map: Option<PathBuf>,
    /// Raster of the RMS that was predicted (a terrain's map `rms-predicted`), for a column of `--rms-map`.
    #[arg(long, value_name = "TIF", requires = "rms_map")]
    pub rms_predicted: Option<PathBuf>,
    /// Aerodynamic roughness length z0 for wind from N equally spaced directions (16 without N), by the formulas of Lettau,
    /// Munro and Macdonald.
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "16", group = "winds",
        value_parser = clap::value_parser!(u16).range(1..=360))]
    pub wind: Option<u16>,
    /// The same for wind from these azimuths, degrees clockwise from grid north.
    #[arg(long, value_name = "DEG,...", value_delimiter = ',', allow_negative_numbers = true, group = "winds")]
    pub wind_from: Vec<f64>,
    /// Width of the moving average that is taken off for z0 after the least-squares plane, m; the plane alone when absent.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "winds")]
    pub outer_scale: Option<f64>,
    /// Height of the obstacles in the formulas of Lettau and Macdonald.
    #[arg(long, value_enum, default_value_t = Obstacles::TwoSigma, requires = "winds")]
    pub obstacle_height: Obstacles,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
}

/// `hillshade`.
#[derive(Debug, Args)]
pub struct Hillshade {
    /// DEM.
    pub dem: PathBuf,
    /// Picture to write (.png).
    #[arg(short, long, value_name = "PNG")]
    pub output: PathBuf,
    /// Most pixels along a side; a DEM with more cells is thinned by means over whole cells.
    #[arg(long, value_name = "N", default_value_t = 1024)]
    pub pixels: u32,
    /// Factor on the slopes before shading; by the rms slope when absent (1 from 0.25 on).
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    pub exaggeration: Option<f64>,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
}

/// `render`.
#[derive(Debug, Args)]
pub struct Render {
    /// DEM, or what `terrain` takes: a generator (see `kinds`) or a TOML file with `kind` and its parameters.
    #[arg(value_name = "DEM|SPEC.toml|KIND")]
    pub surface: String,
    /// Azimuth that the light comes from, clockwise from north, and elevation above the horizon, deg.
    #[arg(long, value_name = "AZ,EL", default_value = "315,45", allow_hyphen_values = true)]
    pub sun: String,
    /// Camera: `nadir[:PIXEL_M]`, `parallel:AZ,EL[,PIXEL_M]` or `pinhole:X,Y,Z,TO_X,TO_Y,TO_Z[,FOV_DEG]`.
    #[arg(long, value_name = "CAMERA", default_value = "nadir")]
    pub camera: String,
    /// Columns and rows of a parallel or pinhole image.
    #[arg(long, value_name = "COLSxROWS")]
    pub size: Option<String>,
    /// Raster of the albedo with the cells of the surface, or one albedo for all of it, 0 to 1.
    #[arg(long, value_name = "FILE|VALUE")]
    pub albedo: Option<String>,
    /// Any other parameter of the image (see `kinds image`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// A parameter of the generator (see `kinds`), `name=value`.
    #[arg(long = "set-surface", value_name = "K=V")]
    pub set_surface: Vec<String>,
    /// Seed of the random streams of a generated surface and of the noise.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Image to write: .tif or .png.
    #[arg(short, long, value_name = "TIF|PNG")]
    pub output: PathBuf,
    /// How a DEM is read.
    #[command(flatten)]
    pub reading: Reading,
    /// How a GeoTIFF is written.
    #[command(flatten)]
    pub writing: Writing,
}

/// `photoclinometry`.
#[derive(Debug, Args)]
pub struct Photoclinometry {
    /// Images and what is known of them.
    #[arg(value_name = "IMAGES.toml")]
    pub images: PathBuf,
    /// A setting (see `kinds photoclinometry`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Seed of the random streams (paths, perturbed solutions).
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Heights to write, .tif; maps stand beside them.
    #[arg(short, long, value_name = "DEM.tif")]
    pub output: PathBuf,
    /// How GeoTIFFs are written.
    #[command(flatten)]
    pub writing: Writing,
}

/// How the local mean is taken off.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Detrend {
    /// The band of wavelengths alone.
    Band,
    /// Less a moving average.
    Ma,
    /// Less a mean with exponential weights.
    Exp,
}

/// Height of the obstacles on a continuous surface.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Obstacles {
    /// Twice the standard deviation of the detrended heights.
    TwoSigma,
    /// Mean of the detrended heights above zero.
    MeanAbove,
}

/// `traverse`.
#[derive(Debug, Args)]
pub struct Traverse {
    /// DEM, metric, with cells that the vehicle's wheels can feel.
    pub dem: PathBuf,
    /// Vehicle (see `kinds`), or a vehicle file of your own (.toml with a table `parameters`).
    #[arg(long, value_name = "V", default_value = "husky_a200")]
    pub vehicle: String,
    /// Number of missions.
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub missions: u32,
    /// Starts driven of each mission: the drawn one and perturbed ones, for a probability of success.
    #[arg(long, value_name = "N")]
    pub replicates: Option<u32>,
    /// Replace an existing release of this study even if it has fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Seed of the random streams.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// A setting of `[roughness]` (see `schema`), by which starts and goals are judged, `name=value`.
    #[arg(long = "set-roughness", value_name = "K=V")]
    pub set_roughness: Vec<String>,
    /// A rule of the missions (see `kinds`), `name=value`.
    #[arg(long = "set-missions", value_name = "K=V")]
    pub set_missions: Vec<String>,
    /// A parameter of the run (see `kinds`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Date that the release carries.
    #[arg(long, value_name = "YYYY-MM-DD", default_value = "1970-01-01")]
    pub date: String,
    /// Where.
    #[command(flatten)]
    pub place: Place,
}

/// `navigate`.
#[derive(Debug, Args)]
pub struct Navigate {
    /// DEM.
    pub dem: PathBuf,
    /// Start, in the DEM's coordinates.
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    pub start: String,
    /// Goal, in the DEM's coordinates.
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    pub goal: String,
    /// How the route is searched: grid, roadmap, theta_star or anytime (see `kinds`).
    #[arg(long, value_name = "M", default_value = "grid")]
    pub method: String,
    /// Vehicle whose limits of slope hold (see `kinds`); slopes of up to 30 degrees when absent.
    #[arg(long, value_name = "V")]
    pub vehicle: Option<String>,
    /// What cannot be entered: GeoJSON with polygons in the DEM's coordinates, or a raster that is not 0 there. May be repeated.
    #[arg(long, value_name = "FILE")]
    pub obstacles: Vec<PathBuf>,
    /// A parameter of the route (see `kinds`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Formation of a team that follows the route: column, line or wedge, or custom with slots (see `kinds`). Needs `-o DIR`.
    #[arg(long, value_name = "F")]
    pub formation: Option<String>,
    /// A parameter of the team (see `kinds`), `name=value`.
    #[arg(long = "team", value_name = "K=V", requires = "formation")]
    pub team: Vec<String>,
    /// Replace an existing release of this route even if it has fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Date that the release carries.
    #[arg(long, value_name = "YYYY-MM-DD", default_value = "1970-01-01")]
    pub date: String,
    /// Where.
    #[command(flatten)]
    pub place: Place,
}

/// `rover`.
#[derive(Debug, Args)]
pub struct Rover {
    /// Study file.
    pub study: PathBuf,
    /// Move every number of the navigators by up to this share of its value, up and down: 10% or 0.1.
    #[arg(long, value_name = "P", allow_hyphen_values = true)]
    pub perturb: Option<String>,
    /// Trajectories of the perturbation; each moves every number once. 10, or what the study says, when absent.
    #[arg(long, value_name = "N")]
    pub trajectories: Option<u32>,
    /// Where.
    #[command(flatten)]
    pub place: Place,
    /// Replace an existing release of these rovers even if it has fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Working memory of the items at once, GiB; an item that needs more is refused. When absent, 4, and larger items run alone.
    #[arg(long, value_name = "GIB", allow_negative_numbers = true)]
    pub memory: Option<f64>,
}

/// `report`.
#[derive(Debug, Args)]
pub struct Report {
    /// Release folder.
    pub release: PathBuf,
    /// Folder to write, never inside of the release; ./NAME-report when absent.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Another release: which groups and figures differ from it?
    #[arg(long, value_name = "RELEASE")]
    pub against: Option<PathBuf>,
    /// Table of analysed logs (`analyze -o`): do the missions match them? May be repeated.
    #[arg(long, value_name = "LOGS.parquet")]
    pub logs: Vec<PathBuf>,
}

/// `analyze`.
#[derive(Debug, Args)]
pub struct Analyze {
    /// MCAP logs; folders of ROS 2 bags.
    #[arg(required = true, value_name = "MCAP")]
    pub logs: Vec<PathBuf>,
    /// Topic of the poses; the best one when absent.
    #[arg(long, value_name = "TOPIC")]
    pub topic: Option<String>,
    /// Frame to follow where poses come as transforms.
    #[arg(long, value_name = "FRAME", default_value = "base_link")]
    pub body: String,
    /// Frame in which it moves; the root of the transforms when absent.
    #[arg(long, value_name = "FRAME")]
    pub fixed: Option<String>,
    /// Sampling rate of the figures, Hz; slower logs keep their own.
    #[arg(long, value_name = "HZ", default_value_t = 20.0, allow_negative_numbers = true)]
    pub rate: f64,
    /// Band of the vertical acceleration, Hz.
    #[arg(long, value_name = "LOW,HIGH", default_value = "0.2,8", allow_hyphen_values = true)]
    pub band: String,
    /// How heights and angles are differentiated: second_difference or gradient.
    #[arg(long, value_name = "D", default_value = "second_difference")]
    pub differentiator: String,
    /// DEM of the ground: clearance, and classes under the path.
    #[arg(long, value_name = "DEM")]
    pub dem: Option<PathBuf>,
    /// What to add to the log's positions to get the DEM's, m.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true)]
    pub offset: String,
    /// Label of the logs in the table.
    #[arg(long, value_name = "NAME")]
    pub group: Option<String>,
    /// Write the table `logs`, as Parquet.
    #[arg(short, long, value_name = "PARQUET")]
    pub output: Option<PathBuf>,
}

/// `pack`.
#[derive(Debug, Args)]
pub struct Pack {
    /// Release folder.
    pub release: PathBuf,
    /// Archive to write, never inside of the release.
    #[arg(short, long, value_name = "TAR")]
    pub output: PathBuf,
}

/// `compare`.
#[derive(Debug, Args)]
pub struct Compare {
    /// Release, DEM or fit file.
    pub a: PathBuf,
    /// Release, DEM or fit file.
    #[arg(required_unless_present = "split_half")]
    pub b: Option<PathBuf>,
    /// Fit one half of A, and compare textures of that fit with the other half, on what was not fitted.
    #[arg(long, conflicts_with_all = ["b", "window_b"])]
    pub split_half: bool,
    /// End with exit code 4 when any quantity is different (releases of one study and version: any byte).
    #[arg(long)]
    pub fail_on_difference: bool,
    /// Releases: difference of means that counts as the same, as a share of A's mean (0.05; 5 points for success and shares).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub margin: Option<f64>,
    /// Window of the moving average that separates background from texture, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub outer_scale: Option<f64>,
    /// Covariance model of both, of one term.
    #[arg(long, value_name = "MODEL")]
    pub model: Option<String>,
    /// Relative difference of sigma that counts as the same (0.1).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_sigma: Option<f64>,
    /// Relative difference of b that counts as the same (0.25).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_range: Option<f64>,
    /// Relative difference of the ratio of axes that counts as the same (0.25).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_anisotropy: Option<f64>,
    /// Distance of the height distributions that counts as the same, standard deviations (0.1).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_heights: Option<f64>,
    /// Simulated surfaces of each DEM (199).
    #[arg(long, value_name = "N")]
    pub simulations: Option<u32>,
    /// Seed of the random streams of simulations and permutations.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Part of A, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window_a: Option<String>,
    /// Part of B.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window_b: Option<String>,
    /// Cell size for files that carry none, m: one number, or east-west,north-south.
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub cell: Option<String>,
    /// Any other parameter: trim, alpha, equivalence_shape, equivalence_agreement; `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
}

/// How a DEM is written.
#[derive(Debug, Args)]
pub struct Writing {
    /// Compression of a GeoTIFF.
    #[arg(long, value_enum, default_value_t)]
    pub compress: Compress,
    /// A cloud-optimised GeoTIFF: with overviews, laid out so that a part can be read over a network.
    #[arg(long)]
    pub cog: bool,
}

/// `convert`.
#[derive(Debug, Args)]
pub struct Convert {
    /// DEM to read; or the vehicle to write: its name (see `kinds vehicle`) or a vehicle file.
    pub input: PathBuf,
    /// DEM to write, or the file of a vehicle (.xml is MJCF, .urdf); a folder with --for.
    pub output: PathBuf,
    /// Write a folder for this simulator.
    #[arg(long = "for", value_name = "SIMULATOR", value_parser = simulators())]
    pub simulator: Option<Simulator>,
    /// Where the simulator takes certain sizes only, cut the largest one out of the middle instead of resampling.
    #[arg(long, requires = "simulator")]
    pub crop: bool,
    /// Decimate a mesh: no cell centre may lie farther from it than this, vertically, m.
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub max_error: Option<f64>,
    /// Decimate a mesh to at most this many triangles.
    #[arg(long, value_name = "N")]
    pub triangles: Option<usize>,
    /// Ground whose friction the file of a vehicle states (`sastrugi kinds surface`); `study` when absent.
    #[arg(long, value_name = "SURFACE")]
    pub surface: Option<String>,
    /// Part of the DEM, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window: Option<String>,
    /// Which cells; the others are written without data.
    #[command(flatten)]
    pub masks: Masks,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
    /// How the DEM is written.
    #[command(flatten)]
    pub writing: Writing,
}

fn simulators() -> impl TypedValueParser<Value = Simulator> {
    let named =
        |name: String| Simulator::ALL.into_iter().find(|s| s.name() == name).ok_or("no simulator has this name");
    PossibleValuesParser::new(Simulator::ALL.map(Simulator::name)).try_map(named)
}

/// `info`.
#[derive(Debug, Args)]
pub struct Info {
    /// DEM, transects (.csv, .txt), fit file, MCAP recording, table, or release folder.
    pub path: PathBuf,
    /// How a DEM is read.
    #[command(flatten)]
    pub reading: Reading,
}

/// `kinds`.
#[derive(Debug, Args)]
pub struct Kinds {
    /// One of them, with all its parameters.
    pub kind: Option<String>,
}

/// `schema`.
#[derive(Debug, Args)]
pub struct Schema {
    /// `study` (default), `tables`, `topics`, or the name of a table or topic.
    pub name: Option<String>,
    /// Print the reference of study files as Markdown.
    #[arg(long)]
    pub markdown: bool,
}

/// `completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// Shell.
    pub shell: Shell,
}

/// `serve`.
#[derive(Debug, Args)]
pub struct Serve {
    /// Worlds, studies and releases.
    #[arg(required = true, value_name = "WORLD.toml|STUDY.toml|RELEASE")]
    pub paths: Vec<PathBuf>,
    /// Address to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    pub listen: String,
    /// Folder for the tile library, created if missing; several servers may share it. Without it tiles are kept in memory only.
    #[arg(long, value_name = "DIR")]
    pub library: Option<PathBuf>,
    /// Maximum size of the tile library on disk.
    #[arg(long, value_name = "BYTES", default_value = "10G")]
    pub library_bytes: String,
    /// Memory for cached tiles; as much again is used for rasters of releases.
    #[arg(long, value_name = "BYTES", default_value = "512M")]
    pub memory_bytes: String,
    /// Maximum number of samples in a patch; a quarter of it in an image.
    #[arg(long, value_name = "N", default_value_t = 1 << 22, value_parser = clap::value_parser!(u64).range(1..=1 << 26))]
    pub samples_max: u64,
    /// Maximum number of concurrent requests per client.
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub per_client: u32,
    /// Maximum number of open connections.
    #[arg(long, value_name = "N", default_value_t = 2048, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub connections: u32,
    /// Time limit for one request, in seconds.
    #[arg(long, value_name = "S", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub request_seconds: u64,
    /// Origin whose pages may use the server, as `https://example.org`, or `*`; may be given several times.
    #[arg(long, value_name = "ORIGIN")]
    pub cors: Vec<String>,
    /// Log every request on stderr; RUST_LOG gives finer control.
    #[arg(long)]
    pub log: bool,
    /// Format of the log, whether asked for or of warnings only.
    #[arg(long, value_enum, default_value_t = LogFormat::Text)]
    pub log_format: LogFormat,
}

/// Format of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Lines to read.
    Text,
    /// One JSON object a line.
    Json,
}
