"""Opens the metadata of a release with the programs for which they are written.

    python check_metadata.py RELEASE    croissant.json with mlcroissant (every record of every record set, against the rows of the
                                        tables), ro-crate-metadata.json with rocrate, CITATION.cff with cffconvert, the head of
                                        README.md as a dataset hub reads it, .zenodo.json
"""

import fnmatch
import hashlib
import json
import logging
import re
import warnings
from pathlib import Path

import cffconvert
import mlcroissant
import pyarrow.parquet as pq
from cffconvert.cli.create_citation import create_citation
from rocrate.rocrate import ROCrate
from ruamel.yaml import YAML

from common import expect, manifest, run

# Stages that only copy files into the release.
COPIES = {"original", "mask"}
PARTS = ["train", "validation", "test"]
# Tables with a file for each terrain.
LONG = {"samples", "formation_samples", "rover_samples"}
# Maps that go with heights.
MAPS = ["albedo", "class", "flux", "rms-measured", "rms-predicted", "rock-potential"]
# Tables with more files are only described as a file set; their hashes are in the manifest.
DESCRIBED_FILES = 64


def plain(value):
    """A value as Parquet has it."""
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, list):
        return [plain(element) for element in value]
    if value is None or isinstance(value, (bool, str)):
        return value
    return value.item() if hasattr(value, "item") else value


def same(theirs, ours):
    if isinstance(ours, list):
        return len(theirs) == len(ours) and all(map(same, theirs, ours))
    if ours is None:
        return theirs is None or theirs != theirs
    return theirs == ours


def tables(release):
    """Rows of every table, in order of its files."""
    rows = {}
    for folder in sorted((release / "tables").iterdir()):
        parts = sorted(folder.glob("*.parquet"))
        rows[folder.name] = [row for part in parts for row in pq.read_table(part).to_pylist()]
    return rows


def flat(record, name):
    """A record without the field that holds the columns of a long table."""
    top = {key: value for key, value in record.items() if key != f"{name}/row"}
    return {**top, **record.get(f"{name}/row", {})}


def check_records(dataset, name, rows):
    records = [flat(record, name) for record in dataset.records(name)]
    expect(len(records) == len(rows), f"croissant.json, {name}: {len(records)} records instead of {len(rows)}")
    columns = list(rows[0])
    keys = [f"{name}/{column}" for column in columns]
    expect(list(records[0]) == keys, f"croissant.json, {name}: columns {list(records[0])} instead of {keys}")
    for number, (record, row) in enumerate(zip(records, rows, strict=True)):
        for column in columns:
            theirs = plain(record[f"{name}/{column}"])
            expect(same(theirs, row[column]), f"croissant.json, {name}, row {number}, {column}: {theirs} is not {row[column]}")
    return len(records)


def check_croissant(release):
    dataset = mlcroissant.Dataset(release / "croissant.json")
    issues = dataset.metadata.ctx.issues
    expect(not issues.errors, f"croissant.json: {issues.report()}")
    expected = tables(release)
    sets = {record_set.id for record_set in dataset.metadata.record_sets}
    expect(sets - {"splits"} == set(expected), f"croissant.json: record sets {sorted(sets)}")
    counts = {name: check_records(dataset, name, rows) for name, rows in expected.items()}
    for name in sets & LONG:
        check_terrain(release, name, expected[name])
    if "splits" in sets:
        parts = [record["splits/name"] for record in dataset.records("splits")]
        expect(sorted(map(plain, parts)) == sorted(PARTS), f"croissant.json: splits {parts}")
        check_references(release, sets)
    check_distribution(release, dataset.metadata)
    return {"records": counts, "warnings": sorted(issues.warnings)}


def check_terrain(release, name, rows):
    """Only the file of one terrain. (A filter modifies the data set on which it is called.)"""
    terrain = rows[-1]["terrain_id"]
    wanted = [row for row in rows if row["terrain_id"] == terrain]
    found = list(mlcroissant.Dataset(release / "croissant.json").records(name, filters={f"{name}/terrain_id": terrain}))
    named = {plain(record[f"{name}/terrain_id"]) for record in found}
    expect(len(found) == len(wanted) and named == {terrain}, f"croissant.json, {name}: {len(found)} records of {named}")


def check_references(release, sets):
    """Every column that names a split refers to the record set of the splits, except in tables with a file for each terrain."""
    described = json.loads((release / "croissant.json").read_text())["recordSet"]
    fields = {field["@id"]: field for record_set in described for field in record_set["field"]}
    expect("cr:Split" in fields["splits/url"]["dataType"], "croissant.json: the splits are not of type cr:Split")
    columns = [f"{name}/split" for name in sorted(sets) if f"{name}/split" in fields]
    expect(columns, "croissant.json: no column names a part")
    for column in columns:
        field = fields[column]
        refers = field.get("references") == {"field": {"@id": "splits/name"}} and "cr:Split" in field["dataType"]
        expect(refers, f"croissant.json: {column} does not refer to splits/name")


