//! Command-line arguments, with the help texts.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use sastrugi_schemas::study::Simulator;
use sastrugi_stages::runner::shard::PARTS_MAX;
use sastrugi_stages::starting::STARTING;
use sastrugi_store::dem::points::Statistic;
use std::path::{Path, PathBuf};

/// Generate rough-terrain datasets that reproduce bit for bit, and compare them statistically.
#[derive(Debug, Parser)]
#[command(name = "sastrugi", version, propagate_version = true, max_term_width = 100)]
#[command(
    after_help = "Exit codes: 0 done, 1 failed, 2 bad usage or study, 3 done but some items failed, 4 verification\n\
        (or compare --fail-on-difference) found a difference, 65 input data missing or unusable, 75\n\
        interrupted or retryable.\n\n\
        Example:\n  sastrugi init\n  sastrugi run study.toml -o release"
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
    /// Options common to all verbs.
    #[command(flatten)]
    pub common: Common,
}

/// Options common to all verbs.
#[derive(Debug, Args)]
pub struct Common {
    /// Number of threads; default: all cores. Results do not depend on it.
    #[arg(long, global = true, display_order = 101, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the result as JSON on stdout.
    #[arg(long, global = true, display_order = 102)]
    pub json: bool,
    /// Suppress progress on stderr; errors are always printed.
    #[arg(long, global = true, display_order = 103)]
    pub quiet: bool,
}

/// Verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Write a small commented study to start from, and its schema for editors.
    #[command(after_help = init_help())]
    Init(Init),
    /// Run a study and write its release; resumes where an earlier run stopped.
    #[command(
        after_help = "Examples:\n  sastrugi run study.toml -o release\n  sastrugi run study.toml -o part1 --shard 1/3\n  \
        sastrugi run study.toml --ancestors 3 --cache cache\n  \
        sastrugi run study.toml -o part1 --shard 1/3 --cache cache\n  \
        sastrugi run study.toml -o s3://terrains/snow\n\n\
        For s3://, AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY or the machine's role give access; AWS_REGION\n\
        and AWS_ENDPOINT_URL choose another region or store. The release is assembled in the work area and\n\
        uploaded, its manifest last."
    )]
    Run(Run),
    /// Show what a run would compute, its cost, and why each stale item is stale.
    #[command(after_help = "Examples:\n  sastrugi plan study.toml -o release\n  \
        sastrugi plan study.toml -o part1 --shard 1/3\n  sastrugi plan study.toml --shards 8")]
    Plan(Plan),
    /// Merge shards into a release, byte for byte the same as an unsharded run.
    #[command(after_help = "Example:\n  sastrugi merge part1 part2 part3 -o release")]
    Merge(Merge),
    /// Show the size of a shared cache, and remove entries unused for a long time.
    #[command(
        after_help = "Safe while shards run: they recompute what was removed. Without a limit nothing is removed;\n\
        with one, drafts that killed runs left more than a day ago are removed too.\n\n\
        Examples:\n  sastrugi cache /scratch/cache\n  sastrugi cache /scratch/cache --max-age 30 --max-bytes 500G"
    )]
    Cache(Cache),
    /// Check all checksums, schemas and row counts of a release; recompute items on request.
    #[command(after_help = "Examples:\n  sastrugi verify release\n  sastrugi verify release --recompute 3")]
    Verify(Verify),
    /// Generate one terrain.
    #[command(after_help = "Examples:\n  sastrugi terrain multifractal --seed 7 -o rough.tif\n  \
        sastrugi terrain weierstrass_mandelbrot --set fractal_dimension=2.4 \\\n    \
        --set size_px='[512, 512]' -o wm.png")]
    Terrain(Terrain),
    /// Fit a covariance model to a measured DEM.
    #[command(after_help = "Exit code 3: some of the DEMs could not be fitted; 1: none could.\n\n\
        Examples:\n  sastrugi fit snow.tif --outer-scale 2 -o fit.json\n  \
        sastrugi fit snow.tif --outer-scale 2 --model auto --bootstrap 199 --plot fit.svg -o fit.json\n  \
        sastrugi fit snow.tif --outer-scale 2 --mask plot.geojson --exclude trees.geojson -o fit.json\n  \
        sastrugi fit scan.laz --cell 0.05 --statistic median --outer-scale 2 -o fit.json\n  \
        sastrugi fit gravel.tif --outer-scale 0.5 --statistics -o fit.json\n  \
        sastrugi fit march.tif april.tif may.tif --outer-scale 2 --table season.csv\n  \
        sastrugi fit snow_on.tif --minus snow_off.tif --outer-scale 2 --difference depth.tif -o depth.json")]
    Fit(Box<Fit>),
    /// Co-register DEM B to DEM A: shift, raise and tilt with standard errors, NMAD before and after, and the difference.
    #[command(
        after_help = "Method of Nuth and Kääb (2011), with raise and tilt estimated in the same equations. With --mask\n\
        or --exclude, B is co-registered on stable terrain only; the difference still covers all of A. The\n\
        exit code is 0 even when co-registration does not improve the fit or does not converge; read the\n\
        verdict.\n\n\
        Examples:\n  sastrugi coregister flight_1.tif flight_2.tif\n  \
        sastrugi coregister snow_on.tif snow_off.tif --mask road.geojson -o depth.tif"
    )]
    Coregister(Coregister),
    /// Synthesise a texture that matches a fit.
    #[command(
        after_help = "Examples:\n  sastrugi texture fit.json --size 20x20 --cell 0.1 --seed 1 -o texture.tif\n  \
        sastrugi texture fit.json --size 10x10 --cell 0.05 --onto terrain.tif \\\n    \
        --covariance surface -o textured.tif\n  \
        sastrugi texture fit.json --method wavelet_statistics --size 20x20 -o texture.tif\n  \
        sastrugi texture fit.json --method quilting --exemplar snow.tif --size 20x20 -o texture.tif\n  \
        sastrugi texture fit.json --fill snow.tif -o without-holes.tif"
    )]
    Texture(Texture),
    /// Measure the roughness of a DEM and classify its cells.
    #[command(
        after_help = "With --vehicle or --band: RMS of profiles in that wavelength band, power law of their PSD, ISO\n\
        8608 class and International Roughness Index. With --wind or --wind-from: aerodynamic roughness\n\
        length z0 for each wind direction.\n\n\
        Examples:\n  sastrugi roughness terrain.tif --classes classes.tif\n  \
        sastrugi roughness terrain.tif --vehicle wb=2.7,r=0.33 --rms-map rms.txt\n  \
        sastrugi roughness terrain.tif --band 0.3048:3.048 --detrend ma\n  \
        sastrugi roughness ice.tif --wind --outer-scale 2\n  \
        sastrugi roughness ice.tif --wind-from 225,240 --outer-scale 2"
    )]
    Roughness(Roughness),
    /// Drive missions over one DEM and write them as a release.
    #[command(after_help = "Examples:\n  sastrugi traverse terrain.tif --vehicle husky_a200 --missions 5 -o drive\n  \
        sastrugi traverse bar.tif --set-missions length_m=2 --set-missions border_m=0.5 \\\n    \
        --set-roughness closing_radius_m=0 --replicates 8 -o drive")]
    Traverse(Traverse),
    /// Plan a route over one DEM, optionally with a team that follows it in formation. Output: GeoJSON, a picture, or a release with
    /// tables, recordings and report.
    #[command(
        after_help = "An output ending in .geojson or .svg contains only the route; any other name is the folder of a\n\
        release. GeoJSON is written in the DEM's own coordinates.\n\n\
        Examples:\n  sastrugi navigate site.tif --start 12,30 --goal 240,180 -o route.svg\n  \
        sastrugi navigate site.tif --start 12,30 --goal 240,180 --vehicle husky_a200 \\\n    \
        --set cost=energy -o route.geojson\n  \
        sastrugi navigate site.tif --start 12,30 --goal 240,180 --obstacles buildings.geojson -o routes\n  \
        sastrugi navigate site.tif --start 12,30 --goal 240,180 --formation wedge \\\n    \
        --team members=6 --team spacing_m=5 -o team"
    )]
    Navigate(Navigate),
    /// Drive the rovers of a study and rank their parameters by effect.
    #[command(
        after_help = "Runs only the [[rover]] tables of a study and the terrains they need. The release contains that\n\
        reduced study, and `run` on it produces the same release. --perturb varies the parameters of every\n\
        navigator along trajectories (elementary effects: Morris, 1991) while worlds, starts and noise\n\
        stay fixed. `sastrugi plan` on the released study shows the cost.\n\n\
        Examples:\n  sastrugi rover study.toml -o design\n  \
        sastrugi rover study.toml --perturb 10% --trajectories 4 -o perturbed"
    )]
    Rover(Rover),
    /// Compute traversal metrics from MCAP logs of any vehicle: sastrugi, ROS 2 or Foxglove messages.
    #[command(
        after_help = "Reads Odometry, PoseStamped, TFMessage, Imu (ROS 2, CDR), PoseInFrame, Odometry, FrameTransforms\n\
        (Foxglove, protobuf) and sastrugi's own messages. Exit code 3: a log is truncated, or some of the\n\
        logs could not be analysed.\n\n\
        Examples:\n  sastrugi analyze drive.mcap\n  sastrugi analyze bags/*.mcap --group field -o field.parquet\n  \
        sastrugi analyze drive.mcap --topic /odometry/filtered --dem site.tif --offset 0,0,-12.5"
    )]
    Analyze(Analyze),
    /// Write the report of a release: one offline HTML page, with figures as SVG and numbers as JSON.
    #[command(after_help = "Examples:\n  sastrugi report release -o release-report\n  \
        sastrugi report release --against release-before --logs field.parquet -o compared")]
    Report(Report),
    /// Pack a release into one archive, byte for byte the same on every machine.
    #[command(after_help = "A damaged release is not packed; the exit code is then 4.\n\n\
        Example:\n  sastrugi pack release -o release.tar")]
    Pack(Pack),
    /// Test whether two releases, two DEMs or two fits are statistically the same, or whether a texture matches its site.
    #[command(after_help = "The verdict on each quantity is: same (within the bounds), different, or cannot tell.\n\n\
        Two releases are compared file by file (hashes), then by the metrics in the tables missions and\n\
        terrains, group by group, with terrains as the independent units. `--fail-on-difference` exits\n\
        with code 4 when a metric is different or, for releases of the same study by the same version,\n\
        when a file is missing or any byte differs.\n\n\
        With --split-half and --statistics, every distance of the texture is shown next to the distances\n\
        between parts of the site.\n\n\
        Examples:\n  \
        sastrugi compare release other-release --margin 0.1\n  \
        sastrugi compare site.tif synthetic.tif --outer-scale 2\n  \
        sastrugi compare site.tif texture.tif --statistics --outer-scale 2\n  \
        sastrugi compare site.json synthetic.json --equivalence-sigma 0.05 --fail-on-difference")]
    Compare(Compare),
    /// Convert between DEM formats by file extension (.tif .asc .hgt .png .npy, meshes .obj .glb .usda), grid point clouds (.las
    /// .laz), or export: a terrain as a folder for a simulator, a vehicle as a file (.xml for MuJoCo, .urdf), the missions of a release
    /// for a learner.
    #[command(
        after_help = "With --for, OUT is a folder with the heights, README.md (import steps) and import.json (all\n\
        numbers). Where the simulator accepts only certain sizes, the heights are resampled (bilinear,\n\
        same extent) and README.md states by how much heights change; with --crop, the middle is cut out\n\
        and no height changes.\n\n\
        With --for lerobot, INPUT is a release and OUT a LeRobot dataset (format 3.0): an episode is one\n\
        mission, with state, height patch, command and split of every sample.\n\n\
        Examples:\n  sastrugi convert N44W072.hgt tile.tif\n  sastrugi convert scan.laz scan.tif --cell 0.05 --fill 2\n  \
        sastrugi convert terrain.tif terrain.glb\n  sastrugi convert terrain.tif unreal-terrain --for unreal\n  \
        sastrugi convert terrain.tif terrain.obj --max-error 0.01\n  sastrugi convert husky_a200 husky.xml\n  \
        sastrugi convert mine.toml mine.urdf --surface hard_soil\n  \
        sastrugi convert release dataset --for lerobot --patch 3.2 --patch-cell 0.1"
    )]
    Convert(Convert),
    /// Draw a DEM as PNG: coloured by height, lit from the north-west.
    #[command(after_help = "Examples:\n  sastrugi hillshade terrain.tif -o terrain.png\n  \
        sastrugi hillshade site.tif --pixels 400 --exaggeration 5 -o site.png")]
    Hillshade(Hillshade),
    /// Render a DEM or a generated surface for a given sun and camera, with albedo, shading and cast shadows.
    #[command(after_help = "Cameras: nadir (straight down, covers the surface), nadir:PIXEL_M,\n\
        parallel:AZIMUTH,ELEVATION[,PIXEL_M] (parallel rays from that direction),\n\
        pinhole:X,Y,Z,TO_X,TO_Y,TO_Z[,FIELD_OF_VIEW_DEG] (z above the ground; absolute heights with\n\
        `--set camera.above_ground=false`). The albedo comes from DEM.albedo.tif next to the DEM or from\n\
        the generator's map if there is one; otherwise it is 0.25. A GeoTIFF contains the brightness\n\
        (I/F), with sun and camera in a .json next to it; a PNG shows it in 8-bit grey.\n\n\
        Examples:\n  sastrugi render site.tif --sun 120,20 -o site-morning.tif\n  \
        sastrugi render planetary --set-surface size_m='[20, 20]' --seed 3 --sun 90,15 -o mars.png\n  \
        sastrugi render site.tif --camera parallel:200,40,0.5 --set noise.relative=0.01 -o oblique.tif\n  \
        sastrugi render planetary --set-surface size_m='[20, 20]' --seed 3 \\\n    \
        --camera pinhole:4,2,0.3,4,12,0 --size 960x540 -o rover.png")]
    Render(Render),
    /// Recover heights and albedo from three or more registered images of one surface under different sun directions.
    #[command(
        after_help = "IMAGES.toml lists the JSON files that `render` writes next to its images, `images = [\"a.json\",\n\
        ...]`, or describes images with the same keys in [[image]]. `coarse` and `coarse_sigma_m` add a\n\
        coarse DEM, `altimetry` measured points (CSV: x, y, z, sigma), `truth` a surface to compare with,\n\
        [settings] any key of `sastrugi kinds photoclinometry`. Written next to DEM.tif: DEM.albedo.tif,\n\
        standard deviations (.uncertainty.tif for heights, .slope-sigma.tif, .albedo-sigma.tif),\n\
        DEM.condition.tif, DEM.lit.tif (number of images in which a cell is lit) and DEM.leaning.tif.\n\n\
        Examples:\n  sastrugi photoclinometry images.toml -o dem.tif\n  \
        sastrugi photoclinometry images.toml --set cell_m=2 --set free_exposure=true \\\n    \
        --set stereo='{}' -o dem.tif"
    )]
    Photoclinometry(Photoclinometry),
    /// Describe a file or a release.
    #[command(after_help = "Example:\n  sastrugi info terrain.tif")]
    Info(Info),
    /// List all generators, fits, methods, mission rules and vehicles with parameters, defaults and sources.
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
    /// Print the licence of the program and those of everything that it contains.
    #[command(after_help = "Example:\n  sastrugi licences | less")]
    Licences,
    /// Serve worlds and releases over HTTP: patches of terrain anywhere at any resolution, map tiles, and a map page.
    #[command(
        after_help = "A WORLD.toml has the format of a `terrain` specification, kind planetary or elaborate. A\n\
        STUDY.toml serves all its planetary terrains; a RELEASE serves its terrains with their maps,\n\
        missions and rovers. With SASTRUGI_TOKEN set, requests must send that token.\n\n\
        Examples:\n  sastrugi serve planet.toml\n  \
        sastrugi serve study.toml release --library tiles --library-bytes 10G --listen 127.0.0.1:9000\n  \
        curl -o patch.tif \\\n    \
        'http://127.0.0.1:8080/v1/collections/planet/patch?center=0,0&size=512,512&resolution_m=0.02'"
    )]
    Serve(Serve),
}

