//! Stage `traverse`: drives and records all missions on one terrain.

use super::dem as measured;
use super::rasters::Raster;
use super::{missions, roughness, vehicle};
use crate::builder::{BuildError, Builder, HEIGHTS, Heightfield, unknown_id};
use crate::job::{
    Estimate, ItemRef, Job, JobError, Outcome, Product, RowWriter, Work, joined as joined_recipe, parsed,
};
use crate::operations::dem::input_error;
use crate::operations::drawn::Lines;
use crate::revision::Room;
use crate::runner::graph::Node;
use crate::study::entry::joined;
use crate::study::{Entry, Expanded, StudyError, keys};
use rayon::prelude::*;
use sastrugi_mobility::metrics::{Differentiator, MissionLabels, mission_row, replicate_row, sample_rows};
use sastrugi_mobility::missions::{Difficulty, Mission, ReplicateParameters, ReplicateSettings};
use sastrugi_mobility::registry::{self, Number, numbers, stated};
use sastrugi_mobility::vehicle::{
    Ground, GroundError, SurfaceLayers, SurfaceMap, TraverseError, TraverseParameters, TraverseSettings, Vehicle,
    check_scale, drive,
};
use sastrugi_numeric::{Grid, Streams};
use sastrugi_schemas::study::{McapFlavour, StudyHead, TraverseItem};
use sastrugi_schemas::tables::{MissionRow, ParameterRow, ReplicateRow, SampleRow};
use sastrugi_schemas::topics::{EventKind, Recording};
use sastrugi_schemas::{Kind, ParameterError, counted};
use sastrugi_store::mcap::{MissionMcap, TerrainView, bag_metadata, write_mission};
use sastrugi_store::{dem, digest};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Name of the stage.
pub const STAGE: &str = "traverse";

/// Missions that are driven before their samples are written. Until then the samples are in memory, about 0.7 MB per mission of 35 s.
const MISSIONS_AT_ONCE: usize = 32;

/// The one kind of run.
pub fn kinds() -> Vec<Kind> {
    vec![Kind {
        family: "traverse",
        kind: "pure_pursuit",
        summary: "a vehicle follows the line of each mission until it reaches the goal, tips over, gets stuck, leaves the terrain or runs out of time",
        source: "Majhor and Bos, sections 2.3 and 2.4; model in docs/traversal.md",
        parameters: schema(),
    }]
}

/// The parameters of the run and of the starts in one schema.
fn schema() -> Value {
    keys::schema_of_both::<TraverseParameters, ReplicateParameters>()
}

/// A vehicle with its settings, the same on every terrain.
struct Drive {
    /// Id; missions are recorded as `<id>-0001`.
    id: String,
    /// Swept parameters.
    variant: Option<String>,
    vehicle: Vehicle,
    settings: TraverseSettings,
    starts: ReplicateSettings,
    /// Rasters of wheel friction and rolling resistance.
    rasters: [Option<Raster>; 2],
    head: StudyHead,
    /// Number of missions on each terrain.
    count: usize,
    /// Approximate simulated time of a mission, s.
    seconds_each: f64,
    /// What its items have in common of their recipes, as JSON: the first keys and the last one.
    recipe: [String; 2],
}

impl Drive {
    /// The same with the common parts of the recipes.
    fn with_recipe(self) -> Self {
        let Self { settings, vehicle, starts, rasters, head, .. } = &self;
        let first = json!({
            "traverse": settings.parameters(),
            "vehicle": vehicle.parameters(),
            "starts": starts,
            "rasters": rasters.each_ref().map(|raster| raster.as_ref().map(|raster| &raster.item)),
        });
        let last = json!({
            "study": { "name": head.name, "seed": head.seed, "license": head.license, "epoch_ns": head.epoch_ns, "mcap": head.mcap },
        });
        let recipe = [first, last].map(|part| part.to_string());
        Self { recipe, ..self }
    }
}

