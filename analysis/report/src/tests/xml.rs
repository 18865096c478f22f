//! A slow, strict XML reader (also for the HTML that this crate writes), for tests only.

/// Elements of HTML that have no end tag.
const VOID: [&str; 4] = ["meta", "br", "wbr", "hr"];

/// Panics unless the text is one well-formed XML element.
pub fn assert_well_formed(text: &str) {
    if let Err(e) = check(text, false) {
        panic!("{e}");
    }
}

/// Panics unless the text is an HTML page whose elements nest.
pub fn assert_nests(text: &str) {
    let body = text.strip_prefix("<!DOCTYPE html>\n").expect("a document type");
    if let Err(e) = check(body, true) {
        panic!("{e}");
    }
}

fn check(text: &str, html: bool) -> Result<(), String> {
    let mut open: Vec<String> = Vec::new();
    let mut rest = text;
    let mut elements = 0;
    while let Some(start) = rest.find('<') {
        data(&rest[..start])?;
        let end = rest[start..].find('>').ok_or("a tag without its end")? + start;
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            let expected = open.pop().ok_or_else(|| format!("</{name}> closes nothing"))?;
            if expected != name {
                return Err(format!("</{name}> where </{expected}> was due"));
            }
            continue;
        }
        elements += 1;
        if open.is_empty() && elements > 1 && !html {
            return Err("two root elements".into());
        }
        let (body, closed) = tag.strip_suffix('/').map_or((tag, false), |b| (b, true));
        let name = body.split_whitespace().next().ok_or("a tag without a name")?;
        if !name.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Err(format!("bad name {name}"));
        }
        attributes(&body[name.len()..], html)?;
        let void = html && VOID.contains(&name);
        if !closed && !void {
            open.push(name.to_owned());
            if html && name == "style" {
                rest = &rest[rest.find("</style>").ok_or("style without its end")?..];
            }
        }
    }
    data(rest)?;
    if open.is_empty() && elements > 0 { Ok(()) } else { Err(format!("{open:?} not closed")) }
}

fn attributes(text: &str, html: bool) -> Result<(), String> {
    let mut rest = text.trim();
    let mut names = Vec::new();
    while !rest.is_empty() {
        let (name, after) = rest.split_once('=').ok_or_else(|| format!("attribute without value: {rest}"))?;
        let good = |c: char| c.is_ascii_alphanumeric() || "-:".contains(c);
        if name.is_empty() || !name.chars().all(good) || names.contains(&name) {
            return Err(format!("bad or repeated attribute {name}"));
        }
        names.push(name);
        let after = after.strip_prefix('"').ok_or_else(|| format!("{name} is not quoted"))?;
        let (value, next) = after.split_once('"').ok_or_else(|| format!("{name} is not closed"))?;
        if html && name.starts_with("on") {
            return Err(format!("script in {name}"));
        }
        data(value)?;
        rest = next.trim_start();
    }
    Ok(())
}

/// Character data: entities that exist, characters that XML allows.
fn data(text: &str) -> Result<(), String> {
    for (i, _) in text.match_indices('&') {
        let known = ["&amp;", "&lt;", "&gt;", "&quot;", "&#39;"].iter().any(|e| text[i..].starts_with(e));
        if !known {
            return Err(format!("bad entity in {:?}", &text[i..]));
        }
    }
    let allowed =
        |c: char| c >= ' ' && !matches!(c, '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}') || c == '\n' || c == '\t';
    match text.chars().find(|c| !allowed(*c) || *c == '<') {
        Some(c) => Err(format!("bad character {c:?}")),
        None => Ok(()),
    }
}

#[test]
fn val_the_reader_is_strict() {
    assert!(check("<a b=\"1\"><c/>x &amp; y</a>", false).is_ok());
    for bad in
        ["<a>", "<a></b>", "<a b=1/>", "<a b=\"1\" b=\"2\"/>", "<a>&x;</a>", "<a/><b/>", "<a>\u{0}</a>", "</a>", ""]
    {
        assert!(check(bad, false).is_err(), "{bad:?}");
    }
}