impl Verb {
    /// The output file, for verbs that write a single one.
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

    /// Every file and folder that the verb writes, except releases, which may lie in an object store, and reports.
    pub fn outputs(&self) -> Vec<&Path> {
        let study = match self {
            Self::Init(args) => Some(args.output.as_path()),
            _ => None,
        };
        let more = match self {
            Self::Fit(args) => {
                let FitShown { plot, csv, local, .. } = &args.shown;
                vec![&args.table, &args.difference, &args.map, &args.background, plot, csv, local]
            }
            Self::Roughness(args) => vec![&args.rms_map],
            _ => Vec::new(),
        };
        let more = more.into_iter().flatten().map(PathBuf::as_path);
        self.output_file().into_iter().chain(study).chain(more).collect()
    }

    /// True for an output that is a folder, or with which the names of files begin.
    pub fn is_folder(&self, output: &Path) -> bool {
        match self {
            Self::Fit(args) => {
                let of_several = if args.dems.len() > 1 { args.output.as_deref() } else { None };
                [of_several, args.shown.local.as_deref()].contains(&Some(output))
            }
            Self::Convert(args) => args.target.is_some(),
            _ => false,
        }
    }
}

/// Release folder and work area.
#[derive(Debug, Args)]
pub struct Place {
    /// Release folder.
    #[arg(short, long, value_name = "DIR", default_value = "release")]
    pub output: PathBuf,
    /// Work area; default: DIR.work next to the release.
    #[arg(long, value_name = "DIR")]
    pub work: Option<PathBuf>,
}