struct TraverseJob {
    /// Shared by all terrains, of which there may be many.
    drive: Arc<Drive>,
    terrain: String,
    group: Option<String>,
    variant: Option<String>,
    lines: Arc<Lines>,
    heightfield: ItemRef,
    /// Number of cells of the heightfield.
    cells: u64,
    /// Streams from which the starts after the first are drawn.
    streams: Streams,
}

/// The heightfield of an item of this stage.
pub fn terrain_of(item_id: &str) -> &str {
    item_id.split_once('@').map_or(item_id, |(_, heightfield)| heightfield)
}

/// The run of an item of this stage.
pub fn run_of(item_id: &str) -> &str {
    item_id.split_once('@').map_or(item_id, |(run, _)| run)
}

/// Adds the items of `[[traverse]]`.
///
/// # Errors
/// An invalid item.
pub fn add(builder: &mut Builder<'_>) -> Result<(), BuildError> {
    builder.each(STAGE, add_table)
}

fn add_table(builder: &mut Builder<'_>, entry: &Entry<'_>) -> Result<(), BuildError> {
    let (envelope, params): (TraverseItem, Value) = entry.read()?;
    entry.check_keys::<TraverseItem>(&params, &schema())?;
    let expanded = entry.expand(&envelope.id, None, &envelope.sweep, &params)?;
    let prepared = expanded.iter().map(|one| Prepared::of(entry, one)).collect::<Result<Vec<_>, _>>()?;
    let Some(drawn) = builder.missions.get(&envelope.missions).cloned() else {
        return Err(unknown_id(entry, "missions", &envelope.missions, builder.missions.keys()).into());
    };
    let rasters = [
        raster(builder, entry, "wheel_friction_raster", envelope.wheel_friction_raster.as_deref())?,
        raster(builder, entry, "rolling_resistance_raster", envelope.rolling_resistance_raster.as_deref())?,
    ];
    for (one, Prepared { raw, starts, vehicle, settings }) in expanded.into_iter().zip(prepared) {
        builder.claim(entry, STAGE, &one.id)?;
        // The default speed, which some vehicles do not reach, was not asked for.
        let of_speed = one.params.get("speed_m_s").and_then(|_| registry::doubt_of_speed(&vehicle, raw.speed_m_s));
        let doubts = registry::doubts(&raw.vehicle, &raw.vehicle_changes).into_iter().chain(of_speed);
        for doubt in doubts.map(|doubt| format!("traverse \"{}\": {doubt}", envelope.id)) {
            // The values of a sweep may share one vehicle, so each doubt is listed once.
            if !builder.doubts.contains(&doubt) {
                builder.doubts.push(doubt);
            }
        }
        if raw.goal_tolerance_m >= drawn.length_m {
            let (tolerance_m, length_m) = (raw.goal_tolerance_m, drawn.length_m);
            let message = format!("is {tolerance_m} m; it must be below the length of the missions, {length_m} m");
            return Err(entry.refuse(ParameterError::new("goal_tolerance_m", message)).into());
        }
        let starts = ReplicateSettings::new(starts, drawn.length_m).map_err(|e| entry.refuse(e))?;
        let speed_m_s = raw.speed_m_s.min(vehicle.speed_limit_m_s());
        let drive = Drive {
            id: one.id,
            variant: one.sweep,
            vehicle,
            settings,
            starts,
            rasters: rasters.clone(),
            head: builder.study.head.clone(),
            count: drawn.count,
            seconds_each: (drawn.length_m / speed_m_s).min(raw.timeout_s),
            recipe: Default::default(),
        };
        let drive = Arc::new(drive.with_recipe());
        if drawn.lines.iter().any(|lines| builder.exported.contains(&lines.heightfield)) {
            vehicle::add(builder, &drive.id, &drive.vehicle, &drive.settings)?;
        }
        drawn.lines.iter().try_for_each(|lines| add_one(builder, entry, &envelope.id, &drive, lines))?;
    }
    Ok(())
}

/// The parameters of a run, checked as far as they do not depend on its missions.
struct Prepared {
    raw: TraverseParameters,
    starts: ReplicateParameters,
    vehicle: Vehicle,
    settings: TraverseSettings,
}

