//! Verbs that list what the program knows.

use crate::Verdict;
use crate::args::{Arguments, Common, Completions, Kinds, Schema};
use crate::failure::{Code, Failure};
use crate::output::{columns, print};
use clap::CommandFactory;
use sastrugi_schemas::topics::ros2::{ROS2, ROVER_ROS2, TEAM_ROS2};
use sastrugi_schemas::topics::{self, Field, Topic};
use sastrugi_schemas::{Kind, Table, tables};
use sastrugi_stages::study::keys::nearest;
use sastrugi_stages::{registry, schema};
use serde_json::{Value, json};

/// `kinds`.
pub fn kinds(args: &Kinds, common: &Common) -> Verdict {
    let all = registry::kinds();
    let Some(name) = &args.kind else {
        let rows: Vec<Vec<String>> =
            all.iter().map(|k| vec![k.family.to_owned(), k.kind.to_owned(), k.summary.to_owned()]).collect();
        print(common.json, &json!(all), &columns(&rows))?;
        return Ok(Code::Done);
    };
    let chosen: Vec<&Kind> = all.iter().filter(|k| k.kind == name || k.family == name).collect();
    if chosen.is_empty() {
        let names = all.iter().flat_map(|k| [k.kind, k.family]);
        let hint = nearest(name, names)
            .map_or_else(|| "`sastrugi kinds` lists them".to_owned(), |n| format!("did you mean `{n}`?"));
        return Err(Failure::usage(format!("there is no kind `{name}`; {hint}")));
    }
    let text: Vec<String> = chosen.iter().map(|k| describe(k)).collect();
    print(common.json, &json!(chosen), &text.join("\n\n"))?;
    Ok(Code::Done)
}

fn describe(kind: &Kind) -> String {
    let mut rows = Vec::new();
    parameters("", &[&kind.parameters], &mut rows);
    let text = format!("{} {}: {}\nsource: {}", kind.family, kind.kind, kind.summary, kind.source);
    if rows.is_empty() { text } else { format!("{text}\n{}", columns(&rows)) }
}

/// Rows `name, default, description` of a schema's properties: tables opened, lists of tables as `name[]` or by the kind of table, and
/// words with what each of them says. `path` leads from the root to the schema; a table within itself is not opened again.
fn parameters(prefix: &str, path: &[&Value], rows: &mut Vec<Vec<String>>) {
    let (Some(root), Some(schema)) = (path.first(), path.last()) else { return };
    let schema = resolve(schema, root);
    let open = |prefix: &str, table: &Value, rows: &mut Vec<Vec<String>>| {
        if !path.iter().any(|outer| std::ptr::eq(*outer, table)) {
            parameters(prefix, &[path, &[table]].concat(), rows);
        }
    };
    let defaults = schema.get("default");
    for (name, property) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
        if property.get("const").is_some() {
            continue;
        }
        let inner = resolve(property, root);
        let items = inner.get("items").map(|items| resolve(items, root));
        let (tables, words) = (items.map_or_else(Vec::new, choices), words(inner));
        let is_table = |schema: &Value| schema.get("properties").is_some();
        let lists_tables = !tables.is_empty() || items.is_some_and(is_table);
        let default = property.get("default").or_else(|| defaults.and_then(|d| d.get(name)));
        let default = default.filter(|_| !is_table(inner) && !lists_tables).map(Value::to_string).unwrap_or_default();
        let description = if property.get("description").is_some() { text_of(property) } else { text_of(inner) };
        rows.push(vec![format!("  {prefix}{name}"), default, description]);
        for (word, text) in words {
            rows.push(vec![format!("  {prefix}{name} = {word}"), String::new(), text]);
        }
        if is_table(inner) {
            open(&format!("{prefix}{name}."), inner, rows);
        } else if let Some(items) = items {
            open(&format!("{prefix}{name}[]."), items, rows);
        }
        for (kind, table) in tables {
            rows.push(vec![format!("  {prefix}{name}[{kind}]"), String::new(), text_of(table)]);
            open(&format!("{prefix}{name}[{kind}]."), table, rows);
        }
    }
}

/// Kinds of the tables that a list of `items` may hold, with their schemas.
fn choices(items: &Value) -> Vec<(&str, &Value)> {
    let all = items.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    all.filter_map(|c| Some((c.pointer("/properties/kind/const")?.as_str()?, c))).collect()
}

/// Words that a parameter may be, with what the schema says of each.
fn words(schema: &Value) -> Vec<(String, String)> {
    let all = schema.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    let described = all.filter(|word| word.get("description").is_some());
    described.filter_map(|word| Some((word.get("const")?.to_string(), text_of(word)))).collect()
}

/// What a schema says of itself, on one line.
fn text_of(schema: &Value) -> String {
    schema.get("description").and_then(Value::as_str).unwrap_or_default().replace('\n', " ")
}