/// `init`.
#[derive(Debug, Args)]
pub struct Init {
    /// Subject of the study.
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
    /// Release folder and work area.
    #[command(flatten)]
    pub place: Place,
    /// Run one of N shards (I = 1..N) into a folder for `merge`.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Compute only what more than one of N shards needs, publish it to --cache, and write no release.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(PARTS_MAX)), requires = "cache", conflicts_with_all = ["shard", "output"])]
    pub ancestors: Option<u32>,
    /// Shared cache: a folder, or s3://BUCKET/PREFIX, that any number of runs may use at the same time, also over a network. Finished items
    /// are copied from it; new ones are published to it.
    #[arg(long, value_name = "DIR|s3://...")]
    pub cache: Option<String>,
    /// Read the shared cache without writing to it.
    #[arg(long, requires = "cache", conflicts_with = "ancestors")]
    pub cache_read_only: bool,
    /// Also replace a release or shard of another study, another shard, or one with fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Limit on the working memory of concurrent items, GiB; items that need more are refused. Default: 4, and larger items run alone.
    #[arg(long, value_name = "GIB", allow_negative_numbers = true)]
    pub memory: Option<f64>,
}

/// `plan`.
#[derive(Debug, Args)]
pub struct Plan {
    /// Study file.
    pub study: PathBuf,
    /// Release folder and work area.
    #[command(flatten)]
    pub place: Place,
    /// Plan one of N shards (I = 1..N), including the items it depends on.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Show what each of N shards costs, what they have in common, and whether they are balanced, for an empty work area.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(PARTS_MAX)), conflicts_with = "shard")]
    pub shards: Option<u32>,
}

/// `cache`.
#[derive(Debug, Args)]
pub struct Cache {
    /// Shared cache.
    #[arg(value_name = "DIR|s3://...")]
    pub place: String,
    /// Remove the least recently used entries until the cache is no larger than this, such as 500G.
    #[arg(long, value_name = "BYTES")]
    pub max_bytes: Option<String>,
    /// Remove entries unused for more than this many days.
    #[arg(long, value_name = "DAYS", allow_negative_numbers = true)]
    pub max_age: Option<f64>,
}

/// `merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// Folders written by `run --shard`.
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// Release: a folder, or s3://BUCKET/PREFIX.
    #[arg(short, long, value_name = "DIR|s3://...", default_value = "release")]
    pub output: PathBuf,
    /// Also replace a release of another study, or one with fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
}

/// `verify`.
#[derive(Debug, Args)]
pub struct Verify {
    /// Release: a folder, or s3://BUCKET/PREFIX, which is downloaded to the folder for temporary files.
    pub release: PathBuf,
    /// Also recompute all or K of the items and compare their bytes.
    #[arg(long, value_name = "all|K")]
    pub recompute: Option<String>,
}

/// Compression of a GeoTIFF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Compress {
    /// Uncompressed.
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
    /// Set a parameter, `name=value`; the value is TOML, a bare word is text.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Seed of the random streams.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Heightfield to write; its extension selects the format.
    #[arg(short, long, value_name = "DEM")]
    pub output: PathBuf,
    /// How the DEM is written.
    #[command(flatten)]
    pub writing: Writing,
}

/// How a DEM is read.
#[derive(Debug, Args)]
pub struct Reading {
    /// Cell size for point clouds and for files that state none, m: one number, or east-west,north-south.
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub cell: Option<String>,
    /// Statistic that gives the height of a point-cloud cell (.las, .laz): mean, median, lowest, highest or N-th percentile of its
    /// points.
    #[arg(long, value_name = "mean|median|min|max|pN", default_value = "mean")]
    pub statistic: Statistic,
    /// Fill gaps of a point cloud up to this distance from its points, in cells.
    #[arg(long, value_name = "CELLS", default_value_t = 0)]
    pub fill: u32,
    /// Use only the ground points (class 2) of a point cloud.
    #[arg(long)]
    pub ground: bool,
}

/// Which cells of a DEM are used.
#[derive(Debug, Args)]
pub struct Masks {
    /// Use only the cells that this file marks: GeoJSON polygons in the DEM's coordinates, or the nonzero cells of a raster. If
    /// given several times, only cells that all files mark are used.
    #[arg(long, value_name = "FILE")]
    pub mask: Vec<PathBuf>,
    /// Exclude the cells that this file marks. May be repeated.
    #[arg(long, value_name = "FILE")]
    pub exclude: Vec<PathBuf>,
}

impl Masks {
    /// Every file, with `true` for those that exclude.
    pub fn all(&self) -> Vec<(PathBuf, bool)> {
        marked(&self.mask, &self.exclude)
    }
}

/// Mask files, with `true` for those that exclude.
fn marked(mask: &[PathBuf], exclude: &[PathBuf]) -> Vec<(PathBuf, bool)> {
    let of = |files: &[PathBuf], excludes: bool| files.iter().map(|f| (f.clone(), excludes)).collect::<Vec<_>>();
    [of(mask, false), of(exclude, true)].concat()
}

