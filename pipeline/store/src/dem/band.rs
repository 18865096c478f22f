//! Kind of values of a raster, as stored in a GeoTIFF: unit and description of the band in GDAL's metadata.

use std::borrow::Cow;
use std::fmt::Write;

/// TIFF tag of GDAL's metadata, XML.
pub(super) const TAG: u16 = 42112;
/// Spellings of metres in use, in lower case.
const METRES: [&str; 6] = ["", "m", "metre", "metres", "meter", "meters"];
/// Item that marks codes, in addition to the items that GDAL defines.
const CODES: &str = "VALUES";

/// Kind of values of a raster.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Values {
    /// Heights, m.
    #[default]
    Heights,
    /// Values of another quantity.
    Quantity {
        /// Unit, `1` for dimensionless values.
        unit: Cow<'static, str>,
        /// Description.
        description: Cow<'static, str>,
    },
    /// Codes, which cannot be averaged: an overview cell holds one of them.
    Codes {
        /// Meaning of the codes.
        description: Cow<'static, str>,
    },
}

impl Values {
    /// Unit; `None` for codes.
    pub fn unit(&self) -> Option<&str> {
        match self {
            Self::Heights => Some("m"),
            Self::Quantity { unit, .. } => Some(unit),
            Self::Codes { .. } => None,
        }
    }

    /// Description; empty if the file gives none.
    pub fn description(&self) -> &str {
        match self {
            Self::Heights => "heights",
            Self::Quantity { description, .. } | Self::Codes { description } => description,
        }
    }

    /// Note for values that are not heights in metres.
    pub(super) fn note(&self) -> Option<String> {
        let unconverted = "they are used unconverted";
        match self {
            Self::Heights => None,
            Self::Quantity { unit, .. } if unit == "m" => None,
            Self::Quantity { unit, .. } => {
                Some(format!("values are in `{unit}` according to the file, not in m; {unconverted}"))
            }
            Self::Codes { description } => {
                Some(format!("values are codes ({description}) according to the file, not heights; {unconverted}"))
            }
        }
    }

    /// The text of the tag.
    pub(super) fn metadata(&self) -> String {
        let mut text = "<GDALMetadata>\n".to_owned();
        // Writing to a string cannot fail.
        let mut item = |name: &str, role: &str, value: &str| {
            let role = if role.is_empty() { String::new() } else { format!(" role=\"{role}\"") };
            let _ = writeln!(text, "  <Item name=\"{name}\" sample=\"0\"{role}>{}</Item>", escaped(value));
        };
        match self {
            Self::Heights => item("UNITTYPE", "unittype", "m"),
            Self::Quantity { unit, description } => {
                item("UNITTYPE", "unittype", unit);
                item("DESCRIPTION", "description", description);
            }
            Self::Codes { description } => {
                item("DESCRIPTION", "description", description);
                item(CODES, "", "codes");
            }
        }
        text.push_str("</GDALMetadata>\n");
        text
    }

    /// Parses the text of the tag for the first band; heights if it states nothing else.
    pub(super) fn of_metadata(text: &str) -> Self {
        let items: Vec<(&str, String)> = items(text).collect();
        let find = |what: &str| items.iter().find(|(attributes, _)| attributes.contains(what)).map(|(_, value)| value);
        let description = Cow::Owned(find("role=\"description\"").cloned().unwrap_or_default());
        let unit = find("role=\"unittype\"").cloned().unwrap_or_default();
        match find(&format!("name=\"{CODES}\"")).map(String::as_str) {
            Some("codes") => Self::Codes { description },
            _ if !METRES.contains(&unit.to_lowercase().as_str()) => {
                Self::Quantity { unit: Cow::Owned(unit), description }
            }
            _ if description.is_empty() => Self::Heights,
            _ => Self::Quantity { unit: Cow::Borrowed("m"), description },
        }
    }
}

/// Attributes and text of the items of the first band.
fn items(text: &str) -> impl Iterator<Item = (&str, String)> {
    let parts = text.split("<Item ").skip(1).filter_map(|part| {
        let (attributes, rest) = part.split_once('>')?;
        let (value, _) = rest.split_once("</Item>")?;
        Some((attributes, unescaped(value.trim())))
    });
    parts.filter(|(attributes, _)| attributes.contains("sample=\"0\""))
}

/// Text of an item, escaped twice, as GDAL writes and reads it.
fn escaped(text: &str) -> String {
    let once = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    once(&once(text))
}

fn unescaped(text: &str) -> String {
    let named = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
    let once = |text: &str| named.iter().fold(text.to_owned(), |text, (name, sign)| text.replace(name, sign));
    once(&once(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Items of two bands, as written by GDAL 3.10.3 (through rasterio).
    #[test]
    fn val_units_of_other_programs() {
        let of = |unit: &str| {
            Values::of_metadata(&format!(
                "<GDALMetadata>\n  <Item name=\"STATISTICS_MEAN\" sample=\"0\">3.5</Item>\n  <Item name=\"AREA\">x</Item>\n  \
                 <Item name=\"DESCRIPTION\" sample=\"0\" role=\"description\">band &amp;amp; &amp;lt;1&amp;gt;</Item>\n  \
                 <Item name=\"UNITTYPE\" sample=\"1\" role=\"unittype\">K</Item>\n  \
                 <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">{unit}</Item>\n</GDALMetadata>\n"
            ))
        };
        let metres = Values::Quantity { unit: "m".into(), description: "band & <1>".into() };
        assert!(["m", "metre", "Meter", ""].iter().all(|unit| of(unit) == metres) && metres.note().is_none());
        assert_eq!(of("ft"), Values::Quantity { unit: "ft".into(), description: "band & <1>".into() });
        assert!(of("ft").note().unwrap().contains("`ft`"));
        assert_eq!(Values::of_metadata("<GDALMetadata><Item name=\"VALUES"), Values::Heights);
    }

    proptest! {
        /// Any metadata is read back as written.
        #[test]
        fn prop_metadata_is_read_back(unit in "[a-z&<>/0-9]{1,8}", description in "[ -~]{0,40}") {
            let description = Cow::<str>::Owned(description.trim().to_owned());
            let codes = Values::Codes { description: description.clone() };
            prop_assert_eq!(&Values::of_metadata(&codes.metadata()), &codes);
            prop_assume!(!METRES.contains(&unit.as_str()) || unit == "m" && !description.is_empty());
            let quantity = Values::Quantity { unit: unit.into(), description };
            prop_assert_eq!(&Values::of_metadata(&quantity.metadata()), &quantity);
        }

        /// Whatever the items of a file say, also damaged and in any order: what is read of them is written and read back the same.
        #[test]
        fn prop_any_items_are_read(
            start in "\\PC{0,20}",
            all in prop::collection::vec(
                (
                    "(sample=\"0\"|role=\"unittype\"|role=\"description\"|name=\"VALUES\"| |>){0,4}",
                    "(codes|m|ft|\\PC{0,8})",
                ),
                0..4,
            ),
        ) {
            let text: String = all.iter().map(|(attributes, value)| format!("<Item {attributes}>{value}</Item>")).collect();
            let found = Values::of_metadata(&format!("{start}{text}"));
            prop_assert_eq!(&Values::of_metadata(&found.metadata()), &found);
        }
    }
}