def check_distribution(release, metadata):
    """Every file of the release is a file object with its hash, or in a set; every set has a file."""
    objects = {file.content_url: file.sha256 for file in metadata.file_objects}
    patterns = {file_set.id: (file_set.includes, file_set.excludes or []) for file_set in metadata.file_sets}
    found = set()
    for path in sorted(path for path in release.rglob("*") if path.is_file()):
        name = str(path.relative_to(release))
        matches = lambda patterns: any(fnmatch.fnmatchcase(name, one) for one in patterns)
        holders = {key for key, (includes, excludes) in patterns.items() if matches(includes) and not matches(excludes)}
        found |= holders
        map_of = [word for word in MAPS if name.startswith("terrain/") and name.endswith(f".{word}.tif")]
        expect(not map_of or holders == {f"map-{map_of[0]}-files"}, f"croissant.json: {name} is in {holders}")
        if name in objects:
            sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
            expect(objects.pop(name) == sha256, f"croissant.json: the hash of {name} is wrong")
        else:
            expect(holders, f"croissant.json: {name} is in no file object and no file set")
            table = name.split("/")[1] if name.startswith("tables/") else None
            parts = len(list((release / "tables" / table).glob("*.parquet"))) if table else DESCRIBED_FILES + 1
            expect(parts > DESCRIBED_FILES, f"croissant.json: the hash of {name} is missing")
    expect(not objects, f"croissant.json names {sorted(objects)}")
    expect(found == set(patterns), f"croissant.json: no file is in {sorted(set(patterns) - found)}")


def check_crate(release):
    crate = ROCrate(release)
    root = crate.root_dataset
    for key in ["name", "description", "license", "datePublished"]:
        expect(root.get(key), f"ro-crate-metadata.json: the root has no {key}")
    for entity in crate.data_entities:
        expect((release / entity.id).exists(), f"ro-crate-metadata.json: there is no {entity.id}")
    actions = crate.get_by_type("CreateAction")
    expect(actions, "ro-crate-metadata.json: no action")
    for action in actions:
        for key in ["instrument", "object", "result"]:
            linked = action.get(key)
            linked = linked if isinstance(linked, list) else [linked]
            expect(linked, f"ro-crate-metadata.json: {action.id} has no {key}")
            unknown = [entity for entity in linked if isinstance(entity, str) or entity is None]
            expect(not unknown, f"ro-crate-metadata.json: {action.id}: {key} {unknown} is not described")
    stages = {artifact["stage"] for artifact in manifest(release)["artifacts"]} - {"", *COPIES}
    named = {action["name"].removeprefix("stage ") for action in actions}
    expect(named == stages, f"ro-crate-metadata.json: actions {sorted(named)}, stages {sorted(stages)}")
    check_provenance(release, actions)
    return {"entities": len(crate.get_entities()), "actions": sorted(named)}


def check_provenance(release, actions):
    """Inputs and outputs of each action agree with the parents in the manifest: all that have a file, and nothing else."""
    artifacts = manifest(release)["artifacts"]
    stage_of = {artifact["path"]: artifact["stage"] for artifact in artifacts}
    item_of = {a["path"]: f"{a['stage']}/{a['item']}" for a in artifacts if a.get("item")}
    ids = [entity["@id"] for entity in json.loads((release / "ro-crate-metadata.json").read_text())["@graph"]]
    expect(len(ids) == len(set(ids)), "ro-crate-metadata.json: two entities have one id")

    def linked(action, key):
        entities = action[key]
        return [entity.id for entity in (entities if isinstance(entities, list) else [entities])]

    def within(path, entity):
        return path == entity or (entity[-1] == "/" and path.startswith(entity))

    def stages_in(entity):
        return {stage for path, stage in stage_of.items() if within(path, entity)}

    for action in actions:
        stage = action["name"].removeprefix("stage ")
        for entity in linked(action, "result"):
            expect(stage in stages_in(entity), f"ro-crate-metadata.json: stage {stage} did not make {entity}")
        read = linked(action, "object")
        expect("study.toml" in read, f"ro-crate-metadata.json: stage {stage} does not name study.toml")
        if stage == "report":
            continue
        parts = set(stage.split("+"))
        items = {parent for a in artifacts if a["stage"] in parts for parent in a.get("parents", [])}
        files = {path for path, item in item_of.items() if item in items}
        unnamed = sorted(path for path in files if not any(within(path, entity) for entity in read))
        expect(not unnamed, f"ro-crate-metadata.json: stage {stage} does not name {unnamed}")
        parents = {item.split("/")[0] for item in items}
        for entity in read:
            fits = entity == "study.toml" or (stages_in(entity) & parents and not entity.startswith("tables/"))
            expect(fits, f"ro-crate-metadata.json: stage {stage} did not read {entity}")