impl Prepared {
    fn of(entry: &Entry<'_>, one: &Expanded) -> Result<Self, BuildError> {
        entry.check_keys::<TraverseItem>(&one.params, &schema())?;
        let (raw, starts): (TraverseParameters, ReplicateParameters) =
            keys::read_both(&one.params).map_err(|e| entry.refuse(e))?;
        let (vehicle, settings) = raw.prepare().map_err(|e| entry.refuse(e))?;
        Ok(Self { raw, starts, vehicle, settings })
    }
}

/// The item that produces a raster of the surface.
fn raster(builder: &Builder<'_>, entry: &Entry<'_>, key: &str, id: Option<&str>) -> Result<Option<Raster>, StudyError> {
    let Some(id) = id else { return Ok(None) };
    builder.surface(entry, key, id).map(|field| Some(field.into()))
}

/// Refuses a terrain whose cells are known to be larger than the vehicle. A measured DEM is checked when it is read, because its file
/// may give the cell size in degrees.
fn check_scales(field: &Heightfield, vehicle: &Vehicle) -> Result<(), GroundError> {
    let longer = field.geometry.map(|g| g.cell[0].max(g.cell[1]));
    match longer.or(field.cell_m).filter(|_| field.item.stage != measured::STAGE) {
        Some(cell_m) => check_scale(cell_m, vehicle),
        None => Ok(()),
    }
}

/// Adds the run over one terrain.
fn add_one(
    builder: &mut Builder<'_>,
    entry: &Entry<'_>,
    traverse: &str,
    drive: &Arc<Drive>,
    lines: &Arc<Lines>,
) -> Result<(), StudyError> {
    let terrain = lines.heightfield.clone();
    let Some(field) = builder.heightfields.get(&terrain) else { return Ok(()) };
    check_scales(field, &drive.vehicle)
        .map_err(|e| entry.error("missions", format!("\"{terrain}\": failed to {e}")))?;
    // Named after the table without its swept part, so that every value of a sweep has the same starts.
    let streams = builder.streams(STAGE, &format!("{traverse}@{}", lines.word), None, 0);
    let stream = (drive.starts.count() > 1).then(|| streams.label());
    let own = [field.item.clone(), roughness::item(&terrain), lines.item.clone()];
    let parents = own.into_iter().chain(drive.rasters.iter().flatten().map(|raster| raster.item.clone())).collect();
    let item = ItemRef::new(STAGE, &format!("{}@{terrain}", drive.id));
    let job = TraverseJob {
        drive: Arc::clone(drive),
        group: field.group.clone(),
        variant: joined(field.variant.as_deref(), drive.variant.as_deref()),
        lines: Arc::clone(lines),
        heightfield: field.item.clone(),
        cells: field.cells,
        streams,
        terrain,
    };
    builder.node(Node { item, parents, inputs: Vec::new(), stream, job: Box::new(job) })
}

/// The results of one mission: its rows, and its recording, which is already on disk.
struct Driven {
    products: Vec<Product>,
    row: MissionRow,
    /// One row per start if there are several starts, otherwise empty.
    replicates: Vec<ReplicateRow>,
    samples: Vec<SampleRow>,
}

/// Data shared by all missions on a terrain.
struct Site {
    ground: Ground,
    heights: Grid,
    heights_sha256: String,
    classes: Grid<u8>,
}

impl TraverseJob {
    fn site(&self, work: &Work<'_>) -> Result<Site, JobError> {
        let heights = dem::read(&work.parent(&self.heightfield, HEIGHTS)?).map_err(input_error)?;
        let path = work.parent(&roughness::item(&self.terrain), roughness::CLASSES_RAW)?;
        let classes = dem::read_classes(&path).map_err(input_error)?;
        let ground =
            Ground::new(&heights.grid, &self.drive.vehicle).map_err(|e| JobError::input(format!("cannot {e}")))?;
        let ground = self.with_surface(ground, work, &heights.grid, &classes)?;
        let heights_sha256 = digest::heights(&heights.grid);
        Ok(Site { ground, heights: heights.grid, heights_sha256, classes })
    }