/// `fit`.
#[derive(Debug, Args)]
pub struct Fit {
    /// Measured DEM, or several to fit with the same settings.
    #[arg(required = true, value_name = "DEM")]
    pub dems: Vec<PathBuf>,
    /// Fit file to write; for several DEMs a folder, with one fit file per DEM, named after it.
    #[arg(short, long, value_name = "FIT.json", required_unless_present = "table")]
    pub output: Option<PathBuf>,
    /// Table to write, .parquet or .csv, one row per DEM: file, the columns of `schema fits` with intervals, and error, the reason
    /// why a DEM could not be fitted.
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// Window of the moving average that separates background from residual, m (2).
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub outer_scale: Option<f64>,
    /// `corrected` for detrending and trimming (default), or `paper`: the published procedure.
    #[arg(long, value_name = "corrected|paper")]
    pub mode: Option<String>,
    /// Share of residuals to trim, both tails together (0.05).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub trim: Option<f64>,
    /// Covariance model (`exponential`), several separated by commas, or `auto`; the one with the best AICc is chosen. `empirical`:
    /// the measured covariance itself.
    #[arg(long, value_name = "MODEL,...")]
    pub model: Option<String>,
    /// Number of bootstrap replicates for the confidence intervals (99); 0 for no intervals.
    #[arg(long, value_name = "N")]
    pub bootstrap: Option<u32>,
    /// Store the statistics of the residual, from which `texture --method modulated` and `wavelet_statistics` work without the DEM.
    #[arg(long)]
    pub statistics: bool,
    /// Standard deviation of the DEM's white noise, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub noise_sigma: Option<f64>,
    /// Standard deviation of spatially correlated noise, as from dense image matching, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "correlated_noise_range")]
    pub correlated_noise_sigma: Option<f64>,
    /// Lag at which the correlation of that noise falls to 1/e, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "correlated_noise_sigma")]
    pub correlated_noise_range: Option<f64>,
    /// Part of the DEM known to be smooth (GeoJSON polygons or raster), from which its white and correlated noise are estimated.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["noise_sigma", "correlated_noise_sigma", "minus"])]
    pub noise_reference: Option<PathBuf>,
    /// Standard deviation of the point-spread function that blurred the DEM, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub inner_scale: Option<f64>,
    /// Seed for the random streams of the replicates.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Part of the DEM, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window: Option<String>,
    /// Which cells are fitted.
    #[command(flatten)]
    pub masks: Masks,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
    /// DEM to co-register to the first (shift, raise, tilt) and subtract from it, for example for snow depth. The co-registration
    /// is printed even if the difference cannot be fitted.
    #[arg(long, value_name = "DEM")]
    pub minus: Option<PathBuf>,
    /// Write the difference of the two DEMs.
    #[arg(long, value_name = "DEM", requires = "minus")]
    pub difference: Option<PathBuf>,
    /// Write the covariance at every lag as a GeoTIFF whose coordinates are the lag in m.
    #[arg(long, value_name = "MAP.tif")]
    pub map: Option<PathBuf>,
    /// Write the background that the fit removes as a DEM, to be used with `texture --onto`.
    #[arg(long, value_name = "DEM")]
    pub background: Option<PathBuf>,
    /// Further files that show the fit.
    #[command(flatten)]
    pub shown: FitShown,
    /// Set any other parameter of the fit (see `kinds fit`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
}

/// Files that show a fit.
#[derive(Debug, Args)]
pub struct FitShown {
    /// Plot the fit (.svg or .png): measured and model covariance by lag, structure function, and covariance by direction.
    #[arg(long, value_name = "FILE.svg|png")]
    pub plot: Option<PathBuf>,
    /// Write the covariance bins as CSV: kind (ring or direction), lag_m, azimuth_deg (clockwise from grid north), covariance_m2,
    /// pairs, model_m2 (including the bias of the estimator), surface_model_m2 (rings only).
    #[arg(long, value_name = "FILE.csv")]
    pub csv: Option<PathBuf>,
    /// Write maps of local roughness as GeoTIFFs, one cell per block of the DEM, m: PREFIX.band-rms.tif and, with the range fixed at
    /// that of the fit, PREFIX.sigma.tif and PREFIX.sigma2-over-b.tif. Blocks with too few cells have no data.
    #[arg(long, value_name = "PREFIX")]
    pub local: Option<PathBuf>,
    /// Width of these blocks, m: at least two outer scales; default: four.
    #[arg(long, value_name = "M", allow_negative_numbers = true, requires = "local")]
    pub local_block: Option<f64>,
}

/// `coregister`.
#[derive(Debug, Args)]
pub struct Coregister {
    /// Reference DEM.
    pub a: PathBuf,
    /// DEM to move; metric and in A's coordinate system, but cell size and extent may differ.
    pub b: PathBuf,
    /// DEM to write with A minus the moved B; its extension selects the format.
    #[arg(short, long, value_name = "DIFFERENCE.tif")]
    pub output: Option<PathBuf>,
    /// Part of A, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window: Option<String>,
    /// Stable terrain: B is co-registered on these cells of A; the difference covers all cells.
    #[command(flatten)]
    pub masks: Masks,
    /// How the DEMs are read.
    #[command(flatten)]
    pub reading: Reading,
    /// How the difference is written.
    #[command(flatten)]
    pub writing: Writing,
}

/// Masks with which the DEM of a fit was fitted.
#[derive(Debug, Args)]
pub struct ExemplarMasks {
    /// With `--exemplar`: the `--mask` files of the fit, all of them and in the same order.
    #[arg(long, value_name = "FILE", requires = "exemplar")]
    pub mask: Vec<PathBuf>,
    /// With `--exemplar`: the `--exclude` files of the fit, all of them and in the same order.
    #[arg(long, value_name = "FILE", requires = "exemplar")]
    pub exclude: Vec<PathBuf>,
}

impl ExemplarMasks {
    /// Every file, with `true` for those that exclude.
    pub fn all(&self) -> Vec<(PathBuf, bool)> {
        marked(&self.mask, &self.exclude)
    }
}

