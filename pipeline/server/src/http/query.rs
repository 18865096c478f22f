//! Query parameters: each must be known, and each is checked.

use super::problem::{Problem, shortened};
use std::collections::BTreeMap;
use std::str::FromStr;

/// The query parameters of one request.
#[derive(Clone, Debug, Default)]
pub struct Query(BTreeMap<String, String>);

/// Largest coordinate that is accepted, m.
const FARTHEST_M: f64 = 1e15;

impl Query {
    /// Parameters from the pairs of a query string; `known` are the names that the route takes.
    ///
    /// # Errors
    /// A name that is unknown or repeated.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_server::http::Query;
    ///
    /// let pairs = |text: &str| vec![("resolution_m".to_owned(), text.to_owned())];
    /// let query = Query::new(pairs("0.02"), &["resolution_m", "size"]).unwrap();
    /// assert_eq!(query.number("resolution_m", [1e-6, 1e9]).unwrap(), Some(0.02));
    /// assert_eq!(query.pair("size").unwrap(), None);
    /// // The detail of a refusal states what would be accepted.
    /// let refused = Query::new(pairs("0.02"), &["size"]).unwrap_err();
    /// assert_eq!(refused.detail(), "unknown parameter `resolution_m`; this path takes size");
    /// ```
    pub fn new(pairs: Vec<(String, String)>, known: &[&str]) -> Result<Self, Problem> {
        let mut all = BTreeMap::new();
        for (name, value) in pairs {
            if name == TOKEN {
                continue;
            }
            if !known.contains(&name.as_str()) {
                let names = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let shown = shortened(&name);
                return Err(Problem::bad_request(format!("unknown parameter `{shown}`; this path takes {names}")));
            }
            if all.contains_key(&name) {
                return Err(Problem::bad_request(format!("the parameter `{name}` is given more than once")));
            }
            all.insert(name, value);
        }
        Ok(Self(all))
    }

    /// A parameter as text.
    pub fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    /// A parameter that is one of several words.
    ///
    /// # Errors
    /// Any other word.
    pub fn word<'a>(&self, name: &str, words: &[&'a str], default: &'a str) -> Result<&'a str, Problem> {
        let Some(text) = self.text(name) else { return Ok(default) };
        let found = words.iter().find(|w| **w == text);
        found.copied().ok_or_else(|| refused(name, text, &format!("one of {}", words.join(", "))))
    }

    /// A finite number within bounds.
    ///
    /// # Errors
    /// Text that is not a finite number within bounds.
    pub fn number(&self, name: &str, [low, high]: [f64; 2]) -> Result<Option<f64>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let value = real(text).filter(|v| (low..=high).contains(v));
        value.map(Some).ok_or_else(|| refused(name, text, &format!("a number from {low} to {high}")))
    }

    /// A required number.
    ///
    /// # Errors
    /// It is missing or out of bounds.
    pub fn number_of(&self, name: &str, bounds: [f64; 2]) -> Result<f64, Problem> {
        self.number(name, bounds)?.ok_or_else(|| missing(name))
    }

    /// An integer within bounds.
    ///
    /// # Errors
    /// Text that is not an integer within bounds.
    pub fn whole(&self, name: &str, [low, high]: [u32; 2]) -> Result<Option<u32>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let value = u32::from_str(text).ok().filter(|v| (low..=high).contains(v));
        value.map(Some).ok_or_else(|| refused(name, text, &format!("an integer from {low} to {high}")))
    }

    /// A position or a size, `a,b`.
    ///
    /// # Errors
    /// Text that is not two finite numbers.
    pub fn pair(&self, name: &str) -> Result<Option<[f64; 2]>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        place(text).map(Some).ok_or_else(|| {
            refused(name, text, &format!("two numbers from -{FARTHEST_M:e} to {FARTHEST_M:e}, such as `12.5,-3`"))
        })
    }

    /// Positions along a line, `x,y;x,y;...`.
    ///
    /// # Errors
    /// Fewer than two positions, more than `most`, or text that is not positions.
    pub fn line(&self, name: &str, most: usize) -> Result<Vec<[f64; 2]>, Problem> {
        let text = self.text(name).ok_or_else(|| missing(name))?;
        let places: Option<Vec<[f64; 2]>> = text.split(';').map(place).collect();
        places.filter(|p| (2..=most).contains(&p.len())).ok_or_else(|| {
            refused(
                name,
                text,
                &format!("2 to {most} positions from -{FARTHEST_M:e} to {FARTHEST_M:e}, such as `0,0;10,5`"),
            )
        })
    }

    /// Integers, `1,3`; empty text gives an empty list.
    ///
    /// # Errors
    /// Text that is not integers.
    pub fn numbers(&self, name: &str) -> Result<Option<Vec<usize>>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let parts = text.split(',').filter(|part| !part.is_empty());
        let numbers: Result<Vec<usize>, _> = parts.map(usize::from_str).collect();
        numbers.map(Some).map_err(|_| refused(name, text, "integers, such as `1,3`"))
    }
}

/// Name of the parameter that carries the token for images, whose requests cannot carry a header.
pub const TOKEN: &str = "token";

/// A number; -0 is 0, so that the same request has the same tag.
fn real(text: &str) -> Option<f64> {
    f64::from_str(text).ok().map(|value| value + 0.0)
}