    /// The ground with a map of its surface, if friction or rolling resistance vary in space.
    fn with_surface(
        &self,
        ground: Ground,
        work: &Work<'_>,
        heights: &Grid,
        classes: &Grid<u8>,
    ) -> Result<Ground, JobError> {
        let parameters = &self.drive.settings.parameters().surface;
        let [wheel_friction, rolling_resistance] =
            [0, 1].map(|i| self.drive.rasters[i].as_ref().map(|raster| read_raster(work, raster, heights)).transpose());
        let layers = SurfaceLayers {
            classes: parameters.differs_by_class().then(|| classes.clone()),
            wheel_friction: wheel_friction?,
            rolling_resistance: rolling_resistance?,
        };
        if layers.is_empty() {
            return Ok(ground);
        }
        let surface = SurfaceMap::new(parameters, layers).map_err(|e| JobError::input(format!("cannot {e}")))?;
        Ok(ground.with_surface(surface))
    }

    fn mission_id(&self, mission: &Mission) -> String {
        format!("{}-{:04}", self.drive.id, mission.index + 1)
    }

    /// Drives a mission from all its starts and records the first.
    fn drive(
        &self,
        work: &Work<'_>,
        site: &Site,
        view: &TerrainView<'_>,
        mission: &Mission,
    ) -> Result<Driven, JobError> {
        let id = self.mission_id(mission);
        let fail = |e: JobError| e.reworded(|words| format!("{id}: {words}"));
        let release_path = match self.drive.head.mcap {
            McapFlavour::Viewer => format!("mcap/{}/{id}.mcap", self.terrain),
            McapFlavour::Ros2 => format!("mcap/{}/{id}/{id}.mcap", self.terrain),
        };
        let labels = MissionLabels {
            terrain_id: self.terrain.clone(),
            group: self.group.clone(),
            variant: self.variant.clone(),
            pair_id: self.lines.pair_id(mission),
            traverse_id: self.drive.id.clone(),
            path: release_path.clone(),
        };
        let recording = self.recording(site, mission).map_err(|e| fail(JobError::new(e)))?;
        let difficulty = Difficulty::along(&site.heights, &site.classes, mission, self.drive.vehicle.wheelbase_m());
        let mut row = mission_row(&labels, mission, &difficulty, &recording, self.differentiator());
        row.mission_id.clone_from(&id);
        let replicates = self.replicates(site, mission, &labels, &recording).map_err(|e| fail(JobError::new(e)))?;
        if !replicates.is_empty() {
            let successes = replicates.iter().filter(|r| r.outcome == EventKind::Success.name()).count();
            row.replicates = replicates.len() as i64;
            row.success_probability = successes as f64 / replicates.len() as f64;
        }
        let mut samples = sample_rows(&self.terrain, mission, &recording, &site.classes);
        samples.iter_mut().for_each(|s| s.mission_id.clone_from(&id));
        let metadata = self.metadata(&row, &site.heights_sha256);
        let mcap = MissionMcap {
            flavour: self.drive.head.mcap,
            recording: &recording,
            terrain: view,
            start_m: mission.start_m,
            goal_m: mission.goal_m,
            epoch_ns: self.drive.head.epoch_ns,
            metadata: &metadata,
        };
        let file = format!("{id}.mcap");
        let summary = write_mission(&work.output(&file), &mcap).map_err(|e| fail(JobError::io(e)))?;
        let mut products = Vec::new();
        if self.drive.head.mcap == McapFlavour::Ros2 {
            let (bag, place) = (format!("{id}.metadata.yaml"), format!("mcap/{}/{id}/metadata.yaml", self.terrain));
            work.write(&bag, bag_metadata(&file, &summary).as_bytes()).map_err(fail)?;
            products.push(Product::released(&bag, place, None));
        }
        let recorded = Product::released(&file, release_path, Some(summary.content_sha256));
        products.push(Product { records: Some(summary.messages), ..recorded });
        Ok(Driven { products, row, replicates, samples })
    }

