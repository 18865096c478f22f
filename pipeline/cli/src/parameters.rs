//! Descriptions of parameters, from their JSON Schema.

use sastrugi_stages::verbs::parameters::to_toml;
use serde_json::Value;

/// A parameter, or one of its alternatives: a word or a kind of table.
#[derive(Debug, Default)]
pub struct Parameter {
    /// Dotted name: `.` after a table, `[].` after a list of tables, `[kind].` after a table of that kind; `name = word` for a word.
    pub name: String,
    /// Type of the value; empty for words and tables of a list.
    pub holds: String,
    /// Default as TOML; empty if there is none.
    pub default: String,
    /// True if required.
    pub is_required: bool,
    /// Meaning.
    pub meaning: String,
}

/// All parameters in a schema, including those of nested tables; a table that contains itself is expanded once.
pub fn parameters(schema: &Value) -> Vec<Parameter> {
    let mut rows = Vec::new();
    add("", &[schema], schema.get("default"), &mut rows);
    rows
}

/// `path` leads from the root to the schema; `defaults` is the default of the table.
fn add(prefix: &str, path: &[&Value], defaults: Option<&Value>, rows: &mut Vec<Parameter>) {
    let (Some(root), Some(schema)) = (path.first(), path.last()) else { return };
    let schema = resolve(schema, root);
    let open = |prefix: &str, table: &Value, defaults: Option<&Value>, rows: &mut Vec<Parameter>| {
        if !path.iter().any(|outer| std::ptr::eq(*outer, table)) {
            add(prefix, &[path, &[table]].concat(), defaults.or_else(|| table.get("default")), rows);
        }
    };
    for (name, property) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
        if property.get("const").is_some() {
            continue;
        }
        let inner = resolve(property, root);
        let items = inner.get("items").map(|items| resolve(items, root));
        let (tables, words) = (choices(items.unwrap_or(inner)), words(items.unwrap_or(inner)));
        let is_table = |schema: &Value| schema.get("properties").is_some();
        let lists_tables = !tables.is_empty() || items.is_some_and(is_table);
        let own = defaults.and_then(|d| d.get(name)).or_else(|| property.get("default"));
        let shown = own.filter(|_| !is_table(inner) && !lists_tables);
        let default = shown.and_then(|v| to_toml(v).ok()).map(|v| v.to_string()).unwrap_or_default();
        let meaning = if property.get("description").is_some() { text_of(property) } else { text_of(inner) };
        let holds = holds(property, root);
        let required = schema.get("required").and_then(Value::as_array);
        let is_required = required.is_some_and(|all| all.iter().any(|key| key == name)) && default.is_empty();
        rows.push(Parameter { name: format!("{prefix}{name}"), holds, default, is_required, meaning });
        for (word, meaning) in words {
            rows.push(Parameter { name: format!("{prefix}{name} = {word}"), meaning, ..Parameter::default() });
        }
        if is_table(inner) {
            open(&format!("{prefix}{name}."), inner, own.filter(|v| v.is_object()), rows);
        } else if let Some(items) = items {
            open(&format!("{prefix}{name}[]."), items, None, rows);
        }
        for (kind, table) in tables {
            let name = format!("{prefix}{name}[{kind}]");
            let inside = format!("{name}.");
            rows.push(Parameter { name, meaning: text_of(table), ..Parameter::default() });
            open(&inside, table, None, rows);
        }
    }
}

/// Type of a value, as text.
fn holds(schema: &Value, root: &Value) -> String {
    if let Some(choices) = schema.get("anyOf").and_then(Value::as_array) {
        let mut all: Vec<String> =
            choices.iter().filter(|choice| choice["type"] != "null").map(|choice| holds(choice, root)).collect();
        all.dedup();
        return all.join(" or ");
    }
    let schema = resolve(schema, root);
    if schema.get("anyOf").is_some() {
        return holds(schema, root);
    }
    if schema.get("enum").is_some() || schema.get("oneOf").is_some_and(|one| one[0].get("const").is_some()) {
        return "word".to_owned();
    }
    if schema.get("oneOf").is_some() {
        return "table".to_owned();
    }
    let kind = match &schema["type"] {
        Value::Array(all) => all.iter().find(|kind| *kind != "null").unwrap_or(&Value::Null),
        one => one,
    };
    match kind.as_str() {
        Some("string") => "text".to_owned(),
        Some("boolean") => "true or false".to_owned(),
        Some("array") => list_of(schema, root),
        Some("object") if schema.get("properties").is_some() => "table".to_owned(),
        Some("object") if schema.pointer("/additionalProperties/type").is_some_and(|kind| kind == "array") => {
            "table of lists".to_owned()
        }
        Some("object") => "table".to_owned(),
        Some(other) => other.to_owned(),
        None => "any value".to_owned(),
    }
}

