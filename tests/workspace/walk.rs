//! The walk of CONTRIBUTING.md, followed step by step in a scratch copy of the checkout.

use sastrugi_tests::checkout::{self, run};
use std::fs;
use std::path::{Path, PathBuf};

/// A fenced block of the page that the walk uses.
#[derive(Debug, PartialEq)]
enum Step {
    /// Text for a file: the whole file, or lines to insert below the line `after`.
    Write { file: String, after: Option<String>, text: String },
    /// Commands, one on each line.
    Run(Vec<String>),
}

/// The value of `key=VALUE` or `key="VALUE"` in the words behind the opening fence.
fn attribute(words: &str, key: &str) -> Option<String> {
    let rest = words.split_once(&format!("{key}="))?.1;
    let value = match rest.strip_prefix('"') {
        Some(quoted) => quoted.split('"').next(),
        None => rest.split_whitespace().next(),
    };
    value.map(str::to_owned)
}

/// The steps of a page, in order.
fn steps(page: &str) -> Vec<Step> {
    let mut steps = Vec::new();
    for block in page.split("```").skip(1).step_by(2) {
        let (words, text) = block.split_once('\n').unwrap_or((block, ""));
        if let Some(file) = attribute(words, "file") {
            steps.push(Step::Write { file, after: attribute(words, "after"), text: text.to_owned() });
        } else if words == "sh walk" {
            steps.push(Step::Run(text.lines().map(str::to_owned).collect()));
        }
    }
    steps
}

/// The text of a file with `lines` inserted below the first line that reads `after`.
fn inserted(text: &str, after: &str, lines: &str) -> String {
    let marked = format!("{after}\n");
    let at = text.find(&marked).unwrap_or_else(|| panic!("there is no line `{after}`")) + marked.len();
    format!("{}{lines}{}", &text[..at], &text[at..])
}

/// Settings of cargo with which the room of the generator and those that use it, all of which the walk compiles again, are not optimised.
const QUICKLY: &str = "[profile.release.package]\n\
    sastrugi-terrain.opt-level = 0\nsastrugi-stages.opt-level = 0\nsastrugi-server.opt-level = 0\nsastrugi-cli.opt-level = 0\n";

/// A checkout with the compiled libraries, so that only what the walk touches is built again.
fn scratch() -> PathBuf {
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("walk");
    checkout::copy(&copy);
    sastrugi_tests::copy_build(&copy.join("target"));
    fs::create_dir_all(copy.join(".cargo")).unwrap();
    fs::write(copy.join(".cargo/config.toml"), QUICKLY).unwrap();
    copy
}

#[test]
fn val_the_walk_of_contributing_has_its_steps() {
    let page = fs::read_to_string(sastrugi_fixtures::workspace_root().join("CONTRIBUTING.md")).unwrap();
    let steps = steps(&page);
    let commands = steps.iter().filter(|step| matches!(step, Step::Run(_))).count();
    assert_eq!((steps.len(), commands), (6, 1), "{steps:?}");
    // The lines that the walk inserts below are there, also while nobody runs it.
    for step in &steps {
        if let Step::Write { file, after: Some(after), text } = step {
            let path = sastrugi_fixtures::workspace_root().join(file);
            inserted(&fs::read_to_string(path).unwrap(), after, text);
        }
    }
}

#[test]
fn val_steps_are_read_and_lines_inserted() {
    let page = "```rust file=a.rs after=\"b {\"\nx\n```\n```sh\nno\n```\n```sh walk\nls\n```\n";
    let write = Step::Write { file: "a.rs".to_owned(), after: Some("b {".to_owned()), text: "x\n".to_owned() };
    assert_eq!(steps(page), [write, Step::Run(vec!["ls".to_owned()])]);
    assert_eq!(inserted("a {\nb {\n}\n", "b {", "x\n"), "a {\nb {\nx\n}\n");
}

#[test]
#[ignore = "slow: it compiles"]
fn val_the_walk_of_contributing_works() {
    let copy = scratch();
    let page = fs::read_to_string(copy.join("CONTRIBUTING.md")).unwrap();
    for step in steps(&page) {
        match step {
            Step::Write { file, after, text } => {
                let path = copy.join(file);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                let text = match after {
                    Some(after) => inserted(&fs::read_to_string(&path).unwrap(), &after, &text),
                    None => text,
                };
                fs::write(path, text).unwrap();
            }
            Step::Run(lines) => lines.iter().for_each(|line| run(&copy, &format!("unset CARGO_TARGET_DIR; {line}"))),
        }
    }
    run(&copy, "cargo fmt --all --check");
    for made in ["ripples.tif", "ripples.png"] {
        assert!(fs::metadata(copy.join(made)).unwrap().len() > 1000, "{made}");
    }
    fs::remove_dir_all(&copy).unwrap();
}