/// `texture`.
#[derive(Debug, Args)]
pub struct Texture {
    /// Fit file; only `model` and `parameters` are required.
    pub fit: PathBuf,
    /// Size east-west by north-south, m.
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Cell size, m; default: that of the site for methods that repeat it, otherwise 0.1.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub cell: Option<f64>,
    /// Seed of the random streams.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Synthesis method. From any fit: fft_ma, cholesky, gaussians, quasi_wavelets; from one with `--statistics`: modulated,
    /// wavelet_statistics; with `--exemplar`: quilting, exemplar.
    #[arg(long, value_name = "M", default_value = "fft_ma")]
    pub method: String,
    /// The DEM of the fit, from whose residual `quilting` and `exemplar` copy cells. Its licence extends to the texture.
    #[arg(long, value_name = "DEM")]
    pub exemplar: Option<PathBuf>,
    /// Masks of the fit.
    #[command(flatten)]
    pub masks: ExemplarMasks,
    /// Spectral coefficients of `unit` magnitude (exact covariance in each tile) or `gaussian`.
    #[arg(long, value_name = "unit|gaussian")]
    pub phase: Option<String>,
    /// Repeat the (periodic) texture, rows by columns.
    #[arg(long, value_name = "RxC")]
    pub tile: Option<String>,
    /// DEM to add the texture to.
    #[arg(long, value_name = "DEM")]
    pub onto: Option<PathBuf>,
    /// Covariance of the `surface`, or of the `residual` that remains when the moving average over the fit's window is subtracted.
    /// Default: `residual` with `--onto` (a measured background), otherwise `surface`.
    #[arg(long, value_name = "surface|residual")]
    pub covariance: Option<String>,
    /// Factor on the heights of the texture: one number above 0, or with `--onto` a raster of factors, 0 or above.
    #[arg(long, value_name = "FACTOR|RASTER")]
    pub amplitude: Option<String>,
    /// Only fill the holes of this DEM, with texture conditioned on their surroundings; `--method` must be `fft_ma` or one that
    /// repeats the site. `--cell` gives the cell size of a DEM that states none.
    #[arg(long, value_name = "DEM", conflicts_with_all = ["onto", "size", "tile", "phase", "covariance", "amplitude", "set"])]
    pub fill: Option<PathBuf>,
    /// Set any other parameter of the method (see `kinds`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Heightfield to write; its extension selects the format.
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
    /// Write the class map, before closing, as GeoTIFF.
    #[arg(long, value_name = "TIF")]
    pub classes: Option<PathBuf>,
    /// Set any key of `[roughness]` (see `schema`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Evaluate wavelengths from the tyre radius to twice the wheelbase: `wb=2.7,r=0.33` in m, a vehicle (see `kinds`), or a vehicle
    /// file.
    #[arg(long, value_name = "V", group = "bumps")]
    pub vehicle: Option<String>,
    /// Evaluate wavelengths from MIN to MAX, m.
    #[arg(long, value_name = "MIN:MAX", group = "bumps")]
    pub band: Option<String>,
    /// How profiles are detrended: band-pass only, minus a moving average over the longest wavelength, or minus an exponentially
    /// weighted mean. Their results are not comparable.
    #[arg(long, value_enum, default_value_t = Detrend::Band, requires = "bumps")]
    pub detrend: Detrend,
    /// Accept cells that are too large for the shortest wavelength of the band.
    #[arg(long, requires = "bumps")]
    pub allow_coarse: bool,
    /// Write the RMS in windows of three times the longest wavelength, as text.
    #[arg(long, value_name = "TXT", requires = "bumps")]
    pub rms_map: Option<PathBuf>,
    /// Raster of predicted RMS (a terrain's map `rms-predicted`), added as a column of `--rms-map`.
    #[arg(long, value_name = "TIF", requires = "rms_map")]
    pub rms_predicted: Option<PathBuf>,
    /// Estimate the aerodynamic roughness length z0 for wind from N equally spaced directions (default 16), with the formulas of
    /// Lettau, Munro and Macdonald.
    #[arg(long, value_name = "N", num_args = 0..=1, require_equals = true, default_missing_value = "16", group = "winds",
        value_parser = clap::value_parser!(u16).range(1..=360))]
    pub wind: Option<u16>,
    /// The same for wind from these azimuths, degrees clockwise from grid north.
    #[arg(long, value_name = "DEG,...", value_delimiter = ',', allow_negative_numbers = true, group = "winds")]
    pub wind_from: Vec<f64>,
    /// Width of the moving average subtracted for z0 after the least-squares plane, m; default: subtract the plane only.
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
    /// Maximum number of pixels along a side; a larger DEM is reduced by averaging blocks of cells.
    #[arg(long, value_name = "N", default_value_t = 1024)]
    pub pixels: u32,
    /// Factor on the slopes before shading; default: from the RMS slope (1 where that is 0.25 or more).
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    pub exaggeration: Option<f64>,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
}

/// `render`.
#[derive(Debug, Args)]
pub struct Render {
    /// DEM, or as for `terrain` a generator (see `kinds`) or a TOML file with `kind` and its parameters.
    #[arg(value_name = "DEM|SPEC.toml|KIND")]
    pub surface: String,
    /// Direction of the sun: azimuth clockwise from north and elevation above the horizon, deg.
    #[arg(long, value_name = "AZ,EL", default_value = "315,45", allow_hyphen_values = true)]
    pub sun: String,
    /// Camera: `nadir[:PIXEL_M]`, `parallel:AZ,EL[,PIXEL_M]` or `pinhole:X,Y,Z,TO_X,TO_Y,TO_Z[,FOV_DEG]`.
    #[arg(long, value_name = "CAMERA", default_value = "nadir")]
    pub camera: String,
    /// Size of a parallel or pinhole image, columns by rows.
    #[arg(long, value_name = "COLSxROWS")]
    pub size: Option<String>,
    /// Albedo, 0 to 1: a raster with the cells of the surface, or one value for the surface.
    #[arg(long, value_name = "FILE|VALUE")]
    pub albedo: Option<String>,
    /// Set any other parameter of the image (see `kinds image`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Set a parameter of the generator (see `kinds`), `name=value`.
    #[arg(long = "set-surface", value_name = "K=V")]
    pub set_surface: Vec<String>,
    /// Seed of the random streams of the generated surface and the noise.
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
    /// Description of the images.
    #[arg(value_name = "IMAGES.toml")]
    pub images: PathBuf,
    /// Set a parameter (see `kinds photoclinometry`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Seed of the random streams (paths, perturbed solutions).
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// DEM to write, .tif; maps are written next to it.
    #[arg(short, long, value_name = "DEM.tif")]
    pub output: PathBuf,
    /// How GeoTIFFs are written.
    #[command(flatten)]
    pub writing: Writing,
}

