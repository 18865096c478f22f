//! Parameters of a request: each known by name, each checked.

use super::problem::Problem;
use std::collections::BTreeMap;
use std::str::FromStr;

/// The parameters of one request.
#[derive(Clone, Debug, Default)]
pub struct Query(BTreeMap<String, String>);

/// Farthest place that is understood, m.
const FARTHEST_M: f64 = 1e15;

impl Query {
    /// From the pairs of an address; `known` are the names that the path takes.
    ///
    /// # Errors
    /// A name that is not known, or stands twice.
    pub fn new(pairs: Vec<(String, String)>, known: &[&str]) -> Result<Self, Problem> {
        let mut all = BTreeMap::new();
        for (name, value) in pairs {
            if name == TOKEN {
                continue;
            }
            if !known.contains(&name.as_str()) {
                let names = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                return Err(Problem::bad_request(format!("`{name}`: unknown parameter; this path takes {names}")));
            }
            if all.contains_key(&name) {
                return Err(Problem::bad_request(format!("the parameter `{name}` is given more than once")));
            }
            all.insert(name, value);
        }
        Ok(Self(all))
    }

    /// Text of a parameter.
    pub fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    /// One of several words.
    ///
    /// # Errors
    /// Another word.
    pub fn word<'a>(&self, name: &str, words: &[&'a str], default: &'a str) -> Result<&'a str, Problem> {
        let Some(text) = self.text(name) else { return Ok(default) };
        let found = words.iter().find(|w| **w == text);
        found.copied().ok_or_else(|| refused(name, text, &format!("one of {}", words.join(", "))))
    }

    /// A finite number within bounds.
    ///
    /// # Errors
    /// Text that is not such a number.
    pub fn number(&self, name: &str, [low, high]: [f64; 2]) -> Result<Option<f64>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let value = f64::from_str(text).ok().filter(|v| (low..=high).contains(v));
        value.map(Some).ok_or_else(|| refused(name, text, &format!("a number from {low} to {high}")))
    }

    /// A number that must be there.
    ///
    /// # Errors
    /// It is missing, or not within bounds.
    pub fn number_of(&self, name: &str, bounds: [f64; 2]) -> Result<f64, Problem> {
        self.number(name, bounds)?.ok_or_else(|| missing(name))
    }

    /// A whole number within bounds.
    ///
    /// # Errors
    /// Text that is not such a number.
    pub fn whole(&self, name: &str, [low, high]: [u32; 2]) -> Result<Option<u32>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let value = u32::from_str(text).ok().filter(|v| (low..=high).contains(v));
        value.map(Some).ok_or_else(|| refused(name, text, &format!("a whole number from {low} to {high}")))
    }

    /// A place or size, `a,b`.
    ///
    /// # Errors
    /// Text that is not two finite numbers.
    pub fn pair(&self, name: &str) -> Result<Option<[f64; 2]>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        place(text).map(Some).ok_or_else(|| {
            refused(name, text, &format!("two numbers from -{FARTHEST_M:e} to {FARTHEST_M:e}, as `12.5,-3`"))
        })
    }

    /// Places along a line, `x,y;x,y;...`.
    ///
    /// # Errors
    /// Fewer than two places, or text that is not places.
    pub fn line(&self, name: &str, most: usize) -> Result<Vec<[f64; 2]>, Problem> {
        let text = self.text(name).ok_or_else(|| missing(name))?;
        let places: Option<Vec<[f64; 2]>> = text.split(';').map(place).collect();
        places.filter(|p| (2..=most).contains(&p.len())).ok_or_else(|| {
            refused(name, text, &format!("2 to {most} places from -{FARTHEST_M:e} to {FARTHEST_M:e}, as `0,0;10,5`"))
        })
    }

    /// Whole numbers, `1,3`; an empty text has none.
    ///
    /// # Errors
    /// Text that is not whole numbers.
    pub fn numbers(&self, name: &str) -> Result<Option<Vec<usize>>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let parts = text.split(',').filter(|part| !part.is_empty());
        let numbers: Result<Vec<usize>, _> = parts.map(usize::from_str).collect();
        numbers.map(Some).map_err(|_| refused(name, text, "whole numbers, as `1,3`"))
    }
}

/// Name of the parameter that carries the token of pictures, which cannot carry a header.
pub const TOKEN: &str = "token";

fn place(text: &str) -> Option<[f64; 2]> {
    let (a, b) = text.split_once(',')?;
    let number = |text: &str| f64::from_str(text.trim()).ok().filter(|v| v.abs() <= FARTHEST_M);
    Some([number(a)?, number(b)?])
}

fn missing(name: &str) -> Problem {
    Problem::bad_request(format!("the parameter `{name}` is missing"))
}

fn refused(name: &str, text: &str, right: &str) -> Problem {
    let shown: String = text.chars().take(60).collect();
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
    }
}