    /// The rows of the starts of a mission, empty if there is only one. `first` is the recording from the drawn start.
    fn replicates(
        &self,
        site: &Site,
        mission: &Mission,
        labels: &MissionLabels,
        first: &Recording,
    ) -> Result<Vec<ReplicateRow>, TraverseError> {
        if self.drive.starts.count() == 1 {
            return Ok(Vec::new());
        }
        let row = |replicate: usize| {
            let start = self.drive.starts.start(mission, replicate, &self.streams);
            let recording = match replicate {
                0 => Cow::Borrowed(first),
                _ => Cow::Owned(self.recording(site, &start)?),
            };
            let row = replicate_row(labels, &start, replicate as i64 + 1, &recording, self.differentiator());
            Ok(ReplicateRow { mission_id: self.mission_id(mission), ..row })
        };
        (0..self.drive.starts.count()).into_par_iter().map(row).collect()
    }

    fn recording(&self, site: &Site, start: &Mission) -> Result<Recording, TraverseError> {
        drive(&site.ground, &self.drive.vehicle, &self.drive.settings, start)
    }

    fn differentiator(&self) -> Differentiator {
        self.drive.settings.parameters().differentiator
    }

    /// Metadata that states the origin of a recording that is read on its own.
    fn metadata(&self, row: &MissionRow, heights_sha256: &str) -> BTreeMap<String, BTreeMap<String, String>> {
        let head = &self.drive.head;
        let study = [("name", head.name.clone()), ("seed", head.seed.to_string()), ("license", head.license.clone())];
        let terrain = [("id", self.terrain.clone()), ("group", self.group.clone().unwrap_or_default())];
        let mission = [
            ("id", row.mission_id.clone()),
            ("start_m", format!("{} {}", row.start_x_m, row.start_y_m)),
            ("goal_m", format!("{} {}", row.goal_x_m, row.goal_y_m)),
        ];
        let parameters = serde_json::to_string(self.drive.settings.parameters()).unwrap_or_default();
        let vehicle = [("name", row.vehicle.clone()), ("parameters", parameters)];
        let outcome = [("outcome", row.outcome.clone()), ("time_s", row.time_s.to_string())];
        let map = |pairs: &[(&str, String)]| pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        [
            ("study".to_owned(), map(&study)),
            ("terrain".to_owned(), map(&terrain)),
            ("mission".to_owned(), map(&mission)),
            ("vehicle".to_owned(), map(&vehicle)),
            ("outcome".to_owned(), map(&outcome)),
            ("hashes".to_owned(), map(&[("terrain_heights_sha256", heights_sha256.to_owned())])),
        ]
        .into()
    }

    /// Every number of the run, by name.
    fn parameters(&self) -> Vec<ParameterRow> {
        let row = |number: Number| ParameterRow {
            traverse_id: self.drive.id.clone(),
            parameter: number.parameter,
            value: number.value,
            source: number.source,
        };
        let Drive { vehicle, settings, starts, rasters, .. } = &*self.drive;
        let [friction, resistance] = rasters.each_ref().map(|raster| raster.as_ref().map(|raster| &raster.item));
        let rasters = json!({ "wheel_friction_raster": friction, "rolling_resistance_raster": resistance });
        let more = json!({ "starts": starts, "surface": rasters, "missions": *self.lines.rules });
        let mut rows: Vec<ParameterRow> =
            numbers(vehicle, settings).into_iter().chain(stated("", &more)).map(row).collect();
        rows.sort_by(|a, b| a.parameter.cmp(&b.parameter));
        rows
    }
}

/// A raster of the surface, which must overlap the terrain.
fn read_raster(work: &Work<'_>, raster: &Raster, terrain: &Grid) -> Result<Grid, JobError> {
    let values = raster.read(work)?.grid;
    if terrain.geometry.overlaps(&values.geometry) {
        return Ok(values);
    }
    let ([x, y], [tx, ty]) = (values.geometry.origin, terrain.geometry.origin);
    Err(JobError::input(format!(
        "the raster {} with origin ({x:.2}, {y:.2}) m does not overlap the terrain, whose origin is ({tx:.2}, {ty:.2}) m; \
         convert it to the coordinates of the terrain",
        raster.item.id
    )))
}

