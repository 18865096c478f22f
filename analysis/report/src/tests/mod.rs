//! Structure of complete reports; nothing here compares with a stored page.

pub mod made_up;
mod navigation;
mod on_disk;
mod photoclinometry;
mod rendered;
mod rovers;
pub mod xml;

use crate::content::Block;
use crate::data::{Against, Data, Mission};
use crate::write::{Summary, write};
use sastrugi_schemas::Cell;
use sastrugi_schemas::manifest::FailedItem;
use sastrugi_schemas::study::HypothesisItem;
use sastrugi_schemas::tables::{LogRow, SampleRow, TerrainRow};
use std::collections::BTreeMap;
use std::path::Path;

/// Every file of a report by its path, and the summary.
fn report(data: &Data) -> (BTreeMap<String, String>, Summary) {
    let folder = tempfile::tempdir().unwrap();
    let summary = write(data, folder.path(), &|_| ()).unwrap();
    let read = |path: &std::path::PathBuf| {
        let text = std::fs::read_to_string(folder.path().join(path)).unwrap();
        (path.display().to_string(), text)
    };
    (summary.files.iter().map(read).collect(), summary)
}

fn assert_sound(files: &BTreeMap<String, String>) {
    for (name, text) in files {
        match Path::new(name).extension().and_then(|e| e.to_str()) {
            Some("svg") => xml::assert_well_formed(text),
            Some("html") => xml::assert_nests(text),
            _ => drop(serde_json::from_str::<serde_json::Value>(text).unwrap()),
        }
        let words = text.replace("data:image/png;base64,", "");
        let outside = words.replace("http://www.w3.org/2000/svg", "");
        assert!(!outside.contains("http://") && !outside.contains("https://"), "{name} needs the network");
        let forbidden = if name.ends_with(".json") { &["@import"][..] } else { &["<script", "@import", "url(//"] };
        assert!(!forbidden.iter().any(|word| text.contains(word)), "{name}");
        for bad in [">NaN", "\"NaN", "NaN<", " NaN", "inf\"", ">inf", " inf "] {
            assert!(!text.contains(bad), "{name} prints {bad}");
        }
    }
}

#[test]
fn prop_a_full_report_is_sound() {
    let (files, summary) = report(&made_up::full(3, 48));
    assert_sound(&files);
    let page = &files["index.html"];
    for section in [
        "terrain",
        "covariance",
        "texture",
        "routes",
        "formations",
        "losses",
        "rovers",
        "missions",
        "comparison",
        "published",
        "probability",
    ] {
        assert!(page.contains(&format!("<section id=\"{section}\">")), "{section}");
    }
    for figure in &summary.figures {
        let svg = &files[&format!("figures/{figure}.svg")];
        assert!(svg.contains("role=\"img\"") && svg.contains("<title ") && svg.contains("<desc "), "{figure}");
        assert!(page.contains(&format!("href=\"data/{figure}.json\"")), "{figure}");
        assert!(files.contains_key(&format!("data/{figure}.json")), "{figure}");
    }
    let of_fit = ["covariance", "candidates", "profile", "directions", "residual", "mask"];
    let of_texture = ["measured", "synthetic", "tiles", "psd", "structure", "heights", "profiles"];
    let expected = of_fit
        .map(|f| format!("{f}-jacksboro-corrected"))
        .into_iter()
        .chain(of_texture.map(|f| format!("{f}-texture")));
    for figure in expected {
        assert!(summary.figures.contains(&figure), "{figure} is missing");
    }
    for table in ["intervals-of-jacksboro", "candidates-of-jacksboro", "figures-of-texture", "surfaces"] {
        assert!(files.contains_key(&format!("data/{table}.json")), "{table}");
    }
    // Three surfaces in one frame, each with its own name.
    let heights = &files["figures/heights-texture.svg"];
    assert!(["measured residual", "synthetic, residual", "as synthesised"].iter().all(|name| heights.contains(name)));
    assert_eq!(summary.bytes, files.values().map(|t| t.len() as u64).sum::<u64>());
    assert!(page.contains("Settings differ"));
}

/// The residual of a texture is stored at amplitude 1, its heights are not: the verdict, the summary, the table and the legends say so.
#[test]
fn val_the_amplitude_of_a_texture_is_stated() {
    let mut data = made_up::full(1, 24);
    let words = [
        "This is at amplitude 1; the file has 0.5 times these heights.",
        "as synthesised, times 0.5",
        "heights times 0.5",
    ];
    let page = |data: &Data| report(data).0.remove("index.html").unwrap();
    let plain = page(&data);
    assert!(!words.iter().any(|words| plain.contains(words)) && plain.contains("as synthesised"));
    let texture = data.terrains.iter_mut().find(|t| t.terrain_id == "texture").unwrap();
    texture.params = r#"{"fit":"jacksboro-corrected","method":"fft_ma","amplitude":0.5}"#.into();
    let (files, _) = report(&data);
    assert_sound(&files);
    let page = &files["index.html"];
    assert_eq!(page.matches(words[0]).count(), 2, "in the summary and in the section");
    assert!(words.iter().all(|words| page.contains(words)));
    let table: serde_json::Value = serde_json::from_str(&files["data/figures-of-texture.json"]).unwrap();
    assert_eq!(table["columns"][3]["name"], "as synthesised, times 0.5");
    assert!(table["title"].as_str().unwrap().ends_with("The residual of the texture is that at amplitude 1"));
}

/// Conditions of plain queries use only columns of their table.
#[test]
fn prop_conditions_name_columns_of_their_table() {
    let (files, _) = report(&made_up::full(3, 48));
    let mut checked = 0;
    for (name, text) in files.iter().filter(|(name, _)| name.starts_with("data/")) {
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        let query = without_inner(json["query"].as_str().unwrap_or_default());
        let Some((_, after)) = query.split_once("from 'tables/").filter(|_| !query.contains(" join ")) else {
            continue;
        };
        let (table, condition) = after.split_once("/*.parquet'").unwrap();
        let Some((_, condition)) = condition.split_once(" where ") else { continue };
        let columns = sastrugi_schemas::tables::by_name(table).unwrap().columns;
        let words = ["and", "or", "in", "is", "not", "null", "isfinite", "coalesce"];
        let condition = condition.split(" group by ").next().unwrap();
        let outside_of_quotes: String = condition.split('\'').step_by(2).collect();
        let identifiers = outside_of_quotes.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        for word in identifiers.filter(|w| w.starts_with(|c: char| c.is_ascii_alphabetic()) && !words.contains(w)) {
            assert!(
                columns.iter().any(|column| column.name == word),
                "{name}: {table} has no column {word}: {condition}"
            );
            checked += 1;
        }
    }
    assert!(checked > 20, "{checked} columns");
}

/// A release without missions has no table of them, so no query names it.
#[test]
fn prop_queries_name_tables_that_there_are() {
    let mut data = made_up::full(3, 24);
    data.missions.clear();
    data.replicates.clear();
    let (files, _) = report(&data);
    assert!(files.contains_key("data/published.json"));
    for (name, text) in files.iter().filter(|(name, _)| name.starts_with("data/")) {
        assert!(!text.contains("tables/missions/"), "{name}");
    }
}

