//! The reference for study files (`docs/study.md`): all sections, kinds and keys, generated from the schemas of their types.

use crate::examples::EXAMPLES;
use crate::parameters::{Parameter, parameters, text_of};
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::study::StudyHead;
use sastrugi_schemas::{Kind, capital};
use sastrugi_stages::registry::{self, Form, SECTIONS, Section};
use sastrugi_stages::starting::STARTING;
use sastrugi_stages::verbs::parameters::to_toml;
use serde_json::Value;

const INTRODUCTION: &str = include_str!("reference.md");

/// The section whose vehicles are listed below it.
const DRIVING: &str = "traverse";

/// Where a reader of the page goes from here.
const NEXT: &str = "Next: [what a release contains](release.md), or [run the study on a cluster](cluster.md).";

/// The page as Markdown.
pub fn study() -> String {
    let listed = |name: &str, form: Form, envelope: &Value| {
        let heading = heading(name, form);
        let anchor = name.replace('_', "-");
        format!("| [`{heading}`](#{anchor}) | {} |", purpose(envelope))
    };
    let head = schema_of::<StudyHead>();
    let mut contents = vec![listed("study", Form::Table, &head)];
    contents.extend(SECTIONS.iter().map(|s| listed(s.name, s.form, &(s.envelope)())));
    let mut parts = vec![
        INTRODUCTION.trim_end().to_owned(),
        format!("## Sections\n\n| section | purpose |\n|---|---|\n{}", contents.join("\n")),
        chapter("study", Form::Table, &head),
    ];
    for section in &SECTIONS {
        parts.push(chapter(section.name, section.form, &(section.envelope)()));
        parts.extend(kinds(section));
        if section.name == DRIVING {
            parts.extend(vehicles());
        }
    }
    parts.push(NEXT.to_owned());
    parts.join("\n\n")
}

fn heading(name: &str, form: Form) -> String {
    match form {
        Form::Table => format!("[{name}]"),
        Form::Array => format!("[[{name}]]"),
    }
}

/// The description of a section without the leading name.
fn purpose(envelope: &Value) -> String {
    let text = text_of(envelope);
    capital(text.split_once("`: ").map_or(text.as_str(), |(_, purpose)| purpose))
}

fn chapter(name: &str, form: Form, envelope: &Value) -> String {
    let example = example(&heading(name, form)).map(|text| format!("\n\n```toml\n{text}\n```")).unwrap_or_default();
    let place = Place { section: name, kind: None };
    format!("## {name}\n\n{}{example}\n\n{}", purpose(envelope), table(&place, envelope))
}

/// Tables of the kinds of a section.
fn kinds(section: &Section) -> Vec<String> {
    let kinds = (section.kinds)();
    let distinct = section.distinct_kinds();
    let of_kind = |kind: &Kind| match section.selector() {
        Some(selector) => format!("### `{selector} = \"{}\"`", kind.kind),
        None => format!("### Parameters of [[{}]]", section.name),
    };
    let text = |kind: &Kind| {
        let summary = match kinds.len() == distinct.len() {
            true => kind.description(),
            false => {
                kinds.iter().map(|k| format!("* `{}`: {}", k.kind, k.description())).collect::<Vec<_>>().join("\n")
            }
        };
        let place = Place { section: section.name, kind: section.selector().map(|selector| (selector, kind.kind)) };
        let rows = table(&place, &kind.parameters);
        format!("{}\n\n{summary}{}{rows}", of_kind(kind), if rows.is_empty() { "" } else { "\n\n" })
    };
    distinct.iter().map(text).collect()
}

/// The vehicles, and the keys that change them.
fn vehicles() -> [String; 2] {
    let all: Vec<Kind> = registry::kinds().into_iter().filter(|kind| kind.family == "vehicle").collect();
    let rows: Vec<String> = all.iter().filter_map(vehicle).collect();
    let schema = all.first().map_or(Value::Null, |kind| kind.parameters.clone());
    let keys: Vec<String> = parameters(&schema).iter().map(|p| changed(&all, p)).collect();
    [
        format!(
            "### Vehicles\n\n| vehicle | what it is | length, width, wheelbase | mass with wheels |\n|---|---|---|---|\n{}",
            rows.join("\n")
        ),
        format!(
            "### Keys of `vehicle_changes`\n\nThe example is the value of the first vehicle that has the key; `sastrugi kinds husky_a200` prints all \
             values of a vehicle with their sources. With another `kind`, a suspension or a drive is replaced as a whole.\n\n\
             | key | holds | example | meaning |\n|---|---|---|---|\n{}",
            keys.join("\n")
        ),
    ]
}

