//! `convert --for lerobot`.

use super::reading;
use crate::Verdict;
use crate::args::{Common, Compress, Convert};
use crate::failure::{Code, Failure};
use crate::output::print;
use sastrugi_schemas::counted;
use sastrugi_stages::verbs::Reading;
use sastrugi_stages::verbs::lerobot::{self, PATCH_CELL_M, PATCH_M, Settings};
use serde_json::{Value, json};

/// The missions of a release as a LeRobot dataset.
pub fn convert(args: &Convert, common: &Common) -> Verdict {
    check_others(args)?;
    let patch = lerobot::patch(args.patch.unwrap_or(PATCH_M), args.patch_cell.unwrap_or(PATCH_CELL_M))?;
    let settings = Settings { patch, traverses: args.traverse.iter().cloned().collect() };
    let converted = lerobot::convert(&args.input, &args.output, &settings)?;
    let named = |(split, range): (&String, &Value)| format!("{split} {}", range.as_str().unwrap_or_default());
    let splits: Vec<String> = converted.splits.iter().map(named).collect();
    let mut text = format!(
        "{}: {}, {} at {} Hz, {}; episodes of {}",
        args.output.display(),
        counted(converted.episodes, "episode"),
        counted(converted.frames, "frame"),
        converted.fps,
        counted(converted.tasks.len(), "task"),
        splits.join(", ")
    );
    converted.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    print(common.json, &json!(converted), &text)?;
    Ok(Code::Done)
}

/// Refuses the options of other conversions.
fn check_others(args: &Convert) -> Result<(), Failure> {
    let of_mesh = args.max_error.is_some() || args.triangles.is_some();
    let of_dem = args.crop || args.window.is_some() || !args.masks.all().is_empty() || args.surface.is_some();
    let of_file = args.writing.cog || args.writing.compress != Compress::default();
    if of_mesh || of_dem || of_file || reading(&args.reading)? != Reading::default() {
        let message = "the only options for lerobot are --patch, --patch-cell and --traverse";
        return Err(Failure::usage(format!("{}: {message}", args.output.display())));
    }
    Ok(())
}

/// Refuses the options for LeRobot with other conversions.
pub fn check_unused(args: &Convert) -> Result<(), Failure> {
    if args.patch.is_none() && args.patch_cell.is_none() && args.traverse.is_empty() {
        return Ok(());
    }
    let message = "--patch, --patch-cell and --traverse apply to --for lerobot only";
    Err(Failure::usage(format!("{}: {message}", args.output.display())))
}
