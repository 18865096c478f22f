//! Studies: text, head, and the tables of the sections.

pub mod entry;
pub mod keys;
mod orcid;
pub mod text;

pub use entry::{Entry, Expanded};
use keys::UnknownKey;
pub use text::{Refusals, StudyError, StudyText};

use sastrugi_schemas::ParameterError;
use sastrugi_schemas::kind::{read_all, remove, schema_of};
use sastrugi_schemas::study::{McapFlavour, RoughnessSection, Shares, StudyHead};
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Start of the message on an unknown section.
pub const UNKNOWN_SECTION: &str = "unknown section";

/// A study after reading: the head is checked, the items are still tables.
pub struct Study {
    /// `[study]`.
    pub head: StudyHead,
    /// `[roughness]`.
    pub roughness: RoughnessSection,
    /// Base folder of relative paths.
    pub folder: PathBuf,
    text: StudyText,
    root: Map<String, Value>,
}

impl Study {
    /// Reads a study from its text; relative paths start from `folder`.
    ///
    /// # Errors
    /// All errors outside the items, with their places.
    pub fn parse(raw: &str, folder: &Path, sections: &[&'static str]) -> Result<Self, Refusals> {
        let (study, errors) = Self::read(raw, folder, sections)?;
        Refusals::none(errors).map(|()| study)
    }

    /// The same, but returns the errors outside the items along with the study, so that its items can be checked as well.
    ///
    /// # Errors
    /// A text that is not valid TOML.
    pub fn read(raw: &str, folder: &Path, sections: &[&'static str]) -> Result<(Self, Vec<StudyError>), StudyError> {
        let text = StudyText::parse(raw)?;
        let Value::Object(root) = text.to_json()? else {
            return Err(StudyError::at(None, "a study must be a table of sections"));
        };
        let mut errors = Vec::new();
        let head = read_head(&root, &text, &mut errors);
        let roughness = read_section::<RoughnessSection>(&root, &text, "roughness", &mut errors).unwrap_or_default();
        errors.extend(check_roughness(&roughness).err().map(|e| section_error(&text, "roughness", e)));
        let study = Self { head, roughness, folder: folder.to_owned(), text, root };
        errors.extend(study.unknown_sections(sections));
        Ok((study, errors))
    }

    /// The tables of `[[section]]`, in order.
    ///
    /// # Errors
    /// A section that is not an array of tables.
    pub fn entries(&self, section: &'static str) -> Result<Vec<Entry<'_>>, StudyError> {
        let Some(value) = self.root.get(section) else { return Ok(Vec::new()) };
        let tables = value.as_array().map(|list| list.iter().map(Value::as_object).collect::<Option<Vec<_>>>());
        let Some(Some(tables)) = tables else {
            let message = format!("`{section}` must be written as [[{section}]], one table per item");
            return Err(StudyError::at(self.text.span(&[section.to_owned()], true), message));
        };
        Ok(tables.into_iter().enumerate().map(|(index, table)| Entry::new(section, index, table, &self.text)).collect())
    }

    /// Byte range of the value at a path (array positions as numbers) in the study's text; `None` if it does not exist.
    pub fn span_of(&self, path: &[String]) -> Option<Range<usize>> {
        self.text.exact_span(path)
    }

    fn unknown_sections(&self, sections: &[&'static str]) -> Vec<StudyError> {
        let known = || ["study"].into_iter().chain(sections.iter().copied());
        let names: Vec<&str> = known().collect();
        let unknown = self.root.keys().filter(|k| !known().any(|s| s == *k));
        let refuse = |unknown: &String| {
            let span = self.text.span(std::slice::from_ref(unknown), true);
            if !self.root.get(unknown).is_some_and(is_section) {
                let message =
                    format!("the key `{unknown}` is outside every section; put it below its section, such as [study]");
                return StudyError::at(span, message);
            }
            let message = format!("{UNKNOWN_SECTION} `{unknown}`; known: {}", names.join(", "));
            let help = keys::nearest(unknown, known()).map(|n| format!("did you mean `{n}`?"));
            StudyError::at(span, message).with_help(help)
        };
        unknown.map(refuse).collect()
    }
}

/// True for what TOML writes as `[name]` or `[[name]]`.
fn is_section(value: &Value) -> bool {
    let is_list = |list: &Vec<Value>| !list.is_empty() && list.iter().all(Value::is_object);
    value.is_object() || value.as_array().is_some_and(is_list)
}

/// Reads the head; if that fails, returns a partial head with which the items can be checked.
fn read_head(root: &Map<String, Value>, text: &StudyText, errors: &mut Vec<StudyError>) -> StudyHead {
    if !root.contains_key("study") {
        errors.push(StudyError::at(None, "missing section [study]; it must contain at least name, seed and date"));
    }
    let Some(mut head) = read_section::<StudyHead>(root, text, "study", errors) else { return readable_head(root) };
    if head.title.is_empty() {
        head.title.clone_from(&head.name);
    }
    let checks = [
        check_id("name", &head.name),
        check_date(&head.date),
        check_license(&head.license),
        check_version(head.version.as_deref()),
        check_url(head.url.as_deref()),
        check_doi(head.doi.as_deref()),
        check_split(head.split),
        check_creators(&head),
        check_organizations(&head),
        check_orcids(&head),
        check_words("keywords", &head.keywords),
        check_words("funding", &head.funding),
        check_epoch(&head),
    ];
    errors.extend(checks.into_iter().filter_map(Result::err).map(|e| section_error(text, "study", e)));
    head
}

/// A head with all readable keys, for checking what depends on it; its errors have been reported.
fn readable_head(root: &Map<String, Value>) -> StudyHead {
    let keys = root.get("study").and_then(Value::as_object).into_iter().flatten();
    keys.fold(StudyHead::default(), |head, (key, value)| {
        let with = serde_json::to_value(&head).map(|mut all| {
            all[key] = value.clone();
            all
        });
        with.and_then(serde_json::from_value).unwrap_or(head)
    })
}

/// Reads a section that is a single table, if it is present and valid.
fn read_section<T>(
    root: &Map<String, Value>,
    text: &StudyText,
    section: &str,
    errors: &mut Vec<StudyError>,
) -> Option<T>
where
    T: serde::de::DeserializeOwned + schemars::JsonSchema,
{
    let mut value = root.get(section)?.clone();
    let unknown = keys::find_unknown(&value, &schema_of::<T>());
    for key in &unknown {
        errors.push(unknown_key(text, &[section.to_owned()], key));
        remove(&mut value, &key.path);
    }
    // A required key given under another name is not reported as missing too.
    let is_told = |e: &ParameterError| unknown.iter().filter_map(UnknownKey::nearest).any(|key| e.is_missing(key));
    match read_all(value) {
        Ok(read) => Some(read),
        Err(refused) => {
            errors.extend(refused.into_iter().filter(|e| !is_told(e)).map(|e| section_error(text, section, e)));
            None
        }
    }
}

fn section_error(text: &StudyText, section: &str, error: ParameterError) -> StudyError {
    let path: Vec<String> = [section].into_iter().chain(segments(&error.key)).map(str::to_owned).collect();
    StudyError::at(text.span(&path, false), format!("[{section}] {error}"))
}

/// The segments of a dotted path; array positions are separate segments.
fn segments(key: &str) -> impl Iterator<Item = &str> {
    key.split(['.', '[', ']']).filter(|s| !s.is_empty())
}

fn unknown_key(text: &StudyText, parent: &[String], unknown: &keys::UnknownKey) -> StudyError {
    let path: Vec<String> = parent.iter().chain(&unknown.path).cloned().collect();
    let place = parent.first().map_or("", String::as_str);
    let message = format!("unknown key `{}` in {place}", unknown.path.join("."));
    let help = match unknown.nearest() {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("known keys: {}", unknown.known.join(", ")),
    };
    let meant = unknown.nearest().map(Into::into);
    let error = StudyError::at(text.span(&path, true), message).with_help(Some(help));
    StudyError { key: unknown.path.clone().into(), meant, ..error }
}

/// Refuses settings of `[roughness]` that are out of range.
///
/// # Errors
/// The first one.
pub fn check_roughness(section: &RoughnessSection) -> Result<(), ParameterError> {
    ParameterError::positive("low_max", section.low_max)?;
    ParameterError::positive("semi_max", section.semi_max)?;
    ParameterError::not_negative("border_m", section.border_m)?;
    ParameterError::not_negative("closing_radius_m", section.closing_radius_m)?;
    section.band_window_m.map_or(Ok(0.0), |w| ParameterError::positive("band_window_m", w))?;
    if section.semi_max <= section.low_max {
        let message = format!("must be above low_max = {}, got {}", section.low_max, section.semi_max);
        return Err(ParameterError::new("semi_max", message));
    }
    Ok(())
}

/// Ids match `[a-z0-9][a-z0-9.-]{0,63}`.
fn check_id(key: &str, id: &str) -> Result<(), ParameterError> {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    let right = id.len() <= 64 && id.starts_with(plain) && id.chars().all(|c| plain(c) || c == '.' || c == '-');
    if right {
        return Ok(());
    }
    let rule = "must be 1 to 64 characters of a-z, 0-9, `.` and `-`, starting with a letter or digit";
    Err(ParameterError::new(key, format!("{rule}, got \"{id}\"")))
}

/// Dates must be valid days of the Gregorian calendar.
fn check_date(date: &str) -> Result<(), ParameterError> {
    let part = |range: std::ops::Range<usize>| date.get(range)?.parse::<u32>().ok();
    let shape = date.len() == 10
        && date.bytes().enumerate().all(|(i, b)| match i {
            4 | 7 => b == b'-',
            _ => b.is_ascii_digit(),
        });
    let day_exists = || {
        let (year, month, day) = (part(0..4)?, part(5..7)?, part(8..10)?);
        let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        let days = [31, if leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
        let last = *days.get((month as usize).checked_sub(1)?)?;
        (year > 0 && (1..=last).contains(&day)).then_some(())
    };
    if shape && day_exists().is_some() {
        return Ok(());
    }
    Err(ParameterError::new("date", format!("must be a date, YYYY-MM-DD, got \"{date}\"")))
}

fn check_license(license: &str) -> Result<(), ParameterError> {
    if license.trim().is_empty() {
        return Err(ParameterError::new("license", "is empty; it must be an SPDX expression such as CC-BY-4.0"));
    }
    Ok(())
}

fn check_split(split: Option<Shares>) -> Result<(), ParameterError> {
    let Some(shares) = split.map(Shares::by_part) else { return Ok(()) };
    let written = match split {
        Some(Shares::Two(two)) => format!("{two:?}"),
        _ => format!("{shares:?}"),
    };
    let refuse = |rule: &str| Err(ParameterError::new("split", format!("{rule}, got {written}")));
    if !shares.iter().all(|share| (0.0..=1.0).contains(share)) {
        return refuse("must be shares from 0 to 1");
    }
    if (shares.iter().sum::<f64>() - 1.0).abs() > 1e-9 {
        return refuse("must add up to 1 (such as [0.7, 0.15, 0.15])");
    }
    if shares.iter().filter(|share| **share > 0.0).count() < 2 {
        return refuse("must have at least two shares above 0");
    }
    Ok(())
}

fn check_version(version: Option<&str>) -> Result<(), ParameterError> {
    match version {
        Some(v) if v.trim().is_empty() => {
            Err(ParameterError::new("version", "is empty; it must be a text such as \"1.0.0\""))
        }
        _ => Ok(()),
    }
}

fn check_url(url: Option<&str>) -> Result<(), ParameterError> {
    let right = |url: &str| {
        let rest = url.strip_prefix("https://").or_else(|| url.strip_prefix("http://"));
        rest.is_some_and(|rest| !rest.is_empty() && !rest.contains(|c: char| c.is_whitespace() || c.is_control()))
    };
    match url {
        Some(url) if !right(url) => {
            Err(ParameterError::new("url", format!("must be an address, https://..., got \"{url}\"")))
        }
        _ => Ok(()),
    }
}

/// Recordings store seconds in 32 bits, signed in ROS 2.
fn check_epoch(head: &StudyHead) -> Result<(), ParameterError> {
    let (last_s, year) = match head.mcap {
        McapFlavour::Viewer => (u64::from(u32::MAX), 2106),
        McapFlavour::Ros2 => (i32::MAX as u64, 2038),
    };
    // Leave a year for the missions.
    if head.epoch_ns / 1_000_000_000 + 366 * 86_400 <= last_s {
        return Ok(());
    }
    let rule = format!(
        "timestamps of these recordings end in {year}; it must lie at least a year earlier, in ns since 1970-01-01"
    );
    Err(ParameterError::new("epoch_ns", format!("is {}; {rule}", head.epoch_ns)))
}

/// Creators must have names, without repetition.
fn check_creators(head: &StudyHead) -> Result<(), ParameterError> {
    let plain = |name: &str| name.split(',').map(str::trim).collect::<Vec<_>>().join(", ").to_lowercase();
    let names: Vec<String> = head.creators.iter().map(|creator| plain(creator.name())).collect();
    for (k, name) in names.iter().enumerate() {
        let wrong = match () {
            () if name.trim_matches([',', ' ']).is_empty() => "is empty; a creator needs a name",
            () if names[..k].contains(name) => "lists a creator twice",
            () => continue,
        };
        return Err(ParameterError::new(format!("creators.{k}"), wrong.to_owned()));
    }
    Ok(())
}

/// Organisations must be among the creators.
fn check_organizations(head: &StudyHead) -> Result<(), ParameterError> {
    let is_creator = |name: &str| head.creators.iter().any(|creator| creator.name() == name);
    match head.organizations.iter().find(|name| !is_creator(name)) {
        Some(name) => {
            Err(ParameterError::new("organizations", format!("names \"{name}\", which is not in `creators`")))
        }
        None => Ok(()),
    }
}

/// ORCID iDs must be valid, belong to people, and be unique; affiliations must not be empty.
fn check_orcids(head: &StudyHead) -> Result<(), ParameterError> {
    let mut seen = BTreeSet::new();
    for (k, creator) in head.creators.iter().enumerate() {
        let refuse = |key: &str, why: String| Err(ParameterError::new(format!("creators.{k}.{key}"), why));
        if creator.affiliation().is_some_and(|affiliation| affiliation.trim().is_empty()) {
            return refuse("affiliation", "is empty; omit it, or name an organisation".to_owned());
        }
        let Some(orcid) = creator.orcid() else { continue };
        if let Err(wrong) = orcid::check(orcid) {
            return refuse("orcid", format!("is {wrong}"));
        }
        if head.organizations.iter().any(|name| name == creator.name()) {
            return refuse(
                "orcid",
                format!("belongs to \"{}\", an organisation; only people have ORCID iDs", creator.name()),
            );
        }
        if !seen.insert(orcid) {
            return refuse("orcid", format!("is \"{orcid}\", the same as that of another creator"));
        }
    }
    Ok(())
}

/// Words of a list must not be empty or repeated.
fn check_words(key: &str, words: &[String]) -> Result<(), ParameterError> {
    for (k, word) in words.iter().enumerate() {
        let wrong = match () {
            () if word.trim().is_empty() => "is empty".to_owned(),
            () if words[..k].contains(word) => format!("\"{word}\" is listed twice"),
            () => continue,
        };
        return Err(ParameterError::new(format!("{key}.{k}"), wrong));
    }
    Ok(())
}

/// DOIs must be `10.`, four to nine digits, optionally one more group of digits, `/`, and a suffix (pattern of the Citation File Format).
fn check_doi(doi: Option<&str>) -> Result<(), ParameterError> {
    let right = |doi: &str| {
        let (registrant, suffix) = doi.strip_prefix("10.")?.split_once('/')?;
        let (first, more) = registrant.split_once('.').map_or((registrant, None), |(first, more)| (first, Some(more)));
        let is_number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        let digits = (4..=9).contains(&first.len()) && is_number(first) && more.is_none_or(is_number);
        let plain = !suffix.is_empty() && suffix.bytes().all(|b| b.is_ascii_alphanumeric() || b"._;()/:-".contains(&b));
        (digits && plain).then_some(())
    };
    match doi {
        Some(doi) if right(doi).is_none() => {
            let rule = "must be a plain DOI such as 10.5281/zenodo.1234567, without https://doi.org/";
            Err(ParameterError::new("doi", format!("{rule}, got \"{doi}\"")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "[study]\nname = \"x\"\nseed = 1\ndate = \"2024-02-29\"\n";

    fn parse(text: &str) -> Result<Study, Refusals> {
        Study::parse(text, Path::new("."), &["terrain", "dem", "roughness"])
    }

    fn refusal(text: &str) -> (String, String) {
        let Refusals(errors) = parse(text).err().expect("refused");
        let [error] = errors.as_slice() else { panic!("{errors:?}") };
        (error.message.clone(), error.span.clone().map(|s| text[s].to_owned()).unwrap_or_default())
    }

    #[test]
    fn val_defaults() {
        let study = parse(HEAD).unwrap();
        assert_eq!((study.head.title.as_str(), study.head.epoch_ns), ("x", 1_700_000_000_000_000_000));
        assert!((study.roughness.low_max - 0.293).abs() < 1e-3 && (study.roughness.semi_max - 0.820).abs() < 1e-3);
    }

    #[test]
    fn val_a_head_that_is_cited_by_version_and_doi() {
        let more = "version = \"1.2\"\nurl = \"https://example.org/a\"\ndoi = \"10.5281/zenodo.1234567\"\n";
        let head = parse(&format!("{HEAD}{more}")).unwrap().head;
        assert_eq!((head.version.as_deref(), head.doi.as_deref()), (Some("1.2"), Some("10.5281/zenodo.1234567")));
    }

    #[test]
    fn val_creators_are_names_or_tables() {
        let more = "creators = [\"Snow Lab\", { name = \"Doe, Jane\", orcid = \"0000-0002-1825-0097\", affiliation = \"Snow Lab\" }]\n\
            organizations = [\"Snow Lab\"]\nkeywords = [\"snow\"]\nfunding = [\"a fund\"]\n";
        let head = parse(&format!("{HEAD}{more}")).unwrap().head;
        let told: Vec<_> = head.creators.iter().map(|c| (c.name(), c.orcid(), c.affiliation())).collect();
        let jane = ("Doe, Jane", Some("0000-0002-1825-0097"), Some("Snow Lab"));
        assert_eq!(told, [("Snow Lab", None, None), jane]);
    }

    #[test]
    fn val_refusals_name_the_place() {
        let at = |text: &str, words: &str, place: &str| {
            let (message, span) = refusal(text);
            assert!(message.contains(words) && span == place, "{message:?} at {span:?}");
        };
        at(&HEAD.replace("2024-02-29", "0000-01-01"), "YYYY-MM-DD", "\"0000-01-01\"");
        at(&format!("{HEAD}doi = \"10.1234.5.6/x\"\n"), "plain DOI", "\"10.1234.5.6/x\"");
        at(&format!("{HEAD}doi = \"10.1234./x\"\n"), "plain DOI", "\"10.1234./x\"");
        at(&format!("{HEAD}creators = [\"A\", \" , \"]\n"), "is empty", "\" , \"");
        at(&format!("{HEAD}creators = [\"Doe, Jane\", \"Doe,Jane\"]\n"), "twice", "\"Doe,Jane\"");
        at(&HEAD.replace("02-29", "02-30"), "YYYY-MM-DD", "\"2024-02-30\"");
        at(&HEAD.replace("2024-02-29", "2024-€2-29"), "YYYY-MM-DD", "\"2024-€2-29\"");
        at(&HEAD.replace("seed", "sead"), "unknown key `sead`", "sead");
        at(&HEAD.replace("\"x\"", "\"X y\""), "a-z", "\"X y\"");
        at(&HEAD.replace("seed = 1", "seed = -1"), "seed", "-1");
        at(&format!("{HEAD}mcap = \"ros2\"\nepoch_ns = 3000000000000000000\n"), "2038", "3000000000000000000");
        at(&format!("{HEAD}epoch_ns = 5000000000000000000\n"), "2106", "5000000000000000000");
        at(&format!("{HEAD}version = \" \"\n"), "1.0.0", "\" \"");
        at(&format!("{HEAD}url = \"example.org\"\n"), "https://", "\"example.org\"");
        for doi in ["https://doi.org/10.5281/zenodo.1", "10.5281", "10.52/a", "10.5281/a b", "10.5281/"] {
            at(&format!("{HEAD}doi = \"{doi}\"\n"), "plain DOI", &format!("\"{doi}\""));
        }
        at(&format!("{HEAD}creators = [\"a\"]\norganizations = [\"b\"]\n"), "not in `creators`", "[\"b\"]");
        let creator = |table: &str| format!("{HEAD}creators = [\"Roe, R.\", {{ name = \"Doe, J.\", {table} }}]\n");
        at(&creator("orcid = \"0000-0002-1825-0079\""), "checksum is wrong", "\"0000-0002-1825-0079\"");
        at(&creator("orcid = \"0000-0002-1825\""), "plain ORCID iD", "\"0000-0002-1825\"");
        at(&creator("affiliation = \" \""), "is empty", "\" \"");
        at(&creator("orchid = \"0000-0002-1825-0097\""), "unknown key `creators.1.orchid`", "orchid");
        let of_group = creator("orcid = \"0000-0002-1825-0097\"") + "organizations = [\"Doe, J.\"]\n";
        at(&of_group, "an organisation", "\"0000-0002-1825-0097\"");
        at(&format!("{HEAD}keywords = [\"snow\", \"snow\"]\n"), "twice", "\"snow\"");
        at(&format!("{HEAD}[roughness]\nlow_max = 2.0\n"), "above low_max", "[roughness]");
        at(&format!("{HEAD}[[terain]]\nid = \"a\"\n"), "unknown section `terain`", "terain");
        at(&format!("{HEAD}[extra]\n"), "unknown section", "extra");
        at(&format!("extra = 1\n{HEAD}"), "outside every section", "extra");
        at(&format!("split = [0.8, 0.2]\n{HEAD}"), "outside every section", "split");
        at(&format!("extra = [{{ id = \"a\" }}]\n{HEAD}"), "unknown section", "extra");
    }
}