/// A row of the table of vehicles.
fn vehicle(kind: &Kind) -> Option<String> {
    let values = kind.values()?;
    let number = |path: &str| values.pointer(path).and_then(Value::as_f64);
    let axles_m: Vec<f64> = values.pointer("/wheels/axles_m")?.as_array()?.iter().filter_map(Value::as_f64).collect();
    let wheelbase_m = axles_m.first()? - axles_m.last()?;
    let length_m = number("/chassis/size_m/0")?.max(wheelbase_m + 2.0 * number("/wheels/radius_m")?);
    let width_m = number("/chassis/size_m/1")?.max(number("/wheels/track_m")? + number("/wheels/width_m")?);
    let mass_kg = number("/chassis/mass_kg")? + 2.0 * axles_m.len() as f64 * number("/wheels/mass_kg")?;
    let (name, summary) = (kind.kind, capital(kind.summary));
    Some(format!("| `{name}` | {summary}. | {length_m:.2}, {width_m:.2}, {wheelbase_m:.2} m | {mass_kg:.0} kg |"))
}

/// A row of the table of keys that change a vehicle.
fn changed(vehicles: &[Kind], p: &Parameter) -> String {
    let values = vehicles.iter().filter_map(|kind| value_at(kind.values()?, &p.name));
    let example = values.filter(|value| !value.is_object()).find_map(|value| to_toml(value).ok());
    let example = example.map(|value| format!("`{}`", value.to_string().trim())).unwrap_or_default();
    format!("| `{}` | {} | {example} | {} |", p.name, p.holds, p.meaning)
}

/// The value of a vehicle at a key such as `drive[ackermann].spot_turn`, if its drive is of that kind.
fn value_at<'a>(vehicle: &'a Value, key: &str) -> Option<&'a Value> {
    key.split('.').try_fold(vehicle, |at, word| match word.strip_suffix(']').and_then(|word| word.split_once('[')) {
        Some((name, kind)) => at.get(name).filter(|table| table["kind"] == kind),
        None => at.get(word),
    })
}

/// A table of keys; empty if there are none.
fn table(place: &Place<'_>, schema: &Value) -> String {
    let rows: Vec<String> = parameters(schema).iter().map(|p| row(place, p)).collect();
    if rows.is_empty() {
        return String::new();
    }
    format!("| key | holds | default | example | meaning |\n|---|---|---|---|---|\n{}", rows.join("\n"))
}

fn row(place: &Place<'_>, p: &Parameter) -> String {
    let code = |text: &str| if text.is_empty() { String::new() } else { format!("`{}`", text.replace('|', "\\|")) };
    let example = if ["", "table", "list of tables"].contains(&p.holds.as_str()) { None } else { example_of(place, p) };
    let default = if p.is_required { "**required**".to_owned() } else { code(&p.default) };
    let (name, example) = (code(&p.name), code(&example.unwrap_or_default()));
    format!("| {name} | {} | {default} | {example} | {} |", p.holds, p.meaning.replace('|', "\\|"))
}

/// Location of a key: its section, and the kind of its table if kinds have their own keys.
struct Place<'a> {
    section: &'a str,
    /// Key that selects the kind, and the kind.
    kind: Option<(&'static str, &'static str)>,
}

/// The first table of a section in the starting studies, without the surrounding comments.
fn example(heading: &str) -> Option<String> {
    STARTING.iter().find_map(|starting| {
        let lines = starting.text.lines().skip_while(|line| *line != heading);
        let table: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
        (!table.is_empty()).then(|| table.join("\n"))
    })
}

/// An example value of a key: from a starting study, its default, or the list of examples, in this order.
fn example_of(place: &Place<'_>, p: &Parameter) -> Option<String> {
    let last = p.name.rsplit('.').next().unwrap_or_default();
    let in_section = format!("{}: {last}", place.section);
    let find = |name: &str| EXAMPLES.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
    let listed = || find(&in_section).or_else(|| find(&p.name)).or_else(|| find(last));
    let default = || Some(p.default.clone()).filter(|default| !["", "[]", "{}", "\"\""].contains(&default.as_str()));
    written(place, &p.name).or_else(default).or_else(listed)
}