fn list_of(schema: &Value, root: &Value) -> String {
    let items = schema.get("items").or_else(|| schema.pointer("/prefixItems/0"));
    let of = items.map_or_else(|| "any value".to_owned(), |items| holds(items, root));
    let count = match (&schema["minItems"], &schema["maxItems"]) {
        (Value::Number(least), Value::Number(most)) if least == most => format!("{least} "),
        _ => String::new(),
    };
    let plural = match of.as_str() {
        "true or false" | "any value" => of,
        _ if of.ends_with('s') || of.starts_with("list") => of,
        _ => format!("{of}s"),
    };
    format!("list of {count}{plural}")
}

/// Kinds of the tables that a list of `items` may hold, with their schemas.
fn choices(items: &Value) -> Vec<(&str, &Value)> {
    let all = items.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    all.filter_map(|c| Some((c.pointer("/properties/kind/const")?.as_str()?, c))).collect()
}

/// Words that a parameter accepts, with their descriptions.
fn words(schema: &Value) -> Vec<(String, String)> {
    let all = schema.get("oneOf").and_then(Value::as_array).into_iter().flatten();
    let described = all.filter(|word| word.get("description").is_some());
    described.filter_map(|word| Some((word.get("const")?.to_string(), text_of(word)))).collect()
}

/// The description of a schema, on one line.
pub fn text_of(schema: &Value) -> String {
    schema.get("description").and_then(Value::as_str).unwrap_or_default().replace('\n', " ")
}

/// The schema that a reference points to, also if it is optional.
fn resolve<'a>(schema: &'a Value, root: &'a Value) -> &'a Value {
    let something =
        schema.get("anyOf").and_then(Value::as_array).and_then(|any| any.iter().find(|s| s["type"] != "null"));
    let schema = something.unwrap_or(schema);
    let target = schema.get("$ref").and_then(Value::as_str).and_then(|r| r.strip_prefix('#'));
    target.and_then(|path| root.pointer(path)).unwrap_or(schema)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Numbers, words, lists and tables within tables; a table that contains itself is expanded once.
    #[test]
    fn val_parameters_of_a_schema() {
        let schema = json!({
            "required": ["sigma_m", "low"],
            "properties": {
                "kind": { "const": "x" },
                "sigma_m": { "type": "number", "description": "Height.\nIn m." },
                "low": { "$ref": "#/$defs/Layer" },
                "phase": {
                    "description": "Phase.",
                    "default": "unit",
                    "oneOf": [
                        { "const": "unit", "description": "Exact." },
                        { "const": "gaussian", "description": "Random." },
                    ],
                },
                "window": { "type": ["array", "null"], "items": { "type": "number" }, "minItems": 4, "maxItems": 4 },
            },
            "$defs": {
                "Layer": {
                    "type": "object",
                    "description": "A layer.",
                    "properties": {
                        "count": { "type": "integer", "default": 3, "description": "How many." },
                        "inner": { "anyOf": [{ "$ref": "#/$defs/Layer" }, { "type": "null" }] },
                    },
                },
            },
        });
        let mut rows = parameters(&schema);
        rows.sort_by(|a, b| a.name.cmp(&b.name));
        let of = |p: &Parameter| [&p.name, &p.holds, &p.default, &p.meaning].map(String::clone);
        let told: Vec<[String; 4]> = rows.iter().map(of).collect();
        let expected = [
            ["low", "table", "", "A layer."],
            ["low.count", "integer", "3", "How many."],
            ["low.inner", "table", "", "A layer."],
            ["phase", "word", "\"unit\"", "Phase."],
            ["phase = \"gaussian\"", "", "", "Random."],
            ["phase = \"unit\"", "", "", "Exact."],
            ["sigma_m", "number", "", "Height. In m."],
            ["window", "list of 4 numbers", "", ""],
        ];
        assert_eq!(told, expected);
        let required: Vec<&str> = rows.iter().filter(|p| p.is_required).map(|p| p.name.as_str()).collect();
        assert_eq!(required, ["low", "sigma_m"]);
    }

    /// Tables of a list are told apart by their kind, and the keys of each follow it.
    #[test]
    fn val_kinds_of_the_tables_of_a_list() {
        let schema = json!({
            "properties": {
                "processes": {
                    "type": "array",
                    "description": "What happens.",
                    "items": {
                        "oneOf": [{
                            "description": "Craters.",
                            "properties": {
                                "kind": { "const": "craters" },
                                "count": { "type": "integer", "description": "How many." },
                            },
                        }],
                    },
                },
            },
        });
        let names: Vec<String> = parameters(&schema).into_iter().map(|p| p.name).collect();
        assert_eq!(names, ["processes", "processes[craters]", "processes[craters].count"]);
    }
}
