//! The documents of a release for people: what it is, how to cite it, under which licence.

use super::assemble::Contents;
use sastrugi_schemas::study::StudyHead;
use sastrugi_schemas::tables;
use std::fmt::Write as _;

/// `README.md`.
pub fn readme(contents: &Contents<'_>) -> String {
    let head = contents.head;
    let mut text = format!("# {}\n\n", head.title);
    if !head.description.is_empty() {
        let _ = writeln!(text, "{}\n", head.description);
    }
    let _ = writeln!(
        text,
        "Study `{}`, seed {}, {}. Licence: {}. Made with sastrugi {}; `sastrugi verify .` checks every file, and \
         `sastrugi verify . --recompute all` makes it again and compares the bytes.\n",
        head.name,
        head.seed,
        head.date,
        head.license,
        env!("CARGO_PKG_VERSION")
    );
    text.push_str(
        "| where | what |\n|---|---|\n\
         | `report/index.html` | report, one offline page |\n\
         | `study.toml` | the study: everything here follows from it |\n\
         | `dem/` | measured inputs, and the same in metres (`.metric.tif`) |\n\
         | `mask/` | masks of the fits |\n\
         | `terrain/`, `texture/` | heightfields, GeoTIFF, float32 metres, no data -9999 |\n\
         | `classes/` | roughness classes: 0 low, 1 semi, 2 high, 255 none; `.raw.tif` before closing |\n\
         | `fit/` | covariance fits (JSON), with background, residual and the cells used |\n\
         | `mcap/` | one recording per mission |\n\
         | `tables/` | Parquet, units and descriptions in the column metadata |\n\
         | `manifest.json`, `SHA256SUMS` | what each file is made from, and its checksum |\n\n",
    );
    text.push_str("| table | a row is |\n|---|---|\n");
    for table in tables::ALL {
        let _ = writeln!(text, "| `{}` | {} |", table.name, table.description);
    }
    if !contents.failures.is_empty() {
        let _ = writeln!(
            text,
            "\n{} items failed; `manifest.json` lists them with their parameters:\n",
            contents.failures.len()
        );
        for failure in contents.failures {
            let _ = writeln!(text, "- `{}`: {}", failure.item, failure.message);
        }
    }
    text
}

/// `CITATION.cff`.
pub fn citation(head: &StudyHead) -> String {
    let mut text = format!(
        "cff-version: 1.2.0\nmessage: \"If you use this dataset, please cite it as below.\"\ntype: dataset\ntitle: {}\ndate-released: {}\n",
        quoted(&head.title),
        head.date
    );
    let _ = writeln!(text, "license: {}", quoted(&head.license));
    text.push_str("authors:\n");
    let unnamed = ["unnamed".to_owned()];
    let authors = if head.creators.is_empty() { &unnamed[..] } else { &head.creators };
    for author in authors {
        let _ = writeln!(text, "  - name: {}", quoted(author));
    }
    text
}

/// `LICENSE`.
pub fn license(head: &StudyHead) -> String {
    format!(
        "SPDX-License-Identifier: {0}\n\nThis dataset is licensed under {0}. Its text is found by that identifier in the SPDX licence list.\n\
         Measured inputs in dem/ keep their own licences, as study.toml states them.\n",
        head.license
    )
}

/// A YAML string in double quotes; JSON's quoting is a part of YAML's.
fn quoted(text: &str) -> String {
    serde_json::Value::String(text.to_owned()).to_string()
}