/// How profiles are detrended.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Detrend {
    /// Band-pass only.
    Band,
    /// Minus a moving average.
    Ma,
    /// Minus an exponentially weighted mean.
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
    /// DEM with cells no larger than the wheel radius, large enough for missions of 35 m that start and end at least 5 m from the edges.
    pub dem: PathBuf,
    /// Vehicle (see `kinds`), or your own vehicle file (.toml with a table `parameters`).
    #[arg(long, value_name = "V", default_value = "husky_a200")]
    pub vehicle: String,
    /// Number of missions.
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub missions: u32,
    /// Number of starts per mission: the drawn one and perturbed ones, to estimate the probability of success.
    #[arg(long, value_name = "N")]
    pub replicates: Option<u32>,
    /// Also replace a release of another study, over another DEM, or with fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Seed of the random streams.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Set a key of `[roughness]` (see `schema`), which decides where missions may start and end, `name=value`.
    #[arg(long = "set-roughness", value_name = "K=V")]
    pub set_roughness: Vec<String>,
    /// Set a mission rule (see `kinds`), `name=value`.
    #[arg(long = "set-missions", value_name = "K=V")]
    pub set_missions: Vec<String>,
    /// Set a parameter of the traverse (see `kinds`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Date of the release.
    #[arg(long, value_name = "YYYY-MM-DD", default_value = "1970-01-01")]
    pub date: String,
    /// Release folder and work area.
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
    /// Search method: grid, roadmap, theta_star or anytime (see `kinds`).
    #[arg(long, value_name = "M", default_value = "grid")]
    pub method: String,
    /// Vehicle whose slope limits apply (see `kinds`); default: slopes up to 30 degrees.
    #[arg(long, value_name = "V")]
    pub vehicle: Option<String>,
    /// Areas that the route must avoid: GeoJSON polygons in the DEM's coordinates, or the nonzero cells of a raster. May be repeated.
    #[arg(long, value_name = "FILE")]
    pub obstacles: Vec<PathBuf>,
    /// Set a parameter of the route (see `kinds`), `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
    /// Formation of a team that follows the route: column, line, wedge, or custom with slots (see `kinds`). Requires `-o DIR`.
    #[arg(long, value_name = "F")]
    pub formation: Option<String>,
    /// Set a parameter of the team (see `kinds`), `name=value`.
    #[arg(long = "team", value_name = "K=V", requires = "formation")]
    pub team: Vec<String>,
    /// Also replace a release of another study, over another DEM, or with fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Date of the release.
    #[arg(long, value_name = "YYYY-MM-DD", default_value = "1970-01-01")]
    pub date: String,
    /// Release folder and work area.
    #[command(flatten)]
    pub place: Place,
}

/// `rover`.
#[derive(Debug, Args)]
pub struct Rover {
    /// Study file.
    pub study: PathBuf,
    /// Vary each parameter of the navigators by up to this share of its value, up and down: 10% or 0.1.
    #[arg(long, value_name = "P", allow_hyphen_values = true)]
    pub perturb: Option<String>,
    /// Number of trajectories; each changes every parameter once. Default: the study's value, or 10.
    #[arg(long, value_name = "N")]
    pub trajectories: Option<u32>,
    /// Release folder and work area.
    #[command(flatten)]
    pub place: Place,
    /// Also replace a release of another study, of the whole study, or with fewer failed items than the new one.
    #[arg(long)]
    pub replace: bool,
    /// Limit on the working memory of concurrent items, GiB; items that need more are refused. Default: 4, and larger items run alone.
    #[arg(long, value_name = "GIB", allow_negative_numbers = true)]
    pub memory: Option<f64>,
}

/// `report`.
#[derive(Debug, Args)]
pub struct Report {
    /// Release folder.
    pub release: PathBuf,
    /// Folder to write, outside the release; default: ./NAME-report.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Another release to compare with: which groups and metrics differ?
    #[arg(long, value_name = "RELEASE")]
    pub against: Option<PathBuf>,
    /// Table of analysed logs (`analyze -o`) to compare the missions with. May be repeated.
    #[arg(long, value_name = "LOGS.parquet")]
    pub logs: Vec<PathBuf>,
}

/// `analyze`.
#[derive(Debug, Args)]
pub struct Analyze {
    /// MCAP logs, or folders of ROS 2 bags.
    #[arg(required = true, value_name = "MCAP")]
    pub logs: Vec<PathBuf>,
    /// Topic of the poses; default: the most suitable one.
    #[arg(long, value_name = "TOPIC")]
    pub topic: Option<String>,
    /// Frame of the vehicle, if poses are transforms.
    #[arg(long, value_name = "FRAME", default_value = "base_link")]
    pub body: String,
    /// Frame in which the vehicle moves; default: the root of the transforms.
    #[arg(long, value_name = "FRAME")]
    pub fixed: Option<String>,
    /// Sampling rate for the metrics, Hz; slower logs keep their own.
    #[arg(long, value_name = "HZ", default_value_t = 20.0, allow_negative_numbers = true)]
    pub rate: f64,
    /// Frequency band of the vertical acceleration, Hz.
    #[arg(long, value_name = "LOW,HIGH", default_value = "0.2,8", allow_hyphen_values = true)]
    pub band: String,
    /// How heights and angles are differentiated: second_difference or gradient.
    #[arg(long, value_name = "D", default_value = "second_difference")]
    pub differentiator: String,
    /// DEM of the ground, for clearance and roughness classes along the path.
    #[arg(long, value_name = "DEM")]
    pub dem: Option<PathBuf>,
    /// Offset added to positions in the log to obtain the DEM's coordinates, m.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true)]
    pub offset: String,
    /// Label of the logs in the table.
    #[arg(long, value_name = "NAME")]
    pub group: Option<String>,
    /// Write the table `logs` as Parquet.
    #[arg(short, long, value_name = "PARQUET")]
    pub output: Option<PathBuf>,
}

