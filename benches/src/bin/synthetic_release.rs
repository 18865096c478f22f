//! Writes a release with a number of synthetic missions: `synthetic_release DEST MISSIONS [--paired] [--variants K] [--textures]`.

use sastrugi_tests::synthetic::{Shape, release};
use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "usage: synthetic_release DEST MISSIONS [--paired] [--variants K] [--textures]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let made = match arguments.as_slice() {
        [dest, missions, options @ ..] => {
            shape(missions, options).and_then(|shape| release(Path::new(dest), &shape).map_err(|e| e.to_string()))
        }
        _ => Err(USAGE.to_owned()),
    };
    match made {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn shape(missions: &str, options: &[String]) -> Result<Shape, String> {
    let number =
        |text: &str, what: &str| text.parse::<usize>().map_err(|_| format!("\"{text}\" is not a number of {what}"));
    let mut shape = Shape::of_missions(number(missions, "missions")?);
    let mut rest = options.iter().map(String::as_str);
    while let Some(option) = rest.next() {
        match option {
            "--paired" => shape.is_paired = true,
            "--textures" => shape.has_textures = true,
            "--variants" => shape.variants = number(rest.next().ok_or(USAGE)?, "variants")?,
            _ => return Err(USAGE.to_owned()),
        }
    }
    Ok(shape)
}