impl Job for TraverseJob {
    fn recipe(&self) -> Value {
        parsed(&self.recipe_text())
    }

    fn recipe_text(&self) -> String {
        let own = json!({
            "terrain": self.terrain,
            "group": self.group,
            "variant": self.variant,
            "missions": self.lines.item,
        });
        let [first, last] = &self.drive.recipe;
        joined_recipe(&[first, &own.to_string(), last])
    }

    fn rooms(&self) -> &'static [Room] {
        &[Room::Mobility]
    }

    fn memory_bytes(&self) -> u64 {
        // Heights, ground with its bound and classes once; rasters of the surface; the samples of the missions that are driven at once, about
        // 1000 bytes each including the wheels, if all of them take ten times as long as planned, or run out of time; the rows of the starts.
        let Drive { count, seconds_each, starts, settings, rasters, .. } = &*self.drive;
        let rasters: u64 = rasters.iter().flatten().map(|raster| raster.bytes).sum();
        let rows = (count * starts.count()) as u64;
        let parameters = settings.parameters();
        let samples = (*count).min(MISSIONS_AT_ONCE) as f64
            * parameters.timeout_s.min(10.0 * seconds_each)
            * f64::from(parameters.sample_rate_hz);
        ((64 << 20) + 48 * self.cells + rasters).saturating_add((1000.0 * samples) as u64).saturating_add(400 * rows)
    }

    fn estimate(&self) -> Estimate {
        let driven_s = self.drive.count as f64 * self.drive.seconds_each;
        let other_starts_s = driven_s * (self.drive.starts.count() - 1) as f64;
        // The ground and its bound are computed once.
        let ground_s = 5e-8 * self.cells as f64;
        Estimate { seconds: ground_s + 1.7e-3 * driven_s + 1.2e-3 * other_starts_s, bytes: 2e4 * driven_s }
    }

    fn run(&self, work: &Work<'_>) -> Result<Outcome, JobError> {
        let site = self.site(work)?;
        let view = TerrainView::new(&site.heights, Some(&site.classes)).map_err(JobError::new)?;
        let mut missions = missions::read(&missions::file(work, &self.lines.item)?)?;
        // Ids sort as text: 10000 comes before 9999.
        missions.sort_by_cached_key(|mission| self.mission_id(mission));
        let mut samples = RowWriter::new(work);
        let (mut products, mut replicates, mut rows) = (Vec::new(), Vec::new(), Vec::with_capacity(missions.len()));
        for missions in missions.chunks(MISSIONS_AT_ONCE) {
            let driven: Result<Vec<Driven>, JobError> =
                missions.par_iter().map(|mission| self.drive(work, &site, &view, mission)).collect();
            for driven in driven? {
                products.extend(driven.products);
                samples.push(driven.samples)?;
                replicates.extend(driven.replicates);
                rows.push(driven.row);
            }
        }
        let notes = site.ground.warnings().iter().cloned().chain(no_ground_note(&rows)).collect();
        let mut outcome = Outcome { products, notes };
        outcome.write_rows(work, self.parameters())?;
        samples.finish(&mut outcome)?;
        outcome.write_rows(work, replicates)?;
        outcome.write_rows(work, rows)?;
        Ok(outcome)
    }
}

/// A note on missions that ended where they began.
fn no_ground_note(missions: &[MissionRow]) -> Option<String> {
    let nowhere = |row: &&MissionRow| row.time_s == 0.0 && row.outcome == EventKind::OutOfBounds.name();
    let count = missions.iter().filter(nowhere).count();
    (count > 0).then(|| {
        format!(
            "{count} of {} started with the vehicle over cells without data; fill the gaps of the DEM first",
            counted(missions.len(), "mission")
        )
    })
}