/// A query without its subqueries.
fn without_inner(query: &str) -> String {
    let Some(start) = query.find("(select") else { return query.to_owned() };
    let mut depth = 0;
    let end = query[start..].find(|c: char| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        depth == 0
    });
    let rest = end.map_or("", |end| &query[start + end + 1..]);
    without_inner(&format!("{}{rest}", &query[..start]))
}

/// Every id on the page occurs once, and every link within it has a target.
#[test]
fn prop_ids_are_unique() {
    let (files, _) = report(&made_up::full(2, 32));
    let page = &files["index.html"];
    let mut ids: Vec<&str> = page.split(" id=\"").skip(1).filter_map(|t| t.split('"').next()).collect();
    let n = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), n);
    let targets = page.split("href=\"#").skip(1).filter_map(|t| t.split('"').next());
    assert!(targets.into_iter().all(|t| ids.binary_search(&t).is_ok()));
}

#[test]
fn prop_the_same_release_gives_the_same_bytes() {
    assert_eq!(report(&made_up::full(2, 40)), report(&made_up::full(2, 40)));
}

#[test]
fn prop_an_empty_release_has_a_page_without_empty_boxes() {
    let (files, summary) = report(&made_up::empty());
    assert_sound(&files);
    assert_eq!(summary.figures, Vec::<String>::new());
    assert!(!files["index.html"].contains("<section"));
}

/// A release without missions has a summary too: what it has, and how its routes or rovers fared, with the first picture of the page.
#[test]
fn val_every_release_has_a_summary() {
    let terrains = || {
        let mut data = made_up::full(2, 24);
        data.missions.clear();
        data.replicates.clear();
        data.formations.clear();
        data.fits.clear();
        data.rover_effects.clear();
        data.terrains.retain(|t| t.stage == "terrain" && t.variant.is_none());
        data
    };
    let routes = || {
        let mut data = terrains();
        data.rovers.clear();
        data
    };
    let summary = |data: &Data, words: &[&str], picture: &str| {
        let (files, summary) = report(data);
        assert_sound(&files);
        let page = &files["index.html"];
        let section = page.split("<section id=\"summary\">").nth(1).unwrap().split("</section>").next().unwrap();
        assert!(words.iter().all(|words| section.contains(words)), "{words:?} {section}");
        let pictures: Vec<&String> = summary.figures.iter().filter(|f| f.starts_with("summary-")).collect();
        assert!(!pictures.is_empty() && pictures.iter().all(|f| f.starts_with(picture)), "{pictures:?}");
    };
    let has = "The release has 6 terrains in 3 groups (RMS slope ";
    summary(&routes(), &[has, " searches by 3 methods found a route; the median length is "], "summary-routes-2.30");
    let mut rovers = terrains();
    rovers.routes.clear();
    summary(
        &rovers,
        &[has, "2.30: 100 % (95 % interval ", " of 20 rovers on 2 worlds reach their goal; the mean"],
        "summary-rover-tracks-",
    );
    let mut alone = routes();
    alone.routes.clear();
    summary(&alone, &[has, ", relief "], "summary-relief-d2.30-");
}

/// The summary has the results of every section: starts of missions, the other release, the logs, papers, with what qualifies them.
#[test]
fn val_the_summary_has_every_result() {
    let mut data = made_up::full(6, 24);
    data.against = Some(Against { name: "other".into(), data: Box::new(made_up::full(6, 24)) });
    data.logs = Some(vec![LogRow { rms_pitch_rate_deg_s: 1.0, ..made_up::log() }]);
    let page = report(&data).0.remove("index.html").unwrap();
    let summary = page.split("<section id=\"summary\">").nth(1).unwrap().split("</section>").next().unwrap();
    for words in [
        " with several starts, ",
        " comparisons with other, ",
        " comparisons of 1 log with groups of missions, metric by metric: ",
        " published values lie",
        "Settings differ from those of ",
    ] {
        assert!(summary.contains(words), "{words}: {summary}");
    }
    // Without companions, not a word about them.
    let page = report(&made_up::full(6, 24)).0.remove("index.html").unwrap();
    assert!(!page.contains("comparisons with other") && !page.contains(" with groups of missions, metric by metric"));
}

