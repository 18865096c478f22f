//! `init`: writes a starting study.

use crate::Verdict;
use crate::args::{Common, Init};
use crate::failure::{Code, Failure};
use crate::output::print;
use sastrugi_stages::Error;
use sastrugi_stages::remote::check_file;
use sastrugi_stages::schema::{is_own, study_schema};
use sastrugi_stages::starting::{SCHEMA, STARTING};
use sastrugi_store::{atomic, file};
use serde_json::json;
use std::io::ErrorKind;

/// `init`.
pub fn init(args: &Init, common: &Common) -> Verdict {
    let starting = STARTING.iter().find(|s| s.name == args.kind);
    let starting = starting.ok_or_else(|| Failure::usage(format!("unknown kind `{}`", args.kind)))?;
    let (path, schema) = (&args.output, args.output.with_file_name(SCHEMA));
    let Some(name) = path.file_name().map(|name| name.to_string_lossy().into_owned()) else {
        return Err(Failure::usage(format!("{} is not a file name", path.display())));
    };
    if name == SCHEMA {
        return Err(Failure::usage(format!("{name} is reserved for the schema; choose another name with -o")));
    }
    if path.exists() {
        return Err(Failure::usage(format!("{} already exists; choose another name with -o", path.display())));
    }
    // A schema of the program may be from an earlier version, and is replaced. Pipes and folders are not schemas.
    let is_foreign = match file::read(&schema) {
        Ok(text) => !is_own(&text),
        Err(e) if e.kind() == ErrorKind::NotFound => false,
        Err(e) if matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::IsADirectory) => true,
        Err(e) => return Err(Error::at(&schema, e).into()),
    };
    if is_foreign {
        let message = "is not a schema of this program; move it, or write the study to another folder with -o";
        return Err(Failure::usage(format!("{} {message}", schema.display())));
    }
    check_file(&schema)?;
    let published = serde_json::to_string_pretty(&study_schema()).map_err(Failure::failed)? + "\n";
    for (path, text) in [(&schema, published), (path, starting.text.replace("study.toml", &name))] {
        atomic::write(path, text.as_bytes()).map_err(|e| Error::at(path, e))?;
    }
    let (path, schema) = (path.display(), schema.display());
    let first = starting.needs.map_or_else(String::new, |needs| format!("{needs}, then "));
    let text =
        format!("{path}: {}\n{schema}: schema for your editor\nnext: {first}sastrugi plan {path}", starting.summary);
    print(
        common.json,
        &json!({ "study": path.to_string(), "schema": schema.to_string(), "kind": starting.name }),
        &text,
    )?;
    Ok(Code::Done)
}
