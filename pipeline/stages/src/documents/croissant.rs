//! `croissant.json`: describes every table in Croissant 1.1 (MLCommons, "Croissant Format Specification", version 1.1), with which data
//! loaders find the columns with type, unit and description, and the files with their hashes.
//!
//! Tables with one file per terrain are long, and mlcroissant (1.1) builds each record in Python, field by field, with a linear search
//! in the list of the record set's fields: for the 37 columns of `samples` this took more than half of the time. Their columns are
//! therefore subfields of one field, `<table>/row`, and the terrain id is read from the file name, by which mlcroissant can filter:
//! `records("samples", filters={"samples/terrain_id": "<id>"})` opens only that file.

use super::described::{Described, Maker, ORGANIZATION, add_terms, citation_line, map_files, map_words, page};
use super::spdx_list;
use crate::jobs::{exports, original};
use crate::splits::PARTS;
use sastrugi_schemas::manifest::Source;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::tables::{self, Column, ColumnType, Table};
use sastrugi_store::release::Listed;
use serde_json::{Value, json};

/// Record set of the splits, and the column that names a split.
const SPLITS: &str = "splits";
const SPLIT_NAME: &str = "splits/name";
const SPLIT_COLUMN: &str = "split";
const PARQUET: &str = "application/x-parquet";
/// Maximum number of files of a table that are described individually. More are described as one set, with their hashes in the
/// manifest only, so that this file, which loaders read completely, stays small.
const DESCRIBED_FILES: usize = 64;
/// Field that contains the columns of a long table.
const ROW: &str = "row";
/// Set of the generated heightfields.
const HEIGHTS: &str = "terrain-files";
/// Files other than tables, listed with hashes in the manifest: id of the set, folder, extension, media type, description.
const SETS: [(&str, &str, &str, &str, &str); 14] = [
    (HEIGHTS, "terrain", ".tif", "image/tiff", "Generated heightfields, GeoTIFF, float32 metres"),
    ("terrain-pictures", "terrain", ".png", "image/png", "Generated heightfields, 16-bit PNG"),
    ("texture-files", "texture", ".tif", "image/tiff", "Synthesised textures, GeoTIFF, float32 metres"),
    ("dem-files", "dem", ".metric.tif", "image/tiff", "Measured heights in metres, GeoTIFF"),
    (
        "class-files",
        "classes",
        ".tif",
        "image/tiff",
        "Roughness classes: 0 low, 1 semi, 2 high; `.raw.tif` before closing",
    ),
    ("fit-files", "fit", ".json", "application/json", "Covariance fits"),
    (
        "fit-rasters",
        "fit",
        ".tif",
        "image/tiff",
        "Background, residual, covariance and mask of used cells of the fits, GeoTIFF",
    ),
    (
        "route-files",
        "route",
        ".geojson",
        "application/geo+json",
        "Planned routes, GeoJSON in the terrain's own coordinates",
    ),
    (
        "image-files",
        "image",
        ".tif",
        "image/tiff",
        "Rendered images, GeoTIFF, float32 brightness (I/F); sun and camera in `.json`",
    ),
    ("image-descriptions", "image", ".json", "application/json", "Sun, camera and photometry of the rendered images"),
    ("image-pictures", "image", ".png", "image/png", "Rendered images, 8-bit PNG for viewing"),
    (
        "recovered-files",
        "photoclinometry",
        ".tif",
        "image/tiff",
        "Surfaces recovered from images, GeoTIFF, float32 metres; with maps of albedo, uncertainty and number of lit images",
    ),
    ("mcap-files", "mcap", ".mcap", "application/octet-stream", "Recordings of missions, teams and rovers, MCAP"),
    ("bag-files", "mcap", "metadata.yaml", "application/yaml", "Metadata of the recordings for bag readers"),
];
/// Documents and report of the release: id of the set, patterns, media types, description.
const DOCUMENTS: [(&str, &[&str], &[&str], &str); 2] = [
    (
        "documents",
        &[
            "README.md",
            "CITATION.cff",
            "LICENSE",
            "study.toml",
            "croissant.json",
            "ro-crate-metadata.json",
            ".zenodo.json",
            "manifest.json",
            "SHA256SUMS",
        ],
        &["text/markdown", "application/yaml", "text/plain", "application/json", "application/toml"],
        "Documents of the release: study, licence, citation, and list of all files with hashes",
    ),
    (
        "report",
        &["report/index.html", "report/figures/*.svg", "report/data/*.json"],
        &["text/html", "image/svg+xml", "application/json"],
        "The report: one offline page, with its figures and numbers",
    ),
];
/// Folders for simulators.
const EXPORTS: (&str, &[&str], &[&str], &str) = (
    "exports",
    &["export/*/*/*"],
    &["image/png", "application/octet-stream", "application/xml", "text/plain", "application/json", "text/markdown"],
    "Terrains for import into simulators: heights, README.md (import steps), import.json (all numbers)",
);
/// Vehicles of missions on exported terrains.
const VEHICLES: (&str, &[&str], &[&str], &str) = (
    "vehicles",
    &["export/vehicle/*.xml", "export/vehicle/*.urdf"],
    &["application/xml"],
    "Vehicles for import into simulators: MJCF and URDF, with masses, inertia, joints and friction",
);
/// Viewer layout, for recordings of that flavour.
const LAYOUT: (&str, &[&str], &[&str], &str) =
    ("viewer-layout", &["mcap/foxglove-layout.json"], &["application/json"], "Viewer layout for the recordings");

