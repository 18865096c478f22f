//! Checks ORCID iDs: sixteen characters in groups of four, the last one a checksum (ISO 7064, MOD 11-2), as described in
//! <https://support.orcid.org/hc/en-us/articles/360006897674>.

/// Refuses what is not an ORCID iD.
///
/// # Errors
/// The problem, as the end of a sentence "... is ".
pub fn check(orcid: &str) -> Result<(), String> {
    let form = "it must be a plain ORCID iD such as 0000-0002-1825-0097, without https://orcid.org/";
    let Some((digits, last)) = parts(orcid) else { return Err(format!("\"{orcid}\"; {form}")) };
    let right = check_character(&digits);
    match last == right {
        true => Ok(()),
        false => Err(format!(
            "\"{orcid}\", whose checksum is wrong (the last character should be {right}): check for a mistyped digit"
        )),
    }
}

/// The first fifteen digits, and the last character.
fn parts(orcid: &str) -> Option<(Vec<u32>, char)> {
    let groups: Vec<&str> = orcid.split('-').collect();
    let has_shape = groups.len() == 4 && groups.iter().all(|group| group.len() == 4);
    let mut characters: Vec<char> = groups.concat().chars().collect();
    let last = characters.pop().filter(|last| has_shape && (last.is_ascii_digit() || *last == 'X'))?;
    let digits: Option<Vec<u32>> = characters.into_iter().map(|c| c.to_digit(10)).collect();
    Some((digits?, last))
}

/// The checksum of the first fifteen digits.
fn check_character(digits: &[u32]) -> char {
    let total = digits.iter().fold(0, |total, digit| (total + digit) * 2 % 11);
    match (12 - total) % 11 {
        10 => 'X',
        value => char::from_digit(value, 10).unwrap_or('X'),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Examples from ORCID's own pages (Josiah Carberry, Stephen Hawking, Laure Haak), and invalid variants.
    #[test]
    fn val_checksums_are_those_of_orcid() {
        for right in ["0000-0002-1825-0097", "0000-0002-9079-593X", "0000-0001-5109-3700", "0000-0002-1694-233X"] {
            assert_eq!(check(right), Ok(()));
        }
        let wrong = check("0000-0002-1825-0079").unwrap_err();
        assert!(wrong.contains("checksum is wrong") && wrong.contains("the last character should be"), "{wrong}");
        for other in [
            "",
            "0000-0002-1825-009",
            "0000000218250097",
            "https://orcid.org/0000-0002-1825-0097",
            "0000-0002-1825-009x",
            "000X-0002-1825-0097",
            "0000-0002-18é-0097",
        ] {
            let error = check(other).unwrap_err();
            assert!(error.contains("without https://orcid.org/"), "{other}: {error}");
        }
    }
}