/// The value of a key in the first table of its section and kind that has it, in the starting studies.
fn written(place: &Place<'_>, key: &str) -> Option<String> {
    let headings = [heading(place.section, Form::Array), heading(place.section, Form::Table)];
    let is_of_kind = |table: &str| match place.kind {
        None => true,
        Some((selector, kind)) => value_in(table, selector) == Some(format!("\"{kind}\"")),
    };
    STARTING.iter().find_map(|starting| {
        let tables = starting.text.split("\n\n").map(|part| part.trim_start_matches('\n'));
        let mut own = tables.filter_map(|part| {
            let at = part.lines().position(|line| headings.iter().any(|heading| line == heading))?;
            Some(part.lines().skip(at + 1).collect::<Vec<_>>().join("\n"))
        });
        own.find_map(|table| if is_of_kind(&table) { value_in(&table, key) } else { None })
    })
}

/// The value of a key in the lines of a table.
fn value_in(table: &str, key: &str) -> Option<String> {
    table.lines().find_map(|line| {
        let (name, value) = line.split_once(" = ")?;
        let value = value.split_once("  #").map_or(value, |(value, _)| value);
        (name == key).then(|| value.trim().to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn val_values_in_the_lines_of_a_table() {
        let table = "id = \"a\"  # its name\nhigh.d = 2.3\n# count = 4\nlist = [1, 2]";
        let value = |key: &str| value_in(table, key);
        assert_eq!((value("id").as_deref(), value("high.d").as_deref()), (Some("\"a\""), Some("2.3")));
        assert_eq!((value("list").as_deref(), value("count"), value("d")), (Some("[1, 2]"), None, None));
    }

    /// The example of a section is the first table of a starting study, whole and without what surrounds it.
    #[test]
    fn val_examples_of_sections() {
        let mut count = 0;
        for section in &SECTIONS {
            let heading = heading(section.name, section.form);
            let Some(example) = example(&heading) else { continue };
            count += 1;
            assert!(example.starts_with(&heading) && example.lines().count() > 1, "{example}");
            assert!(example.lines().skip(1).all(|line| !line.starts_with('[')), "{example}");
        }
        assert!(count >= 10, "{count}");
        let terrain = example("[[terrain]]").unwrap();
        assert!(terrain.contains("kind = \"multifractal\"") && !terrain.contains("weierstrass"), "{terrain}");
        assert_eq!(example("[[nothing]]"), None);
    }

    /// Vehicles are told apart, and every key has a value of some vehicle.
    #[test]
    fn val_vehicles_and_their_keys() {
        let [table, keys] = vehicles();
        // By hand: 1360 kg and four wheels of 35 kg; axles 2.7 m apart; a track of 1.6 m and wheels 0.27 m wide.
        assert!(table.contains("| 4.00, 1.87, 2.70 m | 1500 kg |"), "{table}");
        assert!(table.lines().filter(|line| line.starts_with("| `")).count() >= 3, "{table}");
        let lines: Vec<&str> = keys.lines().filter(|line| line.starts_with("| `")).collect();
        assert!(lines.len() > 50, "{keys}");
        for line in lines {
            let cells: Vec<&str> = line.split(" | ").collect();
            let is_table = cells[0].ends_with("]`") || cells[1] == "table";
            assert!(cells.len() == 4 && (is_table || cells[2].starts_with('`')), "{line}");
        }
        let car = json!({ "drive": { "kind": "ackermann", "spot_turn": false } });
        assert_eq!(value_at(&car, "drive[ackermann].spot_turn"), Some(&json!(false)));
        assert_eq!((value_at(&car, "drive[skid_steer].spot_turn"), value_at(&car, "wheels.radius_m")), (None, None));
    }

    /// Of a key that is listed twice, the second example would never be shown.
    #[test]
    fn val_examples_are_listed_once() {
        let mut keys: Vec<&str> = EXAMPLES.iter().map(|(key, _)| *key).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), EXAMPLES.len());
    }
}