/// The text of `croissant.json`.
pub fn text(described: &Described<'_>) -> String {
    let head = described.head;
    let mut tables: Vec<Value> = tables::ALL.into_iter().filter_map(|table| record_set(table, described)).collect();
    if head.split.is_some() {
        tables.push(splits());
    }
    let mut dataset = json!({
        "@context": context(),
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": head.title,
        "description": if head.description.is_empty() { &head.title } else { &head.description },
        "license": spdx_list::address(&head.license),
        "creator": described.creators().map(creator).collect::<Vec<_>>(),
        "datePublished": head.date,
        "citeAs": citation_line(head),
        "url": page(head).unwrap_or_else(|| "./".to_owned()),
        "distribution": distribution(described),
        "recordSet": tables,
    });
    if let Some(version) = &head.version {
        dataset["version"] = json!(version);
    }
    if !head.keywords.is_empty() {
        dataset["keywords"] = json!(head.keywords);
    }
    if !described.sources.is_empty() {
        dataset["isBasedOn"] = described.sources.iter().map(work).collect();
    }
    format!("{dataset:#}\n")
}

fn creator(maker: Maker<'_>) -> Value {
    let mut creator = json!({ "@type": format!("sc:{}", maker.kind()), "name": maker.name });
    if let Some(page) = maker.page() {
        creator["sameAs"] = json!(page);
    }
    if let Some(affiliation) = maker.affiliation {
        creator["affiliation"] = json!({ "@type": format!("sc:{ORGANIZATION}"), "name": affiliation });
    }
    creator
}

/// Measured data as a work of its own.
fn work(source: &Source) -> Value {
    let mut work = json!({ "@type": "sc:CreativeWork", "name": source.id });
    add_terms(&mut work, source);
    work
}