def check_citation(release):
    """Valid; with the licence if the format allows it; with the creators as in Croissant, people as people."""
    citation = create_citation(str(release / "CITATION.cff"), None)
    citation.validate()
    file = citation.cffobj
    schema = json.loads((Path(cffconvert.__file__).parent / "schemas/1.2.0/schema.json").read_text())
    known = schema["definitions"]["license-enum"]["enum"]
    stated = manifest(release)["license"].split(" OR ")
    named = file.get("license", [])
    expected = stated if all(part in known for part in stated) else []
    expect(([named] if isinstance(named, str) else named) == expected, f"CITATION.cff: license {named} for {stated}")
    creators = json.loads((release / "croissant.json").read_text())["creator"]
    for author, creator in zip(file["authors"], creators, strict=True):
        person = creator["@type"] == "sc:Person"
        given = [author[key] for key in ("family-names", "given-names") if key in author]
        name = author.get("alias") or ", ".join(given) if person else author.get("name")
        expect(name == creator["name"], f"CITATION.cff: {author} is not {creator}")
    bibtex = citation.as_bibtex()
    for author in file["authors"]:
        names = [part for key, part in author.items() if key not in ("orcid", "affiliation")]
        expect(all(part in bibtex for part in names), f"cffconvert does not name {author}: {bibtex}")
    return {"bibtex": bibtex, "license": named, "license-url": file.get("license-url")}


def check_zenodo(release):
    """The creators of Croissant with their ORCID iDs and affiliations; everything that Zenodo requires on deposit, with its names for licence and grants."""
    deposit = json.loads((release / ".zenodo.json").read_text())
    known = {
        "title", "upload_type", "description", "creators", "access_right", "license", "publication_date", "version", "keywords",
        "grants", "references", "related_identifiers", "notes",
    }
    expect(set(deposit) <= known and deposit["upload_type"] == "dataset", f".zenodo.json has {sorted(deposit)}")
    dataset = json.loads((release / "croissant.json").read_text())
    expect(deposit["title"] == dataset["name"] and deposit["publication_date"] == dataset["datePublished"], f"{deposit}")
    expect(deposit.get("keywords") == dataset.get("keywords"), f".zenodo.json has the keywords {deposit.get('keywords')}")
    for theirs, ours in zip(dataset["creator"], deposit["creators"], strict=True):
        page = f"https://orcid.org/{ours['orcid']}" if "orcid" in ours else None
        named = (ours["name"], page, ours.get("affiliation"))
        expect(named == (theirs["name"], theirs.get("sameAs"), theirs.get("affiliation", {}).get("name")), f"{ours} is not {theirs}")
    stated = manifest(release)["license"].lower()
    expect(deposit["license"] in (stated, "other-open"), f".zenodo.json: license {deposit['license']} for {stated}")
    for grant in deposit.get("grants", []):
        expect(re.fullmatch(r"(10\.13039/\d+::)?\S+", grant["id"]), f".zenodo.json: the grant {grant}")
    return {"license": deposit["license"], "grants": len(deposit.get("grants", []))}


def check_card(release):
    text = (release / "README.md").read_text()
    head = re.match(r"---\n(.*?)\n---\n", text, re.DOTALL)
    expect(head, "README.md has no head")
    card = YAML(typ="safe").load(head[1])
    for key in ["pretty_name", "license", "tags", "configs"]:
        expect(card.get(key), f"README.md: its head has no {key}")
    there = {str(path.relative_to(release)) for path in (release / "tables").glob("*/*.parquet")}
    defaults = [config["config_name"] for config in card["configs"] if config.get("default")]
    expect(len(defaults) == 1, f"the card has the default configurations {defaults}")
    for config in card["configs"]:
        name, files = config["config_name"], config["data_files"]
        parts = {None: [files]} if isinstance(files, str) else {entry["split"]: entry["path"] for entry in files}
        for part, patterns in parts.items():
            found = {path for path in there if any(fnmatch.fnmatch(path, pattern) for pattern in patterns)}
            expect(found and all(path.split("/")[1] == name for path in found), f"README.md: {name} names {sorted(found)}")
            check_part(release, part, found)
            there -= found
    expect(not there, f"README.md does not name {sorted(there)}")
    return {"configs": len(card["configs"]), "license": card["license"]}


def check_part(release, part, paths):
    """Every row of the files of a split is in that split; `other` has the rows of no split."""
    if part is None:
        return
    expect(part in [*PARTS, "other"], f"README.md has the split {part}")
    named = {row for path in paths for row in pq.read_table(release / path, columns=["split"])["split"].to_pylist()}
    expect(named == {None if part == "other" else part}, f"README.md: the split {part} holds rows of {named}")


def check_release(release):
    return {
        "croissant": check_croissant(release),
        "crate": check_crate(release),
        "citation": check_citation(release),
        "zenodo": check_zenodo(release),
        "card": check_card(release),
    }


def check_files(paths):
    raise SystemExit(f"{paths[0]} is not a release")


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    warnings.simplefilter("ignore")
    run(check_release, check_files)
