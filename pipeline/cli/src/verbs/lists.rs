//! Verbs that list kinds, schemas, completions and licences.

use crate::Verdict;
use crate::args::{Arguments, Common, Completions, Kinds, Schema};
use crate::failure::{Code, Failure};
use crate::output::{columns, print};
use crate::parameters::{Parameter, parameters};
use crate::reference;
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
        print(common.json, &all.iter().map(as_json).collect(), &columns(&rows))?;
        return Ok(Code::Done);
    };
    let chosen: Vec<&Kind> = all.iter().filter(|k| k.kind == name || k.family == name).collect();
    if chosen.is_empty() {
        let names = all.iter().flat_map(|k| [k.kind, k.family]);
        let hint = nearest(name, names)
            .map_or_else(|| "`sastrugi kinds` lists them".to_owned(), |n| format!("did you mean `{n}`?"));
        return Err(Failure::usage(format!("unknown kind `{name}`; {hint}")));
    }
    let text: Vec<String> = chosen.iter().map(|k| describe(k)).collect();
    print(common.json, &chosen.iter().map(|k| as_json(k)).collect(), &text.join("\n\n"))?;
    Ok(Code::Done)
}

/// A kind as JSON. A kind with values has them under `parameters`, as in its file, and their description under `schema`.
fn as_json(kind: &Kind) -> Value {
    let Some(values) = kind.values() else { return json!(kind) };
    let mut schema = kind.parameters.clone();
    if let Some(schema) = schema.as_object_mut() {
        ["default", "x-sources"].into_iter().for_each(|key| drop(schema.remove(key)));
    }
    let mut json = json!({
        "family": kind.family,
        "kind": kind.kind,
        "summary": kind.summary,
        "source": kind.source,
        "parameters": values,
        "schema": schema,
    });
    if let Some(sources) = kind.sources() {
        json["sources"] = sources.clone();
    }
    json
}

fn describe(kind: &Kind) -> String {
    let row = |p: Parameter| vec![format!("  {}", p.name), p.default, p.meaning];
    let rows: Vec<Vec<String>> = match kind.values() {
        Some(values) => numbers("", values, kind.sources()),
        None => parameters(&kind.parameters).into_iter().map(row).collect(),
    };
    let text = format!("{} {}: {}\nsource: {}", kind.family, kind.kind, kind.summary, kind.source);
    if rows.is_empty() { text } else { format!("{text}\n{}", columns(&rows)) }
}

/// Rows `name, value, source` of the leaves of a value.
fn numbers(prefix: &str, value: &Value, sources: Option<&Value>) -> Vec<Vec<String>> {
    match value {
        Value::Object(map) => map
            .iter()
            .flat_map(|(key, value)| {
                let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                numbers(&name, value, sources.and_then(|s| s.get(key)))
            })
            .collect(),
        _ => {
            let source = sources.and_then(Value::as_str).unwrap_or_default();
            vec![vec![format!("  {prefix}"), value.to_string(), source.to_owned()]]
        }
    }
}

/// `schema`.
pub fn schema(args: &Schema, common: &Common) -> Verdict {
    match args.name.as_deref() {
        None | Some("study") if args.markdown => {
            let page = reference::study();
            print(common.json, &json!({ "markdown": page }), &page)?;
        }
        Some(_) if args.markdown => {
            return Err(Failure::usage("--markdown works only with `study`"));
        }
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
            // Missions, teams and rovers share the topics of the terrain.
            for topic in all.filter(|t| t.name == name) {
                if !found.contains(&topic) {
                    found.push(topic);
                }
            }
            if found.is_empty() {
                return Err(Failure::usage(format!("unknown topic `{name}`; `sastrugi schema topics` lists them")));
            }
            let text: Vec<String> = found.iter().map(|t| describe_topic(t)).collect();
            print(common.json, &json!(found), &text.join("\n\n"))?;
        }
        Some(name) => {
            let table = tables::by_name(name).ok_or_else(|| {
                let known: Vec<&str> = tables::ALL.iter().map(|t| t.name).collect();
                let known = known.join(", ");
                Failure::usage(format!("unknown schema `{name}`; known: study, tables, topics, {known}"))
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

/// The licence of the program, and those of the linked crates and of the packages in the server's page: they go with every copy.
const THIRD_PARTY: &str = include_str!("../../../../THIRD-PARTY.md");

/// `licences`.
pub fn licences(common: &Common) -> Verdict {
    print(common.json, &json!({ "licence": env!("CARGO_PKG_LICENSE"), "notices": THIRD_PARTY }), THIRD_PARTY)?;
    Ok(Code::Done)
}