/// All files of the release. Measured files, and table files up to [`DESCRIBED_FILES`], are listed with hashes; tables of several
/// files, and all other files, are sets.
fn distribution(described: &Described<'_>) -> Vec<Value> {
    let few = |table: &&&'static Table| described.parts(table.name).count() <= DESCRIBED_FILES;
    let parts = |table: &&'static Table| described.parts(table.name);
    let given = described.files.iter().filter(|file| original::only_copies(&file.origin().stage));
    let mut files: Vec<Value> = given.map(|file| file_object(file, media_of(file.path()))).collect();
    files.extend(tables::ALL.iter().filter(few).flat_map(parts).map(|file| file_object(file, PARQUET)));
    let several = tables::ALL.iter().filter(|table| is_set(table, described));
    files.extend(several.map(|table| {
        let includes = format!("tables/{}/*.parquet", table.name);
        file_set(&set_id(table), &[&includes], &[PARQUET], table.description)
    }));
    let there = |folder: &str, ending: &str| {
        let folder = format!("{folder}/");
        described.files.iter().any(|file| file.path().starts_with(&folder) && file.path().ends_with(ending))
    };
    let maps: Vec<String> = described.maps().map(map_files).collect();
    for (id, folder, ending, media, what) in SETS.into_iter().filter(|(_, folder, ending, ..)| there(folder, ending)) {
        let below = if folder == "mcap" { "**/" } else { "" };
        let mut set = file_set(id, &[&format!("{folder}/{below}*{ending}")], &[media], what);
        if id == HEIGHTS && !maps.is_empty() {
            // The specification defines the term, but its context lacks it.
            set["cr:excludes"] = one_or_many(&maps.iter().map(String::as_str).collect::<Vec<_>>());
        }
        files.push(set);
    }
    files.extend(described.maps().map(|map| {
        let what = format!("Maps of the heightfields, GeoTIFF, float32: {}", map_words(map));
        file_set(&format!("map-{}-files", map.name), &[&map_files(map)], &["image/tiff"], &what)
    }));
    let layout = (described.head.mcap == McapFlavour::Viewer && there("mcap", ".mcap")).then_some(LAYOUT);
    let exports = there(exports::FOLDER.trim_end_matches('/'), "").then_some(EXPORTS);
    let vehicles = there("export/vehicle", ".urdf").then_some(VEHICLES);
    let documents = DOCUMENTS.into_iter().chain(layout).chain(exports).chain(vehicles);
    files.extend(documents.map(|(id, includes, media, what)| file_set(id, includes, media, what)));
    files
}

/// Media type of a measured file or a mask.
fn media_of(path: &str) -> &'static str {
    match path.rsplit('.').next() {
        Some("tif" | "tiff") => "image/tiff",
        Some("png") => "image/png",
        Some("asc" | "prj") => "text/plain",
        Some("geojson" | "json") => "application/geo+json",
        _ => "application/octet-stream",
    }
}

fn file_object(file: &Listed, media: &str) -> Value {
    json!({
        "@type": "cr:FileObject",
        "@id": file.path(),
        "name": file.path(),
        "contentUrl": file.path(),
        "contentSize": format!("{} B", file.bytes()),
        "encodingFormat": media,
        "sha256": file.sha256(),
    })
}

fn file_set(id: &str, includes: &[&str], media: &[&str], description: &str) -> Value {
    json!({
        "@type": "cr:FileSet",
        "@id": id,
        "name": id,
        "description": description,
        "encodingFormat": one_or_many(media),
        "includes": one_or_many(includes),
    })
}

/// A single value is not wrapped in a list, as usual in JSON-LD.
fn one_or_many(values: &[&str]) -> Value {
    match values {
        [one] => json!(one),
        _ => json!(values),
    }
}

/// Whether the files of a table are described as a set: several files, or one per terrain.
fn is_set(table: &Table, described: &Described<'_>) -> bool {
    described.parts(table.name).count() > usize::from(table.file_per.is_none())
}

fn set_id(table: &Table) -> String {
    format!("{}-files", table.name)
}

/// The record set of a table; `None` for a table without a file.
fn record_set(table: &Table, described: &Described<'_>) -> Option<Value> {
    let first = described.parts(table.name).next()?;
    let source = match is_set(table, described) {
        false => json!({ "fileObject": { "@id": first.path() } }),
        true => json!({ "fileSet": { "@id": set_id(table) } }),
    };
    let keys = table.columns.iter().filter(|column| column.key);
    let fields = table.columns.iter().map(|column| field(described, table, column, &source)).collect();
    Some(json!({
        "@type": "cr:RecordSet",
        "@id": table.name,
        "name": table.name,
        "description": table.description,
        "key": keys.map(|column| json!({ "@id": field_id(table, column) })).collect::<Vec<_>>(),
        "field": nested(table, fields),
    }))
}

/// The fields of a record set; for a table with one file per terrain, the column that names the file and one field for the others.
fn nested(table: &Table, fields: Vec<Value>) -> Vec<Value> {
    let Some(file_per) = table.file_per.and_then(|key| table.position(key)) else { return fields };
    let mut rest = fields;
    let mut named = rest.remove(file_per);
    named["source"]["extract"] = json!({ "fileProperty": "filename" });
    named["source"]["transform"] = json!({ "regex": "^part-(.+)\\.parquet$" });
    let row = json!({
        "@type": "cr:Field",
        "@id": format!("{}/{ROW}", table.name),
        "name": ROW,
        "description": "The other columns of the row",
        "subField": rest,
    });
    vec![named, row]
}