fn place(text: &str) -> Option<[f64; 2]> {
    let (a, b) = text.split_once(',')?;
    let number = |text: &str| real(text.trim()).filter(|v| v.abs() <= FARTHEST_M);
    Some([number(a)?, number(b)?])
}

fn missing(name: &str) -> Problem {
    Problem::bad_request(format!("the parameter `{name}` is missing"))
}

fn refused(name: &str, text: &str, right: &str) -> Problem {
    let shown = shortened(text);
    Problem::bad_request(format!("`{name}`: \"{shown}\" is not valid; it must be {right}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn query(pairs: &[(&str, &str)]) -> Result<Query, Problem> {
        Query::new(pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect(), &["x", "size", "line", "n"])
    }

    #[test]
    fn val_parameters_are_read_and_wrong_ones_are_named() {
        let q = query(&[("x", "2.5"), ("size", "3,4"), ("line", "0,0;1,2;3,4"), ("token", "secret")]).unwrap();
        assert_eq!(q.number("x", [0.0, 3.0]).unwrap(), Some(2.5));
        assert_eq!(q.number_of("x", [0.0, 3.0]).unwrap(), 2.5);
        assert!(q.number_of("n", [0.0, 3.0]).unwrap_err().detail().contains("missing"));
        assert_eq!(q.pair("size").unwrap(), Some([3.0, 4.0]));
        assert_eq!(q.line("line", 3).unwrap().len(), 3);
        assert!(q.line("line", 2).is_err());
        for (name, text) in [("x", "nan"), ("x", "4"), ("x", "inf"), ("x", "1e400"), ("x", "")] {
            let problem = query(&[(name, text)]).unwrap().number(name, [0.0, 3.0]).unwrap_err();
            assert!(problem.detail().contains("`x`"), "{}", problem.detail());
        }
        assert!(query(&[("y", "1")]).is_err() && query(&[("x", "1"), ("x", "1")]).is_err());
        assert!(query(&[("size", "1,2,3")]).unwrap().pair("size").is_err());
        assert_eq!(query(&[("n", "")]).unwrap().numbers("n").unwrap(), Some(vec![]));
        let zero = query(&[("x", "-0"), ("size", "-0.0,-0")]).unwrap();
        let shown = format!("{:?} {:?}", zero.number("x", [-1.0, 1.0]).unwrap(), zero.pair("size").unwrap());
        assert_eq!(shown, "Some(0.0) Some([0.0, 0.0])");
    }

    fn refusal<T: std::fmt::Debug>(result: Result<T, Problem>) -> String {
        result.unwrap_err().detail().to_owned()
    }

    #[test]
    fn val_words_and_integers_are_read() {
        let q = |text: &str| query(&[("n", text)]).unwrap();
        assert_eq!(q("mean").word("n", &["point", "mean"], "point").unwrap(), "mean");
        assert_eq!(query(&[]).unwrap().word("n", &["point", "mean"], "point").unwrap(), "point");
        assert_eq!(
            refusal(q("Mean").word("n", &["point", "mean"], "point")),
            "`n`: \"Mean\" is not valid; it must be one of point, mean"
        );
        assert_eq!([q("0"), q("12")].map(|q| q.whole("n", [0, 12]).unwrap()), [Some(0), Some(12)]);
        for text in ["13", "-1", "1.5", "", "4294967296"] {
            assert!(refusal(q(text).whole("n", [0, 12])).contains("an integer from 0 to 12"), "{text}");
        }
        assert_eq!(q("1,3").numbers("n").unwrap(), Some(vec![1, 3]));
        assert!(q("1,-3").numbers("n").is_err() && q("1;3").numbers("n").is_err());
    }

    /// Both ends of a range are accepted, and positions up to 1e15.
    #[test]
    fn val_limits_are_inclusive() {
        let x = |text: &str| query(&[("x", text)]).unwrap().number("x", [-1.0, 3.0]).is_ok();
        assert_eq!(["-1", "3", "3.0000001", "-1.0000001"].map(x), [true, true, false, false]);
        let size = |text: &str| query(&[("size", text)]).unwrap().pair("size").is_ok();
        assert_eq!(["1e15,-1e15", "1.1e15,0", "0,nan", "1", ""].map(size), [true, false, false, false, false]);
        let line = |text: &str| query(&[("line", text)]).unwrap().line("line", 3).is_ok();
        assert_eq!(["0,0", "0,0;1,1", "0,0;1,1;2,2;3,3", "0,0;;1,1"].map(line), [false, true, false, false]);
        assert_eq!(refusal(query(&[]).unwrap().line("line", 3)), "the parameter `line` is missing");
    }

    /// The detail repeats at most 60 characters of what was sent.
    #[test]
    fn val_long_texts_are_shortened() {
        let text = "9".repeat(1000);
        let said = refusal(query(&[("x", text.as_str())]).unwrap().whole("x", [0, 1]));
        assert!(said.starts_with(&format!("`x`: \"{}\" is not valid", "9".repeat(60))), "{said}");
        let said = refusal(query(&[(text.as_str(), "1")]));
        assert!(said.starts_with(&format!("unknown parameter `{}`;", "9".repeat(60))), "{said}");
    }
}