/// `pack`.
#[derive(Debug, Args)]
pub struct Pack {
    /// Release folder.
    pub release: PathBuf,
    /// Archive to write, outside the release.
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
    /// Fit one half of A, and compare textures of that fit with the other half in statistics that were not fitted.
    #[arg(long, conflicts_with_all = ["b", "window_b", "statistics"])]
    pub split_half: bool,
    /// Compare B, a texture of any origin, with the site A by statistics of their blocks; the reference is how far blocks of the site
    /// differ from each other.
    #[arg(long)]
    pub statistics: bool,
    /// Exit with code 4 when any quantity is different (for releases of the same study and version: any byte).
    #[arg(long)]
    pub fail_on_difference: bool,
    /// For releases: largest difference of means that counts as the same, as a share of A's mean (0.05; 5 percentage points for success
    /// and shares).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub margin: Option<f64>,
    /// Window of the moving average that separates background from residual, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub outer_scale: Option<f64>,
    /// Covariance model fitted to both; a model of one term.
    #[arg(long, value_name = "MODEL")]
    pub model: Option<String>,
    /// Largest relative difference of sigma that counts as the same (0.1).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_sigma: Option<f64>,
    /// Largest relative difference of b that counts as the same (0.25).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_range: Option<f64>,
    /// Largest relative difference of the axis ratio that counts as the same (0.25).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_anisotropy: Option<f64>,
    /// Largest distance between the height distributions that counts as the same, in standard deviations (0.1).
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub equivalence_heights: Option<f64>,
    /// Number of simulated surfaces per DEM (199).
    #[arg(long, value_name = "N")]
    pub simulations: Option<u32>,
    /// Seed for the random streams of simulations and permutations.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Part of A, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window_a: Option<String>,
    /// Part of B, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window_b: Option<String>,
    /// Cell size for files that state none, m: one number, or east-west,north-south.
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub cell: Option<String>,
    /// Set any other parameter: trim, alpha, find_objects, equivalence_shape, equivalence_agreement, equivalence_covariance;
    /// `name=value`.
    #[arg(long = "set", value_name = "K=V")]
    pub set: Vec<String>,
}

/// How a DEM is written.
#[derive(Debug, Args)]
pub struct Writing {
    /// Compression of a GeoTIFF.
    #[arg(long, value_enum, default_value_t)]
    pub compress: Compress,
    /// Write a cloud-optimised GeoTIFF: tiled, with overviews, readable in part over a network.
    #[arg(long)]
    pub cog: bool,
}

/// `convert`.
#[derive(Debug, Args)]
pub struct Convert {
    /// DEM to read, or the vehicle to write: its name (see `kinds vehicle`) or a vehicle file; for lerobot a release.
    pub input: PathBuf,
    /// DEM or vehicle file (.xml for MJCF, .urdf) to write; with --for a folder.
    pub output: PathBuf,
    /// Export to a folder: a DEM for this simulator, or the missions of a release for a learner (lerobot).
    #[arg(long = "for", value_name = "TARGET", value_parser = targets())]
    pub target: Option<Target>,
    /// Where the simulator accepts only certain sizes, crop the middle to the largest of them instead of resampling.
    #[arg(long, requires = "target")]
    pub crop: bool,
    /// For lerobot: side of the height patch around the vehicle, a whole number of cells, m (3.2).
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub patch: Option<f64>,
    /// For lerobot: distance between the points of the height patch, m (0.1).
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub patch_cell: Option<f64>,
    /// For lerobot: only the missions of this traverse. May be repeated.
    #[arg(long, value_name = "ID")]
    pub traverse: Vec<String>,
    /// Decimate a mesh; maximum vertical distance of any cell centre from it, m.
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    pub max_error: Option<f64>,
    /// Decimate a mesh to at most this many triangles.
    #[arg(long, value_name = "N")]
    pub triangles: Option<usize>,
    /// Ground whose friction is written to the vehicle file (`sastrugi kinds surface`); default: `study`.
    #[arg(long, value_name = "SURFACE")]
    pub surface: Option<String>,
    /// Part of the DEM, x0,y0,x1,y1 in its own coordinates.
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true)]
    pub window: Option<String>,
    /// Which cells are converted; the others become no data.
    #[command(flatten)]
    pub masks: Masks,
    /// How the DEM is read.
    #[command(flatten)]
    pub reading: Reading,
    /// How the DEM is written.
    #[command(flatten)]
    pub writing: Writing,
}

impl Convert {
    /// The simulator to export for, if any.
    pub fn simulator(&self) -> Option<Simulator> {
        match self.target {
            Some(Target::Simulator(simulator)) => Some(simulator),
            Some(Target::Lerobot) | None => None,
        }
    }
}

/// What a folder is exported for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A simulator.
    Simulator(Simulator),
    /// LeRobot.
    Lerobot,
}

impl Target {
    const LEROBOT: &str = "lerobot";

    fn named(name: &str) -> Option<Self> {
        let simulator = Simulator::ALL.into_iter().find(|simulator| simulator.name() == name);
        simulator.map(Self::Simulator).or_else(|| (name == Self::LEROBOT).then_some(Self::Lerobot))
    }
}

fn targets() -> impl TypedValueParser<Value = Target> {
    let names = Simulator::ALL.map(Simulator::name).into_iter().chain([Target::LEROBOT]);
    let named = |name: String| Target::named(&name).ok_or("no target has this name");
    PossibleValuesParser::new(names).try_map(named)
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
    /// Kind or family to describe, with all its parameters.
    pub kind: Option<String>,
}

/// `schema`.
#[derive(Debug, Args)]
pub struct Schema {
    /// `study` (default), `tables`, `topics`, or the name of a table or topic.
    pub name: Option<String>,
    /// Print the reference for study files as Markdown.
    #[arg(long)]
    pub markdown: bool,
}

/// `completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// Shell to print completions for.
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
    /// Memory for cached tiles; the same amount again is used for rasters of releases.
    #[arg(long, value_name = "BYTES", default_value = "512M")]
    pub memory_bytes: String,
    /// Maximum number of samples in a patch; images may have a quarter as many pixels.
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
    /// Origin whose pages may use the server, such as `https://example.org`, or `*`. May be repeated.
    #[arg(long, value_name = "ORIGIN")]
    pub cors: Vec<String>,
    /// Log every request on stderr; RUST_LOG gives finer control.
    #[arg(long)]
    pub log: bool,
    /// Format of the log and of warnings.
    #[arg(long, value_enum, default_value_t = LogFormat::Text)]
    pub log_format: LogFormat,
}

/// Format of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Plain text.
    Text,
    /// One JSON object per line.
    Json,
}

#[cfg(test)]
mod tests;