fn field_id(table: &Table, column: &Column) -> String {
    format!("{}/{}", table.name, column.name)
}

fn field(described: &Described<'_>, table: &Table, column: &Column, source: &Value) -> Value {
    let (data_type, is_list) = match column.column_type {
        ColumnType::Text => ("sc:Text", false),
        ColumnType::F64 => ("cr:Float64", false),
        ColumnType::I64 => ("cr:Int64", false),
        ColumnType::Bool => ("sc:Boolean", false),
        ColumnType::F32List => ("cr:Float32", true),
        ColumnType::F64List => ("cr:Float64", true),
    };
    let mut source = source.clone();
    source["extract"] = json!({ "column": column.name });
    let mut field = json!({
        "@type": "cr:Field",
        "@id": field_id(table, column),
        "name": column.name,
        "description": column.description,
        "dataType": data_type,
        "source": source,
    });
    if !column.unit.is_empty() {
        field["unitText"] = json!(column.unit);
    }
    if column.name == SPLIT_COLUMN {
        field["dataType"] = json!(["sc:Text", "cr:Split"]);
        // A reference would be a join, which loads all files of a table before the first record.
        if described.head.split.is_some() && table.file_per.is_none() {
            field["references"] = json!({ "field": { "@id": SPLIT_NAME } });
        }
    }
    if is_list {
        field["isArray"] = json!(true);
        field["arrayShape"] = json!("-1");
    }
    field
}

/// Record set of the values of the column `split`.
fn splits() -> Value {
    const SPLIT_URL: &str = "splits/url";
    let column = |id: &str, data_type: Value| {
        let name = id.rsplit('/').next();
        json!({ "@type": "cr:Field", "@id": id, "name": name, "dataType": data_type })
    };
    let urls = ["cr:TrainingSplit", "cr:ValidationSplit", "cr:TestSplit"];
    let rows = PARTS.iter().zip(urls).map(|(part, url)| json!({ SPLIT_NAME: part, SPLIT_URL: url }));
    json!({
        "@type": "cr:RecordSet",
        "@id": SPLITS,
        "name": SPLITS,
        "description": "Splits of the terrains; every group is divided in the shares stated in the study",
        "dataType": "cr:Split",
        "key": { "@id": SPLIT_NAME },
        "field": [column(SPLIT_NAME, json!("sc:Text")), column(SPLIT_URL, json!(["sc:URL", "cr:Split"]))],
        "data": rows.collect::<Vec<_>>(),
    })
}

/// The context, verbatim from the specification.
fn context() -> Value {
    let croissant = [
        "arrayShape",
        "citeAs",
        "column",
        "containedIn",
        "equivalentProperty",
        "extract",
        "field",
        "fileProperty",
        "fileObject",
        "fileSet",
        "format",
        "includes",
        "isArray",
        "isLiveDataset",
        "jsonPath",
        "key",
        "md5",
        "parentField",
        "path",
        "recordSet",
        "references",
        "regex",
        "repeated",
        "replace",
        "samplingRate",
        "separator",
        "source",
        "subField",
        "transform",
    ];
    let mut context = json!({
        "@language": "en",
        "@vocab": "https://schema.org/",
        "sc": "https://schema.org/",
        "cr": "http://mlcommons.org/croissant/",
        "rai": "http://mlcommons.org/croissant/RAI/",
        "dct": "http://purl.org/dc/terms/",
        "conformsTo": "dct:conformsTo",
        "data": { "@id": "cr:data", "@type": "@json" },
        "examples": { "@id": "cr:examples", "@type": "@json" },
        "dataType": { "@id": "cr:dataType", "@type": "@vocab" },
        "description": { "@container": "@language" },
        "name": { "@container": "@language" },
    });
    for word in croissant {
        context[word] = json!(format!("cr:{word}"));
    }
    context
}