/// Each optional part is removed in turn; the page adapts.
#[test]
fn prop_any_part_may_be_absent() {
    type Take = (&'static str, fn(&mut Data));
    let takes: [Take; 27] = [
        ("rovers", |d| d.rovers.clear()),
        ("effects", |d| d.rover_effects.clear()),
        ("routes", |d| d.routes.clear()),
        ("paths", |d| d.routes.iter_mut().for_each(|r| (r.outcome, r.path) = ("no_path".into(), None))),
        ("formations", |d| d.formations.clear()),
        ("followers", |d| d.formations.iter_mut().for_each(|f| (f.members, f.depth_error_m) = (1, f64::NAN))),
        ("events", |d| d.formation_events.clear()),
        ("missions", |d| d.missions.clear()),
        ("replicates", |d| d.replicates.clear()),
        ("plain missions", |d| d.missions.retain(|m| m.variant.is_some())),
        ("variants", |d| d.missions.retain(|m| m.variant.is_none())),
        ("pairs", |d| {
            d.missions.iter_mut().for_each(|m| m.pair_id = format!("{}-{}", m.terrain_id, m.mission_id).into())
        }),
        ("lines", |d| d.missions.iter_mut().for_each(|m| (m.goal_x_m, m.progress_m) = (f64::NAN, f64::NAN))),
        ("fits", |d| d.fits.clear()),
        ("covariance", |d| d.covariance.clear()),
        ("psd", |d| d.psd.clear()),
        ("candidates", |d| d.candidates.clear()),
        ("candidate curves", |d| d.candidate_curves.clear()),
        ("profile", |d| d.likelihood_profile.clear()),
        ("surfaces", |d| d.surfaces.clear()),
        ("structure", |d| d.structure.clear()),
        ("profile spectra", |d| d.profile_psd.clear()),
        ("heights", |d| d.heights.clear()),
        ("terrains", |d| d.terrains.clear()),
        ("files", |d| d.files = Box::new(made_up::Shelf::default())),
        ("generated terrains", |d| d.terrains.retain(|t| t.stage != "terrain")),
        ("successes", |d| d.missions.iter_mut().for_each(|m| m.outcome = "tipped".into())),
    ];
    for (name, take) in takes {
        let mut data = made_up::full(2, 24);
        take(&mut data);
        let (files, _) = report(&data);
        assert_sound(&files);
        let page = &files["index.html"];
        for empty in ["<tbody>\n</tbody>", "<div class=\"figures\">\n</div>", "<div class=\"figures wide\">\n</div>"] {
            assert!(!page.contains(empty), "{empty} without {name}");
        }
    }
}

#[test]
fn prop_hostile_words_stay_words() {
    let mut data = made_up::full(2, 24);
    let hostile = "</svg><script>alert(\"1\")</script>&'\u{0}../..";
    data.study.title = hostile.into();
    data.study.creators = vec![hostile.into()];
    data.terrains.iter_mut().for_each(|t| t.group = Some(hostile.into()));
    data.terrains.iter_mut().for_each(|t| t.terrain_id.push_str(hostile));
    data.missions.iter_mut().for_each(|m| m.outcome = hostile.into());
    data.fits.iter_mut().for_each(|f| f.model = hostile.into());
    data.routes.iter_mut().for_each(|r| (r.stage_id, r.group) = (hostile.into(), Some(hostile.into())));
    data.formations.iter_mut().for_each(|f| f.formation = hostile.into());
    data.formation_events.iter_mut().for_each(|e| e.text = hostile.into());
    let (files, _) = report(&data);
    assert_sound(&files);
    assert!(files.keys().all(|name| !name.contains("..") && !name.contains('<')));
}

#[test]
fn prop_unknown_numbers_are_absent_not_nan() {
    let mut data = made_up::full(2, 24);
    for t in &mut data.terrains {
        (t.rms_slope, t.relief_m, t.height_min_m, t.psd_slope) = (f64::NAN, f64::INFINITY, f64::NAN, f64::NEG_INFINITY);
    }
    data.missions.iter_mut().for_each(|m| (m.time_s, m.start_x_m) = (f64::NAN, f64::INFINITY));
    data.fits.iter_mut().for_each(|f| (f.sigma_m, f.range_m) = (f64::NAN, f64::NAN));
    data.covariance.iter_mut().for_each(|c| (c.model_m2, c.covariance_low_m2) = (f64::NAN, f64::INFINITY));
    for fit in &mut data.fits {
        (fit.sigma_low_m, fit.range_high_m, fit.misfit_p, fit.isotropy_ratio) =
            (f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::NAN);
    }
    data.surfaces.iter_mut().for_each(|s| (s.sq_m, s.sal_m, s.hurst_lag_max_m) = (f64::NAN, f64::INFINITY, f64::NAN));
    data.likelihood_profile.iter_mut().for_each(|p| p.range_m = f64::NAN);
    data.structure.iter_mut().for_each(|s| s.value_m2 = f64::INFINITY);
    data.candidates.iter_mut().for_each(|c| (c.parameters, c.chi2) = ("not JSON".into(), Some(f64::NAN)));
    data.routes.iter_mut().for_each(|r| (r.smoothed_cost_m, r.start_x_m, r.free_cells) = (f64::NAN, f64::INFINITY, 0));
    for f in &mut data.formations {
        (f.depth_error_m, f.spacing_m, f.time_s, f.least_separation_m) = (f64::NAN, f64::NAN, f64::INFINITY, f64::NAN);
    }
    data.formation_events.iter_mut().for_each(|e| e.time_s = f64::NAN);
    assert_sound(&report(&data).0);
}

/// Groups share colours only if they are alike: another cell size, other heights or a relief of another magnitude get their own colours.
#[test]
fn val_similar_groups_share_colours() {
    // Ends of the colours of each group, as printed in its figure.
    let ends = |change: fn(&mut Data, &mut made_up::Shelf)| {
        let (mut data, mut shelf) = made_up::parts(1, 40);
        change(&mut data, &mut shelf);
        data.files = Box::new(shelf);
        let (files, _) = report(&data);
        assert_sound(&files);
        let muted = |svg: &str| -> Vec<String> {
            let texts = svg.split("class=\"f-muted\"").skip(1).filter_map(|t| t.split_once('>')?.1.split_once('<'));
            texts.map(|t| t.0.to_owned()).collect()
        };
        ["2.30", "2.45", "2.60"].map(|g| muted(&files[&format!("figures/relief-d{g}-0000.svg")]))
    };
    let alike = ends(|_, _| ());
    assert!(alike[0] == alike[1] && alike[1] == alike[2] && alike[0].len() == 2, "{alike:?}");
    for apart in [
        ends(|data, shelf| lifted(data, shelf, "d2.60-0000", [1.0, 300.0])),
        ends(|data, shelf| lifted(data, shelf, "d2.60-0000", [20.0, 0.0])),
        // Similar to the second group, but not to the first.
        ends(|data, shelf| {
            lifted(data, shelf, "d2.45-0000", [2.5, 0.0]);
            lifted(data, shelf, "d2.60-0000", [6.5, 0.0]);
        }),
        ends(|data, _| {
            data.terrains.iter_mut().filter(|t| t.terrain_id == "d2.60-0000").for_each(|t| t.cell_x_m = 9.0)
        }),
    ] {
        assert!(apart[0] == apart[1] && apart[1] != apart[2], "{apart:?}");
    }
}

/// A terrain's heights, times a factor and shifted.
fn lifted(data: &mut Data, shelf: &mut made_up::Shelf, id: &str, [factor, shift_m]: [f64; 2]) {
    for terrain in data.terrains.iter_mut().filter(|t| t.terrain_id == id) {
        let grid = shelf.grids.get_mut(&terrain.path).unwrap();
        grid.values.iter_mut().for_each(|z| *z = factor * *z + shift_m);
        let (low, high) = grid.range().unwrap();
        (terrain.height_min_m, terrain.height_max_m, terrain.relief_m) = (low, high, high - low);
    }
}

/// A terrain that is too small for shares is named in the text and in place of its bars; one that lacks data is not.
#[test]
fn val_surfaces_too_small_for_shares_are_named() {
    let mut data = made_up::full(1, 24);
    for t in data.terrains.iter_mut().filter(|t| t.terrain_id.starts_with("d2.60")) {
        (t.share_low, t.share_semi, t.share_high, t.share_border_m) = (f64::NAN, f64::NAN, f64::NAN, 26.0);
    }
    let (files, _) = report(&data);
    assert_sound(&files);
    let page = &files["index.html"];
    assert!(page.contains("No class shares for d2.60-0000: surface too small, all cells lie in a border of 26"));
    assert!(page.contains("shares leave out a border of 5 to 26 m"));
    assert!(files["figures/class-shares.svg"].contains("surface too small"));
    data.terrains.iter_mut().for_each(|t| t.share_border_m = 5.0);
    let page = &report(&data).0["index.html"];
    assert!(!page.contains("surface too small") && page.contains("leave out a border of 5 m"));
}

/// The numbers of class shares have a column of the paper only where one applies, and of bands only where there are any.
#[test]
fn val_columns_of_shares_are_those_that_apply() {
    let columns = |data: &Data| {
        let json: serde_json::Value = serde_json::from_str(&report(data).0["data/class-shares.json"]).unwrap();
        let columns = json["columns"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap().to_owned());
        columns.skip(4).collect::<Vec<_>>()
    };
    let mut data = made_up::full(3, 24);
    assert_eq!(columns(&data), ["band, 5 %", "band, 95 %", "paper"]);
    data.missions.clear();
    data.terrains.iter_mut().for_each(|t| t.group = Some(format!("{} m", t.group.as_deref().unwrap_or_default())));
    assert_eq!(columns(&data), ["band, 5 %", "band, 95 %"]);
    data.terrains.retain(|t| t.terrain_id.ends_with("-0000"));
    assert_eq!(columns(&data), [""; 0]);
}

/// Captions of class maps state the radius of the closing.
#[test]
fn val_class_maps_name_the_radius() {
    let mut data = made_up::full(1, 24);
    data.missions.clear();
    let said = |data: &Data| report(data).0["index.html"].clone();
    assert!(said(&data).contains("class map, closed with a disk of radius 0.57 m, over"));
    data.study.roughness.closing_radius_m = 0.1;
    assert!(said(&data).contains("disk of radius 0.1 m, over"));
    data.study.roughness.closing_radius_m = 0.0;
    assert!(said(&data).contains("class map, not closed, over"));
}

/// Where no mission failed, the page says so in the summary and in place of curves; where some failed, it says neither, and names the groups
/// without failures.
#[test]
fn val_releases_without_failures_say_so() {
    let mut data = made_up::full(2, 24);
    data.missions.retain(|m| m.variant.is_none());
    data.terrains.retain(|t| t.variant.is_none());
    let told = |data: &Data| {
        let (files, summary) = report(data);
        assert_sound(&files);
        let page = &files["index.html"];
        let in_summary = page.split("<section id=\"summary\">").nth(1).unwrap().split("</section>").next().unwrap();
        let curves = summary.figures.iter().filter(|figure| figure.starts_with("incidence-")).count();
        let words = [in_summary.contains("reached the goal; none failed."), page.contains("<p>No mission failed.</p>")];
        (words, curves, page.contains("No failures in 2.30 (16 missions)."))
    };
    assert_eq!(told(&data), ([false; 2], 3, false));
    let steep = |m: &Mission| m.terrain_id.starts_with("d2.30");
    data.missions.iter_mut().filter(|m| steep(m)).for_each(|m| m.outcome = "success".into());
    assert_eq!(told(&data), ([false; 2], 2, true));
    data.missions.iter_mut().for_each(|m| m.outcome = "success".into());
    assert_eq!(told(&data), ([true; 2], 0, false));
}

/// Class maps are closed, but the classes along a mission are not: its caption says so.
#[test]
fn val_captions_of_missions_name_the_raw_classes() {
    let (files, summary) = report(&made_up::full(1, 24));
    let missions = summary.figures.iter().filter(|figure| figure.starts_with("mission-d2.")).count();
    assert!(missions > 0, "{:?}", summary.figures);
    let words =
        "the roughness class under the vehicle, cell by cell before the class map was closed. Recording: mcap/d2.";
    assert_eq!(files["index.html"].matches(words).count(), missions);
}

/// A map of each kind is drawn if it has more than one value; the colours of a relief include holes far below the other 99 % of the ground.
#[test]
fn val_maps_and_sparse_holes_are_drawn() {
    let (mut data, mut shelf) = made_up::parts(1, 40);
    data.terrains.retain(|t| t.terrain_id == "d2.30-0000");
    let path = data.terrains[0].path.clone();
    let grid = shelf.grids.get_mut(&path).unwrap();
    grid.values.iter_mut().enumerate().for_each(|(k, z)| *z = if k == 820 { -3.0 } else { 0.01 * libm::sin(k as f64) });
    let heights = grid.clone();
    shelf.grids.insert("terrain/d2.30-0000.albedo.tif".into(), heights.map(|z| 0.2 + z));
    shelf.grids.insert("terrain/d2.30-0000.rock-potential.tif".into(), heights.map(|_| 0.069));
    shelf.grids.insert("terrain/d2.30-0000.class.tif".into(), heights.map(|z| f64::from(u8::from(z > 0.0))));
    data.files = Box::new(shelf);
    let (files, summary) = report(&data);
    assert_sound(&files);
    assert!(summary.figures.iter().any(|f| f == "map-albedo-d2.30-0000"));
    assert!(!summary.figures.iter().any(|f| f.starts_with("map-rock-potential")));
    assert!(files["index.html"].contains("map albedo: albedo."));
    let ground = &files["figures/map-class-d2.30-0000.svg"];
    assert!(ground.contains(">sand ") && ground.contains(">rock ") && !ground.contains("no data"));
    assert!(files["figures/relief-d2.30-0000.svg"].contains(">−3.00<"));
}

/// A release of DEMs alone shows those that no fit draws.
#[test]
fn val_measured_surfaces_are_drawn() {
    let mut data = made_up::full(1, 24);
    data.terrains.retain(|t| t.stage == "dem");
    let drawn = |data: &Data| report(data).1.figures.iter().any(|figure| figure == "relief-jacksboro");
    assert!(!drawn(&data));
    data.fits.clear();
    assert!(drawn(&data));
}

/// A texture whose covariance the study states has no fit.
#[test]
fn val_stated_covariances_have_no_fit() {
    let mut data = made_up::full(1, 24);
    let base = data.terrains.iter().find(|t| t.stage == "terrain").unwrap().clone();
    let params = format!(r#"{{"fit": {{"model": "exponential"}}, "onto": "{}"}}"#, base.terrain_id);
    data.terrains.push(TerrainRow { terrain_id: "snow".into(), stage: "texture".into(), params, ..base });
    assert!(report(&data).0["index.html"].contains("with a texture of its stated covariance; same"));
}

/// Rows of a file of numbers.
fn rows(files: &BTreeMap<String, String>, name: &str) -> Vec<Vec<serde_json::Value>> {
    let json: serde_json::Value = serde_json::from_str(&files[&format!("data/{name}.json")]).unwrap();
    serde_json::from_value(json["rows"].clone()).unwrap()
}

#[test]
fn val_variants_stay_out_of_plain_comparisons() {
    let with = report(&made_up::full(3, 24)).0;
    let mut data = made_up::full(3, 24);
    data.missions.retain(|m| m.variant.is_none());
    data.terrains.retain(|t| t.variant.is_none());
    let without = report(&data).0;
    let compared = ["comparison", "comparison-trend", "comparison-model", "comparison-power"];
    let others = ["outcomes", "mission-medians", "class-shares", "survivors", "incidence-2.30", "published"];
    for name in compared.into_iter().chain(others) {
        assert_eq!(rows(&with, name), rows(&without, name), "{name}");
    }
    assert!(with.contains_key("data/sensitivity.json") && !without.contains_key("data/sensitivity.json"));
    // 24 missions of the first group: 21 succeed in the plain run, none on steeper terrain.
    let first = &rows(&with, "sensitivity")[0];
    assert_eq!((first[0].as_str(), first[2].as_i64()), (Some("z_scale_percent = 1.0"), Some(0)));
    assert_eq!(first[5].as_f64(), Some(-87.5));
}

/// Three terrains per group: 8 arrangements of signs if groups share draws, 20 of terrains if they do not. The 24 missions per group
/// do not matter.
#[test]
fn val_terrains_are_the_units_of_tests() {
    let mut data = made_up::full(3, 24);
    let paired = rows(&report(&data).0, "comparison");
    data.missions.iter_mut().for_each(|m| m.pair_id = format!("{}-{}", m.terrain_id, m.mission_id).into());
    let apart = rows(&report(&data).0, "comparison");
    for (rows, of, arrangements) in [(paired, "3 blocks, ", 8.0), (apart, "3 + 3 terrains", 20.0)] {
        assert_eq!(rows.len(), 5 * 3);
        for row in rows {
            let (p, adjusted) = (row[10].as_f64().unwrap(), row[11].as_f64().unwrap());
            let steps = p * arrangements;
            assert!(
                row[3].as_str().unwrap().starts_with(of) && (steps - steps.round()).abs() < 1e-9 && adjusted >= p,
                "{row:?}"
            );
            // So few terrains reject no shift at 5 %; delta is bounded.
            assert!(row[4].is_number() && row[5].is_null() && row[6].is_null(), "{row:?}");
            let [delta, low, high] = [7, 8, 9].map(|k| row[k].as_f64().unwrap());
            assert!(-1.0 <= low && low <= delta && delta <= high && high <= 1.0 && low < high, "{row:?}");
        }
    }
}

/// Without groups, and with one terrain per group, there is nothing to test.
#[test]
fn val_groups_without_terrains_are_not_compared() {
    let mut data = made_up::full(2, 24);
    data.missions.retain(|m| m.terrain_id.starts_with("d2.30"));
    assert!(!report(&data).0["index.html"].contains("<section id=\"comparison\">"));
    let mut data = made_up::full(1, 24);
    data.missions.retain(|m| !m.terrain_id.starts_with("d2.60"));
    let files = report(&data).0;
    assert_sound(&files);
    assert!(!files.contains_key("data/comparison-power.json"));
}

/// Where all missions succeed, success has no scatter, from which any study would have a power of 100 %: none is given, and the page says why.
#[test]
fn val_power_needs_scatter() {
    let mut data = made_up::full(6, 24);
    data.missions.iter_mut().for_each(|m| m.pair_id = format!("{}-{}", m.terrain_id, m.mission_id).into());
    let metrics = |data: &Data| {
        let files = report(data).0;
        let rows = rows(&files, "comparison-power");
        let has = |name: &str| rows.iter().any(|row| row[0] == name);
        let words = "No power is given without scatter between terrains or between missions: success on a terrain.";
        let says = files["index.html"].contains(words);
        (has("success on a terrain"), has("RMS pitch rate"), says)
    };
    assert_eq!(metrics(&data), (true, true, false));
    data.missions.iter_mut().for_each(|m| m.outcome = "success".into());
    assert_eq!(metrics(&data), (false, true, true));
}

/// Tables without content are left out, with a sentence: the same missions in every group where none succeeded in all, and components of the variance on
/// single terrains. One terrain in each group has no intervals and bands: the page says so and does not describe any.
#[test]
fn val_tables_without_content_are_left_out() {
    let mut data = made_up::full(1, 24);
    data.missions.retain(|m| m.variant.is_none());
    data.missions.iter_mut().for_each(|m| m.outcome = "success".into());
    let files = report(&data).0;
    let page = &files["index.html"];
    let missions = page.split("<section id=\"missions\">").nth(1).unwrap().split("</section>").next().unwrap();
    assert!(files.contains_key("data/survivors.json") && !files.contains_key("data/variance-components.json"));
    assert!(page.contains("The variance of the outcomes is not split into terrains, missions and starts"));
    assert!(missions.contains("correlated, so with one terrain in each group there are no intervals and no bands."));
    assert!(!missions.contains("sampling band") && !missions.contains("bootstrap samples of whole"));
    let stuck =
        |m: &mut Mission| m.outcome = if m.terrain_id.starts_with("d2.45") { "stuck" } else { "success" }.into();
    data.missions.iter_mut().for_each(stuck);
    let files = report(&data).0;
    assert_sound(&files);
    assert!(!files.contains_key("data/survivors.json"));
    assert!(files["index.html"].contains("With one terrain in each group there are no bands."));
    assert!(
        files["index.html"].contains("No mission with the same start and goal in every group succeeded in all of them")
    );
}

fn claim(json: serde_json::Value) -> HypothesisItem {
    let mut all = serde_json::json!({ "id": "claim", "groups": ["2.30", "2.45", "2.60"], "test": "trend" });
    json.as_object().unwrap().iter().for_each(|(key, value)| all[key] = value.clone());
    serde_json::from_value(all).unwrap()
}

/// Claims have the same p as in the exploratory part. Holm's adjustment is within the family (by hand: the smaller of two p
/// doubles), and a claim with the opposite direction is not supported.
#[test]
fn val_declared_claims_are_adjusted_by_family() {
    let mut data = made_up::full(6, 24);
    let pitch = "rms_pitch_rate_deg_s";
    data.study.hypotheses = vec![
        claim(serde_json::json!({ "statistic": pitch, "direction": "rises", "family": "a" })),
        claim(serde_json::json!({ "statistic": "rms_vertical_acceleration_m_s2", "family": "a" })),
        claim(serde_json::json!({ "statistic": pitch, "direction": "falls" })),
        claim(
            serde_json::json!({ "statistic": pitch, "groups": ["2.30", "2.60"], "test": "difference", "family": "b" }),
        ),
        claim(
            serde_json::json!({ "statistic": pitch, "groups": ["2.30", "2.45"], "test": "equivalence", "margin": 99.0, "family": "c" }),
        ),
        claim(
            serde_json::json!({ "statistic": "max_pitch_deg", "groups": ["2.30", "2.45"], "test": "difference", "family": "d" }),
        ),
        claim(
            serde_json::json!({ "statistic": "success", "groups": ["2.30", "9"], "test": "difference", "family": "e" }),
        ),
    ];
    let (files, _) = report(&data);
    assert_sound(&files);
    let page = &files["index.html"];
    let (first, rest) = (page.find("confirmatory").unwrap(), page.find("Everything else is exploratory").unwrap());
    assert!(first < rest && page.contains(&data.study_sha256));
    assert!(!page.contains("declared no hypothesis"));
    let rows_of = rows(&files, "hypotheses");
    let p = |k: usize| [6, 7].map(|c| rows_of[k][c].as_f64().unwrap());
    let trends = rows(&files, "comparison-trend");
    let explored = trends.iter().find(|r| r[0] == "RMS pitch rate").unwrap();
    assert_eq!(explored[6].as_f64(), Some(p(0)[0]));
    let (small, large) = if p(0)[0] <= p(1)[0] { (p(0), p(1)) } else { (p(1), p(0)) };
    assert!((small[1] - 2.0 * small[0]).abs() < 1e-12 && large[1] >= large[0], "{small:?} {large:?}");
    assert_eq!(p(2)[0], p(2)[1]);
    let verdicts: Vec<&str> = rows_of.iter().map(|r| r[1].as_str().unwrap()).collect();
    assert_eq!(verdicts[0], "supported");
    assert_eq!(verdicts[2], "not supported: the effect has the opposite direction");
    assert_eq!(verdicts[3], "supported");
    assert_eq!(verdicts[4], "equivalent within the margin");
    assert_eq!(verdicts[5], "not supported");
    assert_eq!(verdicts[6], "cannot tell: a group has no missions with this metric");
    // Claims in words, and units of their estimates.
    let [words, measures] = [0, 5].map(|c| rows_of.iter().map(|r| r[c].as_str().unwrap()).collect::<Vec<_>>());
    assert_eq!(words[3], "RMS pitch rate differs between 2.30 and 2.60");
    assert_eq!(words[4], "RMS pitch rate: 2.30 and 2.45 differ by less than 99°/s");
    assert_eq!(
        measures[..6],
        [
            "rank correlation",
            "rank correlation",
            "rank correlation",
            "shift, °/s",
            "difference of means, °/s",
            "shift, °"
        ]
    );
}

/// On 11 of 20 terrains success is as high as in the other group: the shift is 0, but success still falls.
#[test]
fn val_ties_do_not_reverse_a_claim() {
    let mut data = made_up::full(20, 24);
    let on_steep = data.missions.iter().map(|m| m.terrain_id.to_string()).filter(|id| id.starts_with("d2.60"));
    let terrains: std::collections::BTreeSet<String> = on_steep.collect();
    let worse: Vec<&String> = terrains.iter().take(9).collect();
    for (k, mission) in data.missions.iter_mut().enumerate() {
        mission.pair_id = format!("{k}").into();
        let fails = worse.iter().any(|id| mission.terrain_id == id.as_str()) && k % 2 == 0;
        mission.outcome = if fails { "stuck" } else { "success" }.into();
    }
    let groups = ["2.30", "2.60"];
    let success =
        serde_json::json!({ "statistic": "success", "groups": groups, "test": "difference", "direction": "falls" });
    data.study.hypotheses = vec![claim(success)];
    let row = &rows(&report(&data).0, "hypotheses")[0];
    assert_eq!((row[1].as_str(), row[2].as_f64()), (Some("supported"), Some(0.0)), "{row:?}");
}

/// Three blocks have eight arrangements of signs, so no data could reach 5 %.
#[test]
fn val_claims_that_no_data_could_support_are_undecided() {
    let mut data = made_up::full(3, 24);
    let groups = ["2.30", "2.60"];
    data.study.hypotheses =
        vec![claim(serde_json::json!({ "statistic": "success", "groups": groups, "test": "difference" }))];
    assert_eq!(rows(&report(&data).0, "hypotheses")[0][1], "cannot tell: too few terrains");
}

/// The summary names each claim with its verdict and the reason for it.
#[test]
fn val_the_summary_names_the_claims() {
    let mut data = made_up::full(3, 24);
    let groups = ["2.30", "2.60"];
    let success = serde_json::json!({ "statistic": "success", "groups": groups, "test": "difference" });
    data.study.hypotheses = vec![claim(success.clone())];
    let summary = |data: &Data| {
        let page = report(data).0.remove("index.html").unwrap();
        page.split("<section id=\"summary\">")
            .nth(1)
            .unwrap()
            .split("</section>")
            .next()
            .unwrap()
            .replace("&quot;", "\"")
    };
    let words = "\"success on a terrain differs between 2.30 and 2.60\" (cannot tell: too few terrains)";
    let one = format!("One hypothesis was declared; the data cannot decide it: {words}.");
    assert!(summary(&data).contains(&one), "{}", summary(&data));
    data.study.hypotheses = vec![claim(success); 6];
    let six = format!("Of 6 declared hypotheses, 6 are undecided: {}; and 2 more.", [words; 4].join("; "));
    assert!(summary(&data).contains(&six), "{}", summary(&data));
}

/// One terrain in a group has no scatter, so no data could show equivalence: too few terrains, although every group has missions. The same
/// where the terrains are paired, and for a difference.
#[test]
fn val_one_terrain_in_a_group_is_too_few() {
    let groups = ["2.30", "2.60"];
    let claims = [
        serde_json::json!({ "statistic": "success", "groups": groups, "test": "equivalence", "margin": 50.0, "family": "a" }),
        serde_json::json!({ "statistic": "success", "groups": groups, "test": "difference", "family": "b" }),
    ];
    let mut data = made_up::full(1, 24);
    data.study.hypotheses = claims.into_iter().map(claim).collect();
    for paired in [true, false] {
        if !paired {
            data.missions.iter_mut().enumerate().for_each(|(k, m)| m.pair_id = format!("{k}").into());
        }
        for row in rows(&report(&data).0, "hypotheses") {
            assert_eq!(row[1], "cannot tell: too few terrains", "{paired} {row:?}");
            assert_eq!([6, 7].map(|column| row[column].as_f64()), [Some(1.0); 2], "{paired} {row:?}");
        }
    }
}

/// Both groups have successful missions, but no pair has one in both: the verdict does not say that a group has none.
#[test]
fn val_groups_without_common_pairs_are_not_called_empty() {
    let mut data = made_up::full(6, 24);
    for mission in &mut data.missions {
        let even = mission.pair_id.ends_with(['0', '2', '4', '6', '8']);
        let fails = even == mission.terrain_id.starts_with("d2.60");
        mission.outcome = if fails { "stuck" } else { "success" }.into();
    }
    let groups = ["2.30", "2.60"];
    data.study.hypotheses = vec![
        claim(serde_json::json!({ "statistic": "time_s", "groups": groups, "test": "difference", "family": "a" })),
        claim(
            serde_json::json!({ "statistic": "time_s", "groups": groups, "test": "equivalence", "margin": 1.0, "family": "b" }),
        ),
        claim(serde_json::json!({ "statistic": "time_s", "family": "c" })),
    ];
    let verdicts: Vec<serde_json::Value> =
        rows(&report(&data).0, "hypotheses").into_iter().map(|row| row[1].clone()).collect();
    assert_eq!(verdicts, ["cannot tell: no paired missions have this metric in every group"; 3]);
}

/// Six blocks reach 2 / 64 at best: enough for one claim at 5 %, too few for two in a family.
#[test]
fn val_family_size_decides_whether_terrains_suffice() {
    let mut data = made_up::full(6, 24);
    let groups = ["2.30", "2.60"];
    let success = serde_json::json!({ "statistic": "success", "groups": groups, "test": "difference" });
    data.missions.iter_mut().for_each(|m| m.outcome = "success".into());
    data.study.hypotheses = vec![claim(success.clone())];
    let verdict = |data: &Data| rows(&report(data).0, "hypotheses")[0][1].clone();
    assert_eq!(verdict(&data), "not supported");
    data.study.hypotheses = vec![claim(success.clone()), claim(success)];
    assert_eq!(verdict(&data), "cannot tell: too few terrains");
    let equivalence =
        serde_json::json!({ "statistic": "success", "groups": groups, "test": "equivalence", "margin": 5.0 });
    data.study.hypotheses = vec![claim(equivalence)];
    let row = rows(&report(&data).0, "hypotheses").remove(0);
    // No block differs: a sign test against the margin, 2^-6.
    assert_eq!((row[1].as_str(), row[2].as_f64()), (Some("equivalent within the margin"), Some(0.0)));
    assert!(row[3].is_null() && row[6].as_f64() == Some(1.0 / 64.0), "{row:?}");
}

/// Every mission has the same metric in all groups, and the hard ones fail in the last group: nothing changes between groups, although the
/// means of the survivors do.
#[test]
fn val_paired_metrics_use_missions_that_succeed_in_both() {
    let mut data = made_up::full(6, 24);
    for mission in &mut data.missions {
        let number: u32 = mission.pair_id.bytes().map(u32::from).sum::<u32>() % 7;
        mission.rms_pitch_rate_deg_s = 1.0 + f64::from(number);
        let hard = number > 3 && mission.terrain_id.starts_with("d2.60");
        mission.outcome = if hard { "stuck" } else { "success" }.into();
    }
    let rows = rows(&report(&data).0, "comparison");
    let pitch: Vec<_> = rows.iter().filter(|r| r[0] == "RMS pitch rate").collect();
    assert_eq!(pitch.len(), 3);
    for row in pitch {
        assert_eq!((row[4].as_f64(), row[7].as_f64(), row[10].as_f64()), (Some(0.0), Some(0.0), Some(1.0)), "{row:?}");
    }
    // No mission succeeds in both: nothing is compared.
    for mission in &mut data.missions {
        let even = mission.pair_id.ends_with(['0', '2', '4', '6', '8']);
        let fails = even == mission.terrain_id.starts_with("d2.60");
        mission.outcome = if fails { "stuck" } else { "success" }.into();
    }
    let rows = self::rows(&report(&data).0, "comparison");
    let of = |r: &&Vec<serde_json::Value>| r[0] == "RMS pitch rate" && r[2] == "2.30 to 2.60";
    let row = rows.iter().find(of).unwrap();
    assert!(row[3] == "0 blocks, 0 missions" && row[4].is_null() && row[10].is_null(), "{row:?}");
}

/// What is too much to list or to draw is a random sample, and both the page and the file say so; statistics are those of all missions.
#[test]
fn prop_large_releases_are_sampled_and_say_so() {
    let mut data = made_up::full(2, 24);
    data.missions.retain(|m| m.variant.is_none());
    let few = data.missions.clone();
    let times = 21_000usize.div_ceil(few.len());
    let copy = |(k, m): (usize, &Mission)| Mission {
        mission_id: format!("{}-{k:04}", m.mission_id).into(),
        pair_id: format!("{}.{k}", m.pair_id).into(),
        time_s: m.time_s + 1e-3 * k as f64,
        ..m.clone()
    };
    data.missions = few.iter().flat_map(|m| (0..times).map(move |k| (k, m))).map(copy).collect();
    data.missions.sort_by(|a, b| (&a.terrain_id, &a.mission_id).cmp(&(&b.terrain_id, &b.mission_id)));
    let failed = |k: u32| FailedItem {
        stage: "traverse".into(),
        item: format!("t{k:05}"),
        error: "no start".into(),
        parameters: None,
    };
    data.failed = (0..21_000).map(failed).collect();
    let (files, _) = report(&data);
    assert_sound(&files);
    let json =
        |name: &str| -> serde_json::Value { serde_json::from_str(&files[&format!("data/{name}.json")]).unwrap() };
    let all = json("missions");
    assert_eq!(all["random_sample_of"].as_u64(), Some(data.missions.len() as u64));
    assert_eq!(all["rows"].as_array().unwrap().len(), crate::sample::ROWS_MAX);
    let failed = json("failed");
    assert_eq!(failed["random_sample_of"].as_u64(), Some(21_000));
    assert_eq!(failed["rows"].as_array().unwrap().len(), crate::sample::ROWS_MAX);
    assert!(files["index.html"].contains("rows, a random sample of the "));
    assert!(files["index.html"].contains("; a random sample of 400 is drawn"));
    // The counts are those of all.
    let outcomes = rows(&files, "outcomes");
    let missions: u64 = outcomes.iter().map(|row| row[1].as_u64().unwrap()).sum();
    assert_eq!(missions, data.missions.len() as u64);
    let small = report(&made_up::full(2, 24)).0;
    assert!(small.values().all(|text| !text.contains("random sample of") && !text.contains("random_sample_of")));
}

/// Adds a run `second` with the same missions, which all get stuck.
fn add_second_run(data: &mut Data) {
    let second = data.missions.iter().map(|m| Mission {
        traverse_id: "second".into(),
        mission_id: format!("second-{}", m.mission_id).into(),
        outcome: "stuck".into(),
        ..m.clone()
    });
    let second: Vec<Mission> = second.collect();
    data.missions.extend(second);
    data.missions.sort_by(|a, b| (&a.terrain_id, &a.mission_id).cmp(&(&b.terrain_id, &b.mission_id)));
}

/// Missions of two runs that are drawn on the same terrain each have their own samples.
#[test]
fn val_runs_on_one_terrain_show_their_own_samples() {
    let (mut data, mut shelf) = made_up::parts(2, 24);
    data.missions.retain(|m| m.variant.is_none());
    data.missions.iter_mut().for_each(|m| m.outcome = "success".into());
    add_second_run(&mut data);
    for samples in shelf.samples.values_mut() {
        let second = samples.iter().map(|s| (format!("second-{}", s.mission_id), s.clone()));
        let second: Vec<SampleRow> = second.map(|(mission_id, s)| SampleRow { mission_id, ..s }).collect();
        samples.extend(second);
        samples.sort_by(|a, b| a.mission_id.cmp(&b.mission_id));
    }
    data.files = Box::new(shelf);
    let (files, _) = report(&data);
    assert_sound(&files);
    let (second, first): (Vec<&String>, Vec<&String>) =
        files.keys().filter(|path| path.starts_with("figures/mission-")).partition(|path| path.contains("second-"));
    assert_eq!((first.len(), second.len()), (1, 1), "{first:?} {second:?}");
}

/// A second run over the same terrains is a separate group everywhere, and a claim names its run.
#[test]
fn val_runs_are_separate_groups() {
    let mut data = made_up::full(6, 24);
    data.missions.retain(|m| m.variant.is_none());
    let first = data.missions[0].traverse_id.clone();
    add_second_run(&mut data);
    let claimed = |run: &str| {
        let groups = ["2.30", "2.60"];
        claim(serde_json::json!({ "statistic": "success", "groups": groups, "test": "difference", "traverse": run }))
    };
    data.study.hypotheses = vec![claimed(&first), claimed("second")];
    let (files, _) = report(&data);
    assert_sound(&files);
    let names: Vec<String> = data.mission_groups().into_iter().map(|g| g.name).collect();
    assert_eq!(names.len(), 6);
    assert!(names.contains(&format!("2.30, {first}")) && names.contains(&"2.30, second".to_owned()), "{names:?}");
    assert!(files["index.html"].contains(&names[0]));
    let of_runs: Vec<f64> = rows(&files, "hypotheses").iter().map(|r| r[6].as_f64().unwrap()).collect();
    assert!(of_runs[0] < 1.0 && of_runs[1] == 1.0, "{of_runs:?}");
}

/// The same release, with heights known by hash: every value is the same. Other heights: terrains are independent.
#[test]
fn val_a_release_is_compared_with_another() {
    let hashed = |salt: &str| {
        let mut data = made_up::full(6, 24);
        data.contents = data.terrains.iter().map(|t| (t.path.clone(), format!("{salt}{}", t.terrain_id))).collect();
        data
    };
    let against = |other: Data| {
        let mut data = hashed("");
        data.against = Some(Against { name: "other".into(), data: Box::new(other) });
        let (files, _) = report(&data);
        assert_sound(&files);
        rows(&files, "releases")
    };
    let same = against(hashed(""));
    assert!(same.iter().all(|row| row[2] == "the same values"), "{same:?}");
    let of_groups = |rows: &[Vec<serde_json::Value>]| {
        let plain = |row: &&Vec<serde_json::Value>| ["2.30", "2.45", "2.60"].iter().any(|group| row[1] == *group);
        rows.iter().filter(plain).cloned().collect::<Vec<_>>()
    };
    let plain = of_groups(&same);
    assert!(plain.iter().filter(|row| row[0] == "RMS pitch rate").count() == 3);
    assert!(plain.iter().all(|row| row[13] == "6 terrains, paired"), "{plain:?}");
    let mut rough = hashed("");
    rough.missions.iter_mut().for_each(|m| m.rms_pitch_rate_deg_s *= 1.5);
    let differs = against(rough);
    let pitch = |r: &&Vec<serde_json::Value>| r[0] == "RMS pitch rate" && r[6].as_f64() < Some(0.0);
    assert_eq!(of_groups(&differs).iter().filter(pitch).count(), 3);
    let apart = of_groups(&against(hashed("x")));
    assert!(apart.iter().all(|r| r[13] == "6 + 6 terrains" && r[2] == "the same values"), "{apart:?}");
    let mut foreign = hashed("");
    foreign.terrains.iter_mut().for_each(|t| t.group = Some("elsewhere".into()));
    foreign.missions.iter_mut().for_each(|m| m.group = None);
    let mut data = hashed("");
    data.against = Some(Against { name: "other".into(), data: Box::new(foreign) });
    assert!(report(&data).0["index.html"].contains("no group in common"));
    assert!(!report(&hashed("")).0["index.html"].contains("id=\"releases\""));
}

/// A log with the metrics of a mission lies among its group, a far rougher one lies above, one below its noise floor cannot tell.
#[test]
fn val_logs_are_compared_with_missions() {
    let mut data = made_up::full(6, 24);
    let median = |of: fn(&Mission) -> f64| {
        let group = data.mission_groups().swap_remove(0);
        sastrugi_numeric::sums::median(&group.rows.iter().map(|m| of(m)).collect::<Vec<_>>())
    };
    let (pitch, roll) = (median(|m| m.rms_pitch_rate_deg_s), median(|m| m.rms_roll_rate_deg_s));
    let log = LogRow {
        log_id: "drive.mcap".into(),
        group: Some("2.30".into()),
        sample_rate_hz: 20.0,
        efficiency: f64::NAN,
        rms_vertical_acceleration_m_s2: 1e3,
        vertical_acceleration_tells: true,
        rms_pitch_rate_deg_s: pitch,
        pitch_rate_tells: true,
        rms_roll_rate_deg_s: roll,
        roll_rate_tells: false,
        ..made_up::log()
    };
    let other = LogRow { log_id: "other.mcap".into(), group: None, sample_rate_hz: 10.0, ..log.clone() };
    data.logs = Some(vec![log, other]);
    let (files, summary) = report(&data);
    assert_sound(&files);
    assert!(summary.figures.iter().any(|f| f == "log-drive.mcap"), "{:?}", summary.figures);
    let found = rows(&files, "logs-beside-missions");
    assert_eq!(found.len(), 8 + 8 * 3);
    let verdicts: Vec<&str> = found[..4].iter().map(|r| r[3].as_str().unwrap()).collect();
    let few = "cannot tell: at the edge, and too few terrains";
    assert_eq!(verdicts, ["no value", few, "within the middle 95 %", "cannot tell: below three times the noise floor"]);
    assert_eq!(found[1][10].as_f64(), Some(100.0));
    assert!(files["index.html"].contains("Sampled at another rate than the missions (20 Hz)"));
    // With 40 terrains, p can be 2/41; a drive that failed, or whose log is incomplete, is not judged.
    let missions = made_up::full(40, 2);
    let verdict = |outcome: &str, broken: Option<&str>| {
        let (outcome, broken) = (Some(outcome.to_owned()), broken.map(str::to_owned));
        let mut data = made_up::empty();
        (data.missions, data.terrains) = (missions.missions.clone(), missions.terrains.clone());
        data.logs = Some(vec![LogRow { rms_vertical_acceleration_m_s2: 1e3, outcome, broken, ..made_up::log() }]);
        let blocks = (crate::questions::logs::QUESTION.answer)(&data).unwrap();
        let tables = blocks.iter().filter_map(|b| if let Block::Table(t) = b { Some(&t.numbers) } else { None });
        let known = tables.flat_map(|t| &t.rows).find(|row| !matches!(row[5], Cell::Null)).unwrap();
        known[3].clone()
    };
    let text = |words: &str| Cell::Text(words.into());
    assert_eq!(verdict("success", None), text("above the missions"));
    assert_eq!(verdict("stuck", None), text("not judged: outcome stuck"));
    assert_eq!(verdict("success", Some("at 3 s")), text("not judged: the log is incomplete"));
}

/// Values by group and changes of the paper, each with a verdict that agrees with its row.
#[test]
fn val_every_published_value_has_a_verdict() {
    let rows = rows(&report(&made_up::full(3, 24)).0, "published");
    assert_eq!(rows.len(), 6 * 3 + 12 * 2);
    for row in rows {
        let [paper, low, high] = [3, 5, 6].map(|k| row[k].as_f64().unwrap());
        match row[7].as_str() {
            Some("inside") => assert!(paper >= low - 0.5 && paper <= high + 0.5, "{row:?}"),
            Some("outside") => assert!(paper < low || paper > high, "{row:?}"),
            other => panic!("{other:?}"),
        }
    }
}

/// Not a check: writes a page to look at and prints its path.
#[test]
#[ignore = "writes a page to look at"]
fn gold_a_page_to_look_at() {
    let folder = std::env::temp_dir().join("sastrugi-report-page");
    let summary = write(&made_up::full(5, 500), &folder, &|_| ()).unwrap();
    eprintln!("{}: {} bytes", folder.join("index.html").display(), summary.bytes);
}