/// The schema that a reference stands for, also where there may be nothing in its place.
fn resolve<'a>(schema: &'a Value, root: &'a Value) -> &'a Value {
    let something =
        schema.get("anyOf").and_then(Value::as_array).and_then(|any| any.iter().find(|s| s["type"] != "null"));
    let schema = something.unwrap_or(schema);
    let target = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.strip_prefix('#'));
    target.and_then(|path| root.pointer(path)).unwrap_or(schema)
}

/// `schema`.
pub fn schema(args: &Schema, common: &Common) -> Verdict {
    match args.name.as_deref() {
        None | Some("study") => {
            let schema = schema::study_schema();
            let text = serde_json::to_string_pretty(&schema).map_err(Failure::failed)?;
            print(common.json, &schema, &text)?;
        }
        Some("tables") => {
            let text: Vec<String> = tables::ALL.iter().map(|t| describe_table(t)).collect();
            print(common.json, &json!(tables::ALL), &text.join("\n\n"))?;
        }
        Some("topics") => {
            let of = |flavour: &str, topics: &[&Topic]| {
                let described: Vec<String> = topics.iter().map(|t| describe_topic(t)).collect();
                format!("{flavour}\n\n{}", described.join("\n\n"))
            };
            let text = [
                of("mcap = \"viewer\"", &topics::VIEWER),
                of("mcap = \"ros2\"", &ROS2),
                of("mcap = \"viewer\", teams", &topics::TEAM_VIEWER),
                of("mcap = \"ros2\", teams", &TEAM_ROS2),
                of("mcap = \"viewer\", rovers", &topics::ROVER_VIEWER),
                of("mcap = \"ros2\", rovers", &ROVER_ROS2),
            ];
            let all = json!({
                "viewer": topics::VIEWER,
                "ros2": ROS2,
                "team_viewer": topics::TEAM_VIEWER,
                "team_ros2": TEAM_ROS2,
                "rover_viewer": topics::ROVER_VIEWER,
                "rover_ros2": ROVER_ROS2,
            });
            print(common.json, &all, &text.join("\n\n"))?;
        }
        Some(name) if name.starts_with('/') => {
            let teams = topics::TEAM_VIEWER.into_iter().chain(TEAM_ROS2);
            let rovers = topics::ROVER_VIEWER.into_iter().chain(ROVER_ROS2);
            let all = topics::VIEWER.into_iter().chain(ROS2).chain(teams).chain(rovers);
            let mut found: Vec<&Topic> = Vec::new();
            // Missions, teams and rovers share the terrain's.
            for topic in all.filter(|t| t.name == name) {
                if !found.contains(&topic) {
                    found.push(topic);
                }
            }
            if found.is_empty() {
                return Err(Failure::usage(format!("there is no topic `{name}`; `sastrugi schema topics` lists them")));
            }
            let text: Vec<String> = found.iter().map(|t| describe_topic(t)).collect();
            print(common.json, &json!(found), &text.join("\n\n"))?;
        }
        Some(name) => {
            let table = tables::by_name(name).ok_or_else(|| {
                let known: Vec<&str> = tables::ALL.iter().map(|t| t.name).collect();
                let known = known.join(", ");
                Failure::usage(format!("there is no schema `{name}`; there are study, tables, topics, {known}"))
            })?;
            print(common.json, &json!(table), &describe_table(table))?;
        }
    }
    Ok(Code::Done)
}

fn describe_topic(topic: &Topic) -> String {
    let row = |field: &Field| {
        let kind = format!("{:?}", field.kind).to_lowercase();
        vec![format!("  {}", field.name), kind, field.unit.to_owned(), field.description.to_owned()]
    };
    let rows: Vec<Vec<String>> = topic.fields.iter().map(row).collect();
    let text = format!("{} {}: {}", topic.name, topic.schema, topic.description);
    if rows.is_empty() { text } else { format!("{text}\n{}", columns(&rows)) }
}

fn describe_table(table: &Table) -> String {
    let rows: Vec<Vec<String>> = table
        .columns
        .iter()
        .map(|c| {
            let kind = format!("{:?}{}", c.column_type, if c.key { ", key" } else { "" }).to_lowercase();
            vec![format!("  {}", c.name), kind, c.unit.to_owned(), c.description.to_owned()]
        })
        .collect();
    format!("{}: {}\n{}", table.name, table.description, columns(&rows))
}

/// `completions`.
pub fn completions(args: &Completions, common: &Common) -> Verdict {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Arguments::command(), "sastrugi", &mut script);
    let script = String::from_utf8(script).map_err(Failure::failed)?;
    print(common.json, &json!({ "shell": args.shell.to_string(), "script": script }), &script)?;
    Ok(Code::Done)
}
